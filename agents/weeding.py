"""Scripted rules for the laser weeder."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.weeding.aim import LaserMachine
from ..envs.weeding.config import DOSES, SPECIES, STAGES, WeedingConfig
from ..envs.weeding.process import LaserProcess, chance_table, label_dose
from ..envs.weeding.task import (
    ACROSS_SCALE_M,
    ALONG_SCALE_M,
    CANDIDATE_FEATURES,
    CROP_GAP_SCALE_M,
    MACHINE_FEATURES,
    SPEED_SCALE,
    TIME_SCALE_S,
    candidate_table,
)
from .policy import Actions, Observation, StatelessPolicy

Array = NDArray[np.float64]
Flags = NDArray[np.bool_]

_COLUMN = {name: i for i, name in enumerate(CANDIDATE_FEATURES)}
_MACHINE = {name: i for i, name in enumerate(MACHINE_FEATURES)}
_M = len(DOSES)


class View(NamedTuple):
    """What the rules read from an observation; B worlds, K candidates, M doses.

    Attributes:
        legal: (B, K, M).
        chance: (B, K, M), expected probability of a kill.
        value: (B, K, M), expected reward of a shot but for the time.
        label: (B, K), dose that the reported kind calls for.
        time_s: (B, K, M), move, wait and work.
        reach_s: (B, K), move and wait.
        work_s: (M,).
    """

    legal: Flags
    chance: Array
    value: Array
    label: NDArray[np.int64]
    time_s: Array
    reach_s: Array
    work_s: Array


class _WeedingPolicy(StatelessPolicy):
    """Shared reading of observations."""

    def __init__(self, config: WeedingConfig):
        """Tabulate chances and values by reported kind."""
        self.config = config
        process = LaserProcess(config.process)
        self._work_s = process.work_s.sum(axis=1)
        self._energy_j = process.energy_j
        self._chance = chance_table(config.process)
        kinds = [[label_dose(config.process, i, j) for j in range(len(STAGES))] for i in range(len(SPECIES))]
        self._label = np.array(kinds)
        self._wait = 3 * config.slots

    def read(self, observation: Observation) -> View:
        """Expected effects of every shot that the observation offers."""
        table = candidate_table(observation).astype(np.float64)
        k = table.shape[1]
        legal = observation["action_mask"][:, : _M * k].reshape(len(table), k, _M) > 0
        species = (table[..., _COLUMN["grass"]] > 0.5).astype(np.int64)
        stage = table[..., _COLUMN["cotyledon"] : _COLUMN["four_leaf"] + 1].argmax(axis=-1)
        chance = self._chance[species, stage]
        weights, process = self.config.weights, self.config.process
        gap = table[..., _COLUMN["crop_gap"]] * CROP_GAP_SCALE_M
        width = process.spot_radius_m**2 + process.crop_heart_m**2
        on_crop = self._energy_j * np.exp(-2.0 * gap * gap / width)[..., None]
        harm = 1.0 / (1.0 + (process.crop_ed50_j / np.maximum(on_crop, 1e-9)) ** process.crop_slope)
        value = weights.killed * chance + weights.crop * harm + weights.joules * self._energy_j
        reach_s = (table[..., _COLUMN["move"]] + table[..., _COLUMN["wait"]]) * TIME_SCALE_S
        # A shot that is expected to do more harm than good is not on the list of any rule.
        legal &= value > 0.0
        time_s = reach_s[..., None] + self._work_s
        return View(legal, chance, value, self._label[species, stage], time_s, reach_s, self._work_s)

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        raise NotImplementedError

    def fire(self, score: Array) -> Actions:
        """Best of scored shots (B, K, M); wait where all are -inf."""
        flat = score.reshape(len(score), -1)
        best = flat.argmax(axis=1)
        return np.where(flat[np.arange(len(flat)), best] > -np.inf, best, self._wait)


def _only(legal: Flags, label: NDArray[np.int64]) -> Flags:
    """Legal shots with the label dose."""
    return legal & (np.arange(_M) == label[..., None])


def _label_or_less(legal: Flags, label: NDArray[np.int64]) -> Flags:
    """Legal shots with the highest legal dose up to the label's."""
    able = legal & (np.arange(_M) <= label[..., None])
    highest = _M - 1 - able[..., ::-1].argmax(axis=-1)
    return able & (np.arange(_M) == highest[..., None])


