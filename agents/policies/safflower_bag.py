"""Policies for the picker where its bag fills up and heads wilt: a rule that takes what wilts first, and a planner."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ...envs.safflower.config import EFFORTS, STAGES, PerceptionModel, SafflowerConfig
from ...envs.safflower.features import (
    ACROSS_SCALE_M,
    AHEAD_SCALE_M,
    CLOSES_SCALE_S,
    DC,
    DM,
    HEIGHT_SCALE_M,
    LIMIT,
    TRAVEL_SCALE_S,
    C,
    M,
    candidate_table,
)
from ...envs.safflower.rules import EMPTYING
from ...envs.safflower.timing import DRIVE, P, Rates, beside_s, levels_s, settling_s, standing_s
from ...envs.safflower.wilting import last_closing_s
from ...kernels import bind, compiled
from .base import Actions, Observation
from .safflower import NORMAL, GramsPerSecond, decided, demanding, wanted
from .search import NOTHING, Step, Taken, search, within

Array = NDArray[np.float64]

DEPTH, WIDTH = 8, 40
"""Longest sequence that the planner grows, and how many of each length it keeps."""
PRICE = 0.03
"""What a second costs for every stop that lies ahead, in what picking earns on average."""
BURDEN = 0.3
"""What a bag that is left full costs, in grams of reward; less where few heads are left to pick."""
FEW = 6.0
"""Heads that are few; a stop ahead is thought to hold at least as many."""
_ODD = 1e-6
"""Readings so far from all heads of their stage are those of no head."""
_EXACT_S = 1.0
"""Spread of times that are told exactly."""
_UNREAD_S = 1e5
"""The same where nothing is read, as with a camera that renders: any time of the stage is as likely."""
MOVE_S = 1.5
"""Way from head to head and wait for the cart that the estimate reckons with [assumed by the planner]."""


class ClosingFirst(GramsPerSecond):
    """The open head that wilts soonest of those that can still be done in time, normal effort; a full bag is emptied.

    Where nothing wilts it is the fixed order.
    """

    name = "closing-first"

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        open_heads = wanted(observation)
        if not demanding(observation):
            return decided(observation, open_heads.argmax(axis=1), NORMAL, open_heads.any(axis=1))
        candidates = candidate_table(observation)
        closes_s = candidates[..., DC.closes] * CLOSES_SCALE_S
        done_s = candidates[..., C.travel] * TRAVEL_SCALE_S + self._process_s[NORMAL]
        feasible = open_heads & (closes_s >= done_s)
        slot = np.where(feasible, closes_s, np.inf).argmin(axis=1)
        return decided(observation, slot, NORMAL, feasible.any(axis=1))


class Picks(NamedTuple):
    """What can be picked from stops in B worlds; K candidates in the order in which they wilt, then the bag.

    Attributes:
        rates: of the machine's motions.
        work_s: (E,), seconds at a head.
        empty_s: seconds that emptying the bag takes.
        bag_g: what fills the bag, infinite where nothing does.
        clog: (E,), share of what each effort gets with an empty bag that a full one lets drop.
        read_s: standard deviation of what is read of the time at which a head wilts.
        price: (B,), of a second.
        burden: (B,), what a full bag costs at the end of a sequence, in proportion to its fill.
        place: (B, K, 2), of the candidates along from the machine and across, metres.
        descent_s: (B, K), down to them.
        closes_s: (B, K), seconds until they are read to wilt.
        late: (B, K), share of the readings' law that lies before the last heads of their stage wilt.
        within: (B, K), share of it between the first and the last ones.
        worth: (B, K, E), of what picking them brings with an empty bag, time not counted.
        loss: (B, K, E), what a full bag takes off that.
        grams: (B, K, E), what comes into the bag.
        open: (B, K), whether they are worth a look.
    """

    rates: Rates
    work_s: Array
    empty_s: float
    bag_g: float
    clog: Array
    read_s: float
    price: Array
    burden: Array
    place: Array
    descent_s: Array
    closes_s: Array
    late: Array
    within: Array
    worth: Array
    loss: Array
    grams: Array
    open: NDArray[np.bool_]


@compiled
def unwilted(problem: Picks, w: int, candidate: int, done_s: float) -> float:
    """Chance that a candidate has not wilted by a time: normal about the reading, between first and last heads."""
    before = normal((done_s - problem.closes_s[w, candidate]) / problem.read_s)
    return min(max((problem.late[w, candidate] - before) / problem.within[w, candidate], 0.0), 1.0)


@compiled
def normal(sigmas: float) -> float:
    """Share of the normal law below so many standard deviations."""
    return 0.5 * math.erfc(-sigmas * math.sqrt(0.5))


@compiled
def extend(
    problem: Picks,
    w: int,
    x: float,
    y: float,
    z: float,
    clock_s: float,
    candidate: int,
    option: int,
    taken: Taken,
    first: bool,
) -> Step:
    """One more pick, or the bag emptied; ``x`` and ``y`` are along and across, ``z`` is what is in the bag."""
    if candidate == problem.open.shape[1]:
        relief = problem.burden[w] * (z / problem.bag_g)
        return Step(x, y, 0.0, clock_s + problem.empty_s, relief, option == 0 and z > 0.0)
    if not problem.open[w, candidate] or z >= problem.bag_g:
        return Step(x, y, z, clock_s, 0.0, False)
    along, across = problem.place[w, candidate, 0], problem.place[w, candidate, 1]
    descent_s = problem.descent_s[w, candidate]
    move_s = beside_s(problem.rates, along - x, across - y) + settling_s(problem.rates, along - x)
    done_s = clock_s + move_s + descent_s + problem.work_s[option]
    chance = unwilted(problem, w, candidate, done_s)
    if not chance > 0.0:
        return Step(x, y, z, clock_s, 0.0, False)
    full = z / problem.bag_g
    gain = chance * (problem.worth[w, candidate, option] - full * problem.loss[w, candidate, option])
    grams = chance * problem.grams[w, candidate, option] * (1.0 - problem.clog[option] * full)
    gain -= problem.burden[w] * (grams / problem.bag_g)
    # The tool rises from here whatever comes next.
    return Step(along, across, z + grams, done_s + descent_s, gain, True)


@compiled
def prospect(problem: Picks, w: int, clock_s: float, taken: Taken, last: int) -> float:
    """Value of the others, picked in the order in which they wilt where they pay, less the price of all the time."""
    worth, price = -problem.price[w] * clock_s, problem.price[w]
    for j in range(problem.open.shape[1]):
        if not problem.open[w, j] or taken.used >> j & 1:
            continue
        each_s = MOVE_S + 2.0 * problem.descent_s[w, j] + problem.work_s[NORMAL]
        each_s += problem.empty_s * problem.grams[w, j, NORMAL] / problem.bag_g
        chance = unwilted(problem, w, j, clock_s + each_s)
        gain = chance * (problem.worth[w, j, NORMAL] - 0.5 * problem.loss[w, j, NORMAL]) - price * each_s
        if gain > 0.0:
            worth += gain
            clock_s += each_s
    return worth


bind(Picks, extend, prospect)


class BagHorizon(GramsPerSecond):
    """The first decision of the best sequence of picks and emptyings that a beam search finds for this stop.

    A pick is worth its expected grams, less what the bag as full as it is lets drop, times the chance that the head has
    not wilted by the time it is done; a second costs a share of what picking earns while stops lie ahead. Where no
    sequence is worth its time the machine drives on. Where no bag fills up and nothing wilts it is ``GramsPerSecond``.
    """

    name = "bag-horizon"

    def __init__(
        self,
        config: SafflowerConfig,
        perception: PerceptionModel | None = None,
        depth: int = DEPTH,
        width: int = WIDTH,
        price: float = PRICE,
        burden: float = BURDEN,
        budget_ms: float | None = None,
    ):
        """Take the machine's numbers from the configuration.

        Args:
            config: the task's numbers.
            perception: the statistical camera; None where pictures are rendered.
            depth: longest sequence.
            width: sequences kept.
            price: see ``PRICE``.
            burden: see ``BURDEN``.
            budget_ms: wall milliseconds for a decision; the search is then as wide as it has time for, whatever
                ``width``.
        """
        super().__init__(config, perception)
        self.config, self._depth, self._width, self._ahead, self._burden = config, depth, width, price, burden
        self._budget_ms = budget_ms
        standing = standing_s(config)[:DRIVE]
        self._work_s = standing[:, P.shear] + standing[:, P.suck] + standing[:, P.recognise]
        self._rates = Rates.of(config)
        exact = perception == PerceptionModel.perfect()
        read_s = _EXACT_S if exact else max(float(config.scenario.wilting.read_sigma_s), _EXACT_S)
        self._read_s = _UNREAD_S if perception is None else read_s

    @classmethod
    def make(cls, env: Any, seed: int, **settings: Any) -> Any:
        """The policy for an environment, which tells its camera."""
        core = env.unwrapped.core
        return cls(core.config, core.perception, **settings)

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        if not demanding(observation):
            return super().act(observation)
        problem, order = self.problem(observation)
        machine, slots = observation["machine"].astype(np.float64), order.shape[1]
        start = np.zeros((len(order), 3))
        start[:, 1] = machine[:, M.across] * ACROSS_SCALE_M
        start[:, 2] = self._filled_g(machine)
        count = np.full(len(order), slots + 1)
        idle = np.zeros(len(order))

        def plan(width: int) -> NDArray[np.int64]:
            return search(problem, start, idle, len(EFFORTS), count, self._depth, width)

        found = plan(self._width) if self._budget_ms is None else within(self._budget_ms, plan)
        candidate, effort = np.divmod(np.maximum(found, 0), len(EFFORTS))
        slot = np.take_along_axis(order, np.minimum(candidate, slots - 1)[:, None], axis=1)[:, 0]
        other = np.where(found == NOTHING, 0, EMPTYING)
        picks = (found != NOTHING) & (candidate < slots)
        return np.where(picks, slot * len(EFFORTS) + effort, slots * len(EFFORTS) + other)

    def expected(self, observation: Observation, actions: Actions) -> Array:
        """Grams (B,) that picks are expected to bring."""
        if not demanding(observation):
            return super().expected(observation, actions)
        problem, order = self.problem(observation)
        machine, grams = observation["machine"].astype(np.float64), np.zeros(len(order))
        slot, effort = np.divmod(actions, len(EFFORTS))
        for w in np.flatnonzero(slot < order.shape[1]).tolist():
            bag_g, across_m = float(self._filled_g(machine[w])), machine[w, M.across] * ACROSS_SCALE_M
            candidate = int(np.flatnonzero(order[w] == slot[w])[0])
            step = extend(problem, w, 0.0, across_m, bag_g, 0.0, candidate, int(effort[w]), Taken(0, 0, 0), True)
            grams[w] = step.z - bag_g
        return grams

    def problem(self, observation: Observation) -> tuple[Picks, NDArray[np.int64]]:
        """What the search works on, and the slot (B, K) behind each candidate."""
        config, scenario = self.config, self.config.scenario
        table, machine = candidate_table(observation).astype(np.float64), observation["machine"].astype(np.float64)
        order = np.argsort(table[..., DC.closes], axis=1, kind="stable")
        table = np.take_along_axis(table, order[..., None], axis=1)
        open_heads = np.take_along_axis(wanted(observation), order, axis=1)
        relative, weights = self.belief.mass(table)[..., None], config.weights
        grams, mass = relative * self._grams, relative * config.head_mass_g
        # What a pick does not bring in is lost.
        worth = weights.collected_g * grams + weights.lost_g * (mass - grams)
        clog = self.belief.clog
        loss = (weights.collected_g - weights.lost_g) * clog * grams
        level_m = table[..., C.height] * HEIGHT_SCALE_M + self._rates.clear_m
        descent_s = levels_s(self._rates, level_m.ravel()).reshape(level_m.shape)
        closes_s = table[..., DC.closes] * CLOSES_SCALE_S
        closes_s = np.where(table[..., DC.closes] >= LIMIT, 1e9, closes_s)
        late, within = self._closing_shares(table, machine, closes_s)
        ahead = np.rint(machine[:, M.stops_left] * scenario.stops)
        price = self._price + self._ahead * self._average * ahead
        problem = Picks(
            rates=self._rates,
            work_s=self._work_s,
            empty_s=float(scenario.bag.empty_s),
            bag_g=self._bag_g,
            clog=clog,
            read_s=self._read_s,
            price=price,
            burden=self._burden * np.minimum(open_heads.sum(axis=1) / FEW + ahead, 1.0),
            place=np.stack([table[..., C.along] * AHEAD_SCALE_M, table[..., C.across] * ACROSS_SCALE_M], axis=-1),
            descent_s=descent_s,
            closes_s=closes_s,
            late=late,
            within=within,
            worth=worth,
            loss=loss,
            grams=grams,
            open=open_heads,
        )
        return problem, order

    def _closing_shares(self, table: Array, machine: Array, closes_s: Array) -> tuple[Array, Array]:
        """``Picks.late`` and ``Picks.within`` of candidates (B, K, F) that are read to wilt at these times (B, K)."""
        now_s = machine[:, M.time, None] * self.config.scenario.time_limit_s
        last_s = table[..., C.bud : C.bud + len(STAGES)] @ last_closing_s(self.config)
        late = ndtr((last_s - now_s - closes_s) / self._read_s)
        early = ndtr((self.config.scenario.wilting.closes_s[0] - now_s - closes_s) / self._read_s)
        # What never wilts, or is read to wilt when nothing does, wilts about as it is read.
        odd = (closes_s >= 1e9) | (late - early < _ODD)
        return np.where(odd, 1.0, late), np.where(odd, 1.0, late - early)

    @property
    def _bag_g(self) -> float:
        capacity_g = self.config.scenario.bag.capacity_g
        return float(capacity_g) if capacity_g > 0.0 else np.inf

    def _filled_g(self, machine: Array) -> Array:
        """What is in the bag, of machines (..., features); nothing where there is none."""
        return machine[..., DM.bag] * (self._bag_g if np.isfinite(self._bag_g) else 0.0)
