"""Leg lengths of the 3UPS-RPU platform, as machine code: in pieces and bit for bit as ``two_legs_kernels`` says."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled
from ..kernels.angles import sine_cosine

Array = NDArray[np.float64]

BASE_X, BASE_Y, PLATFORM_X, PLATFORM_Y, OFFSET, PAPER = range(6)
"""Columns of the legs' numbers: A_i in the base's plane and B_i in the platform's, m; B_i's x plus the platform's
radius, m; 1 for the paper's orientation and 0 for the machine's."""

_PIECE = 256


@compiled
def leg_length(
    x_m: float,
    z_m: float,
    sine: tuple[float, float],
    cosine: tuple[float, float],
    base: tuple[float, float],
    platform: tuple[float, float],
    offset_m: float,
    paper: float,
) -> float:
    """Distance of A_i and B_i, m, from the platform's centre, the sines and cosines of its angles, a leg's numbers."""
    (sa, sb), (ca, cb) = sine, cosine
    (ax, ay), (bx, by) = base, platform
    across = sa * sb
    if paper != 0.0:
        dx = cb * bx + x_m - ax
        dy = across * offset_m + ca * by - ay
        dz = sa * by - ca * sb * bx + z_m
    else:
        dx = cb * bx + x_m - ax + across * by
        dy = ca * by - ay
        dz = sa * cb * by - sb * bx + z_m
    return np.sqrt(dx * dx + dy * dy + dz * dz)


@compiled
def inverse_of_one(pose: Array, legs: Array, lengths: Array) -> None:
    """Fill the lengths (4,) for a pose (4,) as (x, z, alpha, beta); ``legs`` (4, 6) in the columns above."""
    sa, ca = sine_cosine(pose[2])
    sb, cb = sine_cosine(pose[3])
    for leg in range(4):
        base, platform = (legs[leg, BASE_X], legs[leg, BASE_Y]), (legs[leg, PLATFORM_X], legs[leg, PLATFORM_Y])
        offset, paper = legs[leg, OFFSET], legs[leg, PAPER]
        lengths[leg] = leg_length(pose[0], pose[1], (sa, sb), (ca, cb), base, platform, offset, paper)


@compiled
def inverse_of_many(poses: Array, legs: Array, lengths: Array) -> None:
    """``inverse_of_one`` for poses (n, 4) and lengths (n, 4)."""
    x, z, alpha, beta = np.empty(_PIECE), np.empty(_PIECE), np.empty(_PIECE), np.empty(_PIECE)
    sa, ca, sb, cb = np.empty(_PIECE), np.empty(_PIECE), np.empty(_PIECE), np.empty(_PIECE)
    columns = np.empty((4, _PIECE))
    for start in range(0, len(poses), _PIECE):
        count = min(_PIECE, len(poses) - start)
        for i in range(count):
            x[i], z[i] = poses[start + i, 0], poses[start + i, 1]
            alpha[i], beta[i] = poses[start + i, 2], poses[start + i, 3]
        for i in range(count):
            sa[i], ca[i] = sine_cosine(alpha[i])
            sb[i], cb[i] = sine_cosine(beta[i])
        for leg in range(4):
            base, platform = (legs[leg, BASE_X], legs[leg, BASE_Y]), (legs[leg, PLATFORM_X], legs[leg, PLATFORM_Y])
            offset, paper = legs[leg, OFFSET], legs[leg, PAPER]
            column = columns[leg]
            for i in range(count):
                column[i] = leg_length(x[i], z[i], (sa[i], sb[i]), (ca[i], cb[i]), base, platform, offset, paper)
        for i in range(count):
            for leg in range(4):
                lengths[start + i, leg] = columns[leg, i]
