"""The rules of safflower picking over a batch of worlds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..columns import names
from ..core import Array, Rows, StepResult, observation_space, outside
from ..dice import draw_blocks
from ..drives import Servos
from ..erring import ErringCore
from .batch import Batch, Tracks, stack, unstack
from .beginning import Looks, Outset, begin_tracks, begin_worlds, take_tracks
from .config import EFFORTS, STAGES, PerceptionModel, SafflowerConfig
from .drawing import Growth, draw_heads
from .errors import JOINTS, tool_error
from .features import LIMIT, Candidate, DemandingCandidate, DemandingMachine, Machine
from .field import SafflowerField, Stands
from .filling import completed, row_limits_m
from .rules import apply_worlds, decide_worlds, plan_worlds, show_worlds
from .sighting import Sight, draw_tracks
from .standing import draw_stands, stand_error, whole_stands
from .state import PickerPlan, R, Rewards, Scores, Tables, empty_worlds, tables_of
from .timing import DRIVE, EMPTY, NOTHING, Phases
from .wilting import closings_of, draw_closings, put_closings, show_closings, whole_closings, with_closings


class PickerOutcome(NamedTuple):
    """What happened: ``phases_s`` (B, 6) seconds and ``tool`` (B, 3) where the tool really was while it cut."""

    phases_s: Array
    tool: Array


class SafflowerCore(ErringCore[PickerPlan, PickerOutcome]):
    """Batched picking task. An action is ``slot * 3 + effort``; ``3 K`` drives on.

    Where a bag fills up or filaments wilt, ``3 K + 1`` empties the bag, and more is shown (see ``features``).

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
        k, actions = config.slots, DRIVE * config.slots + 1
        if config.scenario.demanding:
            actions += 1
            self.blocks = {**self.blocks, "machine": DemandingMachine, "candidates": DemandingCandidate}
            self.machine_features, self.candidate_features = names(DemandingMachine), names(DemandingCandidate)
        self.exact = perception == PerceptionModel.perfect()
        self.action_space = spaces.Discrete(actions)
        self.observation_space = observation_space(self, k, actions, LIMIT)
        self.tables = tables_of(config, perception is None)
        self._growth, self._sight = Growth.of(config), Sight.of(config, perception or PerceptionModel.perfect())
        heads = config.scenario.plants * config.scenario.max_heads
        self._numbers = (*self._growth.random_numbers, *self._sight.random_numbers(heads))
        (along, across, up), process = self.frame.tolist(), config.process
        self._outset = Outset(
            (along, across, up), self._growth.reach, float(process.luck_logit), float(process.recognise_s)
        )
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
        uniform, normal, camera_uniform, camera_normal = draw_blocks(generators, self._numbers)
        heads, plants = draw_heads(self._growth, uniform, normal)
        closings = draw_closings(self.config, generators, heads.stage)
        if self.perception is None:
            return Batch(heads, plants, None, luck, stands, closings)
        tracks = draw_tracks(self._sight, heads, camera_uniform, camera_normal)
        return Batch(heads, plants, tracks, luck, stands, closings)

    def stack(self, fields: Sequence[SafflowerField]) -> Batch:
        """The batch of fields in which nothing is missing."""
        stands = [one.stands for one in fields if one.stands is not None]
        rows = np.array([[one.heave_m, one.pitch_rad, one.roll_rad] for one in stands])
        whole = rows.transpose(0, 2, 1) if self.rough else None
        batch = stack(self.config, fields)
        closings = closings_of(fields, batch.heads.exists.shape[1])
        return batch._replace(luck=self.luck_of(fields), stands=whole, closings=closings)

    def unstack(self, batch: Batch) -> list[SafflowerField]:
        """The fields of a batch."""
        fields = with_closings(self.with_luck(unstack(batch, self.perception), batch.luck), batch.closings)
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
        sight = self._sight if self.perception else None
        done = completed(self.config, sight, self.perception, whole, generator)
        done = self.with_whole_luck(done, whole.drives, generator)
        done = replace(done, closings=whole_closings(self.config, done, generator))
        return replace(done, stands=whole_stands(self.config, whole.stands, generator))

    def load(self, rows: Rows, batch: Batch) -> None:
        """Put fields into ``rows`` and the carts at their first stop, reports taken."""
        state, tables, outset = self.state, self.tables, self._outset
        heads, plants, tracks, luck, stands, closings = batch
        self.take_luck(rows, luck)
        if stands is not None:
            self.stands[rows] = stands
        looks = Looks(
            self.head_exists,
            self.head_occluded,
            self.head_size_m,
            self.head_plant,
            self.plant_base,
            self.plant_count,
            self.plant_height_m,
            self.plant_crown_m,
        )
        # NumPy adds up in pairs, and scores hold the last digit of that sum.
        begin_worlds(tables, outset, state, looks, rows, heads, plants, heads.mass_g.sum(axis=1))
        self.episode[rows] += 1
        if tracks is None:
            state.look_due[rows] = True
        else:
            begin_tracks(tables, outset, state, rows, tracks)
        if closings is not None:
            put_closings(self.config, state, rows, closings, tracks is not None, self.exact)

    def receive(self, row: int, position: Array, stage: NDArray[np.int64], size_m: Array, head: Rows) -> None:
        """Take a camera's reports of the present stop into one world, in the fixed order.

        Args:
            row: the world.
            position: (n, 3), world metres.
            stage: (n,), reported stage.
            size_m: (n,), reported filament spread.
            head: (n,), the true head behind each report, ``head_mass_g.shape[1] - 1`` for none; for scoring alone.
        """
        place, told, size = np.ascontiguousarray(position), np.ascontiguousarray(stage), np.ascontiguousarray(size_m)
        behind, no_stops = np.ascontiguousarray(head), np.zeros((1, 1), np.int64)
        tracks = Tracks(place[None], told[None], size[None], behind[None], no_stops)
        take_tracks(self.tables, self._outset, self.state, row, tracks)
        if self.config.scenario.demanding:
            start, end = self.state.first[row, self.state.stop[row] : self.state.stop[row] + 2]
            show_closings(self.config, self.state, row, slice(int(start), int(end)), None)
        self.state.look_due[row] = False

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
            EMPTY: "empty the bag",
        }
        return f"{words.get(kind, 'leave the row')}: {elapsed:.1f} s"
