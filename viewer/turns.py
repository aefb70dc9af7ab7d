"""Rotations with stretches as a browser wants them: quaternions and scales."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def parted(turn: ArrayLike) -> tuple[Array, Array]:
    """Rotations times stretches (n, 3, 3) apart: quaternions (n, 4), (w, x, y, z), and scales (n, 3).

    A stretch goes along the mesh's own axes, as instances have it; mirrored ones do not occur.
    """
    m = np.asarray(turn, np.float64).reshape(-1, 3, 3)
    scale = np.sqrt(np.square(m).sum(axis=1))
    r = m / np.maximum(scale, 1e-12)[:, None, :]
    # Of the four squares the largest is taken for a root: it is at least a quarter.
    trace = r[:, 0, 0] + r[:, 1, 1] + r[:, 2, 2]
    squares = np.column_stack([1.0 + trace, *(1.0 + 2.0 * r[:, i, i] - trace for i in range(3))])
    x, y, z = r[:, 2, 1] - r[:, 1, 2], r[:, 0, 2] - r[:, 2, 0], r[:, 1, 0] - r[:, 0, 1]
    xy, xz, yz = r[:, 0, 1] + r[:, 1, 0], r[:, 0, 2] + r[:, 2, 0], r[:, 1, 2] + r[:, 2, 1]
    # Row i is the quaternion times four times its i-th part.
    rows = np.stack(
        [
            np.stack([squares[:, 0], x, y, z], axis=-1),
            np.stack([x, squares[:, 1], xy, xz], axis=-1),
            np.stack([y, xy, squares[:, 2], yz], axis=-1),
            np.stack([z, xz, yz, squares[:, 3]], axis=-1),
        ],
        axis=1,
    )
    best = rows[np.arange(len(r)), squares.argmax(axis=1)]
    return best / np.linalg.norm(best, axis=1, keepdims=True), scale
