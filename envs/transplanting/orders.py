"""Ordered trays on two carousels: which are open, which comes next, what is wanted; kernels over ``rules.Worlds``.

Worlds without orders have no trays on carousels; every function says then what holds for trays that pass in line.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled, fill
from ..columns import names, numbered
from .columns import SHOWN, E, M, T
from .config import EMPTY, HEALTHY
from .order_columns import LEFT_SCALE_S, ORDERS_AT, SOURCES_AT, Order, SourceTray

_S, _O = numbered(SourceTray), numbered(Order)
_TRAY, _ORDER = len(names(SourceTray)), len(names(Order))


@compiled
def ordered(worlds: Any) -> bool:
    """Whether trays are ordered."""
    return worlds.due_s.shape[1] > 0


@compiled
def source_rows(worlds: Any) -> int:
    """Rows of a source tray on its carousel."""
    return (worlds.source_cells.shape[1] - 1) // worlds.source_at.shape[1]


@compiled
def target_rows(worlds: Any) -> int:
    """Rows of an ordered tray."""
    return (worlds.target_cells.shape[1] - 1) // worlds.due_s.shape[1]


@compiled
def source_tray(worlds: Any, w: int) -> int:
    """The source tray that is presented."""
    return worlds.source_row[w] // source_rows(worlds)


@compiled
def source_left(worlds: Any, w: int) -> int:
    """Rows of the presented source tray behind the one that is presented."""
    return (source_tray(worlds, w) + 1) * source_rows(worlds) - 1 - worlds.source_row[w]


@compiled
def order(worlds: Any, w: int) -> int:
    """The ordered tray that is presented; the last one, when all have gone."""
    return min(worlds.target_row[w] // target_rows(worlds), worlds.due_s.shape[1] - 1)


@compiled
def is_open(worlds: Any, w: int, tray: int) -> bool:
    """Whether an ordered tray can still be served: it has a row, and its lorry is there."""
    rows_left = worlds.target_at[w, tray] < (tray + 1) * target_rows(worlds)
    return rows_left and worlds.totals[w, T.time] < worlds.due_s[w, tray]


@compiled
def steps_on(worlds: Any, w: int) -> int:
    """How far the next open order is on the carousel; 0 where there is no other."""
    here, trays = order(worlds, w), worlds.due_s.shape[1]
    for step in range(1, trays):
        if is_open(worlds, w, (here + step) % trays):
            return step
    return 0


@compiled
def wanted(worlds: Any, w: int) -> int:
    """What the presented target cells are to hold; -1 where nothing gains any more."""
    if not ordered(worlds):
        return HEALTHY
    tray = order(worlds, w)
    return worlds.grade[w, tray] if is_open(worlds, w, tray) else -1


@compiled
def turn(worlds: Any, w: int, side: int, tray: int) -> bool:
    """Present a tray at the row at which it stands; says whether it never was presented before."""
    if side == E.source:
        worlds.source_row[w] = worlds.source_at[w, tray]
    else:
        worlds.target_row[w] = worlds.target_at[w, tray]
    new = not worlds.seen[w, side, tray]
    worlds.seen[w, side, tray] = True
    return new


@compiled
def all_gone(worlds: Any, w: int) -> bool:
    """Whether no order is open any more."""
    for tray in range(worlds.due_s.shape[1]):
        if is_open(worlds, w, tray):
            return False
    return True


@compiled
def show_orders(supply: NDArray[np.float64], worlds: Any, w: int, machine: NDArray[np.float32]) -> None:
    """Write a world's carousels behind the features of ``Machine``, and put its rows that are left right."""
    n, m = worlds.source_reports.shape[2], worlds.target_reports.shape[2]
    trays, rows, here = worlds.source_at.shape[1], source_rows(worlds), source_tray(worlds, w)
    fill(machine[SOURCES_AT:], 0.0)
    left = 0
    for place in range(trays):
        tray, at = (here + place) % trays, SOURCES_AT + place * _TRAY
        row = worlds.source_at[w, tray]
        behind = (tray + 1) * rows - 1 - row
        first, second = 0, 0
        if worlds.seen[w, E.source, tray]:
            for column in range(n):
                seen = worlds.source_reports[w, row, column]
                first += seen == HEALTHY
                second += seen != HEALTHY and seen != EMPTY
        left += behind
        machine[at + _S.rows], machine[at + _S.share] = behind / rows, supply[tray]
        machine[at + _S.first], machine[at + _S.second] = first / n, second / n
    machine[M.source_rows] = left / (trays * rows)
    orders, rows, here, left = worlds.due_s.shape[1], target_rows(worlds), order(worlds, w), 0
    for place in range(orders):
        tray, at = (here + place) % orders, ORDERS_AT + place * _ORDER
        if not is_open(worlds, w, tray):
            continue
        row, grade = worlds.target_at[w, tray], worlds.grade[w, tray]
        behind = (tray + 1) * rows - 1 - row
        cells = behind * m
        for column in range(m):
            cells += not worlds.seen[w, E.target, tray] or worlds.target_reports[w, row, column] != grade
        left += behind
        machine[at + _O.open], machine[at + _O.second] = 1.0, grade != HEALTHY
        machine[at + _O.left] = min((worlds.due_s[w, tray] - worlds.totals[w, T.time]) / LEFT_SCALE_S, SHOWN)
        machine[at + _O.cells] = cells / (rows * m)
    machine[M.target_rows] = left / (orders * rows)
