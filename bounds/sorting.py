"""Bounds for the produce sorter.

Full knowledge: when every item comes and how it lies, what the fingers get of it, what the camera reports, the
machine's own time for every pick. What is worth picking is picked in the best order there is (see ``belt``): the model
is the rules' own but for the slots, of which there may be too few to show every candidate, and for waits, which may end
at any time. Picks that bring nothing are left out: a motion by way of another place is never the quicker one.
"""

from __future__ import annotations

import copy
import math
import time
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.sorting.columns import NUMBER, REWARD, TOTAL, TRUTH
from ..envs.sorting.config import SortingConfig
from ..envs.sorting.state import Tables
from ..envs.sorting.timing import hold_s, stroke_s
from .base import Bound, Expectation, Found, check_method, check_start, relative_gap, state_of
from .belt import Belt, Stream, best_picks, decided_late, expand, finish_s
from .grips import Chances, chances_of, quality
from .packer import TRUSTS, Bench, Guide, found
from .packing import STAGES, Goods, Lines, first_prices, most_filled, priced_orders
from .timeline import Timeline, priced

Array = NDArray[np.float64]

MOST_LABELS, FEW_LABELS = 20_000, 1_000
"""Schedules that are told apart before the search gives way to a bound by prices: with reports as drawn, where hundreds
are enough, and with any reports."""
TICK_S = 0.02
SAVED = 0.3
"""What the time is worth, in things placed, that a grip which holds nothing saves: any number gives a bound [chosen on
tuned seeds]."""
BY_CHANCE = "grips, ways and ripeness by their chances"
STRAY_M, STRAY_RAD = 5e-5, 1e-3
"""How far the simulated platform may be from where it was sent when the fingers close. Over 152 picks it was 6 um and
0.1 mrad at most; ten times that is allowed for."""


class Tries(NamedTuple):
    """What fingers may hold.

    Attributes:
        stream: n things, ``gain`` in reward if all goes well.
        held: (n,), whether a grip holds.
        chances: what was to be expected.
    """

    stream: Stream
    held: NDArray[np.bool_]
    chances: Chances


