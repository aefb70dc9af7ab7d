"""Uniform, standard normal and standard exponential numbers from the steps of a generator, as NumPy makes them.

A generator is the NamedTuple of its state; what a step of it is, is bound to its kind (``kernels.binding``). Numbers
are NumPy's, bit for bit: 53 bits, and ziggurats of 256 layers.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba.np.random._constants import (
    fe_double,
    fi_double,
    ke_double,
    ki_double,
    we_double,
    wi_double,
    ziggurat_exp_r,
    ziggurat_nor_inv_r,
    ziggurat_nor_r,
)
from numpy.typing import NDArray

from .binding import by_kind
from .compiling import compiled

Array = NDArray[np.float64]

_LAST_BITS, _SIGN, _MANTISSA = np.uint64(0xFF), np.uint64(0x100), np.uint64(0x000FFFFFFFFFFFFF)
_ONE, _THREE, _TAIL, _LAYER, _FINE = np.uint64(1), np.uint64(3), np.uint64(8), np.uint64(9), np.uint64(11)
_UNIT = 1.0 / 9007199254740992.0


@by_kind
def stepped(state: Any) -> Any:
    """64 random bits and the state after them."""


@compiled
def uniform(state: Any) -> Any:
    """A number from 0 to below 1, and the state after it."""
    bits, state = stepped(state)
    return np.float64(bits >> _FINE) * _UNIT, state


@compiled
def normal(state: Any) -> Any:
    """A standard normal number, and the state after it."""
    while True:
        bits, state = stepped(state)
        layer, whole = bits & _LAST_BITS, (bits >> _LAYER) & _MANTISSA
        x = np.float64(whole) * wi_double[layer]
        if bits & _SIGN:
            x = -x
        if whole < ki_double[layer]:
            return x, state
        if layer == 0:
            while True:
                share, state = uniform(state)
                beyond = -ziggurat_nor_inv_r * np.log1p(-share)
                share, state = uniform(state)
                rest = -np.log1p(-share)
                if rest + rest > beyond * beyond:
                    x = ziggurat_nor_r + beyond
                    return (-x if (whole >> _TAIL) & _ONE else x), state
        share, state = uniform(state)
        if (fi_double[layer - _ONE] - fi_double[layer]) * share + fi_double[layer] < np.exp(-0.5 * x * x):
            return x, state


@compiled
def exponential(state: Any) -> Any:
    """A standard exponential number, and the state after it."""
    while True:
        bits, state = stepped(state)
        layer, whole = (bits >> _THREE) & _LAST_BITS, bits >> _FINE
        x = np.float64(whole) * we_double[layer]
        if whole < ke_double[layer]:
            return x, state
        share, state = uniform(state)
        if layer == 0:
            return ziggurat_exp_r - np.log1p(-share), state
        if (fe_double[layer - _ONE] - fe_double[layer]) * share + fe_double[layer] < np.exp(-x):
            return x, state


@compiled
def uniforms(state: Any, row: Array) -> Any:
    """Write such numbers all along a row; gives the state after them."""
    for i in range(len(row)):
        row[i], state = uniform(state)
    return state


@compiled
def normals(state: Any, row: Array) -> Any:
    """See ``uniforms``."""
    for i in range(len(row)):
        row[i], state = normal(state)
    return state


@compiled
def exponentials(state: Any, row: Array) -> Any:
    """See ``uniforms``."""
    for i in range(len(row)):
        row[i], state = exponential(state)
    return state
