"""The sorting rules, one world after the other, as machine code; ``task`` prepares what they work on."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled, copy, fill, shortest
from ..core import Array, StepResult
from .features import (
    CANDIDATE_FEATURES,
    CYCLE_SCALE_S,
    MACHINE_FEATURES,
    PLACE_SCALE_M,
    WAIT_SCALE_S,
)
from .reports import fate, show_reports
from .state import (
    ACROSS_M,
    APPROACH,
    ASIDE_M2,
    BIN_M,
    CARRY,
    CARRY_S,
    DEADLINE_S,
    DESCEND,
    DESCEND_S,
    DROPPED,
    FIRST_M,
    GRIP,
    HEIGHT_M,
    HOLD_S,
    ILLEGAL,
    LAST,
    LAST_M,
    LEAST_S,
    LIFT,
    MISPLACED,
    NOTHING,
    PASSING_S,
    PHASES,
    PICK,
    PICKS,
    PLACED,
    RELEASE,
    STAND,
    TIME,
    TOTAL,
    TOTAL_VALUE,
    TRUE_GRADE,
    TRUE_S,
    TRUE_Y,
    TRUE_Z,
    TURN,
    VALUE,
    WAIT,
    WASTED,
    X_AXIS,
    Candidate,
    Grip,
    SorterPlan,
    Tables,
    Worlds,
)

_GUESS_S = 0.15
"""First guess at how much longer an approach takes than turning alone."""
_ALONG, _APPROACH = CANDIDATE_FEATURES.index("along"), CANDIDATE_FEATURES.index("approach")
_MACHINE, _FEATURES = len(MACHINE_FEATURES), len(CANDIDATE_FEATURES)
_PHASES = 7
SCORES = 21


@compiled
def move_s(tables: Tables, along_m: float, across_m2: float, least_s: float) -> float:
    """Seconds of a horizontal motion under the speed and acceleration limits, at least ``least_s``."""
    return max(shortest(math.sqrt(along_m * along_m + across_m2), tables.pace, tables.square_pace), least_s)


@compiled
def turning_s(tables: Tables, turn: Array, number: Array) -> float:
    """Seconds that turning the platform from ``turn`` to a report's grip takes at least."""
    cosine = 0.0
    for part in range(4):
        cosine += number[TURN + part] * turn[part]
    angle = 2.0 * math.acos(min(abs(cosine), 1.0))
    return max(shortest(angle, tables.turn_pace, tables.turn_square_pace), tables.shortest_s)


@compiled
def look(tables: Tables, number: Array, time_s: float, place: Array, turn: Array, level: bool) -> Candidate:
    """See a report from a time and a platform's place and turn."""
    v = tables.speed_m_s
    # From level a turn takes what it takes back to level: that is known since the report came.
    least = number[LEAST_S] if level else turning_s(tables, turn, number)
    x_now = (time_s - number[PASSING_S]) * v
    across = number[ACROSS_M] - place[1]
    # The item moves on while the tool comes: the time is a fixed point. The belt is slow against the tool, so that
    # two rounds bring it to 0.1 % of the distance.
    approach = least + _GUESS_S
    for _ in range(2):
        follow = v * approach
        ahead = max(x_now + follow, number[FIRST_M]) - place[0]
        approach = move_s(tables, ahead - 0.5 * follow, across * across, least)
    meet = max(x_now + v * approach, number[FIRST_M])
    wait = max((meet - x_now) / v - approach, 0.0)
    way, carry = number[BIN_M] - meet - v * number[HOLD_S], number[CARRY_S]
    for _ in range(2):
        carry = move_s(tables, way - 0.5 * v * carry, number[ASIDE_M2], number[LEAST_S])
    return Candidate(meet, wait, approach, carry, meet <= number[LAST_M])


