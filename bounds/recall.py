"""Paths in time that remember what they have served, for tools whose ways take the same at any time; compiled.

A state is the target worked on last, a tick of time, and which things of a short list have been served: each target has
its own list, and what does not stand on it is forgotten (Baldacci, Mingozzi and Roberti 2011, ng-routes). What is
remembered brings nothing again, what was forgotten may bring its price twice, so no true schedule is worth less than
its path. Times are rounded down to ticks. Waiting is free where the tool stands: no way leads through the waiting
machine's place more quickly than straight on, as long as a move in parts takes no less than in one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

MOST = 5
"""Longest list of things that a target remembers."""


class Ways(NamedTuple):
    """What can be worked on, T targets in the order along the row, O options in that of their targets.

    Things are counted with the targets first, then whatever else is served once.

    Attributes:
        option_first: (T + 1,), place of a target's first option.
        enters: (O,), first tick at which an option can be done, the window's front edge being what it waits for.
        lasts: (T,), last tick at which it can be done.
        stand_s: (O,).
        pair_first: (T + 1,), place of the first of those targets that a target's window overlaps.
        pair_to: (P,), the other target.
        pair_s: (P,), seconds of the way.
        far: (T,), first target that is reached from here whenever its window opens, however long the way.
        start_s: (T,), ways from where the tool stands in the beginning.
        share_first: (O + 1,), place of an option's first share.
        share_thing: (C,), thing that stops a share from being paid again.
        full: (C,), whether the share serves that thing.
        tick_s: grain of time.
    """

    option_first: Numbers
    enters: Numbers
    lasts: Numbers
    stand_s: Array
    pair_first: Numbers
    pair_to: Numbers
    pair_s: Array
    far: Numbers
    start_s: Array
    share_first: Numbers
    share_thing: Numbers
    full: NDArray[np.bool_]
    tick_s: float


class Lists(NamedTuple):
    """What each target remembers, and what follows from it.

    Attributes:
        lengths: (T,), of its list.
        thing: (T, MOST), the list.
        base: (T + 1,), place of its states; of each subset of its list the ticks follow each other.
        first: (T,), its first tick.
        made: (O,), what of its target's list an option serves, as bits.
        table: (P + 1,), place of a pair's entries: by option of the other target, then by subset.
        after: (E,), subset with which the other target goes on, -1 where it has been served, or where no path ever has
            the subset before.
    """

    lengths: Numbers
    thing: Numbers
    base: Numbers
    first: Numbers
    made: Numbers
    table: Numbers
    after: Numbers


class Guide(NamedTuple):
    """What is left to win at some prices, from every state on: where a search for a schedule looks first.

    Attributes:
        ways: what can be worked on; nothing where there is no guide.
        lists: what is remembered.
        target: (O,), of each option.
        price: (C,), of the shares.
        left: (things,), what the prices leave of what a thing is worth.
        best: value of the best schedule from a state on, see ``longest``.
        later: likewise.
        lasts_s: (things,), when a thing can be served for the last time.
    """

    ways: Ways
    lists: Lists
    target: Numbers
    price: Array
    left: Array
    best: Array
    later: Array
    lasts_s: Array


def unguided() -> Guide:
    """No guide."""
    none, no, floats = np.zeros(0, np.int64), np.zeros(0, bool), np.zeros(0)
    ways = Ways(none, none, none, floats, none, none, floats, none, floats, none, none, no, 1.0)
    lists = Lists(none, np.zeros((0, MOST), np.int64), none, none, none, none, none)
    return Guide(ways, lists, none, floats, floats, floats, floats, floats)


@compiled
def next_known(guide: Guide, target: int, known: int, option: int) -> int:
    """Subset of an option's target's list that is served, after what ``target`` knew; -1 for no target yet."""
    ways, lists, then = guide.ways, guide.lists, guide.target[option]
    if target >= 0 and then < ways.far[target]:
        for p in range(ways.pair_first[target], ways.pair_first[target + 1]):
            if ways.pair_to[p] == then:
                entry = lists.table[p] + (option - ways.option_first[then]) * (1 << lists.lengths[target]) + known
                return max(lists.after[entry], lists.made[option])
    return int(lists.made[option])


@compiled
def ahead(guide: Guide, target: int, known: int, time_s: float) -> float:
    """What is left to win after a work on a target, where it knows this subset; -1 for no target yet."""
    if target < 0:
        return float(guide.later[0])
    ways, lists = guide.ways, guide.lists
    tick, first, last = int(time_s / ways.tick_s), lists.first[target], ways.lasts[target]
    if tick > last:
        return float(guide.later[ways.far[target]])
    return float(guide.best[lists.base[target] + known * (last - first + 1) + max(tick - first, 0)])


@compiled
def listed(ways: Ways, count: Numbers, thing: Numbers) -> Lists:
    """States and transitions for what the targets remember."""
    targets, options = len(count), len(ways.stand_s)
    first, base = np.empty(targets, np.int64), np.zeros(targets + 1, np.int64)
    made = np.zeros(options, np.int64)
    for k in range(targets):
        first[k] = ways.enters[ways.option_first[k] : ways.option_first[k + 1]].min()
        base[k + 1] = base[k] + max(ways.lasts[k] - first[k] + 1, 0) * (1 << count[k])
        for o in range(ways.option_first[k], ways.option_first[k + 1]):
            for c in range(ways.share_first[o], ways.share_first[o + 1]):
                for b in range(count[k]):
                    if ways.full[c] and thing[k, b] == ways.share_thing[c]:
                        made[o] |= 1 << b
    table = np.zeros(len(ways.pair_to) + 1, np.int64)
    for i in range(targets):
        for p in range(ways.pair_first[i], ways.pair_first[i + 1]):
            k = ways.pair_to[p]
            table[p + 1] = table[p] + (ways.option_first[k + 1] - ways.option_first[k]) * (1 << count[i])
    after = np.empty(table[-1], np.int64)
    for i in range(targets):
        for p in range(ways.pair_first[i], ways.pair_first[i + 1]):
            k, entry = ways.pair_to[p], table[p]
            for o in range(ways.option_first[k], ways.option_first[k + 1]):
                for s in range(1 << count[i]):
                    then, seen = made[o], False
                    for b in range(count[i]):
                        if s >> b & 1:
                            seen = seen or thing[i, b] == k
                            for other in range(count[k]):
                                if thing[k, other] == thing[i, b]:
                                    then |= 1 << other
                    for other in range(count[k]):
                        if thing[k, other] == i:
                            then |= 1 << other
                    after[entry] = -1 if seen else then
                    entry += 1
    forget(ways, count, made, table, after)
    return Lists(count, thing, base, first, made, table, after)


@compiled
def forget(ways: Ways, count: Numbers, made: Numbers, table: Numbers, after: Numbers) -> None:
    """Take out, in ``after``, the transitions from subsets in which no path ever is: most of them."""
    targets = len(count)
    met = np.zeros((targets, 1 << MOST), np.bool_)
    for k in range(targets):
        for o in range(ways.option_first[k], ways.option_first[k + 1]):
            met[k, made[o]] = True
    # In the last turn nothing new is met, and what is not is taken out.
    new, last = True, False
    while new or not last:
        last, new = not new, False
        for i in range(targets):
            for p in range(ways.pair_first[i], ways.pair_first[i + 1]):
                k, entry = ways.pair_to[p], table[p]
                for _ in range(ways.option_first[k], ways.option_first[k + 1]):
                    for s in range(1 << count[i]):
                        then = after[entry]
                        if met[i, s] and then >= 0:
                            new = new or not met[k, then]
                            met[k, then] = True
                        elif last:
                            after[entry] = -1
                        entry += 1


@compiled
def weighed(ways: Ways, lists: Lists, price: Array, cost: Array, weight: Array) -> None:
    """Weight (E,) of every transition at prices of the shares (C,), less the options' costs (O,)."""
    for i in range(len(lists.lengths)):
        for p in range(ways.pair_first[i], ways.pair_first[i + 1]):
            k, entry = ways.pair_to[p], lists.table[p]
            for o in range(ways.option_first[k], ways.option_first[k + 1]):
                for s in range(1 << lists.lengths[i]):
                    weight[entry] = -cost[o]
                    if lists.after[entry] < 0:
                        entry += 1
                        continue
                    for c in range(ways.share_first[o], ways.share_first[o + 1]):
                        paid = True
                        for b in range(lists.lengths[i]):
                            if s >> b & 1 and lists.thing[i, b] == ways.share_thing[c]:
                                paid = False
                        if paid:
                            weight[entry] += price[c]
                    entry += 1


