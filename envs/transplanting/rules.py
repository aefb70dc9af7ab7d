"""The transplanting rules, one world after the other, as machine code; ``task`` prepares what they work on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled
from ..columns import names
from ..core import Array, StepResult
from .columns import (
    Candidate,
    E,
    H,
    L,
    P,
    Phases,
    R,
    Rewards,
    Scores,
    T,
    W,
)
from .config import DAMAGED, EMPTY, HEALTHY, POOR, SPEEDS
from .field import Cells
from .orders import all_gone, is_open, order, ordered, source_left, source_tray, steps_on, target_rows, turn, wanted
from .timing import CLEARING, STRAIGHT, Times, above, handling_s

INDEX_SOURCE, INDEX_TARGET, NOTHING, FINISH = range(len(SPEEDS), len(SPEEDS) + 4)
"""Kinds of decision after the three speeds: move a conveyor on, an illegal action, send the last row away."""
TURN_SOURCES, TURN_TARGETS, SEND_TARGET = range(FINISH + 1, FINISH + 4)
"""Likewise where trays are ordered: bring the next tray of a carousel, send an ordered tray away for the next one."""

_SPEEDS, _PHASES, _REWARDS = len(SPEEDS), len(names(Phases)), len(names(Rewards))
_FEATURES, _SCORES = len(names(Candidate)), len(names(Scores))


class Terms(NamedTuple):
    """What decides how a transplant ends and what it counts; the same in every world.

    Attributes:
        chances: (3, 2), of each speed, see ``Harms``.
        weights: of the reward's terms, see ``Rewards``.
        extraction: chance that a plug leaves its cell whole.
        reach_m: a gripper farther than this from a cell's middle misses it.
        time_limit_s: when the episode is cut off.
        from_outside: whether reports come from cameras, after each move of a conveyor.
        supply: (source trays,), share of the second grade in each sowing; none without orders.
    """

    chances: Array
    weights: Array
    extraction: float
    reach_m: float
    time_limit_s: float
    from_outside: bool
    supply: Array


class FixedFeatures(NamedTuple):
    """What is shown that no decision changes, for P places and K pairs as in ``timing``.

    Attributes:
        pair: (K, F), a possible pair's columns that do not depend on where the tool is.
        place: (P, 2), the features of the machine that the tool's place decides, the first two of ``Machine``.
    """

    pair: NDArray[np.float32]
    place: NDArray[np.float32]


class Worlds(NamedTuple):
    """State of B worlds. Behind the last row stands one more with nothing to do, for the worlds that are over.

    Attributes:
        source_cells: (B, source rows + 1, n), what each cell holds.
        target_cells: (B, target rows + 1, m), likewise.
        source_reports: (B, source rows + 1, n), what the machine believes of each cell.
        target_reports: (B, target rows + 1, m), likewise.
        luck: (B, source rows + 1, n, 3), uniform numbers of each plug, see ``Lucks``.
        source_row: (B,), the presented one.
        target_row: (B,), the presented one.
        look_due: (B, 2), whether a camera has to report, see ``Ends``.
        place: (B,), where the tool stands, see ``Places``.
        totals: (B, .), see ``Totals``.
        source_at: (B, source trays), row that each tray of the carousel presents; no trays without orders.
        target_at: (B, target trays), likewise; a tray that has gone stands at the row behind its last.
        seen: (B, 2, trays), whether a tray was presented, see ``Ends``; no trays without orders.
        grade: (B, target trays), what its cells are to hold, ``HEALTHY`` or ``POOR``; no trays without orders.
        due_s: (B, target trays), when its lorry leaves, likewise.
    """

    source_cells: Cells
    target_cells: Cells
    source_reports: Cells
    target_reports: Cells
    luck: Array
    source_row: NDArray[np.int64]
    target_row: NDArray[np.int64]
    look_due: NDArray[np.bool_]
    place: NDArray[np.int64]
    totals: Array
    source_at: NDArray[np.int64]
    target_at: NDArray[np.int64]
    seen: NDArray[np.bool_]
    grade: Cells
    due_s: Array


class TransplantPlan(NamedTuple):
    """What the transplanter has to do in each world.

    Attributes:
        kind: (B,), speed index, ``INDEX_SOURCE``, ``INDEX_TARGET``, ``NOTHING`` or ``FINISH``; with orders
            ``TURN_SOURCES``, ``TURN_TARGETS`` or ``SEND_TARGET`` too.
        pair: (B,), source column times the target row's columns plus target column; 0 when none; with orders the tray
            that is presented after the decision, where a conveyor or a carousel moves.
        held: (B, 2), what the pair's cells hold before the decision, see ``Ends``; ``EMPTY`` when there is no pair.
        clears: (B,), whether the target cell's seedling goes to the chute first.
        grips: (B,), whether the gripper's sensor will find a plug between the needles; without one the tool stays at
            the source cell.
        start: (B,), place that the tool stands at, see ``Places``.
        end: (B,), place that it will stand at.
        phases_s: (B, 5), nominal seconds, see ``Phases``.
        travel_m: (B,), length of the tool's path.
    """

    kind: NDArray[np.int64]
    pair: NDArray[np.int64]
    held: Cells
    clears: NDArray[np.bool_]
    grips: NDArray[np.bool_]
    start: NDArray[np.int64]
    end: NDArray[np.int64]
    phases_s: Array
    travel_m: Array


@compiled
def plan_worlds(times: Times, extraction: float, worlds: Worlds, actions: NDArray[np.int64]) -> TransplantPlan:
    """Turn actions (B,) into motions and nominal phase times."""
    count = actions.size
    kind, pair, held = np.empty(count, np.int64), np.empty(count, np.int64), np.zeros((count, 2), np.int8)
    clears, grips = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    start, end = worlds.place.copy(), worlds.place.copy()
    phases_s, travel_m = np.zeros((count, _PHASES)), np.zeros(count)
    for w in range(count):
        what, chosen = kind_of(worlds, w, actions[w])
        kind[w], pair[w] = what, chosen
        if what < INDEX_SOURCE:
            clears[w], grips[w], end[w] = plan_pair(
                times, extraction, worlds, w, what, chosen, held, phases_s, travel_m
            )
        elif what == NOTHING:
            phases_s[w, P.wait] = times.illegal_s
        else:
            # A conveyor moves once the tool has risen from the cells.
            phases_s[w, P.travel], travel_m[w] = times.rise[start[w], W.s], times.rise[start[w], W.m]
            if what == INDEX_SOURCE:
                phases_s[w, P.index] = times.row_s[E.source, worlds.source_row[w]]
            elif what == TURN_SOURCES:
                phases_s[w, P.index] = times.turn_s[E.source]
            elif what == TURN_TARGETS or what == SEND_TARGET or (what == FINISH and ordered(worlds)):
                # The last tray is taken away as far as it would be for the next one.
                phases_s[w, P.index] = max(steps_on(worlds, w), 1) * times.turn_s[E.target]
            else:
                phases_s[w, P.index] = times.row_s[E.target, worlds.target_row[w]]
            end[w] = above(times, start[w])
    return TransplantPlan(kind, pair, held, clears, grips, start, end, phases_s, travel_m)


@compiled
def kind_of(worlds: Worlds, w: int, action: int) -> tuple[int, int]:
    """Kind of decision behind an action, and its pair."""
    columns = worlds.target_reports.shape[2]
    pair, what = action // _SPEEDS, action % _SPEEDS
    if pair < worlds.source_reports.shape[2] * columns:
        ready = worlds.source_reports[w, worlds.source_row[w], pair // columns] != EMPTY
        want = wanted(worlds, w)
        gap = want >= 0 and worlds.target_reports[w, worlds.target_row[w], pair % columns] != want
        return (what if ready and gap else NOTHING), pair
    if ordered(worlds):
        return carousel_kind(worlds, w, action - _SPEEDS * worlds.source_reports.shape[2] * columns)
    if what == 0:
        return (INDEX_SOURCE if worlds.source_row[w] + 2 < worlds.source_reports.shape[1] else NOTHING), 0
    return (INDEX_TARGET if worlds.target_row[w] + 2 < worlds.target_reports.shape[1] else FINISH), 0


@compiled
def carousel_kind(worlds: Worlds, w: int, move: int) -> tuple[int, int]:
    """Kind of decision behind the ``move``-th action after the pairs, with orders, and the tray that it brings."""
    source, trays, tray = source_tray(worlds, w), worlds.source_at.shape[1], order(worlds, w)
    step = steps_on(worlds, w)
    if move == 0:
        return (TURN_SOURCES if trays > 1 else NOTHING), (source + 1) % trays
    if move == 1:
        return (TURN_TARGETS if step > 0 else NOTHING), (tray + step) % worlds.due_s.shape[1]
    if move == 2:
        return (INDEX_SOURCE if source_left(worlds, w) > 0 else NOTHING), source
    if is_open(worlds, w, tray) and worlds.target_row[w] + 1 < (tray + 1) * target_rows(worlds):
        return INDEX_TARGET, tray
    return (SEND_TARGET if step > 0 else FINISH), (tray + step) % worlds.due_s.shape[1]


@compiled
def plan_pair(
    times: Times,
    extraction: float,
    worlds: Worlds,
    w: int,
    speed: int,
    pair: int,
    held: Cells,
    phases_s: Array,
    travel_m: Array,
) -> tuple[bool, bool, int]:
    """Write down a pair's phases and what its cells hold; gives whether it clears, whether it grips, where it ends."""
    n, m = worlds.source_cells.shape[2], worlds.target_cells.shape[2]
    source, target, row = pair // m, pair % m, worlds.source_row[w]
    held[w, E.source] = worlds.source_cells[w, row, source]
    held[w, E.target] = worlds.target_cells[w, worlds.target_row[w], target]
    clears = worlds.target_reports[w, worlds.target_row[w], target] != EMPTY
    grips = held[w, E.source] != EMPTY and worlds.luck[w, row, source, L.extract] < extraction
    way, here = CLEARING if clears else STRAIGHT, worlds.place[w]
    phases_s[w, P.travel], travel_m[w] = times.approach[way, here, pair, W.s], times.approach[way, here, pair, W.m]
    phases_s[w, P.handle] = handling_s(times, clears, grips)
    if not grips:
        return clears, grips, source
    phases_s[w, P.carry] = times.carry[speed, pair, W.s]
    travel_m[w] += times.carry[speed, pair, W.m]
    return clears, grips, n + target


