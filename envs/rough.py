"""Rough ground: heights along three lines, by the spectral density of a class of roughness.

Heights are a sum of waves of 0.05 to 3.5 cycles/m, the band in which soil was measured, with the spectral density

    G(n) = G(n0) (n / n0)^-w,   n0 = 0.1 cycles/m,

along each of three lines: left wheels, crop row, right wheels. The ground is isotropic: two lines a distance b apart
share their waves to the part (coherence) 2 (pi n b)^(w/2) K(2 pi n b) / Gamma(w/2), K the modified Bessel function of
order w/2 [Kamash and Robson 1978].
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.special import gamma, kv

from ..kernels import compiled
from ..kernels.elementary import power
from .core import Array
from .rough_config import RoughGround
from .shaking import U

STEP_M = 0.05
"""From row to row of a profile [published: steps of 50 mm suffice for tilled soil]."""
WAVES_PER_M = 0.05, 3.5
"""Slowest and fastest waves [published: where soil was measured]."""
N0_PER_M = 0.1


class Waves(NamedTuple):
    """What all grounds of a configuration share.

    Attributes:
        mix: (K, 3, 3), amplitudes of the three lines from independent numbers.
        cosine: (K, S), of each wave at each row.
        sine: (K, S).
    """

    mix: Array
    cosine: Array
    sine: Array


def density_m3(ground: RoughGround, waves_per_m: Array) -> Array:
    """Spectral density (n,) of the height, m2 a cycle/m, at waves (n,)."""
    return ground.roughness_m3 * power(np.asarray(waves_per_m) / N0_PER_M, -ground.waviness)


def coherence(ground: RoughGround, waves_per_m: Array, apart_m: float) -> Array:
    """Part (n,) of their waves that two lines share."""
    order, x = 0.5 * ground.waviness, math.pi * np.asarray(waves_per_m) * apart_m
    return 2.0 * x**order * kv(order, 2.0 * x) / gamma(order)


@lru_cache(maxsize=16)
def waves_of(ground: RoughGround, first_m: float, rows: int) -> Waves:
    """The waves of a ground of so many rows."""
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
    cosine, sine = turned(waves, along)
    return Waves(mix * size[:, None, None], cosine, sine)


def heights_of(waves: Waves, luck: Array) -> Array:
    """Heights (S, 3) of the three lines from independent numbers (K, 3, 2)."""
    heights = np.empty((waves.cosine.shape[1], 3))
    _superpose(waves.mix, luck, waves.cosine, waves.sine, heights)
    return heights


def summed_up(surface: Array) -> None:
    """Fill in the integrals of surfaces (R, S, 7) whose heights are there."""
    for height, sums in ((U.left, U.left_sum), (U.right, U.right_sum)):
        _integrate(surface, height, sums, STEP_M)


def turned(waves_per_m: Array, along_m: Array) -> tuple[Array, Array]:
    """Cosine and sine (K, S) of waves (K,) at places (S,)."""
    cosine, sine = np.empty((2, len(waves_per_m), len(along_m)))
    _turn(waves_per_m, along_m, cosine, sine)
    return cosine, sine


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
def _integrate(surface: Array, height: int, sums: int, step_m: float) -> None:
    for w in range(len(surface)):
        total = 0.0
        for i in range(surface.shape[1]):
            surface[w, i, sums] = total
            if i + 1 < surface.shape[1]:
                total += 0.5 * step_m * (surface[w, i, height] + surface[w, i + 1, height])
