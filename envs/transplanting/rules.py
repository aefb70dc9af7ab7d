"""The transplanting rules, one world after the other, as machine code; ``task`` prepares what they work on."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..core import Array, StepResult
from .config import DAMAGED, EMPTY, HEALTHY, POOR, SPEEDS
from .features import CANDIDATE_FEATURES, MACHINE_FEATURES, MOVE_SCALE_S
from .field import LUCKS, Cells

INDEX_SOURCE, INDEX_TARGET, NOTHING, FINISH = 3, 4, 5, 6
"""Kinds of decision after the three speeds: move a conveyor on, an illegal action, send the last row away."""
TRAVEL, CARRY, HANDLE, INDEX, WAIT = range(5)
"""Phases."""
_EXTRACT, _LOSE, _DAMAGE = range(len(LUCKS))

_SPEEDS, _MACHINE, _FEATURES = len(SPEEDS), len(MACHINE_FEATURES), len(CANDIDATE_FEATURES)
_APPROACH, _POOR, _CLEAR = (CANDIDATE_FEATURES.index(name) for name in ("approach", "source_poor", "clear"))

TIME, DONE, _MISSED, DAMAGES, ILLEGAL, PHASES = range(6)
LOST, TORN, WASTED, CLEARED, TRIED, TRAVELLED, FILLED, CELLS, GAPS, LAST = range(PHASES + WAIT + 1, 20)
"""Columns of the running totals, all but the last in the scorecard's order; the missed cells' one is filled there.
Five phases begin at ``PHASES``; ``FILLED`` counts the target cells that hold a healthy seedling."""
TOTALS = LAST + 1
_FIRST_TOTAL = 3
SCORES = _FIRST_TOTAL + LAST + 1


class Tables(NamedTuple):
    """What the rules look up; the same in every world. P places and K pairs as in ``Motions``.

    Attributes:
        approach: (2, P, K, 2), seconds and metres from a place to a pair's source cell: straight, by way of the chute.
        carry: (3, K, 2), seconds and metres from source to target, by speed.
        rise: (P, 2), seconds and metres from a place to above it.
        row_s: (2, rows), seconds that the source and the target conveyor take to move on from each row.
        pair_feature: (K, F), a possible pair's columns that do not depend on where the tool is.
        place_feature: (P, 2), what is shown of the tool's place.
        chances: (3, 2), chance to lose a gripped plug on the way and that it arrives damaged, by speed.
        weights: (3,), of the reward's terms.
        extraction: chance that a plug leaves its cell whole.
        reach_m: a gripper farther than this from a cell's middle misses it.
        grip_s: seconds to grip.
        release_s: seconds to release.
        illegal_s: seconds that an illegal action costs.
        time_limit_s: when the episode is cut off.
        from_outside: whether reports come from cameras, after each move of a conveyor.
    """

    approach: Array
    carry: Array
    rise: Array
    row_s: Array
    pair_feature: NDArray[np.float32]
    place_feature: NDArray[np.float32]
    chances: Array
    weights: Array
    extraction: float
    reach_m: float
    grip_s: float
    release_s: float
    illegal_s: float
    time_limit_s: float
    from_outside: bool


class Worlds(NamedTuple):
    """State of B worlds. Behind the last row stands one more with nothing to do, for the worlds that are over.

    Attributes:
        source_cells: (B, source rows + 1, n), what each cell holds.
        target_cells: (B, target rows + 1, m), likewise.
        source_reports: (B, source rows + 1, n), what the machine believes of each cell.
        target_reports: (B, target rows + 1, m), likewise.
        luck: (B, source rows + 1, n, 3), uniform numbers of each plug, as ``LUCKS`` names them.
        source_row: (B,), the presented one.
        target_row: (B,), the presented one.
        look_due: (B, 2), whether a camera has to report: source, target.
        place: (B,), where the tool stands, see ``Motions``.
        totals: (B, TOTALS).
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


