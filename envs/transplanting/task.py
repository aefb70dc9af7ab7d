"""The rules of tray transplanting over a batch of worlds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..core import COMMON_SCORES, Array, Rows, StepResult, TaskCore
from .config import DAMAGED, EMPTY, HEALTHY, POOR, SPEEDS, PerceptionModel, TransplantingConfig
from .motions import motions
from .process import damage_chances, loss_chances
from .scenario import Cells, draw_blocks, draw_field, model_reports, random_numbers

INDEX_SOURCE, INDEX_TARGET, NOTHING, FINISH = 3, 4, 5, 6
"""Kinds of decision after the three speeds: move a conveyor on, an illegal action, send the last row away."""

MACHINE_FEATURES = ("place", "down", "time", "source_rows", "target_rows", "ready", "gaps")
CANDIDATE_FEATURES = ("present", "source", "target", "carry", "approach", "source_poor", "clear")

PLACE_SCALE_M = 0.3
MOVE_SCALE_S = 1.0
"""What the features are divided by, to be of order one."""

_TIME, _LAST, _DONE, _DAMAGED, _ILLEGAL, _LOST, _TORN, _WASTED, _CLEARED, _TRIED, _TRAVEL = range(11)
"""Columns of the running totals."""


def candidate_table(observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
    """Candidates (..., K, F) of an observation, one column a name of ``CANDIDATE_FEATURES``."""
    flat = observation["candidates"]
    return flat.reshape(*flat.shape[:-1], -1, len(CANDIDATE_FEATURES))


class TransplantPlan(NamedTuple):
    """What the transplanter has to do in each world.

    Attributes:
        kind: (B,), speed index, ``INDEX_SOURCE``, ``INDEX_TARGET``, ``NOTHING`` or ``FINISH``.
        pair: (B,), source column times the target row's columns plus target column; 0 when none.
        source: (B,), the source cell's number in the flat state of all worlds.
        target: (B,), the target cell's, likewise.
        clears: (B,), whether the target cell's seedling goes to the chute first.
        grips: (B,), whether the gripper's sensor will find a plug between the needles; without one the tool stays at
            the source cell.
        start: (B,), place that the tool stands at, see ``Motions``.
        end: (B,), place that it will stand at.
        phases_s: (B, phases), nominal seconds of each phase.
        travel_m: (B,), length of the tool's path.
    """

    kind: NDArray[np.int64]
    pair: NDArray[np.int64]
    source: NDArray[np.int64]
    target: NDArray[np.int64]
    clears: NDArray[np.bool_]
    grips: NDArray[np.bool_]
    start: NDArray[np.int64]
    end: NDArray[np.int64]
    phases_s: Array
    travel_m: Array


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
        scenario, process = config.scenario, config.process
        self.source_shape = (scenario.source_trays * scenario.source.rows, scenario.source.columns)
        self.target_shape = (scenario.target_trays * scenario.target.rows, scenario.target.columns)
        (rows_s, n), (rows_t, m) = self.source_shape, self.target_shape
        k = scenario.pairs
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
        self.motions = table = motions(config.machine, scenario.source, scenario.target)
        self._approaches = np.stack([table.approach_s.ravel(), table.approach_m.ravel()], axis=-1)
        self._carries = np.stack([table.carry_s.ravel(), table.carry_m.ravel()], axis=-1)
        self._n, self._m, self._k = n, m, k
        self._pair_source, self._pair_target = np.repeat(np.arange(n), m), np.tile(np.arange(m), n)
        self._approach_scaled = (table.approach_s / MOVE_SCALE_S).astype(np.float32)
        template = np.zeros((k, len(CANDIDATE_FEATURES)), np.float32)
        template[:, 0] = 1.0
        template[:, 1] = table.x_m[self._pair_source] / PLACE_SCALE_M
        template[:, 2] = table.x_m[n + self._pair_target] / PLACE_SCALE_M
        template[:, 3] = table.carry_s[SPEEDS.index("normal")] / MOVE_SCALE_S
        self._template = template.reshape(n, m, -1)
        self._place_scaled = np.stack([table.x_m / PLACE_SCALE_M, table.height_m == 0.0], axis=-1)
        # Time of a conveyor's move away from each row; no row follows the supply's last one.
        self._source_s = self._row_times(0, scenario.source_trays, scenario.source.rows)
        self._target_s = self._row_times(1, scenario.target_trays, scenario.target.rows)
        # Row: whether the target cell is cleared first; column: whether a plug is gripped.
        once = np.array([process.grip_s, process.grip_s + process.release_s])
        self._handle_s = np.stack([once, once + once[1]])
        # By kind: what the tool goes on with while only conveyors move or nothing does.
        self._lose = np.append(loss_chances(config.machine, process), np.zeros(4))
        self._damage = np.append(damage_chances(config.machine, process), np.zeros(4))
        weights = config.weights
        self._weights = np.array([weights.planted, weights.spoiled, weights.seconds])
        self._reach_m = process.reach_m
        self._numbers = random_numbers(scenario)

        b = self.worlds
        self._rows = np.arange(b)
        # Products with ones count a few columns faster than a reduction over a short last axis.
        self._ones_s, self._ones_t = np.ones(n), np.ones(m)
        # Behind the last row stands an empty one, for the worlds that are over.
        self.source_cells = np.zeros((b, rows_s + 1, n), np.int8)
        self.target_cells = np.zeros((b, rows_t + 1, m), np.int8)
        self.source_reports = np.zeros((b, rows_s + 1, n), np.int8)
        self.target_reports = np.zeros((b, rows_t + 1, m), np.int8)
        self.luck = np.zeros((b, rows_s + 1, n, 3))
        # What a scene makes the seedlings' looks from; the rules never read it.
        self.source_looks = np.zeros((b, rows_s, n))
        self.target_looks = np.zeros((b, rows_t, m))
        self.source_row, self.target_row = np.zeros(b, np.int64), np.zeros(b, np.int64)
        self.look_due = np.zeros((b, 2), bool)
        self.place = np.zeros(b, np.int64)
        self.episode = np.zeros(b, np.int64)
        self.totals = np.zeros((b, 11))
        self.phases_s = np.zeros((b, len(self.phase_names)))
        self.healthy, self.gaps = np.zeros(b), np.zeros(b)
        self._source_offset, self._target_offset = self._rows * (rows_s + 1), self._rows * (rows_t + 1)

    def reset_rows(self, rows: Rows, generators: Sequence[np.random.Generator]) -> None:
        """Draw new trays for ``rows`` and present the first row of each."""
        if len(rows) == 0:
            return
        scenario = self.config.scenario
        field = draw_field(scenario, *draw_blocks(generators, self._numbers))
        self.source_cells[rows, :-1], self.target_cells[rows, :-1] = field.source, field.target
        self.target_cells[rows, -1] = HEALTHY
        self.luck[rows, :-1] = field.luck
        self.source_looks[rows], self.target_looks[rows] = field.source_lot, field.target_lot
        if self.perception is None:
            self.source_reports[rows], self.target_reports[rows] = EMPTY, HEALTHY
            self.look_due[rows] = True
        else:
            seen = model_reports(self.perception, field)
            self.source_reports[rows, :-1], self.target_reports[rows, :-1] = seen
            self.target_reports[rows, -1] = HEALTHY
        self.source_row[rows], self.target_row[rows] = 0, 0
        self.episode[rows] += 1
        self.place[rows] = self.motions.park
        self.totals[rows], self.phases_s[rows] = 0.0, 0.0
        self.healthy[rows] = np.count_nonzero(field.target == HEALTHY, axis=(1, 2))
        self.gaps[rows] = self.target_shape[0] * self.target_shape[1] - self.healthy[rows]

    def receive(self, row: int, source: Cells, target: Cells) -> None:
        """Take the cameras' reports of the presented rows into one world.

        What the machine has learnt of a row since it was presented stands: each row is looked at once.

        Args:
            row: the world.
            source: (source columns,), ``EMPTY``, ``HEALTHY`` or ``POOR``.
            target: (target columns,), likewise.
        """
        fresh_source, fresh_target = self.look_due[row]
        if fresh_source:
            self.source_reports[row, self.source_row[row]] = source
        if fresh_target:
            self.target_reports[row, self.target_row[row]] = target
        self.look_due[row] = False

    def plan(self, actions: NDArray[np.int64]) -> TransplantPlan:
        """Turn actions (B,) into motions and nominal phase times."""
        pair = actions // len(SPEEDS)
        indexing = pair == self._k
        kind = actions - len(SPEEDS) * pair
        pair = np.where(indexing, 0, pair)
        source, target = self._cells_of(pair)
        ready, open_cell = self.source_reports.take(source), self.target_reports.take(target)
        kind[((ready == EMPTY) | (open_cell == HEALTHY)) & ~indexing] = NOTHING
        if np.count_nonzero(indexing):
            kind[indexing] += INDEX_SOURCE
            kind[(kind == INDEX_SOURCE) & (self.source_row >= self.source_shape[0] - 1)] = NOTHING
            kind[(kind == INDEX_TARGET) & (self.target_row >= self.target_shape[0] - 1)] = FINISH
        moving = kind < INDEX_SOURCE
        clears = moving & (open_cell == POOR)
        grips = moving & (self.source_cells.take(source) != EMPTY)
        grips &= self.luck.reshape(-1, 3).take(source, axis=0)[:, 0] < self.config.process.extraction

        table, start = self.motions, self.place
        phases = np.zeros((self.worlds, len(self.phase_names)))
        way = (clears * len(table.x_m) + start) * self._k + pair
        carry = np.minimum(kind, 2) * self._k + pair
        # Seconds and metres side by side: one gather for both.
        approach = self._approaches.take(way, axis=0)
        carried = self._carries.take(carry, axis=0)
        carried *= grips[:, None]
        handle = self._handle_s.take(2 * clears + grips)
        all_move = np.count_nonzero(moving) == self.worlds
        if not all_move:
            approach *= moving[:, None]
            handle *= moving
        phases[:, 0], phases[:, 1], phases[:, 2] = approach[:, 0], carried[:, 0], handle
        travel = approach[:, 1] + carried[:, 1]
        end = np.where(grips, self._n + self._pair_target.take(pair), self._pair_source.take(pair))
        if not all_move:
            end[~moving] = start[~moving]
            phases[:, 4] = self.config.process.illegal_s * (kind == NOTHING)
            rows = np.flatnonzero((kind > NOTHING) | ((kind >= INDEX_SOURCE) & (kind < NOTHING)))
            here, tray = start[rows], kind[rows] != INDEX_SOURCE
            phases[rows, 0], travel[rows] = table.rise_s[here], table.rise_m[here]
            times = np.where(tray, self._target_s[self.target_row[rows]], self._source_s[self.source_row[rows]])
            phases[rows, 3] = times
            end[rows] = np.where(here < table.cells, here + table.cells, here)
        return TransplantPlan(kind, pair, source, target, clears, grips, start, end, phases, travel)

    def apply(self, plan: TransplantPlan, outcome: TransplantOutcome) -> StepResult:
        """Move plugs, index rows, book the time."""
        kind, clears, grips = plan.kind, plan.clears, plan.grips
        moving = kind < INDEX_SOURCE
        source, target = plan.source, plan.target
        plug, cell = self.source_cells.take(source), self.target_cells.take(target)
        luck = self.luck.reshape(-1, 3).take(source, axis=0)
        kept = luck[:, 1] >= self._lose.take(kind)
        if outcome.error_m.max() > self._reach_m:
            kept &= (outcome.error_m <= self._reach_m).all(axis=1)
        arrives = grips & kept
        left = cell * ~clears  # EMPTY is 0
        # A plug that is pushed into another one spoils both.
        hurt = (luck[:, 2] < self._damage.take(kind)) | (left != EMPTY)
        now = np.where(arrives, np.where(hurt, np.int8(DAMAGED), plug), left)
        is_healthy = now == HEALTHY
        gain = np.subtract(is_healthy, cell == HEALTHY, dtype=np.float64)
        was_healthy = moving & (plug == HEALTHY)
        good = arrives & is_healthy

        # Worlds that only index write back what they read.
        seen = self.source_reports.take(source)
        known = self.target_reports.take(target)
        known = np.where(arrives, seen, known * ~clears)
        still = ~moving
        self.source_cells.put(source, plug * still)
        self.source_reports.put(source, seen * still)
        self.target_cells.put(target, now)
        self.target_reports.put(target, known)
        wasted = self._index(kind)

        totals = self.totals
        elapsed = np.add.reduce(outcome.phases_s, axis=1)
        booked = np.empty_like(totals)
        booked[:, _TIME] = elapsed
        booked[:, _LAST] = 0.0
        booked[:, _DONE] = good
        torn = moving & (plug != EMPTY) & ~grips
        booked[:, _DAMAGED] = arrives & hurt
        booked[:, _DAMAGED] += arrives & (left == HEALTHY)
        booked[:, _DAMAGED] += torn
        booked[:, _ILLEGAL] = kind == NOTHING
        booked[:, _LOST] = grips & ~kept
        booked[:, _TORN] = torn
        booked[:, _WASTED] = wasted
        booked[:, _CLEARED] = clears & (cell != EMPTY)
        booked[:, _TRIED] = moving
        booked[:, _TRAVEL] = plan.travel_m
        totals += booked
        np.copyto(totals[:, _LAST], totals[:, _TIME], where=good)
        self.phases_s += outcome.phases_s
        self.healthy += gain
        self.place = plan.end

        rewards = np.empty((self.worlds, 3))
        rewards[:, 0] = gain
        rewards[:, 1] = wasted + (was_healthy & ~good)
        rewards[:, 2] = elapsed
        rewards *= self._weights
        terminated = kind == FINISH
        truncated = (totals[:, _TIME] >= self.config.scenario.time_limit_s) & ~terminated
        return StepResult(rewards, outcome.phases_s, terminated, truncated)

    def observe(self) -> dict[str, NDArray[np.float32 | np.int8]]:
        """What the machine knows: itself, the pairs of the presented rows, what it may do."""
        ready, known = self.presented_reports()
        usable, opening = ready != EMPTY, known != HEALTHY
        legal = usable[:, :, None] & opening[:, None, :]
        clear = known == POOR
        size = self._n, self._m
        direct = self._approach_scaled[0].take(self.place, axis=0).reshape(-1, *size)
        if np.count_nonzero(clear):
            round_about = self._approach_scaled[1].take(self.place, axis=0).reshape(-1, *size)
            direct = np.where(clear[:, None, :], round_about, direct)
        feature = legal[..., None] * self._template
        np.multiply(direct, legal, out=feature[..., 4])
        feature[..., 5] = legal & (ready == POOR)[:, :, None]
        feature[..., 6] = legal & clear[:, None, :]
        machine = np.empty((self.worlds, len(MACHINE_FEATURES)), np.float32)
        machine[:, :2] = self._place_scaled.take(self.place, axis=0)
        machine[:, 2] = self.totals[:, _TIME] * (1.0 / self.config.scenario.time_limit_s)
        machine[:, 3] = 1.0 - (self.source_row + 1.0) * (1.0 / self.source_shape[0])
        machine[:, 4] = 1.0 - (self.target_row + 1.0) * (1.0 / self.target_shape[0])
        machine[:, 5] = (usable @ self._ones_s) * (1.0 / self._n)
        machine[:, 6] = (opening @ self._ones_t) * (1.0 / self._m)
        mask = np.empty((self.worlds, len(SPEEDS) * self._k + 2), np.int8)
        mask[:, :-2].reshape(self.worlds, self._k, -1)[...] = legal.reshape(self.worlds, -1, 1)
        mask[:, -2] = self.source_row < self.source_shape[0] - 1
        mask[:, -1] = 1
        return {"machine": machine, "candidates": feature.reshape(self.worlds, -1), "action_mask": mask}

    def presented_reports(self) -> tuple[Cells, Cells]:
        """What the machine believes of the presented rows: (B, source columns) and (B, target columns)."""
        source = self.source_reports.reshape(-1, self._n).take(self._source_offset + self.source_row, axis=0)
        target = self.target_reports.reshape(-1, self._m).take(self._target_offset + self.target_row, axis=0)
        return source, target

    def cells_of_pair(self, pair: int) -> tuple[int, int]:
        """Places of a pair's source and target cell, see ``Motions``."""
        return int(self._pair_source[pair]), self._n + int(self._pair_target[pair])

    def scores(self) -> Array:
        """Scorecard so far; see ``score_names``. The net rate counts every cell of every target tray."""
        t = self.totals
        done, time_s = t[:, _DONE], t[:, _TIME]
        cells = float(self.target_shape[0] * self.target_shape[1])
        result = np.empty((self.worlds, len(self.score_names)))
        result[:, 0] = self.healthy * (1.0 / cells)
        result[:, 1] = t[:, _LAST] / np.maximum(done, 1.0)
        result[:, 2] = 60.0 * done / np.maximum(time_s, 1e-9)
        result[:, 3] = time_s
        result[:, 4] = done
        result[:, 5] = cells - self.healthy
        result[:, 6:8] = t[:, _DAMAGED : _ILLEGAL + 1]
        result[:, 8:13] = self.phases_s
        result[:, 13:19] = t[:, _LOST:]
        result[:, 19] = self.healthy
        result[:, 20] = cells
        result[:, 21] = self.gaps
        result[:, 22] = 1.0 - (cells - self.healthy) / np.maximum(self.gaps, 1.0)
        return result

    def describe(self, plan: TransplantPlan, result: StepResult, row: int = 0) -> str:
        """One line about the last decision."""
        kind, pair = int(plan.kind[row]), int(plan.pair[row])
        elapsed = float(result.phases_s[row].sum())
        if kind < INDEX_SOURCE:
            cleared = ", cleared first" if plan.clears[row] else ""
            found = "" if plan.grips[row] else ": no plug gripped"
            cells = f"{self._pair_source[pair] + 1} -> {self._pair_target[pair] + 1}{cleared}"
            return f"plug {cells}, {SPEEDS[kind]}{found}: {elapsed:.2f} s"
        words = {
            INDEX_SOURCE: f"source row {int(self.source_row[row]) + 1}/{self.source_shape[0]}",
            INDEX_TARGET: f"target row {int(self.target_row[row]) + 1}/{self.target_shape[0]}",
            FINISH: "last target row leaves",
        }
        return f"{words.get(kind, 'illegal action')}: {elapsed:.2f} s"

    def _cells_of(self, pair: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
        """Flat numbers (B,) of a pair's cells in the presented rows."""
        source = (self._source_offset + self.source_row) * self._n + self._pair_source.take(pair)
        target = (self._target_offset + self.target_row) * self._m + self._pair_target.take(pair)
        return source, target

    def _index(self, kind: NDArray[np.int64]) -> Array:
        """Move the conveyors on; returns the healthy seedlings (B,) that leave with a source row."""
        wasted = np.zeros(self.worlds)
        if not np.count_nonzero(kind >= INDEX_SOURCE):
            return wasted
        source = kind == INDEX_SOURCE
        if np.count_nonzero(source):
            rows = np.flatnonzero(source)
            wasted[rows] = np.count_nonzero(self.source_cells[rows, self.source_row[rows]] == HEALTHY, axis=1)
            self.source_row[rows] += 1
            if self.perception is None:
                self.look_due[rows, 0] = True
        target = (kind == INDEX_TARGET) | (kind == FINISH)
        if np.count_nonzero(target):
            # A batch steps worlds that are over along with the others: they stay at the empty row.
            self.target_row = np.minimum(self.target_row + target, self.target_shape[0])
            if self.perception is None:
                self.look_due[kind == INDEX_TARGET, 1] = True
        return wasted

    def _row_times(self, side: int, trays: int, rows: int) -> Array:
        """Seconds (trays * rows + 1,) that the conveyor takes away from each row."""
        times = np.full(trays * rows + 1, self.motions.index_s[side])
        times[rows - 1 :: rows] = self.motions.exchange_s[side]
        return times
