"""What all executors in PyBullet share: a motion that the machine cannot follow ends as an outcome, not as an error.

Plans respect the machine's motors, so this is for what no plan foresees. A tool that is not where it was sent, beyond
what a longer wait mends, or a way that leaves the mechanism's limits, is a *fault*: the target sees the tool where it
really was, and the machine then stands where the rules say. Where the machine may stop, its drives take ``RECOVERY_S``
to be switched on again; a weeder's cart drives on.
"""

from __future__ import annotations

from typing import Any, Generic

import numpy as np
from numpy.typing import NDArray

from ..mechanisms.errors import UnreachablePoseError
from ..simulation.machine import START_TOLERANCE_M, LostMachineError
from .core import Array, OutcomeT, PlanT, Rows

RECOVERY_S = 5.0
"""What a fault costs [assumed]."""
_ONE_ROW = np.zeros(1, np.int64)


class Driven(Generic[PlanT, OutcomeT]):
    """Executor of one world's machine; a subclass makes ``_machine`` in its constructor.

    Attributes:
        fault: why the last decision's motion failed, empty where it did not.
    """

    fault = ""
    _lost = False
    _off: Any = 0.0
    """What the machine is off from where the rules say it stands, because its drives err."""
    _machine: Any
    """A ``LoopMachine``."""

    def __init__(self, worlds: int):
        """Hold the rules to a single world."""
        if worlds != 1:
            raise ValueError(f"{worlds} worlds: the PyBullet executor drives one machine")

    def reset_rows(self, rows: Rows) -> None:
        """Put the machine where the rules say it stands, and forget its faults."""
        self._lost, self.fault = False, ""
        if len(rows):
            self._put()

    def execute(self, plan: PlanT) -> OutcomeT:
        """Carry a plan out, whatever the machine does."""
        lost, self._lost, self.fault = self._lost, False, ""
        try:
            if lost:
                self._put()
            return self.drive(plan)
        except UnreachablePoseError as error:
            self._give_up(f"the way leaves the machine's limits: {error.limit} by {-error.margin:.3g}")
        except LostMachineError as error:
            self._give_up(str(error))
        return self.missed(plan)

    def place(self) -> None:
        """Put the machine where the rules say it stands."""
        raise NotImplementedError

    def drive(self, plan: PlanT) -> OutcomeT:
        """Drive the machine and say what happened."""
        raise NotImplementedError

    def missed(self, plan: PlanT) -> OutcomeT:
        """What happened where the machine did not move at all."""
        raise NotImplementedError

    def close(self) -> None:
        """Close the world; idempotent."""
        self._machine.close()

    def arrived(self, error_m: float, saturated: NDArray[np.bool_]) -> bool:
        """Whether the machine is near enough to where it was sent to go on from there; else the decision is a fault."""
        if error_m <= START_TOLERANCE_M:
            return True
        weak = ", ".join(self._machine.motors_at(saturated)) or "none"
        self._give_up(f"the tool stopped {1e3 * error_m:.1f} mm from where it was sent; motors at their limits: {weak}")
        return False

    def erring(self, way: Array, share: Array, error: Array) -> Array:
        """Where drives that err lead the tool on a way (n, k): from where it stands to where it comes to rest.

        Args:
            way: commanded.
            share: (n,) of the way that has been gone, 0 at its beginning.
            error: (k,), what the tool is off by at its end.
        """
        before, self._off = self._off, error
        return way + before + share[:, None] * (error - before)

    def _put(self) -> None:
        self._off = 0.0
        self.place()

    def _give_up(self, reason: str) -> None:
        self._lost, self.fault = True, self.fault or reason
