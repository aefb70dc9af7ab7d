"""Bounds on schedules of one machine by a time-expanded graph and prices on what can be had once.

A node is a state of the machine at a tick of time; an edge is a decision, which brings shares of things, and its end is
rounded down to a tick, so that no true schedule is missing. The longest path is quick to find, but it may serve a thing
again and again. So every thing gets a price: a schedule is worth what it serves at these prices, plus what the prices
leave of each thing's gain. That bounds every schedule that counts a thing once, for any prices; subgradient steps make
the bound small (Held and Karp 1971; Held, Wolfe and Crowder 1974).
"""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

_PATIENCE = 4
"""Steps without a smaller bound after which steps are halved."""
_MEMORY = 0.6
"""Share of the last direction in the next one."""


class Timeline(NamedTuple):
    """A time-expanded graph: V nodes, from the last tick to the first, E edges, O options, C shares.

    Attributes:
        first: (V + 1,), place of a node's first edge; a node comes after all that its edges lead to.
        to: (E,), node where an edge ends.
        option: (E,), what the decision is.
        wait: (V,), node of the same state a tick later, or itself where there is none.
        end_s: (V,), time of a node.
        start: node in which every schedule begins.
        share_first: (O + 1,), place of an option's first share.
        share_thing: (C,), thing that the option serves.
        share: (C,), how much of it; any set of options that has it has shares that add up to at least 1.
    """

    first: Numbers
    to: NDArray[np.int32]
    option: NDArray[np.int32]
    wait: Numbers
    end_s: Array
    start: int
    share_first: Numbers
    share_thing: Numbers
    share: Array


class Priced(NamedTuple):
    """A bound by prices.

    Attributes:
        bound: no schedule is worth more.
        found: what the best schedule found is worth; it is one of the graph, which may be kinder than the rules.
        prices: of the things, at which the bound was found.
    """

    bound: float
    found: float
    prices: Array


@compiled
def longest_path(graph: Timeline, weight: Array, end: Array, best: Array, way: Numbers) -> float:
    """Value of the best schedule from every node, into ``best`` (V,); ``way`` (V,) is its first edge.

    Args:
        graph: nodes and edges.
        weight: (O,), of an edge by its option.
        end: (V,), worth of ending in a node.
        best: result.
        way: result: -1 to wait, -2 to end.
    """
    for node in range(len(end)):
        value, edge = end[node], -2
        later = graph.wait[node]
        if later != node and best[later] > value:
            value, edge = best[later], -1
        for e in range(graph.first[node], graph.first[node + 1]):
            through = weight[graph.option[e]] + best[graph.to[e]]
            if through > value:
                value, edge = through, e
        best[node], way[node] = value, edge
    return best[graph.start]


@compiled
def follow(graph: Timeline, way: Numbers, options: Numbers) -> tuple[int, int]:
    """Options along the best schedule, into ``options``; how many there are, and the node where it ends."""
    node, count = graph.start, 0
    while way[node] != -2:
        if way[node] == -1:
            node = int(graph.wait[node])
        else:
            options[count] = graph.option[way[node]]
            count += 1
            node = int(graph.to[way[node]])
    return count, node


@compiled
def option_weights(graph: Timeline, prices: Array, cost: Array, weight: Array) -> None:
    """Weight (O,) of every option at the prices (things,), less its own cost (O,)."""
    for option in range(len(cost)):
        weight[option] = -cost[option]
        for place in range(graph.share_first[option], graph.share_first[option + 1]):
            weight[option] += graph.share[place] * prices[graph.share_thing[place]]


@compiled
def carried_out(
    graph: Timeline, options: Numbers, gain: Array, cost: Array, whole: NDArray[np.bool_], served: Array
) -> float:
    """What options (n,) bring one after the other; ``served`` (things,), zero before, adds up their shares."""
    worth = 0.0
    for option in options:
        new, begun = 0.0, False
        for place in range(graph.share_first[option], graph.share_first[option + 1]):
            thing, share = graph.share_thing[place], graph.share[place]
            had, has = min(served[thing], 1.0), min(served[thing] + share, 1.0)
            if not whole[thing]:
                new += gain[thing] * (has - had)
            elif had < 1.0 and has >= 1.0 - 1e-9:
                new += gain[thing]
            begun = begun or (whole[thing] and share < 1.0)
            served[thing] += share
        # A decision that brings nothing new is left out: that takes no longer.
        if new > cost[option] or begun:
            worth += new - cost[option]
    return float(worth)