class Fifo(_WeedingPolicy):
    """In the order in which they came, whatever dose up to the label's there is still time for."""

    name = "fifo"

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        view = self.read(observation)
        able = _label_or_less(view.legal, view.label)
        return self.fire(np.where(able, -np.arange(able.shape[1])[:, None], -np.inf))


class EarliestDeadline(_WeedingPolicy):
    """The first to leave among those that can still get the dose that their kind calls for."""

    name = "edf"

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        view = self.read(observation)
        able = _only(view.legal, view.label)
        return self.fire(np.where(able, -np.arange(able.shape[1])[:, None], -np.inf))


class Nearest(_WeedingPolicy):
    """The one that is reached soonest, with the label's dose."""

    name = "nearest"

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        view = self.read(observation)
        able = _only(view.legal, view.label)
        return self.fire(np.where(able, -view.reach_s[..., None], -np.inf))


class ShortestDwell(_WeedingPolicy):
    """The one that asks for the shortest burn, of those the one that is reached soonest."""

    name = "shortest-dwell"

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        view = self.read(observation)
        able = _only(view.legal, view.label)
        return self.fire(np.where(able, -1e3 * view.work_s - view.reach_s[..., None], -np.inf))


class KillPerSecond(_WeedingPolicy):
    """Shot and dose with the highest expected value a second."""

    name = "kill-per-second"

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        view = self.read(observation)
        return self.fire(np.where(view.legal, view.value / view.time_s, -np.inf))


class _Beams(NamedTuple):
    """Partial sequences, W a world; leading axes (B, W).

    Attributes:
        place: (B, W, 3), where the machine stands after the sequence, relative to the present cart.
        clock: (B, W), seconds from now.
        gained: (B, W), value so far.
        used: (B, W, K), candidates that the sequence has treated.
        first: (B, W), the action that it begins with, -1 for none.
        last: (B, W), candidate that it ends at, K where it only waited.
    """

    place: Array
    clock: Array
    gained: Array
    used: Flags
    first: NDArray[np.int64]
    last: NDArray[np.int64]


class _Rest(NamedTuple):
    """For the estimate of what comes after a sequence, (B, K) each and ``move_s`` (B, K + 1, K)."""

    value: Array
    service_s: Array
    opens_s: Array
    leaves_s: Array
    move_s: Array
    """From candidate to candidate; the last row begins at the machine's present place."""


