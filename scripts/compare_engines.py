"""Run random motions of every machine in MuJoCo and set them beside the closed form and PyBullet.

    python scripts/compare_engines.py [--machines picker,weeder] [--motions 20] [--write FOLDER]

Both engines simulate the same trees, masses, pinned points and motor limits, far more finely than environments do:
what is compared is the machines, not the time steps. Motions are quintic, rest to rest between random poses, at the
limits of speed and acceleration that the environments have. A motion arrives when the tool has come within half a
millimetre of its end for good. ``--write`` saves the machines as MJCF.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from fieldgym.motion import QUINTIC
from fieldgym.motion.orientation import angle_between, euler_angles, from_euler, slerp, tilted
from fieldgym.simulation.assembly import (
    Assembly,
    picker_assembly,
    prrs_assembly,
    transplanter_assembly,
    weeder_assembly,
)
from fieldgym.simulation.hoe import HoeMachine
from fieldgym.simulation.hoe_model import HoeParameters
from fieldgym.simulation.mjcf import to_mjcf
from fieldgym.simulation.picker import PickerMachine
from fieldgym.simulation.picker_model import JOINTS as PICKER_JOINTS
from fieldgym.simulation.picker_model import PickerParameters, picker_joints
from fieldgym.simulation.prrs import MOTORS, SWINGS
from fieldgym.simulation.sorter import SorterMachine
from fieldgym.simulation.sorter_model import SorterParameters
from fieldgym.simulation.transplanter import TransplanterMachine
from fieldgym.simulation.transplanter_model import JOINTS as TRANSPLANTER_JOINTS
from fieldgym.simulation.transplanter_model import TransplanterParameters, transplanter_joints
from fieldgym.simulation.weeder import WeederMachine
from fieldgym.simulation.weeder_model import JOINTS as WEEDER_JOINTS
from fieldgym.simulation.weeder_model import WeederParameters, weeder_joints

Array = NDArray[np.float64]

PYBULLET_HZ, FINER = 960.0, 8
"""Steps a second in PyBullet, and steps of MuJoCo in one of them."""
SETTLING_S = 0.1
"""Rest before a motion, in which the closures take up the weight, and after it."""
ARRIVED_M = 5e-4


@dataclass(frozen=True)
class Motion:
    """A motion sampled at MuJoCo's rate, with rests before and after.

    Attributes:
        joints: (n, all joints), active and passive, by the closed form.
        tool: (n, 3), the tool's place in the world by the closed form, metres.
        free: position (3,) and quaternion (w, x, y, z) at its begin of a free platform, or None.
    """

    joints: Array
    tool: Array
    free: tuple[Array, Array] | None = None


@dataclass(frozen=True)
class Case:
    """A machine with its motions.

    Attributes:
        machine: class of the machine in PyBullet.
        parameters: at ``PYBULLET_HZ``.
        assembly: of them.
        names: of the joints in a motion's columns.
        draw: a random motion.
    """

    machine: Callable[[Any], Any]
    parameters: Any
    assembly: Assembly
    names: tuple[str, ...]
    draw: Callable[[np.random.Generator], Motion]


@dataclass(frozen=True)
class Outcome:
    """Largest differences over the motions of a machine.

    Attributes:
        loop_m: between two points that are pinned together in MuJoCo.
        path_m: of the tool in MuJoCo from the closed form.
        engines_m: of the tool in MuJoCo from the tool in PyBullet.
        cycle: of the summed times until the tools arrive, MuJoCo's from the closed form's, as a share.
        effort: of a motor's peak effort in a motion, MuJoCo's from PyBullet's, as a share of the larger one.
    """

    loop_m: float
    path_m: float
    engines_m: float
    cycle: float
    effort: float


def _shares(duration_s: float) -> Array:
    """Share of the way, (n,), at MuJoCo's rate, between two rests; whole steps of PyBullet."""
    steps = int(np.ceil(duration_s * PYBULLET_HZ)) * FINER
    rest = int(SETTLING_S * PYBULLET_HZ) * FINER
    time = np.clip(np.arange(-rest, steps + rest + 1), 0, None) / (PYBULLET_HZ * FINER)
    return QUINTIC.sample(np.minimum(time, duration_s), 1.0, duration_s).position


