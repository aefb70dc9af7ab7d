"""The rules of produce sorting over a batch of worlds."""

from __future__ import annotations

from collections.abc import Sequence
from math import pi
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..core import COMMON_SCORES, Array, Rows, StepResult, TaskCore
from .config import GRADES, PerceptionModel, SortingConfig
from .features import CANDIDATE_FEATURES, MACHINE_FEATURES
from .field import (
    ITEM,
    LENGTH_M,
    REPORT,
    THICKNESS,
    WIDTH,
    Camera,
    Stream,
    draw_blocks,
    draw_items,
    draw_reports,
    random_numbers,
)
from .reports import begin_worlds, take_reports
from .rules import apply_worlds, end_phases, foresee_worlds, grip_worlds, observe_worlds, plan_worlds, score_worlds
from .state import PICK, TIME, WAIT, Grip, SorterPlan, Tables, Worlds

_FEATURE_LIMIT = 10.0


class SorterOutcome(NamedTuple):
    """What happened: seconds of each phase (B, 7) and the grip."""

    phases_s: Array
    grip: Grip


class SortingCore(TaskCore[SorterPlan, SorterOutcome]):
    """Batched sorting task. Action k grips the candidate in slot k; the last action waits.

    Args:
        config: the task's numbers.
        perception: statistical camera, or None when reports come from outside through ``receive``.
        worlds: number of worlds B.
    """

    reward_names = ("placed", "misplaced", "dropped", "wasted")
    phase_names = ("wait", "approach", "descend", "grip", "lift", "carry", "release")

    def __init__(self, config: SortingConfig, perception: PerceptionModel | None, worlds: int = 1):
        """Allocate the state."""
        super().__init__(worlds)
        self.config, self.perception = config, perception
        k, n = config.slots, config.scenario.max_items
        self.score_names = (
            *COMMON_SCORES,
            *(f"phase_{name}_s" for name in self.phase_names),
            *("value_rate", "misplaced", "dropped", "wasted", "total", "picks_per_min"),
        )
        self.action_space = spaces.Discrete(k + 1)
        limit = _FEATURE_LIMIT
        self.observation_space = spaces.Dict(
            {
                "machine": spaces.Box(-limit, limit, (len(MACHINE_FEATURES),), np.float32),
                "candidates": spaces.Box(-limit, limit, (k * len(CANDIDATE_FEATURES),), np.float32),
                "action_mask": spaces.Box(0, 1, (k + 1,), np.int8),
            }
        )
        self.tables = Tables.of(config)
        self._stream, self._camera = Stream.of(config), Camera.of(config, perception or PerceptionModel.perfect())
        self._numbers = random_numbers(config.scenario, self._camera)
        # Reports of nothing come on top; a real camera may report an item again.
        reports = n + (len(self._camera.ghosts) if perception else n)
        self.state = Worlds.room(worlds, n, reports, k)
        # What lies on the belt, one row an item; see ``scenario.ITEM``. The last item stands for none.
        self.items = np.full((worlds, n + 1, len(ITEM)), np.inf)
        self.sensor_seed = np.zeros(worlds, np.int64)
        self.episode = np.zeros(worlds, np.int64)

    @property
    def time_s(self) -> Array:
        """Seconds since the stream began, (B,)."""
        return self.state.totals[:, TIME]

    def draw(self, generators: Sequence[np.random.Generator]) -> Any:
        """Draw new streams."""
        return draw_blocks(generators, self._numbers)

    def load(self, rows: Rows, batch: Any) -> None:
        """Put streams into ``rows``; the belt is full up to the reach, the platform rests in the middle."""
        uniform, normal, camera_uniform, camera_normal = batch
        draw_items(self._stream, self.items, rows, uniform, normal)
        begin_worlds(self.tables, self.state, rows, self.items)
        self.episode[rows] += 1
        self.sensor_seed[rows] = (camera_uniform[:, 0] * 2.0**52).astype(np.int64)
        if self.perception is not None:
            drawn = np.empty((len(rows), self.state.number.shape[1] - 1, len(REPORT)))
            draw_reports(self._stream, self._camera, self.items, rows, camera_uniform, camera_normal, drawn)
            take_reports(self.tables, self.state, rows, drawn)

    def receive(self, row: int, reports: Array) -> None:
        """Add a camera's reports (n, columns) to one world; those that do not fit in the memory are forgotten.

        The columns are ``scenario.REPORT``.
        """
        take_reports(self.tables, self.state, np.array([row]), reports[None])

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
        """Nominal seconds (B, 7) of each phase: after an empty grip the platform only comes to rest."""
        return end_phases(plan, held, self.tables.stop_s)

    def stack(self, fields: Sequence[Any]) -> Any:
        """The batch of fields."""
        raise NotImplementedError

    def unstack(self, batch: Any) -> list[Any]:
        """The fields of a batch."""
        raise NotImplementedError

    def nominal(self, plan: SorterPlan) -> SorterOutcome:
        """Nominal phase times, the tool exactly where it was sent."""
        grip = self.foreseen(plan)
        return SorterOutcome(self.phases_of(plan, grip.held), grip)

    def apply(self, plan: SorterPlan, outcome: SorterOutcome) -> StepResult:
        """Book the item and the time, and move to the next decision."""
        return apply_worlds(self.tables, self.state, plan, outcome.grip, outcome.phases_s)

    def observe(self) -> dict[str, NDArray[np.float32 | np.int8]]:
        """What the machine knows: itself, the items that it has seen and that have not left, what it may do."""
        machine, candidates, mask = observe_worlds(self.tables, self.state)
        return {"machine": machine, "candidates": candidates, "action_mask": mask}

    def scores(self) -> Array:
        """Scorecard so far; see ``score_names``. The net rate's denominator is every item of the stream."""
        return score_worlds(self.state.totals)

    def describe(self, plan: SorterPlan, result: StepResult, row: int = 0) -> str:
        """One line about the last decision."""
        elapsed = float(result.phases_s[row].sum())
        if plan.kind[row] != PICK:
            return f"{'wait' if plan.kind[row] == WAIT else 'illegal action'}: {elapsed:.2f} s"
        placed, misplaced, dropped, wasted = (float(value) for value in result.rewards[row])
        words = [(placed, "placed"), (misplaced, "wrong bin"), (dropped, "dropped"), (wasted, "nothing held")]
        what = next((word for value, word in words if value), "no reward")
        return f"{GRADES[int(plan.grade[row])]} from slot {int(plan.slot[row])}: {what}, {elapsed:.2f} s"

    def item_mass_kg(self, plan: SorterPlan, row: int = 0) -> float:
        """Mass of the item that a world's plan goes for; 0 where there is none."""
        number = int(self.state.report_item[row, plan.report[row]])
        if number == self.items.shape[1] - 1:
            return 0.0
        item = self.items[row, number]
        volume_m3 = pi / 6.0 * item[LENGTH_M] ** 3 * item[WIDTH] * item[THICKNESS]
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
