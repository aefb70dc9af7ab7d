"""Picks for orders by who knows every luck, carried out by the rules themselves: how near a bound is reached.

Sequences are grown pick by pick, the best of every bucket of time kept (beam search), with bins that are away while
they are swapped. They are ranked by what they have brought and by what the prices of the bound (see ``packing``) leave
to a machine at that place and time, to the things that were not tried and to the lines that are not full.
"""

from __future__ import annotations

import copy
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.sorting.columns import TOTAL
from ..kernels import compiled
from .belt import Belt, Stream, finish_s
from .packing import Lines

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

WIDTH, BUCKET_S = 100, 0.2
"""Sequences that are kept in each bucket of time."""
TRUSTS = 0.95, 0.8, 0.6
"""The guide knows of no swapped bins, so it promises too much; each is tried [chosen, like the numbers above, on seeds
1000000 to 1000004]."""
AHEAD_S = 6.0
"""What is known so much later than the next thing is not waited for."""
_NONE = -1


class Guide(NamedTuple):
    """What the bound's prices leave.

    Attributes:
        tick_s: of the graph.
        worth: (ticks, places), to a machine at a place from a tick on.
        thing: (n,), of each thing.
        line: (L,), of what each line lacks.
    """

    tick_s: float
    worth: Array
    thing: Array
    line: Array


class Bench(NamedTuple):
    """What a search works on.

    Attributes:
        belt: the machine.
        stream: things that come right into their bins, in the order of their deadlines.
        lines: what is ordered.
        surplus: share of a thing's gain that it brings where no line waits for it.
        holds: things in a bin.
        swap_s: until a full one has been swapped.
        guide: see there.
        trust: how much of what it promises is believed.
    """

    belt: Belt
    stream: Stream
    lines: Lines
    surplus: float
    holds: int
    swap_s: float
    guide: Guide
    trust: float


class Sequences(NamedTuple):
    """Sequences that end in B buckets, the best W of each.

    Attributes:
        filled: (B,), how many there are.
        time_s: (B, W), when the last thing lies in its bin.
        place: (B, W), over which bin the machine is.
        worth: (B, W), what it has brought.
        promise: (B, W), what the prices leave of things and lines.
        rank: (B, W), which are kept.
        parent: (B, W), bucket times W and slot of the sequence without the last thing, -1 for none.
        thing: (B, W), the last one, -1 for none.
        left: (B, W, L), what every line still lacks.
        items: (B, W, bins), what lies in each bin.
        ready_s: (B, W, bins), when an empty one stands there.
    """

    filled: Numbers
    time_s: Array
    place: Numbers
    worth: Array
    promise: Array
    rank: Array
    parent: Numbers
    thing: Numbers
    left: Numbers
    items: Numbers
    ready_s: Array


