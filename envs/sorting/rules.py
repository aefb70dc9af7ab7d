"""The sorting rules, one world after the other, as machine code; ``state`` says what they work on."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled, copy, fill
from ..core import Array, StepResult
from ..kernel_core import book
from .columns import (
    CANDIDATE,
    LIMIT,
    MACHINE,
    NUMBER,
    PHASE,
    PLACE_SCALE_M,
    REWARD,
    SCORE,
    TOTAL,
    TRUTH,
    Candidate,
    Phases,
    Rewards,
    Scores,
)
from .looks import ROOM, WAY, in_time, lay_features, lay_way, look, scale, ways_for
from .order_columns import Tallies
from .orders import blocked_s, deliver, fill_bin, lines_full, show_book, waiting_line
from .reports import fate, show_reports, shown
from .state import NOTHING, PICK, WAIT, Grip, SorterPlan, Tables, Worlds

_FEATURES = len(Candidate._fields)
_PHASES, _REWARDS, _SCORES = len(Phases._fields), len(Rewards._fields), len(Scores._fields)
_TALLIES = len(Tallies._fields)


@compiled
def plan_worlds(tables: Tables, worlds: Worlds, actions: NDArray[np.int64]) -> SorterPlan:
    """Turn actions (B,) into motions and nominal phase times."""
    n, slots, empty = actions.size, worlds.slot_report.shape[1], worlds.number.shape[1] - 1
    kinds, slot = np.empty(n, np.int64), np.empty(n, np.int64)
    reports, grades = np.empty(n, np.int64), np.empty(n, np.int64)
    start, start_turn = worlds.place.copy(), worlds.turn.copy()
    meet, bins, turn = worlds.place.copy(), worlds.place.copy(), worlds.turn.copy()
    grip, axes, phases_s = np.empty((n, 3)), np.zeros((n, 6)), np.zeros((n, _PHASES))
    paces, speed = tables.paces, tables.paces.speed_m_s
    ways = ways_for(min(n, ROOM))
    for w in range(n):
        if w % ROOM == 0:
            together = min(ROOM, n - w)
            for i in range(together):
                slot[w + i] = min(actions[w + i], slots - 1)
                lay_way(tables, worlds, w + i, worlds.slot_report[w + i, slot[w + i]], ways, i)
            look(tables, ways, together)
        report = worlds.slot_report[w, slot[w]]
        number = worlds.number[w, report]
        way = ways[:, w % ROOM]
        kind = WAIT if actions[w] == slots else (PICK if in_time(ways, w % ROOM) and report != empty else NOTHING)
        kinds[w] = kind
        if kind != PICK:
            reports[w], grades[w] = empty, worlds.report_grade[w, empty]
            grip[w, 0], grip[w, 1], grip[w, 2] = start[w, 0], start[w, 1], tables.level_m
            phases_s[w, PHASE.wait] = tables.rest_s[kind]
            continue
        reports[w], grades[w] = report, worlds.report_grade[w, report]
        meet[w, 0], meet[w, 1] = way[WAY.meet_m], number[NUMBER.across_m]
        grip[w, 0] = way[WAY.meet_m] + speed * number[NUMBER.descend_s]
        grip[w, 1], grip[w, 2] = number[NUMBER.across_m], number[NUMBER.height_m]
        copy(number[NUMBER.turn_w :], turn[w])
        copy(number[NUMBER.x_axis_x :], axes[w])
        copy(tables.bins[grades[w]], bins[w])
        phases_s[w, PHASE.wait], phases_s[w, PHASE.approach] = way[WAY.wait_s], way[WAY.approach_s]
        phases_s[w, PHASE.descend], phases_s[w, PHASE.lift] = number[NUMBER.descend_s], number[NUMBER.descend_s]
        phases_s[w, PHASE.grip], phases_s[w, PHASE.carry] = paces.grip_s, way[WAY.carry_s]
        phases_s[w, PHASE.release] = paces.release_s
        if worlds.bin_ready_s.shape[1]:
            over_s = worlds.totals[w, TOTAL.time_s] + way[WAY.wait_s] + way[WAY.approach_s]
            over_s += number[NUMBER.hold_s] + way[WAY.carry_s]
            phases_s[w, PHASE.release] += blocked_s(worlds, w, grades[w], over_s)
    return SorterPlan(kinds, slot, reports, grades, start, start_turn, meet, grip, turn, axes, bins, phases_s)


@compiled
def grip_worlds(tables: Tables, worlds: Worlds, plan: SorterPlan, position: Array, axes: Array) -> Grip:
    """What the fingers get with the platform at ``position`` (B, 3) and the tool's ``axes`` (B, 6) as they close."""
    n = len(plan.kind)
    held, lost = np.empty(n, np.bool_), np.empty(n, np.bool_)
    for w in range(n):
        item = worlds.report_item[w, plan.report[w]]
        truth, phases = worlds.item_truth[w, item], plan.phases_s[w]
        closing_s = worlds.totals[w, TOTAL.time_s] + phases[PHASE.wait] + phases[PHASE.approach] + phases[PHASE.descend]
        held[w], lost[w] = fate(
            tables.fingers,
            position[w, 0] - tables.tool_m * axes[w, 3] - tables.paces.speed_m_s * (closing_s - truth[TRUTH.passing_s]),
            position[w, 1] - tables.tool_m * axes[w, 4] - truth[TRUTH.across_m],
            position[w, 2] - tables.tool_m * axes[w, 5] - truth[TRUTH.up_m],
            axes[w],
            truth,
        )
        held[w] = held[w] and worlds.item_free[w, item]
        lost[w] = lost[w] and held[w]
    return Grip(held, lost)


