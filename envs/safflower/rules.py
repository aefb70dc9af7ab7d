"""The picking rules, one world after the other, as machine code; ``task`` prepares what they work on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled, shortest
from ..core import Array, StepResult
from .features import (
    ACROSS_SCALE_M,
    AHEAD_SCALE_M,
    CANDIDATE_FEATURES,
    HEIGHT_SCALE_M,
    MACHINE_FEATURES,
    TRAVEL_SCALE_S,
)
from .process import Shears, collected_share, cut_share

DRIVE, NOTHING, FINISH = 3, 4, 5
"""Kinds of decision after the three efforts: drive on, an illegal action, leave the row."""
RECOGNISE, TRAVEL_ALONG, TRAVEL, SETTLE, SHEAR, SUCK = range(6)
"""Phases; the second is called ``drive`` where it leads to another stop."""

_ALONG, _TRAVEL = CANDIDATE_FEATURES.index("along"), CANDIDATE_FEATURES.index("travel")
_MACHINE, _FEATURES = len(MACHINE_FEATURES), len(CANDIDATE_FEATURES)

STILL_M = 1e-4
"""A cart that moves less than this stands still and need not settle."""

TIME, DONE, MISSED, DAMAGED, ILLEGAL, PHASES, GAINED, DROPPED, TOTAL, WASTED, LAST = (
    0,
    1,
    2,
    3,
    4,
    5,
    11,
    12,
    13,
    14,
    15,
)
"""Columns of the running totals, all but the last in the scorecard's order; six phases begin at ``PHASES``."""
TOTALS = LAST + 1
SCORES = TOTALS + 4


class Tables(NamedTuple):
    """What the rules look up; the same in every world.

    Attributes:
        phases_s: (6, 6), nominal seconds of each phase by kind of decision, motion apart.
        strokes: (6,), shear strokes by kind.
        dropped: (6,), share of the cut filaments that drops on average, by kind.
        shears: numbers of the cut.
        pace_s_m: (2,), seconds a metre at the speed limit, of the cart and of the tool.
        square_pace_s2_m: (2,), seconds squared a metre at the acceleration limit, of the cart and of the tool.
        settle_s: time to settle after the cart has moved.
        clear_m: level of the traverses, in the arm's plane.
        stop_pose: (S, 3), parked pose at each stop.
        next_look: (S, 3), pose from which the camera sees the stop after each stop.
        weights: (3,), of the reward's terms.
        time_limit_s: when the episode is cut off.
        from_outside: whether reports come from a camera, after each drive.
    """

    phases_s: Array
    strokes: Array
    dropped: Array
    shears: Shears
    pace_s_m: Array
    square_pace_s2_m: Array
    settle_s: float
    clear_m: float
    stop_pose: Array
    next_look: Array
    weights: Array
    time_limit_s: float
    from_outside: bool


class Worlds(NamedTuple):
    """State of B worlds with N heads, M reports and K slots; positions are (cart, u, v) metres as in ``PickerPlan``.

    Attributes:
        head_position: (B, N + 1, 3); head N stands for none.
        head_stage: (B, N + 1).
        head_mass_g: (B, N + 1), what is left on the head.
        head_visited: (B, N + 1).
        head_odds: (B, N + 1, 2), what a head's luck multiplies the odds of its cut and of its collection with.
        track_target: (B, M + 1, 3); report M stands for none.
        track_feature: (B, M + 1, F), what does not depend on where the arm is.
        track_descent_s: (B, M + 1).
        track_legal: (B, M + 1).
        track_head: (B, M + 1).
        first: (B, S + 1), first report of each stop.
        slot_report: (B, K + 1), report in each slot; the last slot is the empty one that driving on points at.
        cursor: (B,), next report of this stop that has no slot yet.
        stop_end: (B,), end of this stop's reports.
        remaining: (B,), reports of this stop that were not picked.
        stop: (B,).
        look_due: (B,), whether a camera has to report.
        pose: (B, 3).
        rise_s: (B,), seconds of the rise that the next decision begins with.
        totals: (B, TOTALS).
    """

    head_position: Array
    head_stage: NDArray[np.int64]
    head_mass_g: Array
    head_visited: NDArray[np.bool_]
    head_odds: Array
    track_target: Array
    track_feature: NDArray[np.float32]
    track_descent_s: Array
    track_legal: NDArray[np.bool_]
    track_head: NDArray[np.int64]
    first: NDArray[np.int64]
    slot_report: NDArray[np.int64]
    cursor: NDArray[np.int64]
    stop_end: NDArray[np.int64]
    remaining: NDArray[np.int64]
    stop: NDArray[np.int64]
    look_due: NDArray[np.bool_]
    pose: Array
    rise_s: Array
    totals: Array


