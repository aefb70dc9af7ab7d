"""Scripted rules for the produce sorter."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...envs.sorting.columns import (
    CANDIDATE,
    CYCLE_SCALE_S,
    PLACE_SCALE_M,
    TURN_SCALE_RAD,
    WAIT_SCALE_S,
    candidate_table,
)
from ...envs.sorting.config import REFERENCE_CYCLE_S, PerceptionModel, SortingConfig
from ...envs.sorting.odds import GRADE_COLUMNS, GRIP_LEVEL_M, Odds
from ...envs.sorting.reports import SWING_M
from ...envs.sorting.timing import Paces, approach_s, hold_s, stroke_s, way_s
from ...kernels import bind, compiled
from ...motion import QUINTIC
from .base import Actions, ConfiguredPolicy, Observation, StatelessPolicy
from .search import NOTHING, Step, Taken, search, within

Array = NDArray[np.float64]


def time_left_s(table: Array) -> Array:
    """Seconds (...) until candidates can no longer be gripped, from their features (F, ...)."""
    return WAIT_SCALE_S * table[CANDIDATE.slack] + table[CANDIDATE.approach]


class _Ranking(StatelessPolicy):
    """The possible item with the smallest key; waits where there is none."""

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        possible = observation["action_mask"][:, :-1] > 0
        key = np.where(possible, self._key(candidate_table(observation)), np.inf)
        return np.where(possible.any(axis=1), key.argmin(axis=1), possible.shape[1])

    def _key(self, table: NDArray[np.float32]) -> Array:
        """Key (B, K) of candidates (B, K, F); what stands in empty slots does not matter."""
        raise NotImplementedError


class Fifo(_Ranking):
    """The item that came first: the one farthest down the belt. What sorting cells without a planner do."""

    name = "fifo"

    def _key(self, table: NDArray[np.float32]) -> Array:
        return -table[..., CANDIDATE.along].astype(np.float64)


class EarliestDeadline(_Ranking):
    """The item that leaves the reach first, at its own yaw and tilt and its place across the belt."""

    name = "edf"

    def _key(self, table: NDArray[np.float32]) -> Array:
        return np.broadcast_to(np.arange(table.shape[1], dtype=np.float64), table.shape[:2])


class Nearest(_Ranking):
    """The item that the tool is over soonest."""

    name = "nearest"

    def _key(self, table: NDArray[np.float32]) -> Array:
        return table[..., CANDIDATE.approach] + WAIT_SCALE_S * table[..., CANDIDATE.wait].astype(np.float64)


class ShortestCycle(_Ranking):
    """The item that is in its bin soonest."""

    name = "shortest-cycle"

    def _key(self, table: NDArray[np.float32]) -> Array:
        return table[..., CANDIDATE.cycle].astype(np.float64)


class ValuePerSecond(_Ranking):
    """The highest expected value per second until it is in its bin."""

    name = "value-per-second"

    def _key(self, table: NDArray[np.float32]) -> Array:
        worth = table[..., CANDIDATE.value].astype(np.float64) * table[..., CANDIDATE.quality]
        return -worth / np.maximum(table[..., CANDIDATE.cycle], 1e-6)


class Picks(NamedTuple):
    """What can be gripped in B worlds with K slots; places in mechanism coordinates as they are now.

    Attributes:
        paces: what times depend on.
        hold_s: seconds from the approach's end to the lift's.
        price: what a second costs.
        bins: (4, 2), where each grade is let go.
        present: (B, K).
        possible: (B, K), whether it can be the next one.
        goal: (B, K), grade.
        gain: (B, K), what it is expected to bring.
        done_s: (B, K), until it is in its bin as the next one.
        along_m: (B, K), of the platform over it.
        across_m: (B, K), of the platform over it.
        first_m: (B, K), where an approach may end at the earliest.
        last_m: (B, K), and at the latest.
        turn_s: (B, K), seconds that turning from level takes.
        order: (B, K), the order in which what comes after a sequence is gripped.
    """

    paces: Paces
    hold_s: float
    price: float
    bins: Array
    present: NDArray[np.bool_]
    possible: NDArray[np.bool_]
    goal: NDArray[np.int64]
    gain: Array
    done_s: Array
    along_m: Array
    across_m: Array
    first_m: Array
    last_m: Array
    turn_s: Array
    order: NDArray[np.int64]


@compiled
def over_bin(problem: Picks, w: int, x: float, y: float, clock_s: float, candidate: int) -> tuple[float, bool]:
    """When the platform, level at ``x``, ``y`` at the clock's time, is over an item's bin with it; whether it can."""
    paces, least, first_m = problem.paces, problem.turn_s[w, candidate], problem.first_m[w, candidate]
    place = problem.bins[problem.goal[w, candidate]]
    v, pace, square_pace = paces.speed_m_s, paces.pace, paces.square_pace
    now, across = problem.along_m[w, candidate] + v * clock_s, problem.across_m[w, candidate]
    aside = across - y
    approach = approach_s(v, now, first_m, x, aside * aside, 0.0, pace, square_pace, least, 0.0)
    meet = max(now + v * approach, first_m)
    lifted_s = clock_s + max((meet - now) / v, approach) + problem.hold_s
    aside = place[1] - across
    carry = way_s(place[0] - meet - v * problem.hold_s, aside * aside, 0.0, pace, square_pace, least)
    return lifted_s + carry, meet <= problem.last_m[w, candidate]


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
    """Grip one more item; the platform is level over the item's bin after it, ``z`` and ``option`` mean nothing."""
    if not (problem.possible[w, candidate] if first else problem.present[w, candidate]):
        return Step(x, y, z, clock_s, 0.0, False)
    place, gain = problem.bins[problem.goal[w, candidate]], problem.gain[w, candidate]
    if first:
        return Step(place[0], place[1], z, problem.done_s[w, candidate], gain, True)
    over_s, possible = over_bin(problem, w, x, y, clock_s, candidate)
    return Step(place[0], place[1], z, over_s + problem.paces.release_s, gain, possible)


