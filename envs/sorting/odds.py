"""How likely a pick is to end in the right bin, given what a camera reports of it: closed forms of the task's own laws.

A report says where an item was, how it lay and of which grade it is. It errs, the item leaves its place before it is
gripped, the drives are off, a held item may slip, and what looks ripe may be green. All errors are taken for normal and
small, so that the quality of a grip, an exponential of their squares, and its square have known means.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels.elementary import exp
from ...motion.orientation import axes, from_euler
from ..core import Array
from ..drives import Servos
from .columns import CANDIDATE, KINDS
from .config import PerceptionModel, SortingConfig
from .drawing import Stream
from .errors import JOINTS

GRADE_COLUMNS = slice(CANDIDATE.ware, CANDIDATE.ware + KINDS)
"""Where a candidate's grades stand among its features."""
GRIP_LEVEL_M = 0.010
"""Typical height of the platform when it grips."""


class Misses(NamedTuple):
    """Where the tool is, less where the item is, of one kind, beyond what a report says.

    Attributes:
        mean_m: (3,), along, across, up.
        variance_m2: (3,).
        turn_rad2: (3,), variances of the turns about the item's long axis, the one across it and the vertical.
    """

    mean_m: Array
    variance_m2: Array
    turn_rad2: Array


def shares(config: SortingConfig) -> Array:
    """Share of each grade (4,) in what comes."""
    stream, produce = Stream.of(config), config.produce
    lengths = _raster(stream, 0, 0)
    ware, fruit = float(np.mean(lengths >= produce.ware_from_m)), produce.fruit_share
    ripe = 1.0 - produce.ripe_from
    return np.array([(1.0 - fruit) * ware, (1.0 - fruit) * (1.0 - ware), fruit * ripe, fruit * (1.0 - ripe)])


def right_grade(config: SortingConfig, perception: PerceptionModel) -> Array:
    """Chance of each reported grade (4,) that there is an item, and one of that grade."""
    seen = perception.recall * shares(config)[:, None] * np.array(perception.confusion, float)
    reported = seen.sum(axis=0) + perception.false_per_item / KINDS
    return np.divide(seen.diagonal(), reported, out=np.zeros(KINDS), where=reported > 0.0)


def misses(config: SortingConfig, perception: PerceptionModel, kind: int) -> Misses:
    """What a camera, the item and the drives are off by."""
    # A report's error carries the tool along; an item's own way carries it away. The tool's own error comes on top.
    mean, variance, turn = _drive_errors(config)
    slip = np.array([config.belt.slip_sigma_m, config.belt.slip_sigma_m, 0.0])
    lean, yaw = perception.tilt_sigma_rad[kind], perception.yaw_sigma_rad[kind]
    return Misses(
        mean + np.array(perception.bias_m, float),
        variance + np.array(perception.sigma_m, float) ** 2 + slip**2,
        turn + np.array([lean, lean, yaw]) ** 2,
    )


def quality_mean(config: SortingConfig, off: Misses, kind: int, power: float) -> float:
    """Mean of a power of a grip's quality, as a share of that power of the quality that a report lets expect."""
    grip = config.grip
    scale_m2 = np.array([grip.centre_sigma_m, grip.centre_sigma_m, grip.height_sigma_m]) ** 2
    spread = scale_m2 + power * off.variance_m2
    mean = float(np.prod(np.sqrt(scale_m2 / spread) * exp(-0.5 * power * off.mean_m**2 / spread)))
    # A horizontal error of equal variances beyond which the fingers close beside the item.
    square_m2 = grip.capture_m**2
    level_m2 = max(0.5 * float(off.variance_m2[:2].sum()), 1e-12)
    mean *= 1.0 - math.exp(-0.5 * square_m2 * (1.0 / level_m2 + power / scale_m2[0]))
    # Sines of normal angles; a turn about an axis moves the two others.
    sine2 = 0.5 * (1.0 - exp(-2.0 * off.turn_rad2))
    narrow, flat = _shape(Stream.of(config), kind)
    misfit = np.array([flat, flat + narrow, narrow]) * sine2
    return mean * float(np.prod(1.0 / np.sqrt(1.0 + power * misfit / grip.misfit_sigma**2)))


class Odds:
    """Chance that a pick ends in the bin of its true grade.

    Attributes:
        aligned: (4,), by reported grade, of items that the tool can align with.
    """

    def __init__(self, config: SortingConfig, perception: PerceptionModel):
        """Take the means from the configuration and the camera's statistics."""
        grip = config.grip
        right = right_grade(config, perception)
        powers = np.empty((KINDS, 2))
        for grade in range(KINDS):
            off = misses(config, perception, grade // 2)
            once, twice = (quality_mean(config, off, grade // 2, power) for power in (1.0, 2.0))
            # Of what is held, with the quality as a share, a share times 1 - quality slips.
            powers[grade] = right[grade] * np.array([(1.0 - grip.slip) * once, grip.slip * twice])
        self.aligned = grip.best * powers.sum(axis=1)
        self._powers, self._best = powers, grip.best

    def placed(self, table: NDArray[Any]) -> Array:
        """Chance (...) of candidates (..., F)."""
        powers = table[..., GRADE_COLUMNS] @ self._powers
        # As shown, the quality holds the best grips' share already.
        quality = table[..., CANDIDATE.quality] / self._best if self._best > 0.0 else 0.0
        return self._best * quality * (powers[..., 0] + powers[..., 1] * quality)


def _raster(stream: Stream, kind: int, size: int) -> Array:
    """Every value that ``drawing.on_raster`` gives of a kind: lengths (size 0), widths (1), thicknesses (2)."""
    levels = round(stream.levels[kind, size])
    return stream.low[kind, size] + stream.span[kind, size] * np.arange(levels) / max(levels - 1, 1)


def _shape(stream: Stream, kind: int) -> tuple[float, float]:
    """Mean squares of 1 - width / length and of 1 - thickness / length."""
    width, thickness = _raster(stream, kind, 1), _raster(stream, kind, 2)
    flat = 1.0 - width[:, None] * thickness
    return float(np.mean((1.0 - width) ** 2)), float(np.mean(flat**2))


def _drive_errors(config: SortingConfig) -> tuple[Array, Array, Array]:
    """What drives carry the tool off by: mean and variance (3,) of its place, variances (3,) of its turns.

    In the middle of the belt, level; what lags, a fraction of a millimetre, is left out.
    """
    servos = Servos.of(config.scenario.drives, *JOINTS)
    if not servos.on:
        return np.zeros(3), np.zeros(3), np.zeros(3)
    mechanism, tool_m = config.machine.sorter.mechanism, config.machine.sorter.tool_m
    pose, along = np.zeros((1, 6)), np.zeros((1, 6))
    pose[:, 2], along[:, 0] = GRIP_LEVEL_M, config.belt.speed_m_s
    behind = servos.joint_error(np.zeros((1, sum(JOINTS))), mechanism.joint_rates(pose, along))
    off = np.concatenate([behind, np.diag(servos.encoder)])
    error = mechanism.pose_error(np.repeat(pose, len(off), axis=0), off)
    z_axis = axes(from_euler(error[:, 3:]))[..., 2]
    place = error[:, :3] - tool_m * (z_axis - np.array([0.0, 0.0, 1.0]))
    return place[0], (place[1:] ** 2).sum(axis=0), (error[:, 3:] ** 2).sum(axis=0)
