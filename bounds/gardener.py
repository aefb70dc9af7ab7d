"""A schedule that knows everything, carried out by the weeding rules themselves: how near a bound can be reached.

Sequences of shots are grown in the order of time, the most valuable of each moment kept (beam search in buckets). What
a shot brings is what the bound's own options say; where the bound also says what is left to win from a state on (see
``recall``), that is added at the bound's prices. Then the rules carry the best sequence out and say what it is worth.
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
from .recall import Guide, ahead, next_known
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
_WHOLE = 1.0 - 1e-9


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
        guide: what is left to win, if that is known.
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
    guide: Guide


class Grown(NamedTuple):
    """One sequence.

    Attributes:
        time_s: when it ends.
        worth: what it has brought.
        rank: which are kept.
        joules: what it has taken.
        place: where the arm stands then.
        parent: sequence without the last option.
        option: the last one, -1 for a moment's wait.
        target: worked on last, -1 for none.
        known: what that remembers.
    """

    time_s: float
    worth: float
    rank: float
    joules: float
    place: Place
    parent: int
    option: int
    target: int
    known: int


class Pending(NamedTuple):
    """Sequences that end in buckets to come, the best W of each of N buckets, which are filled in turn.

    Attributes:
        filled: (N,), how many there are.
        time: (N, W), see ``Grown``, like what follows.
        worth: (N, W).
        rank: (N, W).
        joules: (N, W).
        place: (N, W, 3).
        parent: (N, W).
        option: (N, W).
        target: (N, W).
        known: (N, W).
    """

    filled: Numbers
    time: Array
    worth: Array
    rank: Array
    joules: Array
    place: Array
    parent: Numbers
    option: Numbers
    target: Numbers
    known: Numbers


class Account(NamedTuple):
    """What one sequence has done lately.

    Attributes:
        done: (T,), tracks that were worked on.
        served: (things,), sum of shares.
        owed: (things,), what prices have paid for it.
        things: (things,), those with shares.
        begun: (1,), how many these are.
    """

    done: NDArray[np.bool_]
    served: Array
    owed: Array
    things: Numbers
    begun: Numbers


@compiled
def put(pending: Pending, bucket: int, grown: Grown) -> None:
    """Keep a sequence in its bucket where it is among the best; of two alike the better one, or the sooner."""
    row = bucket % len(pending.filled)
    count, width = pending.filled[row], pending.time.shape[1]
    slot = count
    for i in range(count):
        if pending.option[row, i] == grown.option and abs(pending.worth[row, i] - grown.worth) < 1e-9:
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
    pending.time[row, slot], pending.worth[row, slot], pending.joules[row, slot] = (
        grown.time_s,
        grown.worth,
        grown.joules,
    )
    pending.rank[row, slot], place = grown.rank, grown.place
    pending.place[row, slot, A.carrier], pending.place[row, slot, A.lean] = place.carrier_m, place.lean_m
    pending.place[row, slot, A.across] = place.across_m
    pending.parent[row, slot], pending.option[row, slot] = grown.parent, grown.option
    pending.target[row, slot], pending.known[row, slot] = grown.target, grown.known


@compiled
def grown(garden: Garden, width: int, bucket_s: float) -> tuple[Numbers, float]:
    """Options of the best sequence found, in order, and what it is worth by the options' own account."""
    options, v, front, guide = len(garden.track), garden.speed_m_s, garden.front_m, garden.guide
    things, buckets, ring = len(garden.gain), int(garden.until_s / bucket_s) + 2, int(AHEAD_S / bucket_s)
    guided = len(guide.target) > 0
    pending = Pending(
        np.zeros(ring, np.int64),
        np.empty((ring, width)),
        np.empty((ring, width)),
        np.empty((ring, width)),
        np.empty((ring, width)),
        np.empty((ring, width, 3)),
        np.empty((ring, width), np.int64),
        np.empty((ring, width), np.int64),
        np.empty((ring, width), np.int64),
        np.empty((ring, width), np.int64),
    )
    room = buckets * width + 1
    time, parent, option = np.empty(room), np.empty(room, np.int64), np.empty(room, np.int64)
    count, best, best_worth = 0, -1, -np.inf
    account = Account(
        np.zeros(garden.track.max() + 1, np.bool_),
        np.zeros(things),
        np.zeros(things),
        np.empty(things, np.int64),
        np.zeros(1, np.int64),
    )
    # What was done to a thing longer ago than this cannot be added to.
    past_s = 2.0 * (2.0 * front + 0.1) / v
    here = Place(garden.place[A.carrier], garden.place[A.lean], garden.place[A.across])
    put(pending, 0, Grown(0.0, 0.0, 0.0, 0.0, here, -1, -1, -1, 0))
    for bucket in range(buckets):
        row = bucket % ring
        for i in range(pending.filled[row]):
            now, worth, joules, label = pending.time[row, i], pending.worth[row, i], pending.joules[row, i], count
            target, known = pending.target[row, i], pending.known[row, i]
            time[label], parent[label], option[label] = now, pending.parent[row, i], pending.option[row, i]
            count += 1
            if worth > best_worth:
                best, best_worth = label, worth
            cart, x, y = garden.cart_m + v * now, pending.place[row, i, A.carrier], pending.place[row, i, A.lean]
            here = Place(x, y, pending.place[row, i, A.across])
            reckon(garden, label, now - past_s, time, parent, option, account, True)
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
                if account.done[garden.track[o]] or joules + garden.energy_j[o] > garden.budget_j:
                    continue
                way = approach(garden.arm, garden.stand_s[o], here, cart, v, along, across)
                then = now + way.move_s + way.wait_s + garden.stand_s[o]
                if not way.legal or then >= garden.until_s or then - now >= AHEAD_S - 2.0 * bucket_s:
                    continue
                more = brought(garden, account, o)
                place = Place(
                    way.carrier_m + garden.aim_m[o, G.along] - along,
                    way.lean_m,
                    way.across_m + garden.aim_m[o, G.across] - across,
                )
                spent, rank, on, knows = joules + garden.energy_j[o], worth + more, -1, 0
                if guided:
                    on, knows = guide.target[o], next_known(guide, target, known, o)
                    rank += ahead(guide, on, knows, then) + open_sum(garden, account, o, then)
                longer = Grown(then, worth + more, rank, spent, place, label, o, on, knows)
                put(pending, max(int(then / bucket_s), bucket + 1), longer)
            rest = ready(garden.arm, garden.cart_m + v * (now + garden.moment_s))
            carrier, lean = rest.carrier_m - here.carrier_m, rest.lean_m - here.lean_m
            move_s = move_time(garden.arm, carrier, lean, rest.across_m - here.across_m)
            move_s = max(move_s, lift_time(garden.arm, here.across_m, rest.across_m))
            then = now + max(garden.moment_s, move_s)
            if then < garden.until_s:
                rank = worth
                if guided:
                    rank += ahead(guide, target, known, then) + open_sum(garden, account, -1, then)
                waiting = Grown(then, worth, rank, joules, rest, label, -1, target, known)
                put(pending, max(int(then / bucket_s), bucket + 1), waiting)
            reckon(garden, label, now - past_s, time, parent, option, account, False)
        pending.filled[row] = 0
    order, n, label = np.empty(count, np.int64), 0, best
    while label > 0:
        order[n] = option[label]
        n += 1
        label = parent[label]
    return order[:n][::-1].copy(), best_worth


