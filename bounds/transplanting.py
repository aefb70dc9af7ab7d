"""Bounds for the tray transplanter.

Full knowledge: what every cell holds, each plug's luck at each speed, what the cameras report, every gate's time. A
transplant is one good plug into one open cell; what it takes is split into a share of its plug and a share of its cell
by dual prices: no carry and no way back is shorter than the shares of its two ends together (linear programming
duality; Kuhn 1955 for the assignment problem). The tool's ways between two transplants are shortest paths over all
its places, so attempts that miss, conveyors that move and cells that are cleared on the way are paid for. How many
plugs and cells there are, and which rows must have been presented for them, is exact; that a row's plugs meet certain
rows of cells only is left out. In expectation each plug is tried with some chance (see ``plugs``).
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linprog

from ..envs.transplanting.columns import E, H, L, W
from ..envs.transplanting.config import EMPTY, HEALTHY, POOR, TransplantingConfig
from ..envs.transplanting.core import TransplantingCore
from ..envs.transplanting.timing import CLEARING, STRAIGHT, Places, Times, above
from .base import Bound, Expectation, Found, check_method, check_start, relative_gap, state_of
from .plugs import Attempts, attempts_of, most_by_shares

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

SHUT, OPEN, BLOCKED, HIDDEN = range(4)
"""Target cells that gain nothing, that are empty, that must be cleared first; poor ones that no camera sees: the first
plug spoils them, then they must be cleared."""
USELESS = -1
_WORDS = "shares of plugs and cells from assignment duals; which rows meet is left out"


class Shares(NamedTuple):
    """Seconds that a transplant takes at least, split; every sum is a lower bound of the true time.

    Attributes:
        plug_s: (speeds, n), of a plug by the speed that carries it and its column.
        cell_s: (m,), of an empty cell by its column.
        clear_s: (m,), more for one that must be cleared.
        once_s: paid once an episode: the first way starts over the chute, the last one is not followed by another.
    """

    plug_s: Array
    cell_s: Array
    clear_s: Array
    once_s: float


@dataclass(frozen=True, eq=False)
class TrayInstance:
    """Trays with their luck.

    Attributes:
        plug_speed: (source rows, n), fastest speed at which a plug arrives healthy, ``USELESS`` where none does.
        supply: (source rows,), healthy seedlings that a row holds.
        cell: (target rows, m), ``SHUT``, ``OPEN``, ``BLOCKED`` or ``HIDDEN``.
        healthy: cells of the target trays that hold a healthy seedling from the beginning.
        source_s: (source rows,), time of the conveyor away from each row; the last one cannot be left.
        target_s: (target rows,), likewise; leaving the last one ends the episode.
        shares: what a transplant takes.
        longest_s: no decision takes longer.
        rise_s: least time of the tool from a cell to above it.
        places: where the tool can stand.
        times: how long everything takes.
        config: the task's numbers.
        drawn: whether the cameras' reports are those that were drawn.
        attempts: what comes of carrying a plug, by its chances.
    """

    plug_speed: Numbers
    supply: Array
    cell: Numbers
    healthy: int
    source_s: Array
    target_s: Array
    shares: Shares
    longest_s: float
    rise_s: float
    places: Places
    times: Times
    config: TransplantingConfig
    drawn: bool
    attempts: Attempts

    @property
    def most(self) -> int:
        """Transplants for which there are plugs and cells."""
        return min(int((self.plug_speed != USELESS).sum()), int((self.cell != SHUT).sum()))

    def bound(self, method: str = "relaxation", time_limit_s: float = 60.0) -> Bound:
        """What no policy can beat; see ``Instance``. Both methods are the same: there is nothing to search.

        Raises:
            ValueError: unknown method, or a reward that pays for time or for spoiled seedlings.
        """
        check_method(method)
        weights = self.config.weights
        if min(weights.planted, -weights.spoiled, -weights.seconds) < 0.0:
            raise ValueError(f"{weights}: the bound needs planted >= 0, spoiled <= 0 and seconds <= 0")
        began = time.perf_counter()
        planted = self._most_in_time()
        net_rate = (self.healthy + planted) / self.cell.size
        value, cycle_s = self._largest_return(planted), self.cycle_time_at(net_rate)
        gap, found = math.nan, None
        if self.drawn:
            found = Found(*carried_out(self, planted))
            gaps = relative_gap(net_rate, found.net_rate), relative_gap(value, found.episode_return)
            gap, found = (math.nan, None) if math.isnan(found.net_rate) else (max(gaps), found)
        words = f"{_WORDS}; {'reports as drawn' if self.drawn else 'any reports'}"
        hope = self._expectation()
        return Bound(net_rate, value, cycle_s, words, gap == 0.0, gap, time.perf_counter() - began, hope, found)

    def _expectation(self) -> Expectation:
        """The same where nobody knows what will come of a plug, but its chances."""
        weights, limit = self.config.weights, self.config.scenario.time_limit_s
        second, spoiled = -weights.seconds, -weights.spoiled
        cells, _ = self._cells(second)
        # Every plug that is gripped goes to a cell, filled or not: the least share of one is the plug's.
        cell, attempts = np.concatenate(cells) - second * float(self.shares.cell_s.min()), self.attempts
        planted = most_by_shares(attempts, np.zeros_like(attempts.plug_s), np.zeros(len(cell)), np.zeros(1), 1.0)
        # A plug that is tried in a row that is left does not leave with it.
        used = spoiled * (1.0 - attempts.good)[:, None] + second * attempts.plug_s
        moves = np.concatenate([[0.0], np.cumsum(second * self.source_s[:-1] + spoiled * self.supply[:-1])])
        finished = most_by_shares(attempts, used, cell, moves, weights.planted, left=spoiled)
        # Who plants nothing pays for the conveyor alone.
        finished = max(finished - second * (self.shares.once_s + self.rise_s), 0.0) - second * self.target_s.sum()
        value = max(float(finished), weights.planted * planted - second * limit)
        return Expectation((self.healthy + planted) / self.cell.size, value, "plugs by their chances", False)

    def cycle_time_at(self, net_rate: float) -> float:
        """Seconds that the cycle time cannot fall below with at least this net rate; infinite when it cannot be had."""
        least = max(math.ceil(net_rate * self.cell.size - self.healthy - 1e-9), 1)
        if least > self.most:
            return math.inf
        # Transplants that gain nothing count as targets too: cells can be cleared and planted again and again.
        again = float((self.shares.cell_s + self.shares.clear_s).min())
        plugs = int((self.plug_speed != USELESS).sum())
        seconds = self._least_s(plugs, again)
        counts = np.arange(len(seconds))
        return float((seconds[least:] / counts[least:]).min())

    def _plugs(self, spoiled: float, second: float) -> tuple[list[Array], Array]:
        """By row: price of each useful plug, and what it costs to move on to the row."""
        rows = []
        for speeds in self.plug_speed:
            use = np.flatnonzero(speeds != USELESS)
            rows.append(second * self.shares.plug_s[speeds[use], use] - spoiled)
        moves = second * self.source_s[:-1] + spoiled * self.supply[:-1]
        return rows, np.concatenate([[0.0], np.cumsum(moves)])

    def _cells(self, second: float) -> tuple[list[Array], Array]:
        rows = []
        for cells in self.cell:
            use = np.flatnonzero(cells != SHUT)
            extra = self.shares.clear_s[use] * (cells[use] != OPEN)
            rows.append(second * (self.shares.cell_s[use] + extra))
        return rows, second * np.concatenate([[0.0], np.cumsum(self.target_s[:-1])])

    def _handle_s(self, count: int) -> Array:
        return self.times.handle_s * np.arange(count + 1, dtype=np.float64) + self.shares.once_s

    def _least_s(self, count: int, again: float = math.inf) -> Array:
        """Seconds (count + 1,) until 0 ... ``count`` plugs are planted; infinite where there are not as many."""
        plugs = cheapest(*self._plugs(0.0, 1.0), count)
        cells = cheapest(*self._cells(1.0), count, again)
        seconds = np.maximum(plugs + cells + self._handle_s(count), 0.0)
        seconds[0] = 0.0
        return seconds

    def _most_in_time(self) -> int:
        """Largest number of plugs that can be planted before the time is up; the last decision may run over."""
        limit = self.config.scenario.time_limit_s
        return int(np.flatnonzero(self._least_s(self.most) <= limit + self.longest_s)[-1])

    def _largest_return(self, planted: int) -> float:
        """Bound on the return with at most ``planted`` transplants."""
        weights, limit = self.config.weights, self.config.scenario.time_limit_s
        second, spoiled, counts = -weights.seconds, -weights.spoiled, np.arange(planted + 1)
        cells, _ = self._cells(second)
        # Every target row is served and sent away; the tool rises before that.
        cost = cheapest(cells, np.zeros(len(cells)), planted) + second * float(self.target_s.sum())
        # A used plug in a row that is left is one seedling less that leaves with it; in the last row it is free.
        rows, moves = self._plugs(spoiled, second)
        stays, _ = self._plugs(0.0, second)
        cost += cheapest(rows, moves, planted, last=stays)
        cost[1:] += second * (self._handle_s(planted)[1:] + self.rise_s)
        finished = float((weights.planted * counts - cost).max())
        # Who does not finish uses the time up.
        return max(finished, weights.planted * planted - second * limit)


def cheapest(
    rows: list[Array], reach: Array, count: int, again: float = math.inf, last: list[Array] | None = None
) -> Array:
    """Least price (count + 1,) of 0 ... ``count`` things out of rows that are reached one after the other.

    Args:
        rows: price of each thing of a row.
        reach: (rows,), price of getting to a row, from the first one on.
        count: most things that are asked for.
        again: price at which a thing can be had as often as one likes, from the first row on.
        last: prices while a row is the last one reached, where they differ.
    """
    best = np.full(count + 1, np.inf)
    known = np.zeros(0)
    for here, row in enumerate(rows):
        own = row if last is None else last[here]
        prices = np.sort(np.concatenate([known, own]))[:count]
        if math.isfinite(again):
            prices = np.minimum(np.pad(prices, (0, count - len(prices)), constant_values=again), again)
        best[: len(prices) + 1] = np.minimum(
            best[: len(prices) + 1], reach[here] + np.concatenate([[0.0], np.cumsum(prices)])
        )
        known = np.concatenate([known, row])
    return best


def carried_out(instance: TrayInstance, planted: int) -> tuple[float, float]:
    """Net rate and return of a schedule that knows everything: rows in order, the shortest next transplant first.

    Both are NaN when it does not end in time.

    Args:
        instance: what there is.
        planted: transplants to carry out, or as many as the rows allow.
    """
    config, times, once = instance.config, instance.times, instance.times.handle_s
    n, m = instance.plug_speed.shape[1], instance.cell.shape[1]
    approach, carry = times.approach[..., W.s].reshape(2, -1, n, m), times.carry[..., W.s].reshape(-1, n, m)
    direct, cleared = approach[STRAIGHT], approach[CLEARING]
    place, total_s, spoiled, done, here, there = instance.places.park, 0.0, 0.0, 0, 0, 0
    plugs, cells = instance.plug_speed.copy(), instance.cell.copy()
    cells[cells == HIDDEN] = SHUT
    while True:
        i, j = np.flatnonzero(plugs[here] != USELESS), np.flatnonzero(cells[there] != SHUT)
        if len(i) and len(j) and done < planted:
            both = np.ix_(i, j)
            over = cells[there, j] == BLOCKED
            seconds = np.where(over, cleared[place][both] + once, direct[place][both]) + once
            seconds += carry[plugs[here, i]][:, i][:, :, j][np.arange(len(i)), np.arange(len(i))]
            a, b = np.unravel_index(int(seconds.argmin()), seconds.shape)
            total_s, place, done = total_s + float(seconds[a, b]), n + int(j[b]), done + 1
            plugs[here, i[a]], cells[there, j[b]] = USELESS, SHUT
            continue
        rising = float(times.rise[place, W.s])
        place = above(times, place)
        if len(j) and done < planted and here + 1 < len(plugs):
            # Every healthy seedling that leaves is one that was not planted.
            spoiled += instance.supply[here] - int((instance.plug_speed[here] != plugs[here]).sum())
            total_s, here = total_s + rising + float(instance.source_s[here]), here + 1
            continue
        total_s, there = total_s + rising + float(instance.target_s[there]), there + 1
        if there == len(cells):
            break
    if total_s > config.scenario.time_limit_s:
        return math.nan, math.nan
    weights = config.weights
    value = weights.planted * done + weights.seconds * total_s + weights.spoiled * spoiled
    return (instance.healthy + done) / instance.cell.size, value


def instance_of(core: TransplantingCore, reports: str = "drawn", row: int = 0) -> TrayInstance:
    """What stands in a world of the rules right after its reset.

    Args:
        core: the rules.
        reports: ``"drawn"`` or ``"driven"``: the cameras' reports are those that lie in ``core``, a simulated machine
            being never quicker than its plan, and no better beside a cell; ``"any"``: whatever they may report.
        row: the world.

    Raises:
        ValueError: the episode is under way, or ``reports`` is unknown.
    """
    state, config = state_of(core), core.config
    check_start(reports, state.place[row] != core.places.park or state.source_row[row] or state.target_row[row])
    (rows_s, n), (rows_t, m) = core.source_shape, core.target_shape
    table = core.times
    source, target = state.source_cells[row, :rows_s], state.target_cells[row, :rows_t]
    speed = fastest(core, row, source == HEALTHY)
    carry_s = np.ascontiguousarray(table.carry[..., W.s])
    tried = source == HEALTHY
    cell = np.where(target == HEALTHY, SHUT, np.where(target == POOR, BLOCKED, OPEN))
    # The same prices whatever the cameras report: so knowing the reports never makes a bound weaker.
    prices = shares(core.places, table, speed, cell)
    if reports != "any":
        speed[state.source_reports[row, :rows_s] == EMPTY] = USELESS
        tried &= state.source_reports[row, :rows_s] != EMPTY
        told = state.target_reports[row, :rows_t]
        cell[told == HEALTHY] = SHUT
        cell[(cell == BLOCKED) & (told == EMPTY)] = HIDDEN
        cell[(cell == OPEN) & (told == POOR)] = BLOCKED
    ends = table.row_s[E.source, :rows_s], table.row_s[E.target, :rows_t]
    rise_s = table.rise[:, W.s]
    longest = float(table.approach[..., W.s].max() + carry_s.max()) + 2.0 * table.handle_s
    return TrayInstance(
        plug_speed=speed,
        supply=np.count_nonzero(source == HEALTHY, axis=1).astype(np.float64),
        cell=cell,
        healthy=int(np.count_nonzero(target == HEALTHY)),
        source_s=ends[E.source],
        target_s=ends[E.target],
        shares=prices,
        longest_s=max(longest, float(max(seconds.max() for seconds in ends) + rise_s.max()), table.illegal_s),
        rise_s=float(rise_s[n : n + m].min()),
        places=core.places,
        times=table,
        config=config,
        drawn=reports != "any",
        attempts=attempts_of(core, prices, tried, reports, row),
    )


def fastest(core: TransplantingCore, row: int, grown: NDArray[np.bool_]) -> Numbers:
    """Fastest speed at which the plugs of ``grown`` cells (source rows, n) arrive whole, else ``USELESS``."""
    chances, luck = core.terms.chances, state_of(core).luck[row, : len(grown)]
    speed = np.full(grown.shape, USELESS)
    for index in np.argsort(-core.times.carry[..., W.s].sum(axis=1), kind="stable"):
        good = (
            (luck[..., L.extract] < core.config.process.extraction)
            & (luck[..., L.lose] >= chances[index, H.lose])
            & (luck[..., L.damage] >= chances[index, H.damage])
        )
        speed[good & grown] = index
    return speed


def shares(places: Places, times: Times, plug_speed: Numbers, cell: Numbers) -> Shares:
    """Split the times of a configuration for the plugs and cells that there are; valid for any others too."""
    n, m = plug_speed.shape[1], cell.shape[1]
    sources, targets, park = np.arange(n), n + np.arange(m), places.park
    speeds, rise_s = len(times.carry), times.rise[:, W.s]
    carry = times.carry[..., W.s].reshape(speeds, n, m)
    approach = times.approach[..., W.s].reshape(2, -1, n, m)
    usual, over = approach[STRAIGHT].min(axis=2), approach[CLEARING].transpose(0, 2, 1)
    # Shortest ways (P, P) over all that decisions do: to a source cell, on to a target, up before a conveyor moves.
    way = np.full((len(rise_s),) * 2, np.inf)
    np.fill_diagonal(way, 0.0)
    way[:, :n] = np.minimum(way[:, :n], np.minimum(usual, over.min(axis=1)))
    way[:n, n : n + m] = np.minimum(way[:n, n : n + m], carry.min(axis=0))
    for place in range(places.cells):
        way[place, above(times, place)] = rise_s[place]
    for middle in range(len(way)):
        way = np.minimum(way, way[:, middle, None] + way[middle])

    used = np.array([[np.count_nonzero(plug_speed[:, i] == s) for i in range(n)] for s in range(speeds)], float)
    open_cells = np.array([np.count_nonzero(cell[:, j] != SHUT) for j in range(m)], float)
    plug, end = dual_prices(carry.reshape(-1, m), used.ravel(), open_cells)
    # The way back begins where the last plug was set and ends at the next one.
    back = way[targets][:, :n].T
    fetch, start = dual_prices(back, used.sum(axis=0), open_cells)
    first = float((way[park, :n] - fetch).min())
    begins = np.concatenate([start, [first], -fetch - times.grip_s])
    begun = np.concatenate([targets, [park], sources])
    clear = np.empty(m)
    for j in range(m):
        detour = (way[begun][:, :, None] + over[None, :, j, :]).min(axis=1)
        ways = detour[:, :, None] + way[:n, :n] + times.grip_s * (1.0 - np.eye(n))
        clear[j] = (ways.min(axis=1) - fetch - begins[:, None]).min() + times.grip_s + times.release_s
    return Shares(
        plug_s=plug.reshape(speeds, n) + fetch,
        cell_s=end + start,
        clear_s=np.maximum(clear, 0.0),
        once_s=first - float(start.max()),
    )


def dual_prices(cost: Array, supply: Array, demand: Array) -> tuple[Array, Array]:
    """Prices of rows and columns, (n,) and (m,), whose sums never exceed ``cost`` (n, m).

    Out of all of them those with the largest total over the shares of ``supply`` and ``demand``: the dual of the
    transportation problem between them.
    """
    p = (supply + 1e-3) / (supply + 1e-3).sum()
    q = (demand + 1e-3) / (demand + 1e-3).sum()
    n, m = cost.shape
    both = np.hstack([np.repeat(np.eye(n), m, axis=0), np.tile(np.eye(m), (n, 1))])
    found = linprog(-np.concatenate([p, q]), A_ub=both, b_ub=cost.ravel(), bounds=(None, None), method="highs")
    rows = found.x[:n] if found.success else np.zeros(n)
    # Only the columns' prices are made from the rows': so no rounding of the solver can make the sum too large.
    columns = (cost - rows[:, None]).min(axis=0)
    return rows, columns
