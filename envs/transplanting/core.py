"""The rules of tray transplanting over a batch of worlds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..core import COMMON_SCORES, Array, Rows, StepResult, TaskCore
from .config import EMPTY, HEALTHY, SPEEDS, PerceptionModel, TransplantingConfig
from .features import CANDIDATE_FEATURES, MACHINE_FEATURES, MOVE_SCALE_S, PLACE_SCALE_M
from .field import LUCKS, Cells, draw_blocks, draw_field, model_reports, random_numbers
from .motions import Motions, motions
from .process import damage_chances, loss_chances
from .rules import (
    CELLS,
    FILLED,
    FINISH,
    GAPS,
    INDEX_SOURCE,
    INDEX_TARGET,
    TOTALS,
    Tables,
    TransplantPlan,
    Worlds,
    apply_worlds,
    observe_worlds,
    plan_worlds,
    score_worlds,
)


class TransplantOutcome(NamedTuple):
    """What happened: ``phases_s`` (B, phases) seconds, ``error_m`` (B, 2) tool errors while it gripped and released."""

    phases_s: Array
    error_m: Array


class TransplantingCore(TaskCore[TransplantPlan, TransplantOutcome]):
    """Batched transplanting task.

    An action is ``pair * 3 + speed``, ``3 K`` moves the source conveyor on, ``3 K + 1`` the target conveyor. K counts
    every pair (source cell, target cell) of the presented rows: a presented row is a short row of a tray, 5 to 12
    cells, so all pairs are few enough to be actions of their own, and their mask is exact.

    Args:
        config: the task's numbers.
        perception: statistical cameras, or None when reports come from outside through ``receive``.
        worlds: number of worlds B.
    """

    reward_names = ("planted", "spoiled", "time")
    phase_names = ("travel", "carry", "handle", "index", "wait")

    def __init__(self, config: TransplantingConfig, perception: PerceptionModel | None, worlds: int = 1):
        """Allocate the state."""
        super().__init__(worlds)
        self.config, self.perception = config, perception
        scenario, b, k = config.scenario, worlds, config.scenario.pairs
        self.source_shape = rows_s, n = scenario.source_trays * scenario.source.rows, scenario.source.columns
        self.target_shape = rows_t, m = scenario.target_trays * scenario.target.rows, scenario.target.columns
        self.score_names = (
            *COMMON_SCORES,
            *(f"phase_{name}_s" for name in self.phase_names),
            *("lost", "torn", "wasted", "cleared", "transplants", "travel_m", "healthy", "cells", "gaps", "filled"),
        )
        self.action_space = spaces.Discrete(len(SPEEDS) * k + 2)
        self.observation_space = spaces.Dict(
            {
                "machine": spaces.Box(-10.0, 10.0, (len(MACHINE_FEATURES),), np.float32),
                "candidates": spaces.Box(-10.0, 10.0, (k * len(CANDIDATE_FEATURES),), np.float32),
                "action_mask": spaces.Box(0, 1, (len(SPEEDS) * k + 2,), np.int8),
            }
        )
        self.motions = motions(config.machine, scenario.source, scenario.target)
        self.tables = _tables(config, self.motions, from_outside=perception is None)
        self._numbers = random_numbers(scenario)
        self.state = Worlds(
            source_cells=np.zeros((b, rows_s + 1, n), np.int8),
            target_cells=np.zeros((b, rows_t + 1, m), np.int8),
            source_reports=np.zeros((b, rows_s + 1, n), np.int8),
            target_reports=np.zeros((b, rows_t + 1, m), np.int8),
            luck=np.zeros((b, rows_s + 1, n, len(LUCKS))),
            source_row=np.zeros(b, np.int64),
            target_row=np.zeros(b, np.int64),
            look_due=np.zeros((b, 2), bool),
            place=np.zeros(b, np.int64),
            totals=np.zeros((b, TOTALS)),
        )
        # What a scene makes the seedlings' looks from; the rules never read it.
        self.source_looks = np.zeros((b, rows_s, n))
        self.target_looks = np.zeros((b, rows_t, m))
        self.episode = np.zeros(b, np.int64)

    def draw(self, generators: Sequence[np.random.Generator]) -> Any:
        """Draw trays."""
        return draw_field(self.config.scenario, *draw_blocks(generators, self._numbers))

    def load(self, rows: Rows, batch: Any) -> None:
        """Put trays into ``rows`` and present the first row of each."""
        state, field = self.state, batch
        state.source_cells[rows, :-1], state.target_cells[rows, :-1] = field.source, field.target
        state.target_cells[rows, -1] = HEALTHY
        state.luck[rows, :-1] = field.luck
        self.source_looks[rows], self.target_looks[rows] = field.source_lot, field.target_lot
        if self.perception is None:
            state.source_reports[rows], state.target_reports[rows] = EMPTY, HEALTHY
            state.look_due[rows] = True
        else:
            seen = model_reports(self.perception, field)
            state.source_reports[rows, :-1], state.target_reports[rows, :-1] = seen
            state.target_reports[rows, -1] = HEALTHY
        state.source_row[rows], state.target_row[rows] = 0, 0
        state.place[rows] = self.motions.park
        self.episode[rows] += 1
        cells = self.target_shape[0] * self.target_shape[1]
        healthy = np.count_nonzero(field.target == HEALTHY, axis=(1, 2))
        state.totals[rows] = 0.0
        state.totals[rows, FILLED], state.totals[rows, CELLS] = healthy, cells
        state.totals[rows, GAPS] = cells - healthy

    def receive(self, row: int, source: Cells, target: Cells) -> None:
        """Take the cameras' reports of the presented rows into one world.

        What the machine has learnt of a row since it was presented stands: each row is looked at once.

        Args:
            row: the world.
            source: (source columns,), ``EMPTY``, ``HEALTHY`` or ``POOR``.
            target: (target columns,), likewise.
        """
        state = self.state
        fresh_source, fresh_target = state.look_due[row]
        if fresh_source:
            state.source_reports[row, state.source_row[row]] = source
        if fresh_target:
            state.target_reports[row, state.target_row[row]] = target
        state.look_due[row] = False

    def plan(self, actions: NDArray[np.int64]) -> TransplantPlan:
        """Turn actions (B,) into motions and nominal phase times."""
        return plan_worlds(self.tables, self.state, actions)

    def stack(self, fields: Sequence[Any]) -> Any:
        """The batch of fields."""
        raise NotImplementedError

    def unstack(self, batch: Any) -> list[Any]:
        """The fields of a batch."""
        raise NotImplementedError

    def nominal(self, plan: TransplantPlan) -> TransplantOutcome:
        """Nominal phase times, the tool exactly where it was sent."""
        return TransplantOutcome(plan.phases_s, np.zeros((len(plan.kind), 2)))

    def apply(self, plan: TransplantPlan, outcome: TransplantOutcome) -> StepResult:
        """Move plugs, index rows, book the time."""
        return apply_worlds(self.tables, self.state, plan, outcome.phases_s, outcome.error_m)

    def observe(self) -> dict[str, NDArray[np.float32 | np.int8]]:
        """What the machine knows: itself, the pairs of the presented rows, what it may do."""
        machine, candidates, mask = observe_worlds(self.tables, self.state)
        return {"machine": machine, "candidates": candidates, "action_mask": mask}

    def presented_reports(self) -> tuple[Cells, Cells]:
        """What the machine believes of the presented rows: (B, source columns) and (B, target columns)."""
        state, worlds = self.state, np.arange(self.worlds)
        return state.source_reports[worlds, state.source_row], state.target_reports[worlds, state.target_row]

    def cells_of_pair(self, pair: int) -> tuple[int, int]:
        """Places of a pair's source and target cell, see ``Motions``."""
        source, target = divmod(pair, self.target_shape[1])
        return source, self.source_shape[1] + target

    def scores(self) -> Array:
        """Scorecard so far; see ``score_names``. The net rate counts every cell of every target tray."""
        return score_worlds(self.state)

    def describe(self, plan: TransplantPlan, result: StepResult, row: int = 0) -> str:
        """One line about the last decision."""
        kind = int(plan.kind[row])
        elapsed = float(result.phases_s[row].sum())
        if kind < INDEX_SOURCE:
            source, target = divmod(int(plan.pair[row]), self.target_shape[1])
            cleared = ", cleared first" if plan.clears[row] else ""
            found = "" if plan.grips[row] else ": no plug gripped"
            return f"plug {source + 1} -> {target + 1}{cleared}, {SPEEDS[kind]}{found}: {elapsed:.2f} s"
        words = {
            INDEX_SOURCE: f"source row {int(self.state.source_row[row]) + 1}/{self.source_shape[0]}",
            INDEX_TARGET: f"target row {int(self.state.target_row[row]) + 1}/{self.target_shape[0]}",
            FINISH: "last target row leaves",
        }
        return f"{words.get(kind, 'illegal action')}: {elapsed:.2f} s"


