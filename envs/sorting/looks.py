"""Looks at many reports at once: where each is met and how long everything takes, from where a platform is.

A look is a chain of eight square roots, each of which waits for the one before. Here what looks need is laid side by
side first: loops over that become vector code, and reading it from all over the memory goes on side by side too.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled
from ..columns import numbered
from ..core import Array
from .columns import CANDIDATE, CYCLE_SCALE_S, NUMBER, PLACE_SCALE_M, TOTAL, WAIT_SCALE_S
from .reports import shown
from .state import Tables, Worlds
from .timing import GUESS_S, approach_s, carry_s, turn_s

ROOM = 192
"""Looks that are taken together: so many find room near the processor."""
_WIDTH = 8
"""Looks come in as many as a wide register holds; what is left over is looked at for nothing."""


class Ways(NamedTuple):
    """Rows of numbers of looks, a column each."""

    time_s: int
    now_m: int
    first_m: int
    last_m: int
    from_m: int
    across_m2: int
    turn_s: int
    hold_s: int
    bin_m: int
    aside_m2: int
    least_s: int
    deadline_s: int
    # What is found: x of the platform when the approach ends, the wait before it, until the tool is over the item, from
    # the lift to the bin, until the item is in it.
    meet_m: int
    wait_s: int
    approach_s: int
    carry_s: int
    cycle_s: int


WAY = numbered(Ways)


@compiled
def ways_for(looks: int) -> Array:
    """Room (``Ways``, n) for so many looks."""
    return np.zeros((len(WAY), _whole(looks)))


@compiled
def _whole(looks: int) -> int:
    return (looks + _WIDTH - 1) // _WIDTH * _WIDTH


@compiled
def lay_way(tables: Tables, worlds: Worlds, w: int, report: int, ways: Array, i: int) -> None:
    """Lay down what the look ``i`` at a report of a world needs."""
    number, place, speed = worlds.number[w, report], worlds.place[w], tables.paces.speed_m_s
    time_s, across = worlds.totals[w, TOTAL.time_s], number[NUMBER.across_m] - place[1]
    ways[WAY.time_s, i], ways[WAY.now_m, i] = time_s, (time_s - number[NUMBER.passing_s]) * speed
    ways[WAY.first_m, i], ways[WAY.last_m, i] = number[NUMBER.first_m], number[NUMBER.last_m]
    ways[WAY.from_m, i], ways[WAY.across_m2, i] = place[0], across * across
    ways[WAY.hold_s, i], ways[WAY.bin_m, i] = number[NUMBER.hold_s], number[NUMBER.bin_m]
    ways[WAY.aside_m2, i], ways[WAY.least_s, i] = number[NUMBER.aside_m2], number[NUMBER.least_s]
    ways[WAY.deadline_s, i], ways[WAY.carry_s, i] = number[NUMBER.deadline_s], number[NUMBER.carry_s]
    # From level a turn takes what it takes back to level: that is known since the report came.
    ways[WAY.turn_s, i] = number[NUMBER.least_s]
    if not worlds.level[w]:
        ways[WAY.turn_s, i] = turning_s(tables, worlds.turn[w], number)


@compiled
def turning_s(tables: Tables, turn: Array, number: Array) -> float:
    """Seconds that turning the platform from ``turn`` to a report's grip takes at least."""
    cosine, paces = 0.0, tables.paces
    for part in range(4):
        cosine += number[NUMBER.turn_w + part] * turn[part]
    angle = 2.0 * math.acos(min(abs(cosine), 1.0))
    return turn_s(angle, paces.turn_pace, paces.turn_square_pace, paces.shortest_s)


@compiled
def look(tables: Tables, ways: Array, looks: int) -> None:
    """Find the times of the first ``looks`` ways that are laid down; a way's guess at the carry is improved."""
    paces, n = tables.paces, _whole(looks)
    speed, pace, square_pace = paces.speed_m_s, paces.pace, paces.square_pace
    # Short loops over rows with names: of few arrays it is seen at run time that none lies over another.
    now, first, begin, aside = ways[WAY.now_m], ways[WAY.first_m], ways[WAY.from_m], ways[WAY.across_m2]
    turn, approach, meet, wait = ways[WAY.turn_s], ways[WAY.approach_s], ways[WAY.meet_m], ways[WAY.wait_s]
    for i in range(n):
        approach[i] = approach_s(speed, now[i], first[i], begin[i], aside[i], 0.0, pace, square_pace, turn[i], GUESS_S)
    for i in range(n):
        meet[i] = max(now[i] + speed * approach[i], first[i])
    for i in range(n):
        wait[i] = max((meet[i] - now[i]) / speed - approach[i], 0.0)
    to_bin, hold, aside2 = ways[WAY.bin_m], ways[WAY.hold_s], ways[WAY.aside_m2]
    least, carry = ways[WAY.least_s], ways[WAY.carry_s]
    for i in range(n):
        way = to_bin[i] - meet[i] - speed * hold[i]
        carry[i] = carry_s(speed, way, aside2[i], 0.0, pace, square_pace, least[i], carry[i])
    cycle, release_s = ways[WAY.cycle_s], paces.release_s
    for i in range(n):
        cycle[i] = approach[i] + wait[i] + carry[i] + hold[i] + release_s


@compiled
def scale(ways: Array, looks: int) -> None:
    """Turn what the first ``looks`` have found into what policies are shown; of the cycle it stands as the carry."""
    n, now, approach, wait = _whole(looks), ways[WAY.now_m], ways[WAY.approach_s], ways[WAY.wait_s]
    time_s, slack, carry, cycle = ways[WAY.time_s], ways[WAY.deadline_s], ways[WAY.carry_s], ways[WAY.cycle_s]
    for i in range(n):
        carry[i] = shown(cycle[i] / CYCLE_SCALE_S)
    for i in range(n):
        slack[i] = shown(max(slack[i] - time_s[i] - approach[i], -WAIT_SCALE_S) / WAIT_SCALE_S)
    for i in range(n):
        now[i] = shown(now[i] / PLACE_SCALE_M)
    for i in range(n):
        approach[i] = shown(approach[i])
    for i in range(n):
        wait[i] = shown(wait[i] / WAIT_SCALE_S)


@compiled
def lay_features(ways: Array, i: int, feature: NDArray[np.float32]) -> None:
    """Write what policies are shown of the look ``i``."""
    feature[CANDIDATE.along], feature[CANDIDATE.approach] = ways[WAY.now_m, i], ways[WAY.approach_s, i]
    feature[CANDIDATE.wait], feature[CANDIDATE.cycle] = ways[WAY.wait_s, i], ways[WAY.carry_s, i]
    feature[CANDIDATE.slack], feature[CANDIDATE.possible] = ways[WAY.deadline_s, i], in_time(ways, i)


@compiled
def in_time(ways: Array, i: int) -> bool:
    """Whether what the look ``i`` was at can be gripped now."""
    return ways[WAY.meet_m, i] <= ways[WAY.last_m, i]
