"""The rules of produce sorting over a batch of worlds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import pi
from typing import Any, NamedTuple

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ...motion import QUINTIC
from ..core import COMMON_SCORES, Array, Rows, StepResult, TaskCore
from .config import GRADES, PerceptionModel, SortingConfig
from .process import grip_quality, holds, slips
from .reports import COLUMNS, SURVEYED, prepare
from .scenario import Reports, draw_blocks, draw_items, draw_reports, ghost_slots, item_axes, random_numbers

PICK, WAIT, NOTHING = 0, 1, 2
"""Kinds of decision: grip an item, let the belt run, an illegal action."""

MACHINE_FEATURES = ("x", "y", "turned", "time", "in_view")
CANDIDATE_FEATURES = (
    *("present", "along", "across", "cos_2yaw", "sin_2yaw", "tilt", "turn", "length"),
    *GRADES,
    *("value", "quality", "approach", "wait", "cycle", "slack", "possible"),
)

PLACE_SCALE_M = 0.2
TILT_SCALE_RAD = 0.35
TURN_SCALE_RAD = 1.0
LENGTH_SCALE_M = 0.06
WAIT_SCALE_S = 4.0
CYCLE_SCALE_S = 2.0
"""What the features are divided by, to be of order one."""

_GUESS_S = 0.15
"""First guess at how much longer an approach takes than turning alone."""
_STATIC = CANDIDATE_FEATURES.index("approach")
_WINDOW_MORE = 12
_FEATURE_LIMIT = 10.0
_TIME, _LAST, _PLACED, _VALUE, _MISPLACED, _DROPPED, _WASTED, _ILLEGAL, _PICKS = range(9)
"""Columns of the running totals."""


def candidate_table(observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
    """Candidates (..., K, F) of an observation, one column a name of ``CANDIDATE_FEATURES``."""
    flat = observation["candidates"]
    return flat.reshape(*flat.shape[:-1], -1, len(CANDIDATE_FEATURES))


class SorterPlan(NamedTuple):
    """What the sorter has to do in each world. Places are the platform's centre in mechanism coordinates.

    Attributes:
        kind: (B,), ``PICK``, ``WAIT`` or ``NOTHING``.
        slot: (B,), candidate slot.
        report: (B,), report behind it.
        start: (B, 2), x and y at the travel level.
        start_turn: (B, 4), quaternion.
        meet: (B, 2), x and y at the travel level when the approach ends, over the moving item.
        grip: (B, 3), where the fingers close.
        turn: (B, 4), quaternion of the grip.
        axes: (6, B), the tool's x and z axes at the grip.
        bin: (B, 2), where the item is let go, level and unturned.
        phases_s: (B, 7), nominal seconds of each phase when the fingers hold the item.
    """

    kind: NDArray[np.int64]
    slot: NDArray[np.int64]
    report: NDArray[np.int64]
    start: Array
    start_turn: Array
    meet: Array
    grip: Array
    turn: Array
    axes: Array
    bin: Array
    phases_s: Array


class Grip(NamedTuple):
    """What came of closing the fingers: whether they hold, and whether the item slips out on the way, (B,) each."""

    held: NDArray[np.bool_]
    lost: NDArray[np.bool_]


class SorterOutcome(NamedTuple):
    """What happened: seconds of each phase (B, 7) and the grip."""

    phases_s: Array
    grip: Grip


class _Survey(NamedTuple):
    """Every candidate as seen from now, (B, K) each: where it is met and how long everything takes."""

    place: NDArray[np.int64]
    columns: Array
    meet_x: Array
    approach_s: Array
    wait_s: Array
    carry_s: Array
    legal: NDArray[np.bool_]


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
        k, items = config.slots, config.scenario.max_items
        model = perception or PerceptionModel.perfect()
        reports = items + (ghost_slots(config, model) if perception else items)
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
        sorter, belt = config.machine.sorter, config.belt
        self._speed = belt.speed_m_s
        # Following the belt adds its speed to the motion's own, so that much is kept back.
        self._by_speed = QUINTIC.peak_velocity / (sorter.velocity_m_s - belt.speed_m_s)
        self._by_push = QUINTIC.peak_acceleration / sorter.acceleration_m_s2
        self._by_rate = QUINTIC.peak_velocity / sorter.turn_rad_s
        self._by_twist = QUINTIC.peak_acceleration / sorter.turn_rad_s2
        self._bins = np.array(belt.bins_m)
        self._bin_x, self._bin_y = self._bins[:, 0].copy(), self._bins[:, 1].copy()
        self._values = np.array(config.produce.value)
        self._weights = (
            np.array(config.weights.__dict__["placed"]),
            np.array([config.weights.misplaced, config.weights.dropped, config.weights.wasted]),
        )
        self._numbers = random_numbers(config, model)
        self._rest_s = np.array([0.0, config.grip.wait_s, config.grip.illegal_s])

        b = self.worlds
        self._no_item, self._no_report = items, reports
        self._rows, self._slots = np.arange(b), np.arange(k)
        self._window = np.arange(k + _WINDOW_MORE)
        width = reports + 1 + len(self._window)
        self._item_offset, self._report_offset = self._rows * (items + 1), self._rows * width
        self._empty_place = (self._report_offset + reports)[:, None]
        self._gone = np.zeros((b, len(self._window) + 1), bool)
        # True items, one row a quantity so that a gather brings contiguous columns; the last item is none.
        self._truth = np.zeros((13, b, items + 1))
        self.item_place = np.full((b, items + 1, 3), np.inf)
        self.item_free = np.zeros((b, items + 1), bool)
        self.item_grade = np.zeros((b, items + 1), np.int64)
        self.item_shape = np.zeros((b, items + 1, 7))
        self.total, self.total_value = np.zeros(b), np.zeros(b)
        self.end_s = np.zeros(b)
        # Reports in the order in which they leave; what comes after them is none.
        self._columns = np.zeros((len(COLUMNS), b, width))
        self._feature = np.zeros((b, width, len(CANDIDATE_FEATURES)), np.float32)
        self.leave_s = np.full((b, width), np.inf)
        self.seen_s = np.full((b, width), np.inf)
        self.report_item = np.full((b, width), items)
        self.report_grade = np.zeros((b, width), np.int64)
        self.report_held, self.report_lost = np.zeros((2, b, width), bool)
        self._first = np.zeros(b, np.int64)
        self.place = np.zeros((b, 2))
        self.turn = np.zeros((b, 4))
        self._level = np.ones(b, bool)
        self.totals = np.zeros((b, 9))
        self.phases_s = np.zeros((b, len(self.phase_names)))
        self.sensor_seed = np.zeros(b, np.int64)
        self.episode = np.zeros(b, np.int64)
        self._survey_now: _Survey | None = None

    @property
    def time_s(self) -> Array:
        """Seconds since the stream began, (B,)."""
        return self.totals[:, _TIME]

    def reset_rows(self, rows: Rows, generators: Sequence[np.random.Generator]) -> None:
        """Draw new streams for ``rows``; the belt is full up to the reach, the platform rests in the middle."""
        if len(rows) == 0:
            return
        uniform, normal, camera_uniform, camera_normal = draw_blocks(generators, self._numbers)
        items = draw_items(self.config, uniform, normal)
        long_axis, short_axis = item_axes(items.yaw, items.tilt, items.azimuth)
        truth, above = self._truth, self.config.machine.sorter.origin_above_belt_m
        truth[0, rows, :-1] = items.arrival_s - items.slip_m[..., 0] * (1.0 / self._speed)
        truth[1, rows, :-1], truth[2, rows, :-1] = items.y_m + items.slip_m[..., 1], items.z_m - above
        truth[3:6, rows, :-1] = np.moveaxis(long_axis, -1, 0)
        truth[6:9, rows, :-1] = np.moveaxis(short_axis, -1, 0)
        truth[9, rows, :-1], truth[10, rows, :-1] = (1.0 - items.width) ** 2, (1.0 - items.thickness) ** 2
        truth[11, rows, :-1], truth[12, rows, :-1] = items.luck[..., 0], items.luck[..., 1]
        for column, values in enumerate((items.arrival_s, items.y_m, items.z_m)):
            self.item_place[rows, :-1, column] = values
        self.item_free[rows, :-1], self.item_grade[rows, :-1] = items.exists, items.grade
        shape = (items.length_m, items.width, items.thickness, items.yaw, items.tilt, items.azimuth, items.skin)
        for column, values in enumerate(shape):
            self.item_shape[rows, :-1, column] = values
        self.total[rows] = items.exists.sum(axis=1)
        self.total_value[rows] = (self._values[items.grade] * items.exists).sum(axis=1)
        last = np.where(items.exists, items.arrival_s, -np.inf).max(axis=1)
        self.end_s[rows] = np.maximum(last + self.config.belt.exit_x_m / self._speed, 0.0)
        self.totals[rows], self.phases_s[rows] = 0.0, 0.0
        self.place[rows], self.turn[rows], self._level[rows] = 0.0, (1.0, 0.0, 0.0, 0.0), True
        self._first[rows] = 0
        self.episode[rows] += 1
        self.sensor_seed[rows] = (camera_uniform[:, 0] * 2.0**52).astype(np.int64)
        self.leave_s[rows], self.seen_s[rows] = np.inf, np.inf
        self.report_item[rows] = self._no_item
        self._feature[rows] = 0.0
        if self.perception is not None:
            reports = draw_reports(self.config, self.perception, items, camera_uniform, camera_normal)
            self._place_reports(rows, reports)
        self._survey_now = None

    def receive(self, row: int, reports: Reports) -> None:
        """Add a camera's reports (1, n) to one world; those that do not fit in the memory are forgotten."""
        # What is done or has left makes room.
        kept = np.flatnonzero(np.isfinite(self.seen_s[row]) & (self.leave_s[row] > self.totals[row, _TIME]))
        n = min(reports.arrival_s.shape[1], self._no_report - len(kept))
        if n <= 0:
            return
        part = Reports(**{name: values[:, :n] for name, values in vars(reports).items()})
        columns, features, leave = prepare(self.config, part)
        old = {name: getattr(self, name)[row, kept].copy() for name in ("seen_s", "report_item", "report_grade")}
        leave_s = np.concatenate([self.leave_s[row, kept], leave[0]])
        order = np.argsort(leave_s, kind="stable")
        m = len(order)
        self.leave_s[row, :m] = leave_s[order]
        self._columns[:, row, :m] = np.concatenate([self._columns[:, row, kept], columns[:, 0]], axis=1)[:, order]
        self._feature[row, :m] = np.concatenate([self._feature[row, kept], features[0]])[order]
        self.seen_s[row, :m] = np.concatenate([old["seen_s"], part.seen_s[0]])[order]
        self.report_item[row, :m] = np.concatenate([old["report_item"], part.item[0]])[order]
        self.report_grade[row, :m] = np.concatenate([old["report_grade"], part.grade[0]])[order]
        held, lost = self._foresee(np.array([row]), self._columns[:, [row], :m], self.report_item[[row], :m])
        self.report_held[row, :m], self.report_lost[row, :m] = held[0], lost[0]
        for name, nothing in (("leave_s", np.inf), ("seen_s", np.inf), ("report_item", self._no_item)):
            getattr(self, name)[row, m:] = nothing
        self._feature[row, m:] = 0.0
        self._first[row] = 0
        self._survey_now = None

    def plan(self, actions: NDArray[np.int64]) -> SorterPlan:
        """Turn actions (B,) into motions and nominal phase times."""
        survey = self._survey()
        k = self.config.slots
        slot = np.minimum(actions, k - 1)
        at = self._rows * k + slot
        legal = survey.legal.take(at)
        kind = np.where(actions == k, WAIT, np.where(legal, PICK, NOTHING))
        picking = kind == PICK
        place = survey.place.take(at)
        p = self._columns.reshape(len(COLUMNS), -1).take(place, axis=1)
        grade = self.report_grade.take(place)
        phases = np.zeros((len(kind), len(self.phase_names)))
        phases[:, 0] = survey.wait_s.take(at)
        phases[:, 1] = survey.approach_s.take(at)
        phases[:, 2] = phases[:, 4] = p[15]
        phases[:, 3] = self.config.grip.grip_s
        phases[:, 5] = survey.carry_s.take(at)
        phases[:, 6] = self.config.grip.release_s
        if not picking.all():
            phases *= picking[:, None]
            phases[:, 0] += self._rest_s.take(kind)
        meet = np.empty((len(kind), 2))
        meet[:, 0], meet[:, 1] = survey.meet_x.take(at), p[1]
        grip = np.empty((len(kind), 3))
        grip[:, 0] = meet[:, 0] + self._speed * p[15]
        grip[:, 1], grip[:, 2] = p[1], p[14]
        return SorterPlan(
            kind=kind,
            slot=slot,
            report=np.where(picking, place - self._report_offset, self._no_report),
            start=self.place,
            start_turn=self.turn,
            meet=meet,
            grip=grip,
            turn=np.ascontiguousarray(p[6:10].T),
            axes=p[16:],
            bin=self._bins.take(grade, axis=0),
            phases_s=phases,
        )

    def grip(self, plan: SorterPlan, position: Array, axes: Array) -> Grip:
        """What the fingers get when they close with the platform at ``position`` (B, 3) and the tool's ``axes``."""
        item = self._item_offset + self.report_item.take(self._report_offset + plan.report)
        truth = self._truth.reshape(len(self._truth), -1).take(item, axis=1)
        phases = plan.phases_s
        closing_s = self.totals[:, _TIME] + phases[:, 0] + phases[:, 1] + phases[:, 2]
        tool = position.T - self.config.machine.sorter.tool_m * axes[3:]
        off = tool - truth[:3]
        off[0] = tool[0] - self._speed * (closing_s - truth[0])
        held, lost = self._fate(off, axes, truth)
        held &= self.item_free.take(item)
        return Grip(held, lost & held)

    def foreseen(self, plan: SorterPlan) -> Grip:
        """What the fingers get when the platform is exactly where the plan wants it: known since the report came."""
        at = self._report_offset + plan.report
        held = self.report_held.take(at)
        held &= self.item_free.take(self._item_offset + self.report_item.take(at))
        return Grip(held, self.report_lost.take(at) & held)

    def phases_of(self, plan: SorterPlan, held: NDArray[np.bool_]) -> Array:
        """Nominal seconds (B, 7) of each phase: after an empty grip the platform only comes to rest."""
        empty = (plan.kind == PICK) & ~held
        if not empty.any():
            return plan.phases_s
        phases = plan.phases_s.copy()
        phases[empty, 5], phases[empty, 6] = self.config.machine.stop_s, 0.0
        return phases

    def apply(self, plan: SorterPlan, outcome: SorterOutcome) -> StepResult:
        """Book the item and the time, and move to the next decision."""
        picking = plan.kind == PICK
        held = outcome.grip.held & picking
        at = self._report_offset + plan.report
        item = self.report_item.take(at)
        lost = outcome.grip.lost & picking
        arrived = held & ~lost
        place = self._item_offset + item
        true_grade = self.item_grade.take(place)
        right = arrived & (true_grade == self.report_grade.take(at))
        value = self._values.take(true_grade) * right
        self.item_free.put(place[held], False)
        self.leave_s.put(at[picking], -np.inf)

        totals = self.totals
        elapsed = np.add.reduce(outcome.phases_s, axis=1)
        booked = np.empty_like(totals)
        booked[:, _TIME] = elapsed
        booked[:, _LAST] = 0.0
        booked[:, _PLACED] = right
        booked[:, _VALUE] = value
        booked[:, _MISPLACED] = arrived & ~right
        booked[:, _DROPPED] = lost
        booked[:, _WASTED] = picking & ~held
        booked[:, _ILLEGAL] = plan.kind == NOTHING
        booked[:, _PICKS] = arrived
        totals += booked
        np.copyto(totals[:, _LAST], totals[:, _TIME], where=arrived)
        self.phases_s += outcome.phases_s
        self._move(plan, picking, held)
        self._survey_now = None

        rewards = np.empty((len(picking), 4))
        rewards[:, 0] = value * self._weights[0]
        rewards[:, 1:] = booked[:, _MISPLACED : _WASTED + 1] * self._weights[1]
        terminated = totals[:, _TIME] >= self.end_s
        truncated = (totals[:, _TIME] >= self.config.scenario.time_limit_s) & ~terminated
        return StepResult(rewards, outcome.phases_s, terminated, truncated)

    def observe(self) -> dict[str, NDArray[np.float32 | np.int8]]:
        """What the machine knows: itself, the items that it has seen and that have not left, what it may do."""
        survey = self._survey()
        p, t = survey.columns, self.totals[:, _TIME]
        feature = self._feature.reshape(-1, len(CANDIDATE_FEATURES)).take(survey.place, axis=0)
        present = feature[..., 0]
        total_s = survey.approach_s + survey.wait_s + survey.carry_s
        total_s += p[4] + self.config.grip.release_s
        slack = p[5] - t[:, None] - survey.approach_s
        feature[..., 1] = (t[:, None] - p[0]) * (self._speed / PLACE_SCALE_M)
        feature[..., _STATIC] = survey.approach_s
        feature[..., _STATIC + 1] = survey.wait_s * (1.0 / WAIT_SCALE_S)
        feature[..., _STATIC + 2] = total_s * (1.0 / CYCLE_SCALE_S)
        feature[..., _STATIC + 3] = np.maximum(slack, -WAIT_SCALE_S) * (1.0 / WAIT_SCALE_S)
        feature[..., _STATIC + 4] = survey.legal
        feature *= present[..., None]
        machine = np.empty((self.worlds, len(MACHINE_FEATURES)), np.float32)
        machine[:, :2] = self.place * (1.0 / PLACE_SCALE_M)
        machine[:, 2] = np.sqrt(np.maximum(1.0 - self.turn[:, 0] * self.turn[:, 0], 0.0))
        machine[:, 3] = t * (1.0 / self.config.scenario.time_limit_s)
        machine[:, 4] = np.add.reduce(present, axis=1) * (1.0 / self.config.slots)
        mask = np.ones((self.worlds, self.config.slots + 1), np.int8)
        mask[:, :-1] = survey.legal
        return {"machine": machine, "candidates": feature.reshape(self.worlds, -1), "action_mask": mask}

    def scores(self) -> Array:
        """Scorecard so far; see ``score_names``. The net rate's denominator is every item of the stream."""
        t = self.totals
        time_s = np.maximum(t[:, _TIME], 1e-9)
        result = np.empty((self.worlds, len(self.score_names)))
        result[:, 0] = t[:, _PLACED] / np.maximum(self.total, 1.0)
        result[:, 1] = t[:, _LAST] / np.maximum(t[:, _PICKS], 1.0)
        result[:, 2] = 60.0 * t[:, _PLACED] / time_s
        result[:, 3] = t[:, _TIME]
        result[:, 4] = t[:, _PLACED]
        result[:, 5] = self.total - t[:, _PICKS] - t[:, _DROPPED]
        result[:, 6] = t[:, _DROPPED]
        result[:, 7] = t[:, _ILLEGAL]
        result[:, 8:15] = self.phases_s
        result[:, 15] = t[:, _VALUE] / np.maximum(self.total_value, 1e-12)
        result[:, 16:19] = t[:, _MISPLACED : _WASTED + 1]
        result[:, 19] = self.total
        result[:, 20] = 60.0 * t[:, _PICKS] / time_s
        return result

    def describe(self, plan: SorterPlan, result: StepResult, row: int = 0) -> str:
        """One line about the last decision."""
        elapsed = float(result.phases_s[row].sum())
        if plan.kind[row] != PICK:
            return f"{'wait' if plan.kind[row] == WAIT else 'illegal action'}: {elapsed:.2f} s"
        grade = GRADES[int(self.report_grade[row, plan.report[row]])]
        placed, misplaced, dropped, wasted = (float(value) for value in result.rewards[row])
        words = [(placed, "placed"), (misplaced, "wrong bin"), (dropped, "dropped"), (wasted, "nothing held")]
        what = next((word for value, word in words if value), "no reward")
        return f"{grade} from slot {int(plan.slot[row])}: {what}, {elapsed:.2f} s"

    def item_exists(self, row: int) -> NDArray[np.bool_]:
        """Which of a world's item slots (N + 1,) hold an item, on the belt or not; for drawing and counting alone."""
        return np.isfinite(self.item_place[row, :, 0])

    def item_mass_kg(self, plan: SorterPlan, row: int = 0) -> float:
        """Mass of the item that a world's plan goes for; 0 where there is none."""
        item = int(self.report_item[row, plan.report[row]])
        if item == self._no_item:
            return 0.0
        length, width, thickness = self.item_shape[row, item, :3].tolist()
        return float(self.config.produce.density_kg_m3 * pi / 6.0 * length**3 * width * thickness)

    def refusal(self, slot: int, row: int = 0) -> str:
        """Why a slot cannot be gripped now, in words; names the machine's limit where it is one. Empty if it can."""
        from .refusals import explain

        survey = self._survey()
        if survey.legal[row, slot]:
            return ""
        report = int(survey.place[row, slot] - self._report_offset[row])
        if report == self._no_report:
            return "no item in this slot"
        return explain(self.config, self._columns[:, row, report], float(self.totals[row, _TIME]))

    def _fate(self, off: Array, axes: Array, truth: Array) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Whether the fingers hold, and whether the item would slip on the way, (...), if it is there.

        Args:
            off: tool less item's centre, (3, ...), metres.
            axes: the tool's x and z axes, (6, ...).
            truth: the items' numbers, (13, ...).
        """
        in_line = axes * truth[3:9]
        cosines = in_line[0::3] + in_line[1::3] + in_line[2::3]
        misfit = (1.0 - cosines * cosines) * truth[9:11]
        quality = grip_quality(self.config.grip, off, misfit)
        return holds(self.config.grip, quality, truth[11]), slips(self.config.grip, quality, truth[12])

    def _foresee(
        self, rows: Rows, columns: Array, item: NDArray[np.int64]
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """``_fate`` of reports (R, M) when the tool goes where they say: the belt's speed cancels out."""
        truth = self._truth.reshape(len(self._truth), -1).take(self._item_offset[rows][:, None] + item, axis=1)
        axes = columns[16:22]
        off = columns[[1, 1, 14]] - self.config.machine.sorter.tool_m * axes[3:]
        off[1:] -= truth[1:3]
        off[0] += self._speed * (truth[0] - columns[0]) - columns[1]
        return self._fate(off, axes, truth)

    def _move(self, plan: SorterPlan, picking: NDArray[np.bool_], held: NDArray[np.bool_]) -> None:
        """Put the platforms where the decision leaves them: over the bin, or at rest over the belt."""
        if held.all():
            self.place = plan.bin
            if not self._level.all():
                self.turn = np.zeros((len(held), 4))
                self.turn[:, 0] = 1.0
                self._level = np.ones(len(held), bool)
            return
        if not picking.any():
            return
        place, turn = self.place.copy(), self.turn.copy()
        place[held], turn[held] = plan.bin[held], (1.0, 0.0, 0.0, 0.0)
        empty = picking & ~held
        place[empty] = plan.meet[empty]
        follow_s = plan.phases_s[empty, 2] + plan.phases_s[empty, 3] + plan.phases_s[empty, 4]
        place[empty, 0] += self._speed * (follow_s + 0.5 * self.config.machine.stop_s)
        turn[empty] = plan.turn[empty]
        self.place, self.turn = place, turn
        self._level = (self._level | held) & ~empty

    def _survey(self) -> _Survey:
        """Look at every candidate from now; kept until something changes."""
        if self._survey_now is None:
            self._survey_now = self._look()
        return self._survey_now

    def _look(self) -> _Survey:
        t = self.totals[:, _TIME, None]
        place = self._candidates(t)
        p = self._columns[:SURVEYED].reshape(SURVEYED, -1).take(place, axis=1)
        v, half_v = self._speed, 0.5 * self._speed
        x0, y0 = self.place[:, :1], self.place[:, 1:]
        least = p[10]
        if not self._level.all():
            # From level a turn takes what it takes back to level: that is known since the report came.
            cosine = np.abs(np.add.reduce(p[6:10] * self.turn.T[:, :, None], axis=0))
            turn = 2.0 * np.arccos(np.minimum(cosine, 1.0))
            other = np.maximum(turn * self._by_rate, np.sqrt(turn * self._by_twist))
            np.maximum(other, self.config.machine.shortest_move_s, out=other)
            least = np.where(self._level[:, None], least, other)
        x_now = (t - p[0]) * v
        across = p[1] - y0
        across *= across
        # The item moves on while the tool comes: the time is a fixed point. The belt is slow against the tool, so that
        # two rounds bring it to 0.1 % of the distance.
        ahead, edge = x_now - x0, p[2] - x0
        approach = least + _GUESS_S
        for _ in range(2):
            follow = v * approach
            approach = self._move_s(np.maximum(ahead + follow, edge) - 0.5 * follow, across, least)
        meet_x = np.maximum(x_now + v * approach, p[2])
        wait = np.maximum((meet_x - x_now) * (1.0 / v) - approach, 0.0)
        way = p[12] - meet_x - v * p[4]
        carry = p[13]
        for _ in range(2):
            carry = self._move_s(way - half_v * carry, p[11], p[10])
        return _Survey(place, p, meet_x, approach, wait, carry, meet_x <= p[3])

    def _move_s(self, along: Array, across_square: Array, least_s: Array) -> Array:
        """Seconds of a horizontal motion under the speed and acceleration limits, at least ``least_s``."""
        distance = np.sqrt(along * along + across_square)
        return np.maximum(np.maximum(distance * self._by_speed, np.sqrt(distance * self._by_push)), least_s)

    def _candidates(self, t: Array) -> NDArray[np.int64]:
        """Flat places (B, K) of the first reports, by leaving time, that have come and whose items are there."""
        # The window may look past the last report: behind it lie places that never leave and never come.
        place = (self._report_offset + self._first)[:, None] + self._window
        gone = self._gone
        np.less_equal(self.leave_s.take(place), t, out=gone[:, :-1])
        self._first += gone.argmin(axis=1)
        hidden = self.seen_s.take(place) > t
        hidden |= gone[:, :-1]
        # Flat places ascend, and none lies behind the empty one: sorting moves what is hidden to the end.
        shown = np.where(hidden, self._empty_place, place)
        shown.sort(axis=1)
        return np.minimum(shown[:, : self.config.slots], self._empty_place)

    def _place_reports(self, rows: Rows, reports: Reports) -> None:
        """Write reports and all that can be said of them before they arrive, in the order in which they leave."""
        columns, features, leave = prepare(self.config, reports)
        order = leave.argsort(axis=1, kind="stable")
        m = order.shape[1]
        self.leave_s[rows, :m] = np.take_along_axis(leave, order, axis=1)
        self._columns[:, rows, :m] = np.take_along_axis(columns, order[None], axis=2)
        self._feature[rows, :m] = np.take_along_axis(features, order[..., None], axis=1)
        self.seen_s[rows, :m] = np.take_along_axis(reports.seen_s, order, axis=1)
        self.report_item[rows, :m] = np.take_along_axis(reports.item, order, axis=1)
        self.report_grade[rows, :m] = np.take_along_axis(reports.grade, order, axis=1)
        held, lost = self._foresee(rows, self._columns[:, rows, :m], self.report_item[rows, :m])
        self.report_held[rows, :m], self.report_lost[rows, :m] = held, lost
