"""The rules of safflower picking over a batch of worlds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ...motion import QUINTIC
from ..core import COMMON_SCORES, Array, Rows, StepResult, TaskCore
from .config import EFFORTS, STAGES, PerceptionModel, SafflowerConfig
from .process import collected_share, cut_share
from .scenario import (
    Tracks,
    draw_blocks,
    draw_heads,
    draw_tracks,
    random_numbers,
    reach_table,
    stop_centres,
)

DRIVE, NOTHING, FINISH = 3, 4, 5
"""Kinds of decision after the three efforts: drive on, an illegal action, leave the row."""

MACHINE_FEATURES = ("across", "height", "ahead", "time", "stops_left", "remaining")
CANDIDATE_FEATURES = ("present", "along", "across", "height", "travel", *STAGES, "size", "reachable")

_AHEAD_SCALE_M = 0.3
_ACROSS_SCALE_M = 0.15
_HEIGHT_SCALE_M = 0.2
_TRAVEL_SCALE_S = 4.0
_SIZE_SCALE_M = 0.05
_STILL_M = 1e-4

_TOTALS = ("time_s", "last_done_s", "gained_g", "left_g", "dropped_g", "done", "wasted", "damaged", "illegal")
_TIME, _LAST, _GAINED, _LEFT, _DROPPED, _DONE, _WASTED, _DAMAGED, _ILLEGAL = range(len(_TOTALS))


class PickerPlan(NamedTuple):
    """What the picker has to do in each world; positions are (cart, u, v): cart along the row, tool in the arm's plane.

    Attributes:
        kind: (B,), effort index, ``DRIVE``, ``NOTHING`` or ``FINISH``.
        slot: (B,), candidate slot, ``slots`` when none.
        track: (B,), report behind it.
        start: (B, 3), metres.
        target: (B, 3), metres.
        leg_s: (B, 4), seconds for rise, traverse across, descent, and the cart's move beside the traverse.
        phases_s: (B, 6), nominal seconds of each phase.
    """

    kind: NDArray[np.int64]
    slot: NDArray[np.int64]
    track: NDArray[np.int64]
    start: Array
    target: Array
    leg_s: Array
    phases_s: Array


class PickerOutcome(NamedTuple):
    """What happened: ``phases_s`` (B, 6) seconds and ``tool`` (B, 3) where the tool really was while it cut."""

    phases_s: Array
    tool: Array


class SafflowerCore(TaskCore[PickerPlan, PickerOutcome]):
    """Batched picking task. An action is ``slot * 3 + effort``; the last action drives on.

    Args:
        config: the task's numbers.
        perception: statistical camera, or None when reports come from outside through ``receive``.
        worlds: number of worlds B.
    """

    reward_names = ("collected", "lost", "time")
    phase_names = ("recognise", "drive", "travel", "settle", "shear", "suck")

    def __init__(self, config: SafflowerConfig, perception: PerceptionModel | None, worlds: int = 1):
        """Allocate the state."""
        super().__init__(worlds)
        self.config, self.perception = config, perception
        scenario, machine, process = config.scenario, config.machine, config.process
        k, heads, tracks = config.slots, scenario.plants * scenario.max_heads, scenario.max_tracks
        self.score_names = (
            *COMMON_SCORES,
            *(f"phase_{name}_s" for name in self.phase_names),
            *("collected_g", "left_g", "dropped_g", "total_g", "wasted", "grams_per_min", "stop"),
        )
        self.action_space = spaces.Discrete(3 * k + 1)
        self.observation_space = spaces.Dict(
            {
                "machine": spaces.Box(-10.0, 10.0, (len(MACHINE_FEATURES),), np.float32),
                "candidates": spaces.Box(-10.0, 10.0, (k, len(CANDIDATE_FEATURES)), np.float32),
                "action_mask": spaces.Box(0, 1, (3 * k + 1,), np.int8),
            }
        )
        # Numbers that the rules look up by kind of decision.
        shear = [n * process.stroke_m / process.shear_speed for n in process.strokes]
        zero = [0.0, 0.0, 0.0]
        self._recognise_s = np.array([process.locate_s] * 3 + [process.recognise_s, process.illegal_s, 0.0])
        self._shear_s, self._suck_s = np.array(shear + zero), np.array([*process.suction_s, *zero])
        self._strokes = np.array([*process.strokes, 0, 0, 0])
        self._velocity = np.array([machine.tool_velocity] * 3 + [machine.cart_velocity])
        self._acceleration = np.array([machine.tool_acceleration] * 3 + [machine.cart_acceleration])
        self._park = np.array([0.5 * machine.bar.base_m, machine.clear_level_m])
        self._half_base_m, self._clear_m = 0.5 * machine.bar.base_m, machine.clear_level_m
        self._centres = stop_centres(scenario)
        self._weights = np.array([config.weights.collected_g, config.weights.lost_g, config.weights.seconds])
        self._numbers = random_numbers(config, perception or PerceptionModel.perfect())

        b = self.worlds
        self._rows, self._slots = np.arange(b), np.arange(k)
        # Row `heads` and column `tracks` are the empty head and the empty report.
        self.head_position = np.zeros((b, heads + 1, 3))
        self.head_exists = np.zeros((b, heads + 1), bool)
        self.head_occluded = np.zeros((b, heads + 1), bool)
        self.head_stage = np.zeros((b, heads + 1), np.int64)
        self.head_size_m = np.zeros((b, heads + 1))
        self.head_mass_g = np.zeros((b, heads + 1))
        self.head_visited = np.zeros((b, heads + 1), bool)
        self.head_luck = np.zeros((b, heads + 1, 2))
        self.plant_base = np.zeros((b, scenario.plants, 3))
        self.plant_height_m = np.zeros((b, scenario.plants))
        self.plant_crown_m = np.zeros((b, scenario.plants))
        self.track_target = np.zeros((b, tracks + 1, 3))
        self.track_feature = np.zeros((b, tracks + 1, len(CANDIDATE_FEATURES)), np.float32)
        self.track_descent_s = np.zeros((b, tracks + 1))
        self.track_legal = np.zeros((b, tracks + 1), bool)
        self.track_head = np.full((b, tracks + 1), heads)
        self.first = np.zeros((b, scenario.stops + 1), np.int64)
        self.slot_track = np.full((b, k + 1), tracks)
        self.cursor = np.zeros(b, np.int64)
        self.stop = np.zeros(b, np.int64)
        self.look_due = np.zeros(b, bool)
        self.pose = np.zeros((b, 3))
        self.totals = np.zeros((b, len(_TOTALS)))
        self.phases_s = np.zeros((b, len(self.phase_names)))
        self.total_g, self.open_heads = np.zeros(b), np.zeros(b)

    def reset_rows(self, rows: Rows, generators: Sequence[np.random.Generator]) -> None:
        """Draw new fields for ``rows`` and put the carts at their first stop, reports taken."""
        if len(rows) == 0:
            return
        scenario = self.config.scenario
        uniform, normal, camera_uniform, camera_normal = draw_blocks(generators, self._numbers)
        heads, plants = draw_heads(self.config, uniform, normal)
        self.head_position[rows, :-1] = heads.position
        self.head_exists[rows, :-1] = heads.exists
        self.head_occluded[rows, :-1] = heads.occluded
        self.head_stage[rows, :-1] = heads.stage
        self.head_size_m[rows, :-1] = heads.size_m
        self.head_mass_g[rows, :-1] = heads.mass_g
        self.head_visited[rows] = False
        self.head_luck[rows, :-1, 0], self.head_luck[rows, :-1, 1] = heads.cut_luck, heads.drop_luck
        self.plant_base[rows], self.plant_height_m[rows] = plants.base, plants.height_m
        self.plant_crown_m[rows] = plants.crown_m
        self.total_g[rows] = heads.mass_g.sum(axis=1)
        self.open_heads[rows] = np.count_nonzero(heads.mass_g, axis=1)
        self.totals[rows], self.phases_s[rows] = 0.0, 0.0
        self.totals[rows, _TIME] = self.phases_s[rows, 0] = self.config.process.recognise_s
        self.pose[rows, 0] = self._centres[0] - self.config.machine.camera_ahead_m
        self.pose[rows, 1:] = self._park
        self.stop[rows] = 0
        self.first[rows] = 0
        self._clear_tracks(rows)
        if self.perception is None:
            self.look_due[rows] = True
        else:
            tracks = draw_tracks(self.config, self.perception, heads, camera_uniform, camera_normal)
            self._place_tracks(rows, tracks, 0)
            self.first[rows] = tracks.first
        self._fill_slots(rows)
        if scenario.potted and not np.all(self.total_g[rows] > 0.0):
            raise ValueError("the scenario drew a field without an open head: raise mean_heads")

    def receive(self, row: int, position: Array, stage: NDArray[np.int64], size_m: Array, head: Rows) -> None:
        """Take a camera's reports of the present stop into one world, in the fixed order.

        Args:
            row: the world.
            position: (n, 3), world metres.
            stage: (n,), reported stage.
            size_m: (n,), reported filament spread.
            head: (n,), the true head behind each report, ``head_mass_g.shape[1] - 1`` for none; for scoring alone.
        """
        capacity = self.config.scenario.max_tracks
        start = int(self.first[row, self.stop[row]])
        n = min(len(position), capacity - start)
        one = slice(None, n)
        tracks = Tracks(
            position[None, one], stage[None, one], size_m[None, one], head[None, one], np.zeros((1, 1), np.int64)
        )
        rows = np.array([row])
        self._place_tracks(rows, tracks, start)
        self.first[row, self.stop[row] + 1 :] = start + n
        self._fill_slots(rows)
        self.look_due[row] = False

    def plan(self, actions: NDArray[np.int64]) -> PickerPlan:
        """Turn actions (B,) into motions and nominal phase times."""
        slot, effort = np.divmod(actions, len(EFFORTS))
        track = self.slot_track[self._rows, slot]
        driving = slot == self.config.slots
        ends = self.stop == len(self._centres) - 1
        kind = np.where(self.track_legal[self._rows, track], effort, NOTHING)
        kind[driving] = DRIVE
        kind[driving & ends] = FINISH
        start = self.pose.copy()
        target = self.track_target[self._rows, track]
        moving = kind <= DRIVE
        if driving.any():
            next_stop = np.minimum(self.stop + 1, len(self._centres) - 1)
            look = np.empty_like(target)
            look[:, 0] = self._centres[next_stop] - self.config.machine.camera_ahead_m
            look[:, 1:] = self._park
            target = np.where(driving[:, None], look, target)
        if not moving.all():
            stay = start.copy()
            stay[:, 2] = np.where(kind == FINISH, self._clear_m, start[:, 2])
            target = np.where(moving[:, None], target, stay)
        # Nothing to do is not even a rise: its stroke would otherwise be counted down again.
        level = np.where(kind == NOTHING, start[:, 2], self._clear_m)
        strokes = np.empty((len(kind), 4))
        np.subtract(level, start[:, 2], out=strokes[:, 0])
        np.subtract(target[:, 1], start[:, 1], out=strokes[:, 1])
        np.subtract(level, target[:, 2], out=strokes[:, 2])
        np.subtract(target[:, 0], start[:, 0], out=strokes[:, 3])
        leg_s = QUINTIC.duration_unchecked(strokes, self._velocity, self._acceleration)
        across = np.maximum(leg_s[:, 1], leg_s[:, 3])
        phases = np.empty((len(kind), len(self.phase_names)))
        phases[:, 0] = self._recognise_s[kind]
        phases[:, 1] = across * driving
        phases[:, 2] = leg_s[:, 0] + leg_s[:, 2] + (across - phases[:, 1])
        phases[:, 3] = self.config.machine.settle_s * (np.abs(strokes[:, 3]) > _STILL_M)
        phases[:, 4] = self._shear_s[kind]
        phases[:, 5] = self._suck_s[kind]
        return PickerPlan(kind, slot, track, start, target, leg_s, phases)

    def apply(self, plan: PickerPlan, outcome: PickerOutcome) -> StepResult:
        """Cut, collect, book the time and move to the next decision."""
        rows, kind = self._rows, plan.kind
        picking = kind < DRIVE
        head = np.where(picking, self.track_head[rows, plan.track], self.head_mass_g.shape[1] - 1)
        tool = outcome.tool
        centre = self.head_position[rows, head]
        along = centre[:, 0] - tool[:, 0]
        across = centre[:, 1] - tool[:, 1] + self._half_base_m
        height = centre[:, 2] - tool[:, 2] - self.config.scenario.motor_height_m
        luck = self.head_luck[rows, head]
        mass = self.head_mass_g[rows, head]
        radial = np.sqrt(along * along + across * across)
        cut = mass * cut_share(self.config.process, self._strokes[kind], radial, height, luck[:, 0])
        gained = cut * collected_share(self.config.process, self._suck_s[kind], luck[:, 1])
        self.head_mass_g[rows, head] = mass - cut
        fresh = picking & ~self.head_visited[rows, head]
        self.head_visited[rows, head] |= picking & (radial <= self.config.process.capture_radius_m)
        done = fresh & (gained > 0.0)

        totals = self.totals
        elapsed = np.add.reduce(outcome.phases_s, axis=1)
        totals[:, _TIME] += elapsed
        np.copyto(totals[:, _LAST], totals[:, _TIME], where=done)
        totals[:, _GAINED] += gained
        totals[:, _LEFT] += np.where(done, mass - cut, 0.0)
        totals[:, _DROPPED] += cut - gained
        totals[:, _DONE] += done
        totals[:, _WASTED] += picking & ~done
        totals[:, _DAMAGED] += fresh & self.head_visited[rows, head] & (self.head_stage[rows, head] == 0)
        totals[:, _ILLEGAL] += kind == NOTHING
        self.phases_s += outcome.phases_s
        self.pose = np.array(plan.target)
        self._advance(plan, picking)

        rewards = np.empty((len(kind), 3))
        rewards[:, 0] = gained
        rewards[:, 1] = np.where(done, mass - gained, cut - gained)
        rewards[:, 2] = elapsed
        rewards *= self._weights
        terminated = kind == FINISH
        truncated = (totals[:, _TIME] >= self.config.scenario.time_limit_s) & ~terminated
        return StepResult(rewards, outcome.phases_s, terminated, truncated)

    def observe(self) -> dict[str, NDArray[np.float32 | np.int8]]:
        """What the machine knows: itself, the candidates of this stop, what it may do."""
        rows, slot_track = self._rows[:, None], self.slot_track[:, :-1]
        feature = self.track_feature[rows, slot_track]
        target = self.track_target[rows, slot_track]
        offset = np.abs(target - self.pose[:, None])
        present = feature[..., 0]
        # Tool and cart travel side by side after the rise that every candidate shares; see plan().
        pairs = offset[..., 1::-1]
        beside = QUINTIC.duration_unchecked(pairs, self._velocity[2:], self._acceleration[2:]).max(axis=-1)
        rise = QUINTIC.duration_unchecked(
            self._clear_m - self.pose[:, 2:], self._velocity[0], self._acceleration[0]
        )
        travel = beside + rise + self.track_descent_s[rows, slot_track]
        feature[..., 1] = (target[..., 0] - self.pose[:, :1]) / _AHEAD_SCALE_M * present
        feature[..., 4] = travel / _TRAVEL_SCALE_S * present
        machine = np.empty((self.worlds, len(MACHINE_FEATURES)), np.float32)
        machine[:, 0] = (self.pose[:, 1] - self._half_base_m) / _ACROSS_SCALE_M
        machine[:, 1] = (self.pose[:, 2] - self._clear_m) / _HEIGHT_SCALE_M
        machine[:, 2] = (self.pose[:, 0] - self._centres[self.stop]) / _AHEAD_SCALE_M
        machine[:, 3] = self.totals[:, _TIME] / self.config.scenario.time_limit_s
        machine[:, 4] = (len(self._centres) - 1 - self.stop) / len(self._centres)
        left = self.first[self._rows, self.stop + 1] - self.cursor
        machine[:, 5] = (np.add.reduce(present, axis=1) + left) / self.config.slots
        mask = np.ones((self.worlds, 3 * self.config.slots + 1), np.int8)
        mask[:, :-1].reshape(self.worlds, -1, 3)[...] = self.track_legal[rows, slot_track][..., None]
        return {"machine": machine, "candidates": feature, "action_mask": mask}

    def scores(self) -> Array:
        """Scorecard so far; see ``score_names``. The net rate is eq. 35 over every open head of the field."""
        t = self.totals
        done = t[:, _DONE]
        result = np.empty((self.worlds, len(self.score_names)))
        result[:, 0] = t[:, _GAINED] / np.maximum(self.total_g, 1e-12)
        result[:, 1] = t[:, _LAST] / np.maximum(done, 1.0)
        result[:, 2] = 60.0 * done / t[:, _TIME]
        result[:, 3] = t[:, _TIME]
        result[:, 4] = done
        result[:, 5] = self.open_heads - done
        result[:, 6] = t[:, _DAMAGED]
        result[:, 7] = t[:, _ILLEGAL]
        result[:, 8:14] = self.phases_s
        result[:, 14] = t[:, _GAINED]
        result[:, 15] = self.total_g - t[:, _GAINED] - t[:, _DROPPED]
        result[:, 16] = t[:, _DROPPED]
        result[:, 17] = self.total_g
        result[:, 18] = t[:, _WASTED]
        result[:, 19] = 60.0 * t[:, _GAINED] / t[:, _TIME]
        result[:, 20] = self.stop
        return result

    def describe(self, plan: PickerPlan, result: StepResult, row: int = 0) -> str:
        """One line about the last decision."""
        kind = int(plan.kind[row])
        elapsed = float(result.phases_s[row].sum())
        if kind < DRIVE:
            grams = float(result.rewards[row, 0]) / (self.config.weights.collected_g or 1.0)
            return f"pick slot {int(plan.slot[row])} {EFFORTS[kind]}: {grams:.3f} g in {elapsed:.1f} s"
        words = {DRIVE: f"drive to stop {int(self.stop[row]) + 1}/{len(self._centres)}", NOTHING: "illegal action"}
        return f"{words.get(kind, 'leave the row')}: {elapsed:.1f} s"

    def _advance(self, plan: PickerPlan, picking: NDArray[np.bool_]) -> None:
        """Close the gap that a picked candidate leaves, in order; refill the slots after a drive."""
        end = self.first[self._rows, self.stop + 1]
        more = picking & (self.cursor < end)
        slots, empty = self.slot_track, self.track_legal.shape[1] - 1
        slots[:, -1] = np.where(more, self.cursor, empty)
        gap = np.where(picking, plan.slot, self.config.slots)
        slots[:, :-1] = np.where(self._slots < gap[:, None], slots[:, :-1], slots[:, 1:])
        slots[:, -1] = empty
        self.cursor += more
        driven = plan.kind == DRIVE
        if driven.any():
            self.stop += driven
            rows = np.flatnonzero(driven)
            if self.perception is None:
                self.look_due[rows] = True
                self.first[rows, self.stop[rows] + 1] = self.first[rows, self.stop[rows]]
            self._fill_slots(rows)

    def _fill_slots(self, rows: Rows) -> None:
        begin, end = self.first[rows, self.stop[rows]], self.first[rows, self.stop[rows] + 1]
        tracks = begin[:, None] + self._slots
        self.slot_track[rows, :-1] = np.where(tracks < end[:, None], tracks, self.track_legal.shape[1] - 1)
        self.cursor[rows] = np.minimum(begin + self.config.slots, end)

    def _clear_tracks(self, rows: Rows) -> None:
        self.track_feature[rows] = 0.0
        self.track_legal[rows] = False
        self.track_head[rows] = self.head_mass_g.shape[1] - 1

    def _place_tracks(self, rows: Rows, tracks: Tracks, start: int) -> None:
        """Write reports and all that policies are shown of them that does not depend on where the arm is."""
        machine, scenario = self.config.machine, self.config.scenario
        where = slice(start, start + tracks.position.shape[1])
        target = tracks.position.copy()
        target[..., 1] += self._half_base_m
        target[..., 2] -= scenario.motor_height_m
        descent = np.maximum(self._clear_m - target[..., 2], 0.0)
        half_width = np.interp(target[..., 2], *reach_table(machine.bar), left=-1.0, right=-1.0)
        legal = (np.abs(tracks.position[..., 1]) <= half_width) & (target[..., 2] <= self._clear_m)
        feature = np.zeros((*descent.shape, len(CANDIDATE_FEATURES)), np.float32)
        feature[..., 0] = 1.0
        feature[..., 2] = tracks.position[..., 1] / _ACROSS_SCALE_M
        feature[..., 3] = (target[..., 2] - self._clear_m) / _HEIGHT_SCALE_M
        feature[..., 5:9] = tracks.stage[..., None] == np.arange(len(STAGES))
        feature[..., 9] = tracks.size_m / _SIZE_SCALE_M
        feature[..., 10] = legal
        self.track_target[rows, where] = target
        self.track_descent_s[rows, where] = QUINTIC.duration_unchecked(
            descent, machine.tool_velocity, machine.tool_acceleration
        )
        self.track_legal[rows, where] = legal
        self.track_feature[rows, where] = feature
        self.track_head[rows, where] = tracks.head