@compiled
def queue(problem: Picks, w: int, x: float, y: float, clock_s: float, used: int) -> tuple[float, float]:
    """What the others bring, gripped in ``order`` where they still can be, and when the last one is done."""
    worth = 0.0
    for candidate in problem.order[w]:
        if not used >> candidate & 1:
            step = extend(problem, w, x, y, 0.0, clock_s, candidate, 0, Taken(used, 0, 0), False)
            if step.possible:
                worth += step.gain
                x, y, clock_s = step.x, step.y, step.clock_s
    return worth, clock_s


@compiled
def prospect(problem: Picks, w: int, clock_s: float, taken: Taken, last: int) -> float:
    """What the others bring in the queue's order, less the price of all the time."""
    place = problem.bins[problem.goal[w, last]]
    worth, done_s = queue(problem, w, place[0], place[1], clock_s, taken.used)
    return worth - problem.price * done_s


bind(Picks, extend, prospect)


class PickPlanner(ConfiguredPolicy):
    """Base of policies that plan a few picks ahead with a beam search, carry out the first and plan again.

    Later picks start level over the bin of the one before.

    Args:
        config: the task's public numbers.
        depth: picks ahead.
        width: sequences kept at each depth.
        budget_ms: wall milliseconds for a decision; the search is then as wide as it has time for, whatever ``width``.
    """

    def __init__(self, config: SortingConfig, depth: int, width: int, budget_ms: float | None = None):
        """Take the machine's times from the configuration."""
        if depth < 1 or width < 1:
            raise ValueError(f"depth = {depth}, width = {width}: both must be at least 1")
        self._depth, self._width, self._budget_ms = depth, width, budget_ms
        self._paces, grip = Paces.of(config), config.grip
        self._turn_limits = config.machine.sorter.turn_rad_s, config.machine.sorter.turn_rad_s2
        down = config.machine.travel_level_m - GRIP_LEVEL_M
        self._hold_s = hold_s(stroke_s(down, self._paces.down_pace, self._paces.square_pace), grip.grip_s)
        self._bins = np.array(config.belt.bins_m, float)

    def gain(self, observation: Observation) -> Array:
        """What gripping each candidate (B, K) is expected to bring."""
        raise NotImplementedError

    def expected(self, observation: Observation, actions: Actions) -> Array:
        """What picks (B,) are expected to bring."""
        gain = self.gain(observation)
        worlds, k = gain.shape
        return np.where(actions < k, gain[np.arange(worlds), np.minimum(actions, k - 1)], 0.0)

    def _picks(self, observation: Observation, gain: Array, price: float) -> Picks:
        """What can be gripped, with what each item is expected to bring (B, K) and what a second costs."""
        table = np.moveaxis(candidate_table(observation), -1, 0).astype(np.float64)
        along, across = table[CANDIDATE.along] * PLACE_SCALE_M, table[CANDIDATE.across] * PLACE_SCALE_M
        last = along + self._paces.speed_m_s * time_left_s(table)
        turn_s = QUINTIC.duration_unchecked(table[CANDIDATE.turn] * TURN_SCALE_RAD, *self._turn_limits)
        return Picks(
            paces=self._paces,
            hold_s=self._hold_s,
            price=price,
            bins=self._bins,
            present=table[CANDIDATE.present] > 0.0,
            possible=observation["action_mask"][:, :-1] > 0,
            goal=np.argmax(table[GRADE_COLUMNS], axis=0),
            gain=gain,
            done_s=table[CANDIDATE.cycle] * CYCLE_SCALE_S,
            along_m=along,
            across_m=across,
            first_m=-(last + SWING_M + self._paces.speed_m_s * self._hold_s),
            last_m=last,
            turn_s=np.maximum(turn_s, self._paces.shortest_s),
            order=np.argsort(-along, axis=1, kind="stable"),
        )

    def _plan(self, problem: Any, picks: Picks, waiting: float = -np.inf) -> Actions:
        """First pick (B,) of the best sequence; waits where nothing is possible, or worth more than ``waiting``."""
        worlds, k = picks.present.shape
        idle = np.full(worlds, waiting)
        count = picks.present.sum(axis=1)
        start = np.zeros((worlds, 3))

        def plan(width: int) -> NDArray[np.int64]:
            return search(problem, start, idle, 1, count, self._depth, width)

        answer = plan(self._width) if self._budget_ms is None else within(self._budget_ms, plan)
        return np.where(answer == NOTHING, k, answer)


