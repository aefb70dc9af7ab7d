"""A schedule that knows everything, carried out by the weeding rules themselves: how near a bound can be reached.

Sequences of shots are grown in the order of time, the most valuable of each moment kept (beam search in buckets). What
a shot brings is what the bound's own options say; then the rules carry the best sequence out and say what it is worth.
"""

from __future__ import annotations

import copy
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.weeding.core import WeederOutcome
from ..envs.weeding.ridges import lift_time
from ..envs.weeding.state import MODES, T
from ..envs.weeding.timing import A, G, Place, approach, move_time, ready
from ..kernels import compiled
from .shots import Shots

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

WIDTH = 40
"""Sequences that are kept in each bucket of time."""
BUCKET_S = 0.05
AHEAD_S = 16.0
"""Options that take longer are left out."""
EARLY_S = 2.0
"""So long before the window reaches a target it is looked at."""


class Garden(NamedTuple):
    """What a search works on; J options, T tracks, C shares.

    Attributes:
        arm: numbers of the tool's arm.
        place: (3,), where the arm stands in the beginning.
        cart_m: the same of the cart.
        speed_m_s: of the cart.
        front_m: the window begins this far before the machine's middle and ends as far behind it.
        moment_s: what waiting takes.
        until_s: nothing happens after this.
        track: (J,), ascending along the row.
        told_m: (J, 2), as in ``Shots``; ``aim_m`` alike.
        aim_m: (J, 2).
        stand_s: (J,).
        value: (J,), what an option brings beside its shares, less its cost.
        share_first: (J + 1,).
        share_thing: (C,).
        share: (C,).
        gain: (things,), of each thing, once.
        whole: (things,), whether shares gain nothing until they add up to 1.
        energy_j: (J,).
        budget_j: that all of them may take.
    """

    arm: Any
    place: Array
    cart_m: float
    speed_m_s: float
    front_m: float
    moment_s: float
    until_s: float
    track: Numbers
    told_m: Array
    aim_m: Array
    stand_s: Array
    value: Array
    share_first: Numbers
    share_thing: Numbers
    share: Array
    gain: Array
    whole: NDArray[np.bool_]
    energy_j: Array
    budget_j: float


class Pending(NamedTuple):
    """Sequences that end in buckets to come, the best W of each of N buckets, which are filled in turn.

    Attributes:
        filled: (N,), how many there are.
        time: (N, W), when they end.
        worth: (N, W), what they have brought.
        joules: (N, W), what they have taken.
        place: (N, W, 3), where the arm stands then.
        parent: (N, W), sequence without the last option.
        option: (N, W), the last one, -1 for a moment's wait.
    """

    filled: Numbers
    time: Array
    worth: Array
    joules: Array
    place: Array
    parent: Numbers
    option: Numbers


@compiled
def put(
    pending: Pending, bucket: int, time_s: float, worth: float, joules: float, place: Place, parent: int, option: int
) -> None:
    """Keep a sequence in its bucket where it is among the best; of two alike the sooner one."""
    row = bucket % len(pending.filled)
    count, width = pending.filled[row], pending.time.shape[1]
    slot = count
    for i in range(count):
        if pending.option[row, i] == option and abs(pending.worth[row, i] - worth) < 1e-9:
            if pending.time[row, i] <= time_s:
                return
            slot = i
            break
    if slot == width:
        slot = 0
        for i in range(1, width):
            if pending.worth[row, i] < pending.worth[row, slot]:
                slot = i
        if pending.worth[row, slot] >= worth:
            return
    elif slot == count:
        pending.filled[row] += 1
    pending.time[row, slot], pending.worth[row, slot], pending.joules[row, slot] = time_s, worth, joules
    pending.place[row, slot, A.carrier], pending.place[row, slot, A.lean] = place.carrier_m, place.lean_m
    pending.place[row, slot, A.across] = place.across_m
    pending.parent[row, slot], pending.option[row, slot] = parent, option