class RecedingHorizon(_WeedingPolicy):
    """Beam search over the next shots; what comes after them is estimated by earliest deadline first.

    Sequences of up to ``depth`` shots are grown over estimated windows and move times; the ``width`` best of each
    depth are kept. A sequence is worth what its shots are expected to bring, plus what serving the other candidates
    in the order of leaving, with their labels' doses, would still bring after it, less the time.
    Waiting a moment is a sequence too. Only the first shot is fired.
    """

    name = "receding-horizon"

    def __init__(self, config: WeedingConfig, depth: int = 4, width: int = 6):
        """Take the machine's windows and move times from the configuration."""
        super().__init__(config)
        if depth < 1 or width < 1:
            raise ValueError(f"depth = {depth} and width = {width}: give at least 1")
        self._machine = LaserMachine(config.reach, config.cart.early_s)
        self._depth, self._width = depth, width
        # A second is charged at a quarter of what work without pause earns [assumed]: weeds that no camera has seen yet
        # will want it. The same uncertainty makes the estimate keep one service in reserve before a weed leaves.
        self._price = 0.25 * config.weights.killed / config.service_s
        self._reserve_s = config.service_s

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        view = self.read(observation)
        b, k = view.label.shape
        table = candidate_table(observation).astype(np.float64)
        present = table[..., _COLUMN["present"]] > 0.5
        along = np.where(present, table[..., _COLUMN["along"]] * ALONG_SCALE_M, 1e3)
        across = table[..., _COLUMN["across"]] * ACROSS_SCALE_M
        machine = observation["machine"].astype(np.float64)
        speed = np.maximum(machine[:, _MACHINE["speed"]] * SPEED_SCALE, 1e-3)
        start = machine[:, None, :3] * self._machine.scale
        rest = self._rest(view, present, along, across, speed, start)
        zeros = np.zeros((b, 1))
        beams = _Beams(start, zeros, zeros, ~present[:, None], np.full((b, 1), -1), np.full((b, 1), k))
        moment = np.full((b, 1), self.config.cart.moment_s)
        best = self._worth(beams._replace(clock=moment), rest)[:, 0]
        action = np.full(b, self._wait)
        for level in range(self._depth):
            grown = self._grow(beams, view, along, across, speed, level == 0)
            worth = np.where(np.isfinite(grown.gained), self._worth(grown, rest), -np.inf)
            top = worth.argmax(axis=1)
            rows = np.arange(b)
            better = worth[rows, top] > best
            best = np.where(better, worth[rows, top], best)
            action = np.where(better, grown.first[rows, top], action)
            if level + 1 < self._depth:
                kept = np.argsort(-worth, axis=1, kind="stable")[:, : self._width]
                beams = _Beams(*(_pick(part, kept) for part in grown))
        return action

    def _grow(self, beams: _Beams, view: View, along: Array, across: Array, speed: Array, first: bool) -> _Beams:
        """Every sequence with one more shot, (B, W K M) of them; impossible ones have gained -inf."""
        b, w, k = beams.used.shape
        cart = speed[:, None] * beams.clock
        flat = b * w

        def spread(values: Array) -> Array:
            return np.broadcast_to(values[:, None], (b, w, k)).reshape(flat, k)

        found = self._machine.approach(
            view.work_s,
            beams.place.reshape(flat, 3),
            cart.reshape(flat),
            np.repeat(speed, w),
            spread(along),
            spread(across),
        )
        shape = (b, w, k, _M)
        able = found.legal.reshape(shape) & ~beams.used[..., None] & (view.value > 0.0)[:, None]
        if first:
            # For the next shot the mask knows better than the estimate.
            able &= view.legal[:, None]
        clock = beams.clock[..., None, None] + (found.move_s + found.wait_s).reshape(shape) + view.work_s
        gained = np.where(able, beams.gained[..., None, None] + view.value[:, None], -np.inf)
        used = beams.used[:, :, None, None] | np.eye(k, dtype=bool)[:, None]
        used = np.broadcast_to(used, (b, w, k, _M, k))
        action = np.arange(k * _M).reshape(k, _M)
        begun = np.where(beams.first[..., None, None] >= 0, beams.first[..., None, None], action)
        n = w * k * _M
        last = np.broadcast_to(np.arange(k)[:, None], (b, w, k, _M))
        return _Beams(
            found.beam.reshape(b, n, 3),
            clock.reshape(b, n),
            gained.reshape(b, n),
            used.reshape(b, n, k),
            begun.reshape(b, n),
            last.reshape(b, n),
        )

    def _rest(self, view: View, present: Flags, along: Array, across: Array, speed: Array, start: Array) -> _Rest:
        reach = self.config.reach
        front = self._machine.front_m
        rows, columns = np.ogrid[: len(along), : along.shape[1]]
        value = np.where(present, np.maximum(view.value[rows, columns, view.label], 0.0), 0.0)
        service = view.work_s[view.label]
        # The lean takes a fixed share of the way along; while one weed is served the next comes nearer.
        share = reach.lean_m / reach.front_m
        lean = share * along
        places = np.stack([along - lean, lean, across], axis=-1)
        stroke = places[:, None] - np.concatenate([places, start], axis=1)[:, :, None]
        passed = share * speed[:, None] * np.concatenate([service, np.zeros((len(along), 1))], axis=1)
        stroke[..., 0] += passed[..., None]
        stroke[..., 1] -= passed[..., None]
        opens = (along - front) / speed[:, None]
        leaves = (along + front) / speed[:, None] - self._reserve_s
        return _Rest(value, service, opens, leaves, self._machine.move_time(stroke))

    def _worth(self, beams: _Beams, rest: _Rest) -> Array:
        """Value (B, W) of sequences with the rest served in the order of leaving where it still can be."""
        clock, worth, last = beams.clock, beams.gained, beams.last
        k = rest.value.shape[1]
        flat = rest.move_s.transpose(2, 0, 1).reshape(k, -1)
        row = (k + 1) * np.arange(len(clock))[:, None]
        for j in range(k):
            ready = np.maximum(clock + flat[j].take(row + last), rest.opens_s[:, j, None])
            done = ready + rest.service_s[:, j, None]
            served = ~beams.used[..., j] & (done <= rest.leaves_s[:, j, None]) & (rest.value[:, j, None] > 0.0)
            clock = np.where(served, done, clock)
            worth = worth + served * rest.value[:, j, None]
            last = np.where(served, j, last)
        return worth - self._price * clock


