"""How near a head stands under higher ones, which hide it from a camera above, as machine code.

A row is taken as stretches as long as the largest gap that matters: who is near stands in the same or in the next. The
heads of each are a chain: ``first`` (C,) of a stretch and the one ``after`` (N,) each head, -1 where there is none.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled, fill
from ..core import Array
from .config import GAPS_M

_STRETCH_M = GAPS_M[-1]


def stretches(length_m: float) -> int:
    """How many a row is taken as."""
    return max(math.ceil(length_m / _STRETCH_M), 1)


@compiled
def stretch(begin_m: float, count: int, along_m: float) -> int:
    """In which of ``count`` something stands; what is before the first or behind the last is taken to it."""
    return int(min(max(math.floor((along_m - begin_m) / _STRETCH_M), 0.0), count - 1.0))


@compiled
def chain(
    begin_m: float, place: Array, exists: NDArray[np.bool_], first: NDArray[np.int64], after: NDArray[np.int64]
) -> None:
    """Write the chains of a row's heads (N, 3), where they exist (N,)."""
    fill(first, -1)
    for i in range(len(place)):
        if exists[i]:
            k = stretch(begin_m, len(first), place[i, 0])
            after[i], first[k] = first[k], i


@compiled
def gap_m(begin_m: float, place: Array, first: NDArray[np.int64], after: NDArray[np.int64], i: int) -> float:
    """How far head ``i`` is, seen from above, from the nearest higher one: exact below ``GAPS_M[-1]``, or more."""
    here, nearest = stretch(begin_m, len(first), place[i, 0]), np.inf
    for k in range(max(here - 1, 0), min(here + 2, len(first))):
        j = first[k]
        while j >= 0:
            if place[j, 2] > place[i, 2]:
                along, across = place[j, 0] - place[i, 0], place[j, 1] - place[i, 1]
                nearest = min(nearest, along * along + across * across)
            j = after[j]
    return math.sqrt(nearest)
