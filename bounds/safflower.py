"""Bounds for the safflower picker.

Full knowledge: where every head is, its mass and both its lucks, what the camera reports, every move's time. What a
pick brings is exact, since a head can be picked once; time is Lagrangian-relaxed (see ``stops``), the limit on shown
candidates is left out. Visits that bring nothing are left out: by the triangle inequality they never save time.
"""

from __future__ import annotations

import copy
import math
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..envs.safflower.batch import stop_centres
from ..envs.safflower.config import EFFORTS, SafflowerConfig
from ..envs.safflower.core import SafflowerCore
from ..envs.safflower.process import Shears, collected_share, cut_share, dropped_share
from ..envs.safflower.timing import DRIVE, P, legs_s, levels_s, standing_s
from .base import Bound, Expectation, Found, check_method, check_start, relative_gap
from .clogging import clogging
from .gatherer import Row, found, row_of
from .stops import EXACT_TARGETS, Array, Stop, largest, shortest_cycle
from .wilting import Closing, most

Numbers = NDArray[np.int64]
Share = Callable[[float, float], float]

HOPED = "cuts and suction by their means"
_LUCKS = 12
"""Nodes of the quadrature over a head's normal luck."""


@dataclass(frozen=True, eq=False)
class PickerInstance:
    """One field with its luck.

    Attributes:
        stops: what each stop offers; ``gain`` in grams, ``other`` what a pick loses, in reward.
        hoped: the same on average over both lucks of each head.
        config: the task's numbers.
        total_g: filaments of all open heads.
        already_s: time that has passed before the first decision.
        relaxed: what was left out, in words.
        exact: whether nothing was: every candidate of every stop fits into the slots.
    """

    stops: list[Stop]
    hoped: list[Stop]
    config: SafflowerConfig
    total_g: float
    already_s: float
    relaxed: str
    exact: bool

    @property
    def budget_s(self) -> float:
        """The last decision begins before this, counted from the first one."""
        return self.config.scenario.time_limit_s - self.already_s

    def worths(self, stops: list[Stop]) -> list[Array]:
        """Reward of every option of some stops, its time not counted, (n, E) a stop."""
        return [self.config.weights.collected_g * stop.gain + stop.other for stop in stops]

    def bound(self, method: str = "relaxation", time_limit_s: float = 60.0) -> Bound:
        """What no policy can beat; see ``Instance``.

        Raises:
            ValueError: unknown method, or a reward that pays for time spent.
        """
        check_method(method)
        second = -self.config.weights.seconds
        if second < 0.0:
            raise ValueError(f"weights.seconds = {-second}: the bound needs a reward that does not pay for time")
        began = time.perf_counter()
        gains, worths = [stop.gain for stop in self.stops], self.worths(self.stops)
        grams, proven_g = largest(self.stops, gains, self.budget_s, reach_end=False)
        value, proven_v = largest(self.stops, worths, self.budget_s, second)
        words = f"Lagrangian relaxation of time, routes exact up to {EXACT_TARGETS} heads a stop; {self.relaxed}"
        proven, gap = proven_g and proven_v, 0.0 if proven_g and proven_v else math.nan
        if method == "cp-sat" and not proven:
            from .cp_sat import solve

            solver_g, done_g, gap_g = solve(self.stops, gains, self.budget_s, 0.0, 0.5 * time_limit_s)
            solver_v, done_v, gap_v = solve(self.stops, worths, self.budget_s, second, 0.5 * time_limit_s)
            grams, value = min(grams, solver_g), min(value, solver_v)
            proven, gap, words = done_g and done_v, max(gap_g, gap_v), f"CP-SAT; {self.relaxed}"
        proven = proven and self.exact
        net_rate = min(grams / max(self.total_g, 1e-12), 1.0)
        cycle_s = self.cycle_time_at(net_rate)
        hoped_g, _ = largest(self.hoped, [stop.gain for stop in self.hoped], self.budget_s, reach_end=False)
        hoped_v, _ = largest(self.hoped, self.worths(self.hoped), self.budget_s, second)
        hope = Expectation(hoped_g / max(self.total_g, 1e-12), hoped_v, HOPED, False)
        found = Found(net_rate, value) if proven else None
        return Bound(net_rate, value, cycle_s, words, proven, gap, time.perf_counter() - began, hope, found)

    def cycle_time_at(self, net_rate: float) -> float:
        """Seconds that the cycle time cannot fall below with at least this net rate; infinite when it cannot be had."""
        return shortest_cycle(self.stops, net_rate * self.total_g, self.already_s)


