"""Why an item cannot be gripped, in words; names the machine's limit where it is one."""

from __future__ import annotations

import numpy as np

from ...motion.orientation import euler_angles
from ...simulation.sorter_limits import first_violation
from ..core import Array
from .config import SortingConfig
from .reports import COLUMNS

_AT = {name: row for row, name in enumerate(COLUMNS)}


def explain(config: SortingConfig, columns: Array, time_s: float) -> str:
    """The reason for a report's numbers (columns,) at a time; see ``COLUMNS``."""
    if np.isfinite(columns[_AT["last_x"]]):
        return f"too late by {max(time_s - columns[_AT['deadline_s']], 0.0):.2f} s: it leaves the reach before the lift"
    tool_axis = columns[_AT["z_x"] : _AT["z_z"] + 1]
    mechanism = config.machine.sorter.mechanism
    pose = np.zeros((2, 6))
    pose[:, 1] = columns[_AT["y"]]
    pose[:, 2] = columns[_AT["z"]], config.machine.travel_level_m
    pose[:, 3:] = euler_angles(columns[_AT["w"] : _AT["k"] + 1])
    found = first_violation(mechanism, pose)
    if found is not None:
        return f"out of reach: {found.limit} is exceeded by {-found.margin:.4f}"
    lean = np.degrees(np.arccos(np.clip(tool_axis[2], -1.0, 1.0)))
    limit = np.degrees(config.machine.tilt_limit_rad)
    if lean > limit - 0.1:
        return f"it leans further than the tilt limit of {limit:.0f} deg allows to grip"
    return "the reach at this yaw and tilt is too short to follow the belt while gripping"