class PickerPlan(NamedTuple):
    """What the picker has to do in each world; positions are (cart, u, v): cart along the row, tool in the arm's plane.

    Attributes:
        kind: (B,), effort index, ``DRIVE``, ``NOTHING`` or ``FINISH``.
        slot: (B,), candidate slot, ``slots`` when none.
        report: (B,), the report behind it, the empty one when there is none.
        start: (B, 3), metres.
        target: (B, 3), metres.
        rise_s: (B,), seconds of the rise to the traverse level.
        beside_s: (B, 2), seconds of the cart's move and of the traverse across, which go on side by side.
        descent_s: (B,), seconds of the descent.
        phases_s: (B, 6), nominal seconds of each phase.
        next_rise_s: (B,), seconds of the rise that the next decision begins with.
    """

    kind: NDArray[np.int64]
    slot: NDArray[np.int64]
    report: NDArray[np.int64]
    start: Array
    target: Array
    rise_s: Array
    beside_s: Array
    descent_s: Array
    phases_s: Array
    next_rise_s: Array


@compiled
def plan_worlds(tables: Tables, worlds: Worlds, actions: NDArray[np.int64]) -> PickerPlan:
    """Turn actions (B,) into motions and nominal phase times."""
    n, slots = actions.size, worlds.slot_report.shape[1] - 1
    kind, chosen, reports = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    start, target = worlds.pose.copy(), np.empty((n, 3))
    rise_s, beside_s, descent_s, next_rise_s = np.empty(n), np.empty((n, 2)), np.empty(n), np.empty(n)
    phases_s = np.empty((n, tables.phases_s.shape[1]))
    for w in range(n):
        slot, what = actions[w] // DRIVE, actions[w] % DRIVE
        report = worlds.slot_report[w, slot]
        rise = worlds.rise_s[w]
        if slot == slots:
            stop = worlds.stop[w]
            what = DRIVE if stop + 1 < len(tables.next_look) else FINISH
        elif not worlds.track_legal[w, report]:
            # No motion at all, not even up and down again to where it is.
            what, slot, report, rise = NOTHING, slots, worlds.slot_report[w, slots], 0.0
        descent = worlds.track_descent_s[w, report]
        for axis in range(3):
            if what == NOTHING:
                target[w, axis] = start[w, axis]
            elif what == DRIVE:
                target[w, axis] = tables.next_look[worlds.stop[w], axis]
            elif what == FINISH:
                target[w, axis] = tables.clear_m if axis == 2 else start[w, axis]
            else:
                target[w, axis] = worlds.track_target[w, report, axis]
        for axis in range(2):
            stroke = target[w, axis] - start[w, axis]
            beside_s[w, axis] = shortest(stroke, tables.pace_s_m[axis], tables.square_pace_s2_m[axis])
        beside = max(beside_s[w, 0], beside_s[w, 1])
        drive = beside if slot == slots else 0.0
        for phase in range(phases_s.shape[1]):
            phases_s[w, phase] = tables.phases_s[what, phase]
        phases_s[w, TRAVEL_ALONG] = drive
        phases_s[w, TRAVEL] = rise + descent + (beside - drive)
        phases_s[w, SETTLE] = tables.settle_s if abs(target[w, 0] - start[w, 0]) > STILL_M else 0.0
        kind[w], chosen[w], reports[w] = what, slot, report
        rise_s[w], descent_s[w] = rise, descent
        next_rise_s[w] = worlds.rise_s[w] if what == NOTHING else descent
    return PickerPlan(kind, chosen, reports, start, target, rise_s, beside_s, descent_s, phases_s, next_rise_s)


