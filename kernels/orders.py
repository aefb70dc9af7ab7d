"""Ascending orders and places in tables, for kernels: what Numba's own functions take seconds to compile."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from .compiling import compiled

_RUN = 16
"""So many are sorted by putting one after the other in its place."""


@compiled
def rank(keys: NDArray[Any], order: NDArray[Any], spare: NDArray[Any]) -> None:
    """Write the places of ``keys`` (n,) in ascending order into ``order``; of equals the first stays the first.

    Args:
        keys: numbers, none of them NaN.
        order: (n or more,), whole numbers.
        spare: as ``order``; what stands in it is lost.
    """
    n, width = len(keys), _RUN
    for begin in range(0, n, width):
        for i in range(begin, min(begin + width, n)):
            key, k = keys[i], i
            while k > begin and keys[order[k - 1]] > key:
                order[k] = order[k - 1]
                k -= 1
            order[k] = i
    while width < n:
        for begin in range(0, n - width, 2 * width):
            middle, end = begin + width, min(begin + 2 * width, n)
            if keys[order[middle - 1]] > keys[order[middle]]:
                _merge(keys, order, spare, begin, middle, end)
        width *= 2


@compiled
def _merge(keys: NDArray[Any], order: NDArray[Any], spare: NDArray[Any], begin: int, middle: int, end: int) -> None:
    """Join the ascending places ``begin`` to ``middle`` and ``middle`` to ``end``."""
    for k in range(begin, middle):
        spare[k] = order[k]
    left, right, k = begin, middle, begin
    while left < middle:
        if right < end and keys[order[right]] < keys[spare[left]]:
            order[k] = order[right]
            right += 1
        else:
            order[k] = spare[left]
            left += 1
        k += 1


@compiled
def count_below(ascending: NDArray[Any], value: float) -> int:
    """How many of ascending numbers are smaller than ``value``."""
    low, high = 0, len(ascending)
    while low < high:
        middle = (low + high) // 2
        if ascending[middle] < value:
            low = middle + 1
        else:
            high = middle
    return low


@compiled
def count_upto(ascending: NDArray[Any], value: float) -> int:
    """How many of ascending numbers are no larger than ``value``: which of 0, 1, ... a chance gives, by their sums."""
    low, high = 0, len(ascending)
    while low < high:
        middle = (low + high) // 2
        if ascending[middle] <= value:
            low = middle + 1
        else:
            high = middle
    return low
