"""Ordered trays whose luck is known, as a machine of few moves; what the rules say of a sequence of them.

From a waiting row every plug is planted that fits, the quickest transplant next, each at the fastest speed at which it
arrives whole; plugs that come to harm at any speed stay where they are.
"""

from __future__ import annotations

import copy
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.transplanting.columns import NEXT_SOURCE, NEXT_TARGET, TURN_SOURCES, TURN_TARGETS, E, T, W
from ..envs.transplanting.config import EMPTY, HEALTHY, POOR
from ..envs.transplanting.core import TransplantingCore
from ..envs.transplanting.timing import CLEARING, STRAIGHT, Times, above, handling_s
from ..kernels import compiled
from .transplanting import USELESS

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

PLANT = 0
"""A move that plants all that fits; the others are actions counted from the end."""
NONE = -1
TRAY, ORDER, PLACE, IDLE, TURNED, FIRST = range(6)
"""Columns of a state: the trays that are presented, the tool's place, whether the supply has moved since something was
planted, turns since then; behind them the row at which each source tray stands, the good plugs of that row, as bits,
and likewise the row of each order and its open cells."""
_SHUT = -1


class Nursery(NamedTuple):
    """What a search works on: source trays of r rows and n columns, orders of q rows and m columns.

    Attributes:
        times: how long everything takes.
        park: where the tool stands in the beginning.
        rows: (2,), rows of a tray, see ``Ends``.
        speed: (source rows, n), fastest speed at which a plug arrives whole, ``USELESS`` where none does.
        content: (source rows, n), what the plug is.
        lost: (source rows,), seedlings of a row that nobody can use.
        way: (target rows, m), to a cell, see ``timing``; < 0 where nothing can be planted.
        grade: (orders,), content that an order's cells are to hold.
        due_s: (orders,), when its lorry leaves.
        leaves: (orders,), in the sequence in which they leave.
        gain: worth of a cell.
        waste: cost of a seedling that is wasted.
        second: cost of a second.
        each_s: a transplant on average.
        limit_s: when the episode is cut off.
    """

    times: Times
    park: int
    rows: Numbers
    speed: Numbers
    content: Numbers
    lost: Numbers
    way: Numbers
    grade: Numbers
    due_s: Array
    leaves: Numbers
    gain: float
    waste: float
    second: float
    each_s: float
    limit_s: float


def nursery_of(core: TransplantingCore, row: int, speed: Numbers, lacks: NDArray[np.bool_]) -> Nursery:
    """What stands in a world of the rules right after its reset, its luck known.

    Args:
        core: the rules.
        row: the world.
        speed: (source rows, n), fastest speed at which a plug that can be tried arrives whole, else ``USELESS``.
        lacks: (target rows, m), which cells can be served.
    """
    state, times, weights = core.state, core.times, core.config.weights
    content = state.source_cells[row, :-1].astype(np.int64)
    sold = (content == HEALTHY) | (content == POOR)
    way = np.where(state.target_reports[row, :-1] == EMPTY, STRAIGHT, CLEARING)
    n, m = core.source_shape[1], core.target_shape[1]
    back_s = times.approach[STRAIGHT, n : n + m, :, W.s].mean()
    return Nursery(
        times=times,
        park=core.places.park,
        rows=np.array([core.source_trays[1], core.target_trays[1]]),
        speed=speed,
        content=content,
        lost=np.count_nonzero(sold & (speed == USELESS), axis=1),
        way=np.where(lacks, way, _SHUT),
        grade=state.grade[row].astype(np.int64),
        due_s=state.due_s[row].copy(),
        leaves=np.argsort(state.due_s[row], kind="stable"),
        gain=float(weights.planted),
        waste=-float(weights.spoiled),
        second=-float(weights.seconds),
        each_s=float(times.carry[..., W.s].mean() + back_s + times.handle_s),
        limit_s=float(core.config.scenario.time_limit_s),
    )


def carried_out(core: TransplantingCore, actions: Numbers) -> tuple[float, float]:
    """Net rate and return of actions, behind which every tray is sent away.

    Args:
        core: the rules of one world; they stay as they are.
        actions: in order.
    """
    core, total, over, step = copy.deepcopy(core), 0.0, False, 0
    while not over:
        action = int(actions[step]) if step < len(actions) else core.action_space.n + NEXT_TARGET
        plan = core.plan(np.array([action]))
        result = core.apply(plan, core.nominal(plan))
        total, over = total + float(result.rewards.sum()), bool(result.terminated[0] or result.truncated[0])
        step += 1
    totals = core.state.totals[0]
    return float(totals[T.healthy] / totals[T.cells]), total


def acted(nursery: Nursery, moves: Numbers, actions: int) -> Numbers:
    """The actions of moves, ``actions`` being the number that there is."""
    state, now_s, pairs, found = start(nursery), 0.0, np.empty(nursery.speed.shape[1], np.int64), []
    for move in moves.tolist():
        now_s, _, count = moved(nursery, state, now_s, move, pairs)
        found += pairs[:count].tolist() if move == PLANT else [actions + move]
    return np.array(found, np.int64)


@compiled
def start(nursery: Nursery) -> Numbers:
    """The first state."""
    trays, orders = len(nursery.speed) // nursery.rows[E.source], len(nursery.grade)
    state = np.zeros(FIRST + 2 * (trays + orders), np.int64)
    state[PLACE] = nursery.park
    for tray in range(trays):
        state[FIRST + trays + tray] = bits_of(nursery.speed[tray * nursery.rows[E.source]])
    for order in range(orders):
        state[FIRST + 2 * trays + orders + order] = bits_of(nursery.way[order * nursery.rows[E.target]])
    return state