@compiled
def apply_worlds(terms: Terms, worlds: Worlds, plan: TransplantPlan, phases_s: Array, error_m: Array) -> StepResult:
    """Move plugs, index rows, book the time; ``error_m`` (B, 2) are the tool's errors at source and target."""
    count = len(plan.kind)
    rewards, terminated, truncated = np.zeros((count, _REWARDS)), np.empty(count, np.bool_), np.empty(count, np.bool_)
    for w in range(count):
        kind, totals = plan.kind[w], worlds.totals[w]
        elapsed = 0.0
        for phase in range(_PHASES):
            elapsed += phases_s[w, phase]
            totals[T.travel_s + phase] += phases_s[w, phase]
        totals[T.time] += elapsed
        totals[T.travel_m] += plan.travel_m[w]
        gain, spoiled = 0.0, 0.0
        if kind < INDEX_SOURCE:
            within = error_m[w, E.source] <= terms.reach_m and error_m[w, E.target] <= terms.reach_m
            gain, spoiled = transplant(terms, worlds, plan, w, within)
        elif kind == INDEX_SOURCE:
            spoiled = index_source(worlds, w)
        elif kind == NOTHING:
            totals[T.illegal] += 1.0
        elif ordered(worlds):
            look = move_trays(worlds, w, kind, plan.pair[w])
            if terms.from_outside:
                worlds.look_due[w, E.source if kind == TURN_SOURCES else E.target] |= look
        else:
            # A batch steps worlds that are over along with the others: they stay at the row behind the last.
            worlds.target_row[w] = min(worlds.target_row[w] + 1, worlds.target_cells.shape[1] - 1)
        if terms.from_outside:
            worlds.look_due[w, E.source] |= kind == INDEX_SOURCE
            worlds.look_due[w, E.target] |= kind == INDEX_TARGET
        rewards[w, R.planted] = gain * terms.weights[R.planted]
        rewards[w, R.spoiled] = spoiled * terms.weights[R.spoiled]
        rewards[w, R.time] = elapsed * terms.weights[R.time]
        worlds.place[w] = plan.end[w]
        terminated[w] = all_gone(worlds, w) if ordered(worlds) else kind == FINISH
        truncated[w] = totals[T.time] >= terms.time_limit_s and not terminated[w]
    return StepResult(rewards, phases_s, terminated, truncated)


