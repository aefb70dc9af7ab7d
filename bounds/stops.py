"""Bounds for machines that serve targets stop by stop under a time limit: Lagrangian relaxation of the time.

A stop is a little routing problem: which targets, each how, in which order. With a price on seconds the stops fall
apart; the sum of their best values plus the price of the time allowed bounds every schedule, for any price >= 0
(Geoffrion 1974, Lagrangean relaxation for integer programming). A stop with few targets is solved exactly over all
subsets (Held and Karp 1962); one with many pays for each target its shortest approach only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..kernels.sums import in_order

Array = NDArray[np.float64]

EXACT_TARGETS = 9
"""Stops up to this many targets are solved over all subsets."""


@dataclass(frozen=True, eq=False)
class Stop:
    """Targets of one stop, n of them with E options each; times in seconds, every one a lower bound of the true one.

    Attributes:
        gain: (n, E), what each option brings.
        other: (n, E), what each option costs or brings beside that and the time.
        process_s: (n, E), time at the target.
        approach_s: (n + 1, n), from the stop's beginning (row 0) or from a target to a target.
        leave_s: (n + 1,), from the beginning or a target to the next stop's beginning; at the last stop, to the end.
        routed: whether ``approach_s`` obeys the triangle inequality, so that routes may be reckoned with it.
    """

    gain: Array
    other: Array
    process_s: Array
    approach_s: Array
    leave_s: Array
    routed: bool = True

    @property
    def targets(self) -> int:
        """Number of targets."""
        return len(self.gain)

    @property
    def exact(self) -> bool:
        """Whether the stop is solved over all routes."""
        return self.routed and self.targets <= EXACT_TARGETS

    @cached_property
    def longest_s(self) -> float:
        """Longest decision at this stop that serves a target."""
        if self.targets == 0:
            return 0.0
        return float((self.approach_s.max(axis=0)[:, None] + self.process_s).max())

    @cached_property
    def shortest_approach_s(self) -> Array:
        """(n,), from wherever the machine may come."""
        approach = self.approach_s.copy()
        approach[1 + np.arange(self.targets), np.arange(self.targets)] = np.inf
        return approach.min(axis=0)

    def best(self, worth: Array, price: float) -> tuple[float, float]:
        """Largest value of a visit, worth minus price x time: when the machine drives on, and when it stays.

        Args:
            worth: (n, E), of each option, its time not counted.
            price: of a second, >= 0.
        """
        direct = -price * float(self.leave_s[0])
        if self.targets == 0:
            return direct, 0.0
        value = (worth - price * self.process_s).max(axis=1)
        if self.exact:
            through, stay = self._routes(value, price)
        else:
            shortest = self.shortest_approach_s
            there = np.maximum(value - price * shortest, 0.0).sum()
            # Somebody is first: it is approached from the beginning, not from where that would be shortest.
            first = price * float((self.approach_s[0] - shortest).min())
            stay = float(there - first)
            through = stay - price * float(self.leave_s[1:].min())
        return max(through, direct), max(stay, 0.0)

    def _routes(self, value: Array, price: float) -> tuple[float, float]:
        """Best value over all sequences of distinct targets, with and without leaving at the end."""
        n = self.targets
        step = price * self.approach_s[1:]
        best = np.full((1 << n, n), -np.inf)
        best[1 << np.arange(n), np.arange(n)] = value - price * self.approach_s[0]
        for sets, last, before in _layers(n):
            # Sets that hold `last`, reached from the same sets without it.
            best[sets, last] = value[last] + (best[before] - step[None, :, last]).max(axis=1)
        return float((best - price * self.leave_s[1:]).max()), float(best.max())


_LAYERS: dict[int, list[tuple[NDArray[np.int64], int, NDArray[np.int64]]]] = {}


def _layers(n: int) -> list[tuple[NDArray[np.int64], int, NDArray[np.int64]]]:
    """(sets, last, sets without last), in the order of the sets' sizes, from two targets on."""
    if n not in _LAYERS:
        sets = np.arange(1 << n)
        size = sum((sets >> j) & 1 for j in range(n)) if n else np.zeros(1, int)
        _LAYERS[n] = [
            (chosen, j, chosen ^ (1 << j))
            for count in range(2, n + 1)
            for j in range(n)
            for chosen in (sets[(size == count) & ((sets >> j) & 1 == 1)],)
        ]
    return _LAYERS[n]


