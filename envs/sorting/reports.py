"""What follows from a report alone: how the tool must stand, where on the belt it can, how long it stays down."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...motion import QUINTIC
from ...motion.orientation import axes, tilted
from ..core import Array
from .config import GRADES, SortingConfig
from .process import grip_quality
from .reach import reach_m
from .scenario import Reports

COLUMNS = (
    *("passing_s", "y", "first_x", "last_x", "hold_s", "deadline_s", "w", "i", "j", "k"),
    *("carry_least_s", "carry_across_square", "bin_x", "carry_guess_s"),
    *("z", "descend_s", "x_x", "x_y", "x_z", "z_x", "z_y", "z_z"),
)
"""Rows of a report's numbers: when the platform over it would pass x = 0; its y; first and last x where an approach may
end; seconds from the approach's end to the lift's; latest end of an approach; the tool's quaternion; for the way to the
bin its least time, square of y, x and a first guess at the time; height of the grip; seconds down (and up again); the
tool's x and z axes."""

SURVEYED = COLUMNS.index("z")
"""Rows before this one are looked at for every candidate at every decision, the others for the chosen one."""

SWING_M = 0.006
"""Kept free at the end of the reach: the way to the bin begins at the belt's speed [assumed, tested]."""


def wrapped(yaw: Array) -> Array:
    """Angles (...) in (-pi/2, pi/2]: an ellipsoid looks the same after half a turn."""
    return yaw - np.pi * np.ceil(yaw / np.pi - 0.5)


def prepare(config: SortingConfig, reports: Reports) -> tuple[Array, NDArray[np.float32], Array]:
    """Numbers (columns, R, M), features (R, M, F) and leaving times (R, M) of reports.

    Reports of nothing leave at infinity. Reports that cannot be gripped have no last x and no deadline.
    """
    machine, belt, sorter = config.machine, config.belt, config.machine.sorter
    there = np.isfinite(reports.arrival_s)
    arrival = np.where(there, reports.arrival_s, 0.0)
    yaw_seen = wrapped(reports.yaw)
    yaw = np.clip(yaw_seen, -machine.yaw_limit_rad, machine.yaw_limit_rad)
    tilt = np.minimum(reports.tilt, machine.tilt_limit_rad)
    quaternion = np.moveaxis(tilted(tilt, reports.azimuth, yaw), -1, 0)
    turned = axes(np.moveaxis(quaternion, 0, -1))
    z_axis = turned[..., :, 2]
    passing = arrival - sorter.tool_m * z_axis[..., 0] / belt.speed_m_s
    y = reports.y_m + sorter.tool_m * z_axis[..., 1]
    z = np.maximum(reports.z_m + sorter.tool_m * z_axis[..., 2] - sorter.origin_above_belt_m, 0.0)
    z = np.minimum(z, machine.travel_level_m)
    descend = QUINTIC.duration_unchecked(machine.travel_level_m - z, sorter.velocity_m_s, sorter.acceleration_m_s2)
    hold = 2.0 * descend + config.grip.grip_s
    reach = reach_m(sorter.mechanism, machine.travel_level_m + 0.005, tilt, yaw)
    half = np.sqrt(np.maximum(reach * reach - y * y, 0.0))
    last = half - SWING_M - belt.speed_m_s * hold
    fits = (reports.tilt <= machine.tilt_limit_rad + config.grip.refused_tilt_rad) & (last > -half)
    last = np.where(fits, last, -np.inf)
    turn = 2.0 * np.arccos(np.minimum(quaternion[0], 1.0))
    carry_least = np.maximum(
        QUINTIC.duration_unchecked(turn, sorter.turn_rad_s, sorter.turn_rad_s2), machine.shortest_move_s
    )
    bins = np.array(belt.bins_m)
    deadline = np.where(fits, passing + last / belt.speed_m_s, -np.inf)
    across = bins[reports.grade, 1] - y
    aside = np.sqrt(across * across + bins[reports.grade, 0] ** 2)
    guess = QUINTIC.duration_unchecked(aside, sorter.velocity_m_s - belt.speed_m_s, sorter.acceleration_m_s2)
    columns = np.stack(
        [
            *(passing, y, -half, last, hold, np.where(fits, deadline, -1e9), *quaternion),
            *(carry_least, across * across, bins[reports.grade, 0], np.maximum(guess, carry_least), z, descend),
            *(turned[..., row, column] for column in (0, 2) for row in range(3)),
        ]
    )
    missing = reports.tilt - tilt
    yaw_misfit = ((1.0 - reports.width) * np.sin(yaw_seen - yaw)) ** 2
    tilt_misfit = ((1.0 - reports.thickness) * np.sin(missing)) ** 2
    misfit = np.stack([yaw_misfit, tilt_misfit])
    quality = config.grip.best * grip_quality(config.grip, np.zeros((3, *y.shape)), misfit)
    # Scales as in the task's module, which this one must not import.
    static = (
        *(there, 0.0 * y, y / 0.2, np.cos(2.0 * yaw_seen), np.sin(2.0 * yaw_seen), reports.tilt / 0.35, turn),
        reports.length_m / 0.06,
        *(reports.grade == grade for grade in range(len(GRADES))),
        np.array(config.produce.value)[reports.grade],
        quality,
    )
    features = np.zeros((*y.shape, len(static) + 5), np.float32)
    for column, values in enumerate(static):
        features[..., column] = values
    # What cannot be gripped is shown until it has left the place where others are.
    leave = passing + np.where(fits, last, 0.10) / belt.speed_m_s
    return columns, features, np.where(there, leave, np.inf)
