"""What carries a weeding plan out: the plan's own word, or the machine in PyBullet."""

from __future__ import annotations

from ..core import Rows
from .task import WeederOutcome, WeederPlan


class AnalyticWeeder:
    """Executor that takes the plan's word: nominal phase times, the tool exactly where it was set."""

    def reset_rows(self, rows: Rows) -> None:
        """Nothing to prepare."""

    def execute(self, plan: WeederPlan) -> WeederOutcome:
        """What the plan says."""
        return WeederOutcome(plan.phases_s, plan.aim)

    def close(self) -> None:
        """Nothing to free."""
