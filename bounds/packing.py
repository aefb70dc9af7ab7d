"""What order lines leave of a stream's worth: prices on things and on lines in a time-expanded graph.

Every thing may be picked once and every line takes its count. A thing that lies in its bin at a time fills one of its
grade's lines that are due no sooner, at that line's price, or brings what surplus brings. For any prices a longest path
bounds every schedule (see ``timeline``); subgradient steps on both kinds of prices make the bound small. Relaxed beyond
that: bins are never away, and ends are rounded down to a tick, so a thing may be a tick late. Who knows the luck has
only those things to pick that land right, with chances of 1.

**In expectation** a pick may fail: then the machine is free sooner, somewhere over the belt, and nothing lies in a bin.
A pick is worth what it brings on average and, by their chances, the two nodes to which it may lead. So the longest path
becomes the best policy of a machine that knows the stream, the chances and how its grips went, and that may pick a
thing twice and fill a line beyond its count, at their prices: a relaxed weakly coupled dynamic program (Adelman and
Mersereau 2008). Why no policy of the rules gets more on average: before each decision add up what was paid so far, the
worth of the node of the machine's place and time (rounded down), the prices of the things not tried yet, and those of
what lines still lack.

- By the rules a pick ends no sooner, and who waits has no more, so the nodes in the sum are worth no less than the true
  places and times.
- What lands right is paid its gain while a line gives up its price, or is paid as surplus. Neither is more than the
  weight, which is the best of both over the lines of its grade that are due no sooner, and is known at the decision.
- Whether it is held, slips and is ripe is luck that nothing told before, so a policy may depend on all that it saw: the
  mean of the sum after the decision, given that, is no more than the sum before it.

So the sum falls on average, whatever the policy, and what stands in it at the end beside what was paid is not negative:
no mean is above the sum at the start. This needs prices that are set before the luck; nothing of it enters them. What
brings nothing on average even at the lines' full gain is left out: who does without it is nowhere later. Where a chance
is only known to lie between two, the better of them is taken, since means are linear in it.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled, fill
from .grips import Chances
from .timeline import Timeline

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
Indices = NDArray[np.int32]

_ENOUGH, _LEAST = 0.2, 1e-4
"""Part of the fall hoped for that is none, and of the bound below which none is hoped for."""


class Stage(NamedTuple):
    """How prices are looked for by subgradient steps.

    Attributes:
        tick_s: of the graph; with a coarse one steps cost less.
        rounds: most steps.
        fall: part of the bound by which it is hoped to fall in a step.
        memory: share of the last direction in the next one.
        patience: steps without enough of a fall after which half of it is hoped for.
    """

    tick_s: float
    rounds: int
    fall: float
    memory: float
    patience: int


STAGES = Stage(0.06, 600, 0.05, 0.9, 20), Stage(0.02, 60, 0.001, 0.7, 6)
"""First coarse, then fine: the bound is that of the last [chosen on seeds 1000000 to 1000002]."""


class Lines(NamedTuple):
    """Order lines, L of them, those that are due first in front.

    Attributes:
        grade: (L,), what they want.
        wants: (L,), how many of it.
        due_s: (L,), until when.
    """

    grade: Numbers
    wants: Numbers
    due_s: Array


class Goods(NamedTuple):
    """Things to be picked, n of them.

    Attributes:
        grade: (n,), of which grade they are reported.
        gain: (n,), of a right one that fills a line.
        surplus: share of it that others bring.
        chances: what may come of picks.
    """

    grade: Numbers
    gain: Array
    surplus: float
    chances: Chances


def most_filled(lines: Lines, goods: Goods, ready_s: Array) -> float:
    """What things could bring if every one lay in its bin as soon as it can, one machine for each, all grips held.

    Args:
        lines: what is ordered.
        goods: the things; of a grade all gain the same.
        ready_s: (n,), no sooner is a thing in its bin.
    """
    total = 0.0
    for kind in np.unique(goods.grade):
        mine, there = lines.grade == kind, np.sort(ready_s[goods.grade == kind])
        left, filled = lines.wants[mine].copy(), 0
        for done_s in there[::-1]:
            # Late things first, each into the line that is due last of those that it can fill.
            able = np.flatnonzero((left > 0) & (lines.due_s[mine] >= done_s))
            if len(able):
                left[able[-1]] -= 1
                filled += 1
        worth = float(goods.gain[goods.grade == kind].max(initial=0.0))
        total += worth * (filled + goods.surplus * (len(there) - filled))
    return total


def first_prices(lines: Lines, goods: Goods, guess: Array) -> list[Array]:
    """Prices (n + L,) of things and lines to begin with.

    Args:
        lines: what is ordered.
        goods: the things.
        guess: (n,), seconds that a thing takes, roughly.
    """
    gain, mean = goods.gain, goods.chances.mean
    worths = np.array([gain[goods.grade == kind].max(initial=0.0) for kind in lines.grade])
    second = float(gain.max(initial=0.0)) / max(float(guess.min(initial=1.0)), 1e-9)
    return [
        np.concatenate([np.maximum(mean(gain * (1.0 - cost)) - late * second * guess, 0.0), cost * worths])
        for late in (0.0, 0.2, 0.5, 0.8)
        for cost in (0.0, 0.3, 0.6)
    ]


def priced_orders(
    graph: Timeline,
    instead: Indices,
    lines: Lines,
    goods: Goods,
    begin: Sequence[Array],
    stage: Stage,
    time_limit_s: float = 30.0,
) -> tuple[float, Array, Array]:
    """Smallest bound found on what things bring on average, see the module, its prices (n + L,) and nodes' worths (V,).

    Args:
        graph: an edge's option is the thing that it picks; its end is when that lies in its bin.
        instead: (E,), node where an edge ends if the grip holds nothing.
        lines: what is ordered.
        goods: the things.
        begin: prices (n + L,) each, to go on from the best of.
        stage: how to go on.
        time_limit_s: wall seconds after which no step begins.
    """
    began = time.perf_counter()
    n, several, chances = len(goods.gain), len(lines.wants) + 1, goods.chances
    # An option is a thing and the first of all lines that is due after it is done, whatever that wants.
    first_line = np.searchsorted(lines.due_s, graph.end_s[graph.to], side="left")
    graph = graph._replace(option=(graph.option * several + first_line).astype(np.int32))
    best, way, reached = np.empty(len(graph.wait)), np.empty(len(graph.wait), np.int64), np.empty(len(graph.wait))
    weight, choice, count = np.empty(n * several), np.empty(n * several, np.int64), np.empty(n * several)
    capacity = np.concatenate([np.ones(n), lines.wants.astype(float)])

    def at(prices: Array) -> tuple[float, Array]:
        """Bound at prices of things and lines, and how much of each thing and line is left there."""
        _weigh(lines, goods, prices[n:], weight, choice)
        value = _best_on_average(graph, instead, chances, several, weight, prices, best, way)
        _tried(graph, instead, chances, several, way, reached, count)
        left = capacity.copy()
        left[:n] -= count.reshape(n, several).sum(axis=1)
        landed = count * np.repeat(chances.most * chances.right, several)
        np.subtract.at(left, n + choice[choice >= 0], landed[choice >= 0])
        return value + float(capacity @ prices), left

    prices = min(begin, key=lambda some: at(some)[0])
    bound, left = at(prices)
    here, direction, fall, stale = prices, np.zeros(n + several - 1), stage.fall * bound, 0
    for _ in range(stage.rounds):
        if fall <= _LEAST * bound or time.perf_counter() - began > time_limit_s:
            break
        # No price falls below nothing.
        slope = np.where((here <= 0.0) & (left > 0.0), 0.0, left)
        direction = stage.memory * direction + (1.0 - stage.memory) * slope
        square = float(direction @ direction)
        if square <= 0.0:
            break
        here = np.maximum(here - fall / square * direction, 0.0)
        value, left = at(here)
        stale = 0 if value < bound - _ENOUGH * fall else stale + 1
        if value < bound:
            bound, prices = value, here
        if stale == stage.patience:
            fall, stale, here, direction = 0.5 * fall, 0, prices, np.zeros(n + several - 1)
            left = at(here)[1]
    at(prices)
    return float(bound), prices, best


@compiled
def _weigh(lines: Lines, goods: Goods, line: Array, weight: Array, choice: Numbers) -> None:
    """What every option brings on average if the grip holds, and the line that it fills, -1 for none."""
    several = len(line) + 1
    right, held, surplus = goods.chances.right, goods.chances.held, goods.surplus
    for j in range(len(goods.gain)):
        cheapest, found, gain = np.inf, -1, goods.gain[j]
        weight[j * several + several - 1] = right[j] * surplus * gain + held[j]
        choice[j * several + several - 1] = -1
        for k in range(several - 2, -1, -1):
            if lines.grade[k] == goods.grade[j] and line[k] < cheapest:
                cheapest, found = line[k], k
            wins = gain - cheapest > surplus * gain
            weight[j * several + k] = right[j] * (gain - cheapest if wins else surplus * gain) + held[j]
            choice[j * several + k] = found if wins else -1


@compiled
def _best_on_average(
    graph: Timeline,
    instead: Indices,
    chances: Chances,
    several: int,
    weight: Array,
    prices: Array,
    best: Array,
    way: Numbers,
) -> float:
    """Worth of the best policy from every node, into ``best`` (V,); ``way`` (V,) is as in ``timeline.longest_path``."""
    for node in range(len(best)):
        value, edge = 0.0, -2
        later = graph.wait[node]
        if later != node and best[later] > value:
            value, edge = best[later], -1
        for e in range(graph.first[node], graph.first[node + 1]):
            option = graph.option[e]
            j = option // several
            through = weight[option] + best[graph.to[e]]
            if chances.least[j] < 1.0:
                fails = chances.missed + best[instead[e]]
                through = fails + (chances.most[j] if through > fails else chances.least[j]) * (through - fails)
            through -= prices[j]
            if through > value:
                value, edge = through, e
        best[node], way[node] = value, edge
    return best[graph.start]


@compiled
def _tried(
    graph: Timeline, instead: Indices, chances: Chances, several: int, way: Numbers, reached: Array, count: Array
) -> None:
    """How often that policy tries every option on average, into ``count`` (O,); ``reached`` (V,) is overwritten."""
    fill(reached, 0.0)
    fill(count, 0.0)
    reached[graph.start] = 1.0
    for node in range(graph.start, -1, -1):
        share, edge = reached[node], way[node]
        if share <= 0.0 or edge == -2:
            continue
        if edge == -1:
            reached[graph.wait[node]] += share
            continue
        option = graph.option[edge]
        holds = chances.most[option // several]
        count[option] += share
        reached[graph.to[edge]] += share * holds
        reached[instead[edge]] += share * (1.0 - holds)
