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

WIDTH = 24
"""Sequences that are kept in each bucket of time."""
BUCKET_S = 0.1
ROOM = 400_000
"""Sequences that a search may hold at all."""


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


@compiled
def grown(garden: Garden, width: int, bucket_s: float, room: int) -> tuple[Numbers, float]:
    """Options of the best sequence found, in order, and what it is worth by the options' own account."""
    options, v, front = len(garden.track), garden.speed_m_s, garden.front_m
    things, buckets = len(garden.gain), int(garden.until_s / bucket_s) + 2
    time, worth, joules = np.empty(room), np.empty(room), np.empty(room)
    place, parent, option = np.empty((room, 3)), np.empty(room, np.int64), np.empty(room, np.int64)
    # Labels of a bucket hang on a chain.
    head, after = np.full(buckets, -1), np.empty(room, np.int64)
    time[0], worth[0], joules[0], parent[0], option[0], after[0] = 0.0, 0.0, 0.0, -1, -1, -1
    for axis in range(3):
        place[0, axis] = garden.place[axis]
    head[0], count, best = 0, 1, 0
    served, done = np.zeros(things), np.zeros(options + 1, np.bool_)
    own, values = np.empty(room, np.int64), np.empty(room)
    # What was done to a thing longer ago than this cannot be added to.
    past_s = 2.0 * (2.0 * front + 0.1) / v
    for bucket in range(buckets):
        n, label = 0, head[bucket]
        while label >= 0:
            own[n], values[n] = label, -worth[label]
            n += 1
            label = after[label]
        kept, last_worth, last_option = 0, np.inf, -2
        for i in np.argsort(values[:n]):
            label = own[i]
            if kept == width:
                break
            if worth[label] == last_worth and option[label] == last_option:
                continue
            kept, last_worth, last_option = kept + 1, worth[label], option[label]
            now = time[label]
            cart = garden.cart_m + v * now
            here = Place(place[label, A.carrier], place[label, A.lean], place[label, A.across])
            # What the sequence has done.
            back = label
            while back >= 0 and time[back] > now - past_s:
                o = option[back]
                if o >= 0:
                    done[garden.track[o]] = True
                    for s in range(garden.share_first[o], garden.share_first[o + 1]):
                        served[garden.share_thing[s]] += garden.share[s]
                back = parent[back]
            low = np.searchsorted(garden.told_m[:, G.along], cart - front)
            for o in range(low, options):
                along, across = garden.told_m[o, G.along], garden.told_m[o, G.across]
                if along > cart + front + 0.6 * v:
                    break
                if done[garden.track[o]] or joules[label] + garden.energy_j[o] > garden.budget_j or count == room:
                    continue
                way = approach(garden.arm, garden.stand_s[o], here, cart, v, along, across)
                then = now + way.move_s + way.wait_s + garden.stand_s[o]
                if not way.legal or then >= garden.until_s:
                    continue
                more = garden.value[o]
                for s in range(garden.share_first[o], garden.share_first[o + 1]):
                    thing, share = garden.share_thing[s], garden.share[s]
                    had, has = min(served[thing], 1.0), min(served[thing] + share, 1.0)
                    if garden.whole[thing]:
                        more += garden.gain[thing] if has >= 1.0 - 1e-9 and had < 1.0 - 1e-9 else 0.0
                    else:
                        more += garden.gain[thing] * (has - had)
                time[count], worth[count], parent[count], option[count] = then, worth[label] + more, label, o
                joules[count] = joules[label] + garden.energy_j[o]
                place[count, A.carrier] = way.carrier_m + garden.aim_m[o, G.along] - along
                place[count, A.lean] = way.lean_m
                place[count, A.across] = way.across_m + garden.aim_m[o, G.across] - across
                to = max(int(then / bucket_s), bucket)
                if to == bucket:
                    to += 1
                after[count], head[to] = head[to], count
                if worth[count] > worth[best]:
                    best = count
                count += 1
            rest = ready(garden.arm, garden.cart_m + v * (now + garden.moment_s))
            move_s = move_time(
                garden.arm,
                rest.carrier_m - here.carrier_m,
                rest.lean_m - here.lean_m,
                rest.across_m - here.across_m,
            )
            move_s = max(move_s, lift_time(garden.arm, here.across_m, rest.across_m))
            then = now + max(garden.moment_s, move_s)
            if then < garden.until_s and count < room:
                time[count], worth[count], parent[count], option[count] = then, worth[label], label, -1
                joules[count] = joules[label]
                place[count, A.carrier], place[count, A.lean], place[count, A.across] = (
                    rest.carrier_m,
                    rest.lean_m,
                    rest.across_m,
                )
                to = max(int(then / bucket_s), bucket + 1)
                after[count], head[to] = head[to], count
                count += 1
            back = label
            while back >= 0 and time[back] > now - past_s:
                o = option[back]
                if o >= 0:
                    done[garden.track[o]] = False
                    for s in range(garden.share_first[o], garden.share_first[o + 1]):
                        served[garden.share_thing[s]] = 0.0
                back = parent[back]
    order, n, label = np.empty(count, np.int64), 0, best
    while label > 0:
        order[n] = option[label]
        n += 1
        label = parent[label]
    return order[:n][::-1].copy(), worth[best]


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