class RecedingHorizon(PickPlanner):
    """Counts what a sequence is expected to place and what the queue's order would still place after it.

    Less a price for all the time.

    Args:
        config: the task's public numbers.
        depth: picks ahead.
        width: sequences kept at each depth.
        by_value: count values instead of items.
        perception: statistics of the camera; None: those that ship with the package.
        budget_ms: see ``PickPlanner``.
    """

    name = "receding-horizon"

    def __init__(
        self,
        config: SortingConfig,
        depth: int = 7,
        width: int = 16,
        *,
        by_value: bool = False,
        perception: PerceptionModel | None = None,
        budget_ms: float | None = None,
    ):
        """See ``PickPlanner``."""
        super().__init__(config, depth, width, budget_ms)
        self._by_value, self._odds = by_value, Odds(config, perception or PerceptionModel.measured())
        mean = float(np.mean(self._odds.aligned * (config.produce.value if by_value else 1.0)))
        # Half of what work without pause earns, less a tenth for bad fits [of 0 to 1, on seeds 0-99]: items that no
        # camera has seen yet will want the time.
        self._price = 0.45 * mean / REFERENCE_CYCLE_S

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        picks = self._picks(observation, self.gain(observation), self._price)
        return self._plan(picks, picks)

    def gain(self, observation: Observation) -> Array:
        """See ``PickPlanner``."""
        table = candidate_table(observation).astype(np.float64)
        gain = self._odds.placed(table)
        return gain * table[..., CANDIDATE.value] if self._by_value else gain