@dataclass(frozen=True, eq=False)
class BagInstance(PickerInstance):
    """One field with its luck where a bag fills up or heads wilt.

    What a bag that fills up lets drop is paid for (see ``clogging``); emptying it takes its time for all filaments
    beyond the first bag.

    Attributes:
        closes_s: (n,) a stop, when each target wilts.
        least_g: (n, E) a stop, what each option brings at least; nothing where no bag fills up.
        clogs: (n, E) a stop, grams that it loses at least with each gram in the bag; of ``stops``, and of ``hoped``.
        most_g: a bag never holds more.
        core: the rules of this world, for decisions to be carried out, what these go by, and the reports of its heads;
            None where reports are not drawn.
    """

    closes_s: list[Array]
    least_g: list[Array]
    clogs: tuple[list[Array], list[Array]]
    most_g: float
    core: tuple[Any, Row, Numbers] | None

    def without_schedule(self) -> BagInstance:
        """Bounds alone: what is carried out besides is sought longer than these."""
        return replace(self, core=None)

    def bound(self, method: str = "relaxation", time_limit_s: float = 60.0) -> Bound:
        """What no policy can beat; see ``Instance``.

        Raises:
            ValueError: unknown method, or a reward that pays for time spent or for losses.
        """
        check_method(method)
        weights = self.config.weights
        if weights.seconds > 0.0 or weights.lost_g > weights.collected_g:
            raise ValueError("weights: the bound needs a reward that pays neither for time nor for losses")
        began = time.perf_counter()
        (known, hoped), second = self.clogs, -weights.seconds
        grams = self._most([stop.gain for stop in self.stops], 0.0, known)
        value = self._most(self.worths(self.stops), second, known)
        # What is emptied is known, what is gained is not.
        hoped_g = self._most([stop.gain for stop in self.hoped], 0.0, hoped)
        hoped_v = self._most(self.worths(self.hoped), second, hoped)
        hope = Expectation(hoped_g / max(self.total_g, 1e-12), hoped_v, HOPED, False)
        net_rate = min(grams / max(self.total_g, 1e-12), 1.0)
        words = f"shares of picks by the time they close, stops by dynamic programming; {self.relaxed}"
        cycle_s = self.cycle_time_at(net_rate)
        reached, gap = None, math.nan
        if self.core is not None:
            results = found(*self.core)
            reached = Found(max(g for g, _ in results) / max(self.total_g, 1e-12), max(v for _, v in results))
            gap = max(relative_gap(net_rate, reached.net_rate), relative_gap(value, reached.episode_return))
        return Bound(net_rate, value, cycle_s, words, gap == 0.0, gap, time.perf_counter() - began, hope, reached)

    def _most(self, worths: list[Array], second: float, clogs: list[Array]) -> float:
        """Largest sum of worths; the clock is set back by the emptying that the first bag does not need."""
        bag, weights, limit_s = self.config.scenario.bag, self.config.weights, self.config.scenario.time_limit_s
        back_s = bag.empty_s if any(least.any() for least in self.least_g) else 0.0
        over_s = max(max(stop.longest_s for stop in self.stops), bag.empty_s)
        begin_s = self.already_s - back_s
        # What a bag saves is what emptying it costs; so that brings as much as it costs, for as long as one likes.
        gram = weights.collected_g - weights.lost_g if second > 0.0 else 0.0
        clogged = clogging(clogs, self.least_g, second * back_s / gram if gram > 0.0 else 0.0)
        saved, all_s = gram * clogged.saved, limit_s + over_s - begin_s
        stops = []
        for stop, worth, least, cost, closes_s in zip(
            self.stops, worths, self.least_g, clogged.costs, self.closes_s, strict=True
        ):
            bags = least / self.most_g
            takes_s, worth = _takes_s(stop) + bag.empty_s * bags, worth - gram * cost + saved * bags
            if saved > 0.0:
                idle = np.full((1, worth.shape[1]), all_s)
                worth, takes_s = np.vstack([worth, second * idle]), np.vstack([takes_s, idle])
                closes_s = np.append(closes_s, begin_s + 2.0 * all_s)
            stops.append(Closing(worth, takes_s, closes_s, float(stop.leave_s.min())))
        return most(stops, begin_s, limit_s, over_s, second) + second * back_s


