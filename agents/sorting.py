"""Scripted rules for the produce sorter."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..envs.sorting.config import GRADES, REFERENCE_CYCLE_S, SortingConfig
from ..envs.sorting.features import (
    CANDIDATE_FEATURES,
    CYCLE_SCALE_S,
    PLACE_SCALE_M,
    TURN_SCALE_RAD,
    WAIT_SCALE_S,
    candidate_table,
)
from ..envs.sorting.reports import SWING_M
from ..motion import QUINTIC
from .policy import Actions, Observation, StatelessPolicy

Array = NDArray[np.float64]

_COLUMN = {name: i for i, name in enumerate(CANDIDATE_FEATURES)}
_FIRST_GRADE = _COLUMN[GRADES[0]]
_GRIP_LEVEL_M = 0.010
"""Typical height of the platform when it grips."""


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
        return -table[..., _COLUMN["along"]].astype(np.float64)


class EarliestDeadline(_Ranking):
    """The item that leaves the reach first, at its own yaw and tilt and its place across the belt."""

    name = "edf"

    def _key(self, table: NDArray[np.float32]) -> Array:
        return np.broadcast_to(np.arange(table.shape[1], dtype=np.float64), table.shape[:2])


class Nearest(_Ranking):
    """The item that the tool is over soonest."""

    name = "nearest"

    def _key(self, table: NDArray[np.float32]) -> Array:
        return table[..., _COLUMN["approach"]] + WAIT_SCALE_S * table[..., _COLUMN["wait"]].astype(np.float64)


class ShortestCycle(_Ranking):
    """The item that is in its bin soonest."""

    name = "shortest-cycle"

    def _key(self, table: NDArray[np.float32]) -> Array:
        return table[..., _COLUMN["cycle"]].astype(np.float64)


class ValuePerSecond(_Ranking):
    """The highest expected value per second until it is in its bin."""

    name = "value-per-second"

    def _key(self, table: NDArray[np.float32]) -> Array:
        worth = table[..., _COLUMN["value"]].astype(np.float64) * table[..., _COLUMN["quality"]]
        return -worth / np.maximum(table[..., _COLUMN["cycle"]], 1e-6)


class RecedingHorizon(StatelessPolicy):
    """Plans a few picks ahead with a beam search, carries out the first and plans again.

    A sequence counts the items that it is expected to place, less the time that it takes at the rate at which the
    machine places items when it never lacks any. Later picks start level over the bin of the one before.

    Args:
        config: the task's public numbers.
        depth: picks ahead.
        width: sequences kept at each depth.
        by_value: count values instead of items.
    """

    name = "receding-horizon"

    def __init__(self, config: SortingConfig, depth: int = 4, width: int = 8, *, by_value: bool = False):
        """Take the machine's times from the configuration."""
        if depth < 1 or width < 1:
            raise ValueError(f"depth = {depth}, width = {width}: both must be at least 1")
        self._depth, self._width, self._by_value = depth, width, by_value
        sorter, machine = config.machine.sorter, config.machine
        self._speed = config.belt.speed_m_s
        self._limits = sorter.velocity_m_s - self._speed, sorter.acceleration_m_s2
        self._turn_limits = sorter.turn_rad_s, sorter.turn_rad_s2
        self._shortest_s = machine.shortest_move_s
        down = machine.travel_level_m - _GRIP_LEVEL_M
        descend = float(QUINTIC.duration(down, sorter.velocity_m_s, sorter.acceleration_m_s2))
        self._hold_s, self._release_s = 2.0 * descend + config.grip.grip_s, config.grip.release_s
        self._bins = np.array(config.belt.bins_m)
        mean_value = float(np.mean(config.produce.value)) if by_value else 1.0
        self._price = 0.9 * config.grip.best * mean_value / REFERENCE_CYCLE_S

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        mask = observation["action_mask"][:, :-1] > 0
        table = candidate_table(observation).astype(np.float64)
        worlds, k = mask.shape
        gain = table[..., _COLUMN["quality"]]
        if self._by_value:
            gain = gain * table[..., _COLUMN["value"]]
        along = table[..., _COLUMN["along"]] * PLACE_SCALE_M
        across = table[..., _COLUMN["across"]] * PLACE_SCALE_M
        last = along + self._speed * (table[..., _COLUMN["slack"]] * WAIT_SCALE_S + table[..., _COLUMN["approach"]])
        first = -(last + SWING_M + self._speed * self._hold_s)
        turn_s = QUINTIC.duration_unchecked(table[..., _COLUMN["turn"]] * TURN_SCALE_RAD, *self._turn_limits)
        turn_s = np.maximum(turn_s, self._shortest_s)
        goal = np.argmax(table[..., _FIRST_GRADE : _FIRST_GRADE + len(GRADES)], axis=-1)
        fit = table[..., _COLUMN["present"]] > 0.0

        time = np.where(mask, table[..., _COLUMN["cycle"]] * CYCLE_SCALE_S, np.inf)
        score = np.where(mask, gain - self._price * time, -np.inf)
        head, at = (np.broadcast_to(part, (worlds, k)) for part in (np.arange(k), goal))
        used = np.broadcast_to(np.eye(k, dtype=bool), (worlds, k, k))
        won = gain
        best, choice = score.max(axis=1), score.argmax(axis=1)
        for _ in range(self._depth - 1):
            kept = np.argsort(-score, axis=1, kind="stable")[:, : self._width]
            score, time, won = (np.take_along_axis(part, kept, axis=1) for part in (score, time, won))
            head, at = (np.take_along_axis(part, kept, axis=1) for part in (head, at))
            used = np.take_along_axis(used, kept[..., None], axis=1)
            done, possible = self._next(self._bins[at], time, along, across, first, last, turn_s, goal)
            possible &= ~used & fit[:, None] & np.isfinite(score)[..., None]
            won_then = won[..., None] + gain[:, None]
            shape = (worlds, -1)
            score = np.where(possible, won_then - self._price * done, -np.inf).reshape(shape)
            time, won = done.reshape(shape), won_then.reshape(shape)
            head = np.repeat(head, k, axis=1)
            at = np.broadcast_to(goal[:, None], possible.shape).reshape(shape)
            used = (used[:, :, None] | np.eye(k, dtype=bool)).reshape(worlds, -1, k)
            top = score.max(axis=1)
            better = top > best
            best = np.where(better, top, best)
            choice = np.where(better, np.take_along_axis(head, score.argmax(axis=1)[:, None], axis=1)[:, 0], choice)
        return np.where(mask.any(axis=1), choice, k)

    def _next(
        self, spot: Array, time: Array, along: Array, across: Array, first: Array, last: Array, turn_s: Array,
        goal: NDArray[np.int64],
    ) -> tuple[Array, NDArray[np.bool_]]:  # fmt: skip
        """When each candidate is in its bin (B, W, K) after sequences (B, W) that end over ``spot``, and if it can."""
        start = np.where(np.isfinite(time), time, 0.0)[..., None]
        now = along[:, None] + self._speed * start
        least = turn_s[:, None]
        aside = across[:, None] - spot[..., 1:]
        approach = least
        for _ in range(2):
            meet = np.maximum(now + self._speed * approach, first[:, None])
            distance = np.hypot(meet - spot[..., :1] - 0.5 * self._speed * approach, aside)
            approach = np.maximum(QUINTIC.duration_unchecked(distance, *self._limits), least)
        meet = np.maximum(now + self._speed * approach, first[:, None])
        arrive = start + np.maximum((meet - now) / self._speed, approach)
        bins = self._bins[goal][:, None]
        distance = np.hypot(bins[..., 0] - meet - self._speed * self._hold_s, bins[..., 1] - across[:, None])
        carry = np.maximum(QUINTIC.duration_unchecked(distance, *self._limits), least)
        return arrive + self._hold_s + carry + self._release_s, meet <= last[:, None]
