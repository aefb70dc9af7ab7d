"""The best sequence of picks from a belt, by dynamic programming over sets; compiled.

A schedule is told by where the machine stands, when, what it has picked of the things that still lie in reach, and what
that was worth. One such label dominates another that is no earlier, no more valuable, and has picked no less of what
lies in reach (Feillet et al. 2004, elementary shortest paths with resources; Held and Karp 1962): only labels that
nothing dominates go on. Things pass quickly, so the sets stay small and the optimum is proven.
"""

from __future__ import annotations

import heapq
import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.sorting.timing import GUESS_S, Paces, approach_s, carry_s, stroke_s, way_s
from ..kernels import compiled

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
Indices = NDArray[np.int32]

MEMORY = 62
"""Things that may lie in reach at once and still be told apart."""
_RECENT = 256
"""Labels before a new one that are asked whether they dominate it."""


class Stream(NamedTuple):
    """Things on a belt, n of them in the order of their deadlines; x along the belt, metres.

    Attributes:
        passing_s: (n,), when the machine over it would pass x = 0.
        across_m: (n,), its y.
        first_m: (n,), first x where an approach may end.
        last_m: (n,), last one.
        hold_s: (n,), from the approach's end until it is lifted.
        least_s: (n,), no approach and no way to its bin is shorter.
        known_s: (n,), no decision to pick it before this; as late as that does not matter (see ``decided_late``).
        bin: (n,), where it goes; behind the last of the ``Belt.places`` where the grip holds nothing: then the machine
            rests over the belt, and may do so anywhere.
        gain: (n,), what that is worth, > 0.
        slack_m: taken off every distance between machine and thing.
    """

    passing_s: Array
    across_m: Array
    first_m: Array
    last_m: Array
    hold_s: Array
    least_s: Array
    known_s: Array
    bin: NDArray[np.int64]
    gain: Array
    slack_m: float


class Belt(NamedTuple):
    """The machine over the belt.

    Attributes:
        paces: what times depend on.
        places: (bins + 1, 2), x and y of the bins, then where the machine stands in the beginning.
        limit_s: no decision begins at or after this.
    """

    paces: Paces
    places: Array
    limit_s: float


@compiled
def finish_s(belt: Belt, stream: Stream, j: int, place: int, time_s: float) -> float:
    """When thing ``j`` lies in its bin if it is decided for at ``time_s``; infinite where that is too late."""
    paces, slack, least = belt.paces, stream.slack_m, stream.least_s[j]
    v, pace, square_pace = paces.speed_m_s, paces.pace, paces.square_pace
    start_s = max(time_s, stream.known_s[j])
    now = (start_s - stream.passing_s[j]) * v
    if place < len(belt.places):
        x, y = belt.places[place, 0], belt.places[place, 1]
        across, first = stream.across_m[j] - y, stream.first_m[j] - x
        approach = approach_s(v, now - x, first, 0.0, across * across, slack, pace, square_pace, least, GUESS_S)
    else:
        # Where it stands is not known, nor how it is turned: it may be over the thing already.
        approach = paces.shortest_s
    meet = max(now + v * approach, stream.first_m[j])
    if meet > stream.last_m[j] or start_s >= belt.limit_s:
        return np.inf
    wait = max((meet - now) / v - approach, 0.0)
    to = stream.bin[j]
    if to == len(belt.places):
        return start_s + wait + approach + stream.hold_s[j] + paces.stop_s
    bin_x, aside = belt.places[to, 0], belt.places[to, 1] - stream.across_m[j]
    way = bin_x - meet - v * stream.hold_s[j]
    guess = stroke_s(math.sqrt(bin_x * bin_x + aside * aside), pace, square_pace)
    carry = carry_s(v, way, aside * aside, slack, pace, square_pace, least, max(guess, least))
    return start_s + wait + approach + stream.hold_s[j] + carry + paces.release_s


def decided_late(belt: Belt, stream: Stream) -> Stream:
    """The same stream with decisions put off while the machine would only wait for the thing anyway."""
    widest = np.abs(belt.places).max(axis=0).sum() + np.abs(stream.across_m) + np.abs(stream.first_m) + stream.slack_m
    slowest_s = np.maximum(belt.paces.pace * widest, np.sqrt(belt.paces.square_pace * widest))
    enters_s = stream.passing_s + stream.first_m / belt.paces.speed_m_s
    return stream._replace(known_s=np.maximum(stream.known_s, enters_s - np.maximum(slowest_s, stream.least_s)))


