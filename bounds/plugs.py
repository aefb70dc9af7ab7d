"""What the best use of plugs brings whose luck nobody knows: a linear programme over the chance that each is tried.

Whatever a policy does, a plug is tried at a speed with some chance, and what comes of that does not depend on why. So
means are linear in these chances: of what is planted, of the seconds, of the cells that are filled. Cells are filled
once; a price on filling them makes the plugs independent, and any price gives a bound (linear programming duality).
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.transplanting.columns import H
from ..envs.transplanting.config import HEALTHY
from .base import state_of

Array = NDArray[np.float64]

PRICES, ZOOMS = 33, 4
"""Prices of a filled cell that are tried, from nothing to what a plant is worth, then nearer and nearer the best."""


class Attempts(NamedTuple):
    """Plugs that may be tried, n of them, at S speeds.

    Attributes:
        row: (n,), source row of each.
        good: (S,), chance that it arrives healthy.
        fills: (S, n), chance that it fills a cell for good.
        plug_s: (S, n), mean seconds of trying it, but for the share of the cell.
    """

    row: NDArray[np.int64]
    good: Array
    fills: Array
    plug_s: Array


def most_by_shares(
    attempts: Attempts, used: Array, cell: Array, moves: Array, planted: float, left: float = 0.0
) -> float:
    """Largest mean of what is planted less what it costs.

    Args:
        attempts: the plugs.
        used: (S, n), mean cost of trying each.
        cell: (m,), cost of filling each cell, >= 0.
        moves: (rows,), cost of getting to each source row; with a single one all rows are there from the beginning.
        planted: worth of a healthy plant.
        left: what is saved by a plug that was tried in a row that is left.
    """
    worth = planted * attempts.good[:, None] - used
    rows = len(moves)
    row = attempts.row if rows > 1 else np.zeros_like(attempts.row)

    def at(prices: Array) -> Array:
        """Largest means (prices, rows) by the last row that is reached."""
        # Filled at a price, each cell earns what it costs less.
        filled = np.maximum(prices[:, None] - cell[None], 0.0).sum(axis=1)
        tried = (worth[None] - prices[:, None, None] * attempts.fills[None]).max(axis=1, initial=-np.inf)
        here, gone = np.zeros((len(prices), rows)), np.zeros((len(prices), rows))
        np.add.at(here.T, row, np.maximum(tried, 0.0).T)
        np.add.at(gone.T, row, np.maximum(tried + left, 0.0).T)
        before = np.concatenate([np.zeros((len(prices), 1)), np.cumsum(gone, axis=1)[:, :-1]], axis=1)
        return before + here + filled[:, None] - moves

    low, high, least = 0.0, max(planted, 0.0) + left, np.full(rows, np.inf)
    for _ in range(ZOOMS):
        prices = np.linspace(low, high, PRICES)
        totals = at(prices)
        least = np.minimum(least, totals.min(axis=0))
        best = int(totals[:, int(least.argmax())].argmin())
        low, high = float(prices[max(best - 1, 0)]), float(prices[min(best + 1, PRICES - 1)])
    return float(least.max())


def attempts_of(core: Any, prices: Any, use: NDArray[np.bool_], reports: str, row: int) -> Attempts:
    """Chances of the healthy plugs that may be carried, ``use`` (rows, n), at what a transplant takes at least."""
    state, times, extraction = state_of(core), core.times, core.config.process.extraction
    chances, (rows, columns) = core.terms.chances, np.nonzero(use)
    arrives = extraction * (1.0 - chances[:, H.lose])
    # A cell whose plug has come to harm is as good as planted where it was reported healthy: nobody clears it.
    told = (state.source_reports[row][rows, columns] == HEALTHY) & (reports != "any")
    good = arrives * (1.0 - chances[:, H.damage])
    return Attempts(
        row=rows,
        good=good,
        fills=np.where(told, arrives[:, None], good[:, None]),
        plug_s=extraction * (prices.plug_s[:, columns] + float(prices.cell_s.min()) + times.handle_s)
        + (1.0 - extraction) * times.grip_s,
    )
