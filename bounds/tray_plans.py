"""Plans of ordered trays that know everything: how near a bound is reached.

Plans are grown move by move (see ``nursery``), the best of every bucket of time kept (beam search), of those that have
come equally far in the supply only a few. They are ranked by what they have brought and by what is left to them: cells
that there are plugs and seconds for until the lorries leave, plugs, and what fits in the presented rows, each at a
price. Several prices are tried; what the rules say of the best plan of each is what can be had.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.transplanting.columns import NEXT_SOURCE, NEXT_TARGET, TURN_SOURCES, TURN_TARGETS, E
from ..envs.transplanting.config import HEALTHY, POOR
from ..envs.transplanting.core import TransplantingCore
from ..kernels import compiled
from .base import Found
from .nursery import (
    FIRST,
    IDLE,
    NONE,
    ORDER,
    PLANT,
    TRAY,
    TURNED,
    Nursery,
    acted,
    all_gone,
    bits_of,
    carried_out,
    count_of,
    is_open,
    moved,
    start,
)

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

BUCKET_S, MOST_BUCKETS = 0.5, 2000
WIDTH, ALIKE = 80, 8
"""Plans that are kept in a bucket, and those of them whose supply stands at the same rows [chosen on seeds 1000000 to
1000004, like the prices]."""


class Prices(NamedTuple):
    """What is left to a plan counts so much.

    Attributes:
        cell: a cell that can still be filled, in worths of one.
        plug: a good plug, likewise.
        fits: a plug that fits in the presented rows, likewise.
        slow: a transplant takes so much longer than on average, all moves included.
    """

    cell: float
    plug: float
    fits: float
    slow: float


PRICES = Prices(0.4, 0.1, 0.1, 1.4), Prices(0.6, 0.0, 0.1, 1.2), Prices(0.7, 0.0, 0.1, 1.4), Prices(0.6, 0.0, 0.1, 1.65)


class Plans(NamedTuple):
    """Plans that end in B buckets, the best W of each.

    Attributes:
        filled: (B,), how many there are.
        state: (B, W, .), see ``nursery``.
        time_s: (B, W), when it ends.
        worth: (B, W), what it has brought.
        rank: (B, W), which are kept.
        parent: (B, W), bucket times W and slot of the plan without the last move, -1 for none.
        move: (B, W), the last one.
    """

    filled: Numbers
    state: NDArray[np.int64]
    time_s: Array
    worth: Array
    rank: Array
    parent: Numbers
    move: Numbers


def found(core: TransplantingCore, nursery: Nursery) -> Found:
    """What the best plans got from the rules, which stay as they are.

    Args:
        core: the rules of one world, right after its reset.
        nursery: what stands there.
    """
    results = [carried_out(core, actions) for actions in planned(int(core.action_space.n), nursery)]
    return Found(max(net_rate for net_rate, _ in results), max(value for _, value in results))


def planned(actions: int, nursery: Nursery) -> Iterator[Numbers]:
    """Actions of several plans, ``actions`` being the number that there is: for the return, and for cells alone."""
    cells = nursery._replace(gain=1.0, waste=0.0, second=0.0)
    for aim, several in ((nursery, PRICES), (cells, PRICES[:2])):
        for prices in several:
            moves = grown(aim, prices, WIDTH, ALIKE)
            yield acted(aim, moves, actions)


@compiled
def grown(nursery: Nursery, prices: Prices, width: int, alike: int) -> Numbers:
    """Moves of the best plan that was found, up to its last that planted something or sent a tray away."""
    trays, first = len(nursery.speed) // nursery.rows[E.source], start(nursery)
    last_s = min(nursery.due_s.max(), nursery.limit_s)
    bucket_s = max(BUCKET_S, last_s / MOST_BUCKETS)
    buckets = int(last_s / bucket_s) + 2
    plans = Plans(
        np.zeros(buckets, np.int64),
        np.zeros((buckets, width, len(first)), np.int64),
        np.zeros((buckets, width)),
        np.zeros((buckets, width)),
        np.zeros((buckets, width)),
        np.full((buckets, width), NONE),
        np.zeros((buckets, width), np.int64),
    )
    behind, cells = plugs_behind(nursery), cells_behind(nursery)
    then, pairs = first.copy(), np.empty(nursery.speed.shape[1], np.int64)
    for column in range(len(first)):
        plans.state[0, 0, column] = first[column]
    plans.filled[0] = 1
    best, last, final = -np.inf, NONE, PLANT
    for bucket in range(buckets):
        for slot in range(plans.filled[bucket]):
            label = bucket * width + slot
            for move in (PLANT, NEXT_TARGET, TURN_TARGETS, NEXT_SOURCE, TURN_SOURCES):
                for column in range(len(first)):
                    then[column] = plans.state[bucket, slot, column]
                now_s, more, count = moved(nursery, then, plans.time_s[bucket, slot], move, pairs)
                if count < 0:
                    continue
                worth, at = plans.worth[bucket, slot] + more, max(int(now_s / bucket_s), bucket + 1)
                if now_s >= nursery.limit_s or all_gone(nursery, then, now_s):
                    if worth > best:
                        best, last, final = worth, label, move
                elif at < buckets:
                    rank = worth + left(nursery, prices, behind, cells, then, now_s)
                    put(plans, at, then, trays, alike, now_s, worth, rank, label, move)
    count, label = 0, last
    while label > 0:
        count, label = count + 1, plans.parent[label // width, label % width]
    moves, label = np.full(count + 1, final), last
    for i in range(count - 1, -1, -1):
        moves[i], label = plans.move[label // width, label % width], plans.parent[label // width, label % width]
    return moves


@compiled
def plugs_behind(nursery: Nursery) -> Numbers:
    """Good plugs (source rows, ``POOR`` + 1) of every content in the rows of its tray behind each row."""
    behind = np.zeros((len(nursery.speed), POOR + 1), np.int64)
    for row in range(len(behind) - 2, -1, -1):
        if (row + 1) % nursery.rows[E.source]:
            for content in range(POOR + 1):
                behind[row, content] = behind[row + 1, content]
            for i in range(nursery.speed.shape[1]):
                if nursery.speed[row + 1, i] >= 0:
                    behind[row, nursery.content[row + 1, i]] += 1
    return behind


@compiled
def cells_behind(nursery: Nursery) -> Numbers:
    """Cells (target rows,) that can be served in the rows of its tray behind each row."""
    behind = np.zeros(len(nursery.way), np.int64)
    for row in range(len(behind) - 2, -1, -1):
        if (row + 1) % nursery.rows[E.target]:
            behind[row] = behind[row + 1] + count_of(bits_of(nursery.way[row + 1]))
    return behind


@compiled
def left(nursery: Nursery, prices: Prices, plugs: Numbers, cells: Numbers, state: Numbers, now_s: float) -> float:
    """What is left to a plan at prices; ``plugs`` and ``cells`` are those behind each row."""
    per, orders, trays = nursery.rows[E.source], len(nursery.grade), len(nursery.speed) // nursery.rows[E.source]
    there, fills, done, fits = np.zeros(POOR + 1), np.zeros(POOR + 1), 0.0, 0.0
    wants = nursery.grade[state[ORDER]]
    for tray in range(trays):
        row, bits = tray * per + state[FIRST + tray], state[FIRST + trays + tray]
        for content in range(POOR + 1):
            there[content] += plugs[row, content]
        for i in range(nursery.speed.shape[1]):
            if bits >> i & 1:
                there[nursery.content[row, i]] += 1.0
                if tray == state[TRAY] and nursery.content[row, i] == wants:
                    fits += 1.0
    for order in nursery.leaves:
        if is_open(nursery, state, now_s, order):
            at = FIRST + 2 * trays + order
            row, waiting = order * nursery.rows[E.target] + state[at], count_of(state[at + orders])
            room = (nursery.due_s[order] - now_s) / (prices.slow * nursery.each_s) - done
            can = max(min(float(cells[row] + waiting), room), 0.0)
            done, fills[nursery.grade[order]] = done + can, fills[nursery.grade[order]] + can
            if order == state[ORDER]:
                fits = min(fits, float(waiting))
    if not is_open(nursery, state, now_s, state[ORDER]):
        fits = 0.0
    total = prices.fits * fits
    for content in (HEALTHY, POOR):
        total += prices.cell * min(there[content], fills[content]) + prices.plug * there[content]
    return float(nursery.gain * total)


@compiled
def put(
    plans: Plans,
    bucket: int,
    state: Numbers,
    trays: int,
    alike: int,
    now_s: float,
    worth: float,
    rank: float,
    parent: int,
    move: int,
) -> None:
    """Keep a plan in its bucket where it is among the best there, and among the best with its supply.

    Of two in the same state the better one is kept.
    """
    count, width = plans.filled[bucket], plans.time_s.shape[1]
    slot, lowest, near, weakest = count, 0, 0, 0
    for i in range(count):
        same, beside = True, True
        for column in range(FIRST + trays - 1, -1, -1):
            if plans.state[bucket, i, column] != state[column] and column != IDLE and column != TURNED:
                same, beside = False, beside and column < FIRST
        for column in range(FIRST + trays, len(state)):
            if not same:
                break
            same = plans.state[bucket, i, column] == state[column]
        if same:
            if plans.rank[bucket, i] >= rank:
                return
            slot = i
            break
        if beside:
            if near == 0 or plans.rank[bucket, i] < plans.rank[bucket, weakest]:
                weakest = i
            near += 1
        if plans.rank[bucket, i] < plans.rank[bucket, lowest]:
            lowest = i
    if slot == count and (near >= alike or count == width):
        slot = weakest if near >= alike else lowest
        if plans.rank[bucket, slot] >= rank:
            return
    elif slot == count:
        plans.filled[bucket] += 1
    for column in range(len(state)):
        plans.state[bucket, slot, column] = state[column]
    plans.time_s[bucket, slot], plans.worth[bucket, slot], plans.rank[bucket, slot] = now_s, worth, rank
    plans.parent[bucket, slot], plans.move[bucket, slot] = parent, move
