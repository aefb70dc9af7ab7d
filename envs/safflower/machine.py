"""The machine in PyBullet that carries a picking plan out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...motion import QUINTIC
from ...simulation.motion_result import Rest
from ...simulation.picker_model import PickerParameters
from ..core import Array
from ..driven import RECOVERY_S, Driven
from .config import SafflowerConfig
from .core import PickerOutcome, SafflowerCore
from .state import PickerPlan
from .timing import DRIVE, EMPTY, NOTHING, P

_REST = Rest(tolerance_m=5e-4, limit_s=0.5, wait_s=0.025)
"""The tool's weight alone bends it by up to 0.25 mm."""


class PyBulletPicker(Driven[PickerPlan, PickerOutcome]):
    """Executor that drives the closed-loop machine of one world.

    The machine moves in PyBullet; while it stands still (settling, locating, cutting) time passes without steps.
    """

    def __init__(self, core: SafflowerCore):
        """Build the machine for the rules' single world."""
        # PyBullet loads where a machine is driven, not where a batch is computed.
        from ...simulation.picker import PickerMachine

        super().__init__(core.worlds)
        self._core = core
        self._machine = PickerMachine(picker_parameters(core.config))
        self._dt = 1.0 / self._machine.parameters.physics_hz

    def place(self) -> None:
        """Put the machine where the rules say it stands."""
        pose = self._core.state.pose[0]
        self._machine.reset(float(pose[0]), pose[1:])

    def drive(self, plan: PickerPlan) -> PickerOutcome:
        """Drive the motion and say how long it took and where the tool came to rest."""
        phases = plan.phases_s.copy()
        kind = int(plan.kind[0])
        if kind in (NOTHING, EMPTY):
            return PickerOutcome(phases, plan.target)
        cart, tool, nominal_s = trajectory(plan, self._core.config.machine.clear_level_m, self._dt)
        if self._core.errs:
            share = QUINTIC.sample(self._dt * np.arange(len(cart)), 1.0, nominal_s).position
            way = self.erring(np.column_stack([cart, tool]), share, self._core.tool_error(plan)[0])
            cart, tool = way[:, 0], way[:, 1:]
        report = self._machine.run(cart, tool)
        steps = _REST.steps(self._dt)
        still = np.full(steps, cart[-1]), np.repeat(tool[-1:], steps, 0)
        # The end lies between two samples; the command rests from there on, and so does a tool that is on time.
        report, moved_s = _REST.wait(report, nominal_s, nominal_s, lambda: self._machine.run(*still))
        if not self.arrived(report.final_error_m, report.saturated):
            moved_s += RECOVERY_S
        phases[0, P.drive if kind == DRIVE else P.travel] += moved_s - nominal_s
        x, y, z = report.final_tool_m
        parameters = self._machine.parameters
        plane = [[x, y + 0.5 * parameters.five_bar.base_m, z - parameters.motor_height_m]]
        tool = np.array(plane)
        return PickerOutcome(phases, tool + self._core.stand_error(tool) if self._core.rough else tool)

    def missed(self, plan: PickerPlan) -> PickerOutcome:
        """The tool stayed where it was."""
        phases = plan.phases_s.copy()
        phases[0, P.travel] += RECOVERY_S
        start = plan.start
        return PickerOutcome(phases, start + self._core.stand_error(start) if self._core.rough else start)


def picker_parameters(config: SafflowerConfig) -> PickerParameters:
    """The machine's parameters with its frame set to the scenario's crop."""
    return replace(config.machine.picker, motor_height_m=config.scenario.motor_height_m)


def trajectory(plan: PickerPlan, level_m: float, step_s: float) -> tuple[Array, Array, float]:
    """Commands of one world's motion: rise, traverse and cart side by side, descend.

    The wait for the cart to settle is left out: nothing moves in it.

    Args:
        plan: the plan; its first world counts.
        level_m: level of the traverse in the arm's plane.
        step_s: sampling interval.

    Returns:
        Cart (n,), tool (n, 2) and the nominal duration in seconds.
    """
    rise_s, descent_s, (cart_s, across_s) = plan.rise_s[0], plan.descent_s[0], plan.beside_s[0]
    start, target = plan.start[0], plan.target[0]
    beside_s = max(across_s, cart_s)
    nominal_s = float(rise_s + beside_s + descent_s)
    time = step_s * np.arange(int(np.ceil(nominal_s / step_s)) + 1)
    above = level_m
    up = QUINTIC.sample(time, above - start[2], rise_s).position
    down = QUINTIC.sample(time - rise_s - beside_s, target[2] - above, descent_s).position
    across = QUINTIC.sample(time - rise_s, target[1] - start[1], across_s).position
    ahead = QUINTIC.sample(time - rise_s, target[0] - start[0], cart_s).position
    tool = np.column_stack([start[1] + across, start[2] + up + down])
    return start[0] + ahead, tool, nominal_s
