"""The machine in PyBullet that carries a sorting plan out."""

from __future__ import annotations

import numpy as np

from ...motion.orientation import axes
from ...simulation.motion_result import Rest
from ...simulation.sorter import SorterMachine
from ..core import Array, Rows
from .columns import PHASE
from .core import SorterOutcome, SortingCore
from .motions import PickMotion, Way
from .state import PICK, SorterPlan

_REST = Rest(tolerance_m=5e-4, limit_s=0.5, wait_s=0.025)


class PyBulletSorter:
    """Executor that drives the closed-loop machine of one world.

    The machine moves in PyBullet; while it stands still (waiting, letting go) time passes without steps. What the
    fingers get is judged where the simulated tool really is when they close.
    """

    def __init__(self, core: SortingCore):
        """Build the machine for the rules' single world."""
        if core.worlds != 1:
            raise ValueError(f"{core.worlds} worlds: the PyBullet executor drives one machine")
        self._core = core
        self._machine = SorterMachine(core.config.machine.sorter)
        self._dt = 1.0 / self._machine.parameters.physics_hz

    def reset_rows(self, rows: Rows) -> None:
        """Put the machine where the rules say it stands."""
        if len(rows):
            core = self._core
            at = np.array([[*core.state.place[0], core.config.machine.travel_level_m]])
            self._machine.reset(Way(at, core.state.turn[:1]).poses()[0])

    def execute(self, plan: SorterPlan) -> SorterOutcome:
        """Drive the motion and say how long it took and what the fingers got."""
        core, machine = self._core, self._machine
        if plan.kind[0] != PICK:
            grip = core.foreseen(plan)
            return SorterOutcome(plan.phases_s, grip)
        motion = PickMotion(core.config, plan)
        closing = int(np.ceil(motion.closing_s / self._dt))
        machine.run(self._poses(motion, 0, closing, False))
        position, quaternion = machine.platform()
        # The step in which the fingers close ends a little later; what counts is the error against the command.
        wanted = motion.sample(np.array([closing * self._dt]), False).position[0]
        axis = axes(quaternion)
        grip = core.grip(plan, plan.grip + position - wanted, np.concatenate([axis[:, 0], axis[:, 2]])[None])
        held = bool(grip.held[0])
        if held:
            machine.carry(core.item_mass_kg(plan))
        moved_s = self._finish(motion, closing, held)
        machine.carry(0.0)
        phases = core.phases_of(plan, grip.held).copy()
        phases[0, PHASE.carry] += moved_s - motion.duration_s(held)
        return SorterOutcome(phases, grip)

    def close(self) -> None:
        """Close the world; idempotent."""
        self._machine.close()

    def _finish(self, motion: PickMotion, closing: int, held: bool) -> float:
        """Drive the rest of a pick until the platform rests; returns the seconds since the approach began."""
        end_s = motion.duration_s(held)
        last = int(np.ceil(end_s / self._dt))
        report = self._machine.run(self._poses(motion, closing, last, held))
        still = np.repeat(self._poses(motion, last, last, held), _REST.steps(self._dt), axis=0)
        # The end lies between two samples; the command rests from there on, and so does a platform that is on time.
        return _REST.wait(report, end_s, end_s, lambda: self._machine.run(still))[1]

    def _poses(self, motion: PickMotion, first: int, last: int, held: bool) -> Array:
        return motion.sample(np.arange(first, last + 1, dtype=np.float64) * self._dt, held).poses()
