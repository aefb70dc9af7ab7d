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

CROP = 3
"""Kind of a crop plant; the kinds before it are the weeds' stages."""
WAIT, NOTHING = 3, 4
"""Kinds of decision after the three modes: wait a moment, an illegal action."""
REAL_M = 0.02
"""A camera's track has a weed behind it when one stands this near to where it is shot at."""
SPEED_CHANGES = (0, -1, 1)
"""Notches of the speed variant's three blocks of actions: hold, slower, faster."""

_TIME, _KILLED, _CROP, _ILLEGAL, _SHOTS, _BLANKS, _JOULES, _LAST = range(8)
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
        self._limit_s, self._set_speed_m_s = config.time_limit_s, config.speed_m_s
        self._blind_m = config.cart.unseen_m + machine.front_m
        self._crop_scale = 1.0 / scenario.crop_pitch_m
        self._delay_s = perception.delay_s if perception else 0.0
        # Weeds and crop plants lie in one array: a shot reaches the five weeds and the three crop plants nearest along.
        weeds = scenario.max_weeds + 2 * PAD
        self.weeds_end = weeds
        self._plants_n = weeds + scenario.crops
        reach = np.array([*range(2 * PAD + 1), weeds - 1, weeds, weeds + 1])
        self._near_offset = np.arange(b)[:, None] * self._plants_n + reach
        self._near_column = np.array([0] * (2 * PAD + 1) + [1] * 3)
        tracks = track_capacity(scenario, perception)
        # Behind the tracks lie as many empty places as there are slots, so that looking on never ends outside.
        self.capacity = tracks
        self._tracks_n = tracks + k
        self._track_offset = np.arange(b) * self._tracks_n
        self._slot_offset = np.arange(b) * k
        self._option_offset = np.arange(b) * self.base_actions
        self._mode_of = np.append(np.tile(np.arange(3), k), WAIT)
        self._idle_of = np.append(np.full(3 * k, NOTHING), WAIT)
        self._slot_of = np.append(np.repeat(np.arange(k), 3), k)
        self._changes = np.array(SPEED_CHANGES)
        self._speeds = np.full((b, 2), config.speed_m_s)
        self._slots = np.arange(k)
        self._rows = np.arange(b)
        self._allocate()

    def _allocate(self) -> None:
        b, k, n, tracks = self.worlds, self.config.slots, self._plants_n, self._tracks_n
        self.plant = np.full((b, n, 2), FAR_M)
        self.plant_exists = np.zeros((b, n), bool)
        self.plant_kind = np.zeros((b, n), np.int64)
        self.plant_kind[:, self.weeds_end :] = CROP
        self.plant_species = np.zeros((b, n), np.int64)
        self.plant_look = np.zeros((b, n))
        self.plant_tolerance = np.full((b, n), np.inf)
        self.plant_dose = np.zeros((b, n))
        self.crops_in_strip = np.zeros(b)
        self.weeds = np.zeros(b)
        self.track_report = np.full((b, tracks, 2), FAR_M)
        self.track_aim = np.full((b, tracks, 2), FAR_M)
        self.track_line = np.full((b, tracks, 2), np.nan)
        self.track_near = np.ones((b, tracks, 2), np.int64)
        self.track_real = np.zeros((b, tracks), bool)
        self.track_feature = np.zeros((b, tracks, len(CANDIDATE_FEATURES)), np.float32)
        # Views for gathering; the arrays under them are written, never replaced.
        self._flat_plant, self._flat_track_report = self.plant.reshape(-1, 2), self.track_report.reshape(-1, 2)
        self._flat_track_aim, self._flat_track_line = self.track_aim.reshape(-1, 2), self.track_line.reshape(-1, 2)
        self._flat_track_near = self.track_near.reshape(-1, 2)
        self._flat_track_feature = self.track_feature.reshape(-1, len(CANDIDATE_FEATURES))
        self.track_count = np.zeros(b, np.int64)
        self.slot_track = np.full((b, k), self.capacity)
        self.cursor = np.zeros(b, np.int64)
        self.cart, self.speed, self.set_speed = np.zeros(b), np.zeros(b), np.zeros(b)
        self.place = self.machine.ready(np.zeros(b))
        self._empty = np.ones(b, bool)
        width = self.place.shape[1]
        self._along = np.full((b, k), FAR_M)
        # One place an action of the first block, the last one for waiting, which is none of them.
        self._approach = np.zeros((b, self.base_actions, width))
        self._move_s, self._wait_s = np.zeros((b, self.base_actions)), np.zeros((b, self.base_actions))
        self._legal = np.zeros((b, self.base_actions), bool)
        self.totals = np.zeros((b, 8))
        self.phases_s = np.zeros((b, len(self.phase_names)))

    def reset_rows(self, rows: Rows, generators: Sequence[np.random.Generator]) -> None:
        """Draw new strips for ``rows`` and put the carts before their beginning, already driving."""
        if len(rows) == 0:
            return
        config, process = self.config, self.process
        uniform, normal, camera_uniform, camera_normal = draw_blocks(generators, self._numbers)
        plants = draw_plants(config.scenario, uniform, normal)
        weeds, crops = slice(PAD, self.weeds_end - PAD), slice(self.weeds_end, None)
        along = plants.crop[..., 0]
        inside = (along >= 0.0) & (along <= config.scenario.strip_m)
        self.plant[rows, weeds], self.plant[rows, crops] = plants.weed, plants.crop
        self.plant_exists[rows, weeds], self.plant_exists[rows, crops] = plants.exists, inside
        self.plant_species[rows, weeds], self.plant_kind[rows, weeds] = plants.species, plants.stage
        self.plant_look[rows, weeds], self.plant_look[rows, crops] = plants.look, plants.crop_luck
        tolerance = process.tolerance(plants.species, plants.stage, plants.luck)
        self.plant_tolerance[rows, weeds] = np.where(plants.exists, tolerance, np.inf)
        self.plant_tolerance[rows, crops] = np.where(inside, process.crop_tolerance(plants.crop_luck), np.inf)
        self.plant_dose[rows] = 0.0
        self.weeds[rows] = np.count_nonzero(plants.exists, axis=1)
        self.crops_in_strip[rows] = np.count_nonzero(inside, axis=1)

        self.totals[rows], self.phases_s[rows] = 0.0, 0.0
        self.cart[rows] = -config.cart.start_m
        self.speed[rows] = self.set_speed[rows] = self._set_speed_m_s
        self.place[rows] = self.machine.ready(self.cart[rows])
        self.track_count[rows], self.cursor[rows] = 0, 0
        self.slot_track[rows] = self.capacity
        if self.perception is not None:
            tracks = draw_tracks(config.scenario, config.cart, self.perception, plants, camera_uniform, camera_normal)
            own = slice(None, self.capacity)
            self.track_report[rows, own], self.track_aim[rows, own] = tracks.report, tracks.aim
            self.track_line[rows, own] = tracks.line
            self.track_near[rows, own, 0] = tracks.weed
            self.track_near[rows, own, 1] = crop_index(config.scenario, tracks.aim[..., 0], config.scenario.crops)
            self.track_real[rows, own] = tracks.real
            self.track_count[rows] = tracks.count
            self.track_feature[rows, own] = track_features(
                tracks.report, tracks.species, tracks.stage, tracks.crop_gap_m
            )
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
        for track in range(n):
            self._near(row, track)
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
        self._near(row, track)

    def option_legal(self, row: int, option: int) -> bool:
        """Whether a shot, an action of the first block, is possible now in one world."""
        return bool(self._legal[row, option])

    def _near(self, row: int, track: int) -> None:
        """Which plants a shot at a track may reach; for scoring alone."""
        along = self.track_aim[row, track, :1]
        weeds = self.plant[row, PAD : self.weeds_end - PAD, 0]
        nearest = int(np.argmin(np.abs(weeds - along)))
        gap = self.plant[row, PAD + nearest] - self.track_aim[row, track]
        crop = crop_index(self.config.scenario, along, self.config.scenario.crops)
        self.track_near[row, track] = nearest, int(crop[0])
        self.track_real[row, track] = bool(np.hypot(*gap) < REAL_M)

    def plan(self, actions: NDArray[np.int64]) -> WeederPlan:
        """Turn actions (B,) into what the machine has to do."""
        k = self.config.slots
        speed = self._speeds
        base = actions
        if self.config.speed_control:
            block = actions // self.base_actions
            base = actions - block * self.base_actions
            speed = np.empty((self.worlds, 2))
            low, high = self.config.cart.speed_range_m_s
            wanted = self.set_speed + self.config.cart.notch_m_s * self._changes.take(block)
            speed[:, 0], speed[:, 1] = self.speed, np.minimum(np.maximum(wanted, low), high)
        # Waiting has a place of its own behind the slots; its option is never legal.
        flat = self._option_offset + base
        works = self._legal.take(flat)
        kind = np.where(works, self._mode_of.take(base), self._idle_of.take(base))
        slot = np.where(works, self._slot_of.take(base), k)
        track = np.where(works, self.slot_track.take(self._slot_offset + np.minimum(slot, k - 1)), self.capacity)
        phases = self._kind_phases_s.take(kind, axis=0)
        phases[:, 0], phases[:, 1] = self._move_s.take(flat), self._wait_s.take(flat)
        idle = kind >= WAIT
        place = self._track_offset + track
        aim = self._flat_track_aim.take(place, axis=0)
        shift = aim - self._flat_track_report.take(place, axis=0)
        target = self.machine.corrected(self._approach.reshape(-1, self.place.shape[1]).take(flat, axis=0), shift)
        if np.count_nonzero(idle):
            # Waiting keeps the machine near the front edge of the window while the ground passes by.
            rows = idle.nonzero()[0]
            pause_s = self._pause_s.take(kind[rows])
            ready = self.machine.ready(self.cart[rows] + self._drive(speed[rows], pause_s)[0])
            target[rows] = ready
            move_s = self.machine.move_time(ready - self.place[rows])
            phases[rows, 0], phases[rows, 1], phases[rows, -1] = move_s, 0.0, np.maximum(pause_s - move_s, 0.0)
        return WeederPlan(kind, slot, track, self.place, target, aim, self.cart, speed, phases)

    def apply(self, plan: WeederPlan, outcome: WeederOutcome) -> StepResult:
        """Treat plants, book the time, drive on."""
        kind = plan.kind
        works = kind < WAIT
        track = self._track_offset + plan.track
        near = self._flat_track_near.take(track, axis=0).take(self._near_column, axis=1) + self._near_offset
        offset = self._flat_plant.take(near, axis=0) - outcome.hit[:, None]
        offset *= offset
        before = self.plant_dose.take(near)
        # Idle worlds work far outside, where nothing grows.
        dose = self.process.dose(np.minimum(kind, 2), offset[..., 0] + offset[..., 1], self.plant_kind.take(near))
        after = before + dose
        self.plant_dose.put(near, after)
        limit = self.plant_tolerance.take(near)
        dies = (after >= limit) & (before < limit)
        killed, crops = _count(dies[:, : 2 * PAD + 1]), _count(dies[:, 2 * PAD + 1 :])

        elapsed = np.add.reduce(outcome.phases_s, axis=1)
        energy = self._energy_j.take(kind)
        totals = self.totals
        booked = np.zeros(totals.shape)
        booked[:, _TIME], booked[:, _KILLED], booked[:, _CROP] = elapsed, killed, crops
        booked[:, _ILLEGAL], booked[:, _SHOTS] = kind == NOTHING, works
        booked[:, _BLANKS] = works & ~self.track_real.take(track)
        booked[:, _JOULES] = energy
        totals += booked
        np.copyto(totals[:, _LAST], totals[:, _TIME], where=works)
        self.phases_s += outcome.phases_s

        way, self.speed = self._drive(plan.speed, elapsed)
        self.cart = plan.cart + way
        self.set_speed = plan.speed[:, 1]
        self.place = plan.target
        slots = self.slot_track
        slots.put((self._slot_offset + plan.slot)[works], self.capacity)
        self._prepare()

        rewards = np.empty((len(kind), 4))
        rewards[:, 0], rewards[:, 1], rewards[:, 2], rewards[:, 3] = killed, crops, elapsed, energy
        rewards *= self._weights
        # Behind the strip's end the front camera sees nothing new: without tracks, none will come.
        terminated = (self.cart >= self._end_m) | (self._empty & (self.cart + self._blind_m > self._end_m))
        truncated = (totals[:, _TIME] >= self._limit_s) & ~terminated
        return StepResult(rewards, outcome.phases_s, terminated, truncated)

    def observe(self) -> dict[str, NDArray[np.float32 | np.int8]]:
        """What the machine knows: itself, the candidates in the order in which they leave, what it may do."""
        b, k = self.worlds, self.config.slots
        place = self._track_offset[:, None] + self.slot_track
        feature = self._flat_track_feature.take(place, axis=0)
        present = feature[..., 0]
        offset = self._along - self.cart[:, None]
        moving = slice(1, self.base_actions - 1, 3)
        feature[..., 1] = offset * (1.0 / ALONG_SCALE_M)
        feature[..., 3] = (offset + self._exit_m) / (self.speed * LEAVES_SCALE_S)[:, None]
        feature[..., 4] = self._move_s[:, moving] * (1.0 / TIME_SCALE_S)
        feature[..., 5] = self._wait_s[:, moving] * (1.0 / TIME_SCALE_S)
        # Empty places are far away: bound them before they are taken out.
        np.minimum(feature, 10.0, out=feature)
        feature *= present[..., None]
        machine = np.empty((b, len(MACHINE_FEATURES)), np.float32)
        machine[:, :3] = self.machine.features(self.place, self.cart)
        machine[:, 3] = self.speed * (1.0 / SPEED_SCALE)
        machine[:, 4] = self.set_speed * (1.0 / SPEED_SCALE)
        machine[:, 5] = self.cart * (1.0 / self.config.scenario.strip_m)
        machine[:, 6] = np.add.reduce(present, axis=1) * (1.0 / k)
        mask = np.empty((b, int(self.action_space.n)), np.int8)
        n = self.base_actions
        mask[:, :n] = self._legal
        mask[:, n - 1] = 1
        for start in range(n, mask.shape[1], n):
            mask[:, start : start + n] = mask[:, :n]
        return {"machine": machine, "candidates": feature.reshape(b, -1), "action_mask": mask}

    def scores(self) -> Array:
        """Scorecard so far; see ``score_names``. The net rate counts every true weed of the band, missed ones too."""
        t = self.totals
        time_s, killed, shots = np.maximum(t[:, _TIME], 1e-9), t[:, _KILLED], np.maximum(t[:, _SHOTS], 1.0)
        p = 8 + len(self.phase_names)
        result = np.empty((self.worlds, len(self.score_names)))
        result[:, 0] = killed / np.maximum(self.weeds, 1.0)
        result[:, 1] = t[:, _LAST] / shots
        weeds_per_s = killed / time_s
        result[:, 2] = 60.0 * weeds_per_s
        result[:, 3:5] = t[:, : _KILLED + 1]
        result[:, 5] = self.weeds - killed
        result[:, 6:8] = t[:, _CROP : _ILLEGAL + 1]
        result[:, 8:p] = self.phases_s
        result[:, p] = 100.0 * t[:, _CROP] / np.maximum(self.crops_in_strip, 1.0)
        result[:, p + 1] = weeds_per_s
        result[:, p + 2] = t[:, _JOULES] / np.maximum(killed, 1.0)
        result[:, p + 3] = (self.cart + self.config.cart.start_m) / time_s * (0.36 * self.config.scenario.band_m)
        result[:, p + 4 : p + 6] = t[:, _SHOTS : _BLANKS + 1]
        result[:, p + 6], result[:, p + 7] = self.weeds, self.track_count
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

    def _prepare(self, rows: Rows | None = None) -> None:
        """Drop what has left the window, close the gaps, let known tracks move up, and look at what can be reached."""
        rows = self._rows if rows is None else rows
        self._advance(rows)
        self._look_ahead(rows)

    def _drive(self, speed: Array, time_s: Array) -> tuple[Array, Array]:
        """Way and final speed (B,) of the carts."""
        if not self.config.speed_control:
            return speed[:, 0] * time_s, speed[:, 0]
        return cart_way(speed, self.config.cart.acceleration_m_s2, time_s)

    def _advance(self, rows: Rows) -> None:
        """Candidates are what was shown and is still to come, then the tracks that follow, as far as they are known."""
        k = self.config.slots
        every = len(rows) == self.worlds
        offset, cart, cursor = self._track_offset, self.cart, self.cursor
        slots, speed = self.slot_track, self.speed
        if not every:
            offset, cart, cursor = offset.take(rows), cart.take(rows), cursor.take(rows)
            slots, speed = slots.take(rows, axis=0), speed.take(rows)
        listed = np.empty((len(rows), 2 * k), np.int64)
        listed[:, :k] = slots
        listed[:, k:] = cursor[:, None] + self._slots
        line = self._flat_track_line.take(offset[:, None] + listed, axis=0)
        # Empty places hold NaN: they compare as neither gone nor to come.
        exit_m = (cart - self._exit_m)[:, None]
        kept = line[..., 0] >= exit_m
        gone = line[:, k:, 0] < exit_m
        if self.perception is None:
            kept[:, k:] = False
        else:
            kept[:, k:] &= line[:, k:, 1] <= (cart - speed * self._delay_s)[:, None]
        rank = kept.cumsum(axis=1)
        kept &= rank <= k
        fresh = np.empty((len(rows), k), np.int64)
        fresh.fill(self.capacity)
        fresh.put((self._slot_offset[: len(rows), None] + rank - 1)[kept], listed[kept])
        # Tracks that left while the slots were full are passed over.
        cursor = cursor + (np.add.reduce(kept[:, k:], axis=1) + np.add.reduce(gone, axis=1))
        cursor = np.minimum(cursor, self.capacity)
        empty = rank[:, -1] == 0
        if every:
            self.slot_track, self.cursor, self._empty = fresh, cursor, empty
        else:
            self.slot_track[rows], self.cursor[rows], self._empty[rows] = fresh, cursor, empty

    def _look_ahead(self, rows: Rows) -> None:
        """Approach of every candidate in every mode, from where the machine stands now."""
        every = len(rows) == self.worlds
        slots, offset, place, cart, speed = self.slot_track, self._track_offset, self.place, self.cart, self.speed
        if not every:
            slots, offset, place = slots.take(rows, axis=0), offset.take(rows), place.take(rows, axis=0)
            cart, speed = cart.take(rows), speed.take(rows)
        report = self._flat_track_report.take(offset[:, None] + slots, axis=0)
        along, across = report[..., 0].copy(), report[..., 1].copy()
        found = self.machine.approach(self._stand_s, place, cart, speed, along, across)
        legal = found.legal & (slots < self.capacity)[..., None]
        n, own = len(rows), slice(None, self.base_actions - 1)
        if every:
            self._along = along
            self._approach[:, own] = found.beam.reshape(n, -1, place.shape[1])
            self._move_s[:, own], self._wait_s[:, own] = found.move_s.reshape(n, -1), found.wait_s.reshape(n, -1)
            self._legal[:, own] = legal.reshape(n, -1)
        else:
            self._along[rows], self._approach[rows, own] = along, found.beam.reshape(n, -1, place.shape[1])
            self._move_s[rows, own], self._wait_s[rows, own] = found.move_s.reshape(n, -1), found.wait_s.reshape(n, -1)
            self._legal[rows, own] = legal.reshape(n, -1)


def track_features(
    report: Array, species: NDArray[np.int64], stage: NDArray[np.int64], gap_m: Array
) -> NDArray[np.float32]:
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