@compiled
def foresee_worlds(worlds: Worlds, report: NDArray[np.int64]) -> Grip:
    """What the fingers get when the platform is exactly where the plan wants it: known since the report came."""
    n = len(report)
    held, lost = np.empty(n, np.bool_), np.empty(n, np.bool_)
    for w in range(n):
        held[w] = worlds.report_held[w, report[w]] and worlds.item_free[w, worlds.report_item[w, report[w]]]
        lost[w] = worlds.report_lost[w, report[w]] and held[w]
    return Grip(held, lost)


@compiled
def end_phases(plan: SorterPlan, held: NDArray[np.bool_], stop_s: float) -> Array:
    """Nominal seconds (B, 7) of each phase: after an empty grip the platform only comes to rest."""
    phases_s = plan.phases_s.copy()
    for w in range(len(held)):
        if plan.kind[w] == PICK and not held[w]:
            phases_s[w, PHASE.carry], phases_s[w, PHASE.release] = stop_s, 0.0
    return phases_s


@compiled
def apply_worlds(tables: Tables, worlds: Worlds, plan: SorterPlan, grip: Grip, phases_s: Array) -> StepResult:
    """Book the item and the time, and move to the next decision."""
    n = len(plan.kind)
    rewards, terminated, truncated = np.zeros((n, _REWARDS)), np.empty(n, np.bool_), np.empty(n, np.bool_)
    for w in range(n):
        totals, elapsed = worlds.totals[w], 0.0
        for phase in range(_PHASES):
            elapsed += phases_s[w, phase]
            totals[TOTAL.wait_s + phase] += phases_s[w, phase]
        totals[TOTAL.time_s] += elapsed
        kind, report = plan.kind[w], plan.report[w]
        if kind == PICK:
            worlds.leave_s[w, report] = -np.inf
            item = worlds.report_item[w, report]
            if grip.held[w]:
                worlds.item_free[w, item] = False
                grade, reported, wanted = int(worlds.item_truth[w, item, TRUTH.grade]), plan.grade[w], True
                if worlds.line_left.shape[1] and not grip.lost[w]:
                    fill_bin(worlds, w, reported, tables.bin_holds, tables.swap_s, totals[TOTAL.time_s])
                    wanted = grade == reported and deliver(worlds, w, grade, totals[TOTAL.time_s])
                put_down(tables, grade, reported, grip.lost[w], wanted, totals, rewards[w])
                copy(plan.bin[w], worlds.place[w])
                fill(worlds.turn[w], 0.0)
                worlds.turn[w, 0], worlds.level[w] = 1.0, True
            else:
                totals[TOTAL.wasted] += 1.0
                rewards[w, REWARD.wasted] = tables.weights[REWARD.wasted]
                # The platform rests over the belt, turned as it was.
                phases = plan.phases_s[w]
                follow_s = phases[PHASE.descend] + phases[PHASE.grip] + phases[PHASE.lift] + 0.5 * tables.paces.stop_s
                worlds.place[w, 0] = plan.meet[w, 0] + tables.paces.speed_m_s * follow_s
                worlds.place[w, 1] = plan.meet[w, 1]
                copy(plan.turn[w], worlds.turn[w])
                worlds.level[w] = False
        elif kind == NOTHING:
            totals[TOTAL.illegal] += 1.0
        time_s = totals[TOTAL.time_s]
        terminated[w] = time_s >= worlds.end_s[w]
        truncated[w] = time_s >= tables.time_limit_s and not terminated[w]
        show_reports(worlds, w, time_s)
    return StepResult(rewards, phases_s, terminated, truncated)


