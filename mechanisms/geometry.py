"""Distances between bars, batched over leading axes."""

from __future__ import annotations

import numpy as np

from .batching import Array


def segment_distance(a: Array, b: Array, c: Array, d: Array, axis: int = -1) -> Array:
    """Shortest distance between the segments ab and cd in the plane or in space.

    Args:
        a: first end of the first segment, shape (..., n); ``b`` is its other end.
        b: see ``a``.
        c: first end of the second segment, shape (..., n); ``d`` is its other end.
        d: see ``c``.
        axis: where the coordinates lie; 0 serves kernels that hold long contiguous columns.

    Returns:
        Distances in metres, shape (...); zero where segments in a plane cross.
    """
    u, v, w = b - a, d - c, a - c
    uu, uv, vv = _dot(u, u, axis), _dot(u, v, axis), _dot(v, v, axis)
    uw, vw = _dot(u, w, axis), _dot(v, w, axis)
    determinant = uu * vv - uv * uv
    with np.errstate(divide="ignore", invalid="ignore"):
        free_s = np.where(determinant > 1e-14 * uu * vv, (uv * vw - vv * uw) / determinant, 0.0)
        s = np.clip(free_s, 0.0, 1.0)
        t = np.clip((uv * s + vw) / vv, 0.0, 1.0)
        s = np.clip((uv * t - uw) / uu, 0.0, 1.0)
    apart = w + np.expand_dims(s, axis) * u - np.expand_dims(t, axis) * v
    return np.sqrt(_dot(apart, apart, axis))


def line_distance(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Length of the common normal of the infinite lines through ab and cd in space.

    It is no clearance of bars: it vanishes wherever the lines meet, even far beyond the bars' ends.

    Args:
        a: first point of the first line, shape (..., 3); ``b`` is its second.
        b: see ``a``.
        c: first point of the second line, shape (..., 3); ``d`` is its second.
        d: see ``c``.

    Returns:
        Distances in metres, shape (...).
    """
    u, v, w = b - a, d - c, c - a
    normal = np.cross(u, v)
    length = np.sqrt(_dot(normal, normal, -1))
    parallel = length <= 1e-12 * np.sqrt(_dot(u, u, -1) * _dot(v, v, -1))
    across = np.cross(w, u)
    with np.errstate(divide="ignore", invalid="ignore"):
        apart = np.sqrt(_dot(across, across, -1) / _dot(u, u, -1))
        return np.where(parallel, apart, np.abs(_dot(w, normal, -1)) / length)


def _dot(a: Array, b: Array, axis: int) -> Array:
    return np.sum(a * b, axis=axis)
