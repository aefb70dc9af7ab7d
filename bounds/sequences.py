"""Sequences of shots that a search has grown, the best of each bucket; and how the rules carry one out."""

from __future__ import annotations

import copy
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.weeding.core import WeederOutcome
from ..envs.weeding.state import MODES, T
from ..envs.weeding.timing import A, G, Place
from ..kernels import compiled
from .shots import Shots

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]


class Grown(NamedTuple):
    """One sequence.

    Attributes:
        time_s: when it ends.
        cart_m: where the cart is then.
        speed_m_s: how fast it is.
        worth: what it has brought.
        rank: which are kept.
        joules: what it has taken.
        place: where the arm stands then.
        parent: sequence without the last option.
        option: the last one, -1 for a moment's wait.
        block: 0 where it held the speed, 1 where it slowed down, 2 where it sped up.
        target: worked on last, -1 for none.
        known: what that remembers.
    """

    time_s: float
    cart_m: float
    speed_m_s: float
    worth: float
    rank: float
    joules: float
    place: Place
    parent: int
    option: int
    block: int
    target: int
    known: int


class Pending(NamedTuple):
    """Sequences that end in buckets to come, the best W of each of N buckets, which are filled in turn.

    Attributes:
        filled: (N,), how many there are.
        time: (N, W), see ``Grown``, like what follows.
        cart: (N, W).
        speed: (N, W).
        worth: (N, W).
        rank: (N, W).
        joules: (N, W).
        place: (N, W, 3).
        parent: (N, W).
        option: (N, W).
        block: (N, W).
        target: (N, W).
        known: (N, W).
    """

    filled: Numbers
    time: Array
    cart: Array
    speed: Array
    worth: Array
    rank: Array
    joules: Array
    place: Array
    parent: Numbers
    option: Numbers
    block: Numbers
    target: Numbers
    known: Numbers


@compiled
def put(pending: Pending, bucket: int, grown: Grown) -> None:
    """Keep a sequence in its bucket where it is among the best; of two alike the better one, or the sooner."""
    row = bucket % len(pending.filled)
    count, width = pending.filled[row], pending.time.shape[1]
    slot = count
    for i in range(count):
        alike = pending.option[row, i] == grown.option and abs(pending.speed[row, i] - grown.speed_m_s) < 1e-9
        if alike and abs(pending.worth[row, i] - grown.worth) < 1e-9:
            better = grown.rank - pending.rank[row, i]
            if better < -1e-9 or (better < 1e-9 and pending.time[row, i] <= grown.time_s):
                return
            slot = i
            break
    if slot == width:
        slot = 0
        for i in range(1, width):
            if pending.rank[row, i] < pending.rank[row, slot]:
                slot = i
        if pending.rank[row, slot] >= grown.rank:
            return
    elif slot == count:
        pending.filled[row] += 1
    pending.time[row, slot], pending.cart[row, slot] = grown.time_s, grown.cart_m
    pending.speed[row, slot], pending.block[row, slot] = grown.speed_m_s, grown.block
    pending.worth[row, slot], pending.joules[row, slot] = grown.worth, grown.joules
    pending.rank[row, slot], place = grown.rank, grown.place
    pending.place[row, slot, A.carrier], pending.place[row, slot, A.lean] = place.carrier_m, place.lean_m
    pending.place[row, slot, A.across] = place.across_m
    pending.parent[row, slot], pending.option[row, slot] = grown.parent, grown.option
    pending.target[row, slot], pending.known[row, slot] = grown.target, grown.known


def tended(core: Any, shots: Shots, order: Numbers, blocks: Numbers) -> tuple[float, float]:
    """What the weeds killed count, and the return, of options carried out one after the other, -1 a moment's wait.

    Args:
        core: the rules of one world right after a reset; they stay as they are.
        shots: has the options.
        order: of the options.
        blocks: what each does to the speed; behind the last the cart speeds up.
    """
    core = copy.deepcopy(core)
    state, base = core.state, core.base_actions
    total, over, rest = 0.0, False, list(zip(order.tolist(), blocks.tolist(), strict=True))[::-1]
    while not over:
        action, mask = base - 1, core.observe()["action_mask"][0]
        block = 2 if core.config.speed_control and not rest else 0
        while rest:
            option, asked = rest[-1]
            slots = np.flatnonzero((state.slot_track[0] == shots.track[option]) & (option >= 0))
            can = len(slots) > 0 and bool(mask[int(slots[0]) * MODES + int(shots.mode[option])])
            # What the window has yet to reach is waited for; what it has reached and cannot be done is left out.
            if option >= 0 and not can and shots.told_m[option, G.along] > state.cart[0] + core.machine.front_m:
                break
            rest.pop()
            block = asked
            if can:
                action = int(slots[0]) * MODES + int(shots.mode[option])
            if can or option < 0:
                break
        plan = core.plan(np.array([block * base + action]))
        result = core.apply(plan, WeederOutcome(plan.phases_s, plan.aim))
        total += float(result.rewards.sum())
        over = bool(result.terminated[0] or result.truncated[0])
    return float(core.state.totals[0, T.worth]), total