@dataclass(frozen=True, eq=False)
class SortingInstance:
    """One stream with its luck.

    Attributes:
        belt: the machine over the belt.
        placed: what can be placed in the bin where it belongs; ``gain`` in reward.
        items: of the stream.
        config: the task's numbers.
        labels: schedules to be told apart, see ``MOST_LABELS``.
        drawn: whether the model is the rules' own, so that a schedule may be carried out.
        leave_s: (M,), when each candidate leaves the slots, those that are shown and never picked too.
        seen_s: (M,), when it enters them.
        words: what was assumed of the camera.
        lines: what is ordered; None where every item counts.
        tries: what can be tried; None where reports are not drawn.
        core: the rules of this world, for picks of orders to be carried out; None without orders, or where the model is
            not the rules' own.
        reports: (n,), behind what can be placed; none without ``core``.
    """

    belt: Belt
    placed: Stream
    items: int
    config: SortingConfig
    labels: int
    drawn: bool
    leave_s: Array
    seen_s: Array
    words: str
    lines: Lines | None = None
    tries: Tries | None = None
    core: Any = None
    reports: NDArray[np.int64] | None = None

    def without_schedule(self) -> SortingInstance:
        """Bounds alone: what is carried out besides is sought longer than these."""
        return replace(self, core=None)

    def bound(self, method: str = "relaxation", time_limit_s: float = 30.0) -> Bound:
        """What no policy can beat; see ``Instance``. Both methods are the same: the search is complete where it can be.

        Raises:
            ValueError: unknown method, or a reward that pays for mistakes.
        """
        weights = self.config.weights
        check_method(method)
        if min(weights.placed, -weights.misplaced, -weights.dropped, -weights.wasted) < 0.0:
            raise ValueError(f"{weights}: the bound needs placed >= 0 and everything else <= 0")
        began = time.perf_counter()
        counted = self._counted
        if self.lines is not None:
            return self._packed(self.lines, counted, time_limit_s)
        most, order_n, proven_n = _best(self.belt, counted, self.labels, time_limit_s)
        value, order_v, proven_v = _best(self.belt, self.placed, self.labels, time_limit_s)
        most = math.floor(most + 1e-6)
        net_rate = most / max(self.items, 1)
        gap, found = math.nan, None
        if self.drawn:
            found_n, found_v = self.carried_out(counted, order_n), self.carried_out(self.placed, order_v)
            gap = max(relative_gap(most, found_n), relative_gap(value, found_v))
            found = Found(found_n / max(self.items, 1), found_v)
        cycle_s = self.cycle_time_at(net_rate)
        searched = proven_n and proven_v
        words = "all orders of picks, by dominance over the sets picked" if searched else "paths in time, items priced"
        proven = searched and gap == 0.0
        hope = None
        if self.tries is not None:
            hoped, count = _hoped(self.tries, self.config, len(self.belt.places))
            brought_n, brought_v = (
                _best(self.belt, stream, self.labels, time_limit_s)[0] for stream in (hoped._replace(gain=count), hoped)
            )
            hope = Expectation(brought_n / max(self.items, 1), brought_v, BY_CHANCE, False)
        spent_s = time.perf_counter() - began
        return Bound(net_rate, value, cycle_s, f"{words}; {self.words}", proven, gap, spent_s, hope, found)

    def _packed(self, lines: Lines, counted: Stream, time_limit_s: float) -> Bound:
        """The bound where things fill order lines: by number, where surplus is nothing, and by value."""
        began = time.perf_counter()
        surplus = self.config.scenario.orders.surplus
        sure = Chances.sure(len(counted.gain))
        most, by_count = _filled(self.belt, counted, sure, lines, 0.0, time_limit_s)
        value, by_value = _filled(self.belt, self.placed, sure, lines, surplus, time_limit_s)
        net_rate = math.floor(most + 1e-6) / max(self.items, 1)
        hope = None
        if self.tries is not None:
            tried, _, chances = self.tries
            ones = tried._replace(gain=np.ones(len(tried.gain)))
            hoped_n, _ = _filled(self.belt, ones, chances.counted(), lines, 0.0, time_limit_s)
            hoped_v, _ = _filled(self.belt, tried, chances, lines, surplus, time_limit_s)
            hope = Expectation(hoped_n / max(self.items, 1), hoped_v, BY_CHANCE, False)
        reached, gap = None, math.nan
        if self.core is not None and self.reports is not None:
            results = []
            for stream, share, guide in ((counted, 0.0, by_count), (self.placed, surplus, by_value)):
                book = self.config.scenario.orders
                bench = Bench(
                    self.belt, stream, lines, share, int(book.bin_holds), float(book.swap_s), guide, TRUSTS[0]
                )
                results += found(self.core, self.reports, bench)
            reached = Found(max(n for n, _ in results) / max(self.items, 1), max(value for _, value in results))
            gap = max(relative_gap(net_rate, reached.net_rate), relative_gap(value, reached.episode_return))
        cycle_s = self.cycle_time_at(net_rate)
        words = f"paths in time, items and order lines priced, bins never away; {self.words}"
        seconds = time.perf_counter() - began
        return Bound(net_rate, value, cycle_s, words, gap == 0.0, gap, seconds, hope, reached)

    def cycle_time_at(self, net_rate: float) -> float:
        """Seconds that the cycle time cannot fall below with at least this net rate; infinite when it cannot be had."""
        least = max(math.ceil(net_rate * self.items - 1e-9), 1)
        if least > len(self.placed.gain):
            return math.inf
        earliest = self._earliest_s
        if earliest is None:
            # Whatever the order: a pick takes as long as the two that are nearest to each other.
            return float((self.placed.hold_s + 2.0 * self.placed.least_s).min()) + self.belt.paces.release_s
        counts = np.arange(len(earliest))
        return float((earliest[least:] / counts[least:]).min())

    @property
    def _counted(self) -> Stream:
        """What can be placed, every thing worth the same."""
        return self.placed._replace(gain=np.ones(len(self.placed.gain)))

    @cached_property
    def _earliest_s(self) -> Array | None:
        """Earliest time (n + 1,) at which 0 ... n things can lie in their bins; None where that is not proven."""
        _, earliest, _, proven = best_picks(self.belt, self._counted, self.labels)
        return earliest if proven else None

    def carried_out(self, stream: Stream, order: NDArray[np.int64]) -> float:
        """What the rules give for picks in this order: waits take what a wait takes, slots show what they show."""
        belt, wait_s = self.belt, self.config.grip.wait_s
        place, now, total = len(belt.places) - 1, 0.0, 0.0
        tried: list[float] = []
        leaves = stream.passing_s + stream.last_m / belt.paces.speed_m_s
        for j in order.tolist():
            while now < stream.known_s[j]:
                now += wait_s
            shown = (self.seen_s <= now) & (self.leave_s > now) & (self.leave_s < leaves[j] - 1e-9)
            ahead = np.count_nonzero(shown) - sum(leave > now and leave < leaves[j] - 1e-9 for leave in tried)
            then = finish_s(belt, stream, j, place, now)
            if then == math.inf or ahead >= self.config.slots:
                continue
            now, place, total = then, int(stream.bin[j]), total + float(stream.gain[j])
            tried.append(float(leaves[j]))
        return total


