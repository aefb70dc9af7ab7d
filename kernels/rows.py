"""What Numba's own slices take seconds to compile: writing a row."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from .compiling import compiled


@compiled
def fill(row: NDArray[Any], value: float) -> None:
    """Write ``value`` all along a row."""
    for i in range(len(row)):
        row[i] = value


@compiled
def copy(source: NDArray[Any], target: NDArray[Any]) -> None:
    """Write the first elements of ``source`` all along ``target``."""
    for i in range(len(target)):
        target[i] = source[i]
