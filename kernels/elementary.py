"""Functions of arrays whose last digit does not depend on the processor.

NumPy's own take another routine where the processor has wide registers, and its results differ from the others' in the
last digit. Whatever enters a field, a tolerance or a score goes through these, one number after the other.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .compiling import compiled

Array = NDArray[np.float64]


def exp(exponents: ArrayLike) -> Array:
    """E to the power of each number, of the same shape."""
    numbers = np.asarray(exponents, np.float64)
    result = np.empty(numbers.size)
    _exp(np.ascontiguousarray(numbers).reshape(-1), result)
    return result.reshape(numbers.shape)


def power(bases: ArrayLike, exponent: float) -> Array:
    """Each number, from 0, to the power ``exponent``, of the same shape."""
    numbers = np.asarray(bases, np.float64)
    result = np.empty(numbers.size)
    _power(np.ascontiguousarray(numbers).reshape(-1), float(exponent), result)
    return result.reshape(numbers.shape)


@compiled
def _exp(numbers: Array, result: Array) -> None:
    for i in range(len(numbers)):
        result[i] = math.exp(numbers[i])


@compiled
def _power(numbers: Array, exponent: float, result: Array) -> None:
    for i in range(len(numbers)):
        result[i] = math.pow(numbers[i], exponent)
