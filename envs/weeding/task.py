"""The rules of weeding from a moving cart over a batch of worlds, for any machine and process."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..core import COMMON_SCORES, Array, Rows, StepResult, TaskCore
from .config import PerceptionModel, WeedingConfig
from .scenario import (
    FAR_M,
    PAD,
    crop_index,
    draw_blocks,
    draw_plants,
    draw_tracks,
    random_numbers,
    track_capacity,
)
from .tool import WeedingMachine, WeedingProcess

MACHINE_FEATURES = ("place", "lean_along", "lean_across", "speed", "set_speed", "progress", "backlog")
CANDIDATE_FEATURES = (
    "present",
    "along",
    "across",
    "leaves",
    "move",
    "wait",
    "grass",
    "cotyledon",
    "two_leaf",
    "four_leaf",
    "crop_gap",
)

ALONG_SCALE_M = 0.3
ACROSS_SCALE_M = 0.2
LEAVES_SCALE_S = 4.0
TIME_SCALE_S = 0.5
SPEED_SCALE = 0.1
CROP_GAP_SCALE_M = 0.05
"""What the features are divided by, to be of order one."""

WAIT, NOTHING = 3, 4
"""Kinds of decision after the three modes: wait a moment, an illegal action."""
SPEED_CHANGES = (0, -1, 1)
"""Notches of the speed variant's three blocks of actions: hold, slower, faster."""

_TIME, _LAST, _KILLED, _SHOTS, _CROP, _ILLEGAL, _JOULES, _BLANKS = range(8)
"""Columns of the running totals."""


