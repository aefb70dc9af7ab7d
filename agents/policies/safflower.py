"""Scripted rules for the safflower picker."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...envs.safflower.config import EFFORTS, OPEN_STAGES, PerceptionModel, SafflowerConfig
from ...envs.safflower.features import (
    ACROSS_SCALE_M,
    AHEAD_SCALE_M,
    DC,
    DM,
    TRAVEL_SCALE_S,
    C,
    M,
    candidate_table,
)
from ...envs.safflower.rules import EMPTYING
from ...envs.safflower.timing import DRIVE, P, Rates, legs_s, standing_s
from .base import Actions, ConfiguredPolicy, Observation, StatelessPolicy
from .picker_belief import PickerBelief
from .routes import open_route, shortest_route

NORMAL = EFFORTS.index("normal")
_OPEN = [C.bud + stage for stage in OPEN_STAGES]
_OPEN_SHARE = 0.4
"""Share of a plant's heads that are in bloom and seen on an average day [assumed by the rule]."""


def demanding(observation: Observation) -> bool:
    """Whether a bag fills up or filaments wilt."""
    return observation["machine"].shape[1] > len(M)


def wanted(observation: Observation) -> NDArray[np.bool_]:
    """Candidates (B, K) that can be reached, are reported to be in bloom and have not wilted yet."""
    candidates = candidate_table(observation)
    in_bloom = candidates[..., _OPEN].max(axis=-1) > 0.5
    if demanding(observation):
        # What a full bag forbids is wanted all the same.
        return (candidates[..., C.reachable] > 0.5) & in_bloom & (candidates[..., DC.closes] > 0.0)
    return (observation["action_mask"][:, : -1 : len(EFFORTS)] > 0) & in_bloom


def decided(observation: Observation, slot: NDArray[Any], effort: NDArray[Any] | int, picks: Any) -> Actions:
    """Actions (B,): pick in these slots with these efforts where ``picks``, else drive on; a full bag is emptied."""
    other = len(EFFORTS) * candidate_table(observation).shape[1]
    actions = np.where(picks, slot * len(EFFORTS) + effort, other)
    if demanding(observation):
        actions = np.where(picks & (observation["machine"][:, DM.bag] >= 1.0), other + EMPTYING, actions)
    return actions


class FixedOrder(StatelessPolicy):
    """The paper's way: every open head in the order in which the camera reports it, normal effort."""

    name = "fixed-order"

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        open_heads = wanted(observation)
        return decided(observation, open_heads.argmax(axis=1), NORMAL, open_heads.any(axis=1))


class Nearest(StatelessPolicy):
    """The open head that cart and arm reach soonest, normal effort."""

    name = "nearest"

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        open_heads = wanted(observation)
        travel = np.where(open_heads, candidate_table(observation)[..., C.travel], np.inf)
        return decided(observation, travel.argmin(axis=1), NORMAL, open_heads.any(axis=1))


class _Routes:
    """Routes through candidates by the machine's own move times."""

    def __init__(self, config: SafflowerConfig):
        """Take the machine's rates from the configuration."""
        self._rates = Rates.of(config)

    def first(
        self, observation: Observation, heads: NDArray[np.bool_], route: Callable[[NDArray[np.float64]], list[int]]
    ) -> NDArray[np.int64]:
        """First slot (B,) of a route through ``heads`` (B, K); 0 where there are none."""
        slot = np.zeros(len(heads), np.int64)
        for row in np.flatnonzero(heads.any(axis=1)).tolist():
            slots = np.flatnonzero(heads[row])
            slot[row] = slots[route(self._move_times(observation, row, slots))[0]]
        return slot

    def _move_times(self, observation: Observation, row: int, slots: NDArray[np.int64]) -> NDArray[np.float64]:
        """Seconds between the arm (index 0) and the candidates (1..n); rise and descent are the same in any order."""
        features = candidate_table(observation)[row, slots]
        across = observation["machine"][row, M.across]
        ahead = np.append(0.0, features[:, C.along]) * AHEAD_SCALE_M
        sideways = np.append(across, features[:, C.across]) * ACROSS_SCALE_M
        places = np.column_stack([ahead, sideways])
        return legs_s(self._rates, places, places, 0.0, False)


