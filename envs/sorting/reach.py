"""Where the platform may be, by how it is turned: a bound on the workspace that the batched rules can afford.

At every decision every candidate needs to know whether it can be gripped, lifted and carried away. Asking the
mechanism for its sixteen margins along the whole motion takes milliseconds; the rules need microseconds. So the reach
is tabulated once: for each tilt and yaw the radius around the machine's axis within which every limit holds, whatever
the direction of the position and of the tilt, from the belt up to the travel level. The motion between two poses that
are within the bound stays within the limits: that is not proven but tested, over random motions sampled in time
(``scripts/check_sorter_motions.py``), and the simulated machine refuses what would break a limit by the limit's name.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ...kernels import compiled
from ...mechanisms import ThreePRRS
from ...motion.orientation import euler_angles, tilted
from ..core import Array

TILTS_RAD = np.deg2rad([0.0, 5.0, 10.0, 15.0, 20.0])
YAWS_RAD = np.deg2rad([0.0, 15.0, 30.0, 45.0, 60.0])
_TILT_STEP_RAD, _YAW_STEP_RAD = float(TILTS_RAD[1]), float(YAWS_RAD[1])
RESERVE_M = 0.004
"""Taken off every tabulated radius: for the table's raster and for what a motion swings beyond its ends."""
ABOVE_M = 0.005
"""The reach is asked for up to this far above the travel level."""

_STANDARD_HEIGHT_M = 0.095
_STANDARD_RADII_M = (
    (0.2366, 0.2157, 0.1952, 0.1753, 0.1566),
    (0.2292, 0.2087, 0.1883, 0.1685, 0.1497),
    (0.2210, 0.2014, 0.1811, 0.1615, 0.1428),
    (0.2093, 0.1914, 0.1712, 0.1519, 0.1334),
    (0.1844, 0.1683, 0.1488, 0.1297, 0.1116),
)
"""``tabulate(ThreePRRS.sorter(), 0.095)``; row = tilt, column = yaw."""


def tabulate(mechanism: ThreePRRS, height_m: float, step_rad: float = np.deg2rad(10.0)) -> Array:
    """Radii (tilts, yaws) in metres within which every limit holds, from z = 0 to ``height_m``; -1 where none does.

    Only the sliders see the height, and directly, so the two ends stand for everything between. The machine looks
    the same after a third of a turn and in a mirror: a third of the positions and the positive yaws are enough.
    """
    place, lean = np.meshgrid(
        np.arange(0.0, 2.0 * np.pi / 3.0, step_rad), np.arange(0.0, 2.0 * np.pi, step_rad), indexing="ij"
    )
    radii = np.full((len(TILTS_RAD), len(YAWS_RAD)), -1.0)
    for i, tilt in enumerate(TILTS_RAD):
        for j, yaw in enumerate(YAWS_RAD):
            angles = euler_angles(tilted(tilt, lean, yaw))

            def holds(radius: float, angles: Array = angles) -> bool:
                poses = np.empty((2, *place.shape, 6))
                poses[..., 0], poses[..., 1] = radius * np.cos(place), radius * np.sin(place)
                poses[0, ..., 2], poses[1, ..., 2] = 0.0, height_m
                poses[..., 3:] = angles
                return bool(mechanism.reachable(poses).all())

            low, high = 0.0, mechanism.link_m
            if not holds(low):
                continue
            for _ in range(12):
                middle = 0.5 * (low + high)
                low, high = (middle, high) if holds(middle) else (low, middle)
            radii[i, j] = low
    return radii


@lru_cache(maxsize=8)
def radii(mechanism: ThreePRRS, height_m: float) -> Array:
    """``tabulate`` less the reserve; the shipped machine's table is written down, another one's takes a second."""
    if mechanism == ThreePRRS.sorter() and height_m == _STANDARD_HEIGHT_M:
        return np.array(_STANDARD_RADII_M) - RESERVE_M
    return tabulate(mechanism, height_m) - RESERVE_M


@compiled
def reach_m(table: Array, tilt: float, yaw: float) -> float:
    """Radius in metres that the platform keeps to at a tilt and yaw (rad); bilinear in a table of ``radii``."""
    a = min(max(tilt / _TILT_STEP_RAD, 0.0), table.shape[0] - 1.0)
    b = min(abs(yaw) / _YAW_STEP_RAD, table.shape[1] - 1.0)
    i, j = min(int(a), table.shape[0] - 2), min(int(b), table.shape[1] - 2)
    a, b = a - i, b - j
    upper = table[i, j] * (1.0 - b) + table[i, j + 1] * b
    lower = table[i + 1, j] * (1.0 - b) + table[i + 1, j + 1] * b
    return upper * (1.0 - a) + lower * a
