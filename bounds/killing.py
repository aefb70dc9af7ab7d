"""Sets of shots that kill a weed, and the prices of what they do.

A weed that dies whole or not at all dies of one shot, or of the smallest sets of several that together do enough. What
dies by shares, but not more than once, has every set of shots at the tracks that have most of it. Each share has a
price of its own, and a weed leaves what its gain by a set is above the set's price, where that is most.
"""

from __future__ import annotations

from itertools import product
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .shots import Shots

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]
Flags = NDArray[np.bool_]

SETS, LARGEST = 200, 6
"""Most sets of shots that kill one weed, and most shots of a set; with more, the weed dies by shares as far as prices
go."""
TOGETHER = 4
"""Tracks whose shots are put together in sets where things die by shares; those of others are paid as if nothing else
was done."""
SLIGHT, GRANTED = 0.08, 0.3
"""Shares below the first are granted, as long as they are together below the second."""
_WHOLE = 1.0 - 1e-9


class Sets(NamedTuple):
    """How prices make up shares and weeds; C shares, X prices, S sets.

    Attributes:
        price: (C,), price of a share, -1 for none.
        fixed: (C,), share of its weed's gain that a share is paid whatever the prices are.
        full: (C,), whether the share kills by itself.
        weed: (C,).
        prices: how many there are.
        set_first: (S + 1,), place of a set's first price; each has one.
        set_price: (M,), prices of the sets.
        set_part: (S,), share of a weed's gain that a set has.
        weed_first: (weeds + 1,), place of a weed's first set; each has one.
    """

    price: Numbers
    fixed: Array
    full: Flags
    weed: Numbers
    prices: int
    set_first: Numbers
    set_price: Numbers
    set_part: Array
    weed_first: Numbers

    def of_shares(self, prices: Array, gain: Array) -> Array:
        """What the shares are paid, (C,)."""
        return np.where(self.price >= 0, prices[self.price], self.fixed * gain[self.weed])

    def left(self, prices: Array, gain: Array) -> tuple[Array, Numbers]:
        """What the weeds leave (weeds,) of their gains, and by which sets (weeds,)."""
        counts = np.diff(self.weed_first)
        of_set = np.repeat(gain, counts) * self.set_part
        of_set -= np.add.reduceat(prices[self.set_price], self.set_first[:-1])
        most = np.maximum.reduceat(of_set, self.weed_first[:-1])
        best = np.flatnonzero(of_set == np.repeat(most, counts))
        return np.maximum(most, 0.0), best[np.searchsorted(best, self.weed_first[:-1])]

    def begin(self, gain: Array) -> Array:
        """Prices (X,) at which no set costs less than it gains."""
        prices = np.zeros(self.prices)
        of_set = np.repeat(gain, np.diff(self.weed_first)) * self.set_part / np.diff(self.set_first)
        np.maximum.at(prices, self.set_price, np.repeat(of_set, np.diff(self.set_first)))
        return prices


def sets_of(shots: Shots) -> Sets:
    """Which shots kill which weeds; one at least can be killed."""
    option = shots.option_of_share()
    price, fixed = np.full(len(option), -1, np.int64), np.zeros(len(option))
    full, count = np.zeros(len(option), bool), 0
    sets: list[list[int]] = []
    parts: list[float] = []
    weed_first = [0]
    for weed in range(shots.weeds):
        places = np.flatnonzero(shots.share_weed == weed)
        share, track = shots.share[places], shots.track[option[places]]
        ways = killing(track, share) if shots.whole[weed] else None
        if ways is None:
            some, total = shared(track, share)
            used = sorted({c for chosen in some for c in chosen})
            number = {c: count + i for i, c in enumerate(used)}
            fixed[places], full[places] = share, share >= _WHOLE
            parts += total
        else:
            alone, some = ways
            used = sorted({c for chosen in some for c in chosen})
            # All that kill alone have one price.
            number = {c: count + int(alone.any()) + i for i, c in enumerate(used)}
            number |= dict.fromkeys(np.flatnonzero(alone).tolist(), count)
            some = [(int(alone.argmax()),), *some] if alone.any() else some
            full[places[alone]] = True
            parts += [1.0] * len(some)
        for c, at in number.items():
            price[places[c]] = at
        count += len(set(number.values()))
        sets += [[number[c] for c in chosen] for chosen in some]
        weed_first.append(len(sets))
    set_first = np.concatenate([[0], np.cumsum([len(chosen) for chosen in sets])]).astype(np.int64)
    members = np.array([at for chosen in sets for at in chosen], np.int64)
    firsts = np.array(weed_first, np.int64)
    return Sets(price, fixed, full, shots.share_weed, count, set_first, members, np.array(parts), firsts)


def shared(track: Numbers, share: Array) -> tuple[list[tuple[int, ...]], list[float]]:
    """Sets of shares (n,), one a track at most, of the tracks that have most; and what they add up to, 1 at most."""
    most = {k: float(share[track == k].max()) for k in dict.fromkeys(track.tolist())}
    largest = sorted(most, key=lambda k: -most[k])[:TOGETHER]
    ways = [[-1, *np.flatnonzero(track == k).tolist()] for k in largest]
    sets = [tuple(c for c in chosen if c >= 0) for chosen in product(*ways)]
    sets = [chosen for chosen in sets if chosen]
    return sets, [min(float(share[list(chosen)].sum()), 1.0) for chosen in sets]


def killing(track: Numbers, share: Array) -> tuple[Flags, list[tuple[int, ...]]] | None:
    """Which shares (n,) of a weed kill alone, and the smallest sets of others that do; None where these are too many.

    Args:
        track: (n,), at which a shot has the share; a set has one shot a track at most.
        share: (n,), which have to add up to 1.
    """
    most = {k: float(share[track == k].max()) for k in dict.fromkeys(track.tolist())}
    slight = sum(value for value in most.values() if value < SLIGHT)
    granted = slight if slight < GRANTED else 0.0
    need = _WHOLE - granted
    alone = share >= need
    able = [k for k, value in most.items() if value >= SLIGHT or not granted]
    ways = [[c for c in np.flatnonzero(track == k).tolist() if not alone[c]] for k in able]
    tops = [max((float(share[c]) for c in way), default=0.0) for way in ways]
    rest = [sum(tops[at:]) for at in range(len(ways) + 1)]
    found: list[tuple[int, ...]] = []

    def go_on(at: int, chosen: tuple[int, ...], total: float) -> bool:
        if total >= need:
            if all(total - share[c] < need for c in chosen):
                found.append(chosen)
            return len(found) <= SETS
        if total + rest[at] < need:
            return True
        if len(chosen) == LARGEST:
            return False
        return go_on(at + 1, chosen, total) and all(
            go_on(at + 1, (*chosen, c), total + float(share[c])) for c in ways[at]
        )

    if not go_on(0, (), 0.0) or not (alone.any() or found):
        return None
    return alone, found
