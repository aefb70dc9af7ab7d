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


def _dot(a: Array, b: Array, axis: int) -> Array:
    return np.sum(a * b, axis=axis)
