"""What policies are shown of the worlds, and what was achieved in them, as machine code."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled
from ...kernels.nearness import want
from ..core import Array
from ..kernel_core import book
from .features import (
    ALONG_SCALE_M,
    ENERGY,
    LEAVES_SCALE_S,
    LIMIT,
    SPEED_SCALE,
    TIME_SCALE_S,
    C,
    Candidate,
    L,
    Lasting,
    M,
)
from .rules import AHEAD, apply_worlds, plan_worlds, powered
from .state import MODES, OWN, S, T, Tables, Worlds
from .timing import A, G, Place, approach

LASTS = tuple(Candidate._fields.index(name) for name in Lasting._fields)
"""The columns of a candidate that last."""
NORMAL = 1
"""The mode whose motion and wait candidates are shown with."""


@compiled
def held(value: float) -> float:
    """A feature within what is shown."""
    return min(max(value, -LIMIT), LIMIT)


@compiled
def observe_worlds(
    tables: Tables,
    arm: Any,
    worlds: Worlds,
    rows: NDArray[np.int64],
    machine: NDArray[np.float32],
    candidates: NDArray[np.float32],
    mask: NDArray[np.int8],
) -> None:
    """Write features of the machine (B, .) and of the candidates (B, K * F), and the mask (B, .), of ``rows``."""
    slots, empty = worlds.slot_track.shape[1], worlds.track_real.shape[1] - 1
    base = MODES * slots + 1
    along_m, across_m = np.empty(slots), np.empty(slots)
    for row in range(len(rows)):
        w = rows[row]
        if row % AHEAD == 0:
            for other in rows[row : row + AHEAD]:
                want_tracks(worlds, other)
        # Numbers of its own, which nothing that is written could change: they are read once.
        cart, speed = float(worlds.cart[w]), float(worlds.speed[w])
        carrier, lean = float(worlds.place[w, A.carrier]), float(worlds.place[w, A.lean])
        place = Place(carrier, lean, float(worlds.place[w, A.across]))
        present = 0
        while present < slots and worlds.slot_track[w, present] != empty:
            present += 1
        machine[w, M.place] = held((carrier - cart) / arm.scale[A.carrier])
        machine[w, M.lean_along] = held(lean / arm.scale[A.lean])
        machine[w, M.lean_across] = held(place.across_m / arm.scale[A.across])
        machine[w, M.speed] = held(speed / SPEED_SCALE)
        machine[w, M.set_speed] = held(float(worlds.set_speed[w]) / SPEED_SCALE)
        machine[w, M.progress] = held(cart / tables.strip_m)
        machine[w, M.backlog] = present / slots
        for k in range(present):
            track, column = worlds.slot_track[w, k], k * len(C)
            candidates[w, column + C.present] = 1.0
            for n in range(len(L)):
                candidates[w, column + LASTS[n]] = worlds.track_feature[w, track, n]
            along_m[k], across_m[k] = worlds.track_report[w, track, G.along], worlds.track_report[w, track, G.across]
            ahead = along_m[k] - cart
            candidates[w, column + C.along] = held(ahead / ALONG_SCALE_M)
            candidates[w, column + C.leaves] = held((ahead + tables.exit_m) / (speed * LEAVES_SCALE_S))
        if machine.shape[1] > ENERGY:
            machine[w, ENERGY] = held((tables.budget_j - worlds.totals[w, T.joules]) / tables.budget_j)
        for column in range(present * len(C), candidates.shape[1]):
            candidates[w, column] = 0.0
        # What a mode shares in all slots is worked out once: the loop over the slots is the inner one.
        for mode in range(MODES):
            stand_s, enough = float(tables.stand_s[mode]), powered(tables, worlds, w, mode)
            for k in range(present):
                way = approach(arm, stand_s, place, cart, speed, along_m[k], across_m[k])
                mask[w, MODES * k + mode] = enough and way.legal
                if mode == NORMAL:
                    candidates[w, k * len(C) + C.move] = held(way.move_s / TIME_SCALE_S)
                    candidates[w, k * len(C) + C.wait] = held(way.wait_s / TIME_SCALE_S)
        for action in range(MODES * present, base - 1):
            mask[w, action] = 0
        mask[w, base - 1] = 1
        for action in range(base, mask.shape[1]):
            mask[w, action] = mask[w, action - base]


@compiled
def want_tracks(worlds: Worlds, w: int) -> None:
    """Want what is shown of a world's tracks; two rows of features and four places lie side by side."""
    for k in range(0, worlds.slot_track.shape[1], 4):
        want(worlds.track_report[w, worlds.slot_track[w, k], G.along])
    for k in range(0, worlds.slot_track.shape[1], 2):
        want(worlds.track_feature[w, worlds.slot_track[w, k], L.across])


@compiled
def score_worlds(tables: Tables, worlds: Worlds, rows: NDArray[np.int64], numbers: Array) -> None:
    """Write the scorecard so far of ``rows`` into the last columns (B, .): the common scores, the phases, the own ones.

    The net rate counts every true weed of the band, missed ones too.
    """
    phases = worlds.phases_s.shape[1]
    first = numbers.shape[1] - (len(S) + phases + len(OWN))
    for w in rows:
        of, there, score, own = worlds.totals[w], worlds.weeds[w], numbers[w, first:], len(S) + phases
        time_s, killed, shots = max(of[T.time], 1e-9), of[T.killed], of[T.shots]
        score[S.net_rate] = of[T.worth] / (worlds.worth[w] if worlds.worth[w] > 0.0 else 1.0)
        score[S.cycle_time_s] = of[T.last_kill] / max(killed, 1.0)
        score[S.throughput_per_min] = 60.0 * killed / time_s
        score[S.duration_s] = of[T.time]
        score[S.done], score[S.missed] = killed, there - killed
        score[S.damaged], score[S.illegal] = of[T.crop], of[T.illegal]
        for phase in range(phases):
            score[len(S) + phase] = worlds.phases_s[w, phase]
        score[own + OWN.crop_loss_percent] = 100.0 * of[T.crop] / max(worlds.crops_in_strip[w], 1.0)
        score[own + OWN.leaf_loss] = of[T.leaves] / max(worlds.crops_in_strip[w], 1.0)
        score[own + OWN.joules_per_weed] = of[T.joules] / max(killed, 1.0)
        score[own + OWN.ha_per_h] = (worlds.cart[w] + tables.start_m) / time_s * tables.ha_s_per_m_h
        score[own + OWN.shots], score[own + OWN.blank_shots] = shots, of[T.blanks]
        score[own + OWN.shot_time_s] = of[T.last_shot] / max(shots, 1.0)
        score[own + OWN.weeds], score[own + OWN.tracks] = there, worlds.track_count[w]


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
    (tables, arm, _), worlds = desk.rules, desk.worlds
    observe_worlds(tables, arm, worlds, rows, machine, candidates, mask)
    score_worlds(tables, worlds, rows, numbers)


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
    (tables, arm, work), worlds = desk.rules, desk.worlds
    plan = plan_worlds(tables, arm, worlds, actions)
    desk.plan = plan
    book(apply_worlds(tables, work, worlds, plan, plan.phases_s, plan.aim), numbers, terminated, truncated)
    show_worlds(desk, rows, machine, candidates, mask, numbers)