def _picker() -> Case:
    p = PickerParameters(physics_hz=PYBULLET_HZ)
    bar = p.five_bar

    def draw(rng: np.random.Generator) -> Motion:
        while True:
            start, end = rng.uniform((0.1, -0.55), (0.48, -0.28), (2, 2))
            if bar.reachable(np.linspace(start, end, 20)).all():
                break
        arm = QUINTIC.duration(np.linalg.norm(end - start), p.tool_velocity_m_s, p.tool_acceleration_m_s2)
        way = rng.uniform(0.05, 0.3)
        drive = QUINTIC.duration(way, p.cart_velocity_m_s, p.cart_acceleration_m_s2)
        s = _shares(max(float(arm), float(drive)))
        tool, cart = start + s[:, None] * (end - start), way * s
        world = np.column_stack([cart, tool[:, 0] - 0.5 * bar.base_m, p.motor_height_m + tool[:, 1]])
        return Motion(picker_joints(p, cart, tool), world)

    return Case(PickerMachine, p, picker_assembly(p), PICKER_JOINTS, draw)


def _transplanter() -> Case:
    p = TransplanterParameters(physics_hz=PYBULLET_HZ)

    def draw(rng: np.random.Generator) -> Motion:
        start, end = rng.uniform(*p.arm.window_m, (2, 2))
        s = _shares(float(QUINTIC.duration(np.linalg.norm(end - start), 4.5, 60.0)))
        tool = start + s[:, None] * (end - start)
        world = np.column_stack([np.zeros(len(s)), tool[:, 0], p.motor_height_m + tool[:, 1]])
        return Motion(transplanter_joints(p, tool), world)

    return Case(TransplanterMachine, p, transplanter_assembly(p), TRANSPLANTER_JOINTS, draw)


def _weeder() -> Case:
    p = WeederParameters(physics_hz=PYBULLET_HZ)

    def draw(rng: np.random.Generator) -> Motion:
        start, end = rng.uniform((-0.15, 0.55, -0.23, -0.23), (0.15, 0.62, 0.23, 0.23), (2, 4))
        strokes = np.abs(end - start)
        duration_s = float(QUINTIC.duration(strokes, [1.0, 1.0, 2.4, 2.4], [10.0, 10.0, 21.0, 21.0]).max())
        s = _shares(duration_s)
        pose, cart = start + s[:, None] * (end - start), 0.1 * duration_s * s
        world = np.column_stack([cart + pose[:, 0], np.zeros(len(s)), p.base_height_m - pose[:, 1]])
        return Motion(weeder_joints(p, cart, pose), world)

    return Case(WeederMachine, p, weeder_assembly(p), WEEDER_JOINTS, draw)


def _prrs(machine: Callable[[Any], Any], p: SorterParameters | HoeParameters) -> Case:
    def draw(rng: np.random.Generator) -> Motion:
        while True:
            start, end = rng.uniform((-0.15, -0.15, 0.0), (0.15, 0.15, 0.09), (2, 3))
            first, last = (tilted(rng.uniform(0, 0.3), rng.uniform(0, 6.3), rng.uniform(-0.7, 0.7)) for _ in "ab")
            linear = QUINTIC.duration(np.linalg.norm(end - start), p.velocity_m_s, p.acceleration_m_s2)
            angular = QUINTIC.duration(angle_between(first, last), p.turn_rad_s, p.turn_rad_s2)
            s = _shares(max(float(linear), float(angular)))
            pose = np.concatenate([start + s[:, None] * (end - start), euler_angles(slerp(first, last, s))], axis=1)
            if p.mechanism.reachable(pose).all():
                break
        chains = p.mechanism.chains(pose)
        world = pose[:, :3] + [0.0, 0.0, p.origin_height_m]
        return Motion(np.hstack([chains.joints, chains.swing]), world, (world[0], from_euler(pose[0, 3:])))

    return Case(machine, p, prrs_assembly(p), MOTORS + SWINGS, draw)