@compiled
def brought(garden: Garden, account: Account, option: int) -> float:
    """What an option adds to a sequence."""
    more = garden.value[option]
    for s in range(garden.share_first[option], garden.share_first[option + 1]):
        thing, share = garden.share_thing[s], garden.share[s]
        had, has = min(account.served[thing], 1.0), min(account.served[thing] + share, 1.0)
        if garden.whole[thing]:
            more += garden.gain[thing] if has >= _WHOLE and had < _WHOLE else 0.0
        else:
            more += garden.gain[thing] * (has - had)
    return more


@compiled
def open_sum(garden: Garden, account: Account, option: int, time_s: float) -> float:
    """What the guide has yet to hear of things that can still be served after ``time_s``, an option being done by then.

    It promises whatever its prices leave of them to everyone: who has had that will not have it again. Who has begun
    to kill one has paid for a part of it.
    """
    total, guide, new = 0.0, garden.guide, 0
    if option >= 0:
        new = garden.share_first[option + 1] - garden.share_first[option]
    for n in range(account.begun[0] + new):
        if n < account.begun[0]:
            thing = account.things[n]
            served, owed = account.served[thing], account.owed[thing]
        else:
            thing = garden.share_thing[garden.share_first[option] + n - account.begun[0]]
            served, owed = 0.0, 0.0
            if account.served[thing] > 0.0:
                continue
        if guide.lasts_s[thing] <= time_s:
            continue
        if option >= 0:
            for s in range(garden.share_first[option], garden.share_first[option + 1]):
                if garden.share_thing[s] == thing:
                    served, owed = served + garden.share[s], owed + guide.price[s]
        if not garden.whole[thing]:
            total -= guide.left[thing] * min(served, 1.0)
        elif served >= _WHOLE:
            total -= guide.left[thing]
        else:
            total += owed
    return float(total)


@compiled
def reckon(
    garden: Garden,
    label: int,
    since_s: float,
    time: Array,
    parent: Numbers,
    option: Numbers,
    account: Account,
    mark: bool,
) -> None:
    """Write what a sequence has done since a time; or take it back."""
    guided = len(garden.guide.target) > 0
    account.begun[0] = 0
    while label >= 0 and time[label] > since_s:
        o = option[label]
        if o >= 0:
            account.done[garden.track[o]] = mark
            for s in range(garden.share_first[o], garden.share_first[o + 1]):
                thing = garden.share_thing[s]
                if mark and account.served[thing] == 0.0:
                    account.things[account.begun[0]] = thing
                    account.begun[0] += 1
                account.served[thing] = account.served[thing] + garden.share[s] if mark else 0.0
                if guided:
                    account.owed[thing] = account.owed[thing] + garden.guide.price[s] if mark else 0.0
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
