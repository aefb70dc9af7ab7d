"""Why an item cannot be gripped, in words; names the machine's limit where it is one."""

from __future__ import annotations

import numpy as np

from ...motion.orientation import euler_angles
from ...simulation.sorter_limits import first_violation
from ..core import Array
from .columns import NUMBER
from .config import SortingConfig


def explain(config: SortingConfig, number: Array, time_s: float) -> str:
    """The reason for a report's numbers at a time; see ``columns.Number``."""
    if np.isfinite(number[NUMBER.last_m]):
        return f"too late by {max(time_s - number[NUMBER.deadline_s], 0.0):.2f} s: it leaves the reach before the lift"
    tool_axis = number[NUMBER.z_axis_x : NUMBER.z_axis_x + 3]
    mechanism = config.machine.sorter.mechanism
    pose = np.zeros((2, 6))
    pose[:, 1] = number[NUMBER.across_m]
    pose[:, 2] = number[NUMBER.height_m], config.machine.travel_level_m
    pose[:, 3:] = euler_angles(number[NUMBER.turn_w : NUMBER.turn_w + 4])
    found = first_violation(mechanism, pose)
    if found is not None:
        return f"out of reach: {found.limit} is exceeded by {-found.margin:.4f}"
    lean = np.degrees(np.arccos(np.clip(tool_axis[2], -1.0, 1.0)))
    limit = np.degrees(config.machine.tilt_limit_rad)
    if lean > limit - 0.1:
        return f"it leans further than the tilt limit of {limit:.0f} deg allows to grip"
    return "the reach at this yaw and tilt is too short to follow the belt while gripping"
