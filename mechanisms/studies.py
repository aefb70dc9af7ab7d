"""How a figure of a mechanism changes over two of its dimensions at a time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .batching import Array


@dataclass(frozen=True)
class ParameterStudy:
    """A figure over two dimensions.

    Attributes:
        first: values of the first dimension, (m,).
        second: values of the second dimension, (n,).
        values: the figure, (m, n); NaN where such a mechanism cannot be built.
    """

    first: Array
    second: Array
    values: Array

    @property
    def best(self) -> tuple[float, float]:
        """The two dimensions at the largest value."""
        i, j = self._best_index()
        return float(self.first[i]), float(self.second[j])

    @property
    def best_on_rim(self) -> bool:
        """Whether the largest value lies on the rim of the studied range, so that a wider range would hold a larger."""
        i, j = self._best_index()
        return i in (0, len(self.first) - 1) or j in (0, len(self.second) - 1)

    @property
    def summit(self) -> np.ndarray:
        """Cells (m, n) that share the largest value, to one part in 10^9; a ridge shows as a line of them."""
        top = np.nanmax(self.values)
        with np.errstate(invalid="ignore"):
            return self.values >= top - 1e-9 * abs(top) - np.finfo(float).tiny

    @property
    def peaks(self) -> int:
        """Number of separate plateaus that are higher than all that touches them, diagonally too."""
        height = np.where(np.isnan(self.values), -np.inf, self.values)
        around = _neighbours(height, -np.inf)
        slack = 1e-9 * np.abs(self.values[np.isfinite(self.values)]).max(initial=0.0)
        summit = np.isfinite(height) & (height >= around.max(axis=0) - slack)
        level = np.abs(around - np.where(np.isfinite(height), height, np.inf)) <= slack
        while True:
            # A cell level with one that is no summit stands on the same plateau, beside something higher.
            lower = summit & (level & ~_neighbours(summit, True)).any(axis=0)
            if not lower.any():
                return _count_touching(summit)
            summit = summit & ~lower

    def _best_index(self) -> tuple[int, int]:
        i, j = np.unravel_index(int(np.nanargmax(self.values)), self.values.shape)
        return int(i), int(j)


def parameter_study(figure: Callable[[float, float], float], first: ArrayLike, second: ArrayLike) -> ParameterStudy:
    """Evaluate a figure (a volume, a condition number) over two dimensions.

    Args:
        figure: maps two dimensions to a number; a ``ValueError`` (no such mechanism, nothing reachable) counts as NaN.
        first: values of the first dimension, (m,).
        second: values of the second dimension, (n,).
    """
    rows, columns = np.asarray(first, dtype=float), np.asarray(second, dtype=float)
    values = np.full((len(rows), len(columns)), np.nan)
    for i, a in enumerate(rows):
        for j, b in enumerate(columns):
            try:
                values[i, j] = figure(float(a), float(b))
            except ValueError:
                continue
    return ParameterStudy(rows, columns, values)


def _neighbours(values: np.ndarray, beyond: float | bool) -> np.ndarray:
    """The eight neighbours of every cell, (8, m, n); ``beyond`` past the rim."""
    m, n = values.shape
    padded = np.pad(values, 1, constant_values=beyond)
    return np.stack([padded[i : i + m, j : j + n] for i in range(3) for j in range(3) if (i, j) != (1, 1)])


def _count_touching(mask: np.ndarray) -> int:
    """Connected parts of a small lattice whose cells touch along diagonals too."""
    left = {(int(i), int(j)) for i, j in np.argwhere(mask)}
    count = 0
    while left:
        count += 1
        front = [left.pop()]
        while front:
            i, j = front.pop()
            touching = left & {(i + k, j + h) for k in (-1, 0, 1) for h in (-1, 0, 1)}
            left -= touching
            front += touching
    return count
