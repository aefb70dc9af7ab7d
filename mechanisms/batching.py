"""Work on long batches in pieces that stay in the processor's cache."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

CHUNK_POSES = 8192
"""Poses a piece: about eight float64 temporaries of this length fit a 512 KiB second-level cache."""

Array = NDArray[np.float64]


def as_points(values: ArrayLike, width: int, name: str) -> Array:
    """Return ``values`` as float64 with shape ``(..., width)``.

    Raises:
        ValueError: the last axis has another length; the message names the argument and its shape.
    """
    array = np.asarray(values, dtype=np.float64)
    if array.ndim == 0 or array.shape[-1] != width:
        raise ValueError(f"{name} has shape {array.shape}: expected (..., {width})")
    return array


def in_chunks(kernel: Callable[[Array, Array], None], values: Array, width_out: int) -> Array:
    """Apply ``kernel(columns_in, columns_out)`` piece by piece.

    Args:
        kernel: reads contiguous columns ``(width_in, n)`` and fills contiguous columns ``(width_out, n)``.
        values: batch of shape ``(..., width_in)``.
        width_out: length of the result's last axis.

    Returns:
        Array of shape ``(..., width_out)``.
    """
    rows = values.reshape(-1, values.shape[-1])
    result = np.empty((len(rows), width_out))
    piece = min(CHUNK_POSES, max(len(rows), 1))
    columns_in = np.empty((values.shape[-1], piece))
    columns_out = np.empty((width_out, piece))
    with np.errstate(all="ignore"):
        for start in range(0, len(rows), piece):
            stop = min(start + piece, len(rows))
            if stop - start != columns_in.shape[1]:
                columns_in = np.empty((values.shape[-1], stop - start))
                columns_out = np.empty((width_out, stop - start))
            columns_in[:] = rows[start:stop].T
            kernel(columns_in, columns_out)
            result[start:stop] = columns_out.T
    return result.reshape((*values.shape[:-1], width_out))