class TransplantPlan(NamedTuple):
    """What the transplanter has to do in each world.

    Attributes:
        kind: (B,), speed index, ``INDEX_SOURCE``, ``INDEX_TARGET``, ``NOTHING`` or ``FINISH``.
        pair: (B,), source column times the target row's columns plus target column; 0 when none.
        held: (B, 2), what the pair's source and target cell hold before the decision; ``EMPTY`` when there is no pair.
        clears: (B,), whether the target cell's seedling goes to the chute first.
        grips: (B,), whether the gripper's sensor will find a plug between the needles; without one the tool stays at
            the source cell.
        start: (B,), place that the tool stands at, see ``Motions``.
        end: (B,), place that it will stand at.
        phases_s: (B, 5), nominal seconds of each phase.
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
def plan_worlds(tables: Tables, worlds: Worlds, actions: NDArray[np.int64]) -> TransplantPlan:
    """Turn actions (B,) into motions and nominal phase times."""
    count = actions.size
    kind, pair, held = np.empty(count, np.int64), np.empty(count, np.int64), np.zeros((count, 2), np.int8)
    clears, grips = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    start, end = worlds.place.copy(), worlds.place.copy()
    phases_s, travel_m = np.zeros((count, WAIT + 1)), np.zeros(count)
    for w in range(count):
        what, chosen = kind_of(worlds, w, actions[w])
        kind[w], pair[w] = what, chosen
        if what < INDEX_SOURCE:
            clears[w], grips[w], end[w] = plan_pair(tables, worlds, w, what, chosen, held, phases_s, travel_m)
        elif what == NOTHING:
            phases_s[w, WAIT] = tables.illegal_s
        else:
            # A conveyor moves once the tool has risen from the cells.
            here, cells = start[w], len(tables.rise) // 2
            phases_s[w, TRAVEL], travel_m[w] = tables.rise[here, 0], tables.rise[here, 1]
            if what == INDEX_SOURCE:
                phases_s[w, INDEX] = tables.row_s[0, worlds.source_row[w]]
            else:
                phases_s[w, INDEX] = tables.row_s[1, worlds.target_row[w]]
            end[w] = here + cells if here < cells else here
    return TransplantPlan(kind, pair, held, clears, grips, start, end, phases_s, travel_m)


@compiled
def kind_of(worlds: Worlds, w: int, action: int) -> tuple[int, int]:
    """Kind of decision behind an action, and its pair."""
    columns = worlds.target_reports.shape[2]
    pair, what = action // _SPEEDS, action % _SPEEDS
    if pair < worlds.source_reports.shape[2] * columns:
        ready = worlds.source_reports[w, worlds.source_row[w], pair // columns] != EMPTY
        gap = worlds.target_reports[w, worlds.target_row[w], pair % columns] != HEALTHY
        return (what if ready and gap else NOTHING), pair
    if what == 0:
        return (INDEX_SOURCE if worlds.source_row[w] + 2 < worlds.source_reports.shape[1] else NOTHING), 0
    return (INDEX_TARGET if worlds.target_row[w] + 2 < worlds.target_reports.shape[1] else FINISH), 0


@compiled
def plan_pair(
    tables: Tables, worlds: Worlds, w: int, speed: int, pair: int, held: Cells, phases_s: Array, travel_m: Array
) -> tuple[bool, bool, int]:
    """Write down a pair's phases and what its cells hold; gives whether it clears, whether it grips, where it ends."""
    n, m = worlds.source_cells.shape[2], worlds.target_cells.shape[2]
    source, target, row = pair // m, pair % m, worlds.source_row[w]
    held[w, 0] = worlds.source_cells[w, row, source]
    held[w, 1] = worlds.target_cells[w, worlds.target_row[w], target]
    clears = worlds.target_reports[w, worlds.target_row[w], target] == POOR
    grips = held[w, 0] != EMPTY and worlds.luck[w, row, source, _EXTRACT] < tables.extraction
    way, here = 1 if clears else 0, worlds.place[w]
    phases_s[w, TRAVEL], travel_m[w] = tables.approach[way, here, pair, 0], tables.approach[way, here, pair, 1]
    # The needles close at the source cell, whether they find a plug or not.
    phases_s[w, HANDLE] = tables.grip_s
    if clears:
        phases_s[w, HANDLE] += tables.grip_s + tables.release_s
    if not grips:
        return clears, grips, source
    phases_s[w, CARRY] = tables.carry[speed, pair, 0]
    phases_s[w, HANDLE] += tables.release_s
    travel_m[w] += tables.carry[speed, pair, 1]
    return clears, grips, n + target