@compiled
def transplant(terms: Terms, worlds: Worlds, plan: TransplantPlan, w: int, within: bool) -> tuple[float, float]:
    """Empty a source cell and set its plug; gives healthy target cells gained and healthy seedlings spoiled."""
    totals, m, want, late = worlds.totals[w], worlds.target_cells.shape[2], HEALTHY, False
    if ordered(worlds):
        # What is set when the lorry has left stays here.
        tray = order(worlds, w)
        want, late = worlds.grade[w, tray], totals[T.time] > worlds.due_s[w, tray]
    speed, column, gap = plan.kind[w], plan.pair[w] // m, plan.pair[w] % m
    row, target_row = worlds.source_row[w], worlds.target_row[w]
    plug, before = plan.held[w, E.source], plan.held[w, E.target]
    seen = worlds.source_reports[w, row, column]
    worlds.source_cells[w, row, column] = EMPTY
    worlds.source_reports[w, row, column] = EMPTY
    totals[T.transplants] += 1.0
    left = before
    if plan.clears[w]:
        left = EMPTY
        worlds.target_reports[w, target_row, gap] = EMPTY
        if before != EMPTY:
            totals[T.cleared] += 1.0
    now, good, counts = left, False, left == want
    if not plan.grips[w]:
        if plug != EMPTY:
            totals[T.torn] += 1.0
            totals[T.damaged] += 1.0
    elif worlds.luck[w, row, column, L.lose] < terms.chances[speed, H.lose] or not within:
        totals[T.lost] += 1.0
    else:
        # The sensor tells the machine that a plug arrived, not what became of it.
        worlds.target_reports[w, target_row, gap] = seen
        now = plug
        # A plug that is pushed into another one spoils both.
        if left != EMPTY or worlds.luck[w, row, column, L.damage] < terms.chances[speed, H.damage]:
            now = DAMAGED
            totals[T.damaged] += 2.0 if left == want else 1.0
        good = counts = now == want and not late
    worlds.target_cells[w, target_row, gap] = now
    gain = (1.0 if counts else 0.0) - (1.0 if before == want else 0.0)
    totals[T.healthy] += gain
    if good:
        totals[T.done] += 1.0
        totals[T.last] = totals[T.time]
    return gain, (1.0 if sold(worlds, plug) and not good else 0.0)