@compiled
def plan_worlds(tables: Tables, worlds: Worlds, actions: NDArray[np.int64]) -> SorterPlan:
    """Turn actions (B,) into motions and nominal phase times."""
    n, slots, empty = actions.size, worlds.slot_report.shape[1], worlds.number.shape[1] - 1
    kinds, slot = np.empty(n, np.int64), np.empty(n, np.int64)
    reports, grades = np.empty(n, np.int64), np.empty(n, np.int64)
    start, start_turn = worlds.place.copy(), worlds.turn.copy()
    meet, bins, turn = worlds.place.copy(), worlds.place.copy(), worlds.turn.copy()
    grip, axes, phases_s = np.empty((n, 3)), np.zeros((n, 6)), np.zeros((n, _PHASES))
    for w in range(n):
        slot[w] = min(actions[w], slots - 1)
        report = worlds.slot_report[w, slot[w]]
        number = worlds.number[w, report]
        seen = look(tables, number, worlds.totals[w, TIME], start[w], start_turn[w], worlds.level[w])
        kind = WAIT if actions[w] == slots else (PICK if seen.possible and report != empty else NOTHING)
        kinds[w] = kind
        if kind != PICK:
            reports[w], grades[w] = empty, worlds.report_grade[w, empty]
            grip[w, 0], grip[w, 1], grip[w, 2] = start[w, 0], start[w, 1], tables.level_m
            phases_s[w, STAND] = tables.rest_s[kind]
            continue
        reports[w], grades[w] = report, worlds.report_grade[w, report]
        meet[w, 0], meet[w, 1] = seen.meet_m, number[ACROSS_M]
        grip[w, 0] = seen.meet_m + tables.speed_m_s * number[DESCEND_S]
        grip[w, 1], grip[w, 2] = number[ACROSS_M], number[HEIGHT_M]
        copy(number[TURN:], turn[w])
        copy(number[X_AXIS:], axes[w])
        copy(tables.bins[grades[w]], bins[w])
        phases_s[w, STAND], phases_s[w, APPROACH] = seen.wait_s, seen.approach_s
        phases_s[w, DESCEND], phases_s[w, LIFT] = number[DESCEND_S], number[DESCEND_S]
        phases_s[w, GRIP], phases_s[w, CARRY], phases_s[w, RELEASE] = tables.grip_s, seen.carry_s, tables.release_s
    return SorterPlan(kinds, slot, reports, grades, start, start_turn, meet, grip, turn, axes, bins, phases_s)