def instance_of(core: SafflowerCore, reports: str = "drawn", row: int = 0) -> PickerInstance:
    """What stands in a world of the rules right after its reset.

    Args:
        core: the rules.
        reports: ``"drawn"``: the camera's reports are those that lie in ``core``; else: whatever a camera may
            report, the tool may find every head without error and move to it as far as the shear hole allows.
        row: the world.

    Raises:
        ValueError: the episode is under way, or ``reports`` is unknown.
    """
    check_start(reports, core.state.head_visited[row].any() or core.state.stop[row] != 0)
    config = core.config
    read = _drawn if reports == "drawn" else _any
    offered = (read(core, row, stop, False) for stop in range(config.scenario.stops))
    stops, heads, tracks = map(list, zip(*offered, strict=True))
    hoped = [read(core, row, stop, True)[0] for stop in range(config.scenario.stops)]
    mass = core.state.head_mass_g[row]
    relaxed = "all candidates of a stop shown" if reports == "drawn" else "any reports, so no error and second visits"
    shown = int(np.diff(core.state.first[row]).max())
    exact = reports == "drawn" and shown <= config.slots
    if exact:
        relaxed = "every candidate fits into the slots"
    if not config.scenario.demanding:
        return PickerInstance(stops, hoped, config, float(mass.sum()), config.process.recognise_s, relaxed, exact)
    closes_s = [core.state.head_closes_s[row, here] for here in heads]
    begun = float(mass.sum()), config.process.recognise_s, relaxed, False
    bag, core_and_row = config.scenario.bag, None
    least = known = hoping = [np.zeros(stop.gain.shape) for stop in stops]
    if reports == "drawn":
        core_and_row = copy.deepcopy(core.world(row)), row_of(core, row, stops, heads, tracks), np.concatenate(tracks)
        if bag.capacity_g > 0.0:
            least, known, hoping = map(list, zip(*map(partial(_clogs, core, row), heads, tracks), strict=True))
    most_g = bag.capacity_g + float(mass.max(initial=0.0))
    return BagInstance(stops, hoped, config, *begun, closes_s, least, (known, hoping), most_g, core_and_row)


def _drawn(core: SafflowerCore, row: int, stop: int, mean: bool) -> tuple[Stop, Numbers, Numbers]:
    """A stop with the reports that lie in the rules, ``mean``: over the heads' lucks; heads behind them, and these."""
    tracks = np.arange(core.state.first[row, stop], core.state.first[row, stop + 1])
    head = core.state.track_head[row, tracks]
    target = core.state.track_target[row, tracks]
    error = core.state.head_position[row, head] - target
    odds = None if mean else core.state.head_odds[row, head]
    gain = _gains(core.config, error, core.state.head_mass_g[row, head], odds)
    use = core.state.track_legal[row, tracks] & (gain.max(axis=1) > 0.0)
    offered = _stop(core, stop, target[use], gain[use], core.state.head_mass_g[row, head][use], slack_m=0.0)
    return offered, head[use], tracks[use]


def _any(core: SafflowerCore, row: int, stop: int, mean: bool) -> tuple[Stop, Numbers, Numbers]:
    """A stop with every head that a report near its window could stand for, without error; these heads; no reports."""
    config, centre = core.config, stop_centres(core.config.scenario)
    slack = config.process.capture_radius_m
    along = core.state.head_position[row, :, 0] + core.frame[0]
    half = 0.5 * config.scenario.window_m
    low, high = centre[stop] - half - slack, centre[stop] + half + slack
    # The first and the last window take in what lies outside the row; a head near an edge counts at both stops.
    near = ((along >= low) | (stop == 0)) & ((along <= high) | (stop == len(centre) - 1))
    heads = np.flatnonzero(near & (core.state.head_mass_g[row] > 0.0))
    mass = core.state.head_mass_g[row, heads]
    gain = _gains(config, np.zeros((len(heads), 3)), mass, None if mean else core.state.head_odds[row, heads])
    offered = _stop(core, stop, core.state.head_position[row, heads], gain, mass, slack_m=slack)
    return offered, heads, np.zeros(0, np.int64)


def _takes_s(stop: Stop) -> Array:
    """Seconds (n, E) of every option, from wherever the machine may come."""
    return stop.process_s + stop.shortest_approach_s[:, None] if stop.targets else stop.process_s