@compiled
def apply_worlds(tables: Tables, worlds: Worlds, plan: PickerPlan, phases_s: Array, tool: Array) -> StepResult:
    """Cut, collect, book the time and move to the next decision; ``tool`` (B, 3) is where it really was."""
    n = len(plan.kind)
    rewards, terminated, truncated = np.zeros((n, 3)), np.empty(n, np.bool_), np.empty(n, np.bool_)
    for w in range(n):
        kind, totals = plan.kind[w], worlds.totals[w]
        elapsed = 0.0
        for phase in range(phases_s.shape[1]):
            elapsed += phases_s[w, phase]
            totals[PHASES + phase] += phases_s[w, phase]
        totals[TIME] += elapsed
        rewards[w, 2] = elapsed * tables.weights[2]
        if kind < DRIVE:
            mass, gained, done = pick(tables, worlds, w, kind, worlds.track_head[w, plan.report[w]], tool[w])
            rewards[w, 0] = gained * tables.weights[0]
            rewards[w, 1] = (mass - gained) * tables.weights[1] if done else 0.0
            close_gap(worlds, w, plan.slot[w])
        elif kind == DRIVE:
            worlds.stop[w] += 1
            if tables.from_outside:
                worlds.look_due[w] = True
                worlds.first[w, worlds.stop[w] + 1] = worlds.first[w, worlds.stop[w]]
            fill_slots(worlds, w)
        elif kind == NOTHING:
            totals[ILLEGAL] += 1.0
        for axis in range(3):
            worlds.pose[w, axis] = plan.target[w, axis]
        worlds.rise_s[w] = plan.next_rise_s[w]
        terminated[w] = kind == FINISH
        truncated[w] = totals[TIME] >= tables.time_limit_s and not terminated[w]
    return StepResult(rewards, phases_s, terminated, truncated)


@compiled
def pick(tables: Tables, worlds: Worlds, w: int, effort: int, head: int, tool: Array) -> tuple[float, float, bool]:
    """Work on one head; gives the mass that was on it, the grams gained and whether that counts as done."""
    totals, position = worlds.totals[w], worlds.head_position[w, head]
    mass = worlds.head_mass_g[w, head]
    share = cut_share(
        tables.shears,
        tables.strokes[effort],
        position[0] - tool[0],
        position[1] - tool[1],
        position[2] - tool[2],
        worlds.head_odds[w, head, 0],
    )
    cut = mass * share
    gained = cut * collected_share(tables.dropped[effort], worlds.head_odds[w, head, 1])
    fresh = share > 0.0 and not worlds.head_visited[w, head]
    done = fresh and gained > 0.0
    worlds.head_mass_g[w, head] = mass - cut
    if share > 0.0:
        worlds.head_visited[w, head] = True
    totals[GAINED] += gained
    totals[DROPPED] += cut - gained
    if fresh and worlds.head_stage[w, head] == 0:
        totals[DAMAGED] += 1.0
    if done:
        totals[DONE] += 1.0
        totals[MISSED] -= 1.0
        totals[LAST] = totals[TIME]
    else:
        totals[WASTED] += 1.0
    return mass, gained, done


@compiled
def close_gap(worlds: Worlds, w: int, slot: int) -> None:
    """Move the reports after a picked one up by a slot and take the stop's next report in."""
    slots = worlds.slot_report[w]
    for k in range(slot, len(slots) - 1):
        slots[k] = slots[k + 1]
    if worlds.cursor[w] < worlds.stop_end[w]:
        slots[-2] = worlds.cursor[w]
        worlds.cursor[w] += 1
    worlds.remaining[w] -= 1