@compiled
def put_down(
    tables: Tables, grade: int, reported: int, lost: bool, wanted: bool, totals: Array, rewards: Array
) -> None:
    """Book an item that was lifted: its true grade, its bin's, whether it fell on the way and whether it is ordered."""
    if lost:
        totals[TOTAL.dropped] += 1.0
        rewards[REWARD.dropped] = tables.weights[REWARD.dropped]
        return
    totals[TOTAL.last_pick_s] = totals[TOTAL.time_s]
    totals[TOTAL.picks] += 1.0
    if grade == reported and not wanted:
        rewards[REWARD.placed] = tables.surplus * tables.values[grade] * tables.weights[REWARD.placed]
    elif grade == reported:
        totals[TOTAL.last_placed_s] = totals[TOTAL.time_s]
        totals[TOTAL.placed] += 1.0
        totals[TOTAL.value] += tables.values[grade]
        rewards[REWARD.placed] = tables.values[grade] * tables.weights[REWARD.placed]
    else:
        totals[TOTAL.misplaced] += 1.0
        rewards[REWARD.misplaced] = tables.weights[REWARD.misplaced]


@compiled
def observe_worlds(
    tables: Tables,
    worlds: Worlds,
    rows: NDArray[np.int64],
    machine: NDArray[np.float32],
    candidates: NDArray[np.float32],
    mask: NDArray[np.int8],
) -> None:
    """Write features of the machine (B, .) and of the candidates (B, K * F), and the mask (B, K + 1), of ``rows``."""
    slots, empty = worlds.slot_report.shape[1], worlds.number.shape[1] - 1
    together = max(ROOM // slots, 1)
    ways = ways_for(slots * min(together, len(rows)))
    for first in range(0, len(rows), together):
        some, looks = rows[first : first + together], 0
        for w in some:
            for k in range(slots):
                if worlds.slot_report[w, k] == empty:
                    break
                lay_way(tables, worlds, w, worlds.slot_report[w, k], ways, looks)
                looks += 1
        look(tables, ways, looks)
        if worlds.line_left.shape[1]:
            looks = 0
            for w in some:
                for k in range(slots):
                    report = worlds.slot_report[w, k]
                    if report == empty:
                        break
                    over_s = ways[WAY.time_s, looks] + ways[WAY.cycle_s, looks] - tables.paces.release_s
                    ways[WAY.cycle_s, looks] += blocked_s(worlds, w, int(worlds.report_grade[w, report]), over_s)
                    looks += 1
        scale(ways, looks)
        looks = 0
        for w in some:
            fill(candidates[w], 0.0)
            fill(mask[w], 0)
            time_s, taken = worlds.totals[w, TOTAL.time_s], 0
            for k in range(slots):
                report = worlds.slot_report[w, k]
                if report == empty:
                    break
                feature = candidates[w, k * _FEATURES : (k + 1) * _FEATURES]
                copy(worlds.feature[w, report], feature)
                lay_features(ways, looks + k, feature)
                if worlds.line_left.shape[1]:
                    grade = int(worlds.report_grade[w, report])
                    if waiting_line(worlds, w, grade, time_s + ways[WAY.cycle_s, looks + k]) < 0:
                        feature[CANDIDATE.value] = tables.surplus * tables.values[grade]
                mask[w, k] = in_time(ways, looks + k)
                taken += 1
            looks += taken
            mask[w, slots] = 1
            x, y, turn_w = worlds.place[w, 0], worlds.place[w, 1], worlds.turn[w, 0]
            machine[w, MACHINE.x], machine[w, MACHINE.y] = shown(x / PLACE_SCALE_M), shown(y / PLACE_SCALE_M)
            machine[w, MACHINE.turned] = math.sqrt(max(1.0 - turn_w * turn_w, 0.0))
            machine[w, MACHINE.time] = shown(time_s / tables.time_limit_s)
            machine[w, MACHINE.in_view] = taken / slots
            if worlds.line_left.shape[1]:
                show_book(worlds, w, tables.bin_holds, LIMIT, machine[w])


@compiled
def score_worlds(worlds: Worlds, rows: NDArray[np.int64], numbers: Array) -> None:
    """Write the scorecard so far of ``rows`` into the last columns (B, .); the net rate counts every item.

    Where there are orders it counts every item ordered, and what belongs to orders alone stands behind the rest.
    """
    ordered = worlds.line_left.shape[1] > 0
    first = numbers.shape[1] - _SCORES - (_TALLIES + 1 if ordered else 0)
    for w in rows:
        t, score = worlds.totals[w], numbers[w, first:]
        per_minute = 60.0 / max(t[TOTAL.time_s], 1e-9)
        score[SCORE.net_rate] = t[TOTAL.placed] / max(t[TOTAL.items], 1.0)
        score[SCORE.cycle_time_s] = t[TOTAL.last_placed_s] / max(t[TOTAL.placed], 1.0)
        score[SCORE.throughput_per_min] = t[TOTAL.placed] * per_minute
        score[SCORE.duration_s] = t[TOTAL.time_s]
        score[SCORE.done] = t[TOTAL.placed]
        score[SCORE.missed] = t[TOTAL.items] - t[TOTAL.picks] - t[TOTAL.dropped]
        score[SCORE.damaged] = t[TOTAL.dropped]
        score[SCORE.illegal] = t[TOTAL.illegal]
        copy(t[TOTAL.wait_s :], score[SCORE.phase_wait_s : SCORE.phase_wait_s + _PHASES])
        score[SCORE.value_rate] = t[TOTAL.value] / max(t[TOTAL.worth], 1e-12)
        score[SCORE.misplaced] = t[TOTAL.misplaced]
        score[SCORE.wasted] = t[TOTAL.wasted]
        score[SCORE.total] = t[TOTAL.items]
        score[SCORE.picks_per_min] = t[TOTAL.picks] * per_minute
        score[SCORE.pick_cycle_s] = t[TOTAL.last_pick_s] / max(t[TOTAL.picks], 1.0)
        if ordered:
            score[SCORE.missed] = t[TOTAL.items] - t[TOTAL.placed]
            copy(worlds.tallies[w], score[_SCORES : _SCORES + _TALLIES])
            score[_SCORES + _TALLIES] = lines_full(worlds, w)


@compiled
def show_worlds(
    desk: Any,
    rows: NDArray[np.int64],
    machine: NDArray[np.float32],
    candidates: NDArray[np.float32],
    mask: NDArray[np.int8],
    numbers: Array,
) -> None:
    """What ``rows`` show; see ``KernelCore``."""
    (tables,), worlds = desk.rules, desk.worlds
    observe_worlds(tables, worlds, rows, machine, candidates, mask)
    score_worlds(worlds, rows, numbers)


@compiled
def decide_worlds(
    desk: Any,
    rows: NDArray[np.int64],
    actions: NDArray[np.int64],
    machine: NDArray[np.float32],
    candidates: NDArray[np.float32],
    mask: NDArray[np.int8],
    numbers: Array,
    terminated: NDArray[np.bool_],
    truncated: NDArray[np.bool_],
) -> None:
    """A decision in all worlds that goes as planned; see ``KernelCore``."""
    (tables,), worlds = desk.rules, desk.worlds
    plan = plan_worlds(tables, worlds, actions)
    desk.plan = plan
    grip = foresee_worlds(worlds, plan.report)
    phases_s = end_phases(plan, grip.held, tables.paces.stop_s)
    book(apply_worlds(tables, worlds, plan, grip, phases_s), numbers, terminated, truncated)
    show_worlds(desk, rows, machine, candidates, mask, numbers)
