"""What the best use of plugs brings that are tried for orders, each of which leaves with its lorry: a linear program.

By each lorry's time only so much can have been done: the plugs that were tried, each of which takes its share of a
transplant, the rows that were presented on both sides, the cells that had to be cleared to be served again, and the
carousels' turns. So it is told between which lorries a plug is tried:

- A row that has moved on does not come back: once its tray's next one has been presented none of its plugs is tried.
- Carousels turn one way. To present a tray takes the turns up to its place, and to come from an order of one grade to
  one of the other those up to the next change of grade; a round of the carousel has only so many.
- A row that plugs are taken from for both grades waits while the orders change: either it is presented then, or its
  tray has been turned away and comes back, a round. Of the rows of a tray no two wait for the same change, and no
  change finds two trays presented: so there are at least as many changes as such rows in any tray, and as many changes
  and turns of the supply together as such rows in all.

All of this holds on every path of every episode; it is linear, so it holds for means over luck too, where what is
tried stands for the chance that it is.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog
from scipy.sparse import csr_array, vstack

from ..envs.transplanting.columns import E
from ..envs.transplanting.config import HEALTHY, POOR, RewardWeights
from .transplanting import Shares

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
_SOLVED, _IMPOSSIBLE = 0, 2


class Bench(NamedTuple):
    """Trays on carousels.

    Attributes:
        source: source trays, and rows of each.
        cells: (orders, m), cells of each column that lack what they are to hold.
        grade: (orders,), content that an order's cells are to hold.
        due_s: (orders,), when its lorry leaves.
        sold: (source rows,), seedlings that a row holds, or their mean.
        shares: what a transplant takes.
        row_s: (2,), a conveyor's row, see ``Ends``.
        turn_s: (2,), a carousel's tray.
        weights: of the reward.
    """

    source: tuple[int, int]
    cells: Numbers
    grade: Numbers
    due_s: Array
    sold: Array
    shares: Shares
    row_s: Array
    turn_s: Array
    weights: RewardWeights


class Tries(NamedTuple):
    """Ways to try a plug for an order, o of them, of P plugs; each plug is tried once at most.

    Attributes:
        row: (P,), source row of a plug.
        holds: (P,), chance that it is one.
        plug: (o,), which one is tried.
        order: (o,), for which order.
        gain: (o,), chance that a cell holds what it is to hold.
        arrives: (o,), chance that something is set into it.
        closes: (o,), whether it is taken to be done then, whatever came; else it can be cleared and served again.
        try_s: (o,), mean seconds, with the least share of a cell.
    """

    row: Numbers
    holds: Array
    plug: Numbers
    order: Numbers
    gain: Array
    arrives: Array
    closes: NDArray[np.bool_]
    try_s: Array


class _Rows:
    """Inequalities ``entries @ x <= limit``, as they are gathered."""

    def __init__(self) -> None:
        self.parts: list[Any] = []
        self.limits: list[Array] = []

    def add(self, count: int, entries: list[tuple[Any, Any, Any]], limit: float = 0.0) -> None:
        """So many more, of (row, column, value) arrays that broadcast."""
        whole = [[part.ravel() for part in np.broadcast_arrays(*entry)] for entry in entries]
        self.parts.append((count, *(np.concatenate(parts) for parts in zip(*whole, strict=True))))
        self.limits.append(np.full(count, limit))


class Program:
    """The linear program of a bench.

    Lorries k are counted in the order in which they leave; "by k" is by the time at which the k-th does.

    Attributes:
        tries: each of those that were given, once for every period between two lorries up to its order's.
        period: (o,), lorries that have left before.
        tried: (o,), whether a plug is tried in time, and when.
        shown: (orders, rows), whether a row is presented by k.
        touched: (orders, m), cells of a column that something is set into in time.
        kept: (orders,), cells that hold what they are to hold though nothing has closed them.
        cleared: (orders,), cells that are cleared in time.
        served: (orders,), whether any of its cells is touched.
        begun: (orders,), whether anything was tried by k.
        behind: (orders,), rows of an order that are presented behind its first.
        by_grade: (orders, 2, rows), whether plugs of a row are tried for either grade by k.
        both: (orders, rows), whether they are for both.
        turned: (orders, 2), turns of either carousel by k, see ``Ends``.
        changed: (orders,), changes of grade by k.
        wasted: (rows,), seedlings of a row that has moved on which nobody has tried.
        seconds: (1,), of everything.
    """

    def __init__(self, bench: Bench, tries: Tries):
        """Write the inequalities down."""
        self.bench, self._rows, self._upper = bench, _Rows(), []
        (trays, per), (orders, m) = bench.source, bench.cells.shape
        rows, inf = trays * per, math.inf
        self.leaves = np.argsort(bench.due_s, kind="stable")
        self.rank = np.argsort(self.leaves)
        option, self.period = np.nonzero(np.arange(orders) <= self.rank[tries.order][:, None])
        plugs = {"row": tries.row, "holds": tries.holds}
        of = {name: values[option] for name, values in tries._asdict().items() if name not in plugs}
        self.tries = tries = Tries(**plugs, **of)
        self.tried = self._take(len(tries.plug))
        self.shown = self._take(orders, rows)
        self.touched = self._take(orders, m, upper=bench.cells)
        self.kept = self._take(orders, upper=inf)
        self.cleared = self._take(orders, upper=inf)
        self.served, self.begun, self.behind = self._take(orders), self._take(orders), self._take(orders, upper=inf)
        self.by_grade, self.both = self._take(orders, 2, rows), self._take(orders, rows)
        self.turned, self.changed = self._take(orders, 2, upper=inf), self._take(orders, upper=inf)
        self.wasted = self._take(rows, upper=inf)
        # Nothing is gained when the last lorry has left.
        self.seconds = self._take(1, upper=bench.due_s.max())
        self._fill()
        for k in range(orders):
            self._present(k)
            self._turn(k)
            self._change(k)
            self._hasten(k)
        self._waste()
        self.upper = np.concatenate(self._upper)
        size = len(self.upper)
        parts = [csr_array((v.astype(float), (r, c)), shape=(count, size)) for count, r, c, v in self._rows.parts]
        self.matrix, self.limit = vstack(parts).tocsr(), np.concatenate(self._rows.limits)

    def _take(self, *shape: int, upper: Any = 1.0) -> Numbers:
        """Columns of new variables >= 0."""
        begin = sum(map(len, self._upper))
        self._upper.append(np.broadcast_to(np.asarray(upper, float), shape).ravel())
        return begin + np.arange(math.prod(shape)).reshape(shape)

    def _by(self, k: int) -> tuple[Numbers, NDArray[np.bool_]]:
        """Orders that leave by k, and which tries are made by then."""
        return self.leaves[: k + 1], self.period <= k

    def _fill(self) -> None:
        """Cells: what closes one does so for good, what else is kept was gained; what comes second takes clearing."""
        tries, order, close = self.tries, self.tries.order, self.tries.closes
        each = np.arange(len(self.kept))
        touched, arrived = (each[:, None], self.touched, -1.0), (order, self.tried, tries.arrives)
        closed = order[close], self.tried[close], tries.arrives[close]
        self._rows.add(len(each), [closed, (each, self.kept, 1.0), touched])
        self._rows.add(len(each), [arrived, (each, self.cleared, -1.0), touched])
        self._rows.add(len(each), [(each, self.kept, 1.0), (order[~close], self.tried[~close], -tries.gain[~close])])
        cells, m = self.bench.cells.sum(axis=1), self.bench.cells.shape[1]
        self._rows.add(len(each), [(each[:, None], self.touched, 1.0), (each, self.served, -cells)])
        # So many cells lie in so many rows, the first of which was there.
        rows = [(each[:, None], self.touched, 1.0 / m), (each, self.served, -1.0), (each, self.behind, -1.0)]
        self._rows.add(len(each), rows)

    def _present(self, k: int) -> None:
        """A plug is tried once, from a row that was presented and waits; rows come one after the other and stay so."""
        tries, shown, count = self.tries, self.shown, np.arange(len(self.tries.row))
        _, mine = self._by(k)
        self._rows.add(len(count), [(tries.plug[mine], self.tried[mine], 1.0), (count, shown[k, tries.row], -1.0)])
        rows = np.arange(shown.shape[1])
        if k:
            self._rows.add(len(rows), [(rows, shown[k - 1], 1.0), (rows, shown[k], -1.0)])
        behind = np.flatnonzero(rows % self.bench.source[1])
        count = np.arange(len(behind))
        if len(count):
            self._rows.add(len(count), [(count, shown[k, behind], 1.0), (count, shown[k, behind - 1], -1.0)])
        stays = (tries.row + 1) % self.bench.source[1] > 0
        late = ~mine & stays[tries.plug]
        moved = (np.flatnonzero(stays), shown[k, tries.row[stays] + 1], 1.0)
        self._rows.add(len(tries.row), [(tries.plug[late], self.tried[late], 1.0), moved], 1.0)

    def _turn(self, k: int) -> None:
        """Turns up to the trays that are presented, of the supply and of orders."""
        left, _ = self._by(k)
        first = self.shown[k, :: self.bench.source[1]]
        for side, there, place in ((E.source, first, np.arange(len(first))), (E.target, self.served[left], left)):
            turned, count = self.turned[k, side], np.arange(len(place))
            self._rows.add(len(count), [(count, there, place), (count, turned, -1.0)])
            self._rows.add(1, [(0, there, place > 0), (0, turned, -1.0)])

    def _change(self, k: int) -> None:
        """Changes of grade for rows that serve both, and what the carousel turns for them."""
        grade, tries, (trays, per) = self.bench.grade, self.tries, self.bench.source
        _, mine = self._by(k)
        if len(np.unique(grade)) < 2:
            return
        rows, plugs = np.arange(trays * per), np.arange(len(tries.row))
        by_grade, both, changed = self.by_grade[k], self.both[k], self.changed[k]
        for used, content in zip(by_grade, (HEALTHY, POOR), strict=True):
            its = mine & (grade[tries.order] == content)
            entries = [(tries.plug[its], self.tried[its], 1.0), (plugs, used[tries.row], -1.0)]
            self._rows.add(len(plugs), entries)
        self._rows.add(len(rows), [(rows, by_grade, 1.0), (rows, self.shown[k], -1.0), (rows, both, -1.0)])
        self._rows.add(trays, [(rows // per, both, 1.0), (np.arange(trays), changed, -1.0)])
        self._rows.add(1, [(0, both, 1.0), (0, changed, -1.0), (0, self.turned[k, E.source], -1.0)])
        a_round, ahead = changes(grade)
        turns = len(grade) / a_round
        self._rows.add(1, [(0, changed, turns), (0, self.turned[k, E.target], -1.0)], turns * ahead)

    def _hasten(self, k: int) -> None:
        """All that was done by k takes no longer; of cells those are known whose orders have left."""
        bench, shares, last = self.bench, self.bench.shares, k == len(self.leaves) - 1
        left, mine = self._by(k)
        row_s = bench.row_s
        count = np.arange(len(left))
        self._rows.add(len(left), [(count, self.served[left], 1.0), (count, self.begun[k], -1.0)])
        moved = self.shown[k, np.arange(self.shown.shape[1]) % bench.source[1] > 0]
        entries = [
            (0, self.tried[mine], self.tries.try_s[mine]),
            (0, moved, row_s[E.source]),
            (0, self.touched[left], shares.cell_s - shares.cell_s.min()),
            (0, self.behind[left], row_s[E.target]),
            (0, self.cleared[left], float(shares.clear_s.min())),
            (0, self.turned[k], bench.turn_s),
            (0, self.begun[k], shares.once_s),
        ]
        self._rows.add(1, entries, float(bench.due_s[left[-1]]))
        if last:
            self._rows.add(1, [*entries, (0, self.seconds, -1.0)])

    def _waste(self) -> None:
        """Seedlings of rows that were left and not tried."""
        tries, rows = self.tries, np.arange(len(self.wasted))
        behind = np.flatnonzero((rows + 1) % self.bench.source[1])
        if not len(behind):
            return
        place = np.full(len(rows), -1)
        place[behind] = np.arange(len(behind))
        spot = place[tries.row[tries.plug]]
        stays = spot >= 0
        self._rows.add(
            len(behind),
            [
                (place[behind], self.shown[-1, behind + 1], self.bench.sold[behind]),
                (place[behind], self.wasted[behind], -1.0),
                (spot[stays], self.tried[stays], -tries.holds[tries.plug[stays]]),
            ],
        )

    def _gains(self, each: float = -1.0) -> Array:
        """Costs of all variables, so much for a cell that is filled in time."""
        cost, close = np.zeros(len(self.upper)), self.tries.closes
        cost[self.tried[close]], cost[self.kept] = each * self.tries.gain[close], each
        return cost

    def most_cells(self) -> float:
        """Most cells that can be filled in time."""
        return -self._least(self._gains())

    def largest_return(self) -> float:
        """No episode's rewards add up to more."""
        weights, tries = self.bench.weights, self.tries
        cost = self._gains(-weights.planted)
        cost[self.tried] -= weights.spoiled * (tries.holds[tries.plug] - tries.gain)
        cost[self.wasted], cost[self.seconds] = -weights.spoiled, -weights.seconds
        return -self._least(cost)

    def cycle_time(self, cells: int) -> float:
        """Least seconds a planted seedling with so many cells filled; infinite where there are not as many."""
        each_s = math.inf
        for _ in range(20):
            cost = np.zeros(len(self.upper))
            cost[self.seconds] = 1.0
            if math.isfinite(each_s):
                # Seedlings that are planted and taken out again count as well.
                cost[self.tried] = -each_s * self.tries.gain
            found = self._solve(cost, self._gains(), -float(cells) + 1e-6)
            if found is None:
                return math.inf
            now_s = float(found[self.seconds[0]]) / float(self.tries.gain @ found[self.tried])
            if now_s >= each_s - 1e-9:
                break
            each_s = now_s
        return each_s - 1e-6

    def _least(self, cost: Array) -> float:
        found = self._solve(cost)
        assert found is not None, "to do nothing is possible"
        return float(cost @ found)

    def _solve(self, cost: Array, row: Array | None = None, limit: float = 0.0) -> Array | None:
        """The best values, or None where no values hold with ``row @ values <= limit``."""
        matrix, limits = self.matrix, self.limit
        if row is not None:
            matrix, limits = vstack([matrix, csr_array(row[None])]).tocsr(), np.append(limits, limit)
        bounds = np.stack([np.zeros(len(self.upper)), self.upper], axis=1)
        found = linprog(cost, A_ub=matrix, b_ub=limits, bounds=bounds, method="highs")
        if found.status not in (_SOLVED, _IMPOSSIBLE):
            raise RuntimeError(f"the linear program of a bound was not solved: {found.message}")
        return found.x if found.status == _SOLVED else None


def changes(grade: Numbers) -> tuple[int, float]:
    """Changes of grade in a round of the carousel, and how far ahead of their even pace a way from its first tray is.

    Args:
        grade: (orders,), what each order wants, as they stand on the carousel.
    """
    change = np.roll(grade, -1) != grade
    a_round = int(change.sum())
    pace = np.cumsum(change) - a_round / len(grade) * np.arange(1, len(grade) + 1)
    return a_round, float(max(pace.max(), 0.0))
