"""What carries a transplanting plan out: the plan's own word, or the machine in PyBullet."""

from __future__ import annotations

import numpy as np

from ..core import Rows
from .task import TransplantOutcome, TransplantPlan


class AnalyticTransplanter:
    """Executor that takes the plan's word: nominal phase times, the tool exactly where it was sent."""

    def reset_rows(self, rows: Rows) -> None:
        """Nothing to prepare."""

    def execute(self, plan: TransplantPlan) -> TransplantOutcome:
        """What the plan says."""
        return TransplantOutcome(plan.phases_s, np.zeros((len(plan.kind), 2)))

    def close(self) -> None:
        """Nothing to free."""