@compiled
def fill_slots(worlds: Worlds, w: int) -> None:
    """Show the first reports of the stop."""
    slots = worlds.slot_report[w]
    begin, end = worlds.first[w, worlds.stop[w]], worlds.first[w, worlds.stop[w] + 1]
    for k in range(len(slots) - 1):
        slots[k] = begin + k if begin + k < end else slots[-1]
    worlds.cursor[w] = min(begin + len(slots) - 1, end)
    worlds.stop_end[w] = end
    worlds.remaining[w] = end - begin


@compiled
def fill_rows(worlds: Worlds, rows: NDArray[np.int64]) -> None:
    """``fill_slots`` of the worlds ``rows``."""
    for w in rows:
        fill_slots(worlds, w)


@compiled
def observe_worlds(tables: Tables, worlds: Worlds) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int8]]:
    """Features of the machine (B, .) and of the candidates (B, K * F), and the mask (B, 3 K + 1)."""
    n, slots = worlds.slot_report.shape[0], worlds.slot_report.shape[1] - 1
    machine = np.empty((n, _MACHINE), np.float32)
    candidates = np.empty((n, slots * _FEATURES), np.float32)
    mask = np.empty((n, DRIVE * slots + 1), np.int8)
    for w in range(n):
        stop, pose = worlds.stop[w], worlds.pose[w]
        machine[w, 0] = (pose[0] - tables.stop_pose[stop, 0]) / AHEAD_SCALE_M
        machine[w, 1] = (pose[1] - tables.stop_pose[stop, 1]) / ACROSS_SCALE_M
        machine[w, 2] = (pose[2] - tables.stop_pose[stop, 2]) / HEIGHT_SCALE_M
        machine[w, 3] = worlds.totals[w, TIME] / tables.time_limit_s
        machine[w, 4] = 1.0 - (1.0 + stop) / len(tables.stop_pose)
        machine[w, 5] = worlds.remaining[w] / slots
        for k in range(slots):
            report = worlds.slot_report[w, k]
            column = k * _FEATURES
            for f in range(_FEATURES):
                candidates[w, column + f] = worlds.track_feature[w, report, f]
            if candidates[w, column] > 0.0:
                # Tool and cart travel side by side after the rise that every candidate shares; see plan_worlds.
                along = worlds.track_target[w, report, 0] - pose[0]
                across = worlds.track_target[w, report, 1] - pose[1]
                beside_s = max(
                    shortest(along, tables.pace_s_m[0], tables.square_pace_s2_m[0]),
                    shortest(across, tables.pace_s_m[1], tables.square_pace_s2_m[1]),
                )
                travel_s = worlds.rise_s[w] + beside_s + worlds.track_descent_s[w, report]
                candidates[w, column + _ALONG] = along / AHEAD_SCALE_M
                candidates[w, column + _TRAVEL] = travel_s / TRAVEL_SCALE_S
            for effort in range(DRIVE):
                mask[w, DRIVE * k + effort] = worlds.track_legal[w, report]
        mask[w, -1] = 1
    return machine, candidates, mask


@compiled
def score_worlds(worlds: Worlds) -> Array:
    """Scorecard so far (B, SCORES): net rate (eq. 35, every open head counts), cycle time, rate, totals, rest."""
    result = np.empty((len(worlds.totals), SCORES))
    for w in range(len(result)):
        totals = worlds.totals[w]
        per_minute = 60.0 / totals[TIME]
        result[w, 0] = totals[GAINED] / max(totals[TOTAL], 1e-12)
        result[w, 1] = totals[LAST] / max(totals[DONE], 1.0)
        result[w, 2] = totals[DONE] * per_minute
        for column in range(LAST):
            result[w, 3 + column] = totals[column]
        result[w, -2] = totals[GAINED] * per_minute
        result[w, -1] = worlds.stop[w]
    return result
