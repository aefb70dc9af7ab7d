"""The machine in PyBullet that carries a sorting plan out."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...motion import QUINTIC
from ...motion.orientation import axes
from ...simulation.motion_result import Rest
from ...simulation.sorter import SorterMachine
from ..core import Array
from ..driven import RECOVERY_S, Driven
from .columns import PHASE
from .core import SorterOutcome, SortingCore
from .motions import PickMotion, Way
from .state import PICK, SorterPlan

_REST = Rest(tolerance_m=5e-4, limit_s=0.5, wait_s=0.025)


class PyBulletSorter(Driven[SorterPlan, SorterOutcome]):
    """Executor that drives the closed-loop machine of one world.

    The machine moves in PyBullet; while it stands still (waiting, letting go) time passes without steps. What the
    fingers get is judged where the simulated tool really is when they close.
    """

    def __init__(self, core: SortingCore):
        """Build the machine for the rules' single world."""
        super().__init__(core.worlds)
        self._core = core
        self._machine = SorterMachine(core.config.machine.sorter)
        self._dt = 1.0 / self._machine.parameters.physics_hz
        self._before: Any = 0.0

    def place(self) -> None:
        """Put the machine where the rules say it stands."""
        core = self._core
        at = np.array([[*core.state.place[0], core.config.machine.travel_level_m]])
        self._machine.reset(Way(at, core.state.turn[:1]).poses()[0])

    def drive(self, plan: SorterPlan) -> SorterOutcome:
        """Drive the motion and say how long it took and what the fingers got."""
        core, machine = self._core, self._machine
        if plan.kind[0] != PICK:
            grip = core.foreseen(plan)
            return SorterOutcome(plan.phases_s, grip)
        motion = PickMotion(core.config, plan)
        if core.errs:
            self._before, self._off = self._off, core.tool_error(plan)[0]
        closing = int(np.ceil(motion.closing_s / self._dt))
        reached = machine.run(self._poses(motion, 0, closing, False))
        position, quaternion = machine.platform()
        # The step in which the fingers close ends a little later; what counts is the error against the command.
        wanted = motion.sample(np.array([closing * self._dt]), False).position[0]
        axis = axes(quaternion)
        grip = core.grip(plan, plan.grip + position - wanted, np.concatenate([axis[:, 0], axis[:, 2]])[None])
        held = bool(grip.held[0])
        if not self.arrived(reached.final_error_m, reached.saturated):
            machine.reset(self._poses(motion, closing, closing, held)[0])
        if held:
            machine.carry(core.item_mass_kg(plan))
        moved_s = self._finish(motion, closing, held)
        machine.carry(0.0)
        phases = core.phases_of(plan, grip.held).copy()
        phases[0, PHASE.carry] += moved_s - motion.duration_s(held) + (RECOVERY_S if self.fault else 0.0)
        return SorterOutcome(phases, grip)

    def missed(self, plan: SorterPlan) -> SorterOutcome:
        """The platform stayed where it was, and the fingers closed on nothing."""
        core, axis = self._core, axes(plan.turn)
        far = plan.grip + np.array([0.0, 0.0, 1.0])
        grip = core.grip(plan, far, np.concatenate([axis[..., 0], axis[..., 2]], axis=-1))
        phases = core.phases_of(plan, grip.held).copy()
        phases[0, PHASE.carry] += RECOVERY_S
        return SorterOutcome(phases, grip)

    def _finish(self, motion: PickMotion, closing: int, held: bool) -> float:
        """Drive the rest of a pick until the platform rests; returns the seconds since the approach began."""
        end_s = motion.duration_s(held)
        last = int(np.ceil(end_s / self._dt))
        report = self._machine.run(self._poses(motion, closing, last, held))
        still = np.repeat(self._poses(motion, last, last, held), _REST.steps(self._dt), axis=0)
        # The end lies between two samples; the command rests from there on, and so does a platform that is on time.
        report, moved_s = _REST.wait(report, end_s, end_s, lambda: self._machine.run(still))
        self.arrived(report.final_error_m, report.saturated)
        return moved_s

    def _poses(self, motion: PickMotion, first: int, last: int, held: bool) -> Array:
        time = np.arange(first, last + 1, dtype=np.float64) * self._dt
        poses = motion.sample(time, held).poses()
        if self._core.errs:
            share = QUINTIC.sample(time, 1.0, motion.closing_s).position[:, None]
            poses += self._before + share * (self._off - self._before)
        return poses