def _best(belt: Belt, stream: Stream, labels: int, seconds: float) -> tuple[float, NDArray[np.int64], bool]:
    """Largest sum of gains, the order that brings it, and whether it is proven; else a bound by prices."""
    value, _, order, proven = best_picks(belt, stream, labels)
    if proven:
        return float(value), order, True
    first, to, option, wait, end_s, start = expand(belt, stream, TICK_S)
    n = len(stream.gain)
    graph = Timeline(first, to, option, wait, end_s, start, np.arange(n + 1), np.arange(n), np.ones(n))
    guess = stream.hold_s + 2.0 * stream.least_s
    found = priced(
        graph, stream.gain, np.zeros(n), np.zeros(len(end_s)), guess, found=float(value), time_limit_s=seconds
    )
    return min(found.bound, float(stream.gain.sum())), order, False


def _filled(
    belt: Belt, stream: Stream, chances: Chances, lines: Lines, surplus: float, seconds: float
) -> tuple[float, Guide]:
    """What things can bring on average that fill order lines, with bins never away, and what shows the way there."""
    # What brings nothing on average is left out, as what brings nothing at all is: who does without is no later.
    use = chances.mean(stream.gain) > 0.0
    parts = {name: getattr(stream, name)[use] for name in Stream._fields if name != "slack_m"}
    stream, chances, n = Stream(**parts, slack_m=stream.slack_m), chances.of(use), int(use.sum())
    goods = Goods(stream.bin, stream.gain, surplus, chances)
    nowhere = stream._replace(bin=np.full(n, len(belt.places)))
    bound, prices = math.inf, first_prices(lines, goods, stream.hold_s + 2.0 * stream.least_s)
    worth, tick_s = np.zeros(0), 0.0
    for stage in STAGES:
        paths = expand(belt, stream, stage.tick_s)
        instead = expand(belt, nowhere, stage.tick_s)[1] if (chances.least < 1.0).any() else paths[1]
        graph = Timeline(*paths, np.arange(n + 1), np.arange(n), np.ones(n))
        bound, found, worth = priced_orders(graph, instead, lines, goods, prices, stage, seconds)
        prices, tick_s = [found], stage.tick_s
    earliest_s = stream.passing_s + stream.first_m / belt.paces.speed_m_s + stream.hold_s + stream.least_s
    guide = Guide(tick_s, worth.reshape(-1, len(belt.places) + 1)[::-1].copy(), prices[0][:n], prices[0][n:])
    return min(bound, most_filled(lines, goods, earliest_s)), guide


def _lines(worlds: Any, row: int) -> Lines | None:
    """What is ordered in a world; None where every item counts."""
    there = worlds.line_count[row] > 0
    if not there.any():
        return None
    return Lines(worlds.line_grade[row, there], worlds.line_count[row, there], worlds.line_due_s[row, there])


def instance_of(core: Any, reports: str = "drawn", row: int = 0) -> SortingInstance:
    """What stands in a world of the rules right after its reset.

    Args:
        core: the rules.
        reports: ``"drawn"``: the reports are those that lie in ``core``; ``"driven"``: the same, and the platform may
            stray a little; ``"any"``: whatever a camera may report of an item, with the fingers anywhere about it.
        row: the world.

    Raises:
        ValueError: the episode is under way, or ``reports`` is unknown.
    """
    worlds, config = state_of(core), core.config
    check_start(reports, worlds.totals[row, TOTAL.time_s] > 0.0)
    tables = Tables.of(config)
    places = np.vstack([tables.bins, worlds.place[row]])
    limit_s = min(tables.time_limit_s, float(worlds.end_s[row]))
    belt = Belt(tables.paces, places, limit_s)
    items, lines = int(worlds.totals[row, TOTAL.items]), _lines(worlds, row)
    if reports == "any":
        placed = _any(worlds, tables, config, row)
        nothing = np.zeros(0)
        words = "any reports, so no error and every turn of the tool"
        ready = _ready(belt, placed)
        return SortingInstance(belt, ready, items, config, FEW_LABELS, False, nothing, nothing, words, lines)
    there = worlds.queue[row, : worlds.queued[row]]
    number = worlds.number[row, there]
    # In the order of their deadlines.
    there = there[
        np.argsort(number[:, NUMBER.passing_s] + number[:, NUMBER.last_m] / tables.paces.speed_m_s, kind="stable")
    ]
    stray = (0.0, 0.0) if reports == "drawn" else (STRAY_M, STRAY_RAD)
    fits = quality(worlds, tables, row, there, *stray)
    truth = worlds.item_truth[row, worlds.report_item[row, there]]
    held = truth[:, TRUTH.grip_luck] < tables.fingers.best * fits
    kept = truth[:, TRUTH.way_luck] >= tables.fingers.slip * (1.0 - fits)
    right = held & kept & (truth[:, TRUTH.grade] == worlds.report_grade[row, there])
    able = fits > 0.0
    tried = _ready(belt, _drawn(worlds, tables, row, there[able]))
    tries = Tries(tried, held[able], chances_of(core, tables, row, there[able], stray))
    words = "reports as drawn" if reports == "drawn" else "reports as drawn, the platform strays"
    return SortingInstance(
        belt,
        _ready(belt, _drawn(worlds, tables, row, there[right])),
        items,
        config,
        MOST_LABELS,
        reports == "drawn",
        worlds.leave_s[row, there].copy(),
        worlds.seen_s[row, there].copy(),
        words,
        lines,
        tries,
        copy.deepcopy(core.world(row)) if reports == "drawn" and lines is not None else None,
        there[right],
    )