def _tables(config: TransplantingConfig, table: Motions, *, from_outside: bool) -> Tables:
    """What the rules look up, from the configuration and the times of its motions."""
    scenario, machine, process, weights = config.scenario, config.machine, config.process, config.weights
    n, m = scenario.source.columns, scenario.target.columns
    feature = np.zeros((n * m, len(CANDIDATE_FEATURES)), np.float32)
    feature[:, 0] = 1.0
    feature[:, 1] = np.repeat(table.x_m[:n], m) / PLACE_SCALE_M
    feature[:, 2] = np.tile(table.x_m[n : n + m], n) / PLACE_SCALE_M
    feature[:, 3] = table.carry_s[SPEEDS.index("normal")] / MOVE_SCALE_S
    place = np.column_stack([table.x_m / PLACE_SCALE_M, table.height_m == 0.0])
    sides = (scenario.source, scenario.source_trays), (scenario.target, scenario.target_trays)
    # One row more than there are: a batch steps worlds that are over along with the others.
    row_s = np.empty((2, max(tray.rows * trays for tray, trays in sides) + 1))
    for side, (tray, _) in enumerate(sides):
        row_s[side] = table.index_s[side]
        row_s[side, tray.rows - 1 :: tray.rows] = table.exchange_s[side]
    return Tables(
        approach=np.ascontiguousarray(np.stack([table.approach_s, table.approach_m], axis=-1)),
        carry=np.stack([table.carry_s, table.carry_m], axis=-1),
        rise=np.stack([table.rise_s, table.rise_m], axis=-1),
        row_s=row_s,
        pair_feature=feature,
        place_feature=place.astype(np.float32),
        chances=np.stack([loss_chances(machine, process), damage_chances(machine, process)], axis=-1),
        weights=np.array([weights.planted, weights.spoiled, weights.seconds], float),
        extraction=float(process.extraction),
        reach_m=float(process.reach_m),
        grip_s=float(process.grip_s),
        release_s=float(process.release_s),
        illegal_s=float(process.illegal_s),
        time_limit_s=float(scenario.time_limit_s),
        from_outside=from_outside,
    )
