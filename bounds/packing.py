"""What order lines leave of a stream's worth: prices on things and on lines in a time-expanded graph.

Every thing may be picked once and every line takes its count. A thing that lies in its bin at a time fills one of its
grade's lines that are due no sooner, at that line's price, or brings what surplus brings. For any prices a longest path
bounds every schedule (see ``timeline``); subgradient steps on both kinds of prices make the bound small. Relaxed beyond
that: bins are never away, and ends are rounded down to a tick, so a thing may be a tick late.
"""

from __future__ import annotations

import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled
from .timeline import Timeline, follow, longest_path

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

_PATIENCE, _MEMORY = 25, 0.9
"""See ``timeline``; here the best schedule found is far from the bound, so that steps are long and turn often."""


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


def most_filled(lines: Lines, grade: Numbers, ready_s: Array, gain: Array, surplus: float) -> float:
    """What things could bring if every one lay in its bin as soon as it can, one machine for each.

    Args:
        lines: what is ordered.
        grade: (n,), of the things.
        ready_s: (n,), no sooner is a thing in its bin.
        gain: (n,), of one that fills a line, the same for every thing of a grade.
        surplus: share of it that others bring.
    """
    total = 0.0
    for kind in np.unique(grade):
        mine, there = lines.grade == kind, np.sort(ready_s[grade == kind])
        left, filled = lines.wants[mine].copy(), 0
        for done_s in there[::-1]:
            # Late things first, each into the line that is due last of those that it can fill.
            able = np.flatnonzero((left > 0) & (lines.due_s[mine] >= done_s))
            if len(able):
                left[able[-1]] -= 1
                filled += 1
        worth = float(gain[grade == kind].max(initial=0.0))
        total += worth * (filled + surplus * (len(there) - filled))
    return total


def priced_orders(
    graph: Timeline,
    lines: Lines,
    grade: Numbers,
    gain: Array,
    surplus: float,
    guess: Array,
    rounds: int = 600,
    time_limit_s: float = 30.0,
    tolerance: float = 1e-4,
) -> tuple[float, float]:
    """Smallest bound found on what things bring, see the module, and what the best schedule of the graph found brings.

    Args:
        graph: an edge's option is the thing that it picks; its end is when that lies in its bin.
        lines: what is ordered.
        grade: (n,), of the things.
        gain: (n,), of one that fills a line.
        surplus: share of it that others bring.
        guess: (n,), seconds that a thing takes, roughly.
        rounds: most subgradient steps.
        time_limit_s: wall seconds after which no step begins.
        tolerance: relative gap at which to stop.
    """
    began = time.perf_counter()
    n, several = len(gain), len(lines.wants) + 1
    # An option is a thing and the first of all lines that is due after it is done, whatever that wants.
    first_line = np.searchsorted(lines.due_s, graph.end_s[graph.to], side="left")
    options = graph.option.astype(np.int64) * several + first_line
    graph = graph._replace(option=options)
    end, best, way = np.zeros(len(graph.wait)), np.empty(len(graph.wait)), np.empty(len(graph.wait), np.int64)
    taken = np.empty(len(graph.wait), np.int64)
    weight, choice = np.empty(n * several), np.empty(n * several, np.int64)

    found = 0.0

    def at(prices: Array) -> tuple[float, Array]:
        """Bound at prices of things and lines, and how much of each thing and line is left there."""
        nonlocal found
        _weigh(lines, grade, gain, surplus, prices[:n], prices[n:], weight, choice)
        value = longest_path(graph, weight, end, best, way) + float(capacity @ prices)
        count, _ = follow(graph, way, taken)
        left = capacity.copy()
        np.subtract.at(left, taken[:count] // several, 1.0)
        given = choice[taken[:count]]
        np.subtract.at(left, n + given[given >= 0], 1.0)
        found = max(found, _carried_out(lines, grade, gain, surplus, taken[:count], several))
        return value, left

    capacity = np.concatenate([np.ones(n), lines.wants.astype(float)])
    worths = np.array([gain[grade == kind].max(initial=0.0) for kind in lines.grade])
    second = float(gain.max(initial=0.0)) / max(float(guess.min(initial=1.0)), 1e-9)
    bound, here = np.inf, capacity
    for late in (0.0, 0.2, 0.5, 0.8):
        for cost in (0.0, 0.3, 0.6):
            trial = np.concatenate([np.maximum(gain * (1.0 - cost) - late * second * guess, 0.0), cost * worths])
            value, _ = at(trial)
            if value < bound:
                bound, here = value, trial
    _, left = at(here)
    prices, direction, factor, stale = here, np.zeros(len(here)), 1.0, 0
    for _ in range(rounds):
        gap = bound - found
        if gap <= tolerance * bound or time.perf_counter() - began > time_limit_s:
            break
        # No price falls below nothing.
        direction = _MEMORY * direction + (1.0 - _MEMORY) * np.where((here <= 0.0) & (left > 0.0), 0.0, left)
        square = float(direction @ direction)
        if square <= 0.0:
            break
        here = np.maximum(here - factor * gap / square * direction, 0.0)
        value, left = at(here)
        if value < bound - 1e-9:
            bound, prices, stale = value, here, 0
        else:
            stale += 1
            if stale == _PATIENCE:
                factor, stale, here, direction = 0.5 * factor, 0, prices, np.zeros(len(here))
                left = at(here)[1]
    return float(bound), found


@compiled
def _weigh(
    lines: Lines, grade: Numbers, gain: Array, surplus: float, thing: Array, line: Array, weight: Array, choice: Numbers
) -> None:
    """Weight of every option at the prices, and the line that it fills, -1 for none."""
    several = len(line) + 1
    for j in range(len(gain)):
        cheapest, found = np.inf, -1
        weight[j * several + several - 1] = surplus * gain[j] - thing[j]
        choice[j * several + several - 1] = -1
        for k in range(several - 2, -1, -1):
            if lines.grade[k] == grade[j] and line[k] < cheapest:
                cheapest, found = line[k], k
            wins = gain[j] - cheapest > surplus * gain[j]
            weight[j * several + k] = (gain[j] - cheapest if wins else surplus * gain[j]) - thing[j]
            choice[j * several + k] = found if wins else -1


@compiled
def _carried_out(lines: Lines, grade: Numbers, gain: Array, surplus: float, options: Numbers, several: int) -> float:
    """What the options of a path bring in turn: a thing once, into the first line that still lacks some."""
    picked, left, worth = np.zeros(len(gain)), lines.wants.copy(), 0.0
    for option in options:
        j, k = option // several, option % several
        if picked[j] > 0.0:
            continue
        picked[j] = 1.0
        while k < len(left) and not (lines.grade[k] == grade[j] and left[k] > 0):
            k += 1
        if k < len(left):
            left[k] -= 1
            worth += float(gain[j])
        else:
            worth += surplus * float(gain[j])
    return worth
