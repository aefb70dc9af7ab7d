"""What a weeder's target sees of a tool that did not come."""

from __future__ import annotations

import numpy as np

from ..core import WeederOutcome
from ..state import WeederPlan

FAR_M = np.array([0.0, 10.0])
"""Along and across: nothing grows there."""


def stayed(plan: WeederPlan) -> WeederOutcome:
    """The tool stayed where it was; nothing was treated."""
    return WeederOutcome(plan.phases_s, plan.aim + FAR_M)
