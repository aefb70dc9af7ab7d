"""A schedule that knows everything, carried out by the weeding rules themselves: how near a bound can be reached.

Sequences of shots are grown along the row, the most valuable of each place of the cart kept (beam search in buckets);
where the speed is chosen, each decision may change it, and time is paid for. What
a shot brings is what the bound's own options say; where the bound also says what is left to win from a state on (see
``recall``), that is added at the bound's prices. Then the rules carry the best sequence out and say what it is worth.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.weeding.ridges import lift_time
from ..envs.weeding.timing import A, G, Place, approach, move_time, ready, way_of
from ..kernels import compiled
from .recall import Guide, ahead, next_known
from .sequences import Grown, Pending, put

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

WIDTH = 40
"""Sequences that are kept in each bucket of time."""
BUCKET_S = 0.05
"""Seconds of a bucket at the scenario's speed."""
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
        speed_m_s: of the cart, then.
        notch_m_s: by which a decision may change it; 0 where it may not.
        speed_range_m_s: slowest and fastest.
        acceleration_m_s2: of the cart.
        second: what a second costs.
        limit_s: that no sequence takes longer than.
        front_m: the window begins this far before the machine's middle and ends as far behind it.
        moment_s: what waiting takes.
        until_m: nothing happens when the cart has passed this.
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
    notch_m_s: float
    speed_range_m_s: tuple[float, float]
    acceleration_m_s2: float
    second: float
    limit_s: float
    front_m: float
    moment_s: float
    until_m: float
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
def grown(garden: Garden, width: int, bucket_m: float) -> tuple[Numbers, Numbers, float]:
    """Options and blocks of the best sequence found, in order, and what it is worth by the options' own account."""
    options, front, guide = len(garden.track), garden.front_m, garden.guide
    fastest = garden.speed_range_m_s[1]
    buckets = int((garden.until_m - garden.cart_m) / bucket_m) + 2
    things, ring = len(garden.gain), int(AHEAD_S * (fastest if garden.notch_m_s > 0.0 else garden.speed_m_s) / bucket_m)
    guided, blocks = len(guide.target) > 0, 3 if garden.notch_m_s > 0.0 else 1
    pending = Pending(
        np.zeros(ring, np.int64),
        np.empty((ring, width)),
        np.empty((ring, width)),
        np.empty((ring, width)),
        np.empty((ring, width)),
        np.empty((ring, width)),
        np.empty((ring, width)),
        np.empty((ring, width, 3)),
        np.empty((ring, width), np.int64),
        np.empty((ring, width), np.int64),
        np.empty((ring, width), np.int64),
        np.empty((ring, width), np.int64),
        np.empty((ring, width), np.int64),
    )
    room = buckets * width + 1
    carts, parent = np.empty(room), np.empty(room, np.int64)
    option, chosen = np.empty(room, np.int64), np.empty(room, np.int64)
    count, best, best_worth = 0, -1, -np.inf
    account = Account(
        np.zeros(garden.track.max() + 1, np.bool_),
        np.zeros(things),
        np.zeros(things),
        np.empty(things, np.int64),
        np.zeros(1, np.int64),
    )
    # What was done to a thing farther back than this cannot be added to.
    past_m = 2.0 * (2.0 * front + 0.1)
    here = Place(garden.place[A.carrier], garden.place[A.lean], garden.place[A.across])
    put(pending, 0, Grown(0.0, garden.cart_m, garden.speed_m_s, 0.0, 0.0, 0.0, here, -1, -1, 0, -1, 0))
    for bucket in range(buckets):
        row = bucket % ring
        for i in range(pending.filled[row]):
            now, worth, joules, label = pending.time[row, i], pending.worth[row, i], pending.joules[row, i], count
            target, known, v = pending.target[row, i], pending.known[row, i], pending.speed[row, i]
            cart, x, y = pending.cart[row, i], pending.place[row, i, A.carrier], pending.place[row, i, A.lean]
            carts[label], parent[label], option[label] = cart, pending.parent[row, i], pending.option[row, i]
            chosen[label] = pending.block[row, i]
            count += 1
            # What is left of the strip passes at the highest speed.
            last = worth - garden.second * (now + (garden.until_m - cart) / fastest)
            if last > best_worth:
                best, best_worth = label, last
            here = Place(x, y, pending.place[row, i, A.across])
            reckon(garden, label, cart - past_m, carts, parent, option, account, True)
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
                spent_s = way.move_s + way.wait_s + garden.stand_s[o]
                if not way.legal or now + spent_s >= garden.limit_s:
                    continue
                more = brought(garden, account, o)
                place = Place(
                    way.carrier_m + garden.aim_m[o, G.along] - along,
                    way.lean_m,
                    way.across_m + garden.aim_m[o, G.across] - across,
                )
                spent_j, then, on, knows, ahead_n = joules + garden.energy_j[o], now + spent_s, -1, 0, 0.0
                if guided:
                    on, knows = guide.target[o], next_known(guide, target, known, o)
                    ahead_n = ahead(guide, on, knows, then) + open_sum(garden, account, o, then)
                for block in range(blocks):
                    speed = sped(garden, v, block)
                    there = cart + way_of(v, speed, garden.acceleration_m_s2, spent_s)[0]
                    at = max(int((there - garden.cart_m) / bucket_m), bucket + 1)
                    if there < garden.until_m and at < bucket + ring:
                        rank = worth + more + ahead_n - garden.second * then
                        longer = Grown(
                            then, there, speed, worth + more, rank, spent_j, place, label, o, block, on, knows
                        )
                        put(pending, at, longer)
            for block in range(blocks):
                speed = sped(garden, v, block)
                rest = ready(garden.arm, cart + way_of(v, speed, garden.acceleration_m_s2, garden.moment_s)[0])
                carrier, lean = rest.carrier_m - here.carrier_m, rest.lean_m - here.lean_m
                move_s = move_time(garden.arm, carrier, lean, rest.across_m - here.across_m)
                move_s = max(move_s, lift_time(garden.arm, here.across_m, rest.across_m))
                spent_s = max(garden.moment_s, move_s)
                there = cart + way_of(v, speed, garden.acceleration_m_s2, spent_s)[0]
                then, at = now + spent_s, max(int((there - garden.cart_m) / bucket_m), bucket + 1)
                if there < garden.until_m and at < bucket + ring and then < garden.limit_s:
                    rank = worth - garden.second * then
                    if guided:
                        rank += ahead(guide, target, known, then) + open_sum(garden, account, -1, then)
                    put(
                        pending,
                        at,
                        Grown(then, there, speed, worth, rank, joules, rest, label, -1, block, target, known),
                    )
            reckon(garden, label, cart - past_m, carts, parent, option, account, False)
        pending.filled[row] = 0
    order, held, n, label = np.empty(count, np.int64), np.empty(count, np.int64), 0, best
    while label > 0:
        order[n], held[n] = option[label], chosen[label]
        n += 1
        label = parent[label]
    return order[:n][::-1].copy(), held[:n][::-1].copy(), best_worth


@compiled
def sped(garden: Garden, speed_m_s: float, block: int) -> float:
    """Speed after a decision."""
    if block == 0:
        return speed_m_s
    slowest, fastest = garden.speed_range_m_s
    return min(max(speed_m_s + (garden.notch_m_s if block == 2 else -garden.notch_m_s), slowest), fastest)


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
    since_m: float,
    carts: Array,
    parent: Numbers,
    option: Numbers,
    account: Account,
    mark: bool,
) -> None:
    """Write what a sequence has done since the cart was at a place; or take it back."""
    guided = len(garden.guide.target) > 0
    account.begun[0] = 0
    while label >= 0 and carts[label] > since_m:
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