@compiled
def apply_worlds(tables: Tables, worlds: Worlds, plan: TransplantPlan, phases_s: Array, error_m: Array) -> StepResult:
    """Move plugs, index rows, book the time; ``error_m`` (B, 2) are the tool's errors at source and target."""
    count = len(plan.kind)
    rewards, terminated, truncated = np.zeros((count, 3)), np.empty(count, np.bool_), np.empty(count, np.bool_)
    for w in range(count):
        kind, totals = plan.kind[w], worlds.totals[w]
        elapsed = 0.0
        for phase in range(WAIT + 1):
            elapsed += phases_s[w, phase]
            totals[PHASES + phase] += phases_s[w, phase]
        totals[TIME] += elapsed
        totals[TRAVELLED] += plan.travel_m[w]
        gain, spoiled = 0.0, 0.0
        if kind < INDEX_SOURCE:
            within = error_m[w, 0] <= tables.reach_m and error_m[w, 1] <= tables.reach_m
            gain, spoiled = transplant(tables, worlds, plan, w, within)
        elif kind == INDEX_SOURCE:
            spoiled = index_source(worlds, w)
        elif kind == NOTHING:
            totals[ILLEGAL] += 1.0
        else:
            # A batch steps worlds that are over along with the others: they stay at the row behind the last.
            worlds.target_row[w] = min(worlds.target_row[w] + 1, worlds.target_cells.shape[1] - 1)
        if tables.from_outside and (kind == INDEX_SOURCE or kind == INDEX_TARGET):
            worlds.look_due[w, kind - INDEX_SOURCE] = True
        rewards[w, 0] = gain * tables.weights[0]
        rewards[w, 1] = spoiled * tables.weights[1]
        rewards[w, 2] = elapsed * tables.weights[2]
        worlds.place[w] = plan.end[w]
        terminated[w] = kind == FINISH
        truncated[w] = totals[TIME] >= tables.time_limit_s and not terminated[w]
    return StepResult(rewards, phases_s, terminated, truncated)


@compiled
def transplant(tables: Tables, worlds: Worlds, plan: TransplantPlan, w: int, within: bool) -> tuple[float, float]:
    """Empty a source cell and set its plug; gives healthy target cells gained and healthy seedlings spoiled."""
    totals, m = worlds.totals[w], worlds.target_cells.shape[2]
    speed, column, gap = plan.kind[w], plan.pair[w] // m, plan.pair[w] % m
    row, target_row = worlds.source_row[w], worlds.target_row[w]
    plug, before = plan.held[w, 0], plan.held[w, 1]
    seen = worlds.source_reports[w, row, column]
    worlds.source_cells[w, row, column] = EMPTY
    worlds.source_reports[w, row, column] = EMPTY
    totals[TRIED] += 1.0
    left = before
    if plan.clears[w]:
        left = EMPTY
        worlds.target_reports[w, target_row, gap] = EMPTY
        if before != EMPTY:
            totals[CLEARED] += 1.0
    now, good = left, False
    if not plan.grips[w]:
        if plug != EMPTY:
            totals[TORN] += 1.0
            totals[DAMAGES] += 1.0
    elif worlds.luck[w, row, column, _LOSE] < tables.chances[speed, 0] or not within:
        totals[LOST] += 1.0
    else:
        # The sensor tells the machine that a plug arrived, not what became of it.
        worlds.target_reports[w, target_row, gap] = seen
        now = plug
        # A plug that is pushed into another one spoils both.
        if left != EMPTY or worlds.luck[w, row, column, _DAMAGE] < tables.chances[speed, 1]:
            now = DAMAGED
            totals[DAMAGES] += 2.0 if left == HEALTHY else 1.0
        good = now == HEALTHY
    worlds.target_cells[w, target_row, gap] = now
    gain = (1.0 if now == HEALTHY else 0.0) - (1.0 if before == HEALTHY else 0.0)
    totals[FILLED] += gain
    if good:
        totals[DONE] += 1.0
        totals[LAST] = totals[TIME]
    return gain, (1.0 if plug == HEALTHY and not good else 0.0)


