"""Bounds for the tray transplanter where trays are ordered.

Full knowledge as in ``transplanting``, and the same shares of a transplant's time. By each lorry's time only so much
can have been done: for the orders that have left by then, the transplants with their shares, the rows that were
presented on both sides, and a turn for every tray that was brought. A linear program over all lorries at once holds
together which plugs these are and which rows hold them; what is left out is which rows meet and in what sequence, and
that plugs, rows and trays come whole.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import csr_array, vstack

from ..envs.transplanting.columns import E
from ..envs.transplanting.config import EMPTY, HEALTHY, POOR, TransplantingConfig
from ..envs.transplanting.core import TransplantingCore
from .base import Bound, check_method, check_start, state_of
from .transplanting import OPEN, USELESS, Shares, TrayInstance, fastest, shares
from .transplanting import instance_of as trays_in_line

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
_WORDS = "linear program over lorries, rows and plugs; shares of plugs and cells from assignment duals"


class Rows(NamedTuple):
    """Inequalities ``matrix @ x <= limit``, as they are gathered."""

    parts: list[Any]
    limits: list[Array]

    def add(self, count: int, size: int, entries: list[tuple[Any, Any, Any]], limit: Any) -> None:
        """So many more, of (row, column, value) arrays."""
        row, column, value = (
            np.concatenate(
                [np.broadcast_to(part[i], np.broadcast_shapes(*map(np.shape, part))).ravel() for part in entries]
            )
            for i in range(3)
        )
        self.parts.append(csr_array((value.astype(float), (row, column)), shape=(count, size)))
        self.limits.append(np.broadcast_to(np.asarray(limit, float), (count,)))


@dataclass(frozen=True, eq=False)
class OrderInstance:
    """Ordered trays with their luck.

    Attributes:
        speed: (source rows, n), fastest speed at which a plug arrives whole, ``USELESS`` where none does.
        content: (source rows, n), its grade as a cell's content.
        sold: (source rows,), seedlings of either grade that a row holds.
        trays: source trays.
        cells: (orders, m), open cells of each column.
        grade: (orders,), content that an order's cells are to hold.
        due_s: (orders,), when its lorry leaves.
        all_cells: ordered cells.
        shares: what a transplant takes.
        row_s: (2,), a conveyor's row, see ``Ends``.
        turn_s: (2,), a carousel's tray.
        handle_s: gripping and releasing.
        config: the task's numbers.
        words: what is known of the reports.
    """

    speed: Numbers
    content: Numbers
    sold: Array
    trays: int
    cells: Numbers
    grade: Numbers
    due_s: Array
    all_cells: int
    shares: Shares
    row_s: Array
    turn_s: Array
    handle_s: float
    config: TransplantingConfig
    words: str

    def bound(self, method: str = "relaxation", time_limit_s: float = 60.0) -> Bound:
        """What no policy can beat; see ``Instance``. Both methods are the same.

        Raises:
            ValueError: unknown method, or a reward that pays for time or for spoiled seedlings.
        """
        check_method(method)
        weights = self.config.weights
        if min(weights.planted, -weights.spoiled, -weights.seconds) < 0.0:
            raise ValueError(f"{weights}: the bound needs planted >= 0, spoiled <= 0 and seconds <= 0")
        began = time.perf_counter()
        program = _Program(self)
        most = math.floor(program.most_cells() + 1e-6)
        net_rate, value = most / self.all_cells, program.largest_return()
        cycle_s = program.cycle_time(max(most, 1)) if most else math.inf
        words = f"{_WORDS}; {self.words}"
        return Bound(net_rate, value, cycle_s, words, False, math.nan, time.perf_counter() - began)

    def cycle_time_at(self, net_rate: float) -> float:
        """Seconds that the cycle time cannot fall below with at least this net rate; infinite when it cannot be had."""
        return _Program(self).cycle_time(max(math.ceil(net_rate * self.all_cells - 1e-9), 1))


class _Program:
    """The linear program of an instance.

    Variables, lorries k in the order in which they leave: plugs for orders that left with lorry k or before (k, p);
    rows presented by then (k, r); cells filled by order and column; orders served; cells planted again after clearing;
    seconds of everything; seedlings wasted by row.
    """

    def __init__(self, instance: OrderInstance):
        """Write the inequalities down."""
        self.of = of = instance
        rows = len(of.speed)
        orders, m = of.cells.shape
        at, column = np.nonzero(of.speed != USELESS)
        content = of.content[at, column]
        self.plug_s = of.shares.plug_s[of.speed[at, column], column] + of.handle_s
        plugs, per = len(at), rows // of.trays
        leaves = np.argsort(of.due_s, kind="stable")
        sizes = (orders * plugs, orders * rows, orders * m, orders, 1, 1, rows)
        begin = np.concatenate([[0], np.cumsum(sizes)])
        self.size = size = int(begin[-1])
        used = begin[0] + np.arange(sizes[0]).reshape(orders, plugs)
        shown = begin[1] + np.arange(sizes[1]).reshape(orders, rows)
        filled = begin[2] + np.arange(sizes[2]).reshape(orders, m)
        served, self.again, self.seconds = begin[3] + np.arange(orders), int(begin[4]), int(begin[5])
        wasted = begin[6] + np.arange(rows)
        self.filled, self.wasted = filled, wasted
        upper = np.ones(size)
        upper[filled], upper[self.again], upper[wasted] = of.cells, np.inf, np.inf
        # Nothing is gained when the last lorry has left.
        upper[self.seconds] = of.due_s.max()
        self.upper = upper
        held = Rows([], [])
        each, k = np.arange(plugs), np.arange(orders)[:, None]
        # A plug is used from a row that was presented; what was used or presented stays so.
        held.add(orders * plugs, size, [(k * plugs + each, used, 1.0), (k * plugs + each, shown[:, at], -1.0)], 0.0)
        for things in (used, shown):
            last = things.shape[1] * (orders - 1)
            count = np.arange(last)
            if last:
                held.add(last, size, [(count, things[:-1].ravel(), 1.0), (count, things[1:].ravel(), -1.0)], 0.0)
        inner = np.flatnonzero(np.arange(rows) % per)
        count = np.arange(orders * len(inner))
        if len(count):
            held.add(
                len(count),
                size,
                [(count, shown[:, inner].ravel(), 1.0), (count, shown[:, inner - 1].ravel(), -1.0)],
                0.0,
            )
        # Whoever fills cells of an order serves it.
        count = np.arange(orders)
        held.add(
            orders, size, [(count[:, None], filled, 1.0), (count, served, -of.cells.sum(axis=1).astype(float))], 0.0
        )
        source_s = np.where(np.arange(rows) % per, of.row_s[E.source], of.turn_s[E.source])
        source_s[0] = 0.0
        for place in range(orders):
            left = leaves[: place + 1]
            for grade in (HEALTHY, POOR):
                mine = left[of.grade[left] == grade]
                entries = [(0, filled[mine].ravel(), 1.0), (0, used[place, content == grade], -1.0)]
                held.add(1, size, entries, 0.0)
            last = place == orders - 1
            cell_s = of.shares.cell_s + of.row_s[E.target] / m
            entries = [
                (0, used[place], self.plug_s),
                (0, shown[place], source_s),
                (0, filled[left], cell_s[None, :]),
                (0, served[left], np.where(left == 0, 0.0, of.turn_s[E.target]) - of.row_s[E.target]),
            ]
            held.add(1, size, entries, of.due_s[left[-1]] - of.shares.once_s)
            if last:
                again_s = float(self.plug_s.min(initial=np.inf) + (of.shares.cell_s + of.shares.clear_s).min())
                self.again_s = again_s if plugs else 0.0
                entries += [(0, self.again, self.again_s), (0, self.seconds, -1.0)]
                held.add(1, size, entries, -of.shares.once_s)
        # Seedlings of a row that was left and were not planted.
        behind = np.flatnonzero((np.arange(rows) + 1) % per)
        count = np.arange(len(behind))
        if len(count):
            spot = np.full(rows, -1)
            spot[behind] = count
            of_plug = spot[at]
            entries = [(count, shown[-1, behind + 1], of.sold[behind]), (count, wasted[behind], -1.0)]
            entries.append((of_plug[of_plug >= 0], used[-1, of_plug >= 0], -1.0))
            held.add(len(count), size, entries, 0.0)
        self.matrix, self.limit = vstack(held.parts).tocsr(), np.concatenate(held.limits)

    def most_cells(self) -> float:
        """Most cells that can be filled in time."""
        cost = np.zeros(self.size)
        cost[self.filled] = -1.0
        return -self._least(cost)

    def largest_return(self) -> float:
        """No episode's rewards add up to more."""
        weights = self.of.config.weights
        cost = np.zeros(self.size)
        cost[self.filled], cost[self.seconds] = -weights.planted, -weights.seconds
        # A plug that is planted and taken out again is not counted as spoiled: that must not pay.
        if -weights.spoiled <= -weights.seconds * self.again_s:
            cost[self.wasted] = -weights.spoiled
        return -self._least(cost)

    def cycle_time(self, cells: int) -> float:
        """Least seconds a planted seedling with so many cells filled; infinite where there are not as many."""
        need = np.zeros(self.size)
        need[self.filled] = -1.0
        each_s = math.inf
        for _ in range(20):
            cost = np.zeros(self.size)
            cost[self.seconds] = 1.0
            if math.isfinite(each_s):
                cost[self.filled] = cost[self.again] = -each_s
            found = self._solve(cost, need, -float(cells) + 1e-6)
            if found is None:
                return math.inf
            planted = float(found[self.filled].sum() + found[self.again])
            now_s = float(found[self.seconds]) / planted
            if now_s >= each_s - 1e-9:
                break
            each_s = now_s
        return each_s - 1e-6

    def _least(self, cost: Array) -> float:
        found = self._solve(cost)
        return 0.0 if found is None else float(cost @ found)

    def _solve(self, cost: Array, row: Array | None = None, limit: float = 0.0) -> Array | None:
        matrix, limits = self.matrix, self.limit
        if row is not None:
            matrix, limits = vstack([matrix, csr_array(row[None])]).tocsr(), np.append(limits, limit)
        bounds = np.stack([np.zeros(self.size), self.upper], axis=1)
        found = linprog(cost, A_ub=matrix, b_ub=limits, bounds=bounds, method="highs")
        return found.x if found.status == 0 else None