@compiled
def plain(ways: Ways, price: Array, cost: Array) -> Array:
    """Weight (O,) of every option where nothing is remembered."""
    weight = -cost
    for o in range(len(cost)):
        for c in range(ways.share_first[o], ways.share_first[o + 1]):
            weight[o] += price[c]
    return weight


@compiled
def longest(ways: Ways, lists: Lists, weight: Array, alone: Array, end: Array, best: Array, later: Array) -> float:
    """Value of the best schedule from every state on, into ``best``; the whole one's is returned.

    Args:
        ways: what can be worked on.
        lists: what is remembered.
        weight: (E,), see ``weighed``.
        alone: (O,), see ``plain``.
        end: (ticks,), worth of ending at a tick; never rising.
        best: result, by state.
        later: (T + 1,), result: what is best from one of the targets on, reached when its window opens.
    """
    targets, tick_s = len(lists.lengths), ways.tick_s
    step = max(int(ways.stand_s.min() / tick_s), 1)
    later[targets], known = -np.inf, targets
    for low in range((ways.lasts.max() // step) * step, -1, -step):
        for i in range(targets - 1, -1, -1):
            first = lists.first[i]
            a, b = max(low, first), min(low + step - 1, ways.lasts[i])
            if a > b:
                continue
            while known > ways.far[i]:
                known -= 1
                later[known] = later[known + 1]
                for o in range(ways.option_first[known], ways.option_first[known + 1]):
                    if ways.enters[o] <= ways.lasts[known]:
                        length = ways.lasts[known] - lists.first[known] + 1
                        place = lists.base[known] + lists.made[o] * length + ways.enters[o] - lists.first[known]
                        later[known] = max(later[known], alone[o] + best[place])
            length, subsets = ways.lasts[i] - first + 1, 1 << lists.lengths[i]
            for s in range(subsets):
                here = lists.base[i] + s * length - first
                for t in range(a, b + 1):
                    best[here + t] = max(end[t], later[ways.far[i]])
            for p in range(ways.pair_first[i], ways.pair_first[i + 1]):
                k, entry = ways.pair_to[p], lists.table[p]
                lasts, origin = ways.lasts[k], lists.base[k] - lists.first[k]
                other = lasts - lists.first[k] + 1
                for o in range(ways.option_first[k], ways.option_first[k + 1]):
                    ticks, enters = int((ways.pair_s[p] + ways.stand_s[o]) / tick_s), ways.enters[o]
                    end_t = min(b, lasts - ticks)
                    if enters > lasts or a > end_t:
                        entry += subsets
                        continue
                    split = min(max(enters - ticks + 1, a), end_t + 1)
                    for s in range(subsets):
                        then = lists.after[entry]
                        if then >= 0:
                            w = weight[entry]
                            here, there = lists.base[i] + s * length - first, origin + then * other
                            if split > a:
                                value = w + best[there + enters]
                                early = best[here + a : here + split]
                                for t in range(len(early)):
                                    early[t] = early[t] if early[t] > value else value
                            late = best[here + split : here + end_t + 1]
                            on = best[there + ticks + split : there + ticks + end_t + 1]
                            for t in range(len(late)):
                                value = w + on[t]
                                late[t] = late[t] if late[t] > value else value
                        entry += 1
    most = end[0]
    for o in range(len(alone)):
        then = begun(ways, o)
        k = owner(ways, o)
        if then <= ways.lasts[k]:
            length = ways.lasts[k] - lists.first[k] + 1
            place = lists.base[k] + lists.made[o] * length + then - lists.first[k]
            most = max(most, alone[o] + best[place])
    return most


@compiled
def owner(ways: Ways, option: int) -> int:
    """Target of an option."""
    return int(np.searchsorted(ways.option_first, option, side="right")) - 1


@compiled
def begun(ways: Ways, option: int) -> int:
    """Tick at which an option is done first of all."""
    k = owner(ways, option)
    return max(int((ways.start_s[k] + ways.stand_s[option]) / ways.tick_s), ways.enters[option])


@compiled
def followed(
    ways: Ways, lists: Lists, weight: Array, alone: Array, end: Array, best: Array, later: Array, most: float
) -> tuple[Numbers, Numbers]:
    """The best schedule: its options (n,), and the subset (n,) remembered when each was chosen, -1 for nothing.

    Args:
        ways: as in ``longest``, like what follows.
        lists: what is remembered.
        weight: (E,).
        alone: (O,).
        end: (ticks,).
        best: its results; ``later`` alike.
        later: see ``best``.
        most: the best schedule's value.
    """
    targets = len(lists.lengths)
    chosen, subset = np.empty(4 * len(alone) + 4, np.int64), np.empty(4 * len(alone) + 4, np.int64)
    n, i, s, t, tick, value = 0, -1, 0, 0, 0, most
    while n < len(chosen):
        o, then, after = -1, 0, 0
        if i < 0:
            for k in range(targets):
                for other in range(ways.option_first[k], ways.option_first[k + 1]):
                    then = begun(ways, other)
                    if o < 0 and then <= ways.lasts[k]:
                        length = ways.lasts[k] - lists.first[k] + 1
                        place = lists.base[k] + lists.made[other] * length + then - lists.first[k]
                        if alone[other] + best[place] >= value and alone[other] + best[place] > end[0]:
                            o, after, tick = other, lists.made[other], then
        else:
            for p in range(ways.pair_first[i], ways.pair_first[i + 1]):
                k = ways.pair_to[p]
                length = ways.lasts[k] - lists.first[k] + 1
                for other in range(ways.option_first[k], ways.option_first[k + 1]):
                    entry = lists.table[p] + (other - ways.option_first[k]) * (1 << lists.lengths[i]) + s
                    then = max(t + int((ways.pair_s[p] + ways.stand_s[other]) / ways.tick_s), ways.enters[other])
                    if o < 0 and lists.after[entry] >= 0 and then <= ways.lasts[k]:
                        place = lists.base[k] + lists.after[entry] * length + then - lists.first[k]
                        if weight[entry] + best[place] >= value:
                            o, after, tick = other, lists.after[entry], then
            if o < 0 and value > end[t]:
                s = -1
                for other in range(ways.option_first[ways.far[i]], len(alone)):
                    k = owner(ways, other)
                    if o < 0 and ways.enters[other] <= ways.lasts[k]:
                        length = ways.lasts[k] - lists.first[k] + 1
                        place = lists.base[k] + lists.made[other] * length + ways.enters[other] - lists.first[k]
                        if alone[other] + best[place] >= value:
                            o, after, tick = other, lists.made[other], ways.enters[other]
        if o < 0:
            break
        chosen[n], subset[n] = o, -1 if i < 0 else s
        n += 1
        i, s, t = owner(ways, o), after, tick
        length = ways.lasts[i] - lists.first[i] + 1
        value = best[lists.base[i] + s * length + t - lists.first[i]]
    return chosen[:n], subset[:n]
