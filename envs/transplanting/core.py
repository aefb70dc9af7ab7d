"""The rules of tray transplanting over a batch of worlds."""

from __future__ import annotations

from collections.abc import Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..columns import names
from ..core import Array, Rows, StepResult, observation_space, outside
from ..drives import Servos
from ..erring import ErringCore
from ..field import FieldError
from .columns import (
    MOVE_SCALE_S,
    PLACE_SCALE_M,
    SHOWN,
    C,
    Candidate,
    E,
    Lucks,
    M,
    Machine,
    Phases,
    Rewards,
    Scores,
    T,
    Totals,
    W,
)
from .config import DAMAGED, EMPTY, HEALTHY, POOR, SPEEDS, PerceptionModel, TransplantingConfig
from .errors import EMPTY_HANDED, JOINTS, falls_s, tool_error
from .field import Cells, TrayBatch, TrayField, draw_batch, model_reports, shapes, stacked, unstacked, with_every_cell
from .order_columns import OrderMachine
from .process import speed_chances
from .rules import (
    FINISH,
    INDEX_SOURCE,
    INDEX_TARGET,
    SEND_TARGET,
    TURN_SOURCES,
    TURN_TARGETS,
    FixedFeatures,
    Terms,
    TransplantPlan,
    Worlds,
    apply_worlds,
    plan_worlds,
)
from .showing import decide_worlds, show_worlds
from .timing import Places, Times, places, times


class TransplantOutcome(NamedTuple):
    """What happened: ``phases_s`` (B, 5) seconds, ``error_m`` (B, 2) tool errors at the pair's ends."""

    phases_s: Array
    error_m: Array