@compiled
def grip_worlds(tables: Tables, worlds: Worlds, plan: SorterPlan, position: Array, axes: Array) -> Grip:
    """What the fingers get with the platform at ``position`` (B, 3) and the tool's ``axes`` (B, 6) as they close."""
    n = len(plan.kind)
    held, lost = np.empty(n, np.bool_), np.empty(n, np.bool_)
    for w in range(n):
        item = worlds.report_item[w, plan.report[w]]
        truth, phases = worlds.item_truth[w, item], plan.phases_s[w]
        closing_s = worlds.totals[w, TIME] + phases[STAND] + phases[APPROACH] + phases[DESCEND]
        held[w], lost[w] = fate(
            tables.fingers,
            position[w, 0] - tables.tool_m * axes[w, 3] - tables.speed_m_s * (closing_s - truth[TRUE_S]),
            position[w, 1] - tables.tool_m * axes[w, 4] - truth[TRUE_Y],
            position[w, 2] - tables.tool_m * axes[w, 5] - truth[TRUE_Z],
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
            phases_s[w, CARRY], phases_s[w, RELEASE] = stop_s, 0.0
    return phases_s


@compiled
def apply_worlds(tables: Tables, worlds: Worlds, plan: SorterPlan, grip: Grip, phases_s: Array) -> StepResult:
    """Book the item and the time, and move to the next decision."""
    n = len(plan.kind)
    rewards, terminated, truncated = np.zeros((n, 4)), np.empty(n, np.bool_), np.empty(n, np.bool_)
    for w in range(n):
        totals, elapsed = worlds.totals[w], 0.0
        for phase in range(_PHASES):
            elapsed += phases_s[w, phase]
            totals[PHASES + phase] += phases_s[w, phase]
        totals[TIME] += elapsed
        kind, report = plan.kind[w], plan.report[w]
        if kind == PICK:
            worlds.leave_s[w, report] = -np.inf
            item = worlds.report_item[w, report]
            if grip.held[w]:
                worlds.item_free[w, item] = False
                grade = int(worlds.item_truth[w, item, TRUE_GRADE])
                put_down(tables, grade, plan.grade[w], grip.lost[w], totals, rewards[w])
                copy(plan.bin[w], worlds.place[w])
                fill(worlds.turn[w], 0.0)
                worlds.turn[w, 0], worlds.level[w] = 1.0, True
            else:
                totals[WASTED] += 1.0
                rewards[w, 3] = tables.weights[3]
                # The platform rests over the belt, turned as it was.
                phases = plan.phases_s[w]
                follow_s = phases[DESCEND] + phases[GRIP] + phases[LIFT] + 0.5 * tables.stop_s
                worlds.place[w, 0] = plan.meet[w, 0] + tables.speed_m_s * follow_s
                worlds.place[w, 1] = plan.meet[w, 1]
                copy(plan.turn[w], worlds.turn[w])
                worlds.level[w] = False
        elif kind == NOTHING:
            totals[ILLEGAL] += 1.0
        time_s = totals[TIME]
        terminated[w] = time_s >= worlds.end_s[w]
        truncated[w] = time_s >= tables.time_limit_s and not terminated[w]
        worlds.first[w] = show_reports(
            worlds.slot_report[w],
            worlds.queue[w],
            worlds.first[w],
            worlds.queued[w],
            worlds.leave_s[w],
            worlds.seen_s[w],
            time_s,
        )
    return StepResult(rewards, phases_s, terminated, truncated)


@compiled
def put_down(tables: Tables, grade: int, reported: int, lost: bool, totals: Array, rewards: Array) -> None:
    """Book an item that was lifted: its true grade, the grade of its bin, and whether it fell on the way."""
    if lost:
        totals[DROPPED] += 1.0
        rewards[2] = tables.weights[2]
        return
    totals[LAST] = totals[TIME]
    totals[PICKS] += 1.0
    if grade == reported:
        totals[PLACED] += 1.0
        totals[VALUE] += tables.values[grade]
        rewards[0] = tables.values[grade] * tables.weights[0]
    else:
        totals[MISPLACED] += 1.0
        rewards[1] = tables.weights[1]


@compiled
def observe_worlds(tables: Tables, worlds: Worlds) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int8]]:
    """Features of the machine (B, .) and of the candidates (B, K * F), and the mask (B, K + 1)."""
    n, slots, empty = len(worlds.place), worlds.slot_report.shape[1], worlds.number.shape[1] - 1
    machine = np.empty((n, _MACHINE), np.float32)
    candidates = np.zeros((n, slots * _FEATURES), np.float32)
    mask = np.zeros((n, slots + 1), np.int8)
    for w in range(n):
        time_s, shown = worlds.totals[w, TIME], 0
        for k in range(slots):
            report = worlds.slot_report[w, k]
            if report == empty:
                break
            shown += 1
            number = worlds.number[w, report]
            seen = look(tables, number, time_s, worlds.place[w], worlds.turn[w], worlds.level[w])
            feature = candidates[w, k * _FEATURES : (k + 1) * _FEATURES]
            copy(worlds.feature[w, report], feature)
            cycle = seen.approach_s + seen.wait_s + seen.carry_s + number[HOLD_S] + tables.release_s
            slack = max(number[DEADLINE_S] - time_s - seen.approach_s, -WAIT_SCALE_S)
            feature[_ALONG] = (time_s - number[PASSING_S]) * tables.speed_m_s / PLACE_SCALE_M
            feature[_APPROACH] = seen.approach_s
            feature[_APPROACH + 1] = seen.wait_s / WAIT_SCALE_S
            feature[_APPROACH + 2] = cycle / CYCLE_SCALE_S
            feature[_APPROACH + 3] = slack / WAIT_SCALE_S
            feature[_APPROACH + 4] = seen.possible
            mask[w, k] = seen.possible
        mask[w, slots] = 1
        machine[w, 0], machine[w, 1] = worlds.place[w, 0] / PLACE_SCALE_M, worlds.place[w, 1] / PLACE_SCALE_M
        machine[w, 2] = math.sqrt(max(1.0 - worlds.turn[w, 0] * worlds.turn[w, 0], 0.0))
        machine[w, 3], machine[w, 4] = time_s / tables.time_limit_s, shown / slots
    return machine, candidates, mask


@compiled
def score_worlds(totals: Array) -> Array:
    """Scorecard so far (B, SCORES): the net rate's denominator is every item of the stream."""
    result = np.empty((len(totals), SCORES))
    for w in range(len(totals)):
        t = totals[w]
        per_minute = 60.0 / max(t[TIME], 1e-9)
        result[w, 0] = t[PLACED] / max(t[TOTAL], 1.0)
        result[w, 1] = t[LAST] / max(t[PICKS], 1.0)
        result[w, 2] = t[PLACED] * per_minute
        result[w, 3] = t[TIME]
        result[w, 4] = t[PLACED]
        result[w, 5] = t[TOTAL] - t[PICKS] - t[DROPPED]
        result[w, 6] = t[DROPPED]
        result[w, 7] = t[ILLEGAL]
        copy(t[PHASES:], result[w, 8 : 8 + _PHASES])
        result[w, 15] = t[VALUE] / max(t[TOTAL_VALUE], 1e-12)
        result[w, 16] = t[MISPLACED]
        result[w, 17] = t[DROPPED]
        result[w, 18] = t[WASTED]
        result[w, 19] = t[TOTAL]
        result[w, 20] = t[PICKS] * per_minute
    return result