@compiled
def grown(bench: Bench, width: int, bucket_s: float) -> tuple[Numbers, float]:
    """The things (picks,) of the best sequence, in order, and what it is worth by its own account."""
    belt, stream, lines, guide = bench.belt, bench.stream, bench.lines, bench.guide
    n, several, bins = len(stream.gain), len(lines.wants), len(belt.places) - 1
    deadline, last_s = np.empty(n), 0.0
    for j in range(n):
        deadline[j] = stream.passing_s[j] + stream.last_m[j] / belt.paces.speed_m_s
        last_s = max(last_s, min(deadline[j], belt.limit_s))
    buckets = int(last_s / bucket_s) + 2
    kept = Sequences(
        np.zeros(buckets, np.int64),
        np.zeros((buckets, width)),
        np.full((buckets, width), bins),
        np.zeros((buckets, width)),
        np.zeros((buckets, width)),
        np.zeros((buckets, width)),
        np.full((buckets, width), _NONE),
        np.full((buckets, width), _NONE),
        np.zeros((buckets, width, several), np.int64),
        np.zeros((buckets, width, bins), np.int64),
        np.zeros((buckets, width, bins)),
    )
    kept.filled[0] = 1
    for line in range(several):
        kept.left[0, 0, line] = lines.wants[line]
    had, best, best_label = np.zeros(n, np.bool_), 0.0, 0
    for bucket in range(buckets):
        for slot in range(kept.filled[bucket]):
            label, now_s, worth = bucket * width + slot, kept.time_s[bucket, slot], kept.worth[bucket, slot]
            if worth > best:
                best, best_label = worth, label
            mark(kept, label, width, had, True)
            next_s = np.inf
            for j in range(n):
                if not had[j] and deadline[j] >= now_s:
                    next_s = min(next_s, max(stream.known_s[j], now_s))
            for j in range(n):
                if had[j] or deadline[j] < now_s or stream.known_s[j] > next_s + AHEAD_S:
                    continue
                then_s = finish_s(belt, stream, j, kept.place[bucket, slot], now_s)
                if then_s == np.inf:
                    continue
                grade = stream.bin[j]
                release_s = belt.paces.release_s
                then_s = max(then_s - release_s, kept.ready_s[bucket, slot, grade]) + release_s
                line, more = _NONE, bench.surplus * stream.gain[j]
                for k in range(several):
                    waits = kept.left[bucket, slot, k] > 0 and lines.due_s[k] >= then_s
                    if lines.grade[k] == grade and waits:
                        line, more = k, stream.gain[j]
                        break
                promise = kept.promise[bucket, slot] - guide.thing[j]
                if line >= 0:
                    promise -= guide.line[line]
                tick = min(int(then_s / guide.tick_s), len(guide.worth) - 1)
                rank = worth + more + bench.trust * (promise + guide.worth[tick, grade])
                put(
                    bench,
                    kept,
                    max(int(then_s / bucket_s), bucket + 1),
                    label,
                    j,
                    line,
                    then_s,
                    worth + more,
                    promise,
                    rank,
                )
            mark(kept, label, width, had, False)
    count, label = 0, best_label
    order = np.empty(n, np.int64)
    while kept.thing[label // width, label % width] >= 0:
        order[count] = kept.thing[label // width, label % width]
        count, label = count + 1, kept.parent[label // width, label % width]
    return order[:count][::-1].copy(), best


@compiled
def mark(kept: Sequences, label: int, width: int, had: NDArray[np.bool_], value: bool) -> None:
    """Write down whether the things of a sequence were had."""
    while kept.thing[label // width, label % width] >= 0:
        had[kept.thing[label // width, label % width]] = value
        label = kept.parent[label // width, label % width]


@compiled
def put(
    bench: Bench,
    kept: Sequences,
    bucket: int,
    parent: int,
    thing: int,
    line: int,
    time_s: float,
    worth: float,
    promise: float,
    rank: float,
) -> None:
    """Keep a sequence where it is among the best of its bucket; of two that look alike the better one."""
    if bucket >= len(kept.filled):
        return
    count, width = kept.filled[bucket], kept.time_s.shape[1]
    slot, lowest = count, 0
    for i in range(count):
        alike = kept.thing[bucket, i] == thing and abs(kept.worth[bucket, i] - worth) < 1e-9
        if alike and abs(kept.promise[bucket, i] - promise) < 1e-9:
            if kept.rank[bucket, i] > rank or (kept.rank[bucket, i] == rank and kept.time_s[bucket, i] <= time_s):
                return
            slot = i
            break
        if kept.rank[bucket, i] < kept.rank[bucket, lowest]:
            lowest = i
    if slot == width:
        slot = lowest
        if kept.rank[bucket, slot] >= rank:
            return
    elif slot == count:
        kept.filled[bucket] += 1
    before, at, grade = parent // width, parent % width, bench.stream.bin[thing]
    kept.time_s[bucket, slot], kept.place[bucket, slot] = time_s, grade
    kept.worth[bucket, slot], kept.promise[bucket, slot], kept.rank[bucket, slot] = worth, promise, rank
    kept.parent[bucket, slot], kept.thing[bucket, slot] = parent, thing
    for k in range(kept.left.shape[2]):
        kept.left[bucket, slot, k] = kept.left[before, at, k] - (k == line)
    for k in range(kept.items.shape[2]):
        items, ready_s = kept.items[before, at, k] + (k == grade), kept.ready_s[before, at, k]
        if items == bench.holds:
            items, ready_s = 0, time_s + bench.swap_s
        kept.items[bucket, slot, k], kept.ready_s[bucket, slot, k] = items, ready_s


def found(core: Any, reports: Numbers, bench: Bench) -> list[tuple[float, float]]:
    """What the best sequences got from the rules, see ``packed``; ``reports`` (n,) are those of the bench's things."""
    orders = [grown(bench._replace(trust=trust), WIDTH, BUCKET_S)[0] for trust in TRUSTS]
    return [packed(core, reports[order]) for order in orders]


def packed(core: Any, reports: Numbers) -> tuple[float, float]:
    """Things delivered, and the return, of picks at ``reports`` in this order; what cannot be had is left out.

    Args:
        core: the rules of one world right after a reset; they stay as they are.
        reports: (picks,), which are picked.
    """
    core, total, over, rest = copy.deepcopy(core), 0.0, False, reports.tolist()[::-1]
    state, wait = core.state, core.config.slots
    while not over:
        action, mask, now_s = wait, core.observe()["action_mask"][0], state.totals[0, TOTAL.time_s]
        while rest:
            slots = np.flatnonzero(state.slot_report[0] == rest[-1])
            if len(slots) and mask[slots[0]]:
                action = int(slots[0])
                rest.pop()
                break
            # What has not been seen yet, or finds no slot, is waited for; what has left is left out.
            if not len(slots) and state.leave_s[0, rest[-1]] > now_s:
                break
            rest.pop()
        plan = core.plan(np.array([action]))
        result = core.apply(plan, core.nominal(plan))
        total += float(result.rewards.sum())
        over = bool(result.terminated[0] or result.truncated[0])
    return float(state.totals[0, TOTAL.placed]), total
