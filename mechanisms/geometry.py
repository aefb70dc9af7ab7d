"""Distances between bars, batched over leading axes."""

from __future__ import annotations

import numpy as np

from .batching import Array


def segment_distance(a: Array, b: Array, c: Array, d: Array) -> Array:
    """Shortest distance between the segments ab and cd in the plane or in space.

    Args:
        a: first end of the first segment, shape (..., n); ``b`` is its other end.
        b: see ``a``.
        c: first end of the second segment, shape (..., n); ``d`` is its other end.
        d: see ``c``.

    Returns:
        Distances in metres, shape (...); zero where segments in a plane cross.
    """
    u, v, w = b - a, d - c, a - c
    uu, uv, vv = _dot(u, u), _dot(u, v), _dot(v, v)
    uw, vw = _dot(u, w), _dot(v, w)
    determinant = uu * vv - uv * uv
    with np.errstate(divide="ignore", invalid="ignore"):
        free_s = np.where(determinant > 1e-14 * uu * vv, (uv * vw - vv * uw) / determinant, 0.0)
        s = np.clip(free_s, 0.0, 1.0)
        t = np.clip((uv * s + vw) / vv, 0.0, 1.0)
        s = np.clip((uv * t - uw) / uu, 0.0, 1.0)
    return np.linalg.norm(w + s[..., None] * u - t[..., None] * v, axis=-1)


def _dot(a: Array, b: Array) -> Array:
    return np.sum(a * b, axis=-1)
