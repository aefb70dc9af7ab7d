"""Why an item cannot be gripped, in words; names the machine's limit where it is one."""

from __future__ import annotations

import numpy as np

from ...motion.orientation import euler_angles
from ...simulation.sorter_limits import first_violation
from ..core import Array
from .config import SortingConfig
from .state import ACROSS_M, DEADLINE_S, HEIGHT_M, LAST_M, TURN, Z_AXIS


def explain(config: SortingConfig, number: Array, time_s: float) -> str:
    """The reason for a report's numbers (columns,) at a time; see ``COLUMNS``."""
    if np.isfinite(number[LAST_M]):
        return f"too late by {max(time_s - number[DEADLINE_S], 0.0):.2f} s: it leaves the reach before the lift"
    tool_axis = number[Z_AXIS : Z_AXIS + 3]
    mechanism = config.machine.sorter.mechanism
    pose = np.zeros((2, 6))
    pose[:, 1] = number[ACROSS_M]
    pose[:, 2] = number[HEIGHT_M], config.machine.travel_level_m
    pose[:, 3:] = euler_angles(number[TURN : TURN + 4])
    found = first_violation(mechanism, pose)
    if found is not None:
        return f"out of reach: {found.limit} is exceeded by {-found.margin:.4f}"
    lean = np.degrees(np.arccos(np.clip(tool_axis[2], -1.0, 1.0)))
    limit = np.degrees(config.machine.tilt_limit_rad)
    if lean > limit - 0.1:
        return f"it leans further than the tilt limit of {limit:.0f} deg allows to grip"
    return "the reach at this yaw and tilt is too short to follow the belt while gripping"
