"""What policies are shown of the worlds, and what was achieved in them, as machine code."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled, fill
from ..columns import names
from ..core import Array
from ..kernel_core import book
from .columns import (
    MOVE_SCALE_S,
    NEXT_SOURCE,
    NEXT_TARGET,
    SHOWN,
    TURN_SOURCES,
    TURN_TARGETS,
    C,
    Candidate,
    E,
    M,
    Phases,
    S,
    Scores,
    T,
    W,
)
from .config import EMPTY, POOR, SPEEDS
from .orders import ordered, show_orders, source_left, steps_on, wanted
from .rules import FixedFeatures, Worlds, apply_worlds, plan_worlds
from .timing import CLEARING, STRAIGHT, Times

_SPEEDS, _PHASES = len(SPEEDS), len(names(Phases))
_FEATURES, _SCORES = len(names(Candidate)), len(names(Scores))


@compiled
def observe_worlds(
    times: Times,
    fixed: FixedFeatures,
    time_limit_s: float,
    supply: Array,
    worlds: Worlds,
    rows: NDArray[np.int64],
    machine: NDArray[np.float32],
    candidates: NDArray[np.float32],
    mask: NDArray[np.int8],
) -> None:
    """Write features of the machine (B, .) and of the candidates (B, K * F), and the mask (B, 3 K + 2), of ``rows``."""
    n, m = worlds.source_reports.shape[2], worlds.target_reports.shape[2]
    source_rows, target_rows = worlds.source_reports.shape[1] - 1, worlds.target_reports.shape[1] - 1
    for w in rows:
        fill(candidates[w], 0.0)
        fill(mask[w], 0)
        place, row, target_row = worlds.place[w], worlds.source_row[w], worlds.target_row[w]
        usable, want = 0, wanted(worlds, w)
        for source in range(n):
            ready = worlds.source_reports[w, row, source]
            if ready == EMPTY:
                continue
            usable += 1
            for target in range(m):
                known = worlds.target_reports[w, target_row, target]
                if known == want or want < 0:
                    continue
                pair, clear = source * m + target, known != EMPTY
                first = pair * _FEATURES
                for column in range(_FEATURES):
                    candidates[w, first + column] = fixed.pair[pair, column]
                approach_s = times.approach[CLEARING if clear else STRAIGHT, place, pair, W.s]
                candidates[w, first + C.approach] = min(approach_s / MOVE_SCALE_S, SHOWN)
                candidates[w, first + C.source_poor] = 1.0 if ready == POOR else 0.0
                candidates[w, first + C.clear] = 1.0 if clear else 0.0
                for speed in range(_SPEEDS):
                    mask[w, _SPEEDS * pair + speed] = 1
        gaps = 0
        for target in range(m):
            if want >= 0 and worlds.target_reports[w, target_row, target] != want:
                gaps += 1
        machine[w, M.place], machine[w, M.down] = (
            fixed.place[place, M.place],
            fixed.place[place, M.down],
        )
        machine[w, M.time] = min(worlds.totals[w, T.time] / time_limit_s, SHOWN)
        machine[w, M.source_rows] = 1.0 - (row + 1.0) / source_rows
        machine[w, M.target_rows] = 1.0 - (target_row + 1.0) / target_rows
        machine[w, M.ready] = usable / n
        machine[w, M.gaps] = gaps / m
        mask[w, NEXT_SOURCE] = row + 1 < source_rows
        mask[w, NEXT_TARGET] = 1
        if ordered(worlds):
            mask[w, NEXT_SOURCE] = source_left(worlds, w) > 0
            mask[w, TURN_SOURCES] = worlds.source_at.shape[1] > 1
            mask[w, TURN_TARGETS] = steps_on(worlds, w) > 0
            show_orders(supply, worlds, w, machine[w])


@compiled
def score_worlds(all_totals: Array, rows: NDArray[np.int64], numbers: Array) -> None:
    """Write the scorecard so far of ``rows`` into the last columns (B, .), see ``Scores``."""
    first = numbers.shape[1] - _SCORES
    for w in rows:
        totals, score = all_totals[w], numbers[w, first:]
        missed = totals[T.cells] - totals[T.healthy]
        score[S.net_rate] = totals[T.healthy] / totals[T.cells]
        score[S.cycle_time_s] = totals[T.last] / max(totals[T.done], 1.0)
        score[S.throughput_per_min] = 60.0 * totals[T.done] / max(totals[T.time], 1e-9)
        score[S.duration_s] = totals[T.time]
        score[S.done] = totals[T.done]
        score[S.missed] = missed
        score[S.damaged] = totals[T.damaged]
        score[S.illegal] = totals[T.illegal]
        for phase in range(_PHASES):
            score[S.phase_travel_s + phase] = totals[T.travel_s + phase]
        score[S.lost] = totals[T.lost]
        score[S.torn] = totals[T.torn]
        score[S.wasted] = totals[T.wasted]
        score[S.cleared] = totals[T.cleared]
        score[S.transplants] = totals[T.transplants]
        score[S.travel_m] = totals[T.travel_m]
        score[S.healthy] = totals[T.healthy]
        score[S.cells] = totals[T.cells]
        score[S.gaps] = totals[T.gaps]
        score[S.filled] = 1.0 - missed / max(totals[T.gaps], 1.0)


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
    (times, terms, fixed), worlds = desk.rules, desk.worlds
    observe_worlds(times, fixed, terms.time_limit_s, terms.supply, worlds, rows, machine, candidates, mask)
    score_worlds(worlds.totals, rows, numbers)


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
    (times, terms, _), worlds = desk.rules, desk.worlds
    plan = plan_worlds(times, terms.extraction, worlds, actions)
    desk.plan = plan
    result = apply_worlds(terms, worlds, plan, plan.phases_s, np.zeros((len(actions), len(E))))
    book(result, numbers, terminated, truncated)
    show_worlds(desk, rows, machine, candidates, mask, numbers)
