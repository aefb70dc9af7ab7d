"""The rules of safflower picking over a batch of worlds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ...motion import QUINTIC
from ...motion.laws import shortest
from ..core import COMMON_SCORES, Array, Rows, StepResult, TaskCore
from .config import EFFORTS, STAGES, PerceptionModel, SafflowerConfig
from .features import ACROSS_SCALE_M, CANDIDATE_FEATURES, HEIGHT_SCALE_M, MACHINE_FEATURES, SIZE_SCALE_M
from .field import Tracks, draw_blocks, draw_heads, draw_tracks, random_numbers, reach_table, stop_centres
from .process import Shears, dropped_share
from .rules import (
    DRIVE,
    FINISH,
    MISSED,
    NOTHING,
    PHASES,
    RECOGNISE,
    SHEAR,
    SUCK,
    TIME,
    TOTAL,
    TOTALS,
    PickerPlan,
    Tables,
    Worlds,
    apply_worlds,
    fill_rows,
    observe_worlds,
    plan_worlds,
    score_worlds,
)


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
        self.action_space = spaces.Discrete(DRIVE * k + 1)
        self.observation_space = spaces.Dict(
            {
                "machine": spaces.Box(-10.0, 10.0, (len(MACHINE_FEATURES),), np.float32),
                # A flat vector, row by row: learning libraries take two axes for a broken image and warn.
                "candidates": spaces.Box(-10.0, 10.0, (k * len(CANDIDATE_FEATURES),), np.float32),
                "action_mask": spaces.Box(0, 1, (DRIVE * k + 1,), np.int8),
            }
        )
        stops = stop_centres(scenario)
        self._centres = stops
        park = np.array([0.5 * picker.five_bar.base_m, config.machine.clear_level_m])
        stop_pose = np.column_stack([stops, np.tile(park, (len(stops), 1))])
        looking_pose = stop_pose - [picker.camera_ahead_m, 0.0, 0.0]
        # World (along, across, up) of the arm plane's (cart, u, v) = 0.
        self.frame = np.array([0.0, -park[0], scenario.motor_height_m])
        self._first_pose = looking_pose[0]
        self._numbers = random_numbers(config, perception or PerceptionModel.perfect())

        phases_s = np.zeros((FINISH + 1, len(self.phase_names)))
        phases_s[:, RECOGNISE] = [process.locate_s] * DRIVE + [process.recognise_s, process.illegal_s, 0.0]
        phases_s[:DRIVE, SHEAR] = np.array(process.strokes) * process.stroke_m / process.shear_speed
        phases_s[:DRIVE, SUCK] = process.suction_s
        pace_s_m, square_pace_s2_m = QUINTIC.paces(
            np.array([picker.cart_velocity_m_s, picker.tool_velocity_m_s]),
            np.array([picker.cart_acceleration_m_s2, picker.tool_acceleration_m_s2]),
        )
        self.tables = Tables(
            phases_s=phases_s,
            strokes=np.array(process.strokes, float),
            dropped=np.array([dropped_share(process, suction_s) for suction_s in process.suction_s]),
            shears=Shears.of(process),
            pace_s_m=pace_s_m,
            square_pace_s2_m=square_pace_s2_m,
            settle_s=float(config.machine.settle_s),
            clear_m=float(config.machine.clear_level_m),
            stop_pose=stop_pose,
            next_look=looking_pose[np.minimum(np.arange(len(stops)) + 1, len(stops) - 1)],
            weights=np.array([config.weights.collected_g, config.weights.lost_g, config.weights.seconds]),
            time_limit_s=float(scenario.time_limit_s),
            from_outside=perception is None,
        )
        b = worlds
        self.state = Worlds(
            head_position=np.zeros((b, heads + 1, 3)),
            head_stage=np.zeros((b, heads + 1), np.int64),
            head_mass_g=np.zeros((b, heads + 1)),
            head_visited=np.zeros((b, heads + 1), bool),
            head_odds=np.ones((b, heads + 1, 2)),
            track_target=np.zeros((b, tracks + 1, 3)),
            track_feature=np.zeros((b, tracks + 1, len(CANDIDATE_FEATURES)), np.float32),
            track_descent_s=np.zeros((b, tracks + 1)),
            track_legal=np.zeros((b, tracks + 1), bool),
            track_head=np.full((b, tracks + 1), heads),
            first=np.zeros((b, scenario.stops + 1), np.int64),
            slot_report=np.full((b, k + 1), tracks),
            cursor=np.zeros(b, np.int64),
            stop_end=np.zeros(b, np.int64),
            remaining=np.zeros(b, np.int64),
            stop=np.zeros(b, np.int64),
            look_due=np.zeros(b, bool),
            pose=np.zeros((b, 3)),
            rise_s=np.zeros(b),
            totals=np.zeros((b, TOTALS)),
        )
        # What the pictures show and the rules do not ask for.
        self.head_exists = np.zeros((b, heads + 1), bool)
        self.head_occluded = np.zeros((b, heads + 1), bool)
        self.head_size_m = np.zeros((b, heads + 1))
        self.plant_base = np.zeros((b, scenario.plants, 3))
        self.plant_height_m = np.zeros((b, scenario.plants))
        self.plant_crown_m = np.zeros((b, scenario.plants))
        self.episode = np.zeros(b, np.int64)

    def draw(self, generators: Sequence[np.random.Generator]) -> Any:
        """Draw fields and what the statistical camera reports of them."""
        uniform, normal, camera_uniform, camera_normal = draw_blocks(generators, self._numbers)
        heads, plants = draw_heads(self.config, uniform, normal)
        if self.perception is None:
            return heads, plants, None
        return heads, plants, draw_tracks(self.config, self.perception, heads, camera_uniform, camera_normal)

    def load(self, rows: Rows, batch: Any) -> None:
        """Put fields into ``rows`` and the carts at their first stop, reports taken."""
        scenario, state = self.config.scenario, self.state
        heads, plants, tracks = batch
        state.head_position[rows, :-1] = heads.position - self.frame
        state.head_stage[rows, :-1] = heads.stage
        state.head_mass_g[rows, :-1] = heads.mass_g
        state.head_visited[rows] = False
        state.head_odds[rows, :-1, 0] = np.exp(self.config.process.luck_logit * heads.cut_luck)
        state.head_odds[rows, :-1, 1] = np.exp(self.config.process.luck_logit * heads.drop_luck)
        self.head_exists[rows, :-1], self.head_occluded[rows, :-1] = heads.exists, heads.occluded
        self.head_size_m[rows, :-1] = heads.size_m
        self.plant_base[rows], self.plant_height_m[rows] = plants.base, plants.height_m
        self.plant_crown_m[rows] = plants.crown_m
        self.episode[rows] += 1
        state.totals[rows] = 0.0
        state.totals[rows, TOTAL] = heads.mass_g.sum(axis=1)
        state.totals[rows, MISSED] = np.count_nonzero(heads.mass_g, axis=1)
        state.totals[rows, TIME] = state.totals[rows, PHASES + RECOGNISE] = self.config.process.recognise_s
        state.pose[rows] = self._first_pose
        state.rise_s[rows] = 0.0
        state.stop[rows] = 0
        state.first[rows] = 0
        state.track_feature[rows] = 0.0
        state.track_legal[rows] = False
        state.track_head[rows] = state.head_mass_g.shape[1] - 1
        if tracks is None:
            state.look_due[rows] = True
        else:
            self._place_tracks(rows, tracks, 0)
            state.first[rows] = tracks.first
        fill_rows(state, rows)
        if scenario.potted and not np.all(state.totals[rows, TOTAL] > 0.0):
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
        state, stop = self.state, self.state.stop[row]
        start = int(state.first[row, stop])
        n = min(len(position), self.config.scenario.max_tracks - start)
        one = slice(None, n)
        tracks = Tracks(
            position[None, one], stage[None, one], size_m[None, one], head[None, one], np.zeros((1, 1), np.int64)
        )
        rows = np.array([row])
        self._place_tracks(rows, tracks, start)
        state.first[row, stop + 1 :] = start + n
        fill_rows(state, rows)
        state.look_due[row] = False

    def plan(self, actions: NDArray[np.int64]) -> PickerPlan:
        """Turn actions (B,) into motions and nominal phase times."""
        return plan_worlds(self.tables, self.state, actions)

    def stack(self, fields: Sequence[Any]) -> Any:
        """The batch of fields."""
        raise NotImplementedError

    def unstack(self, batch: Any) -> list[Any]:
        """The fields of a batch."""
        raise NotImplementedError

    def nominal(self, plan: PickerPlan) -> PickerOutcome:
        """Nominal phase times, the tool exactly where it was sent."""
        return PickerOutcome(plan.phases_s, plan.target)

    def apply(self, plan: PickerPlan, outcome: PickerOutcome) -> StepResult:
        """Cut, collect, book the time and move to the next decision."""
        return apply_worlds(self.tables, self.state, plan, outcome.phases_s, outcome.tool)

    def observe(self) -> dict[str, NDArray[np.float32 | np.int8]]:
        """What the machine knows: itself, the candidates of this stop, what it may do."""
        machine, candidates, mask = observe_worlds(self.tables, self.state)
        return {"machine": machine, "candidates": candidates, "action_mask": mask}

    def scores(self) -> Array:
        """Scorecard so far; see ``score_names``. The net rate is eq. 35 over every open head of the field."""
        return score_worlds(self.state)

    def describe(self, plan: PickerPlan, result: StepResult, row: int = 0) -> str:
        """One line about the last decision."""
        kind = int(plan.kind[row])
        elapsed = float(result.phases_s[row].sum())
        if kind < DRIVE:
            grams = float(result.rewards[row, 0]) / (self.config.weights.collected_g or 1.0)
            return f"pick slot {int(plan.slot[row])} {EFFORTS[kind]}: {grams:.3f} g in {elapsed:.1f} s"
        words = {
            DRIVE: f"drive to stop {int(self.state.stop[row]) + 1}/{len(self._centres)}",
            NOTHING: "illegal action",
        }
        return f"{words.get(kind, 'leave the row')}: {elapsed:.1f} s"

    def _place_tracks(self, rows: Rows, tracks: Tracks, start: int) -> None:
        """Write reports and all that policies are shown of them that does not depend on where the arm is."""
        where = slice(start, start + tracks.position.shape[1])
        state, clear_m = self.state, self.tables.clear_m
        target = tracks.position - self.frame
        descent = np.maximum(clear_m - target[..., 2], 0.0)
        half_width = np.interp(target[..., 2], *reach_table(self.config.machine.picker.five_bar), left=-1.0, right=-1.0)
        legal = (np.abs(tracks.position[..., 1]) <= half_width) & (target[..., 2] <= clear_m)
        feature = np.zeros((*descent.shape, len(CANDIDATE_FEATURES)), np.float32)
        feature[..., 0] = 1.0
        feature[..., 2] = tracks.position[..., 1] / ACROSS_SCALE_M
        feature[..., 3] = (target[..., 2] - clear_m) / HEIGHT_SCALE_M
        feature[..., 5:9] = tracks.stage[..., None] == np.arange(len(STAGES))
        feature[..., 9] = tracks.size_m / SIZE_SCALE_M
        feature[..., 10] = legal
        state.track_target[rows, where] = target
        state.track_descent_s[rows, where] = shortest(descent, self.tables.pace_s_m[1], self.tables.square_pace_s2_m[1])
        state.track_legal[rows, where] = legal
        state.track_feature[rows, where] = feature
        state.track_head[rows, where] = tracks.head
