"""The picking rules, one world after the other, as machine code; ``core`` prepares what they work on."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled, fill
from ..core import Array, StepResult
from ..kernel_core import book
from .features import (
    ACROSS_SCALE_M,
    AHEAD_SCALE_M,
    CLOSES_SCALE_S,
    DC,
    DM,
    HEIGHT_SCALE_M,
    LIMIT,
    TRAVEL_SCALE_S,
    C,
    M,
)
from .process import collected_share, cut_share
from .state import D, E, PickerPlan, R, S, T, Tables, Worlds
from .timing import DRIVE, EMPTY, FINISH, NOTHING, P, beside_s, cart_s, settling_s, tool_s

EMPTYING = 1
"""Number of the action that empties the bag among those that belong to no slot; 0 drives on."""


@compiled
def plan_worlds(tables: Tables, worlds: Worlds, actions: NDArray[np.int64]) -> PickerPlan:
    """Turn actions (B,) into motions and nominal phase times."""
    n, slots = actions.size, worlds.slot_report.shape[1] - 1
    kind, chosen, reports = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    start, target = worlds.pose.copy(), np.empty((n, 3))
    rise_s, side_s, descent_s, next_rise_s = np.empty(n), np.empty((n, 2)), np.empty(n), np.empty(n)
    phases_s = np.empty((n, len(P)))
    for w in range(n):
        slot, what = actions[w] // DRIVE, actions[w] % DRIVE
        report = worlds.slot_report[w, slot]
        rise = worlds.rise_s[w]
        if slot == slots:
            stop = worlds.stop[w]
            if what == EMPTYING:
                # There is nothing to empty: the mask says so, and it counts as any other illegal action.
                what, rise = EMPTY if worlds.totals[w, T.bag] > 0.0 else NOTHING, 0.0
            else:
                what = DRIVE if stop + 1 < len(tables.look_pose) else FINISH
        elif not worlds.track_legal[w, report] or worlds.totals[w, T.bag] >= tables.bag_g:
            # No motion at all, not even up and down again to where it is.
            what, slot, report, rise = NOTHING, slots, worlds.slot_report[w, slots], 0.0
        descent = worlds.track_descent_s[w, report]
        for axis in range(3):
            if what == NOTHING or what == EMPTY:
                target[w, axis] = start[w, axis]
            elif what == DRIVE:
                target[w, axis] = tables.look_pose[worlds.stop[w] + 1, axis]
            elif what == FINISH:
                target[w, axis] = tables.rates.clear_m if axis == 2 else start[w, axis]
            else:
                target[w, axis] = worlds.track_target[w, report, axis]
        along = target[w, 0] - start[w, 0]
        side_s[w, 0] = cart_s(tables.rates, along)
        side_s[w, 1] = tool_s(tables.rates, target[w, 1] - start[w, 1])
        beside = max(side_s[w, 0], side_s[w, 1])
        drive = beside if slot == slots else 0.0
        for phase in range(len(P)):
            phases_s[w, phase] = tables.standing_s[what, phase]
        phases_s[w, P.drive] = drive
        phases_s[w, P.travel] = rise + descent + (beside - drive)
        phases_s[w, P.settle] = settling_s(tables.rates, along)
        kind[w], chosen[w], reports[w] = what, slot, report
        rise_s[w], descent_s[w] = rise, descent
        next_rise_s[w] = worlds.rise_s[w] if what == NOTHING or what == EMPTY else descent
    return PickerPlan(kind, chosen, reports, start, target, rise_s, side_s, descent_s, phases_s, next_rise_s)


@compiled
def apply_worlds(tables: Tables, worlds: Worlds, plan: PickerPlan, phases_s: Array, tool: Array) -> StepResult:
    """Cut, collect, book the time and move to the next decision; ``tool`` (B, 3) is where it really was."""
    n = len(plan.kind)
    rewards, terminated, truncated = np.zeros((n, len(R))), np.empty(n, np.bool_), np.empty(n, np.bool_)
    for w in range(n):
        kind, totals = plan.kind[w], worlds.totals[w]
        elapsed = 0.0
        for phase in range(len(P)):
            elapsed += phases_s[w, phase]
            totals[T.recognise + phase] += phases_s[w, phase]
        totals[T.time] += elapsed
        rewards[w, R.time] = elapsed * tables.weights[R.time]
        if kind < DRIVE:
            mass, gained, done = pick(tables, worlds, w, kind, worlds.track_head[w, plan.report[w]], tool[w])
            rewards[w, R.collected] = gained * tables.weights[R.collected]
            rewards[w, R.lost] = (mass - gained) * tables.weights[R.lost] if done else 0.0
            close_gap(worlds, w, plan.slot[w])
        elif kind == DRIVE:
            worlds.stop[w] += 1
            if tables.from_outside:
                worlds.look_due[w] = True
                worlds.first[w, worlds.stop[w] + 1] = worlds.first[w, worlds.stop[w]]
            fill_slots(worlds, w)
        elif kind == NOTHING:
            totals[T.illegal] += 1.0
        elif kind == EMPTY:
            totals[T.bag] = 0.0
        for axis in range(3):
            worlds.pose[w, axis] = plan.target[w, axis]
        worlds.rise_s[w] = plan.next_rise_s[w]
        terminated[w] = kind == FINISH
        truncated[w] = totals[T.time] >= tables.time_limit_s and not terminated[w]
    return StepResult(rewards, phases_s, terminated, truncated)


@compiled
def pick(tables: Tables, worlds: Worlds, w: int, effort: int, head: int, tool: Array) -> tuple[float, float, bool]:
    """Work on one head; gives the mass that was on it, the grams gained and whether that counts as done."""
    totals, position = worlds.totals[w], worlds.head_position[w, head]
    mass = worlds.head_mass_g[w, head]
    share = cut_share(
        tables.shears,
        tables.efforts[effort, E.strokes],
        position[0] - tool[0],
        position[1] - tool[1],
        position[2] - tool[2],
        worlds.head_odds[w, head, 0],
    )
    cut = mass * share
    dropped = tables.efforts[effort, E.dropped]
    # The fuller the bag, the more drops; one that nothing fills is infinitely large.
    dropped += (1.0 - dropped) * tables.clog * (totals[T.bag] / tables.bag_g)
    gained = cut * collected_share(dropped, worlds.head_odds[w, head, 1])
    if worlds.head_closes_s.shape[1] > 0 and totals[T.time] > worlds.head_closes_s[w, head]:
        gained = 0.0  # it has wilted by now
    fresh = share > 0.0 and not worlds.head_visited[w, head]
    done = fresh and gained > 0.0
    worlds.head_mass_g[w, head] = mass - cut
    if share > 0.0:
        worlds.head_visited[w, head] = True
    totals[T.gained] += gained
    totals[T.bag] += gained
    totals[T.dropped] += cut - gained
    if fresh and worlds.head_stage[w, head] == 0:
        totals[T.damaged] += 1.0
    if done:
        totals[T.done] += 1.0
        totals[T.missed] -= 1.0
        totals[T.last] = totals[T.time]
    else:
        totals[T.wasted] += 1.0
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
def shown(value: float, scale: float) -> float:
    """A quantity as policies see it: divided by its scale, and no larger than their space."""
    return min(max(value / scale, -LIMIT), LIMIT)


@compiled
def observe_worlds(
    tables: Tables,
    worlds: Worlds,
    rows: NDArray[np.int64],
    machine: NDArray[np.float32],
    candidates: NDArray[np.float32],
    mask: NDArray[np.int8],
) -> None:
    """Write features of the machine (B, .) and of the candidates (B, K * F), and the mask (B, 3 K + 1), of ``rows``."""
    slots = worlds.slot_report.shape[1] - 1
    for w in rows:
        stop, pose = worlds.stop[w], worlds.pose[w]
        machine[w, M.ahead] = shown(pose[0] - tables.stop_pose[stop, 0], AHEAD_SCALE_M)
        machine[w, M.across] = shown(pose[1] - tables.stop_pose[stop, 1], ACROSS_SCALE_M)
        machine[w, M.height] = shown(pose[2] - tables.stop_pose[stop, 2], HEIGHT_SCALE_M)
        machine[w, M.time] = shown(worlds.totals[w, T.time], tables.time_limit_s)
        machine[w, M.stops_left] = 1.0 - (1.0 + stop) / len(tables.stop_pose)
        machine[w, M.remaining] = shown(float(worlds.remaining[w]), slots)
        for k in range(slots):
            report = worlds.slot_report[w, k]
            column = k * len(C)
            for f in range(len(C)):
                candidates[w, column + f] = worlds.track_feature[w, report, f]
            if candidates[w, column + C.present] > 0.0:
                # Tool and cart travel side by side after the rise that every candidate shares; see plan_worlds.
                along = worlds.track_target[w, report, 0] - pose[0]
                across = worlds.track_target[w, report, 1] - pose[1]
                beside = beside_s(tables.rates, along, across)
                travel_s = float(worlds.rise_s[w]) + beside + float(worlds.track_descent_s[w, report])
                candidates[w, column + C.along] = shown(along, AHEAD_SCALE_M)
                candidates[w, column + C.travel] = shown(travel_s, TRAVEL_SCALE_S)
            for effort in range(DRIVE):
                mask[w, DRIVE * k + effort] = worlds.track_legal[w, report]
        mask[w, DRIVE * slots] = 1


@compiled
def observe_demands(
    tables: Tables,
    worlds: Worlds,
    rows: NDArray[np.int64],
    machine: NDArray[np.float32],
    candidates: NDArray[np.float32],
    mask: NDArray[np.int8],
) -> None:
    """Write what is shown of bag and wilting in ``rows``, behind what is shown without them.

    What stands there already moves apart, from the last candidate to the first: where nothing is demanded, a candidate
    keeps a width that is known when the code is compiled.
    """
    slots = worlds.slot_report.shape[1] - 1
    for w in rows:
        for k in range(slots - 1, -1, -1):
            for f in range(len(C) - 1, -1, -1):
                candidates[w, k * len(DC) + f] = candidates[w, k * len(C) + f]
        if worlds.totals[w, T.bag] >= tables.bag_g:
            fill(mask[w, : DRIVE * slots], 0)
        machine[w, DM.bag] = shown(worlds.totals[w, T.bag], tables.bag_g)
        mask[w, DRIVE * slots + EMPTYING] = worlds.totals[w, T.bag] > 0.0
        for k in range(slots):
            report, column = worlds.slot_report[w, k], k * len(DC)
            left_s = worlds.track_told[w, report, D.closes] - worlds.totals[w, T.time]
            candidates[w, column + DC.closes] = shown(max(left_s, 0.0), CLOSES_SCALE_S)
            candidates[w, column + DC.row] = worlds.track_told[w, report, D.row]


@compiled
def score_worlds(totals: Array, stop: NDArray[np.int64], rows: NDArray[np.int64], numbers: Array) -> None:
    """Write the scorecard so far of ``rows`` into the last columns (B, .); the net rate counts every open head."""
    first = numbers.shape[1] - len(S)
    for w in rows:
        of, score = totals[w], numbers[w, first:]
        per_minute = 60.0 / of[T.time] if of[T.time] > 0.0 else 0.0
        score[S.net_rate] = of[T.gained] / max(of[T.total], 1e-12)
        score[S.cycle_time_s] = of[T.last] / max(of[T.done], 1.0)
        score[S.throughput_per_min] = of[T.done] * per_minute
        score[S.duration_s] = of[T.time]
        score[S.done] = of[T.done]
        score[S.missed] = of[T.missed]
        score[S.damaged] = of[T.damaged]
        score[S.illegal] = of[T.illegal]
        for phase in range(len(P)):
            score[S.phase_recognise_s + phase] = of[T.recognise + phase]
        score[S.collected_g] = of[T.gained]
        score[S.dropped_g] = of[T.dropped]
        score[S.total_g] = of[T.total]
        score[S.wasted] = of[T.wasted]
        score[S.grams_per_min] = of[T.gained] * per_minute
        score[S.stop] = stop[w]


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
    if machine.shape[1] > len(M):
        observe_demands(tables, worlds, rows, machine, candidates, mask)
    score_worlds(worlds.totals, worlds.stop, rows, numbers)


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
    book(apply_worlds(tables, worlds, plan, plan.phases_s, plan.target), numbers, terminated, truncated)
    show_worlds(desk, rows, machine, candidates, mask, numbers)