def _ready(belt: Belt, stream: Stream) -> Stream:
    """In the order of the deadlines."""
    order = np.argsort(stream.passing_s + stream.last_m / belt.paces.speed_m_s, kind="stable")
    parts = {name: getattr(stream, name)[order] for name in Stream._fields if name != "slack_m"}
    return decided_late(belt, Stream(**parts, slack_m=stream.slack_m))


def _hoped(tries: Tries, config: SortingConfig, nowhere: int) -> tuple[Stream, Array]:
    """What picks bring on average in reward and, (n,), in things placed, of those that bring something.

    What time they take is as it is drawn: a grip that holds nothing goes on from the belt, sooner. Who knows that is
    charged for it, and paid for grips that hold, so that it comes to nothing on average (``SAVED``).

    Args:
        tries: what can be tried.
        config: the task's numbers.
        nowhere: bin of what is not held.
    """
    stream, held, chances = tries
    saved = SAVED * (held - chances.most)
    placed = chances.most * chances.right + saved
    value = chances.mean(stream.gain) + saved * config.weights.placed * float(np.mean(config.produce.value))
    use = (chances.most > 0.0) & ((value > 0.0) | (placed > 0.0))
    bins = np.where(held, stream.bin, nowhere)
    parts = {name: getattr(stream, name)[use] for name in Stream._fields if name not in ("slack_m", "gain", "bin")}
    count = np.maximum(placed, 0.0)[use]
    return Stream(**parts, bin=bins[use], gain=np.maximum(value, 0.0)[use], slack_m=stream.slack_m), count


def _drawn(worlds: Any, tables: Any, row: int, reports: NDArray[np.int64]) -> Stream:
    number, grade = worlds.number[row, reports], worlds.report_grade[row, reports]
    names = ("passing_s", "across_m", "first_m", "last_m", "hold_s", "least_s")
    parts = {name: number[:, getattr(NUMBER, name)].copy() for name in names}
    gain = float(tables.weights[REWARD.placed]) * tables.values[grade]
    return Stream(**parts, known_s=worlds.seen_s[row, reports].copy(), bin=grade.copy(), gain=gain, slack_m=0.0)


def _any(worlds: Any, tables: Any, config: SortingConfig, row: int) -> Stream:
    """Every item that fingers can hold, as near to machine and bins as an error that they forgive may bring it."""
    fingers, n = tables.fingers, worlds.item_truth.shape[1] - 1
    truth = worlds.item_truth[row, :n]
    items = np.flatnonzero(worlds.item_free[row, :n] & (truth[:, TRUTH.grip_luck] < fingers.best))
    truth, grade = truth[items], truth[items, TRUTH.grade].astype(np.int64)
    # The quality that the luck asks for leaves this much room for errors.
    room = np.log(fingers.best / np.maximum(truth[:, TRUTH.grip_luck], 1e-12))
    height = np.sqrt(room / -fingers.height_per_m2) + tables.tool_m + truth[:, TRUTH.up_m]
    down = tables.level_m - np.clip(height, 0.0, tables.level_m)
    paces = tables.paces
    hold = np.array([hold_s(stroke_s(way, paces.down_pace, paces.square_pace), paces.grip_s) for way in down])
    slack = math.sqrt(fingers.capture_m2) + tables.tool_m * math.sin(tables.tilt_limit_rad)
    widest = float(tables.reach_m.max())
    return Stream(
        passing_s=truth[:, TRUTH.passing_s].copy(),
        across_m=truth[:, TRUTH.across_m].copy(),
        first_m=np.full(len(items), -widest - slack),
        last_m=widest + slack - tables.paces.speed_m_s * hold,
        hold_s=hold,
        least_s=np.full(len(items), paces.shortest_s),
        known_s=np.full(len(items), -math.inf),
        bin=grade.copy(),
        gain=float(tables.weights[REWARD.placed]) * tables.values[grade],
        slack_m=slack,
    )