def candidate_table(observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
    """Candidates (..., K, F) of an observation, one column a name of ``CANDIDATE_FEATURES``."""
    flat = observation["candidates"]
    return flat.reshape(*flat.shape[:-1], -1, len(CANDIDATE_FEATURES))


class WeederPlan(NamedTuple):
    """What the machine has to do in each world.

    Attributes:
        kind: (B,), mode, ``WAIT`` or ``NOTHING``.
        slot: (B,), candidate slot, ``slots`` when none.
        track: (B,), track behind it.
        start: (B, S), machine coordinates now.
        target: (B, S), where it stands during the work, the tool camera's correction included.
        aim: (B, 2), where the tool works in the world, metres; ``FAR_M`` when it does not.
        cart: (B,), cart position at the beginning.
        speed: (B, 2), its speed at the beginning and the one that it changes to, m/s.
        phases_s: (B, P), nominal seconds of each phase, in order: move, wait, the process's own, pause.
    """

    kind: NDArray[np.int64]
    slot: NDArray[np.int64]
    track: NDArray[np.int64]
    start: Array
    target: Array
    aim: Array
    cart: Array
    speed: Array
    phases_s: Array


class WeederOutcome(NamedTuple):
    """What happened: ``phases_s`` (B, P) seconds and ``hit`` (B, 2), where the tool really worked on average."""

    phases_s: Array
    hit: Array


def cart_way(speed: Array, acceleration: float, time_s: Array) -> tuple[Array, Array]:
    """Way (...) and speed (...) of a cart that goes from ``speed[..., 0]`` to ``speed[..., 1]`` at a steady rate."""
    before, after = speed[..., 0], speed[..., 1]
    change = after - before
    ramp_s = np.abs(change) * (1.0 / acceleration)
    short = np.minimum(time_s, ramp_s)
    reached = before + np.sign(change) * (acceleration * short)
    return 0.5 * (before + reached) * short + after * (time_s - short), np.where(time_s >= ramp_s, after, reached)


class WeedingCore(TaskCore[WeederPlan, WeederOutcome]):
    """Batched weeding task.

    An action is ``slot * 3 + mode``; ``3 K`` waits a moment. With ``speed_control`` there are three such blocks: hold
    the speed, one notch slower, one notch faster.

    Args:
        config: the task's numbers.
        machine: where the tool can work and how long it takes to get there.
        process: what it does to plants.
        perception: statistical cameras, or None when tracks come from outside through ``receive``.
        worlds: number of worlds B.
    """

    reward_names = ("killed", "crop", "time", "energy")

    def __init__(
        self,
        config: WeedingConfig,
        machine: WeedingMachine,
        process: WeedingProcess,
        perception: PerceptionModel | None,
        worlds: int = 1,
    ):
        """Allocate the state."""
        super().__init__(worlds)
        self.config, self.machine, self.process, self.perception = config, machine, process, perception
        scenario, k, b = config.scenario, config.slots, worlds
        self.phase_names = ("move", "wait", *process.phases, "pause")
        own = ("crop_loss_percent", "weeds_per_s", "joules_per_weed", "ha_per_h", "shots", "blank_shots")
        self.score_names = (*COMMON_SCORES, *(f"phase_{name}_s" for name in self.phase_names), *own, "weeds", "tracks")
        self.base_actions = 3 * k + 1
        blocks = len(SPEED_CHANGES) if config.speed_control else 1
        self.action_space = spaces.Discrete(blocks * self.base_actions)
        self.observation_space = spaces.Dict(
            {
                "machine": spaces.Box(-10.0, 10.0, (len(MACHINE_FEATURES),), np.float32),
                "candidates": spaces.Box(-10.0, 10.0, (k * len(CANDIDATE_FEATURES),), np.float32),
                "action_mask": spaces.Box(0, 1, (blocks * self.base_actions,), np.int8),
            }
        )
        self._numbers = random_numbers(scenario, perception or PerceptionModel.perfect())
        self._stand_s = np.add.reduce(process.work_s, axis=1)
        weights = config.weights
        self._weights = np.array([weights.killed, weights.crop, weights.seconds, weights.joules])
        # Seconds by kind of decision: the process's own, then the pause.
        own_phases = len(process.phases)
        self._kind_phases_s = np.zeros((5, len(self.phase_names)))
        self._kind_phases_s[:3, 2 : 2 + own_phases] = process.work_s
        self._pause_s = np.array([0.0, 0.0, 0.0, config.cart.moment_s, config.cart.illegal_s])
        self._energy_j = np.append(process.energy_j, [0.0, 0.0])
        self._end_m = scenario.strip_m + machine.front_m
        self._exit_m = machine.front_m
        self._delay_s = perception.delay_s if perception else 0.0
        self._crop_offset = np.arange(b)[:, None] * scenario.crops + np.array([-1, 0, 1])
        n, tracks = scenario.max_weeds + 2 * PAD, track_capacity(scenario, perception)
        self.capacity = tracks
        self._weed_offset = np.arange(b)[:, None] * n + np.arange(2 * PAD + 1)
        self._track_offset = np.arange(b) * (tracks + 1)
        self._slot_offset = np.arange(b) * k
        self._slots = np.arange(k)
        self._rows = np.arange(b)
        self._allocate(n, tracks)

    def _allocate(self, weeds: int, tracks: int) -> None:
        b, k, crops = self.worlds, self.config.slots, self.config.scenario.crops
        self.weed = np.full((b, weeds, 2), FAR_M)
        self.weed_exists = np.zeros((b, weeds), bool)
        self.weed_species = np.zeros((b, weeds), np.int64)
        self.weed_stage = np.zeros((b, weeds), np.int64)
        self.weed_look = np.zeros((b, weeds))
        self.weed_tolerance = np.full((b, weeds), np.inf)
        self.weed_dose = np.zeros((b, weeds))
        self.crop = np.zeros((b, crops, 2))
        self.crop_tolerance = np.full((b, crops), np.inf)
        self.crop_dose = np.zeros((b, crops))
        self.crops_in_strip = np.zeros(b)
        self.weeds = np.zeros(b)
        self.track_report = np.full((b, tracks + 1, 2), FAR_M)
        self.track_aim = np.full((b, tracks + 1, 2), FAR_M)
        self.track_known_m = np.full((b, tracks + 1), FAR_M)
        self.track_weed = np.zeros((b, tracks + 1), np.int64)
        self.track_real = np.zeros((b, tracks + 1), bool)
        self.track_feature = np.zeros((b, tracks + 1, len(CANDIDATE_FEATURES)), np.float32)
        self.track_count = np.zeros(b, np.int64)
        self.slot_track = np.full((b, k), tracks)
        self.cursor = np.zeros(b, np.int64)
        self.cart, self.speed, self.set_speed = np.zeros(b), np.zeros(b), np.zeros(b)
        self.place = self.machine.ready(np.zeros(b))
        self._empty = np.ones(b, bool)
        m, width = len(self._stand_s), self.place.shape[1]
        self._along = np.full((b, k), FAR_M)
        self._approach = np.zeros((b, k, m, width))
        self._move_s, self._wait_s = np.zeros((b, k, m)), np.zeros((b, k, m))
        self._legal = np.zeros((b, k, m), bool)
        self.totals = np.zeros((b, 8))
        self.phases_s = np.zeros((b, len(self.phase_names)))

    def reset_rows(self, rows: Rows, generators: Sequence[np.random.Generator]) -> None:
        """Draw new strips for ``rows`` and put the carts before their beginning, already driving."""
        if len(rows) == 0:
            return
        config, process = self.config, self.process
        uniform, normal, camera_uniform, camera_normal = draw_blocks(generators, self._numbers)
        plants = draw_plants(config.scenario, uniform, normal)
        inner = slice(PAD, -PAD)
        self.weed[rows, inner], self.weed_exists[rows, inner] = plants.weed, plants.exists
        self.weed_species[rows, inner], self.weed_stage[rows, inner] = plants.species, plants.stage
        self.weed_look[rows, inner] = plants.look
        tolerance = process.tolerance(plants.species, plants.stage, plants.luck)
        self.weed_tolerance[rows, inner] = np.where(plants.exists, tolerance, np.inf)
        self.weed_dose[rows], self.crop_dose[rows] = 0.0, 0.0
        self.weeds[rows] = np.count_nonzero(plants.exists, axis=1)
        along = plants.crop[..., 0]
        inside = (along >= 0.0) & (along <= config.scenario.strip_m)
        self.crop[rows] = plants.crop
        self.crop_tolerance[rows] = np.where(inside, process.crop_tolerance(plants.crop_luck), np.inf)
        self.crops_in_strip[rows] = np.count_nonzero(inside, axis=1)

        self.totals[rows], self.phases_s[rows] = 0.0, 0.0
        self.cart[rows] = -config.cart.start_m
        self.speed[rows] = self.set_speed[rows] = config.speed_m_s
        self.place[rows] = self.machine.ready(self.cart[rows])
        self.track_count[rows], self.cursor[rows] = 0, 0
        self.slot_track[rows] = self.capacity
        if self.perception is not None:
            tracks = draw_tracks(config.scenario, config.cart, self.perception, plants, camera_uniform, camera_normal)
            self.track_report[rows, :-1], self.track_aim[rows, :-1] = tracks.report, tracks.aim
            self.track_known_m[rows, :-1] = tracks.known_m
            self.track_weed[rows, :-1], self.track_real[rows, :-1] = tracks.weed, tracks.real
            self.track_count[rows] = tracks.count
            self.track_feature[rows, :-1] = track_features(tracks.report, tracks.species, tracks.stage, tracks.crop_gap_m)
        self._prepare(rows)

    def receive(
        self,
        row: int,
        report: Array,
        species: NDArray[np.int64],
        stage: NDArray[np.int64],
        crop_gap_m: Array,
        treated: NDArray[np.bool_],
    ) -> None:
        """Take a camera's present tracks into one world: n places (n, 2), their kinds, and which were treated.

        A track keeps its index from call to call; new ones come after the old ones.
        """
        n = min(len(report), self.capacity)
        self.track_report[row, :n] = self.track_aim[row, :n] = report[:n]
        self.track_feature[row, :n] = track_features(report[:n], species[:n], stage[:n], crop_gap_m[:n])
        order = np.argsort(self.weed[row, PAD:-PAD, 0], kind="stable")
        along = self.weed[row, PAD:-PAD, 0][order]
        place = np.searchsorted(along, report[:n, 0])
        left, right = np.maximum(place - 1, 0), np.minimum(place, len(along) - 1)
        self.track_weed[row, :n] = np.where(report[:n, 0] - along[left] <= along[right] - report[:n, 0], left, right)
        self.track_count[row] = self.cursor[row] = n
        open_tracks = np.flatnonzero(~treated[:n] & (report[:n, 0] >= self.cart[row] - self._exit_m))
        nearest = open_tracks[np.argsort(report[open_tracks, 0], kind="stable")][: self.config.slots]
        self.slot_track[row] = self.capacity
        self.slot_track[row, : len(nearest)] = nearest
        self._empty[row] = len(nearest) == 0
        self._look_ahead(np.array([row]))

    def correct(self, row: int, track: int, aim: Array) -> None:
        """Take the tool camera's correction of one track: the beam will be set on ``aim`` (2,)."""
        self.track_aim[row, track] = aim
        along = self.weed[row, PAD:-PAD, 0]
        self.track_weed[row, track] = np.argmin(np.abs(along - aim[0]))

    def plan(self, actions: NDArray[np.int64]) -> WeederPlan:
        """Turn actions (B,) into what the machine has to do."""
        k, config = self.config.slots, self.config
        base = actions
        speed = np.empty((self.worlds, 2))
        speed[:, 0], speed[:, 1] = self.speed, self.set_speed
        if config.speed_control:
            block = actions // self.base_actions
            base = actions - block * self.base_actions
            low, high = config.cart.speed_range_m_s
            wanted = self.set_speed + config.cart.notch_m_s * np.array(SPEED_CHANGES).take(block)
            speed[:, 1] = np.minimum(np.maximum(wanted, low), high)
        option = np.minimum(base, 3 * k - 1)
        slot = option // 3
        mode = option - 3 * slot
        flat = self._slot_offset * 3 + option
        works = self._legal.take(flat) & (base < 3 * k)
        kind = np.where(works, mode, np.where(base == 3 * k, WAIT, NOTHING))
        track = np.where(works, self.slot_track.take(self._slot_offset + slot), self.capacity)
        place = self._track_offset + track
        aim = self.track_aim.reshape(-1, 2).take(place, axis=0)
        shift = aim - self.track_report.reshape(-1, 2).take(place, axis=0)
        target = self.machine.corrected(self._approach.reshape(-1, self.place.shape[1]).take(flat, axis=0), shift)
        phases = self._kind_phases_s.take(kind, axis=0)
        move_s, wait_s = self._move_s.take(flat), self._wait_s.take(flat)
        idle = kind >= WAIT
        if idle.any():
            # Waiting keeps the machine near the front edge of the window while the ground passes by.
            pause_s = self._pause_s.take(kind)
            way, _ = cart_way(speed, config.cart.acceleration_m_s2, pause_s)
            ready = self.machine.ready(self.cart + way)
            target = np.where(idle[:, None], ready, target)
            move_s = np.where(idle, self.machine.move_time(ready - self.place), move_s)
            phases[:, -1] = np.maximum(pause_s - move_s, 0.0)
            wait_s = np.where(idle, 0.0, wait_s)
        phases[:, 0], phases[:, 1] = move_s, wait_s
        return WeederPlan(kind, np.where(works, slot, k), track, self.place, target, aim, self.cart, speed, phases)

    def apply(self, plan: WeederPlan, outcome: WeederOutcome) -> StepResult:
        """Treat plants, book the time, drive on."""
        kind = plan.kind
        works = kind < WAIT
        mode = np.where(works, kind, 0)
        near = self._weed_offset + self.track_weed.take(self._track_offset + plan.track)[:, None]
        hit = np.where(works[:, None], outcome.hit, -FAR_M)
        offset = self.weed.reshape(-1, 2).take(near, axis=0) - hit[:, None]
        square = offset * offset
        before = self.weed_dose.take(near)
        after = before + self.process.dose(mode, square[..., 0] + square[..., 1], self.weed_stage.take(near))
        self.weed_dose.put(near, after)
        limit = self.weed_tolerance.take(near)
        killed = _count((after >= limit) & (before < limit))

        beside = self._crop_offset + crop_index(self.config.scenario, hit[:, :1], self.crop.shape[1])
        offset = self.crop.reshape(-1, 2).take(beside, axis=0) - hit[:, None]
        square = offset * offset
        before = self.crop_dose.take(beside)
        after = before + self.process.crop_dose(mode, square[..., 0] + square[..., 1])
        self.crop_dose.put(beside, after)
        limit = self.crop_tolerance.take(beside)
        crops = _count((after >= limit) & (before < limit))

        elapsed = np.add.reduce(outcome.phases_s, axis=1)
        energy = self._energy_j.take(kind)
        totals = self.totals
        booked = np.empty_like(totals)
        booked[:, _TIME] = elapsed
        booked[:, _LAST] = 0.0
        booked[:, _KILLED] = killed
        booked[:, _SHOTS] = works
        booked[:, _CROP] = crops
        booked[:, _ILLEGAL] = kind == NOTHING
        booked[:, _JOULES] = energy
        booked[:, _BLANKS] = works & ~self.track_real.take(self._track_offset + plan.track)
        totals += booked
        np.copyto(totals[:, _LAST], totals[:, _TIME], where=works)
        self.phases_s += outcome.phases_s

        way, self.speed = cart_way(plan.speed, self.config.cart.acceleration_m_s2, elapsed)
        self.cart = plan.cart + way
        self.set_speed = plan.speed[:, 1]
        self.place = plan.target
        slots = self.slot_track
        worked = self._slot_offset[works] + plan.slot[works]
        slots.put(worked, self.capacity)
        self._prepare()

        rewards = np.empty((len(kind), 4))
        rewards[:, 0] = killed
        rewards[:, 1] = crops
        rewards[:, 2] = elapsed
        rewards[:, 3] = energy
        rewards *= self._weights
        terminated = (self.cart >= self._end_m) | (self._empty & (self.cart + self._blind_m() > self._end_m))
        truncated = (totals[:, _TIME] >= self.config.time_limit_s) & ~terminated
        return StepResult(rewards, outcome.phases_s, terminated, truncated)

    def observe(self) -> dict[str, NDArray[np.float32 | np.int8]]:
        """What the machine knows: itself, the candidates in the order in which they leave, what it may do."""
        b, k = self.worlds, self.config.slots
        place = self._track_offset[:, None] + self.slot_track
        feature = self.track_feature.reshape(-1, len(CANDIDATE_FEATURES)).take(place, axis=0)
        present = feature[..., 0]
        offset = self._along - self.cart[:, None]
        feature[..., 1] = offset * (1.0 / ALONG_SCALE_M) * present
        feature[..., 3] = (offset + self._exit_m) / (self.speed * LEAVES_SCALE_S)[:, None] * present
        feature[..., 4] = self._move_s[..., 1] * (1.0 / TIME_SCALE_S) * present
        feature[..., 5] = np.minimum(self._wait_s[..., 1], 10.0 * TIME_SCALE_S) * (1.0 / TIME_SCALE_S) * present
        machine = np.empty((b, len(MACHINE_FEATURES)), np.float32)
        machine[:, :3] = self.machine.features(self.place, self.cart)
        machine[:, 3] = self.speed * (1.0 / SPEED_SCALE)
        machine[:, 4] = self.set_speed * (1.0 / SPEED_SCALE)
        machine[:, 5] = self.cart * (1.0 / self.config.scenario.strip_m)
        machine[:, 6] = np.add.reduce(present, axis=1) * (1.0 / k)
        np.minimum(np.maximum(feature, -10.0, out=feature), 10.0, out=feature)
        mask = np.ones((b, int(self.action_space.n)), np.int8)
        legal = self._legal.reshape(b, 3 * k)
        for block in range(mask.shape[1] // self.base_actions):
            mask[:, block * self.base_actions : block * self.base_actions + 3 * k] = legal
        return {"machine": machine, "candidates": feature.reshape(b, -1), "action_mask": mask}

    def scores(self) -> Array:
        """Scorecard so far; see ``score_names``. The net rate counts every true weed of the band, missed ones too."""
        t, config = self.totals, self.config
        time_s, killed, shots = np.maximum(t[:, _TIME], 1e-9), t[:, _KILLED], t[:, _SHOTS]
        p = len(self.phase_names)
        result = np.empty((self.worlds, len(self.score_names)))
        result[:, 0] = killed / np.maximum(self.weeds, 1.0)
        result[:, 1] = t[:, _LAST] / np.maximum(shots, 1.0)
        result[:, 2] = 60.0 * killed / time_s
        result[:, 3] = t[:, _TIME]
        result[:, 4] = killed
        result[:, 5] = self.weeds - killed
        result[:, 6] = t[:, _CROP]
        result[:, 7] = t[:, _ILLEGAL]
        result[:, 8 : 8 + p] = self.phases_s
        own = result[:, 8 + p :]
        own[:, 0] = 100.0 * t[:, _CROP] / np.maximum(self.crops_in_strip, 1.0)
        own[:, 1] = killed / time_s
        own[:, 2] = t[:, _JOULES] / np.maximum(killed, 1.0)
        own[:, 3] = (self.cart + config.cart.start_m) / time_s * (0.36 * config.scenario.band_m)
        own[:, 4], own[:, 5] = shots, t[:, _BLANKS]
        own[:, 6], own[:, 7] = self.weeds, self.track_count
        return result

    def describe(self, plan: WeederPlan, result: StepResult, row: int = 0) -> str:
        """One line about the last decision."""
        kind = int(plan.kind[row])
        elapsed = float(result.phases_s[row].sum())
        if kind < WAIT:
            effect = "weed dies" if result.rewards[row, 0] > 0.0 else "no kill"
            harm = ", crop plant dies" if result.rewards[row, 1] < 0.0 else ""
            return f"{self.process.modes[kind]} dose on slot {int(plan.slot[row])}: {effect}{harm}, {elapsed:.2f} s"
        return f"{'wait' if kind == WAIT else 'illegal action'}: {elapsed:.2f} s"

    def _blind_m(self) -> float:
        """Where the front camera's view ends: when that is behind the strip and no track is left, none will come."""
        return self.config.cart.unseen_m + self.machine.front_m

    def _prepare(self, rows: Rows | None = None) -> None:
        """Drop what has left the window, close the gaps, let known tracks move up, and look at what can be reached."""
        rows = self._rows if rows is None else rows
        self._advance(rows)
        self._look_ahead(rows)

    def _advance(self, rows: Rows) -> None:
        k, empty = self.config.slots, self.capacity
        place = self._track_offset.take(rows)[:, None]
        cart = self.cart.take(rows)
        slots, exit_m = self.slot_track.take(rows, axis=0), (cart - self._exit_m)[:, None]
        report = self.track_report.reshape(-1, 2)
        kept = (slots < empty) & (report.take(place + slots, axis=0)[..., 0] >= exit_m)
        rank = kept.cumsum(axis=1)
        count = rank[:, -1]
        fresh = np.full_like(slots, empty)
        fresh.put((np.arange(0, k * len(rows), k)[:, None] + rank - 1)[kept], slots[kept])
        if self.perception is not None:
            cursor, end = self.cursor.take(rows)[:, None], self.track_count.take(rows)[:, None]
            while True:
                # Tracks that left while the slots were full are passed over; those behind them are ascending.
                following = cursor + self._slots
                following = np.where(following < end, following, empty)
                passed = np.add.reduce(report.take(place + following, axis=0)[..., 0] < exit_m, axis=1, keepdims=True)
                cursor = cursor + passed
                if passed.max() < k:
                    break
            track = cursor + (self._slots - count[:, None])
            reached = (cart - self.speed.take(rows) * self._delay_s)[:, None]
            able = (track >= cursor) & (track < end)
            track = np.where(able, track, empty)
            able &= self.track_known_m.take(place + track) <= reached
            fresh = np.where(able, track, fresh)
            added = np.add.reduce(able, axis=1)
            self.cursor[rows] = cursor[:, 0] + added
            count = count + added
        self.slot_track[rows] = fresh
        self._empty[rows] = count == 0

    def _look_ahead(self, rows: Rows) -> None:
        """Approach of every candidate in every mode, from where the machine stands now."""
        slots = self.slot_track.take(rows, axis=0)
        report = self.track_report.reshape(-1, 2).take(self._track_offset.take(rows)[:, None] + slots, axis=0)
        along, across = report[..., 0].copy(), report[..., 1].copy()
        place, cart, speed = self.place.take(rows, axis=0), self.cart.take(rows), self.speed.take(rows)
        found = self.machine.approach(self._stand_s, place, cart, speed, along, across)
        legal = found.legal & (slots < self.capacity)[..., None]
        if len(rows) == self.worlds:
            self._along, self._approach, self._move_s, self._wait_s, self._legal = along, *found[:3], legal
        else:
            self._along[rows], self._approach[rows], self._move_s[rows] = along, found.beam, found.move_s
            self._wait_s[rows], self._legal[rows] = found.wait_s, legal


def track_features(report: Array, species: NDArray[np.int64], stage: NDArray[np.int64], gap_m: Array) -> Array:
    """What policies are shown of tracks (..., T) that does not depend on where the machine is."""
    feature = np.zeros((*species.shape, len(CANDIDATE_FEATURES)), np.float32)
    feature[..., 0] = 1.0
    feature[..., 2] = report[..., 1] * (1.0 / ACROSS_SCALE_M)
    feature[..., 6] = species
    feature[..., 7:10] = stage[..., None] == np.arange(3)
    feature[..., 10] = np.minimum(gap_m * (1.0 / CROP_GAP_SCALE_M), 4.0)
    return feature


def _count(flags: NDArray[np.bool_]) -> NDArray[np.int64]:
    return np.add.reduce(flags, axis=1, dtype=np.int64)
