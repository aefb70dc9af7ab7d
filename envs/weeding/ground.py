"""The ground that weeders drive over, drawn from a strip's luck: heights, slip and sway; see ``GroundConfig``.

Heights are those of ``rough``. What is drawn depends on the strip's ``ground.look`` alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from scipy.special import ndtri

from ...kernels import compiled
from ..core import Array
from ..rough import STEP_M, heights_of, summed_up, turned, waves_of
from ..shaking import Shape, U
from .config import FieldTask
from .field import Profile
from .ground_config import LARGEST_SLIP, GroundConfig

_SLIP_M = 1.0
"""Slip at places farther apart than this has little to do with each other [assumed]."""
_SWAYS_PER_M = 0.05, 0.10, 0.15, 0.20
_SALT = 0x67726F75
"""Parts the ground's generator from others of the same luck."""
_BEHIND_M = 1.0


def span(config: FieldTask) -> tuple[float, int]:
    """Where a profile begins, and how many rows it has: all that wheels and cameras come to."""
    cart, base = config.cart, config.scenario.ground.wheel_base_m
    first = -(max(cart.start_m, cart.seen_ahead_m) + base)
    rows = math.ceil((config.scenario.strip_m + _BEHIND_M + base - first) / STEP_M) + 1
    return first, rows


def shape_of(config: FieldTask) -> Shape:
    """What kernels have to know."""
    ground = config.scenario.ground
    gap_m, low_m, beside = config.tool_line
    return Shape(
        span(config)[0],
        STEP_M,
        float(ground.wheel_base_m),
        float(ground.track_m),
        float(ground.footprint_m),
        float(ground.pivot_m),
        float(gap_m),
        float(low_m),
        float(beside),
    )


def draw_profile(config: FieldTask, look: float) -> Profile:
    """The ground of the strip with this luck."""
    ground, (first, rows) = config.scenario.ground, span(config)
    waves = waves_of(ground, first, rows)
    generator = np.random.default_rng([int(look * 2.0**53), _SALT])
    luck = generator.standard_normal((len(waves.mix), 3, 2))
    heights, slip, sway = heights_of(waves, luck), np.empty(rows), np.empty(rows)
    _stray(generator.standard_normal(rows), math.exp(-STEP_M / _SLIP_M), float(ground.slip_share), slip)
    _sway(generator.standard_normal((len(_SWAYS_PER_M), 2)), float(ground.wander_m), *_sways(first, rows), sway)
    left, middle, right = heights.T
    if ground.drift_share is not None:
        slip += drift_of(ground, look) * STEP_M * np.arange(rows)
    return Profile(first + STEP_M * np.arange(rows, dtype=np.float64), left, middle, right, slip, sway)


def draw_profiles(config: FieldTask, looks: Array) -> tuple[Profile, ...]:
    """The grounds of the strips with these lucks (R,); none on level ground."""
    if not config.scenario.ground.uneven:
        return ()
    return tuple(draw_profile(config, look) for look in looks.tolist())


def surface_of(config: FieldTask, profiles: Sequence[Profile]) -> Array:
    """Surfaces (R, S, 7) that kernels take; a profile of other rows is taken between them."""
    first, rows = span(config)
    along = first + STEP_M * np.arange(rows, dtype=np.float64)
    surface = np.zeros((len(profiles), rows, len(U)))
    for row, profile in enumerate(profiles):
        for column, name in ((U.left, "left_m"), (U.middle, "middle_m"), (U.right, "right_m"), (U.slip, "slip_m")):
            surface[row, :, column] = np.interp(along, profile.along_m, getattr(profile, name))
        surface[row, :, U.sway] = np.interp(along, profile.along_m, profile.sway_m)
    summed_up(surface)
    return surface


def drift_of(ground: GroundConfig, look: float) -> float:
    """The odometry's error per distance on the strip with this luck, where the ground's configuration says one."""
    assert ground.drift_share is not None
    return float(ground.drift_share * ndtri(min(max(look, 1e-9), 1.0 - 1e-9)))


@lru_cache(maxsize=16)
def _sways(first_m: float, rows: int) -> tuple[Array, Array]:
    return turned(np.array(_SWAYS_PER_M), first_m + STEP_M * np.arange(rows, dtype=np.float64))


@compiled
def _stray(luck: Array, kept: float, share: float, slip_m: Array) -> None:
    """Sum up what the odometry counts wrong, (S,): slip strays from its mean and comes back within a metre or so."""
    fresh = math.sqrt(1.0 - kept * kept)
    stray, slip_m[0] = luck[0], 0.0
    for i in range(1, len(luck)):
        slip_m[i] = slip_m[i - 1] + min(max(share * stray, -LARGEST_SLIP), LARGEST_SLIP) * STEP_M
        stray = kept * stray + fresh * luck[i]


@compiled
def _sway(luck: Array, size_m: float, cosine: Array, sine: Array, sway_m: Array) -> None:
    parts = len(luck)
    each = size_m / math.sqrt(float(parts))
    for i in range(len(sway_m)):
        total = 0.0
        for k in range(parts):
            total += luck[k, 0] * cosine[k, i] + luck[k, 1] * sine[k, i]
        sway_m[i] = each * total
