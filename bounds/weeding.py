"""Bounds for weeding from a moving cart, with any tool.

Full knowledge: where every plant stands and what it can take, where every track will have the tool work, the machine's
own time for every way. At a steady speed a schedule is a path in a time-expanded graph (see ``strip``) in which a weed
counts once (see ``timeline``); for a tool whose ways take the same at any time, in one that remembers what was served
(see ``remembering``). Where the speed is chosen, a schedule takes at least its work and the shortest ways to
its targets, and no less than the strip takes at the highest speed. Left out: the slots, and that a weed that only
several shots kill takes whole ones. In expectation the same graph is gone through with what shots do on average (see
``hopes``).
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..envs.weeding.outcomes import outcomes_of
from ..envs.weeding.state import T
from ..envs.weeding.timing import G
from .base import Bound, Expectation, Found, check_method, check_start, relative_gap, state_of
from .gardener import BUCKET_S, WIDTH, Garden, grown
from .hopes import hoped_shots
from .recall import Guide, unguided
from .remembering import Both, both, leans
from .sequences import tended
from .shots import STRAY_M, Shots, any_shots, drawn_shots
from .strip import Strip, build, late_s, shortest
from .timeline import Timeline, priced

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

TICK_S = 0.02
"""Grain of time. Half of it is lost on average where a shot and its way take half a second."""
SECONDS = 30.0
"""Most wall seconds for either of the two searches; the number of steps ends them long before, so that a bound is the
same wherever it is reckoned."""
ROUNDS, HOPED_ROUNDS, FEW_ROUNDS, HINTS = 40, 80, 6, (60, 8)
"""Steps of the prices: with the luck known, in expectation, with any reports, those that guide and bound nothing."""
THRIFTS = (0.0, 0.004, 0.008, 0.012, 0.016)
"""Prices of a joule, in killed weeds, that are tried where energy is scarce: each gives a bound."""
FREE_S = 1e9
"""Guess at the seconds of what brings something beside a whole: its price begins with all of its gain."""
HOPED = "luck of shots replaced by measured means, given the reports"


@dataclass(frozen=True, eq=False)
class WeedingInstance:
    """One strip with its luck.

    Attributes:
        shots: what can be done that kills.
        arm: numbers of the tool's arm.
        longest_s: standing time of the longest mode.
        move_s: (J,), no way to an option is shorter.
        drawn: whether the tracks are known, not only the weeds.
        weeds: true weeds of the strip.
        worth: what they count.
        place: (3,), where the arm stands in the beginning.
        cart_m: position of the cart in the beginning.
        least_s: no episode is shorter.
        core: the rules, as they were reset, for a schedule to be carried out; None where reports are not drawn.
        config: the task's numbers.
        words: what was assumed.
        hoped: what can be done, by what it does on average; None where reports are not drawn.
    """

    shots: Shots
    arm: Any
    longest_s: float
    move_s: Array
    drawn: bool
    weeds: int
    worth: float
    place: Array
    cart_m: float
    least_s: float
    core: Any
    config: Any
    words: str
    hoped: Shots | None

    def bound(self, method: str = "relaxation", time_limit_s: float = SECONDS) -> Bound:
        """What no policy can beat; see ``Instance``. Both methods are the same search.

        Raises:
            ValueError: unknown method, or a reward that pays for time, energy or lost crop.
        """
        weights = self.config.weights
        check_method(method)
        if min(weights.killed, -weights.crop, -weights.seconds, -weights.joules) < 0.0:
            raise ValueError(f"{weights}: the bound needs killed >= 0 and everything else <= 0")
        began = time.perf_counter()
        known = self._remembered(self.shots, time_limit_s) if self._remembers else None
        found_n, found_v = (math.nan, math.nan) if self.core is None else self._carried_out(known, time_limit_s)
        if known is not None:
            kills, value = known.kills.bound, known.value.bound
            words = "paths in time that remember, shots priced"
        elif self.config.speed_control:
            kills, value = self._most_work(), float(self._largest_return())
            words = "work and shortest ways against the time"
        else:
            kills, value = self._priced(self.shots, found_n, found_v, time_limit_s)
            words = "paths in a time-expanded graph, weeds priced"
        hope = self._expectation(time_limit_s)
        kills = min(kills, float(self.shots.worth.sum()))
        if (self.shots.worth == 1.0).all():
            kills = math.floor(kills + 1e-6)
        gap = max(relative_gap(kills, found_n), relative_gap(value, found_v)) if self.core is not None else math.nan
        net_rate = kills / (self.worth or 1.0)
        cycle_s = self.cycle_time_at(net_rate)
        found = None if self.core is None else Found(found_n / (self.worth or 1.0), found_v)
        spent_s = time.perf_counter() - began
        return Bound(net_rate, value, cycle_s, f"{words}; {self.words}", gap == 0.0, gap, spent_s, hope, found)

    def _expectation(self, seconds: float) -> Expectation | None:
        """The bound with the luck of what shots do replaced by its mean, given the reports."""
        if self.hoped is None:
            return None
        if self.config.speed_control:
            kills, value = self._hoped_work(self.hoped)
        elif self._remembers:
            hope = self._remembered(self.hoped, seconds)
            kills, value = (0.0, self._idle) if hope is None else (hope.kills.bound, hope.value.bound)
        else:
            hoped, killed = self.hoped, self.config.weights.killed
            reached_n = self._grown(hoped, -hoped.advance, hoped.worth, unguided(), 0.0)[2]
            reached_v = self._grown(hoped, -hoped.cost - killed * hoped.advance, killed * hoped.worth, unguided(), 0.0)[
                2
            ]
            # At the latest it ends when the strip has passed.
            reached_v += self.config.weights.seconds * max(self.least_s, self._until_s)
            kills, value = self._priced(hoped, reached_n, reached_v, seconds)
        return Expectation(kills / (self.worth or 1.0), value, HOPED, True)

    def cycle_time_at(self, net_rate: float) -> float:
        """Seconds that the cycle time cannot fall below with at least this net rate; infinite when it cannot be had.

        Before the n-th weed dies the work and the ways that n weeds take at least are done, and n weeds have come in.
        """
        shots = self.shots
        # The weeds that count most are the fewest that make up a net rate.
        heaviest = np.cumsum(np.sort(shots.worth)[::-1])
        least = int(np.searchsorted(heaviest, net_rate * self.worth - 1e-9)) + 1 if net_rate * self.worth > 1e-9 else 0
        least = max(least, 1 if shots.weeds else 0)
        if least > shots.weeds:
            return math.inf
        if not least:
            return 0.0
        worked_s = np.cumsum(np.sort(shots.least_split(shots.stand_s)))
        moved_s = np.cumsum(np.sort(self._times_s())) - self._first_s()
        last_s = np.maximum(np.maximum(worked_s, moved_s), np.sort(self._enters_s()))
        return float((last_s / np.arange(1, shots.weeds + 1))[least - 1 :].min())

    @property
    def _fastest_m_s(self) -> float:
        config = self.config
        return float(config.cart.speed_range_m_s[1]) if config.speed_control else float(config.speed_m_s)

    @property
    def _until_s(self) -> float:
        """When the strip has passed at a steady speed."""
        way_m = self.config.scenario.strip_m + self.arm.front_m - self.cart_m
        return float(way_m / self.config.speed_m_s)

    @property
    def _idle(self) -> float:
        """Return of an episode in which nothing is done, at most."""
        return float(self.config.weights.seconds) * self.least_s

    @property
    def _remembers(self) -> bool:
        """Whether there are tracks, and a tool whose ways take the same at any time, at a steady speed."""
        return self.drawn and not self.config.speed_control and not leans(self.arm)

    def _remembered(self, shots: Shots, seconds: float) -> Both | None:
        """Bounds on weeds killed and on the return by paths that remember; None where nothing can be done."""
        if not shots.weeds:
            return None
        until = time.perf_counter() + seconds
        return both(self.arm, shots, self.place, self.cart_m, self.config, self.least_s, THRIFTS, until)

    def _enters_s(self) -> Array:
        """Earliest end (weeds,) of a shot that serves each weed."""
        shots, arm = self.shots, self.arm
        ends = (shots.told_m[:, G.along] - shots.slack_m - arm.front_m - self.cart_m) / self._fastest_m_s
        return shots.least((np.maximum(ends, 0.0) + shots.stand_s)[shots.option_of_share()])

    def _priced(self, shots: Shots, found_n: float, found_v: float, seconds: float) -> tuple[float, float]:
        """Bounds on weeds killed and on the return at a steady speed.

        ``found_n`` and ``found_v`` are known to be reached, or NaN.
        """
        config, weights = self.config, self.config.weights
        second = -weights.seconds
        if not shots.weeds:
            return 0.0, self._idle
        speed = float(config.speed_m_s)
        place = shots.told_m, shots.aim_m, shots.slack_m, shots.stand_s, shots.track
        ride = self.cart_m, speed, self.arm.front_m, float(config.cart.moment_s), TICK_S, self._until_s + 1.0
        strip = Strip(*place, *ride, late_s(self.arm))
        move_s = self._moves_s(shots)
        first, to, option, wait, end_s, start = build(self.arm, strip, move_s)
        share_first = np.append(shots.share_first, shots.share_first[-1])
        graph = Timeline(first, to, option, wait, end_s, start, share_first, shots.share_weed, shots.share)
        each = shots.option_of_share()
        guess = shots.least((shots.stand_s + move_s)[each] / shots.share)
        guess[~shots.whole] = FREE_S
        cost, advance = np.append(shots.cost, 0.0), np.append(shots.advance, 0.0)
        # With any reports nearly everything can be killed: there is little to search for.
        rounds = HOPED_ROUNDS if shots is self.hoped else ROUNDS if self.drawn else FEW_ROUNDS
        no_end = np.zeros(len(end_s))
        end = -second * np.maximum(end_s, self.least_s)
        # Where time is not short a weed's price is what its shot costs; else so much more as its seconds are worth.
        gain = shots.worth * weights.killed
        free = shots.least(np.maximum(shots.due(weights.killed), 0.0)[each] / shots.share)
        free[~shots.whole] = gain[~shots.whole]
        least = shots.least(shots.cost[each] / shots.share)
        least[~shots.whole] = 0.0
        energy, scarce_j = np.append(shots.energy_j, 0.0), float(config.scenario.energy_j)
        most_n = most_v = math.inf
        # Nobody may spend more than there is: at any price of a joule a schedule pays at most for all of it.
        for price in THRIFTS if scarce_j > 0.0 else (0.0,):
            spent, all_j = price * energy, price * scarce_j
            lowest, limits = found_n - all_j, {"rounds": rounds, "time_limit_s": seconds, "whole": shots.whole}
            kills = priced(graph, shots.worth, spent + advance, no_end, guess, found=lowest, **limits)
            most_n = min(most_n, kills.bound + all_j)
            spent, all_j = weights.killed * spent, weights.killed * all_j
            paid = cost + spent + weights.killed * advance
            short = weights.killed * kills.prices + least
            value = priced(graph, gain, paid, end, guess, found=found_v - all_j, begin=short, beside=free, **limits)
            most_v = min(most_v, value.bound + all_j)
        return most_n, most_v

    def _moves_s(self, shots: Shots) -> Array:
        """No way (J,) to an option is shorter."""
        return self.move_s if shots is self.shots else shortest(self.arm, self.config, shots)

    def _hoped_work(self, shots: Shots) -> tuple[float, float]:
        """``_most_work`` and ``_largest_return`` of means: of each track the best mode at a price of its seconds."""
        weights, config = self.config.weights, self.config
        second, track = -weights.seconds, shots.share_weed[shots.share_first[:-1]]
        moves_s = self._moves_s(shots)
        seconds, first_s = shots.stand_s + moves_s, float(moves_s.max(initial=0.0))
        limit_s = config.time_limit_s + self.longest_s + late_s(self.arm) + first_s

        def best(value: Array) -> float:
            most = np.zeros(shots.weeds)
            np.maximum.at(most, track, value)
            return float(most.sum())

        kills = shots.brought()
        most_n = min(best(kills - price * seconds) + price * limit_s for price in np.linspace(0.0, 2.0, 21))
        value = weights.killed * kills - shots.cost
        most_v = min(
            best(value - second * part * seconds) + second * (part * first_s - (1.0 - part) * self.least_s)
            for part in np.linspace(0.0, 1.0, 21)
        )
        return most_n, most_v

    def _times_s(self) -> Array:
        """Least work and way (weeds,) of each weed where the speed is free."""
        return self.shots.least_split(self.shots.stand_s + self.move_s)

    def _first_s(self) -> float:
        """The first way begins where the machine waits: it may be shorter than the others."""
        return float(self.move_s.max(initial=0.0))

    def _most_work(self) -> float:
        """Weeds that can be killed in the time allowed; the last decision may run over."""
        longest = self.longest_s + late_s(self.arm)
        spent = np.cumsum(np.sort(self._times_s())) - self._first_s()
        count = np.count_nonzero(spent <= self.config.time_limit_s + longest)
        return float(np.sort(self.shots.worth)[::-1][:count].sum())

    def _largest_return(self) -> float:
        """Bound on the return with a free speed: time is paid for as work or as the strip's length, part by part."""
        shots, weights = self.shots, self.config.weights
        second = -weights.seconds
        best = math.inf
        for part in np.linspace(0.0, 1.0, 11):
            each = shots.least_split(shots.cost + second * part * (shots.stand_s + self.move_s))
            value = float(np.maximum(weights.killed * shots.worth - each, 0.0).sum())
            best = min(best, value + second * (part * self._first_s() - (1.0 - part) * self.least_s))
        return best

    def _carried_out(self, bounds: Both | None, seconds: float) -> tuple[float, float]:
        """Weeds killed and return of the best schedules found that know what each shot does, carried out."""
        killed, shots = self.config.weights.killed, self.shots
        value, second = -shots.cost - killed * shots.advance, -self.config.weights.seconds
        guides = [(unguided(), unguided())] if bounds is None else []
        if bounds is None and shots.weeds and not self.config.speed_control:
            # An arm that leans may take longer than these prices reckon with, so they bound nothing, but show the way.
            until = time.perf_counter() + seconds
            bounds = both(self.arm, shots, self.place, self.cart_m, self.config, self.least_s, (0.0,), until, HINTS)
        if bounds is not None:
            guides.append((bounds.kills.guide, bounds.value.guide))
        found = []
        for of_kills, of_value in guides:
            found.append(self._grown(shots, -shots.advance, shots.worth, of_kills, 0.0))
            found.append(self._grown(shots, value, killed * shots.worth, of_value, second))
        results = [tended(self.core, shots, order, blocks) for order, blocks, _ in found]
        return max(kills for kills, _ in results), max(value for _, value in results)

    def _grown(
        self, shots: Shots, value: Array, gain: Array, guide: Guide, second: float
    ) -> tuple[Numbers, Numbers, float]:
        """Options and blocks of the best sequence found, each option worth its ``value`` and its shares of ``gain``."""
        if not len(shots.track):
            return np.zeros(0, np.int64), np.zeros(0, np.int64), 0.0
        config, cart, scarce_j = self.config, self.config.cart, float(self.config.scenario.energy_j)
        garden = Garden(
            arm=self.arm,
            place=self.place,
            cart_m=self.cart_m,
            speed_m_s=float(config.speed_m_s),
            notch_m_s=float(cart.notch_m_s) if config.speed_control else 0.0,
            speed_range_m_s=(float(cart.speed_range_m_s[0]), float(cart.speed_range_m_s[1])),
            acceleration_m_s2=float(cart.acceleration_m_s2),
            # At a steady speed all take the same.
            second=second if config.speed_control else 0.0,
            limit_s=float(config.time_limit_s),
            front_m=float(self.arm.front_m),
            moment_s=float(cart.moment_s),
            until_m=self.cart_m + self._until_s * float(config.speed_m_s),
            track=shots.track,
            told_m=shots.told_m,
            aim_m=shots.aim_m,
            stand_s=shots.stand_s,
            value=value,
            share_first=shots.share_first,
            share_thing=shots.share_weed,
            share=shots.share,
            gain=gain,
            whole=shots.whole,
            energy_j=shots.energy_j,
            budget_j=scarce_j if scarce_j > 0.0 else math.inf,
            guide=guide,
        )
        return grown(garden, WIDTH, BUCKET_S * float(config.speed_m_s))