@compiled
def bits_of(row: Numbers) -> int:
    """Bits of the numbers of a row that are not negative."""
    bits = 0
    for i in range(len(row)):
        if row[i] >= 0:
            bits |= 1 << i
    return bits


@compiled
def count_of(bits: Any) -> int:
    """How many bits are set."""
    count = 0
    while bits:
        bits &= bits - 1
        count += 1
    return count


@compiled
def is_open(nursery: Nursery, state: Numbers, now_s: float, order: int) -> bool:
    """Whether an order can be served."""
    trays = len(nursery.speed) // nursery.rows[E.source]
    return state[FIRST + 2 * trays + order] < nursery.rows[E.target] and now_s < nursery.due_s[order]


@compiled
def all_gone(nursery: Nursery, state: Numbers, now_s: float) -> bool:
    """Whether no order can be served any more."""
    for order in range(len(nursery.grade)):
        if is_open(nursery, state, now_s, order):
            return False
    return True


@compiled
def moved(nursery: Nursery, state: Numbers, now_s: float, move: int, pairs: Numbers) -> tuple[float, float, int]:
    """Change a state by a move; gives when that is done, what it brings, and how many pairs are planted.

    The last is < 0 where there is no such move, or none that is not as good in another sequence: both sides may move in
    either, so orders do before the supply. ``pairs`` takes the actions of the pairs.
    """
    times, trays, orders = nursery.times, len(nursery.speed) // nursery.rows[E.source], len(nursery.grade)
    tray, order, place, began_s = state[TRAY], state[ORDER], state[PLACE], now_s
    source, target = FIRST + tray, FIRST + 2 * trays + order
    row, target_row = tray * nursery.rows[E.source] + state[source], order * nursery.rows[E.target] + state[target]
    if move == PLANT:
        count = 0
        if is_open(nursery, state, now_s, order):
            count, now_s = plant(nursery, state, now_s, row, target_row, pairs)
        state[IDLE], state[TURNED] = 0, 0
        return now_s, nursery.gain * count - nursery.second * (now_s - began_s), count if count else NONE
    now_s += times.rise[place, W.s]
    state[PLACE], wasted = above(times, place), 0
    if move == NEXT_SOURCE:
        if state[source] + 1 == nursery.rows[E.source]:
            return now_s, 0.0, NONE
        wasted = nursery.lost[row] + count_of(state[source + trays])
        now_s += times.row_s[E.source, row]
        state[source] += 1
        state[source + trays] = bits_of(nursery.speed[row + 1])
        state[IDLE], state[TURNED] = 1, 0
    elif move == TURN_SOURCES:
        turned = state[TURNED] + 1 if state[IDLE] else 1
        if turned >= trays:
            return now_s, 0.0, NONE
        now_s += times.turn_s[E.source]
        state[TRAY] = (tray + 1) % trays
        state[IDLE], state[TURNED] = 1, turned
    else:
        step, here = 0, is_open(nursery, state, began_s, order)
        for on in range(orders - 1, 0, -1):
            if is_open(nursery, state, began_s, (order + on) % orders):
                step = on
        if state[IDLE] or (move == TURN_TARGETS and (step == 0 or state[TURNED] + 1 >= orders)):
            return now_s, 0.0, NONE
        if move == NEXT_TARGET and not here:
            return now_s, 0.0, NONE
        if move == NEXT_TARGET and state[target] + 1 < nursery.rows[E.target]:
            now_s += times.row_s[E.target, target_row]
            state[target] += 1
            state[target + orders] = bits_of(nursery.way[target_row + 1])
            state[TURNED] = 0
        else:
            now_s += max(step, 1) * times.turn_s[E.target]
            if move == NEXT_TARGET:
                state[target] = nursery.rows[E.target]
            state[ORDER] = (order + step) % orders
            state[TURNED] += 1
    return float(now_s), float(-nursery.waste * wasted - nursery.second * (now_s - began_s)), 0


@compiled
def plant(
    nursery: Nursery, state: Numbers, now_s: float, row: int, target_row: int, pairs: Numbers
) -> tuple[int, float]:
    """Plant what fits of two rows until the lorry leaves, the quickest next; gives how many, and when that is done."""
    times, order, orders, m = nursery.times, state[ORDER], len(nursery.grade), nursery.way.shape[1]
    trays = len(nursery.speed) // nursery.rows[E.source]
    plugs, cells = FIRST + trays + state[TRAY], FIRST + 2 * trays + orders + order
    count, place, least_s = 0, state[PLACE], 0.0
    while now_s < nursery.limit_s:
        least_s, best, speed = np.inf, NONE, 0
        for i in range(nursery.speed.shape[1]):
            if not state[plugs] >> i & 1 or nursery.content[row, i] != nursery.grade[order]:
                continue
            for j in range(m):
                if not state[cells] >> j & 1:
                    continue
                pair, way = i * m + j, nursery.way[target_row, j]
                seconds = times.approach[way, place, pair, W.s] + times.carry[nursery.speed[row, i], pair, W.s]
                seconds += handling_s(times, way == CLEARING, True)
                if seconds < least_s:
                    least_s, best, speed = seconds, pair, nursery.speed[row, i]
        if best < 0 or now_s + least_s > nursery.due_s[order]:
            break
        pairs[count] = best * len(times.carry) + speed
        count, now_s, place = count + 1, now_s + least_s, nursery.speed.shape[1] + best % m
        state[plugs] &= ~(1 << (best // m))
        state[cells] &= ~(1 << (best % m))
    state[PLACE] = place
    return count, now_s
