"""The ground that weeders drive over, drawn from a strip's luck: heights, slip and sway; see ``GroundConfig``.

Heights are a sum of waves of 0.05 to 3.5 cycles/m, the band in which soil was measured, with the spectral density

    G(n) = G(n0) (n / n0)^-w,   n0 = 0.1 cycles/m,

along each of three lines: left wheels, crop row, right wheels. The ground is isotropic: two lines a distance b apart
share their waves to the part (coherence) 2 (pi n b)^(w/2) K(2 pi n b) / Gamma(w/2), K the modified Bessel function of
order w/2 [Kamash and Robson 1978]. What is drawn depends on the strip's ``ground.look`` alone.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import gamma, kv, ndtri

from ...kernels import compiled
from ...kernels.elementary import power
from ..core import Array
from .config import FieldTask
from .field import Profile
from .ground_config import LARGEST_SLIP, GroundConfig
from .shaking import Shape, U

STEP_M = 0.05
"""From row to row of a profile [published: steps of 50 mm suffice for tilled soil]."""
WAVES_PER_M = 0.05, 3.5
"""Slowest and fastest waves [published: where soil was measured]."""
N0_PER_M = 0.1
_SLIP_M = 1.0
"""Slip at places farther apart than this has little to do with each other [assumed]."""
_SWAYS_PER_M = 0.05, 0.10, 0.15, 0.20
_SALT = 0x67726F75
"""Parts the ground's generator from others of the same luck."""
_BEHIND_M = 1.0


class Waves(NamedTuple):
    """What all grounds of a configuration share.

    Attributes:
        mix: (K, 3, 3), amplitudes of the three lines from independent numbers.
        cosine: (K, S), of each wave at each row.
        sine: (K, S).
        sway_cosine: (4, S), of the sway's waves.
        sway_sine: (4, S).
    """

    mix: Array
    cosine: Array
    sine: Array
    sway_cosine: Array
    sway_sine: Array


def density_m3(ground: GroundConfig, waves_per_m: Array) -> Array:
    """Spectral density (n,) of the height, m2 a cycle/m, at waves (n,)."""
    return ground.roughness_m3 * power(np.asarray(waves_per_m) / N0_PER_M, -ground.waviness)


def coherence(ground: GroundConfig, waves_per_m: Array, apart_m: float) -> Array:
    """Part (n,) of their waves that two lines share."""
    order, x = 0.5 * ground.waviness, math.pi * np.asarray(waves_per_m) * apart_m
    return 2.0 * x**order * kv(order, 2.0 * x) / gamma(order)


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
    waves = _waves(ground, first, rows)
    generator = np.random.default_rng([int(look * 2.0**53), _SALT])
    luck = generator.standard_normal((len(waves.mix), 3, 2))
    heights, slip, sway = np.empty((rows, 3)), np.empty(rows), np.empty(rows)
    _superpose(waves.mix, luck, waves.cosine, waves.sine, heights)
    _stray(generator.standard_normal(rows), math.exp(-STEP_M / _SLIP_M), float(ground.slip_share), slip)
    _sway(generator.standard_normal((len(_SWAYS_PER_M), 2)), float(ground.wander_m), waves, sway)
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
    for height, sums in ((U.left, U.left_sum), (U.right, U.right_sum)):
        _integrate(surface, height, sums, STEP_M)
    return surface


def drift_of(ground: GroundConfig, look: float) -> float:
    """The odometry's error per distance on the strip with this luck, where the ground's configuration says one."""
    assert ground.drift_share is not None
    return float(ground.drift_share * ndtri(min(max(look, 1e-9), 1.0 - 1e-9)))


@lru_cache(maxsize=16)
def _waves(ground: GroundConfig, first_m: float, rows: int) -> Waves:
    low, high = WAVES_PER_M
    # Waves in the middles of equal bands; so many that the ground does not begin anew where it ends.
    bands = math.ceil((high - low) * max(1.0 / low, rows * STEP_M))
    step = (high - low) / bands
    waves = low + step * (np.arange(bands, dtype=np.float64) + 0.5)
    size = np.sqrt(density_m3(ground, waves) * step)
    half, whole = (coherence(ground, waves, apart) for apart in (0.5 * ground.track_m, ground.track_m))
    mix = np.zeros((len(waves), 3, 3))
    # Cholesky factor of the lines' coherences, written out: what enters a field must not depend on a library.
    mix[:, 0, 0] = 1.0
    mix[:, 1, 0], mix[:, 2, 0] = half, whole
    mix[:, 1, 1] = np.sqrt(1.0 - half * half)
    mix[:, 2, 1] = (half - half * whole) / mix[:, 1, 1]
    mix[:, 2, 2] = np.sqrt(1.0 - whole * whole - mix[:, 2, 1] * mix[:, 2, 1])
    along = first_m + STEP_M * np.arange(rows, dtype=np.float64)
    tables = [np.empty((len(part), rows)) for part in (waves, waves, _SWAYS_PER_M, _SWAYS_PER_M)]
    _turn(waves, along, tables[0], tables[1])
    _turn(np.array(_SWAYS_PER_M), along, tables[2], tables[3])
    return Waves(mix * size[:, None, None], *tables)


@compiled
def _turn(waves_per_m: Array, along_m: Array, cosine: Array, sine: Array) -> None:
    for k in range(len(waves_per_m)):
        for i in range(len(along_m)):
            angle = 2.0 * math.pi * waves_per_m[k] * along_m[i]
            cosine[k, i], sine[k, i] = math.cos(angle), math.sin(angle)


@compiled
def _superpose(mix: Array, luck: Array, cosine: Array, sine: Array, heights: Array) -> None:
    """Sum up waves (K, S) whose parts of the three lines come from independent numbers (K, 3, 2)."""
    rows = cosine.shape[1]
    for line in range(3):
        for i in range(rows):
            heights[i, line] = 0.0
        for k in range(len(mix)):
            a, b = 0.0, 0.0
            for part in range(line + 1):
                a += mix[k, line, part] * luck[k, part, 0]
                b += mix[k, line, part] * luck[k, part, 1]
            for i in range(rows):
                heights[i, line] += a * cosine[k, i] + b * sine[k, i]


@compiled
def _stray(luck: Array, kept: float, share: float, slip_m: Array) -> None:
    """Sum up what the odometry counts wrong, (S,): slip strays from its mean and comes back within a metre or so."""
    fresh = math.sqrt(1.0 - kept * kept)
    stray, slip_m[0] = luck[0], 0.0
    for i in range(1, len(luck)):
        slip_m[i] = slip_m[i - 1] + min(max(share * stray, -LARGEST_SLIP), LARGEST_SLIP) * STEP_M
        stray = kept * stray + fresh * luck[i]


@compiled
def _sway(luck: Array, size_m: float, waves: Waves, sway_m: Array) -> None:
    parts = len(luck)
    each = size_m / math.sqrt(float(parts))
    for i in range(len(sway_m)):
        total = 0.0
        for k in range(parts):
            total += luck[k, 0] * waves.sway_cosine[k, i] + luck[k, 1] * waves.sway_sine[k, i]
        sway_m[i] = each * total


@compiled
def _integrate(surface: Array, height: int, sums: int, step_m: float) -> None:
    for w in range(len(surface)):
        total = 0.0
        for i in range(surface.shape[1]):
            surface[w, i, sums] = total
            if i + 1 < surface.shape[1]:
                total += 0.5 * step_m * (surface[w, i, height] + surface[w, i + 1, height])