@compiled
def grown(garden: Garden, width: int, bucket_s: float) -> tuple[Numbers, float]:
    """Options of the best sequence found, in order, and what it is worth by the options' own account."""
    options, v, front = len(garden.track), garden.speed_m_s, garden.front_m
    things, buckets, ring = len(garden.gain), int(garden.until_s / bucket_s) + 2, int(AHEAD_S / bucket_s)
    pending = Pending(
        np.zeros(ring, np.int64),
        np.empty((ring, width)),
        np.empty((ring, width)),
        np.empty((ring, width)),
        np.empty((ring, width, 3)),
        np.empty((ring, width), np.int64),
        np.empty((ring, width), np.int64),
    )
    room = buckets * width + 1
    time, parent, option = np.empty(room), np.empty(room, np.int64), np.empty(room, np.int64)
    count, best, best_worth = 0, -1, -np.inf
    served, done = np.zeros(things), np.zeros(garden.track.max() + 1, np.bool_)
    # What was done to a thing longer ago than this cannot be added to.
    past_s = 2.0 * (2.0 * front + 0.1) / v
    put(pending, 0, 0.0, 0.0, 0.0, Place(garden.place[A.carrier], garden.place[A.lean], garden.place[A.across]), -1, -1)
    for bucket in range(buckets):
        row = bucket % ring
        for i in range(pending.filled[row]):
            now, worth, joules, label = pending.time[row, i], pending.worth[row, i], pending.joules[row, i], count
            time[label], parent[label], option[label] = now, pending.parent[row, i], pending.option[row, i]
            count += 1
            if worth > best_worth:
                best, best_worth = label, worth
            cart, x, y = garden.cart_m + v * now, pending.place[row, i, A.carrier], pending.place[row, i, A.lean]
            here = Place(x, y, pending.place[row, i, A.across])
            reckon(garden, label, now - past_s, time, parent, option, done, served, True)
            low = 0
            high = options
            while low < high:
                middle = (low + high) // 2
                if garden.told_m[middle, G.along] < cart - front:
                    low = middle + 1
                else:
                    high = middle
            for o in range(low, options):
                along, across = garden.told_m[o, G.along], garden.told_m[o, G.across]
                if along > cart + front + v * EARLY_S:
                    break
                if done[garden.track[o]] or joules + garden.energy_j[o] > garden.budget_j:
                    continue
                way = approach(garden.arm, garden.stand_s[o], here, cart, v, along, across)
                then = now + way.move_s + way.wait_s + garden.stand_s[o]
                if not way.legal or then >= garden.until_s or then - now >= AHEAD_S - 2.0 * bucket_s:
                    continue
                more = garden.value[o]
                for s in range(garden.share_first[o], garden.share_first[o + 1]):
                    thing, share = garden.share_thing[s], garden.share[s]
                    had, has = min(served[thing], 1.0), min(served[thing] + share, 1.0)
                    if garden.whole[thing]:
                        more += garden.gain[thing] if has >= 1.0 - 1e-9 and had < 1.0 - 1e-9 else 0.0
                    else:
                        more += garden.gain[thing] * (has - had)
                place = Place(
                    way.carrier_m + garden.aim_m[o, G.along] - along,
                    way.lean_m,
                    way.across_m + garden.aim_m[o, G.across] - across,
                )
                spent = joules + garden.energy_j[o]
                put(pending, max(int(then / bucket_s), bucket + 1), then, worth + more, spent, place, label, o)
            rest = ready(garden.arm, garden.cart_m + v * (now + garden.moment_s))
            carrier, lean = rest.carrier_m - here.carrier_m, rest.lean_m - here.lean_m
            move_s = move_time(garden.arm, carrier, lean, rest.across_m - here.across_m)
            move_s = max(move_s, lift_time(garden.arm, here.across_m, rest.across_m))
            then = now + max(garden.moment_s, move_s)
            if then < garden.until_s:
                put(pending, max(int(then / bucket_s), bucket + 1), then, worth, joules, rest, label, -1)
            reckon(garden, label, now - past_s, time, parent, option, done, served, False)
        pending.filled[row] = 0
    order, n, label = np.empty(count, np.int64), 0, best
    while label > 0:
        order[n] = option[label]
        n += 1
        label = parent[label]
    return order[:n][::-1].copy(), best_worth


@compiled
def reckon(
    garden: Garden,
    label: int,
    since_s: float,
    time: Array,
    parent: Numbers,
    option: Numbers,
    done: NDArray[np.bool_],
    served: Array,
    mark: bool,
) -> None:
    """Write which tracks a sequence has served since a time, and which shares of things; or take it back."""
    while label >= 0 and time[label] > since_s:
        o = option[label]
        if o >= 0:
            done[garden.track[o]] = mark
            for s in range(garden.share_first[o], garden.share_first[o + 1]):
                served[garden.share_thing[s]] = served[garden.share_thing[s]] + garden.share[s] if mark else 0.0
        label = parent[label]


def tended(core: Any, shots: Shots, order: Numbers) -> tuple[float, float]:
    """What the weeds killed count, and the return, of options carried out one after the other, -1 a moment's wait.

    Args:
        core: the rules of one world right after a reset; they stay as they are.
        shots: has the options.
        order: of the options.
    """
    core = copy.deepcopy(core)
    state, base = core.state, core.base_actions
    total, over, rest = 0.0, False, order.tolist()[::-1]
    while not over:
        action, mask = base - 1, core.observe()["action_mask"][0]
        while rest:
            option = rest.pop()
            slots = np.flatnonzero(state.slot_track[0] == shots.track[option]) if option >= 0 else [core.config.slots]
            if option < 0:
                break
            if len(slots) and mask[int(slots[0]) * MODES + int(shots.mode[option])]:
                action = int(slots[0]) * MODES + int(shots.mode[option])
                break
        plan = core.plan(np.array([action]))
        result = core.apply(plan, WeederOutcome(plan.phases_s, plan.aim))
        total += float(result.rewards.sum())
        over = bool(result.terminated[0] or result.truncated[0])
    return float(core.state.totals[0, T.worth]), total
