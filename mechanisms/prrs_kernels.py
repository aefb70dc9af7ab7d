"""Inverse kinematics of the 3-PRRS, as machine code: in pieces and bit for bit as ``two_legs_kernels`` says."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled
from ..kernels.angles import arctangent, sine_cosine

Array = NDArray[np.float64]

RADIAL_X, RADIAL_Y, ALONG, ACROSS, BASE_RADIUS, LINK = range(6)
"""Columns of the legs' numbers: the unit vector of R1's axis, outwards; the spherical joint's place on the platform,
along its x and its y axis, m; the radius of the sliders' circle, m; the link's length, m."""

_PIECE = 256


@compiled
def platform_axes(sine: tuple[float, float, float], cosine: tuple[float, float, float]) -> tuple[float, ...]:
    """The platform's x and y axes in the base's, x's components first, of Rz(gamma) Ry(beta) Rx(alpha)."""
    (sa, sb, sg), (ca, cb, cg) = sine, cosine
    turned = sb * sa
    return cg * cb, sg * cb, -sb, cg * turned - sg * ca, sg * turned + cg * ca, cb * sa


@compiled
def slider_and_drive(
    dx_m: float, dy_m: float, height_m: float, radial_x: float, radial_y: float, link_m: float
) -> tuple[float, float]:
    """Height of a leg's slider, m, and angle of its driven rotation, rad; NaN where its link cannot reach.

    Args:
        dx_m: spherical joint from the slider's line, along x.
        dy_m: the same along y.
        height_m: height of the spherical joint.
        radial_x: unit vector of R1's axis, outwards.
        radial_y: see ``radial_x``.
        link_m: length of the link.
    """
    drop = np.sqrt(link_m * link_m - dx_m * dx_m - dy_m * dy_m)
    return height_m + drop, arctangent(dy_m * radial_x - dx_m * radial_y, drop)


@compiled
def inverse_of_one(pose: Array, legs: Array, joints: Array) -> None:
    """Fill three sliders and three driven angles (6,) for a pose (6,); ``legs`` (3, 6) in the columns above."""
    sa, ca = sine_cosine(pose[3])
    sb, cb = sine_cosine(pose[4])
    sg, cg = sine_cosine(pose[5])
    xx, xy, xz, yx, yy, yz = platform_axes((sa, sb, sg), (ca, cb, cg))
    for leg in range(3):
        rx, ry, along, across = legs[leg, RADIAL_X], legs[leg, RADIAL_Y], legs[leg, ALONG], legs[leg, ACROSS]
        dx = xx * along + pose[0] + yx * across - legs[leg, BASE_RADIUS] * rx
        dy = xy * along + pose[1] + yy * across - legs[leg, BASE_RADIUS] * ry
        height = xz * along + pose[2] + yz * across
        joints[leg], joints[leg + 3] = slider_and_drive(dx, dy, height, rx, ry, legs[leg, LINK])


@compiled
def inverse_of_many(poses: Array, legs: Array, joints: Array) -> None:
    """``inverse_of_one`` for poses (n, 6) and joints (n, 6)."""
    pose, axes, columns = np.empty((6, _PIECE)), np.empty((6, _PIECE)), np.empty((6, _PIECE))
    x, y, z, alpha, beta, gamma = pose[0], pose[1], pose[2], pose[3], pose[4], pose[5]
    xx, xy, xz, yx, yy, yz = axes[0], axes[1], axes[2], axes[3], axes[4], axes[5]
    for start in range(0, len(poses), _PIECE):
        count = min(_PIECE, len(poses) - start)
        for i in range(count):
            for k in range(6):
                pose[k, i] = poses[start + i, k]
        for i in range(count):
            sa, ca = sine_cosine(alpha[i])
            sb, cb = sine_cosine(beta[i])
            sg, cg = sine_cosine(gamma[i])
            xx[i], xy[i], xz[i], yx[i], yy[i], yz[i] = platform_axes((sa, sb, sg), (ca, cb, cg))
        for leg in range(3):
            rx, ry, along, across = legs[leg, RADIAL_X], legs[leg, RADIAL_Y], legs[leg, ALONG], legs[leg, ACROSS]
            base, link = legs[leg, BASE_RADIUS], legs[leg, LINK]
            slider, drive = columns[leg], columns[leg + 3]
            for i in range(count):
                dx = xx[i] * along + x[i] + yx[i] * across - base * rx
                dy = xy[i] * along + y[i] + yy[i] * across - base * ry
                height = xz[i] * along + z[i] + yz[i] * across
                slider[i], drive[i] = slider_and_drive(dx, dy, height, rx, ry, link)
        for i in range(count):
            for k in range(6):
                joints[start + i, k] = columns[k, i]