CASES: dict[str, Callable[[], Case]] = {
    "picker": _picker,
    "transplanter": _transplanter,
    "sorter": lambda: _prrs(SorterMachine, SorterParameters(physics_hz=PYBULLET_HZ)),
    "hoe": lambda: _prrs(HoeMachine, HoeParameters(physics_hz=PYBULLET_HZ)),
    "weeder": _weeder,
}
"""The machines by name."""


def in_mujoco(case: Case, motions: list[Motion]) -> Iterator[tuple[Array, Array, float]]:
    """Each motion's tool (n, 3), motor efforts (n - 1, motors) and largest gap of a closure, in MuJoCo."""
    import mujoco

    step_s = 1.0 / (PYBULLET_HZ * FINER)
    model: Any = mujoco.MjModel.from_xml_string(to_mjcf(case.assembly, step_s))  # type: ignore[attr-defined]
    data: Any = mujoco.MjData(model)  # type: ignore[attr-defined]
    places = [model.joint(name).qposadr[0] for name in case.names]
    driven = [case.names.index(motor.joint) for motor in case.assembly.motors]
    speeds = [model.joint(motor.joint).dofadr[0] for motor in case.assembly.motors]
    # Stiffness and damping: MuJoCo works the latter out from the inertias.
    stiffness, braking = -model.actuator_biasprm[:, 1], -model.actuator_biasprm[:, 2]
    pins = [(model.site(f"first{k}").id, model.site(f"second{k}").id) for k in range(len(case.assembly.closures))]
    one, two = (list(ends) for ends in zip(*pins, strict=True))
    platform = model.body("platform").id
    for motion in motions:
        mujoco.mj_resetData(model, data)  # type: ignore[attr-defined]
        data.qpos[places] = motion.joints[0]
        if motion.free is not None:
            at = model.joint("platform").qposadr[0]
            data.qpos[at : at + 3], data.qpos[at + 3 : at + 7] = motion.free
        targets = motion.joints[:, driven]
        # As in PyBullet, a step is commanded with the speed that takes it to its end.
        controls = targets[:-1] + braking / stiffness * np.diff(targets, axis=0) / step_s
        tool, efforts, gap = np.empty_like(motion.tool), np.empty((len(targets) - 1, len(driven))), 0.0
        mujoco.mj_forward(model, data)  # type: ignore[attr-defined]
        tool[0] = data.xpos[platform]
        for row in range(1, len(targets)):
            data.ctrl[:] = controls[row - 1]
            before = data.qvel[speeds]
            mujoco.mj_step(model, data)  # type: ignore[attr-defined]
            mujoco.mj_kinematics(model, data)  # type: ignore[attr-defined]
            tool[row] = data.xpos[platform]
            # The integrator takes the damping from the speed at the step's end, the force that it shows does not.
            efforts[row - 1] = data.actuator_force - braking * (data.qvel[speeds] - before)
            gap = max(gap, float(np.linalg.norm(data.site_xpos[one] - data.site_xpos[two], axis=1).max()))
        yield tool, efforts, gap


def in_pybullet(case: Case, motions: list[Motion]) -> Iterator[tuple[Array, Array]]:
    """Each motion's tool (n, 3) and motor efforts (n - 1, motors) in PyBullet, at its own rate."""
    with case.machine(case.parameters) as machine:
        loop = machine._machine
        driven = [case.names.index(motor.joint) for motor in loop.motors]
        order = [case.names.index(name) for name in loop.joints]
        for motion in motions:
            joints = motion.joints[::FINER]
            if motion.free is None:
                loop.reset(joints[0, order])
            else:
                place = np.concatenate([motion.free[0] - machine._origin, euler_angles(motion.free[1])])
                machine.place(place)
            tool, efforts = [loop.point("platform")], []

            def look(row: int, tool: list[Array] = tool, efforts: list[Array] = efforts) -> None:
                tool.append(loop.point("platform"))
                efforts.append(loop.motor_efforts())

            loop.follow(joints[:, driven], look)
            yield np.array(tool), np.array(efforts)


