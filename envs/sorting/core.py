"""The rules of produce sorting over a batch of worlds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import pi
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..arrays import allocated
from ..columns import names
from ..core import Array, Rows, StepResult, observation_space, outside
from ..drives import Servos
from ..erring import ErringCore
from ..field import ABSENT, Camera
from .columns import ITEM, LIMIT, TOTAL, TRUTH, Candidate, Item, Machine, Phases, Rewards, Scores
from .completing import check_fit, completed, window
from .config import GRADES, PerceptionModel, SortingConfig
from .drawing import CameraModel, Stream, draw_streams, report_streams
from .errors import JOINTS, held_at, tool_error
from .field import ProduceField, Streams, booked, reports_of, stacked, unstacked
from .order_columns import OrderedMachine, OrderedScores, Tallies
from .orders import draw_orders, open_books, whole_book
from .reports import begin_worlds, take_reports
from .rules import apply_worlds, decide_worlds, end_phases, foresee_worlds, grip_worlds, plan_worlds, show_worlds
from .state import PICK, WAIT, Grip, SorterPlan, Tables, Worlds


class SorterOutcome(NamedTuple):
    """What happened: seconds of each phase (B, ``Phases``) and the grip."""

    phases_s: Array
    grip: Grip


class SortingCore(ErringCore[SorterPlan, SorterOutcome]):
    """Batched sorting task. Action k grips the candidate in slot k; the last action waits.

    Args:
        config: the task's numbers.
        perception: statistical camera, or None when reports come from outside through ``receive``.
        worlds: number of worlds B.
    """

    reward_names = names(Rewards)
    phase_names = names(Phases)
    score_names = names(Scores)
    machine_features = names(Machine)
    candidate_features = names(Candidate)
    field_type = ProduceField
    blocks = MappingProxyType(
        {"machine": Machine, "candidates": Candidate, "rewards": Rewards, "phases": Phases, "scores": Scores}
    )
    deciding, showing = staticmethod(decide_worlds), staticmethod(show_worlds)

    def __init__(self, config: SortingConfig, perception: PerceptionModel | None, worlds: int = 1):
        """Allocate the state."""
        super().__init__(worlds)
        self.config, self.perception = config, perception
        k, n, self._orders = config.slots, config.scenario.max_items, config.scenario.orders
        lines = self._orders.max_lines
        if lines:
            self.blocks = {**self.blocks, "machine": OrderedMachine, "scores": OrderedScores}
            self.machine_features, self.score_names = names(OrderedMachine), names(OrderedScores)
        self.action_space = spaces.Discrete(k + 1)
        self.observation_space = observation_space(self, k, k + 1, LIMIT)
        self.tables = Tables.of(config)
        self._stream, self._camera = Stream.of(config), CameraModel.of(config, perception or PerceptionModel.perfect())
        self._code = ABSENT if perception is None else int(Camera.of(perception).code[0])
        # Reports of nothing come on top; a real camera may report an item again.
        self._reports = n + len(self._camera.ghosts) if perception else 0
        sizes = {"items": n + 1, "reports": (self._reports or 2 * n) + 1, "slots": k}
        bins, tallies = (len(GRADES), len(names(Tallies))) if lines else (0, 0)
        self.state = allocated(Worlds, worlds, **sizes, lines=lines, bins=bins, tallies=tallies)
        self._drive(Servos.of(config.scenario.drives, *JOINTS))
        # What lies on the belt, one row an item, see ``columns.Item``. The last item stands for none.
        self.items = np.full((worlds, n + 1, len(Item._fields)), np.inf)
        self.sensor_seed = np.zeros(worlds, np.int64)
        self.episode = np.zeros(worlds, np.int64)

    @property
    def time_s(self) -> Array:
        """Seconds since the stream began, (B,)."""
        return self.state.totals[:, TOTAL.time_s]

    def draw(self, generators: Sequence[np.random.Generator]) -> Streams:
        """Draw new streams and what the camera reports of them."""
        luck, orders = self.draw_luck(generators), draw_orders(self._orders, generators)
        drawn = draw_streams(self._stream, self._camera, generators, self.items.shape[1] - 1, self._reports)
        return drawn._replace(luck=luck, orders=orders)

    def stack(self, fields: Sequence[ProduceField]) -> Streams:
        """The batch of fields in which nothing is missing."""
        streams = stacked(fields, self.items.shape[1] - 1, self._reports)
        return streams._replace(luck=self.luck_of(fields), orders=booked(fields, self._orders.max_lines))

    def unstack(self, batch: Streams) -> list[ProduceField]:
        """The fields of a batch."""
        return self.with_luck(unstacked(batch, self._code), batch.luck)

    def load(self, rows: Rows, batch: Streams) -> None:
        """Put streams into ``rows``; the belt is full up to the reach, the platform rests in the middle."""
        self.items[rows] = batch.items
        self.take_luck(rows, batch.luck)
        if batch.orders is not None:
            open_books(self.state, rows, batch.orders)
        begin_worlds(self.tables, self.state, rows, self.items)
        self.episode[rows] += 1
        self.sensor_seed[rows] = batch.noise_seed
        if self._reports:
            take_reports(self.tables, self.state, rows, batch.reports)

    @property
    def window(self) -> dict[str, tuple[float, float]]:
        """When items may pass the machine's middle, and where across the belt they may lie."""
        return window(self.config, self.items.shape[1] - 1)

    def complete(self, field: Any, generator: np.random.Generator) -> ProduceField:
        """See ``TaskCore.complete``; reports that another camera has made are made anew, without any they are made."""
        whole = super().complete(field, generator)
        code = ABSENT if whole.camera is None or not len(whole.camera) else whole.camera.code[0]
        if self.perception is None or code not in (ABSENT, self._code):
            whole = replace(whole, reports=None)
        given, book, last = whole.drives, whole.orders, self.items.shape[1] - 1
        whole = completed(whole, self.config, self._camera, self._code, generator)
        whole = self.with_whole_luck(whole, given, generator)
        whole = replace(whole, orders=whole_book(book, self._orders, generator))
        check_fit(whole, self.config, last, self._reports)
        if self.perception is None or whole.reports is not None:
            return whole
        said = report_streams(self._stream, self._camera, stacked([whole], last, 0).items, generator, self._reports)
        return replace(whole, reports=reports_of(said[0], last))

    def receive(self, row: int, reports: Array) -> None:
        """Add a camera's reports (n, columns) to one world; those that do not fit in the memory are forgotten.

        The columns are those of ``columns.Report``.
        """
        take_reports(self.tables, self.state, np.array([row]), reports[None])

    def rules(self) -> tuple[Tables]:
        """See ``KernelCore``."""
        return (self.tables,)

    def plan(self, actions: NDArray[np.int64]) -> SorterPlan:
        """Turn actions (B,) into motions and nominal phase times."""
        return plan_worlds(self.tables, self.state, actions)

    def grip(self, plan: SorterPlan, position: Array, axes: Array) -> Grip:
        """What the fingers get when they close with the platform at ``position`` (B, 3) and the tool's ``axes``.

        ``axes`` (B, 6) are the tool's x and z axes.
        """
        return grip_worlds(self.tables, self.state, plan, position, axes)

    def foreseen(self, plan: SorterPlan) -> Grip:
        """What the fingers get when the platform is exactly where the plan wants it: known since the report came."""
        return foresee_worlds(self.state, plan.report)

    def phases_of(self, plan: SorterPlan, held: NDArray[np.bool_]) -> Array:
        """Nominal seconds (B, ``Phases``) of each phase: after an empty grip the platform only comes to rest."""
        return end_phases(plan, held, self.tables.paces.stop_s)

    def nominal(self, plan: SorterPlan) -> SorterOutcome:
        """Nominal phase times, the tool where it was sent, or where drives that err bring it."""
        grip = self.foreseen(plan)
        if self.errs:
            found, picks = self.grip(plan, *held_at(plan, self.tool_error(plan))), plan.kind == PICK
            grip = Grip(np.where(picks, found.held, grip.held), np.where(picks, found.lost, grip.lost))
        return SorterOutcome(self.phases_of(plan, grip.held), grip)

    def tool_error(self, plan: SorterPlan) -> Array:
        """See ``ErringCore``: (B, 6) of the mechanism's pose as the fingers close."""
        return tool_error(self.config, self.servos, self.drive_luck, plan)

    def apply(self, plan: SorterPlan, outcome: SorterOutcome) -> StepResult:
        """Book the item and the time, and move to the next decision."""
        return apply_worlds(self.tables, self.state, plan, outcome.grip, outcome.phases_s)

    def misplaced(self) -> str:
        """See ``TaskCore.misplaced``."""
        items, reports = self.state.item_free.shape[1], self.state.report_item.shape[1]
        grade = self.state.item_truth[..., TRUTH.grade]
        if not ((grade >= 0.0) & (grade < len(GRADES))).all():
            return "item_truth"
        return outside(
            self.state,
            report_item=items,
            report_grade=len(GRADES),
            queue=reports,
            queued=reports,
            first=reports,
            slot_report=reports,
            line_grade=len(GRADES),
        )

    def describe(self, plan: SorterPlan, result: StepResult, row: int = 0) -> str:
        """One line about the last decision."""
        elapsed = float(result.phases_s[row].sum())
        if plan.kind[row] != PICK:
            return f"{'wait' if plan.kind[row] == WAIT else 'illegal action'}: {elapsed:.2f} s"
        names_of = ("placed", "wrong bin", "dropped", "nothing held")
        words = zip(result.rewards[row].tolist(), names_of, strict=True)
        what = next((word for value, word in words if value), "no reward")
        return f"{GRADES[int(plan.grade[row])]} from slot {int(plan.slot[row])}: {what}, {elapsed:.2f} s"

    def item_mass_kg(self, plan: SorterPlan, row: int = 0) -> float:
        """Mass of the item that a world's plan goes for; 0 where there is none."""
        number = int(self.state.report_item[row, plan.report[row]])
        if number == self.items.shape[1] - 1:
            return 0.0
        item = self.items[row, number]
        volume_m3 = pi / 6.0 * item[ITEM.length_m] ** 3 * item[ITEM.width] * item[ITEM.thickness]
        return float(self.config.produce.density_kg_m3 * volume_m3)

    def refusal(self, slot: int, row: int = 0) -> str:
        """Why a slot cannot be gripped now, in words; names the machine's limit where it is one. Empty if it can."""
        from .refusals import explain

        if self.observe()["action_mask"][row, slot]:
            return ""
        report = int(self.state.slot_report[row, slot])
        if report == self.state.number.shape[1] - 1:
            return "no item in this slot"
        return explain(self.config, self.state.number[row, report], float(self.time_s[row]))