def _clogs(core: SafflowerCore, row: int, heads: Numbers, tracks: Numbers) -> tuple[Array, Array, Array]:
    """Grams (n, E) that each effort brings into a full bag, and those that it loses at least with each gram in the bag.

    The last of these twice, with the luck that is drawn and on average.
    """
    bag, state = core.config.scenario.bag, core.state
    error, mass = state.head_position[row, heads] - state.track_target[row, tracks], state.head_mass_g[row, heads]

    def full(dropped: float, odds: float) -> float:
        return collected_share(dropped + (1.0 - dropped) * bag.clog, odds)

    def lost(dropped: float, odds: float) -> float:
        # By the fill, what drops is convex or concave, so it is no less than by one of the two ends.
        share = collected_share(dropped, odds)
        first = share * bag.clog / (odds * (1.0 - dropped) + dropped)
        return min(first, share - full(dropped, odds)) / bag.capacity_g

    odds, gains = state.head_odds[row, heads], partial(_gains, core.config, error, mass)
    return gains(odds, full), gains(odds, lost), gains(None, lost)


def _gains(
    config: SafflowerConfig, error: Array, mass: Array, odds: Array | None, share: Share = collected_share
) -> Array:
    """Grams (n, E) that each effort brings, with the heads' lucks (n, 2) or, without them, on average.

    Args:
        config: the task's numbers.
        error: (n, 3), of the tool at each head.
        mass: (n,), grams on it.
        odds: (n, 2), see ``Worlds``.
        share: what reaches the box of what is cut, by the share that drops on average and the head's luck.
    """
    process, shears = config.process, Shears.of(config.process)
    chance, luck = np.ones(1), np.ones((len(mass), 1, 2))
    if odds is not None:
        luck = odds[:, None]
    elif process.luck_logit > 0.0:
        normal, chance = np.polynomial.hermite_e.hermegauss(_LUCKS)
        chance, luck = chance / chance.sum(), np.exp(process.luck_logit * normal)[None, :, None] + np.zeros_like(luck)
    gains = np.empty((len(mass), len(EFFORTS)))
    for effort, (strokes, suction_s) in enumerate(zip(process.strokes, process.suction_s, strict=True)):
        dropped = dropped_share(process, suction_s)
        for head, ((along, across, up), grams) in enumerate(zip(error, mass, strict=True)):
            cut = [cut_share(shears, float(strokes), along, across, up, to_cut) for to_cut in luck[head, :, 0]]
            kept = [share(dropped, to_collect) for to_collect in luck[head, :, 1]]
            # The two lucks have nothing to do with each other.
            gains[head, effort] = grams * float(chance @ cut) * float(chance @ kept)
    return gains


def _stop(core: SafflowerCore, stop: int, target: Array, gain: Array, mass: Array, slack_m: float) -> Stop:
    """A stop with targets (n, 3); the machine may work up to ``slack_m`` beside them."""
    config, tables = core.config, core.tables
    begins = np.vstack([tables.look_pose[stop], target])
    # A tool that is held too high cuts less, not nothing: with any reports a descent may be left out.
    depth_s = levels_s(tables.rates, begins[:, 2]) if slack_m == 0.0 else np.zeros(len(begins))
    approach = legs_s(tables.rates, begins, target, 2.0 * slack_m, True) + depth_s[:, None] + depth_s[None, 1:]
    approach[0] = legs_s(tables.rates, begins[:1], target, slack_m, True)[0] + depth_s[1:]
    standing = standing_s(config)
    # The machine leaves the last stop by lifting its tool.
    leave = depth_s
    if stop + 1 < len(tables.look_pose):
        away = legs_s(tables.rates, begins, tables.look_pose[stop + 1 : stop + 2], slack_m, True)[:, 0]
        leave = away + depth_s + standing[DRIVE, P.recognise]
    work_s = standing[:DRIVE, P.recognise] + standing[:DRIVE, P.shear] + standing[:DRIVE, P.suck]
    process_s = np.tile(work_s, (len(target), 1))
    other = config.weights.lost_g * (mass[:, None] - gain) * (gain > 0.0)
    if slack_m > 0.0:
        # A head may be reported and picked again: two or more visits bring at most everything.
        process_s = np.hstack([process_s, 2.0 * process_s[:, :1]])
        gain, other = np.hstack([gain, mass[:, None]]), np.hstack([other, np.zeros((len(mass), 1))])
    return Stop(gain, other, process_s, approach, leave, routed=slack_m == 0.0)