def largest(
    stops: list[Stop],
    worths: list[Array],
    budget_s: float,
    second: float = 0.0,
    *,
    reach_end: bool = True,
) -> tuple[float, bool]:
    """Bound on the sum of worths minus ``second`` a second, over all schedules that start no decision after the time.

    Args:
        stops: in the order in which they are passed.
        worths: (n, E) a stop, time not counted.
        budget_s: the last decision begins before this.
        second: price of a second in the objective, >= 0.
        reach_end: whether an episode that does not leave the last stop pays for the whole budget; without it the
            way out of the last stop is not counted either.

    Returns:
        The bound, and whether it is the optimum: the best schedule for a free second, its routes solved exactly, keeps
        the time limit.
    """
    rates = [
        float(np.max(worth / np.maximum(stop.process_s, 1e-9)))
        for stop, worth in zip(stops, worths, strict=True)
        if stop.targets
    ]
    highest = max([*rates, 0.0])
    once = max([float(worth.max()) for stop, worth in zip(stops, worths, strict=True) if stop.targets], default=0.0)
    longest_s = max(stop.longest_s for stop in stops)
    cache: dict[float, tuple[Array, Array, Array]] = {}

    def parts(price: float) -> tuple[Array, Array, Array]:
        """Value of all that lies before each stop, of passing it, and of staying there."""
        if price not in cache:
            both = [stop.best(worth, price) for stop, worth in zip(stops, worths, strict=True)]
            through, stay = np.array(both).T
            cache[price] = np.concatenate([[0.0], np.cumsum(through)[:-1]]), through, stay
        return cache[price]

    def curve(price: float) -> Array:
        """Bound for every stop that may be the last one reached."""
        # The last decision may run over: its time is free, which is worth at most its whole time at this price, or
        # the whole of what it brings.
        over = min(price * longest_s, max(once, 0.0)) + price * budget_s
        before, through, stay = parts(price + second)
        if not reach_end:
            return before + stay + over
        finished = before[-1] + through[-1] + over
        # An episode that does not leave the last stop uses its time up, and pays for all of it.
        before, _, stay = parts(price)
        ended = before + stay + over - second * budget_s
        ended[-1] = max(ended[-1], finished)
        return ended

    prices = np.concatenate([[0.0], highest * np.linspace(0.1, 1.2, 12)])
    curves = [curve(float(price)) for price in prices]
    for _ in range(14):
        table = np.array(curves)
        stop = int(table.min(axis=0).argmax())
        order = np.argsort(prices)
        at = int(np.flatnonzero(order == int(table[:, stop].argmin()))[0])
        left, right = prices[order[max(at - 1, 0)]], prices[order[min(at + 1, len(order) - 1)]]
        middle = prices[order[at]]
        new = 0.5 * (middle + (left if middle - left > right - middle else right))
        prices = np.append(prices, new)
        curves.append(curve(float(new)))
    values = np.array(curves).min(axis=0)
    # A curve that does not fall from a price of zero belongs to a schedule that leaves time over.
    hint = 1e-6 * highest
    free, almost = curves[0], curve(hint) - hint * longest_s
    proven = bool(free.argmax() == values.argmax() and almost.max() >= free.max() == values.max())
    return float(values.max()), proven and all(stop.exact for stop in stops)


def shortest_cycle(stops: list[Stop], grams: float, already_s: float) -> float:
    """Seconds per target below which no schedule with at least ``grams`` can fall; infinite when none has as many.

    A schedule with cycle time c has sum over its targets of (c - time + price x gain) >= price x grams + already_s for
    every price >= 0; the largest c for which that is impossible at some price is the bound.

    Args:
        stops: in the order in which they are passed; targets whose gain is zero do not count as served.
        grams: sum of gains that is asked for.
        already_s: time that has passed before the first decision.
    """
    busy = [stop for stop in stops if stop.targets]
    if not busy or grams > in_order(float(stop.gain.max(axis=1).sum()) for stop in busy) * (1.0 + 1e-9):
        return np.inf
    most = 2.0 * max(stop.longest_s for stop in busy) + already_s
    second_per_gram = float(np.median([np.min(s.process_s / np.maximum(s.gain, 1e-9)) for s in busy]))
    prices = second_per_gram * np.concatenate([[0.0], np.geomspace(0.02, 200.0, 22)])
    # Every target pays its shortest approach while prices are searched; routes are reckoned at the best one only.
    coarse = _coarse_excess(stops)
    low, high = np.zeros(len(prices)), np.full(len(prices), most)
    for _ in range(14):
        middle = 0.5 * (low + high)
        impossible = coarse(middle, prices) - prices * grams - already_s < 0.0
        low, high = np.where(impossible, middle, low), np.where(impossible, high, middle)
    best = int(low.argmax())
    price, bottom = float(prices[best]), float(low[best])
    top = min(1.5 * bottom + 1.0, most)
    for _ in range(12):
        cycle_s = 0.5 * (bottom + top)
        both = [stop.best(cycle_s * (stop.gain > 0.0) + price * stop.gain, 1.0) for stop in stops]
        through, stay = np.array(both).T
        before = np.concatenate([[0.0], np.cumsum(through)[:-1]])
        impossible_here = float((before + stay).max()) - price * grams - already_s < 0.0
        bottom, top = (cycle_s, top) if impossible_here else (bottom, cycle_s)
    return bottom


def _coarse_excess(stops: list[Stop]) -> Callable[[Array, Array], Array]:
    """``Stop.best`` without routes for all stops at once: largest sum of (cycle time - time + price x gain)."""
    counts = [stop.targets for stop in stops]
    widest = max(stop.gain.shape[1] for stop in stops if stop.targets)
    gain = np.concatenate([s.gain if s.targets else np.zeros((0, widest)) for s in stops])
    process = np.concatenate([s.process_s if s.targets else np.zeros((0, widest)) for s in stops])
    shortest = np.concatenate([s.shortest_approach_s if s.targets else np.zeros(0) for s in stops])
    member = np.repeat(np.eye(len(stops)), counts, axis=0)
    direct = np.array([s.leave_s[0] for s in stops])
    first = np.array([(s.approach_s[0] - s.shortest_approach_s).min() if s.targets else 0.0 for s in stops])
    away = np.array([s.leave_s[1:].min() if s.targets else s.leave_s[0] for s in stops])
    there = gain > 0.0

    def excess(cycle_s: Array, price: Array) -> Array:
        each = cycle_s[:, None, None] * there + price[:, None, None] * gain - process
        value = np.maximum(each.max(axis=2) - shortest, 0.0) @ member - first
        through = np.maximum(value - away, -direct)
        before = np.concatenate([np.zeros((len(price), 1)), np.cumsum(through, axis=1)[:, :-1]], axis=1)
        return (before + np.maximum(value, 0.0)).max(axis=1)

    return excess