def _pick(values: NDArray[Any], kept: NDArray[np.int64]) -> NDArray[Any]:
    index = kept.reshape(*kept.shape, *(1,) * (values.ndim - 2))
    return np.take_along_axis(values, index, axis=1)


class AtSpeed:
    """Another rule's shots at a constant speed, a multiple of the scenario's own."""

    def __init__(self, policy: _WeedingPolicy, factor: float):
        """Drive at ``factor`` times the scenario's speed, as near as the notches allow."""
        self.name = f"constant-{factor:g}"
        self._policy = policy
        config = policy.config
        low, high = config.cart.speed_range_m_s
        self._target = min(max(factor * config.speed_m_s, low), high)
        self._half = 0.5 * config.cart.notch_m_s
        self._block = 3 * config.slots + 1

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        speed = observation["machine"][:, _MACHINE["set_speed"]] * SPEED_SCALE
        change = np.where(speed > self._target + self._half, 1, np.where(speed < self._target - self._half, 2, 0))
        return change * self._block + self._policy.act(observation)

    def reset(self, rows: NDArray[np.bool_]) -> None:
        """Forget."""
        self._policy.reset(rows)


class HoldBacklog:
    """Another rule's shots, faster or slower so that the work in the window stays a constant share of its time.

    The backlog is the time that the candidates' label doses and mean moves would take, over the time until the last
    of them leaves. Above ``high`` the cart slows down, below ``low`` it speeds up.
    """

    name = "hold-backlog"

    def __init__(self, policy: _WeedingPolicy, low: float = 0.75, high: float = 0.95):
        """Hold the backlog between ``low`` and ``high``."""
        self._policy, self._low, self._high = policy, low, high
        self._block = 3 * policy.config.slots + 1
        self._front = policy.config.reach.front_m
        self._move_s = policy.config.nominal_move_s

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        view = self._policy.read(observation)
        table = candidate_table(observation)
        present = table[..., 0] > 0.5
        work = np.where(present, self._move_s + view.work_s[view.label], 0.0).sum(axis=1)
        way = np.where(present, table[..., _COLUMN["along"]] * ALONG_SCALE_M + self._front, 0.0).max(axis=1)
        speed = np.maximum(observation["machine"][:, _MACHINE["set_speed"]] * SPEED_SCALE, 1e-3)
        backlog = work * speed / np.maximum(way, 0.5 * self._front)
        change = np.where(backlog > self._high, 1, np.where(backlog < self._low, 2, 0))
        return change * self._block + self._policy.act(observation)

    def reset(self, rows: NDArray[np.bool_]) -> None:
        """Forget."""
        self._policy.reset(rows)