@compiled
def index_source(worlds: Worlds, w: int) -> float:
    """Present the next source row; gives the healthy seedlings that leave with the old one."""
    wasted = 0.0
    for column in range(worlds.source_cells.shape[2]):
        if sold(worlds, worlds.source_cells[w, worlds.source_row[w], column]):
            wasted += 1.0
    worlds.totals[w, T.wasted] += wasted
    worlds.source_row[w] += 1
    if ordered(worlds):
        worlds.source_at[w, source_tray(worlds, w)] = worlds.source_row[w]
    return wasted


@compiled
def sold(worlds: Worlds, content: int) -> bool:
    """Whether a seedling is worth something: a healthy one, where both grades are ordered a poor one too."""
    return content == HEALTHY or (content == POOR and ordered(worlds))


@compiled
def move_trays(worlds: Worlds, w: int, kind: int, tray: int) -> bool:
    """Present the next row of an ordered tray, or another tray of either carousel; says whether it is a new one."""
    if kind == TURN_SOURCES:
        return turn(worlds, w, E.source, tray)
    here = order(worlds, w)
    if kind == INDEX_TARGET:
        worlds.target_at[w, tray] += 1
    elif kind != TURN_TARGETS:
        worlds.target_at[w, here] = (here + 1) * target_rows(worlds)
    if kind == FINISH:
        worlds.target_row[w] = worlds.target_cells.shape[1] - 1
        return False
    return turn(worlds, w, E.target, tray)
