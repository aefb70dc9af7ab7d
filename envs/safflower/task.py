"""The rules of safflower picking over a batch of worlds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ...motion import QUINTIC
from ...motion.laws import shortest
from ..core import COMMON_SCORES, Array, Rows, StepResult, TaskCore
from .config import EFFORTS, STAGES, PerceptionModel, SafflowerConfig
from .process import collected_share, cut_share, dropped_share
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

MACHINE_FEATURES = ("ahead", "across", "height", "time", "stops_left", "remaining")
CANDIDATE_FEATURES = ("present", "along", "across", "height", "travel", *STAGES, "size", "reachable")

AHEAD_SCALE_M = 0.3
ACROSS_SCALE_M = 0.15
HEIGHT_SCALE_M = 0.2
TRAVEL_SCALE_S = 4.0
SIZE_SCALE_M = 0.05
"""What the features are divided by, to be of order one."""

_STILL_M = 1e-4

_TIME, _DONE, _MISSED, _DAMAGED, _ILLEGAL = range(5)
_PHASES = slice(5, 11)
_GAINED, _DROPPED, _TOTAL, _WASTED, _LAST = range(11, 16)
"""Columns of the running totals, all but the last in the scorecard's order."""


def candidate_table(observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
    """Candidates (..., K, F) of an observation, one column a name of ``CANDIDATE_FEATURES``."""
    flat = observation["candidates"]
    return flat.reshape(*flat.shape[:-1], -1, len(CANDIDATE_FEATURES))


class PickerPlan(NamedTuple):
    """What the picker has to do in each world; positions are (cart, u, v): cart along the row, tool in the arm's plane.

    Attributes:
        kind: (B,), effort index, ``DRIVE``, ``NOTHING`` or ``FINISH``.
        slot: (B,), candidate slot, ``slots`` when none.
        report: (B,), flat index of the report behind it, an empty one when there is none.
        start: (B, 3), metres.
        target: (B, 3), metres.
        rise_s: (B,), seconds of the rise to the traverse level.
        beside_s: (B, 2), seconds of the cart's move and of the traverse across, which go on side by side.
        descent_s: (B,), seconds of the descent.
        phases_s: (B, 6), nominal seconds of each phase.
        next_rise_s: (B,), seconds of the rise that the next decision begins with.
    """

    kind: NDArray[np.int64]
    slot: NDArray[np.int64]
    report: NDArray[np.int64]
    start: Array
    target: Array
    rise_s: Array
    beside_s: Array
    descent_s: Array
    phases_s: Array
    next_rise_s: Array


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
        scenario, process, picker = config.scenario, config.process, config.machine.picker
        k, heads, tracks = config.slots, scenario.plants * scenario.max_heads, scenario.max_tracks
        self.score_names = (
            *COMMON_SCORES,
            *(f"phase_{name}_s" for name in self.phase_names),
            *("collected_g", "dropped_g", "total_g", "wasted", "grams_per_min", "stop"),
        )
        self.action_space = spaces.Discrete(3 * k + 1)
        self.observation_space = spaces.Dict(
            {
                "machine": spaces.Box(-10.0, 10.0, (len(MACHINE_FEATURES),), np.float32),
                # A flat vector, row by row: learning libraries take two axes for a broken image and warn.
                "candidates": spaces.Box(-10.0, 10.0, (k * len(CANDIDATE_FEATURES),), np.float32),
                "action_mask": spaces.Box(0, 1, (3 * k + 1,), np.int8),
            }
        )
        # Numbers that the rules look up by kind of decision.
        self._process_phases_s = np.zeros((6, len(self.phase_names)))
        self._process_phases_s[:, 0] = [process.locate_s] * 3 + [process.recognise_s, process.illegal_s, 0.0]
        self._process_phases_s[:3, 4] = np.array(process.strokes) * process.stroke_m / process.shear_speed
        self._process_phases_s[:3, 5] = process.suction_s
        self._strokes = np.array([*process.strokes, 0, 0, 0], float)
        # Every pick counts as wasted until it has brought something.
        self._booked_by_kind = np.zeros((6, _LAST + 1))
        self._booked_by_kind[:3, _WASTED] = self._booked_by_kind[NOTHING, _ILLEGAL] = 1.0
        self._dropped = dropped_share(process, self._process_phases_s[:, 5])
        # Seconds a metre at the speed limit, seconds squared a metre at the acceleration limit, for (cart, tool).
        self._beside_pace, self._beside_square_pace = QUINTIC.paces(
            np.array([picker.cart_velocity_m_s, picker.tool_velocity_m_s]),
            np.array([picker.cart_acceleration_m_s2, picker.tool_acceleration_m_s2]),
        )
        self._park = np.array([0.5 * picker.five_bar.base_m, config.machine.clear_level_m])
        self._half_base_m, self._clear_m = self._park.tolist()
        self._centres = stop_centres(scenario)
        # World (along, across, up) of the arm plane's (cart, u, v) = 0.
        self.frame = np.array([0.0, -self._half_base_m, scenario.motor_height_m])
        self._stop_pose = np.column_stack([self._centres, np.tile(self._park, (len(self._centres), 1))])
        stops = len(self._centres)
        self._next_look = self._stop_pose[np.minimum(np.arange(stops) + 1, stops - 1)]
        self._next_look[:, 0] -= picker.camera_ahead_m
        self._leaving = np.array([DRIVE] * (stops - 1) + [FINISH])
        self._stops_left = 1.0 - (1.0 + np.arange(len(self._centres))) / len(self._centres)
        self._pose_scale = 1.0 / np.array([AHEAD_SCALE_M, ACROSS_SCALE_M, HEIGHT_SCALE_M])
        self._no_head = heads
        self._weights = np.array([config.weights.collected_g, config.weights.lost_g, config.weights.seconds])
        self._numbers = random_numbers(config, perception or PerceptionModel.perfect())

        b = self.worlds
        self._rows, self._slots = np.arange(b), np.arange(k)
        # Gathers go through flat views: one index array instead of two is several times faster.
        self._head_offset, self._track_offset = self._rows * (heads + 1), self._rows * (tracks + 1)
        self._first_offset = self._rows * (scenario.stops + 1)
        # Row `heads` and column `tracks` are the empty head and the empty report.
        self.head_position = np.zeros((b, heads + 1, 3))
        self.head_exists = np.zeros((b, heads + 1), bool)
        self.head_occluded = np.zeros((b, heads + 1), bool)
        self.head_stage = np.zeros((b, heads + 1), np.int64)
        self.head_size_m = np.zeros((b, heads + 1))
        self.head_mass_g = np.zeros((b, heads + 1))
        self.head_visited = np.zeros((b, heads + 1), bool)
        # Odds with which a head's luck multiplies its cut and its collection.
        self.head_odds = np.ones((b, heads + 1, 2))
        self.plant_base = np.zeros((b, scenario.plants, 3))
        self.plant_height_m = np.zeros((b, scenario.plants))
        self.plant_crown_m = np.zeros((b, scenario.plants))
        self.track_target = np.zeros((b, tracks + 1, 3))
        self.track_feature = np.zeros((b, tracks + 1, len(CANDIDATE_FEATURES)), np.float32)
        self.track_descent_s = np.zeros((b, tracks + 1))
        self.track_legal = np.zeros((b, tracks + 1), bool)
        self.track_head = np.full((b, tracks + 1), heads)
        self.first = np.zeros((b, scenario.stops + 1), np.int64)
        # Flat indices into the reports; the last column is the empty slot that driving on points at.
        self._empty = self._track_offset + tracks
        self.slot_report = np.repeat(self._empty[:, None], k + 1, axis=1)
        self.cursor, self.stop_end = np.zeros(b, np.int64), np.zeros(b, np.int64)
        self.remaining = np.zeros(b, np.int64)
        self.stop = np.zeros(b, np.int64)
        self.look_due = np.zeros(b, bool)
        self.episode = np.zeros(b, np.int64)
        self.pose = np.zeros((b, 3))
        self.rise_s = np.zeros(b)
        self.totals = np.zeros((b, _LAST + 1))
        self._per_total = np.zeros(b)

    def reset_rows(self, rows: Rows, generators: Sequence[np.random.Generator]) -> None:
        """Draw new fields for ``rows`` and put the carts at their first stop, reports taken."""
        if len(rows) == 0:
            return
        scenario = self.config.scenario
        uniform, normal, camera_uniform, camera_normal = draw_blocks(generators, self._numbers)
        heads, plants = draw_heads(self.config, uniform, normal)
        self.head_position[rows, :-1] = heads.position - self.frame
        self.head_exists[rows, :-1] = heads.exists
        self.head_occluded[rows, :-1] = heads.occluded
        self.head_stage[rows, :-1] = heads.stage
        self.head_size_m[rows, :-1] = heads.size_m
        self.head_mass_g[rows, :-1] = heads.mass_g
        self.head_visited[rows] = False
        self.head_odds[rows, :-1, 0] = np.exp(self.config.process.luck_logit * heads.cut_luck)
        self.head_odds[rows, :-1, 1] = np.exp(self.config.process.luck_logit * heads.drop_luck)
        self.plant_base[rows], self.plant_height_m[rows] = plants.base, plants.height_m
        self.plant_crown_m[rows] = plants.crown_m
        self.episode[rows] += 1
        self.totals[rows] = 0.0
        self.totals[rows, _TOTAL] = heads.mass_g.sum(axis=1)
        self._per_total[rows] = 1.0 / np.maximum(self.totals[rows, _TOTAL], 1e-12)
        self.totals[rows, _MISSED] = np.count_nonzero(heads.mass_g, axis=1)
        self.totals[rows, _TIME] = self.totals[rows, _PHASES.start] = self.config.process.recognise_s
        self.pose[rows, 0] = self._centres[0] - self.config.machine.picker.camera_ahead_m
        self.pose[rows, 1:] = self._park
        self.rise_s[rows] = 0.0
        self.stop[rows] = 0
        self.first[rows] = 0
        self._clear_tracks(rows)
        if self.perception is None:
            self.look_due[rows] = True
        else:
            tracks = draw_tracks(self.config, self.perception, heads, camera_uniform, camera_normal)
            self._place_tracks(rows, tracks, 0)
            self.first[rows] = tracks.first
        chosen = np.zeros(self.worlds, bool)
        chosen[rows] = True
        self._fill_slots(chosen)
        if scenario.potted and not np.all(self.totals[rows, _TOTAL] > 0.0):
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
        self._fill_slots(self._rows == row)
        self.look_due[row] = False

    def plan(self, actions: NDArray[np.int64]) -> PickerPlan:
        """Turn actions (B,) into motions and nominal phase times."""
        slot, effort = np.divmod(actions, len(EFFORTS))
        place = self.slot_report[self._rows, slot]
        driving = slot == self.config.slots
        kind = np.where(self.track_legal.take(place), effort, NOTHING)
        start, rise_s = self.pose, self.rise_s
        target = self.track_target.reshape(-1, 3).take(place, axis=0)
        descent_s = next_rise_s = self.track_descent_s.take(place)
        if np.count_nonzero(driving):
            kind = np.where(driving, self._leaving.take(self.stop), kind)
            target = np.where(driving[:, None], self._next_look.take(self.stop, axis=0), target)
        if np.count_nonzero(kind > DRIVE):
            # Leaving the row is a rise; an illegal action is no motion at all, not even down again to where it is.
            finish, nothing = kind == FINISH, kind == NOTHING
            target[finish] = start[finish]
            target[finish, 2] = self._clear_m
            target[nothing] = start[nothing]
            slot = np.where(nothing, self.config.slots, slot)
            place = np.where(nothing, self._empty, place)
            next_rise_s = np.where(nothing, rise_s, descent_s)
            rise_s, descent_s = np.where(nothing, 0.0, rise_s), np.where(nothing, 0.0, descent_s)
        strokes = target[:, :2] - start[:, :2]
        beside_s = shortest(strokes, self._beside_pace, self._beside_square_pace)
        beside = np.maximum(beside_s[:, 0], beside_s[:, 1])
        phases = self._process_phases_s.take(kind, axis=0)
        phases[:, 1] = drive_s = beside * driving
        phases[:, 2] = rise_s + descent_s + (beside - drive_s)
        phases[:, 3] = self.config.machine.settle_s * (np.abs(strokes[:, 0]) > _STILL_M)
        return PickerPlan(kind, slot, place, start, target, rise_s, beside_s, descent_s, phases, next_rise_s)

    def apply(self, plan: PickerPlan, outcome: PickerOutcome) -> StepResult:
        """Cut, collect, book the time and move to the next decision."""
        kind = plan.kind
        picking = kind < DRIVE
        place = self._head_offset + self.track_head.take(plan.report)
        error = self.head_position.reshape(-1, 3).take(place, axis=0) - outcome.tool
        odds = self.head_odds.reshape(-1, 2).take(place, axis=0)
        mass = self.head_mass_g.take(place)
        share = cut_share(self.config.process, self._strokes.take(kind), error, odds[:, 0])
        cut = mass * share
        gained = cut * collected_share(self._dropped.take(kind), odds[:, 1])
        captured, visited = picking & (share > 0.0), self.head_visited.take(place)
        fresh = captured & ~visited
        self.head_mass_g.put(place, mass - cut)
        self.head_visited.put(place, visited | captured)
        done = fresh & (gained > 0.0)

        totals = self.totals
        elapsed = np.add.reduce(outcome.phases_s, axis=1)
        booked = self._booked_by_kind.take(kind, axis=0)
        booked[:, _TIME] = elapsed
        booked[:, _DONE] = done
        booked[:, _MISSED] = -booked[:, _DONE]
        booked[:, _DAMAGED] = fresh & (self.head_stage.take(place) == 0)
        booked[:, _PHASES] = outcome.phases_s
        booked[:, _GAINED] = gained
        booked[:, _DROPPED] = cut - gained
        booked[:, _WASTED] -= done
        totals += booked
        np.copyto(totals[:, _LAST], totals[:, _TIME], where=done)
        self.pose = plan.target
        self.rise_s = plan.next_rise_s
        self._advance(plan, picking)

        rewards = np.empty((len(kind), 3))
        rewards[:, 0] = gained
        rewards[:, 1] = (mass - gained) * done
        rewards[:, 2] = elapsed
        rewards *= self._weights
        terminated = kind == FINISH
        truncated = (totals[:, _TIME] >= self.config.scenario.time_limit_s) > terminated
        return StepResult(rewards, outcome.phases_s, terminated, truncated)

    def observe(self) -> dict[str, NDArray[np.float32 | np.int8]]:
        """What the machine knows: itself, the candidates of this stop, what it may do."""
        place = self.slot_report[:, :-1]
        feature = self.track_feature.reshape(-1, len(CANDIDATE_FEATURES)).take(place, axis=0)
        present = feature[..., 0]
        # Tool and cart travel side by side after the rise that every candidate shares; see plan().
        offset = self.track_target.reshape(-1, 3).take(place, axis=0) - self.pose[:, None]
        beside_s = shortest(offset[..., :2], self._beside_pace, self._beside_square_pace)
        travel_s = np.maximum(beside_s[..., 0], beside_s[..., 1]) + self.track_descent_s.take(place)
        feature[..., 1] = offset[..., 0] * present * (1.0 / AHEAD_SCALE_M)
        feature[..., 4] = (travel_s + self.rise_s[:, None]) * present * (1.0 / TRAVEL_SCALE_S)
        machine = np.empty((self.worlds, len(MACHINE_FEATURES)), np.float32)
        machine[:, :3] = (self.pose - self._stop_pose.take(self.stop, axis=0)) * self._pose_scale
        machine[:, 3] = self.totals[:, _TIME] * (1.0 / self.config.scenario.time_limit_s)
        machine[:, 4] = self._stops_left.take(self.stop)
        machine[:, 5] = self.remaining * (1.0 / self.config.slots)
        mask = np.empty((self.worlds, 3 * self.config.slots + 1), np.int8)
        mask[:, -1] = 1
        mask[:, :-1].reshape(self.worlds, -1, 3)[...] = self.track_legal.take(place)[..., None]
        return {"machine": machine, "candidates": feature.reshape(self.worlds, -1), "action_mask": mask}

    def scores(self) -> Array:
        """Scorecard so far; see ``score_names``. The net rate is eq. 35 over every open head of the field."""
        t = self.totals
        result = np.empty((self.worlds, len(self.score_names)))
        result[:, 0] = t[:, _GAINED] * self._per_total
        result[:, 1] = t[:, _LAST] / np.maximum(t[:, _DONE], 1.0)
        per_minute = 60.0 / t[:, _TIME]
        result[:, 2] = t[:, _DONE] * per_minute
        result[:, 3:-2] = t[:, :_LAST]
        result[:, -2] = t[:, _GAINED] * per_minute
        result[:, -1] = self.stop
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
        more = picking & (self.cursor < self.stop_end)
        self.remaining -= picking
        slots = self.slot_report
        slots[:, -1] = np.where(more, self.cursor, self._empty)
        slots[:, :-1] = np.where(self._slots < plan.slot[:, None], slots[:, :-1], slots[:, 1:])
        slots[:, -1] = self._empty
        self.cursor += more
        driven = plan.kind == DRIVE
        if np.count_nonzero(driven):
            self.stop += driven
            if self.perception is None:
                rows = np.flatnonzero(driven)
                self.look_due[rows] = True
                self.first[rows, self.stop[rows] + 1] = self.first[rows, self.stop[rows]]
            self._fill_slots(driven)

    def _fill_slots(self, chosen: NDArray[np.bool_]) -> None:
        """Show the first reports of the stop in the chosen worlds (B,)."""
        place = self._first_offset + self.stop
        begin, end = self._track_offset + self.first.take(place), self._track_offset + self.first.take(place + 1)
        reports = begin[:, None] + self._slots
        filled = np.where(reports < end[:, None], reports, self._empty[:, None])
        self.slot_report[:, :-1] = np.where(chosen[:, None], filled, self.slot_report[:, :-1])
        self.cursor = np.where(chosen, np.minimum(begin + self.config.slots, end), self.cursor)
        self.stop_end = np.where(chosen, end, self.stop_end)
        self.remaining = np.where(chosen, end - begin, self.remaining)

    def _clear_tracks(self, rows: Rows) -> None:
        self.track_feature[rows] = 0.0
        self.track_legal[rows] = False
        self.track_head[rows] = self._no_head

    def _place_tracks(self, rows: Rows, tracks: Tracks, start: int) -> None:
        """Write reports and all that policies are shown of them that does not depend on where the arm is."""
        where = slice(start, start + tracks.position.shape[1])
        target = tracks.position - self.frame
        descent = np.maximum(self._clear_m - target[..., 2], 0.0)
        half_width = np.interp(target[..., 2], *reach_table(self.config.machine.picker.five_bar), left=-1.0, right=-1.0)
        legal = (np.abs(tracks.position[..., 1]) <= half_width) & (target[..., 2] <= self._clear_m)
        feature = np.zeros((*descent.shape, len(CANDIDATE_FEATURES)), np.float32)
        feature[..., 0] = 1.0
        feature[..., 2] = tracks.position[..., 1] / ACROSS_SCALE_M
        feature[..., 3] = (target[..., 2] - self._clear_m) / HEIGHT_SCALE_M
        feature[..., 5:9] = tracks.stage[..., None] == np.arange(len(STAGES))
        feature[..., 9] = tracks.size_m / SIZE_SCALE_M
        feature[..., 10] = legal
        self.track_target[rows, where] = target
        self.track_descent_s[rows, where] = shortest(descent, self._beside_pace[1], self._beside_square_pace[1])
        self.track_legal[rows, where] = legal
        self.track_feature[rows, where] = feature
        self.track_head[rows, where] = tracks.head
