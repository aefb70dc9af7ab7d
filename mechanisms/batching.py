"""Work on long batches in pieces that stay in the processor's cache."""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import NamedTuple

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
    array = np.asarray(values, np.float64)
    if array.ndim == 0 or array.shape[-1] != width:
        raise ValueError(f"{name} has shape {array.shape}: expected (..., {width})")
    return array


class Solver(NamedTuple):
    """Machine code that fills its last argument with joint values, from poses and a machine's numbers."""

    one: Callable[[Array, Array, Array], None]
    """Of one pose (width,)."""
    many: Callable[[Array, Array, Array], None]
    """Of poses (n, width); bit for bit what ``one`` says of each."""


_FLOAT64 = np.dtype(np.float64)
_solvers: dict[str, Solver] = {}


def _loaded(module: str) -> Solver:
    """Numba loads with the first pose, not with a geometry."""
    kernels = import_module(f".{module}", __package__)
    _solvers[module] = Solver(kernels.inverse_of_one, kernels.inverse_of_many)
    return _solvers[module]


def solve_rows(module: str, numbers: Array, values: ArrayLike, width: int, name: str) -> Array:
    """Joint values (..., width) of poses (..., width): as many joints as a pose has numbers.

    Args:
        module: of this room, with ``inverse_of_one`` and ``inverse_of_many``.
        numbers: what it is told of the machine.
        values: poses; what is strided or locked is copied, for machine code is made for one kind of array.
        width: numbers a pose.
        name: of the argument, for the message.

    Raises:
        ValueError: as ``as_points``.
    """
    # One pose by itself is a matter of 300 ns: what is not asked for twice is a third of all the rest.
    points = values if type(values) is np.ndarray and values.dtype is _FLOAT64 else np.asarray(values, np.float64)
    solver = _solvers.get(module) or _loaded(module)
    if points.shape == (width,) and points.flags.carray:
        result = np.empty(width)
        solver.one(points, numbers, result)
        return result
    rows = as_points(points, width, name).reshape(-1, width)
    result = np.empty(rows.shape)
    solver.many(rows if rows.flags.carray else rows.copy(), numbers, result)
    return result.reshape(points.shape)


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
