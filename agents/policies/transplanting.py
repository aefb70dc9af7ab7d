"""Scripted rules for the tray transplanter."""

from __future__ import annotations

from itertools import combinations, pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

from ...envs.transplanting.columns import MOVE_SCALE_S, C, W, candidate_table
from ...envs.transplanting.config import SPEEDS, PerceptionModel, TransplantingConfig
from ...envs.transplanting.timing import CLEARING, STRAIGHT, times
from .base import Actions, ConfiguredPolicy, Observation
from .dispatch import PLANT, Dispatch, EarliestDue, InLine, OneLine, Richest, wants_second
from .routes import held_karp
from .tray_belief import Gains, TrayBelief

Array = NDArray[np.float64]

NORMAL = SPEEDS.index("normal")


def wanted(observation: Observation) -> NDArray[np.bool_]:
    """Pairs (B, K) that are possible and whose source cell is reported to hold what the target cell is to hold."""
    table = candidate_table(observation)
    return (table[..., C.present] > 0.0) & (table[..., C.source_poor] == wants_second(observation)[:, None])


class _Rule(ConfiguredPolicy):
    """A pair of the presented rows while there is one worth planting, else the conveyor that brings the next one."""

    chooses_speed = True
    dispatch: type[Dispatch] = InLine

    def __init__(self, config: TransplantingConfig, perception: PerceptionModel | None = None):
        """Take the machine's times and the plugs' chances from the configuration, cells' from the cameras too."""
        self.belief = TrayBelief(config, perception)
        self._dispatch = (self.dispatch if config.scenario.orders.on else OneLine)(config, self.belief)
        scenario, self._weights = config.scenario, config.weights
        self._times = times(config)
        self._carry_s = np.ascontiguousarray(self._times.carry[..., W.s])
        self._n, self._m = scenario.source.columns, scenario.target.columns

    @classmethod
    def make(cls, env: Any, seed: int) -> Any:
        """The policy for an environment; the factory under which it is registered."""
        core = env.unwrapped.core
        return cls(core.config, core.perception)

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        pairs = wanted(observation)
        move = self._dispatch.moves(observation, pairs)
        there = move == PLANT
        chosen = np.where(there, self._choose(observation, pairs), 0)
        index = observation["action_mask"].shape[1] + move
        return np.where(there, chosen * len(SPEEDS) + self._speed(observation, chosen), index)

    def expected(self, observation: Observation, actions: Actions) -> Array:
        """Cells (B,) that transplants are expected to fill with what they are to hold."""
        plants = actions < len(SPEEDS) * self._n * self._m
        gains = self._gains(observation, np.where(plants, actions // len(SPEEDS), 0))
        return np.where(plants, gains.cells[np.arange(len(actions)), actions % len(SPEEDS)], 0.0)

    def _gains(self, observation: Observation, pair: NDArray[np.int64]) -> Gains:
        """What pairs (B,) bring on average at each speed."""
        clear = np.take_along_axis(candidate_table(observation)[..., C.clear], pair[:, None], axis=1)[:, 0] > 0.0
        return self.belief.gains(observation, wants_second(observation) > 0.0, clear)

    def _choose(self, observation: Observation, pairs: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Pair (B,) out of ``pairs`` (B, K); worlds without one may get anything."""
        raise NotImplementedError

    def _approach_s(self, observation: Observation) -> Array:
        """Seconds (B, K) until the tool has gripped each pair's plug."""
        table = candidate_table(observation)
        clearing = self._times.handle_s * table[..., C.clear]
        return table[..., C.approach].astype(np.float64) * MOVE_SCALE_S + clearing

    def _speed(self, observation: Observation, pair: NDArray[np.int64]) -> NDArray[np.int64] | int:
        """Speed (B,) with the highest expected value per second of the cycle."""
        if not self.chooses_speed:
            return NORMAL
        approach = np.take_along_axis(self._approach_s(observation), pair[:, None], axis=1)
        seconds = approach + self._times.handle_s + self._carry_s[:, pair].T
        gains = self._gains(observation, pair)
        value = self._weights.planted * gains.cells + self._weights.spoiled * gains.spoiled
        return (value / seconds).argmax(axis=1)


class FixedOrder(_Rule):
    """The common sequence: the first seedling of the row into the first gap, normal speed."""

    name, chooses_speed = "fixed-order", False

    def _choose(self, observation: Observation, pairs: NDArray[np.bool_]) -> NDArray[np.int64]:
        return pairs.argmax(axis=1)


class FixedOrderChosenSpeed(FixedOrder):
    """The common sequence at the speed with the highest expected value per second."""

    name, chooses_speed = "fixed-order-speed", True


class Nearest(_Rule):
    """The seedling that the tool reaches soonest, into the gap that is nearest to it."""

    name = "nearest"

    def _choose(self, observation: Observation, pairs: NDArray[np.bool_]) -> NDArray[np.int64]:
        carry = self._carry_s[NORMAL]
        key = 1e3 * np.round(self._approach_s(observation), 6) + carry
        return np.where(pairs, key, np.inf).argmin(axis=1)


class ShortestCycle(_Rule):
    """The pair with the shortest cycle: approach, clearing where it is due, and carrying."""

    name = "shortest-cycle"

    def _choose(self, observation: Observation, pairs: NDArray[np.bool_]) -> NDArray[np.int64]:
        seconds = self._approach_s(observation) + self._carry_s[NORMAL]
        return np.where(pairs, seconds, np.inf).argmin(axis=1)


class _Problem(NamedTuple):
    """One world's presented rows.

    Attributes:
        sources: columns of the usable seedlings, ascending.
        gaps: columns of the target cells to fill, ascending.
        first_s: (sources, gaps), seconds of a pair when it comes first: approach, clearing and carrying.
        next_s: (gaps, sources, gaps), seconds of a pair that follows one that ended in that gap.
    """

    sources: NDArray[np.int64]
    gaps: NDArray[np.int64]
    first_s: Array
    next_s: Array


class _Sequence(_Rule):
    """A rule that plans a sequence of pairs over the presented rows and carries out its first one."""

    def _choose(self, observation: Observation, pairs: NDArray[np.bool_]) -> NDArray[np.int64]:
        approach = self._approach_s(observation)
        clear = candidate_table(observation)[..., C.clear] > 0.0
        chosen = np.zeros(len(pairs), np.int64)
        for row in np.flatnonzero(pairs.any(axis=1)):
            problem = self._problem(approach[row], clear[row], pairs[row])
            source, gap = self._sequence(problem)[0]
            chosen[row] = problem.sources[source] * self._m + problem.gaps[gap]
        return chosen

    def _sequence(self, problem: _Problem) -> list[tuple[int, int]]:
        """Pairs (index of the source, index of the gap) in order."""
        raise NotImplementedError

    def _problem(self, approach: Array, clear: NDArray[np.bool_], pairs: NDArray[np.bool_]) -> _Problem:
        n, m = self._n, self._m
        grid = pairs.reshape(n, m)
        sources, gaps = np.flatnonzero(grid.any(axis=1)), np.flatnonzero(grid.any(axis=0))
        both = np.ix_(sources, gaps)
        carry = self._carry_s[NORMAL].reshape(n, m)[both]
        cleared = clear.reshape(n, m)[both][0].astype(np.int64)
        approach_s = self._times.approach[..., W.s].reshape(2, -1, n, m)
        after = approach_s[:, n + gaps][:, :, sources][..., gaps]
        between = np.where(cleared > 0, after[CLEARING] + self._times.handle_s, after[STRAIGHT])
        return _Problem(sources, gaps, approach.reshape(n, m)[both] + carry, between + carry)


class Assignment(_Sequence):
    """Matches seedlings and gaps for the least time as a whole, then takes the matched pairs in the best order."""

    name = "assignment"

    def _sequence(self, problem: _Problem) -> list[tuple[int, int]]:
        # What a pair takes after an average predecessor; which one it will be is decided by the order.
        sources, gaps = linear_sum_assignment(problem.next_s.mean(axis=0))
        return best_order(problem.first_s, problem.next_s, list(zip(sources.tolist(), gaps.tolist(), strict=True)))


class EarliestDueFirst(Assignment):
    """``assignment`` that serves the order whose lorry leaves first; source trays are used up one after the other."""

    name, dispatch = "earliest-due", EarliestDue


class RichestTray(Assignment):
    """``earliest-due`` that brings the source tray whose waiting row is taken to have the most of what is wanted."""

    name, dispatch = "richest-tray", Richest


class TwoOpt(_Sequence):
    """The fixed order, mended until no reversal, no exchange of gaps and no other seedling makes the rows quicker."""

    name = "2-opt"

    def _sequence(self, problem: _Problem) -> list[tuple[int, int]]:
        count = min(len(problem.sources), len(problem.gaps))
        return mended(problem.first_s, problem.next_s, [(i, i) for i in range(count)])


def sequence_s(first_s: Array, next_s: Array, sequence: list[tuple[int, int]]) -> float:
    """Seconds of a sequence of pairs; see ``_Problem`` for the tables."""
    total = first_s[sequence[0]]
    for (_, gap), (source, after) in pairwise(sequence):
        total += next_s[gap, source, after]
    return float(total)


def best_order(first_s: Array, next_s: Array, pairs: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """The quickest order of a few pairs; see ``_Problem`` for the tables, ``routes.held_karp`` for how many."""
    sources, gaps = (np.array(column) for column in zip(*pairs, strict=True))
    times = np.zeros((len(pairs) + 1, len(pairs) + 1))
    times[0, 1:], times[1:, 1:] = first_s[sources, gaps], next_s[gaps[:, None], sources, gaps]
    return [pairs[index] for index in held_karp(times).tolist()]


def mended(first_s: Array, next_s: Array, sequence: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """A sequence that no 2-opt reversal, exchange of two pairs' gaps or change of a seedling or a gap shortens."""
    best, best_s = list(sequence), sequence_s(first_s, next_s, sequence)
    improved = True
    while improved:
        improved = False
        for trial in _neighbours(best, first_s.shape):
            trial_s = sequence_s(first_s, next_s, trial)
            if trial_s < best_s - 1e-9:
                best, best_s, improved = trial, trial_s, True
                break
    return best


def _neighbours(sequence: list[tuple[int, int]], size: tuple[int, ...]):
    for i, j in combinations(range(len(sequence)), 2):
        yield [*sequence[:i], *sequence[i : j + 1][::-1], *sequence[j + 1 :]]
        swapped = list(sequence)
        swapped[i], swapped[j] = (sequence[i][0], sequence[j][1]), (sequence[j][0], sequence[i][1])
        yield swapped
    for side in (0, 1):
        used = {pair[side] for pair in sequence}
        for other in sorted(set(range(size[side])) - used):
            for i, pair in enumerate(sequence):
                changed = (other, pair[1]) if side == 0 else (pair[0], other)
                yield [*sequence[:i], changed, *sequence[i + 1 :]]