def instance_of(core: TransplantingCore, reports: str = "drawn", row: int = 0) -> OrderInstance | TrayInstance:
    """What stands in a world of the rules right after its reset, ordered or not; see ``transplanting.instance_of``.

    Raises:
        ValueError: the episode is under way, or ``reports`` is unknown.
    """
    state, config = state_of(core), core.config
    if not config.scenario.orders.on:
        return trays_in_line(core, reports, row)
    check_start(reports, state.place[row] != core.places.park or state.source_row[row] or state.target_row[row])
    (rows_s, _), (rows_t, m) = core.source_shape, core.target_shape
    source, table = state.source_cells[row, :rows_s], core.times
    speed = fastest(core, row, (source == HEALTHY) | (source == POOR))
    grade, rows = state.grade[row].astype(np.int64), core.target_trays[1]
    prices = shares(core.places, table, speed, np.full((rows_t, m), OPEN))
    lacks = np.ones((rows_t, m), bool)
    if reports != "any":
        speed[state.source_reports[row, :rows_s] == EMPTY] = USELESS
        # A cell that is taken to hold what it should is never served.
        lacks = state.target_reports[row, :rows_t] != np.repeat(grade, rows)[:, None]
    return OrderInstance(
        speed=speed,
        content=source.astype(np.int64),
        sold=np.count_nonzero((source == HEALTHY) | (source == POOR), axis=1).astype(np.float64),
        trays=core.source_trays[0],
        cells=lacks.reshape(-1, rows, m).sum(axis=1),
        grade=grade,
        due_s=state.due_s[row].copy(),
        all_cells=rows_t * m,
        shares=prices,
        row_s=table.row_s[:, 0].copy(),
        turn_s=table.turn_s,
        handle_s=table.handle_s,
        config=config,
        words="any reports" if reports == "any" else "reports as drawn",
    )
