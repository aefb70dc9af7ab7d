"""The rules of safflower picking over a batch of worlds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ...kernels.elementary import exp
from ..columns import names
from ..core import Array, Rows, StepResult, observation_space, outside
from ..drives import Servos
from ..erring import ErringCore
from .batch import Batch, Tracks, stack, unstack
from .config import EFFORTS, STAGES, PerceptionModel, SafflowerConfig
from .drawing import draw_batch, reach_table
from .errors import JOINTS, tool_error
from .features import ACROSS_SCALE_M, HEIGHT_SCALE_M, LIMIT, SIZE_SCALE_M, C, Candidate, Machine
from .field import SafflowerField, Stands
from .filling import completed, row_limits_m
from .rules import apply_worlds, decide_worlds, fill_rows, plan_worlds, show_worlds
from .standing import draw_stands, stand_error, whole_stands
from .state import PickerPlan, R, Rewards, Scores, T, Tables, empty_worlds, tables_of
from .timing import DRIVE, NOTHING, Phases, levels_s


class PickerOutcome(NamedTuple):
    """What happened: ``phases_s`` (B, 6) seconds and ``tool`` (B, 3) where the tool really was while it cut."""

    phases_s: Array
    tool: Array


class SafflowerCore(ErringCore[PickerPlan, PickerOutcome]):
    """Batched picking task. An action is ``slot * 3 + effort``; the last action drives on.

    Args:
        config: the task's numbers.
        perception: statistical camera, or None when reports come from outside through ``receive``.
        worlds: number of worlds B.

    Attributes:
        rough: whether the cart's stops lie on ground that is no plane.
        stands: (B, S, 3), how it stands at them, see ``standing``; no stops on a plane.
    """

    reward_names = names(Rewards)
    phase_names = names(Phases)
    score_names = names(Scores)
    machine_features = names(Machine)
    candidate_features = names(Candidate)
    field_type = SafflowerField
    blocks = MappingProxyType(
        {"machine": Machine, "candidates": Candidate, "rewards": Rewards, "phases": Phases, "scores": Scores}
    )
    deciding, showing = staticmethod(decide_worlds), staticmethod(show_worlds)

    def __init__(self, config: SafflowerConfig, perception: PerceptionModel | None, worlds: int = 1):
        """Allocate the state."""
        super().__init__(worlds)
        self.config, self.perception = config, perception
        k = config.slots
        self.action_space = spaces.Discrete(DRIVE * k + 1)
        self.observation_space = observation_space(self, k, DRIVE * k + 1, LIMIT)
        self.tables = tables_of(config, perception is None)
        self.state = empty_worlds(config, worlds)
        self._drive(Servos.of(config.scenario.drives, *JOINTS))
        self.rough = config.scenario.ground.rough
        self.stepwise = self.errs or self.rough
        self.stands = np.zeros((worlds, config.scenario.stops if self.rough else 0, 3))
        # What the pictures show and the rules do not ask for.
        slots, plants = self.state.head_mass_g.shape[1] - 1, config.scenario.plants
        self.head_exists, self.head_occluded = np.zeros((2, worlds, slots), bool)
        self.head_size_m, self.head_plant = np.zeros((worlds, slots)), np.zeros((worlds, slots), np.int64)
        self.plant_base, self.plant_count = np.zeros((worlds, plants, 3)), np.zeros(worlds, np.int64)
        self.plant_height_m, self.plant_crown_m = np.zeros((2, worlds, plants))
        self.episode = np.zeros(worlds, np.int64)

    @property
    def frame(self) -> Array:
        """World (along, across, up) of the arm plane's (cart, u, v) = 0."""
        machine, scenario = self.config.machine, self.config.scenario
        return np.array([0.0, -0.5 * machine.picker.five_bar.base_m, scenario.motor_height_m])

    def draw(self, generators: Sequence[np.random.Generator]) -> Batch:
        """Draw fields and what the statistical camera reports of them."""
        luck, stands = self.draw_luck(generators), draw_stands(self.config, generators)
        return draw_batch(self.config, self.perception, generators)._replace(luck=luck, stands=stands)

    def stack(self, fields: Sequence[SafflowerField]) -> Batch:
        """The batch of fields in which nothing is missing."""
        stands = [one.stands for one in fields if one.stands is not None]
        rows = np.array([[one.heave_m, one.pitch_rad, one.roll_rad] for one in stands])
        whole = rows.transpose(0, 2, 1) if self.rough else None
        return stack(self.config, fields)._replace(luck=self.luck_of(fields), stands=whole)

    def unstack(self, batch: Batch) -> list[SafflowerField]:
        """The fields of a batch."""
        fields = self.with_luck(unstack(batch, self.perception), batch.luck)
        if batch.stands is None:
            return fields
        return [replace(one, stands=Stands(*rows.T.copy())) for one, rows in zip(fields, batch.stands, strict=True)]

    @property
    def window(self) -> dict[str, tuple[float, float]]:
        """Where along the row heads may be."""
        return {"along_m": row_limits_m(self.config.scenario)}

    def complete(self, field: Any, generator: np.random.Generator) -> SafflowerField:
        """A field with nothing missing; see ``filling``."""
        whole = super().complete(field, generator)
        done = completed(self.config, self.perception, whole, generator)
        done = self.with_whole_luck(done, whole.drives, generator)
        return replace(done, stands=whole_stands(self.config, whole.stands, generator))

    def load(self, rows: Rows, batch: Batch) -> None:
        """Put fields into ``rows`` and the carts at their first stop, reports taken."""
        state = self.state
        heads, plants, tracks, luck, stands = batch
        self.take_luck(rows, luck)
        if stands is not None:
            self.stands[rows] = stands
        state.head_position[rows, :-1] = heads.position - self.frame
        state.head_stage[rows, :-1] = heads.stage
        state.head_mass_g[rows, :-1] = heads.mass_g
        state.head_visited[rows] = False
        state.head_odds[rows, :-1, 0] = exp(self.config.process.luck_logit * heads.cut_luck)
        state.head_odds[rows, :-1, 1] = exp(self.config.process.luck_logit * heads.drop_luck)
        self.head_exists[rows], self.head_occluded[rows] = heads.exists, heads.occluded
        self.head_size_m[rows], self.head_plant[rows] = heads.size_m, heads.plant
        self.plant_base[rows], self.plant_count[rows] = plants.base, plants.count
        self.plant_height_m[rows], self.plant_crown_m[rows] = plants.height_m, plants.crown_m
        self.episode[rows] += 1
        state.totals[rows] = 0.0
        state.totals[rows, T.total] = heads.mass_g.sum(axis=1)
        state.totals[rows, T.missed] = np.count_nonzero(heads.mass_g, axis=1)
        state.totals[rows, T.time] = state.totals[rows, T.recognise] = self.config.process.recognise_s
        state.pose[rows] = self.tables.look_pose[0]
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

    def rules(self) -> tuple[Tables]:
        """See ``KernelCore``."""
        return (self.tables,)

    def plan(self, actions: NDArray[np.int64]) -> PickerPlan:
        """Turn actions (B,) into motions and nominal phase times."""
        return plan_worlds(self.tables, self.state, actions)

    def nominal(self, plan: PickerPlan) -> PickerOutcome:
        """Nominal phase times, the tool where it was sent, or where drives that err and a tilted frame bring it."""
        tool = plan.target + self.tool_error(plan) if self.errs else plan.target
        return PickerOutcome(plan.phases_s, tool + self.stand_error(plan.target) if self.rough else tool)

    def tool_error(self, plan: PickerPlan) -> Array:
        """See ``ErringCore``: (B, 3), cart, u and v."""
        return tool_error(self.config, self.servos, self.drive_luck, plan)

    def stand_error(self, tool: Array) -> Array:
        """What tools at (B, 3) are off by because of how their frames stand at the present stops."""
        return stand_error(self.config, self.stands, self.state.stop, tool)

    def apply(self, plan: PickerPlan, outcome: PickerOutcome) -> StepResult:
        """Cut, collect, book the time and move to the next decision."""
        return apply_worlds(self.tables, self.state, plan, outcome.phases_s, outcome.tool)

    def misplaced(self) -> str:
        """See ``TaskCore.misplaced``."""
        heads, reports = self.state.head_stage.shape[1], self.state.track_head.shape[1]
        return outside(
            self.state,
            head_stage=len(STAGES),
            track_head=heads,
            first=reports,
            slot_report=reports,
            cursor=reports,
            stop_end=reports,
            remaining=reports,
            stop=self.state.first.shape[1] - 1,
        ) or outside(self, head_plant=self.plant_base.shape[1], plant_count=self.plant_base.shape[1] + 1)

    def describe(self, plan: PickerPlan, result: StepResult, row: int = 0) -> str:
        """One line about the last decision."""
        kind = int(plan.kind[row])
        elapsed = float(result.phases_s[row].sum())
        if kind < DRIVE:
            grams = float(result.rewards[row, R.collected]) / (self.config.weights.collected_g or 1.0)
            return f"pick slot {int(plan.slot[row])} {EFFORTS[kind]}: {grams:.3f} g in {elapsed:.1f} s"
        words = {
            DRIVE: f"drive to stop {int(self.state.stop[row]) + 1}/{len(self.tables.stop_pose)}",
            NOTHING: "illegal action",
        }
        return f"{words.get(kind, 'leave the row')}: {elapsed:.1f} s"

    def _place_tracks(self, rows: Rows, tracks: Tracks, start: int) -> None:
        """Write reports and all that policies are shown of them that does not depend on where the arm is."""
        where = slice(start, start + tracks.position.shape[1])
        state, rates = self.state, self.tables.rates
        target = tracks.position - self.frame
        level = target[..., 2]
        half_width = np.interp(level, *reach_table(self.config.machine.picker.five_bar), left=-1.0, right=-1.0)
        legal = (np.abs(tracks.position[..., 1]) <= half_width) & (level <= rates.clear_m)
        feature = np.zeros((*level.shape, len(C)), np.float32)
        feature[..., C.present] = 1.0
        feature[..., C.across] = tracks.position[..., 1] / ACROSS_SCALE_M
        feature[..., C.height] = (level - rates.clear_m) / HEIGHT_SCALE_M
        feature[..., C.bud : C.dry + 1] = tracks.stage[..., None] == np.arange(C.dry + 1 - C.bud)
        feature[..., C.size] = tracks.size_m / SIZE_SCALE_M
        feature[..., C.reachable] = legal
        np.maximum(np.minimum(feature, LIMIT, out=feature), -LIMIT, out=feature)
        state.track_target[rows, where] = target
        state.track_descent_s[rows, where] = levels_s(rates, level.ravel()).reshape(level.shape)
        state.track_legal[rows, where] = legal
        state.track_feature[rows, where] = feature
        state.track_head[rows, where] = tracks.head