@compiled
def index_source(worlds: Worlds, w: int) -> float:
    """Present the next source row; gives the healthy seedlings that leave with the old one."""
    wasted = 0.0
    for column in range(worlds.source_cells.shape[2]):
        if worlds.source_cells[w, worlds.source_row[w], column] == HEALTHY:
            wasted += 1.0
    worlds.totals[w, WASTED] += wasted
    worlds.source_row[w] += 1
    return wasted


@compiled
def observe_worlds(tables: Tables, worlds: Worlds) -> tuple[NDArray[np.float32], NDArray[np.float32], NDArray[np.int8]]:
    """Features of the machine (B, .) and of the candidates (B, K * F), and the mask (B, 3 K + 2)."""
    count, n, m = len(worlds.place), worlds.source_reports.shape[2], worlds.target_reports.shape[2]
    source_rows, target_rows = worlds.source_reports.shape[1] - 1, worlds.target_reports.shape[1] - 1
    machine = np.empty((count, _MACHINE), np.float32)
    candidates = np.zeros((count, n * m * _FEATURES), np.float32)
    mask = np.zeros((count, _SPEEDS * n * m + 2), np.int8)
    for w in range(count):
        place, row, target_row = worlds.place[w], worlds.source_row[w], worlds.target_row[w]
        usable = 0
        for source in range(n):
            ready = worlds.source_reports[w, row, source]
            if ready == EMPTY:
                continue
            usable += 1
            for target in range(m):
                known = worlds.target_reports[w, target_row, target]
                if known == HEALTHY:
                    continue
                pair, clear = source * m + target, 1 if known == POOR else 0
                first = pair * _FEATURES
                for column in range(_FEATURES):
                    candidates[w, first + column] = tables.pair_feature[pair, column]
                candidates[w, first + _APPROACH] = tables.approach[clear, place, pair, 0] / MOVE_SCALE_S
                candidates[w, first + _POOR] = 1.0 if ready == POOR else 0.0
                candidates[w, first + _CLEAR] = clear
                for speed in range(_SPEEDS):
                    mask[w, _SPEEDS * pair + speed] = 1
        gaps = 0
        for target in range(m):
            if worlds.target_reports[w, target_row, target] != HEALTHY:
                gaps += 1
        machine[w, 0], machine[w, 1] = tables.place_feature[place, 0], tables.place_feature[place, 1]
        machine[w, 2] = worlds.totals[w, TIME] / tables.time_limit_s
        machine[w, 3] = 1.0 - (row + 1.0) / source_rows
        machine[w, 4] = 1.0 - (target_row + 1.0) / target_rows
        machine[w, 5] = usable / n
        machine[w, 6] = gaps / m
        mask[w, -2] = row + 1 < source_rows
        mask[w, -1] = 1
    return machine, candidates, mask


@compiled
def score_worlds(worlds: Worlds) -> Array:
    """Scorecard so far (B, SCORES): net rate (every cell of every target tray counts), cycle time, rate, rest."""
    result = np.empty((len(worlds.totals), SCORES))
    for w in range(len(result)):
        totals = worlds.totals[w]
        missed = totals[CELLS] - totals[FILLED]
        result[w, 0] = totals[FILLED] / totals[CELLS]
        result[w, 1] = totals[LAST] / max(totals[DONE], 1.0)
        result[w, 2] = 60.0 * totals[DONE] / max(totals[TIME], 1e-9)
        for total in range(LAST):
            result[w, _FIRST_TOTAL + total] = totals[total]
        result[w, _FIRST_TOTAL + _MISSED] = missed
        result[w, -1] = 1.0 - missed / max(totals[GAPS], 1.0)
    return result