@compiled
def best_picks(belt: Belt, stream: Stream, most: int) -> tuple[float, Array, NDArray[np.int64], bool]:
    """Look at schedules until nothing is left to look at.

    Args:
        belt: the machine.
        stream: the things.
        most: labels to look at before giving up, or an eighth of those to keep in mind.

    Returns:
        The largest sum of gains; the earliest time (n + 1,) at which 0 ... n things can lie in their bins, where all
        gains are equal; the things of the best schedule in order, (picks,); whether all of that is proven.
    """
    n = len(stream.gain)
    earliest = np.full(n + 1, np.inf)
    earliest[0] = 0.0
    deadline = np.empty(n)
    for j in range(n):
        deadline[j] = stream.passing_s[j] + stream.last_m[j] / belt.paces.speed_m_s
    # Who may be anywhere is nowhere later than those who stand somewhere.
    between = np.zeros((len(belt.places) + 1, len(belt.places) + 1))
    between[: len(belt.places), len(belt.places)] = np.inf
    for a in range(len(belt.places)):
        for b in range(len(belt.places)):
            along, across = belt.places[a, 0] - belt.places[b, 0], belt.places[a, 1] - belt.places[b, 1]
            between[a, b] = way_s(along, across * across, 0.0, belt.paces.pace, belt.paces.square_pace, 0.0)
    # Settled labels: when, where, from which thing on, which of those picked, worth, picks.
    time = np.empty(most)
    place = np.empty(most, np.int64)
    base = np.empty(most, np.int64)
    picked = np.empty(most, np.uint64)
    worth = np.empty(most)
    before, thing = np.empty(most, np.int64), np.empty(most, np.int64)
    one, bins = np.uint64(1), len(belt.places) - 1
    queue = [(0.0, 0.0, bins, 0, np.uint64(0), 0, -1, -1)]
    settled, best, best_label, proven = 0, 0.0, -1, True
    while len(queue) > 0:
        now, loss, here, low, done, picks, parent, last = heapq.heappop(queue)
        while low < n and deadline[low] < now:
            low += 1
            done >>= one
        value = -loss
        dominated = False
        for k in range(settled - 1, max(settled - _RECENT, 0) - 1, -1):
            if worth[k] < value - 1e-9 or time[k] + between[place[k], here] > now + 1e-12:
                continue
            shift = low - base[k]
            other = picked[k] >> np.uint64(shift) if shift < 64 else np.uint64(0)
            if other & ~done == 0:
                dominated = True
                break
        if dominated:
            continue
        if settled == most or len(queue) > 8 * most:
            proven = False
            break
        time[settled], place[settled], base[settled] = now, here, low
        picked[settled], worth[settled], before[settled], thing[settled] = done, value, parent, last
        if value > best:
            best, best_label = value, settled
        earliest[picks] = min(earliest[picks], now)
        for j in range(low, min(n, low + MEMORY)):
            bit = one << np.uint64(j - low)
            if done & bit:
                continue
            then = finish_s(belt, stream, j, here, now)
            if then < np.inf:
                to, lost = int(stream.bin[j]), -(value + stream.gain[j])
                heapq.heappush(queue, (then, lost, to, low, done | bit, picks + 1, settled, j))
        for j in range(low + MEMORY, n):
            # What cannot be told apart was not tried: that is fine only while it need not be decided yet.
            proven = proven and stream.known_s[j] > now
        settled += 1
    order = np.empty(n, np.int64)
    length = 0
    while best_label >= 0 and thing[best_label] >= 0:
        order[length] = thing[best_label]
        length += 1
        best_label = before[best_label]
    return best, earliest, order[:length][::-1].copy(), proven


@compiled
def expand(belt: Belt, stream: Stream, tick_s: float) -> tuple[Numbers, Indices, Indices, Numbers, Array, int]:
    """The same as a time-expanded graph, times rounded down; see ``timeline.Timeline``. Options are the things."""
    n, places = len(stream.gain), len(belt.places) + 1
    last = 0.0
    for j in range(n):
        last = max(last, stream.passing_s[j] + stream.last_m[j] / belt.paces.speed_m_s)
    ticks = int(last / tick_s) + 2
    nodes, bins = ticks * places, len(belt.places) - 1
    first, wait, end_s = np.zeros(nodes + 1, np.int64), np.empty(nodes, np.int64), np.empty(nodes)
    room = 0
    for j in range(n):
        deadline = stream.passing_s[j] + stream.last_m[j] / belt.paces.speed_m_s
        room += places * (int((deadline - max(stream.known_s[j], 0.0)) / tick_s) + 3)
    to, option = np.empty(room, np.int32), np.empty(room, np.int32)
    edges = 0
    for node in range(nodes):
        # From the last tick to the first, so every edge leads to a smaller number.
        tick, place = ticks - 1 - node // places, node % places
        first[node], end_s[node] = edges, tick * tick_s
        wait[node] = node - places if tick < ticks - 1 else node
        for j in range(n):
            # Who decides too early only waits.
            if stream.known_s[j] >= (tick + 1) * tick_s:
                continue
            then = finish_s(belt, stream, j, place, tick * tick_s)
            if then < np.inf:
                arrives = min(max(int(then / tick_s), tick + 1), ticks - 1)
                if arrives > tick:
                    to[edges], option[edges] = (ticks - 1 - arrives) * places + stream.bin[j], j
                    edges += 1
    first[nodes] = edges
    return first, to[:edges].copy(), option[:edges].copy(), wait, end_s, (ticks - 1) * places + bins
