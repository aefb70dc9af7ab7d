"""Orientations as unit quaternions (w, x, y, z), batched over leading axes: the turning half of a motion in space."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

_SMALL_RAD = 1e-6
"""Below this half angle sin(s a) / sin(a) is s to the last digit."""

LEVEL = np.array([1.0, 0.0, 0.0, 0.0])
"""No rotation."""


def tilted(tilt: ArrayLike, azimuth: ArrayLike, yaw: ArrayLike) -> Array:
    """Quaternions (..., 4) of a yaw about z followed by a tilt: the z axis leans by ``tilt`` towards ``azimuth``.

    Args:
        tilt: (...), rad.
        azimuth: (...), rad, direction in the horizontal plane.
        yaw: (...), rad.
    """
    parts = np.broadcast_arrays(*(np.asarray(angle, dtype=np.float64) for angle in (tilt, azimuth, yaw)))
    return np.stack(tilted_parts(*(np.array(part, order="C") for part in parts)), axis=-1)


def tilted_parts(tilt: Any, azimuth: Any, yaw: Any) -> tuple[Any, Any, Any, Any]:
    """The four components of ``tilted``, of numbers or of arrays."""
    halves = np.sin(0.5 * tilt), np.cos(0.5 * tilt), np.sin(0.5 * yaw), np.cos(0.5 * yaw)
    return tilted_by(*halves, np.sin(azimuth), np.cos(azimuth))


def tilted_by(st: Any, ct: Any, sy: Any, cy: Any, sa: Any, ca: Any) -> tuple[Any, Any, Any, Any]:
    """``tilted_parts`` from sine and cosine of half the tilt, of half the yaw, and of the azimuth."""
    # (ct, -st sin a, st cos a, 0) times (cy, 0, 0, sy), with the angle sum written out.
    x, y = -st * sa, st * ca
    return ct * cy, x * cy + y * sy, y * cy - x * sy, ct * sy


def product(first: Array, second: Array) -> Array:
    """``second`` followed by ``first``: the Hamilton product (..., 4)."""
    w, x, y, z = (first[..., i] for i in range(4))
    a, b, c, d = (second[..., i] for i in range(4))
    return np.stack(
        [w * a - x * b - y * c - z * d, w * b + x * a + y * d - z * c, w * c - x * d + y * a + z * b,
         w * d + x * c - y * b + z * a],
        axis=-1,
    )  # fmt: skip


def conjugate(quaternion: Array) -> Array:
    """The opposite rotation (..., 4)."""
    return quaternion * np.array([1.0, -1.0, -1.0, -1.0])


def angle_between(first: Array, second: Array) -> Array:
    """Smallest angle (...) in rad that turns one orientation into the other."""
    difference = product(conjugate(first), second)
    sine = np.sqrt(np.sum(difference[..., 1:] ** 2, axis=-1))
    return 2.0 * np.arctan2(sine, np.abs(difference[..., 0]))


def slerp(first: Array, second: Array, share: ArrayLike) -> Array:
    """The shortest turn on SO(3): from ``first`` (share 0) to ``second`` (share 1) about one fixed axis.

    Args:
        first: (..., 4).
        second: (..., 4).
        share: (...), part of the angle that has been turned; along a motion law it is the law's shape.

    Returns:
        Unit quaternions (..., 4).
    """
    part = np.asarray(share, dtype=np.float64)[..., None]
    dot = np.sum(first * second, axis=-1, keepdims=True)
    second = np.where(dot < 0.0, -second, second)
    half = 0.5 * angle_between(first, second)[..., None]
    sine = np.sin(half)
    with np.errstate(divide="ignore", invalid="ignore"):
        a = np.where(half > _SMALL_RAD, np.sin((1.0 - part) * half) / sine, 1.0 - part)
        b = np.where(half > _SMALL_RAD, np.sin(part * half) / sine, part)
    result = a * first + b * second
    return result / np.sqrt(np.sum(result * result, axis=-1, keepdims=True))


def axes(quaternion: Array) -> Array:
    """Rotation matrices (..., 3, 3), columns x, y, z of the turned frame."""
    parts = [quaternion[..., i] for i in range(4)]
    columns = [np.stack(axis(*parts), axis=-1) for axis in (x_axis, y_axis, z_axis)]
    return np.stack(columns, axis=-1)


def x_axis(w: Any, x: Any, y: Any, z: Any) -> tuple[Any, Any, Any]:
    """The turned frame's x axis from a quaternion's components, numbers or arrays."""
    return 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)


def y_axis(w: Any, x: Any, y: Any, z: Any) -> tuple[Any, Any, Any]:
    """See ``x_axis``."""
    return 2.0 * (x * y - w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z + w * x)


def z_axis(w: Any, x: Any, y: Any, z: Any) -> tuple[Any, Any, Any]:
    """See ``x_axis``."""
    return 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)


def euler_angles(quaternion: Array) -> Array:
    """(alpha, beta, gamma), shape (..., 3), of Rz(gamma) Ry(beta) Rx(alpha): the angles of a mechanism's pose."""
    w, x, y, z = (quaternion[..., i] for i in range(4))
    alpha = np.arctan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))
    beta = np.arcsin(np.clip(2.0 * (w * y - x * z), -1.0, 1.0))
    gamma = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
    return np.stack([alpha, beta, gamma], axis=-1)


def from_euler(angles: ArrayLike) -> Array:
    """Quaternions (..., 4) of (alpha, beta, gamma), (..., 3), rad: Rz(gamma) Ry(beta) Rx(alpha)."""
    half = 0.5 * np.asarray(angles, dtype=np.float64)
    cosine, sine = np.cos(half), np.sin(half)
    (ca, cb, cg), (sa, sb, sg) = (np.moveaxis(part, -1, 0) for part in (cosine, sine))
    return np.stack(
        [
            ca * cb * cg + sa * sb * sg,
            sa * cb * cg - ca * sb * sg,
            ca * sb * cg + sa * cb * sg,
            ca * cb * sg - sa * sb * cg,
        ],
        axis=-1,
    )
