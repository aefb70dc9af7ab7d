"""What a motion did, and when it is over: the same for every machine in PyBullet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from .closed_loop import ClosedLoopMachine
from .machine import START_TOLERANCE_M

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MotionResult:
    """What a motion did. Unless it was measured, the maxima know the state after its last step only.

    Attributes:
        duration_s: simulated time.
        final_error_m: distance of the tool from its command at the end.
        closure_error_m: largest gap in a closed loop.
        saturated: which motors were at their limits, bool (motors,).
        measured: whether every step was looked at.
    """

    duration_s: float
    final_error_m: float
    closure_error_m: float
    saturated: NDArray[np.bool_]
    measured: bool


ResultT = TypeVar("ResultT", bound=MotionResult)


class Maxima:
    """Running maxima over the states that were looked at.

    Attributes:
        errors: largest of each error that was told, (n,).
        closure_m: largest gap in a closed loop.
        effort: largest magnitudes that the motors applied, N or N m, (motors,).
    """

    def __init__(self, machine: ClosedLoopMachine, errors: int, motors: int):
        """Nothing was looked at yet."""
        self._machine = machine
        self.errors, self.closure_m, self.effort = np.zeros(errors), 0.0, np.zeros(motors)

    def look(self, *errors: float) -> None:
        """Take the present state in, with its errors."""
        np.maximum(self.errors, errors, out=self.errors)
        self.closure_m = max(self.closure_m, self._machine.closure_error_m())
        np.maximum(self.effort, np.abs(self._machine.motor_efforts()), out=self.effort)


class Rest(NamedTuple):
    """When a motion is over: the tool is near to where it was sent, has had its time, or is lost.

    Attributes:
        tolerance_m: this near.
        limit_s: longest wait after the motion's nominal end; what is left then is the error that the work sees.
        wait_s: time between two looks.
    """

    tolerance_m: float
    limit_s: float
    wait_s: float

    def steps(self, step_s: float) -> int:
        """Commands that hold the machine still for ``wait_s``, the first of which is where it stands."""
        return round(self.wait_s / step_s) + 1

    def wait(self, report: ResultT, moved_s: float, end_s: float, hold: Callable[[], ResultT]) -> tuple[ResultT, float]:
        """Hold still until the motion is over; a tool that is too far off to be led on is left where it is.

        Args:
            report: of the motion.
            moved_s: simulated seconds since it began.
            end_s: nominal ones.
            hold: holds the machine still for a while and reports.

        Returns:
            The last report and the seconds since the motion began.
        """
        while self.tolerance_m < report.final_error_m <= START_TOLERANCE_M and moved_s < end_s + self.limit_s:
            report = hold()
            moved_s += report.duration_s
        return report, moved_s