class TransplantingCore(ErringCore[TransplantPlan, TransplantOutcome]):
    """Batched transplanting task.

    An action is ``pair * 3 + speed``, ``3 K`` moves the source conveyor on, ``3 K + 1`` the target conveyor. K counts
    every pair (source cell, target cell) of the presented rows: a presented row is a short row of a tray, 5 to 12
    cells, so all pairs are few enough to be actions of their own, and their mask is exact.

    Args:
        config: the task's numbers.
        perception: statistical cameras, or None when reports come from outside through ``receive``.
        worlds: number of worlds B.
    """

    reward_names = names(Rewards)
    phase_names = names(Phases)
    score_names = names(Scores)
    machine_features = names(Machine)
    candidate_features = names(Candidate)
    field_type = TrayField
    blocks = MappingProxyType(
        {"machine": Machine, "candidates": Candidate, "rewards": Rewards, "phases": Phases, "scores": Scores}
    )
    deciding, showing = staticmethod(decide_worlds), staticmethod(show_worlds)

    def __init__(self, config: TransplantingConfig, perception: PerceptionModel | None, worlds: int = 1):
        """Allocate the state."""
        super().__init__(worlds)
        self.config, self.perception = config, perception
        scenario, b, k = config.scenario, worlds, config.scenario.pairs
        self.ordered = scenario.orders.on
        if self.ordered:
            self.blocks = {**self.blocks, "machine": OrderMachine}
            self.machine_features = names(OrderMachine)
        actions = len(SPEEDS) * k + (4 if self.ordered else 2)
        trays = (scenario.source_trays, scenario.target_trays) if self.ordered else (0, 0)
        self.source_shape, self.target_shape = (rows_s, n), (rows_t, m) = shapes(scenario)
        self.source_trays = scenario.source_trays, scenario.source.rows
        self.target_trays = scenario.target_trays, scenario.target.rows
        self.action_space = spaces.Discrete(actions)
        self.observation_space = observation_space(self, k, actions, SHOWN)
        self.places = places(config.machine, scenario.source, scenario.target)
        self.times = times(config)
        self.terms = _terms(config, from_outside=perception is None)
        self._drive(Servos.of(scenario.drives, *JOINTS))
        self._fall_s = falls_s(config.machine) if self.errs else ()
        self._fixed = _fixed_features(config, self.places, self.times)
        self.state = Worlds(
            source_cells=np.zeros((b, rows_s + 1, n), np.int8),
            target_cells=np.zeros((b, rows_t + 1, m), np.int8),
            source_reports=np.zeros((b, rows_s + 1, n), np.int8),
            target_reports=np.zeros((b, rows_t + 1, m), np.int8),
            luck=np.zeros((b, rows_s + 1, n, len(names(Lucks)))),
            source_row=np.zeros(b, np.int64),
            target_row=np.zeros(b, np.int64),
            look_due=np.zeros((b, len(E)), bool),
            place=np.zeros(b, np.int64),
            totals=np.zeros((b, len(names(Totals)))),
            source_at=np.zeros((b, trays[E.source]), np.int64),
            target_at=np.zeros((b, trays[E.target]), np.int64),
            seen=np.zeros((b, len(E), max(trays)), bool),
            grade=np.full((b, trays[E.target]), HEALTHY, np.int8),
            due_s=np.zeros((b, trays[E.target])),
        )
        # What a scene makes the seedlings' looks, and the holes of plugs that are gone, from; the rules never read it.
        self.source_began = np.zeros((b, rows_s, n), np.int8)
        self.source_looks = np.zeros((b, rows_s, n))
        self.target_looks = np.zeros((b, rows_t, m))
        self.episode = np.zeros(b, np.int64)

    def draw(self, generators: Sequence[np.random.Generator]) -> TrayBatch:
        """Draw trays."""
        luck = self.draw_luck(generators)
        drawn = draw_batch(self.config.scenario, generators)
        return drawn if luck is None else drawn._replace(drives=luck)

    def stack(self, fields: Sequence[TrayField]) -> TrayBatch:
        """The batch of trays that have every cell."""
        luck, batch = self.luck_of(fields), stacked(fields, self.source_shape, self.target_shape)
        return batch if luck is None else batch._replace(drives=luck)

    def unstack(self, batch: TrayBatch) -> list[TrayField]:
        """The trays of a batch."""
        return self.with_luck(unstacked(batch), batch.drives if self.errs else None)

    def complete(self, field: Any, generator: np.random.Generator) -> TrayField:
        """The trays with every cell: those that are not given are empty; what is missing of luck is drawn.

        Raises:
            FieldError: a cell lies outside the trays, is given twice, or a value is out of its range.
        """
        if isinstance(field, TrayField):
            field.check()
            field = with_every_cell(field, self.source_shape, self.target_shape)
            self._keep_to_orders(field)
        whole = super().complete(field, generator)
        return self.with_whole_luck(whole, whole.drives, generator)

    def _keep_to_orders(self, field: TrayField) -> None:
        """Raise FieldError where a field's orders are not those that the scenario has room for."""
        trays, given = self.state.due_s.shape[1], 0 if field.orders is None else len(field.orders)
        if given != trays:
            asked = f"give a row of kind orders for each of the {trays} target trays" if trays else "leave them out"
            raise FieldError(f"{given} orders in a scenario with {trays}: {asked}")

    def load(self, rows: Rows, batch: TrayBatch) -> None:
        """Put trays into ``rows`` and present the first row of each."""
        state = self.state
        self.take_luck(rows, batch.drives if self.errs else None)
        state.source_cells[rows, :-1], state.target_cells[rows, :-1] = batch.source, batch.target
        state.target_cells[rows, -1] = HEALTHY
        state.luck[rows, :-1] = batch.luck
        self.source_began[rows] = batch.source
        self.source_looks[rows], self.target_looks[rows] = batch.source_lot, batch.target_lot
        if self.perception is None:
            state.source_reports[rows], state.target_reports[rows] = EMPTY, HEALTHY
            state.look_due[rows] = True
        else:
            seen = model_reports(self.perception, batch)
            state.source_reports[rows, :-1], state.target_reports[rows, :-1] = seen
            state.target_reports[rows, -1] = HEALTHY
        state.source_row[rows], state.target_row[rows] = 0, 0
        state.place[rows] = self.places.park
        if self.ordered:
            for at, (trays, length) in ((state.source_at, self.source_trays), (state.target_at, self.target_trays)):
                at[rows] = length * np.arange(trays)
            state.seen[rows] = np.arange(state.seen.shape[2]) == 0
            state.grade[rows], state.due_s[rows] = batch.grade, batch.due_s
        self.episode[rows] += 1
        cells = self.target_shape[0] * self.target_shape[1]
        healthy = np.count_nonzero(batch.target == HEALTHY, axis=(1, 2))
        state.totals[rows] = 0.0
        state.totals[rows, T.healthy], state.totals[rows, T.cells] = healthy, cells
        state.totals[rows, T.gaps] = cells - healthy

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

    def rules(self) -> tuple[Times, Terms, FixedFeatures]:
        """See ``KernelCore``."""
        return self.times, self.terms, self._fixed

    def plan(self, actions: NDArray[np.int64]) -> TransplantPlan:
        """Turn actions (B,) into motions and nominal phase times."""
        return plan_worlds(self.times, self.terms.extraction, self.state, actions)

    def nominal(self, plan: TransplantPlan) -> TransplantOutcome:
        """Nominal phase times, the tool where it was sent, or where drives that err bring it."""
        error_m = np.zeros((len(plan.kind), len(E)))
        if self.errs:
            error_m[:] = np.hypot(*np.moveaxis(self.tool_error(plan), -1, 0))
        return TransplantOutcome(plan.phases_s, error_m)

    def tool_error(self, plan: TransplantPlan) -> Array:
        """See ``ErringCore``: (B, 2, 2), across and up at the pair's two ends."""
        source, target = np.divmod(plan.pair, self.target_shape[1])
        ends = np.stack([source, self.source_shape[1] + target], axis=-1)
        limit = np.stack([np.full_like(plan.kind, EMPTY_HANDED), np.minimum(plan.kind, len(SPEEDS) - 1)], axis=-1)
        return self.place_error(ends, limit, self.drive_luck[:, None])

    def place_error(self, places: Rows, limit: Rows, luck: Array) -> Array:
        """What the tool is off by (..., 2) at places (...) that it comes down to under the limits (...)."""
        process = self.config.process
        work_s = np.where(limit == EMPTY_HANDED, process.grip_s, process.release_s)
        machine, place = self.config.machine, self.places
        points = np.stack([place.x_m[places], machine.arm.window_m[0][1] + place.height_m[places]], axis=-1)
        fall_m = machine.lift_m - place.height_m[places]
        return tool_error(machine, self.servos, luck, points, fall_m, np.take(self._fall_s, limit), work_s)

    def apply(self, plan: TransplantPlan, outcome: TransplantOutcome) -> StepResult:
        """Move plugs, index rows, book the time."""
        return apply_worlds(self.terms, self.state, plan, outcome.phases_s, outcome.error_m)

    def cells_of_pair(self, pair: int) -> tuple[int, int]:
        """Places of a pair's source and target cell, see ``timing.Places``."""
        source, target = divmod(pair, self.target_shape[1])
        return source, self.source_shape[1] + target

    def misplaced(self) -> str:
        """See ``TaskCore.misplaced``."""
        return outside(
            self.state,
            source_cells=DAMAGED + 1,
            target_cells=DAMAGED + 1,
            source_reports=DAMAGED + 1,
            target_reports=DAMAGED + 1,
            source_row=self.state.source_cells.shape[1],
            target_row=self.state.target_cells.shape[1],
            place=len(self.places.x_m),
            source_at=self.state.source_cells.shape[1],
            target_at=self.state.target_cells.shape[1],
            grade=POOR + 1,
        ) or outside(self, source_began=DAMAGED + 1)

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
            TURN_SOURCES: f"source tray {int(plan.pair[row]) + 1}/{self.source_trays[0]}",
            TURN_TARGETS: f"order {int(plan.pair[row]) + 1}/{self.target_trays[0]}",
            SEND_TARGET: f"tray leaves, order {int(plan.pair[row]) + 1}/{self.target_trays[0]}",
            INDEX_SOURCE: f"source row {int(self.state.source_row[row]) + 1}/{self.source_shape[0]}",
            INDEX_TARGET: f"target row {int(self.state.target_row[row]) + 1}/{self.target_shape[0]}",
            FINISH: "last target row leaves",
        }
        return f"{words.get(kind, 'illegal action')}: {elapsed:.2f} s"


