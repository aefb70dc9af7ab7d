"""Bounds by prices of what shots do, on paths that remember what they have served.

A schedule is worth what it does at the prices, less its costs, plus what these leave of each weed's gain over its
cheapest set of shots (see ``killing``): that bounds every schedule, whatever the prices. Subgradient steps make the
bound small. Where the best path serves a thing again, the targets in between remember it from then on (decremental
state space relaxation, Righini and Salani 2008), each as many things as ``recall.MOST``.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.weeding.ridges import lift_time
from ..envs.weeding.timing import A, G, Place, approach, move_time, ready
from ..kernels import compiled
from .killing import Sets, sets_of
from .recall import MOST, Guide, Lists, Ways, followed, listed, longest, plain, weighed
from .shots import Shots

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

TICK_S = 0.02
"""Grain of time."""
ROUNDS, FEWER_ROUNDS = 200, 50
"""Most steps of the prices: for the return, and for the weeds killed, whose prices begin with those."""
FORGETFUL, FEWER_FORGETFUL = 25, 10
"""Steps before anything is remembered: until then prices are too wrong for paths to tell what is worth it."""
_LEVEL, _LOWER, _ENOUGH = 0.06, 0.6, 2e-4
"""Shares of the bound that steps aim below it: at first, and the last; and times which they do after steps in vain."""
_PATIENCE = 5
"""Steps that brought less than a tenth of what they aimed at after which they are in vain."""
_LAST_STEPS = 0.6
"""Share of the last direction in the next one."""
_BEYOND_S = 0.5
"""Where two windows are this far apart no way between two targets is waited for."""


class Priced(NamedTuple):
    """A bound by prices, and what is left to win.

    Attributes:
        bound: no schedule is worth more.
        prices: (X,), at which it was found.
        guide: what is left to win at these prices, for a search.
    """

    bound: float
    prices: Array
    guide: Guide


class Both(NamedTuple):
    """Bounds on weeds killed and on the return."""

    kills: Priced
    value: Priced


def leans(arm: Any) -> bool:
    """Whether what ways take depends on when they are gone, because the tool leans beyond its carrier."""
    far = approach(arm, 0.0, Place(0.0, 0.0, 0.0), 0.0, 1.0, float(arm.front_m), 0.0)
    return bool(ready(arm, 0.0).lean_m != 0.0 or far.lean_m != 0.0)


class Search:
    """Paths over shots at drawn tracks by a tool that does not lean, under a cart at a steady speed.

    Attributes:
        sets: what kills what.
        ways: what can be worked on.
        target: (O,), of each option.
        lists: what each target remembers by now.
        ends_s: (ticks,), the times at which a schedule may end.
    """

    def __init__(self, arm: Any, shots: Shots, place: Array, cart_m: float, speed_m_s: float):
        """Put the shots in order; nothing is remembered yet."""
        self.sets = sets_of(shots)
        self.ways = ways_of(arm, shots, self.sets, place, cart_m, speed_m_s)
        targets = len(self.ways.lasts)
        self.target = np.repeat(np.arange(targets), np.diff(self.ways.option_first))
        self._lasts_s = np.zeros(shots.weeds)
        lasts = self.ways.lasts[self.target[shots.option_of_share()]]
        np.maximum.at(self._lasts_s, shots.share_weed, TICK_S * (lasts + 1.0))
        self._known: list[list[int]] = [[] for _ in range(targets)]
        self._list()
        self.ends_s = np.arange(self.ways.lasts.max() + 1) * TICK_S

    def lowered(
        self, gain: Array, cost: Array, end: Array, prices: Array, rounds: int, until: float, forgetful: int
    ) -> Priced:
        """Smallest bound found on the gains of the weeds killed, less the options' costs, plus the worth of the end.

        Args:
            gain: (weeds,), >= 0.
            cost: (O,).
            end: (ticks,), never rising.
            prices: (X,), to begin with.
            rounds: most steps.
            until: no step begins after this, on the clock of ``time.perf_counter``.
            forgetful: steps before anything is remembered.
        """
        bound, best, here, direction = np.inf, prices, prices, np.zeros(len(prices))
        level, stale = 0.0, 0
        for step in range(rounds):
            value, slope, options = self._at(here, gain, cost, end)
            if step == 0:
                level = _LEVEL * abs(value)
            stale = 0 if value < bound - 0.1 * level else stale + 1
            if value < bound:
                bound, best = value, here
            new = step >= forgetful and self._remember(options)
            if stale >= _PATIENCE:
                level, stale, here, direction = _LOWER * level, 0, best, np.zeros(len(prices))
                if level < _ENOUGH * abs(bound) and not new:
                    break
                value, slope, _ = self._at(here, gain, cost, end)
            # Prices are not below zero.
            slope[(here <= 0.0) & (slope > 0.0)] = 0.0
            direction = _LAST_STEPS * direction + (1.0 - _LAST_STEPS) * slope
            square = float(direction @ direction)
            if square <= 1e-12 or time.perf_counter() > until:
                break
            here = np.maximum(here - (value - bound + level) / square * direction, 0.0)
        bound = min(bound, self._at(best, gain, cost, end)[0])
        left = self.sets.left(best, gain)[0]
        of_shares = self.sets.of_shares(best, gain)
        guide = Guide(self.ways, self.lists, self.target, of_shares, left, self._best, self._later, self._lasts_s)
        return Priced(bound, best, guide)

    def _list(self) -> None:
        """States and transitions for what the targets remember."""
        count = np.array([len(known) for known in self._known], np.int64)
        thing = np.array([known + [0] * (MOST - len(known)) for known in self._known], np.int64)
        self.lists: Lists = listed(self.ways, count, thing)
        self._weight = np.empty(len(self.lists.after))

    def _at(self, prices: Array, gain: Array, cost: Array, end: Array) -> tuple[float, Array, Numbers]:
        """Bound at some prices, its slopes (X,), and the options of the best path."""
        sets, ways, lists = self.sets, self.ways, self.lists
        self._best, self._later = np.empty(lists.base[-1]), np.empty(len(lists.lengths) + 1)
        of_share = sets.of_shares(prices, gain)
        weighed(ways, lists, of_share, cost, self._weight)
        alone = plain(ways, of_share, cost)
        value = longest(ways, lists, self._weight, alone, end, self._best, self._later)
        options, subsets = followed(ways, lists, self._weight, alone, end, self._best, self._later, value)
        slope = paid(ways, lists, options, subsets, self.target, sets.price, sets.prices)
        left, best = sets.left(prices, gain)
        for chosen in best[left > 0.0].tolist():
            slope[sets.set_price[sets.set_first[chosen] : sets.set_first[chosen + 1]]] -= 1.0
        return value + float(left.sum()), slope, options

    def _remember(self, options: Numbers) -> bool:
        """Let targets remember what a path has served twice; whether there was anything new."""
        ways, targets, known, new = self.ways, self.target[options].tolist(), self._known, False
        last: dict[int, int] = {}
        for n, (option, target) in enumerate(zip(options.tolist(), targets, strict=True)):
            here = slice(ways.share_first[option], ways.share_first[option + 1])
            for served in (target, *ways.share_thing[here][ways.full[here]].tolist()):
                # A target knows anyway that it was served itself.
                between = {k for k in targets[last.get(served, n) : n] if k != served and served not in known[k]}
                if all(len(known[k]) < MOST for k in between):
                    for k in between:
                        known[k].append(served)
                        new = True
                last[served] = n
        if new:
            self._list()
        return new


def both(
    arm: Any,
    shots: Shots,
    place: Array,
    cart_m: float,
    config: Any,
    least_s: float,
    thrifts: Sequence[float],
    until: float,
    rounds: tuple[int, int] = (ROUNDS, FEWER_ROUNDS),
) -> Both:
    """Bounds on weeds killed and on the return at a steady speed; of an arm that leans no bounds, but guides.

    Args:
        arm: numbers of an arm; if it does not lean its ways take the same at any time.
        shots: what can be done at drawn tracks; one at least.
        place: (3,), where the arm stands in the beginning.
        cart_m: position of the cart then.
        config: the task's numbers.
        least_s: no episode is shorter.
        thrifts: prices of a joule, in killed weeds, that are tried where energy is scarce.
        until: no step begins after this, on the clock of ``time.perf_counter``.
        rounds: most steps of the prices for the return, and for the weeds killed.
    """
    weights, scarce_j = config.weights, float(config.scenario.energy_j)
    killed = weights.killed
    search = Search(arm, shots, place, cart_m, float(config.speed_m_s))
    gain, end = killed * shots.worth, weights.seconds * np.maximum(search.ends_s, least_s)
    prices, found = search.sets.begin(gain), []
    # Nobody may spend more than there is: at any price of a joule a schedule pays at most for all of it.
    for price in thrifts if scarce_j > 0.0 else (0.0,):
        spent, all_j = price * shots.energy_j + shots.advance, price * scarce_j
        value = search.lowered(gain, shots.cost + killed * spent, end, prices, rounds[0], until, FORGETFUL)
        begin = value.prices / killed if killed > 0.0 else search.sets.begin(shots.worth)
        kills = search.lowered(shots.worth, spent, 0.0 * end, begin, rounds[1], until, FEWER_FORGETFUL)
        found.append((kills._replace(bound=kills.bound + all_j), value._replace(bound=value.bound + killed * all_j)))
    return Both(min((kills for kills, _ in found), key=_bound), min((value for _, value in found), key=_bound))


def _bound(priced: Priced) -> float:
    return priced.bound


def ways_of(arm: Any, shots: Shots, sets: Sets, place: Array, cart_m: float, speed_m_s: float) -> Ways:
    """What can be worked on: shots at drawn tracks, of which the machine knows where they are."""
    first = np.flatnonzero(np.append(True, shots.track[1:] != shots.track[:-1]))
    told, aim = shots.told_m[first], shots.aim_m[first]
    option_first = np.append(first, len(shots.track)).astype(np.int64)
    along, front = told[:, G.along], float(arm.front_m)
    enters_s = np.maximum(along - front - cart_m, 0.0) / speed_m_s
    lasts_s = (along + front - cart_m) / speed_m_s
    far = np.searchsorted(along, along + 2.0 * front + speed_m_s * _BEYOND_S, side="right")
    near = [[k for k in range(far[i]) if k != i and along[k] >= along[i] - 2.0 * front] for i in range(len(first))]
    pair_first = np.concatenate([[0], np.cumsum([len(some) for some in near])]).astype(np.int64)
    pair_to = np.array([k for some in near for k in some], np.int64)
    here = np.array([[place[A.carrier] + place[A.lean], place[A.across]]])
    every = np.arange(len(first))
    return Ways(
        option_first=option_first,
        # Rounding never takes a tick from a schedule.
        enters=((np.repeat(enters_s, np.diff(option_first)) + shots.stand_s) / TICK_S - 1e-6).astype(np.int64),
        lasts=np.floor(lasts_s / TICK_S + 1e-6).astype(np.int64),
        stand_s=shots.stand_s - 1e-9,
        pair_first=pair_first,
        pair_to=pair_to,
        pair_s=ways_s(arm, aim, told, pair_first, pair_to),
        far=far.astype(np.int64),
        start_s=ways_s(arm, here, told, np.array([0, len(first)]), every),
        share_first=shots.share_first,
        share_thing=len(first) + shots.share_weed,
        full=sets.full,
        tick_s=TICK_S,
    )


@compiled
def ways_s(arm: Any, from_m: Array, told_m: Array, pair_first: Numbers, pair_to: Numbers) -> Array:
    """Seconds (P,) of ways from places to targets."""
    found = np.empty(len(pair_to))
    for i in range(len(from_m)):
        for p in range(pair_first[i], pair_first[i + 1]):
            begin, end = from_m[i], told_m[pair_to[p]]
            found[p] = move_time(arm, end[G.along] - begin[G.along], 0.0, end[G.across] - begin[G.across])
            found[p] = max(found[p], lift_time(arm, begin[G.across], end[G.across]))
    return found


@compiled
def paid(
    ways: Ways,
    lists: Lists,
    options: Numbers,
    subsets: Numbers,
    target: Numbers,
    price: Numbers,
    prices: int,
) -> Array:
    """How much of each price (X,) a path is paid.

    Args:
        ways: what can be worked on.
        lists: what is remembered.
        options: (n,), see ``followed``; ``subsets`` alike.
        subsets: see ``options``.
        target: (O,), of each option.
        price: (C,), see ``killing.Sets``; ``prices`` alike.
        prices: see ``price``.
    """
    found = np.zeros(prices)
    for n in range(len(options)):
        for c in range(ways.share_first[options[n]], ways.share_first[options[n] + 1]):
            known = price[c] < 0
            if n > 0 and subsets[n] > 0:
                before = target[options[n - 1]]
                for b in range(lists.lengths[before]):
                    if subsets[n] >> b & 1 and lists.thing[before, b] == ways.share_thing[c]:
                        known = True
            if not known:
                found[price[c]] += 1.0
    return found
