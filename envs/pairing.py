"""Which reports belong to which things, for those who measure cameras."""

from __future__ import annotations

import numpy as np

from .core import Array


def nearest_pairs(distance: Array, limit: float) -> list[tuple[int, int]]:
    """Rows and columns of a table (n, m) of distances that belong together: nearest first, each once, up to a limit."""
    pairs: list[tuple[int, int]] = []
    rows, columns = set[int](), set[int]()
    for flat in np.argsort(distance, axis=None):
        row, column = divmod(int(flat), distance.shape[1])
        if distance[row, column] > limit:
            break
        if row not in rows and column not in columns:
            pairs.append((row, column))
            rows.add(row)
            columns.add(column)
    return pairs
