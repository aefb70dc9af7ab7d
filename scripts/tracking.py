"""What PyBullet's time step makes of a machine's motion, and what plans with one limit for a whole machine cost.

    python scripts/tracking.py steps [--machine picker --machine hoe]
    python scripts/tracking.py closure [--repeats 5]
    python scripts/tracking.py limits

``steps`` prints how far tools are from their commands and pinned points from each other on one fast motion a machine,
by steps a second. ``closure`` runs the picker's fastest gate with other steps, sweeps of the solver, shares of the
closures' error that a step takes back, and a part of the tool's mass on the forearms' ends, and prints the CPU time of
a run as well. ``limits`` prints how much longer a set of motions takes under one limit for the whole machine than each
under its motors' own, where motors are weak.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from rich.table import Table

from fieldgym.envs.motors import PLANNED, Motions
from fieldgym.envs.sorting import motors as sorting
from fieldgym.envs.sorting.config import SortingConfig
from fieldgym.envs.transplanting import motors as transplanting
from fieldgym.envs.transplanting.config import TransplantingConfig
from fieldgym.kernels.config import override
from fieldgym.motion import QUINTIC, Gate
from fieldgym.motion.efforts import duration_under_efforts
from fieldgym.simulation.assembly import Assembly, picker_assembly
from fieldgym.simulation.client import PhysicsClient
from fieldgym.simulation.closed_loop import Body, ClosedLoopMachine
from fieldgym.simulation.hoe import HoeMachine
from fieldgym.simulation.hoe_model import HoeParameters
from fieldgym.simulation.machine import urdf_file
from fieldgym.simulation.picker import PickerMachine, PickerResult, fastest_gate
from fieldgym.simulation.picker import measure_tracking as picker_tracking
from fieldgym.simulation.picker_model import JOINTS, ORANGE, PickerParameters
from fieldgym.simulation.sorter import SorterMachine
from fieldgym.simulation.sorter_model import SorterParameters
from fieldgym.simulation.transplanter import measure_tracking as transplanter_tracking
from fieldgym.simulation.transplanter_model import TransplanterParameters
from fieldgym.simulation.urdf import Joint, Link, Part, Sphere
from fieldgym.simulation.weeder import WeederMachine
from fieldgym.simulation.weeder_model import WeederParameters

STROKE_M, SPEED_M_S, ACCELERATION_M_S2 = 0.15, 1.0, 10.0
"""Of the motion that sorter, hoe and weeder make: sideways, in the middle of their reach."""
PAYLOAD_KG = 0.3


class Gaps(NamedTuple):
    """Largest distances over a motion, metres: of a tool from its command, of pinned points from each other."""

    tracking_m: float
    closure_m: float


def stroke(physics_hz: float) -> Any:
    """Places (n,) along a stroke about 0."""
    duration_s = float(QUINTIC.duration(STROKE_M, SPEED_M_S, ACCELERATION_M_S2))
    at = np.arange(int(np.ceil(duration_s * physics_hz)) + 1) / physics_hz
    return QUINTIC.sample(at, STROKE_M, duration_s).position - 0.5 * STROKE_M


def picker(physics_hz: float) -> Gaps:
    """The fastest gate, with the cart."""
    report = picker_tracking(PickerParameters(physics_hz=physics_hz))
    return Gaps(report.arm_error_m, report.closure_error_m)


def transplanter(physics_hz: float) -> Gaps:
    """The whole window, with the published payload."""
    gate = Gate("stop-quintic", 4.5, 60.0)
    report = transplanter_tracking(gate, TransplanterParameters(physics_hz=physics_hz), PAYLOAD_KG)
    return Gaps(report.tracking_error_m, report.closure_error_m)


def prrs(machine: Callable[[Any], Any], parameters: Any, physics_hz: float) -> Gaps:
    """A stroke of a 3-PRRS."""
    numbers = replace(parameters, physics_hz=physics_hz)
    places = stroke(physics_hz)
    poses = np.tile(numbers.mechanism.home_pose, (len(places), 1))
    poses[:, 0] += places
    with machine(numbers) as made:
        made.reset(poses[0])
        report = made.run(poses, measure=True)
    return Gaps(report.position_error_m, report.closure_error_m)


def weeder(physics_hz: float) -> Gaps:
    """A stroke of the platform along the row under a cart that stands."""
    numbers = WeederParameters(physics_hz=physics_hz)
    places = stroke(physics_hz)
    poses = np.tile(numbers.mechanism.home_pose, (len(places), 1))
    poses[:, 0] += places
    carts, far_m = np.zeros(len(places)), [0.0]
    with WeederMachine(numbers) as made:
        made.reset(0.0, poses[0])
        report = made.run(
            carts,
            poses,
            look=np.ones(len(places), bool),
            on_step=lambda row: far_m.append(made._astray_m(0.0, poses[row])),
        )
    return Gaps(max(far_m), report.closure_error_m)


MACHINES: dict[str, tuple[Callable[[float], Gaps], tuple[float, ...], float]] = {
    "picker": (picker, (60.0, 96.0, 120.0, 240.0, 480.0, 960.0), PickerParameters().physics_hz),
    "transplanter": (transplanter, (250.0, 500.0, 1000.0, 2000.0), TransplanterParameters().physics_hz),
    "sorter": (
        partial(prrs, SorterMachine, SorterParameters()),
        (60.0, 120.0, 240.0, 480.0, 960.0),
        SorterParameters().physics_hz,
    ),
    "hoe": (
        partial(prrs, HoeMachine, HoeParameters()),
        (60.0, 120.0, 240.0, 480.0, 960.0),
        HoeParameters().physics_hz,
    ),
    "weeder": (weeder, (60.0, 120.0, 240.0, 480.0, 960.0), WeederParameters().physics_hz),
}
"""What measures a machine, steps a second to try, and those that environments simulate with."""


def steps(options: argparse.Namespace) -> Table:
    """Tracking and closure by the time step; a star marks what environments simulate with."""
    table = Table("machine", "steps a second", "tracking mm", "closure mm")
    for name in options.machine or MACHINES:
        measure, rates, shipped = MACHINES[name]
        for rate in rates:
            found = measure(rate)
            star = "*" if rate == shipped else ""
            table.add_row(name, f"{rate:g}{star}", f"{1e3 * found.tracking_m:.3f}", f"{1e3 * found.closure_m:.3f}")
    return table


class Variant(NamedTuple):
    """How the picker's closures may be simulated.

    Attributes:
        physics_hz: steps a second.
        sweeps: of the solver in a step.
        share: of a closure's error that a step takes back.
        on_wrists: share of the tool's mass that stands on the forearms' ends.
    """

    physics_hz: float
    sweeps: int
    share: float
    on_wrists: float = 0.0


SHIPPED = Variant(96.0, 60, 0.8)
VARIANTS = (
    SHIPPED,
    Variant(96.0, 60, 0.4),
    Variant(96.0, 60, 0.9),
    Variant(96.0, 60, 1.0),
    Variant(96.0, 120, 1.0),
    Variant(96.0, 500, 1.0),
    Variant(96.0, 60, 1.0, 0.4),
    Variant(120.0, 48, 1.0),
    Variant(192.0, 30, 1.0),
    Variant(240.0, 60, 0.8),
    Variant(240.0, 60, 1.0),
    Variant(240.0, 60, 1.0, 0.4),
    Variant(240.0, 500, 1.0),
)


def with_wrists(parameters: PickerParameters, share: float) -> Assembly:
    """The picker with a share of its tool's mass on the forearms' ends; the level platform never turns."""
    if share == 0.0:
        return picker_assembly(parameters)
    lighter = replace(parameters, tool_mass_kg=(1.0 - share) * parameters.tool_mass_kg)
    assembly = picker_assembly(lighter)
    (placed,) = assembly.parts
    ball = (Part(Sphere(0.01), ORANGE),)
    wrists = [Link(f"wrist{leg}", 0.5 * share * parameters.tool_mass_kg, ball) for leg in (1, 2)]
    ends = [(0.0, length, 0.0) for length in parameters.five_bar.forearm_m]
    joints = [Joint(f"wrist{leg}", "fixed", f"forearm{leg}", f"wrist{leg}", ends[leg - 1]) for leg in (1, 2)]
    robot = replace(placed.robot, links=(*placed.robot.links, *wrists), joints=(*placed.robot.joints, *joints))
    return replace(assembly, parts=(replace(placed, robot=robot),))


class Varied(PickerMachine):
    """The picker as a variant has it."""

    def __init__(self, variant: Variant):
        """Build it in a world of its own."""
        self.variant = variant
        world = PhysicsClient(variant.physics_hz, solver_iterations=variant.sweeps, erp=variant.share)
        super().__init__(PickerParameters(physics_hz=variant.physics_hz), world)

    def _build(self) -> None:
        assembly = with_wrists(self.parameters, self.variant.on_wrists)
        (part,) = assembly.parts
        with urdf_file(None, part.robot.to_xml) as path:
            self._machine = ClosedLoopMachine(self.client, [Body(part.name, path)], assembly.closures, assembly.motors)
        self._order = [JOINTS.index(name) for name in self._machine.joints]


def run(variant: Variant, measure: bool) -> tuple[PickerResult, float]:
    """The fastest gate, and the CPU seconds that driving took."""
    machine = Varied(variant)
    try:
        cart, tool = fastest_gate(machine.parameters)
        machine.reset(cart[0], tool[0])
        start = time.thread_time()
        report = machine.run(cart, tool, measure=measure)
        return report, time.thread_time() - start
    finally:
        machine.client.close()


def closure(options: argparse.Namespace) -> Table:
    """Whether the picker's closures can be better at no cost."""
    table = Table("steps a second", "sweeps", "share", "mass on wrists", "tracking mm", "closure mm", "ms")
    for variant in VARIANTS:
        report, _ = run(variant, True)
        best_s = min(run(variant, False)[1] for _ in range(options.repeats))
        table.add_row(
            f"{variant.physics_hz:g}{'*' if variant == SHIPPED else ''}",
            f"{variant.sweeps}",
            f"{variant.share:g}",
            f"{100.0 * variant.on_wrists:.0f} %",
            f"{1e3 * report.arm_error_m:.3f}",
            f"{1e3 * report.closure_error_m:.3f}",
            f"{1e3 * best_s:.1f}",
        )
    return table


