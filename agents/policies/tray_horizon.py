"""A planner for ordered trays: it plays the rest of an episode in expectation, and moves as the best play begins.

What is not seen yet counts as its tray's sowing says; a transplant takes what an average one does. A play serves any
order first, the others by their lorries' times. Supply comes from the tray that costs the least time a plug, turning,
rows and what is wasted counted at a price; before a row moves on the other grade may be planted from it. Plays differ
in that price, and in how many seedlings make that worth a turn. Which pair is planted, and how fast, ``assignment``
says.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...envs.transplanting.columns import NEXT_SOURCE, NEXT_TARGET, TURN_SOURCES, TURN_TARGETS, E, M, W
from ...envs.transplanting.config import SPEEDS
from ...envs.transplanting.order_columns import LEFT_SCALE_S
from ...envs.transplanting.timing import STRAIGHT, times
from ...kernels import compiled
from .base import Observation
from .dispatch import PLANT, Dispatch, Flags, Moves, O, S, carousels
from .transplanting import Assignment

Array = NDArray[np.float64]
PRICES_S = np.array([0.0, 0.5, 1.5])
"""Seconds that a seedling may cost which leaves with its row unused; each is tried."""
LEASTS = np.array([np.inf, 4.0, 2.5, 1.0])
"""So many seedlings of the other grade in the presented row are planted before it moves on; each is tried."""
_LEAST = 0.05
"""Fewer seedlings or cells are none: what is counted are expectations."""


class Planned(Dispatch):
    """The first move of the best play."""

    def __init__(self, config: Any, belief: Any):
        """Take what everything takes, and what seedlings are worth."""
        super().__init__(config, belief)
        scenario, table, weights = config.scenario, times(config), config.weights
        self._n, self._m = scenario.source.columns, scenario.target.columns
        self._rows = scenario.source.rows, scenario.target.rows
        self._trays = scenario.source_trays, scenario.target_trays
        normal = SPEEDS.index("normal")
        self._whole = belief.whole[normal]
        targets = self._n + np.arange(self._m)
        back = table.approach[STRAIGHT, targets][..., W.s].mean()
        rise = float(table.rise[targets, W.s].mean())
        self._numbers = np.array(
            [
                float(table.carry[normal, :, W.s].mean() + back + table.handle_s),
                belief.closes[normal],
                table.row_s[E.source, 0] + rise,
                table.row_s[E.target, 0] + rise,
                table.turn_s[E.source] + rise,
                table.turn_s[E.target] + rise,
                weights.planted,
                -weights.seconds,
                -weights.spoiled,
                self._m,
            ]
        )

    def moves(self, observation: Observation, pairs: Flags) -> Moves:
        """See ``Dispatch``."""
        machine, seen, mask = observation["machine"], carousels(observation), observation["action_mask"]
        there, move = pairs.any(axis=1), np.zeros(len(pairs), np.int64)
        source, order = seen.source[:, : self._trays[0]], seen.order[:, : self._trays[1]]
        for w in range(len(pairs)):
            supply = np.empty((self._trays[0], 7))
            supply[:, 0] = np.round(source[w, :, S.rows] * self._rows[0])
            supply[:, 1:3] = np.round(source[w][:, [S.first, S.second]] * self._n)
            share = source[w, :, S.share].astype(np.float64)
            supply[:, 3:5] = self._n * self.belief.reported(share)
            supply[:, 5:] = self._whole * self.belief.right(share)
            orders = np.zeros((self._trays[1], 4))
            cells = np.round(order[w, :, O.cells] * self._rows[1] * self._m)
            orders[:, 0] = order[w, :, O.second]
            orders[:, 1] = np.where(order[w, :, O.open] > 0.0, order[w, :, O.left] * LEFT_SCALE_S, 0.0)
            waiting = np.where(cells > 0.0, (cells - 1.0) % self._m + 1.0, 0.0)
            if orders[0, 1] > 0.0:
                waiting[0] = round(float(machine[w, M.gaps]) * self._m)
            orders[:, 2], orders[:, 3] = waiting, np.round((cells - waiting) / self._m)
            # A tray that is full goes.
            full = orders[0, 1] > 0.0 and cells[0] == 0.0
            move[w] = NEXT_TARGET if full else best_move(self._numbers, PRICES_S, LEASTS, supply, orders)
        # What a play begins with may not be possible: a last row that is empty, an order that is about to close.
        possible = np.take_along_axis(mask, mask.shape[1] + np.minimum(move, -1)[:, None], axis=1)[:, 0] > 0
        move = np.where((move == PLANT) | possible, move, NEXT_TARGET)
        return np.where((move == PLANT) & ~there, NEXT_TARGET, move)


class RecedingHorizon(Assignment):
    """``assignment`` that presents what the best play of the rest of the episode begins with."""

    name, dispatch = "receding-horizon", Planned


@compiled
def best_move(numbers: Array, prices_s: Array, leasts: Array, supply: Array, orders: Array) -> int:
    """The first move of the play that is worth most.

    Args:
        numbers: seconds of a transplant, the chance that it closes its cell, seconds of a source row, a target row, a
            turn of either carousel; worth of a cell, of a second, of a wasted seedling; cells of a target row.
        prices_s: see ``PRICES_S``.
        leasts: see ``LEASTS``.
        supply: (source trays, 7), from the presented one on: rows behind the waiting one, seedlings reported to be of
            either grade in that one, and in an average row, chances that they are and arrive unhurt.
        orders: (orders, 4), from the presented one on: grade, seconds left (0: closed), open cells of the waiting row,
            rows behind it.
    """
    best, move = -np.inf, NEXT_TARGET
    for first in range(len(orders)):
        if orders[first, 1] <= 0.0:
            continue
        for least in leasts:
            for price_s in prices_s:
                value, begins = play(numbers, price_s, least, supply, orders, first)
                if value > best + 1e-9:
                    best, move = value, begins
    return move


@compiled
def play(numbers: Array, price_s: float, least: float, supply: Array, orders: Array, first: int) -> tuple[float, int]:
    """Worth of a play that serves ``first`` first, and the move that it begins with."""
    stock, open_cells, behind = supply.copy(), orders[:, 2].copy(), orders[:, 3].copy()
    begins, now_s, planted, wasted, tray, order, this = 1, 0.0, 0.0, 0.0, 0, 0, first
    tau, chance, source_s, target_s = numbers[0], numbers[1], numbers[2], numbers[3]
    while this >= 0:
        if this != order:
            begins = TURN_TARGETS if begins > 0 else begins
            now_s += ((this - order) % len(orders)) * numbers[5]
            order = this
        grade = int(orders[this, 0])
        if now_s >= orders[this, 1]:
            open_cells[this], behind[this] = 0.0, 0.0
        elif open_cells[this] < _LEAST and behind[this] > 0.5:
            begins = NEXT_TARGET if begins > 0 else begins
            behind[this] -= 1.0
            open_cells[this] = numbers[9]
            now_s += target_s
            continue
        elif open_cells[this] >= _LEAST and stock[tray, 1 + grade] >= _LEAST:
            begins = PLANT if begins > 0 else begins
            used = min(stock[tray, 1 + grade], open_cells[this] / chance, (orders[this, 1] - now_s) / tau + _LEAST)
            now_s += used * tau
            planted += (used if now_s <= orders[this, 1] else max(used - _LEAST, 0.0)) * chance * stock[tray, 5 + grade]
            open_cells[this] = max(open_cells[this] - used * chance, 0.0)
            stock[tray, 1 + grade] -= used
            continue
        elif open_cells[this] >= _LEAST:
            if stock[tray, 2 - grade] >= least:
                other = soonest(orders, open_cells, behind, now_s, 1 - grade)
                if other >= 0:
                    this = other
                    continue
            need = (open_cells[this] + behind[this] * numbers[9]) / chance
            to = cheapest_tray(numbers, price_s, stock, tray, grade, need)
            if to >= 0:
                if to != tray:
                    begins = TURN_SOURCES if begins > 0 else begins
                    now_s += ((to - tray) % len(stock)) * numbers[4]
                    tray = to
                if stock[tray, 1 + grade] < _LEAST:
                    begins = NEXT_SOURCE if begins > 0 else begins
                    wasted += stock[tray, 1] + stock[tray, 2]
                    stock[tray, 0] -= 1.0
                    stock[tray, 1], stock[tray, 2] = stock[tray, 3], stock[tray, 4]
                    now_s += source_s
                continue
            # Nothing of this grade is left.
            open_cells[this], behind[this] = 0.0, 0.0
        this = soonest(orders, open_cells, behind, now_s, -1)
    return numbers[6] * planted - numbers[7] * now_s - numbers[8] * wasted, (NEXT_TARGET if begins > 0 else begins)


@compiled
def soonest(orders: Array, open_cells: Array, behind: Array, now_s: float, grade: int) -> int:
    """The order of a grade (-1: of any) that lacks something and whose lorry leaves first; -1 where there is none."""
    found, left_s = -1, np.inf
    for k in range(len(orders)):
        lacks = open_cells[k] >= _LEAST or behind[k] > 0.5
        if lacks and now_s < orders[k, 1] < left_s and (grade < 0 or orders[k, 0] == grade):
            found, left_s = k, orders[k, 1]
    return found


@compiled
def cheapest_tray(numbers: Array, price_s: float, stock: Array, tray: int, grade: int, need: float) -> int:
    """The tray that gives plugs of a grade for the fewest seconds each; -1 where none has any."""
    best, found = np.inf, -1
    for to in range(len(stock)):
        here, a_row, rows = stock[to, 1 + grade], stock[to, 3 + grade], stock[to, 0]
        if here < _LEAST and (rows < 0.5 or a_row < _LEAST):
            continue
        more = min(max(np.ceil((need - here) / max(a_row, _LEAST)), 0.0), rows)
        plugs = min(need, here + more * a_row)
        cost_s = ((to - tray) % len(stock)) * numbers[4] + more * numbers[2]
        if more > 0.0:
            cost_s += price_s * (stock[to, 2 - grade] + (more - 1.0) * stock[to, 4 - grade])
        if cost_s / plugs < best:
            best, found = cost_s / plugs, to
    return found