class NearestTwoOpt(ConfiguredPolicy):
    """The first head of an open route through all open heads at the stop: nearest neighbour mended by 2-opt moves."""

    name = "nearest-2opt"

    def __init__(self, config: SafflowerConfig):
        """Take the machine's rates from the configuration."""
        self._routes = _Routes(config)

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        open_heads = wanted(observation)
        slot = self._routes.first(observation, open_heads, open_route)
        return decided(observation, slot, NORMAL, open_heads.any(axis=1))


class GramsPerSecond(ConfiguredPolicy):
    """The soonest reached open head that is worth its time, with the effort that brings most for it.

    An effort is worth its expected grams less its seconds at a price: what the reward charges while the row can be
    finished in time, and what picking earns on average when it cannot, so that efforts shrink as time runs short.
    """

    name = "grams-per-second"

    def __init__(self, config: SafflowerConfig, perception: PerceptionModel | None = None):
        """Tabulate what each effort takes and what it is expected to bring."""
        self.belief = PickerBelief(config, perception)
        self._grams = config.head_mass_g * self.belief.shares
        standing = standing_s(config)[:DRIVE]
        self._process_s = standing[:, P.shear] + standing[:, P.suck] + standing[:, P.recognise]
        self._process_s = self._process_s + config.machine.settle_s
        self._price = abs(config.weights.seconds)
        self._average = float(np.max(self._grams / (self._process_s + 0.5 * TRAVEL_SCALE_S)))
        scenario = config.scenario
        self._head_share = (self._process_s[NORMAL] + 0.5 * TRAVEL_SCALE_S) / scenario.time_limit_s
        self._row_heads = scenario.plants * scenario.mean_heads * (1.0 if scenario.potted else _OPEN_SHARE)

    @classmethod
    def make(cls, env: Any, seed: int) -> Any:
        """The policy for an environment; the factory under which it is registered."""
        core = env.unwrapped.core
        return cls(core.config, core.perception)

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        surplus, travel_s, worth = self._weigh(observation)
        slot = self._next(observation, travel_s, worth)
        effort = surplus[np.arange(len(slot)), slot].argmax(axis=-1)
        return decided(observation, slot, effort, worth.any(axis=1))

    def expected(self, observation: Observation, actions: Actions) -> NDArray[np.float64]:
        """Grams (B,) that picks are expected to bring."""
        candidates = candidate_table(observation)
        slots = candidates.shape[1]
        slot, effort = np.minimum(actions // len(EFFORTS), slots - 1), actions % len(EFFORTS)
        grams = self.belief.mass(candidates[np.arange(len(slot)), slot]) * self._grams[effort]
        return np.where(actions < slots * len(EFFORTS), grams, 0.0)

    def _next(self, observation: Observation, travel_s: NDArray[Any], worth: NDArray[np.bool_]) -> NDArray[np.int64]:
        """Slot (B,) of the next head among those that are worth their time."""
        return np.where(worth, -travel_s, -np.inf).argmax(axis=1)

    def _weigh(self, observation: Observation) -> tuple[NDArray[Any], NDArray[Any], NDArray[np.bool_]]:
        """Expected surplus (B, K, efforts), travel times (B, K), and which heads are worth their time (B, K)."""
        candidates, machine = candidate_table(observation), observation["machine"]
        open_heads = wanted(observation)
        used = machine[:, M.time]
        served = 1.0 - machine[:, M.stops_left]
        ahead = open_heads.sum(axis=1) + (1.0 - served) * self._row_heads
        tight = used + self._head_share * ahead > 1.0
        second = np.where(tight, self._average, self._price)[:, None, None]
        mass = self.belief.mass(candidates)
        travel_s = candidates[..., C.travel] * TRAVEL_SCALE_S
        surplus = mass[..., None] * self._grams - second * (travel_s[..., None] + self._process_s)
        worth = open_heads & ((surplus.max(axis=-1) > 0.0) | tight[:, None])
        return surplus, travel_s, worth


class Route(GramsPerSecond):
    """The first head of the quickest open route through all heads that are worth their time, with the effort that pays.

    Which heads, and how thoroughly, is decided as ``GramsPerSecond`` does.
    """

    name = "route"

    def __init__(self, config: SafflowerConfig, perception: PerceptionModel | None = None):
        """Take efforts and the machine's rates from the configuration."""
        super().__init__(config, perception)
        self._routes = _Routes(config)

    def _next(self, observation: Observation, travel_s: NDArray[Any], worth: NDArray[np.bool_]) -> NDArray[np.int64]:
        return self._routes.first(observation, worth, shortest_route)