def instance_of(core: Any, reports: str = "drawn", row: int = 0) -> WeedingInstance:
    """What stands in a world of the rules right after its reset.

    Args:
        core: the rules.
        reports: ``"drawn"``: the tracks are those that lie in ``core``; ``"driven"``: the same, and the tool strays a
            little; ``"any"``: whatever the cameras report.
        row: the world.

    Raises:
        ValueError: the episode is under way, ``reports`` is unknown, or the ground shakes the tool.
    """
    state, tables, config, arm = state_of(core), core.tables, core.config, core.machine
    if config.scenario.ground.uneven:
        raise ValueError(
            f"scenario.ground.iso_class = {config.scenario.ground.iso_class!r}: no bound is known where the ground "
            'moves the tool, take a scenario whose ground is "none" and has no second_motion, slip or wander'
        )
    check_start(reports, state.totals[row, T.time] > 0.0)
    fastest = float(config.cart.speed_range_m_s[1]) if config.speed_control else float(config.speed_m_s)
    cart = float(state.cart[row])
    least_s = (tables.end_m - tables.blind_m - cart) / fastest
    if reports == "any":
        shots = any_shots(core, row)
        words = "any reports and any number of tracks a weed"
    else:
        shots = drawn_shots(core, row, 0.0 if reports == "drawn" else STRAY_M)
        n = int(state.track_count[row])
        tracks = np.maximum((state.track_report[row, :n, G.along] - arm.front_m - cart) / fastest, 0.0)
        # The episode goes on until every track has been shot at or has left.
        least_s = max(least_s, float(tracks.max(initial=0.0)) + float(tables.stand_s.min()))
        words = "tracks as drawn" if reports == "drawn" else "tracks as drawn, the tool strays"
    hoped = None
    if reports != "any":
        perception = core.perception
        hoped = hoped_shots(core, row, outcomes_of(config, perception, core.process))
    return WeedingInstance(
        shots=shots,
        arm=arm,
        longest_s=float(tables.stand_s.max()),
        move_s=shortest(arm, config, shots),
        drawn=reports != "any",
        weeds=int(state.weeds[row]),
        worth=float(state.worth[row]),
        place=state.place[row].copy(),
        cart_m=cart,
        least_s=max(least_s, 0.0),
        core=core if reports == "drawn" and core.worlds == 1 else None,
        config=config,
        words=words,
        hoped=hoped,
    )