def priced(
    graph: Timeline,
    gain: Array,
    cost: Array,
    end: Array,
    guess: Array,
    rounds: int = 60,
    time_limit_s: float = 30.0,
    tolerance: float = 1e-4,
    found: float = float("nan"),
    begin: Array | None = None,
    beside: Array | None = None,
    whole: NDArray[np.bool_] | None = None,
) -> Priced:
    """Smallest bound found on the gains of the things served, less the options' costs, plus the worth of the end.

    Args:
        graph: nodes and edges.
        gain: (things,), of each thing, once, >= 0.
        cost: (O,), of each option, >= 0.
        end: (V,), worth of ending in a node.
        guess: (things,), seconds that a thing takes, roughly: prices begin in proportion to them.
        rounds: most subgradient steps.
        time_limit_s: wall seconds after which no step begins.
        tolerance: relative gap at which to stop.
        found: what a schedule is known to be worth, or NaN.
        begin: (things,), prices to begin with instead of those.
        beside: (things,), prices that are tried beside all others; steps from there would be in vain.
        whole: (things,), whether shares of a thing gain nothing until they add up to 1; by default of all. Shares of
            the others gain what they are, up to 1.
    """
    began = time.perf_counter()
    nodes, options, things = len(graph.wait), len(cost), len(gain)
    best, way, weight = np.empty(nodes), np.empty(nodes, np.int64), np.empty(options)
    taken = np.empty(nodes, np.int64)
    whole = np.ones(things, bool) if whole is None else whole
    found = max(float(end[graph.start]), found) if found == found else float(end[graph.start])

    def at(prices: Array) -> tuple[float, Array]:
        """Bound at some prices, and how often the best schedule at them serves each thing."""
        nonlocal found
        option_weights(graph, prices, cost, weight)
        value = longest_path(graph, weight, end, best, way) + float((gain - prices).sum())
        count, last = follow(graph, way, taken)
        served = np.zeros(things)
        found = max(found, carried_out(graph, taken[:count], gain, cost, whole, served) + float(end[last]))
        return value, served

    scale = float(gain.max(initial=0.0)) / max(float(guess.min(initial=1.0)), 1e-9)
    prices, bound, served = gain.copy(), np.inf, np.zeros(things)
    trials = [part * scale * guess for part in (0.0, 0.05, 0.15, 0.3, 0.5, 0.8)]
    for trial in trials if begin is None else [begin]:
        within = np.clip(trial, 0.0, gain)
        value, counts = at(within)
        if value < bound:
            prices, bound, served = within, value, counts
    direction, factor, stale, here = np.zeros(things), 1.0, 0, prices
    for _ in range(rounds):
        gap = bound - found
        if gap <= tolerance * max(abs(bound), 1e-9) or time.perf_counter() - began > time_limit_s:
            break
        slope = served - 1.0
        # Prices stay between zero and the gain: where a step would leave that range there is no slope.
        slope[((here >= gain) & (slope < 0.0)) | ((here <= 0.0) & (slope > 0.0))] = 0.0
        direction = _MEMORY * direction + (1.0 - _MEMORY) * slope
        square = float(direction @ direction)
        if square <= 0.0:
            break
        here = np.clip(here - factor * gap / square * direction, 0.0, gain)
        value, served = at(here)
        if value < bound - 1e-9:
            bound, prices, stale = value, here, 0
        else:
            stale += 1
            if stale == _PATIENCE:
                factor, stale, here, direction = 0.5 * factor, 0, prices, np.zeros(things)
                served = at(here)[1]
    if beside is not None:
        within = np.clip(beside, 0.0, gain)
        value, _ = at(within)
        bound, prices = (value, within) if value < bound else (bound, prices)
    return Priced(float(bound), found, prices)
