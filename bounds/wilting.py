"""A bound for targets that close one after the other at stops that are passed in order, and take time to carry away.

Every pick takes at least its shortest approach and its work. Whatever was picked at a stop before a time has taken its
time between the arrival and then, so for every closing time the picks of what closes until then fit before it. With
shares of picks instead of whole ones that is a greedy problem: what brings most a second comes first, as far as all the
closings still allow (Edmonds 1970, on polymatroids; these constraints are nested). The stops are joined by dynamic
programming over the time of arrival, which is rounded down.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP_S = 1.0
"""Times of arrival are told apart in steps of this."""


class Closing(NamedTuple):
    """Targets of one stop, n of them with E options each.

    Attributes:
        worth: (n, E), what each option brings, its time not counted.
        takes_s: (n, E), seconds that it takes at least.
        closes_s: (n,), when it has to be done.
        leave_s: seconds that it takes at least to drive on.
    """

    worth: Array
    takes_s: Array
    closes_s: Array
    leave_s: float


class Shares(NamedTuple):
    """Parts of targets, in the order of what they bring a second, falling.

    Attributes:
        rate: (m,), what a second brings.
        takes_s: (m,), most seconds that can be spent on it.
        closes_s: (m,), when it has to be done.
    """

    rate: Array
    takes_s: Array
    closes_s: Array


def shares_of(stop: Closing, second: float) -> Shares:
    """The upper hulls of the targets' options over their seconds, at a price of a second, as parts.

    Going from an option to a better one takes more time and brings less for it, so parts are never taken in the wrong
    order.
    """
    parts: list[tuple[float, float, float]] = []
    for worth, takes_s, closes_s in zip(stop.worth, stop.takes_s, stop.closes_s, strict=True):
        at_s = at = 0.0
        while True:
            ahead = (takes_s > at_s) & (worth > at)
            if not ahead.any():
                break
            rates = np.where(ahead, (worth - at) / np.where(ahead, takes_s - at_s, 1.0), -np.inf)
            steepest = rates.max()
            best = int(np.flatnonzero(rates == steepest)[-1])
            if steepest > second:
                parts.append((float(steepest) - second, float(takes_s[best]) - at_s, float(closes_s)))
            at_s, at = float(takes_s[best]), float(worth[best])
    parts.sort(key=lambda part: -part[0])
    return Shares(*np.array(parts).reshape(-1, 3).T)


def greedy(shares: Shares, arrival_s: Array) -> tuple[Array, Array]:
    """What can be brought from a stop by the seconds spent at it, for A arrivals.

    Returns:
        Corners of the seconds, ascending, and of what they bring, (A, m + 1) each.
    """
    deadlines = np.unique(shares.closes_s)
    room = deadlines - arrival_s[:, None]
    spent = np.zeros((len(arrival_s), len(shares.rate) + 1))
    for i, (takes_s, closes_s) in enumerate(zip(shares.takes_s, shares.closes_s, strict=True)):
        later = room[:, np.searchsorted(deadlines, closes_s) :]
        spent[:, i + 1] = np.clip(later.min(axis=1), 0.0, takes_s)
        later -= spent[:, i + 1, None]
    return spent.cumsum(axis=1), (spent * np.append(0.0, shares.rate)).cumsum(axis=1)


def most(stops: list[Closing], begin_s: float, limit_s: float, over_s: float, second: float) -> float:
    """Largest sum of worths, less ``second`` a second, over all schedules.

    Who leaves the last stop pays for the time until then, who does not for all the time until the limit.

    Args:
        stops: in the order in which they are passed.
        begin_s: when the first decision begins, at the earliest.
        limit_s: the last decision begins before this.
        over_s: longest decision, by which the last one may end after the limit.
        second: price of a second from ``begin_s`` on, >= 0.
    """
    arrivals_s = np.arange(begin_s, limit_s, STEP_S)
    last = int(np.ceil((limit_s + over_s - begin_s) / STEP_S)) + 1
    steps = np.arange(last + 1)
    # What comes after arriving in a step; after the limit nothing does.
    value = np.zeros(last + 1)
    for number in range(len(stops) - 1, -1, -1):
        stop = stops[number]
        priced_s, priced = greedy(shares_of(stop, second), arrivals_s)
        free_s, free = greedy(shares_of(stop, 0.0), arrivals_s)
        drive = int(stop.leave_s / STEP_S)
        after, value = value, np.zeros(last + 1)
        for k, arrival_s in enumerate(arrivals_s):
            # Who leaves in a step has worked for less than its end allows, and arrives not before its beginning.
            leaving = steps[k:]
            brought = np.interp(STEP_S * (leaving + 1 - k), priced_s[k], priced[k])
            onward = brought + after[np.minimum(leaving + drive, last)] if number + 1 < len(stops) else brought
            # Steps are rounded down twice a stop, so this much less may be left to be paid for.
            left_s = max(limit_s - arrival_s - 2.0 * STEP_S * number, 0.0)
            stays = np.interp(limit_s + over_s - arrival_s, free_s[k], free[k]) - second * left_s
            value[k] = max(float(onward.max()) - second * stop.leave_s, float(stays))
    return float(value[0])
