"""Scripted rules for weeding with any tool."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...envs.weeding.features import (
    ALONG_SCALE_M,
    CROP_GAP_SCALE_M,
    SPEED_SCALE,
    TIME_SCALE_S,
    C,
    M,
    candidate_table,
)
from ...envs.weeding.state import MODES
from .base import Actions, ConfiguredPolicy, Observation
from .weeding_outlook import outlook

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


class View(NamedTuple):
    """What the rules read from an observation; B worlds, K candidates, M modes.

    Attributes:
        table: (B, K, F), the candidates.
        legal: (B, K, M).
        chance: (B, K, M), expected probability of a kill.
        value: (B, K, M), expected reward of a shot but for the time.
        label: (B, K), dose that the reported kind calls for.
        time_s: (B, K, M), move, wait and work.
        reach_s: (B, K), move and wait.
        work_s: (M,).
    """

    table: Array
    legal: Flags
    chance: Array
    value: Array
    label: NDArray[np.int64]
    time_s: Array
    reach_s: Array
    work_s: Array


class ScriptedWeeder(ConfiguredPolicy):
    """Shared reading of observations.

    Args:
        config: the task's public numbers; they say which tool there is.
    """

    def __init__(self, config: Any):
        """Take the tool's chances and times."""
        self.config, self.outlook = config, outlook(config)
        self.wait = MODES * config.slots

    def read(self, observation: Observation) -> View:
        """Expected effects of every shot that the observation offers."""
        tool, weights = self.outlook, self.config.weights
        table = candidate_table(observation).astype(np.float64)
        k = table.shape[1]
        legal = observation["action_mask"][:, : MODES * k].reshape(len(table), k, MODES) > 0
        species = (table[..., C.grass] > 0.5).astype(np.int64)
        stage = table[..., C.cotyledon : C.four_leaf + 1].argmax(axis=-1)
        chance = tool.chance[species, stage]
        harm = tool.harm(table[..., C.crop_gap] * CROP_GAP_SCALE_M)
        value = weights.killed * chance + weights.crop * harm + weights.joules * tool.energy_j
        reach_s = (table[..., C.move] + table[..., C.wait]) * TIME_SCALE_S
        # A shot that is expected to do more harm than good is not on the list of any rule.
        legal &= value > 0.0
        time_s = reach_s[..., None] + tool.work_s
        return View(table, legal, chance, value, tool.label[species, stage], time_s, reach_s, tool.work_s)

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        view = self.read(observation)
        return self.fire(np.where(self.able(view), self.score(view), -np.inf))

    def able(self, view: View) -> Flags:
        """Shots (B, K, M) that the rule chooses among: the legal ones with the dose that the kind of weed calls for."""
        return view.legal & (np.arange(MODES) == view.label[..., None])

    def score(self, view: View) -> Array:
        """What the rule prefers among them, to be broadcast to (B, K, M): the first to leave."""
        return -np.arange(view.legal.shape[1], dtype=np.float64)[:, None]

    def fire(self, score: Array) -> Actions:
        """Best of scored shots (B, K, M); wait where all are -inf."""
        flat = score.reshape(len(score), -1)
        best = flat.argmax(axis=1)
        return np.where(flat[np.arange(len(flat)), best] > -np.inf, best, self.wait)


class Fifo(ScriptedWeeder):
    """In the order in which they came, whatever dose up to the label's there is still time for."""

    name = "fifo"

    def able(self, view: View) -> Flags:
        """Legal shots with the highest legal dose up to the label's."""
        able = view.legal & (np.arange(MODES) <= view.label[..., None])
        highest = MODES - 1 - able[..., ::-1].argmax(axis=-1)
        return able & (np.arange(MODES) == highest[..., None])


class EarliestDeadline(ScriptedWeeder):
    """The first to leave among those that can still get the dose that their kind calls for."""

    name = "edf"


class Nearest(ScriptedWeeder):
    """The one that is reached soonest, with the label's dose."""

    name = "nearest"

    def score(self, view: View) -> Array:
        """Soonest first."""
        return -view.reach_s[..., None]


class ShortestDwell(ScriptedWeeder):
    """The one that asks for the shortest burn, of those the one that is reached soonest."""

    name = "shortest-dwell"

    def score(self, view: View) -> Array:
        """Shortest first."""
        return -1e3 * view.work_s - view.reach_s[..., None]


class KillPerSecond(ScriptedWeeder):
    """Shot and dose with the highest expected value a second."""

    name = "kill-per-second"

    def able(self, view: View) -> Flags:
        """All legal shots."""
        return view.legal

    def score(self, view: View) -> Array:
        """Most valuable a second first."""
        return view.value / view.time_s


class _SpeedRule:
    """Another rule's shots, and whether to hold, lower or raise the speed: blocks 0, 1 and 2 of the actions."""

    def __init__(self, policy: ScriptedWeeder):
        self._policy = policy
        self._block = MODES * policy.config.slots + 1

    def change(self, observation: Observation) -> NDArray[np.int64]:
        """Block (B,) of the action."""
        raise NotImplementedError

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        return self.change(observation) * self._block + self._policy.act(observation)

    def reset(self, rows: NDArray[np.bool_]) -> None:
        """Forget."""
        self._policy.reset(rows)

    def expected(self, observation: Observation, actions: Actions) -> Array:
        """What the other rule expects (B,) of its shots, if it plans."""
        policy: Any = self._policy
        return policy.expected(observation, actions % self._block)


class AtSpeed(_SpeedRule):
    """Another rule's shots at a constant speed, a multiple of the scenario's own."""

    def __init__(self, policy: ScriptedWeeder, factor: float):
        """Drive at ``factor`` times the scenario's speed, as near as the notches allow."""
        super().__init__(policy)
        self.name = f"constant-{factor:g}"
        config = policy.config
        low, high = config.cart.speed_range_m_s
        self._target = min(max(factor * config.speed_m_s, low), high)
        self._half = 0.5 * config.cart.notch_m_s

    def change(self, observation: Observation) -> NDArray[np.int64]:
        """Block (B,) of the action."""
        speed = observation["machine"][:, M.set_speed] * SPEED_SCALE
        return np.where(speed > self._target + self._half, 1, np.where(speed < self._target - self._half, 2, 0))


class HoldBacklog(_SpeedRule):
    """Another rule's shots, faster or slower so that the work in the window stays a constant share of its time.

    The backlog is the time that the candidates' label doses and mean moves would take, over the time until the last
    of them leaves. Above ``high`` the cart slows down, below ``low`` it speeds up.
    """

    name = "hold-backlog"

    def __init__(self, policy: ScriptedWeeder, low: float = 0.5, high: float = 0.7, name: str = name):
        """Hold the backlog between ``low`` and ``high``."""
        super().__init__(policy)
        self.name = name
        self._low, self._high = low, high
        self._front = policy.outlook.arm.front_m
        self._move_s = policy.config.nominal_move_s

    def change(self, observation: Observation) -> NDArray[np.int64]:
        """Block (B,) of the action."""
        view = self._policy.read(observation)
        table = candidate_table(observation)
        present = table[..., C.present] > 0.5
        work = np.where(present, self._move_s + view.work_s[view.label], 0.0).sum(axis=1)
        way = np.where(present, table[..., C.along] * ALONG_SCALE_M + self._front, 0.0).max(axis=1)
        speed = np.maximum(observation["machine"][:, M.set_speed] * SPEED_SCALE, 1e-3)
        backlog = work * speed / np.maximum(way, 0.5 * self._front)
        return np.where(backlog > self._high, 1, np.where(backlog < self._low, 2, 0))
