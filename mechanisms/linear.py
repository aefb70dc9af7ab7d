"""Small matrices, batched over leading axes, with NaN instead of a raised error where there is no answer."""

from __future__ import annotations

import numpy as np

from .batching import Array


def dot(a: Array, b: Array) -> Array:
    """Scalar products of the last axes, shape (...)."""
    return np.sum(a * b, axis=-1)


def apply(matrix: Array, vector: Array) -> Array:
    """Products (..., m) of matrices (..., m, n) and vectors (..., n), the same to the last bit in any batch."""
    return np.sum(matrix * vector[..., None, :], axis=-1)


def skew(vector: Array) -> Array:
    """Matrices (..., 3, 3) of the cross product with vectors (..., 3)."""
    result = np.zeros((*vector.shape, 3))
    result[..., 0, 1], result[..., 0, 2], result[..., 1, 2] = -vector[..., 2], vector[..., 1], -vector[..., 0]
    return result - np.swapaxes(result, -1, -2)


def angle_of(cosine: Array) -> Array:
    """Arccosine in [0, pi] rad that forgives a cosine just beyond 1."""
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def singular_values(matrix: Array) -> Array:
    """Singular values, largest first, shape (..., n); NaN for matrices that are not finite."""
    finite = np.asarray(np.isfinite(matrix).all(axis=(-1, -2)))
    values = np.linalg.svd(np.where(finite[..., None, None], matrix, 0.0), compute_uv=False)
    return np.where(finite[..., None], values, np.nan)


def solve_regular(matrix: Array, right: Array, regular: np.ndarray) -> Array:
    """Solutions (..., n) of matrix @ solution = right where ``regular`` (...) holds, NaN elsewhere."""
    safe = np.where(regular[..., None, None], matrix, np.eye(matrix.shape[-1]))
    return np.where(regular[..., None], np.linalg.solve(safe, right[..., None])[..., 0], np.nan)


def solve_where_regular(matrix: Array, right: Array) -> Array:
    """Solutions (..., n) of matrix @ solution = right, NaN where the matrix (..., n, n) is singular or holds NaN."""
    with np.errstate(invalid="ignore"):
        return solve_regular(matrix, right, np.abs(np.linalg.det(matrix)) > 0.0)