def arrival(tool: Array, step_s: float) -> float:
    """Seconds until a path (n, 3) has come within ``ARRIVED_M`` of its end for good, between two samples."""
    left = np.linalg.norm(tool - tool[-1], axis=1)
    last = int(np.flatnonzero(left > ARRIVED_M)[-1])
    share = (left[last] - ARRIVED_M) / (left[last] - left[last + 1])
    return step_s * (last + float(share))


def compare(name: str, motions: int, seed: int = 0) -> Outcome:
    """Both engines and the closed form over random motions of one machine."""
    case, rng = CASES[name](), np.random.default_rng(seed)
    drawn = [case.draw(rng) for _ in range(motions)]
    step_s, rest = 1.0 / (PYBULLET_HZ * FINER), int(SETTLING_S * PYBULLET_HZ) * FINER
    loop_m = path_m = engines_m = effort = ours_s = theirs_s = 0.0
    for motion, (tool, forces, gap), (other, others) in zip(
        drawn, in_mujoco(case, drawn), in_pybullet(case, drawn), strict=True
    ):
        loop_m = max(loop_m, gap)
        path_m = max(path_m, float(np.linalg.norm(tool - motion.tool, axis=1).max()))
        engines_m = max(engines_m, float(np.linalg.norm(tool[::FINER] - other, axis=1).max()))
        ours_s += arrival(motion.tool, step_s) - step_s * rest
        theirs_s += arrival(tool, step_s) - step_s * rest
        # Half the rest is left to the closures; a motor that hardly works is judged by a hundredth of its limit.
        begin = rest // 2
        peaks = np.abs(forces[begin:]).max(axis=0), np.abs(others[begin // FINER :]).max(axis=0)
        floor = 0.01 * np.array([motor.limit for motor in case.assembly.motors])
        effort = max(effort, float((np.abs(peaks[0] - peaks[1]) / np.maximum(np.maximum(*peaks), floor)).max()))
    return Outcome(loop_m, path_m, engines_m, abs(theirs_s / ours_s - 1.0), effort)


def main(
    machines: Annotated[str, typer.Option(help="Names, with commas between.")] = ",".join(CASES),
    motions: Annotated[int, typer.Option(min=1, help="Random motions a machine.")] = 20,
    seed: Annotated[int, typer.Option(help="Of the motions.")] = 0,
    write: Annotated[Path | None, typer.Option(help="Folder for the machines' MJCF files.")] = None,
) -> None:
    """Set MuJoCo beside the closed form and PyBullet."""
    if find_spec("mujoco") is None:
        raise typer.BadParameter('MuJoCo is not installed: pip install "fieldgym[test]"')
    console = Console()
    table = Table("Machine", "Loop, mm", "Path, mm", "MuJoCo - PyBullet, mm", "Cycle, %", "Peak effort, %")
    for name in machines.split(","):
        if name not in CASES:
            raise typer.BadParameter(f"{name!r} is no machine: choose from {', '.join(CASES)}", param_hint="--machines")
        if write is not None:
            write.mkdir(parents=True, exist_ok=True)
            (write / f"{name}.xml").write_text(
                to_mjcf(CASES[name]().assembly, 1.0 / (PYBULLET_HZ * FINER)), encoding="utf-8"
            )
        found = compare(name, motions, seed)
        table.add_row(
            name,
            f"{1e3 * found.loop_m:.4f}",
            f"{1e3 * found.path_m:.4f}",
            f"{1e3 * found.engines_m:.4f}",
            f"{100 * found.cycle:.4f}",
            f"{100 * found.effort:.2f}",
        )
    console.print(table)


if __name__ == "__main__":
    typer.run(main)