def _weak() -> Iterator[tuple[str, float, Motions, Motions, Any]]:
    """Machines with weak motors: name, share of the limits, motions before and after the fit, planned efforts."""
    for factor in (0.5, 0.25):
        plain = TransplantingConfig()
        weak = override(plain, {"machine.torque_limit_n_m": factor * plain.machine.torque_limit_n_m})
        plug_kg = plain.process.plug_kg
        before, after = (
            transplanting.stopped(config.machine, plug_kg) for config in (plain, transplanting.within_motors(weak))
        )
        yield "transplanter", factor, before, after, PLANNED * weak.machine.torque_limit_n_m
    plain, factor = SortingConfig(), 0.25
    motors = plain.machine.sorter.slider_force_limit_n, plain.machine.sorter.swing_torque_limit_n_m
    names = ("machine.sorter.slider_force_limit_n", "machine.sorter.swing_torque_limit_n_m")
    weak = override(plain, {name: factor * limit for name, limit in zip(names, motors, strict=True)})
    item_kg = sorting.heaviest_kg(plain)
    before, after = (
        sorting.motions(config.machine, config.belt.speed_m_s, item_kg)
        for config in (plain, sorting.within_motors(weak))
    )
    yield "sorter", factor, before, after, PLANNED * factor * np.repeat(motors, 3)


def limits(_: argparse.Namespace) -> Table:
    """What one limit for a whole machine costs against each motion's own."""
    table = Table("machine", "motors", "longer %")
    for name, factor, before, after, planned in _weak():
        own_s = np.maximum(before.wanted_s, duration_under_efforts(*before.terms, planned))
        table.add_row(name, f"x{factor:g}", f"{100.0 * (after.wanted_s.sum() / own_s.sum() - 1.0):.1f}")
    return table


COMMANDS = {"steps": steps, "closure": closure, "limits": limits}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=COMMANDS)
    parser.add_argument("--machine", choices=tuple(MACHINES), action="append")
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    if options.repeats < 1:
        parser.error(f"--repeats {options.repeats}: give at least 1")
    Console(width=120).print(COMMANDS[options.what](options))


if __name__ == "__main__":
    main()