def _terms(config: TransplantingConfig, *, from_outside: bool) -> Terms:
    """What the rules book by."""
    scenario, process, weights = config.scenario, config.process, config.weights
    return Terms(
        chances=speed_chances(config.machine, process),
        weights=np.array(Rewards(weights.planted, weights.spoiled, weights.seconds)),  # type: ignore[arg-type]
        extraction=process.extraction,
        reach_m=process.reach_m,
        time_limit_s=scenario.time_limit_s,
        from_outside=from_outside,
        supply=np.array(scenario.orders.supply[: scenario.source_trays] if scenario.orders.on else (), float),
    )


def _fixed_features(config: TransplantingConfig, where: Places, table: Times) -> FixedFeatures:
    """What is shown of pairs and places, scaled and held to the observation space."""
    n, m = config.scenario.source.columns, config.scenario.target.columns
    across = np.clip(where.x_m / PLACE_SCALE_M, -SHOWN, SHOWN)
    pair = np.zeros((n * m, len(names(Candidate))), np.float32)
    pair[:, C.present] = 1.0
    pair[:, C.source] = np.repeat(across[:n], m)
    pair[:, C.target] = np.tile(across[n : n + m], n)
    pair[:, C.carry] = np.minimum(table.carry[SPEEDS.index("normal"), :, W.s] / MOVE_SCALE_S, SHOWN)
    place = np.zeros((len(across), 2), np.float32)
    place[:, M.place], place[:, M.down] = across, where.height_m == 0.0
    return FixedFeatures(pair, place)
