"""The rules of weeding from a moving cart, one world after the other, as machine code, for any tool.

``state`` holds what the kernels work on; ``timing`` and ``process`` say what they ask of the tool.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled
from ...kernels.discs import covered_share
from ...kernels.nearness import want
from ..core import Array, StepResult
from .features import LIMIT, L
from .process import dose
from .ridges import lift_time
from .shaken import carried_on, corrected, deeper, worked
from .state import MODES, NOTHING, PAD, WAIT, N, R, T, Tables, V, WeederPlan, Worlds
from .timing import WORK, A, Approach, G, P, Place, approach, move_time, ready, way_of

AHEAD = 32
"""Worlds whose numbers are wanted together: so many find room near the processor."""


@compiled
def approach_slot(tables: Tables, arm: Any, worlds: Worlds, w: int, slot: int, mode: int) -> Approach:
    """How the machine would work on the candidate in a slot."""
    track = worlds.slot_track[w, slot]
    along, across = worlds.track_report[w, track, G.along], worlds.track_report[w, track, G.across]
    place = Place(worlds.place[w, A.carrier], worlds.place[w, A.lean], worlds.place[w, A.across])
    return approach(arm, tables.stand_s[mode], place, worlds.cart[w], worlds.speed[w], along, across)


@compiled
def powered(tables: Tables, worlds: Worlds, w: int, mode: int) -> bool:
    """Whether there is energy left for a work in a mode."""
    return worlds.totals[w, T.joules] + tables.energy_j[mode] <= tables.budget_j


@compiled
def legal_option(tables: Tables, arm: Any, worlds: Worlds, w: int, option: int) -> bool:
    """Whether a shot, an action of the first block, is possible now in one world."""
    slot = option // MODES
    if slot >= worlds.slot_track.shape[1] or worlds.slot_track[w, slot] == worlds.track_real.shape[1] - 1:
        return False
    mode = option % MODES
    return powered(tables, worlds, w, mode) and approach_slot(tables, arm, worlds, w, slot, mode).legal


@compiled
def plan_worlds(tables: Tables, arm: Any, worlds: Worlds, actions: NDArray[np.int64]) -> WeederPlan:
    """Turn actions (B,) into what the machine has to do."""
    n, slots, empty = actions.size, worlds.slot_track.shape[1], worlds.track_real.shape[1] - 1
    own, base = tables.work_s.shape[1], MODES * slots + 1
    pause = WORK + own
    kind, chosen, track = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    target, aim, speed = np.empty((n, len(A))), np.empty((n, len(G))), np.empty((n, len(V)))
    phases_s, correction = np.zeros((n, pause + 1)), np.zeros((n, len(G)))
    for w in range(n):
        speed[w, V.before] = worlds.speed[w]
        speed[w, V.after] = new_speed(tables, worlds.set_speed[w], actions[w] // base)
        option = actions[w] % base
        slot, mode = option // MODES, option % MODES
        kind[w], chosen[w], track[w] = WAIT if slot == slots else NOTHING, slots, empty
        if legal_option(tables, arm, worlds, w, option):
            way = approach_slot(tables, arm, worlds, w, slot, mode)
            kind[w], chosen[w], track[w] = mode, slot, worlds.slot_track[w, slot]
            seen, told = worlds.track_aim[w, track[w]], worlds.track_report[w, track[w]]
            target[w, A.lean] = way.lean_m
            phases_s[w, P.move], phases_s[w, P.wait] = way.move_s, way.wait_s
            for phase in range(own):
                phases_s[w, WORK + phase] = tables.work_s[mode, phase]
            # The carrier takes the tool camera's correction along the row.
            if worlds.surface.shape[1] == 0:
                target[w, A.carrier] = way.carrier_m + (seen[G.along] - told[G.along])
                target[w, A.across] = way.across_m + (seen[G.across] - told[G.across])
            else:
                carried = carried_on(tables, worlds, w, speed[w], way)
                along, across = corrected(tables, worlds, w, speed[w], way, carried, seen[G.along], seen[G.across])
                correction[w, G.along], correction[w, G.across] = along, across
                target[w, A.carrier], target[w, A.across] = way.carrier_m + carried + along, way.across_m + across
                if tables.looks_after:
                    phases_s[w, WORK] += move_time(arm, along, 0.0, across)
        else:
            # Waiting keeps the machine near the front edge of the window while the ground passes by.
            pause_s = float(tables.pause_s[kind[w] - WAIT])
            way_m, _ = way_of(speed[w, V.before], speed[w, V.after], tables.acceleration_m_s2, pause_s)
            rest, now = ready(arm, worlds.cart[w] + way_m), worlds.place[w]
            target[w, A.carrier], target[w, A.lean], target[w, A.across] = rest.carrier_m, rest.lean_m, rest.across_m
            move_s = move_time(
                arm, rest.carrier_m - now[A.carrier], rest.lean_m - now[A.lean], rest.across_m - now[A.across]
            )
            move_s = max(move_s, lift_time(arm, now[A.across], rest.across_m))
            phases_s[w, P.move], phases_s[w, pause] = move_s, max(pause_s - move_s, 0.0)
        aim[w, G.along] = worlds.track_aim[w, track[w], G.along]
        aim[w, G.across] = worlds.track_aim[w, track[w], G.across]
        if kind[w] < WAIT and worlds.surface.shape[1] > 0:
            aim[w, G.along], aim[w, G.across] = worked(tables, worlds, w, speed[w], phases_s[w], target[w])
    cart = worlds.cart.copy()
    return WeederPlan(kind, chosen, track, worlds.place.copy(), target, aim, cart, speed, phases_s, correction)


@compiled
def new_speed(tables: Tables, set_speed: float, block: int) -> float:
    """Commanded speed after an action of a block: hold, one notch slower, one notch faster."""
    if not tables.speed_control:
        return set_speed
    change = tables.notch_m_s * (0.0 if block == 0 else (-1.0 if block == 1 else 1.0))
    return min(max(set_speed + change, tables.speed_range_m_s[0]), tables.speed_range_m_s[1])


@compiled
def apply_worlds(
    tables: Tables, work: Any, worlds: Worlds, plan: WeederPlan, phases_s: Array, hit: Array
) -> StepResult:
    """Treat plants, book the time, drive on; ``hit`` (B, 2) is where the tool really worked."""
    n, empty = len(plan.kind), worlds.track_real.shape[1] - 1
    rewards, terminated, truncated = np.zeros((n, len(R))), np.empty(n, np.bool_), np.empty(n, np.bool_)
    for w in range(n):
        if w % AHEAD == 0:
            for other in range(w, min(w + AHEAD, n)):
                want_world(tables, worlds, other, plan.kind[other], plan.track[other])
        kind, totals = plan.kind[w], worlds.totals[w]
        elapsed = 0.0
        for phase in range(phases_s.shape[1]):
            elapsed += phases_s[w, phase]
            worlds.phases_s[w, phase] += phases_s[w, phase]
        totals[T.time] += elapsed
        rewards[w, R.time] = elapsed * tables.weights[R.time]
        if kind < WAIT:
            along, across, share = hit[w, G.along], hit[w, G.across], 1.0
            if worlds.surface.shape[1] > 0:
                share = deeper(tables, worlds, w, plan.speed[w], phases_s[w], kind, along, across)
            killed, worth, crops, leaves = treat(tables, work, worlds, w, kind, plan.track[w], along, across, share)
            # The machine knows where it meant to work, not where it did.
            track, reports = plan.track[w], worlds.track_report[w]
            along, across = plan.aim[w, G.along], plan.aim[w, G.across]
            if worlds.surface.shape[1] > 0:
                along = reports[track, G.along] + plan.correction[w, G.along]
                across = reports[track, G.across] + plan.correction[w, G.across]
            note(
                work,
                tables.half,
                reports[: worlds.track_count[w]],
                worlds.track_feature[w],
                track,
                worlds.slot_track[w, 0],
                tables.in_order,
                kind,
                along,
                across,
            )
            counted = worth
            if tables.demanded > 0.0:
                counted = counted_kills(tables, worlds.weeds[w], totals[T.killed], killed)
            rewards[w, R.killed] = counted * tables.weights[R.killed]
            rewards[w, R.crop] = crops * tables.weights[R.crop]
            rewards[w, R.energy] = tables.energy_j[kind] * tables.weights[R.energy]
            rewards[w, R.leaves] = leaves * tables.weights[R.leaves]
            worlds.slot_track[w, plan.slot[w]] = empty
        elif kind == NOTHING:
            totals[T.illegal] += 1.0
        way, worlds.speed[w] = way_of(
            plan.speed[w, V.before], plan.speed[w, V.after], tables.acceleration_m_s2, elapsed
        )
        worlds.cart[w] += way
        worlds.set_speed[w] = plan.speed[w, V.after]
        for axis in range(len(A)):
            worlds.place[w, axis] = plan.target[w, axis]
        move_up(tables, worlds, w)
        # Behind the strip's end the front camera sees nothing new: without tracks, none will come.
        nothing_left = worlds.slot_track[w, 0] == empty and worlds.cart[w] + tables.blind_m > tables.end_m
        terminated[w] = worlds.cart[w] >= tables.end_m or nothing_left
        truncated[w] = totals[T.time] >= tables.time_limit_s and not terminated[w]
    return StepResult(rewards, phases_s, terminated, truncated)


@compiled
def want_world(tables: Tables, worlds: Worlds, w: int, kind: int, track: int) -> None:
    """Want the numbers of a world that its decision looks up here and there: a shot's plants, the next track."""
    want(worlds.track_report[w, worlds.cursor[w], G.along])
    want(worlds.track_known_m[w, worlds.cursor[w]])
    if kind < WAIT:
        weed = PAD + worlds.track_near[w, track, N.weed]
        crop = tables.weeds_end + worlds.track_near[w, track, N.crop]
        want(worlds.leaf_lost[w, crop - tables.weeds_end])
        for plant in (weed, crop):
            want(worlds.plant[w, plant, G.along])
            want(worlds.plant_dose[w, plant])
            want(worlds.plant_tolerance[w, plant])
            want(worlds.plant_kind[w, plant])


@compiled
def counted_kills(tables: Tables, weeds: float, total: float, killed: float) -> float:
    """Kills of a decision that are worth something where a share is demanded: those up to the first that meets it.

    Args:
        tables: see there.
        weeds: of the strip.
        total: weeds that have died so far, with this decision.
        killed: of them, those of this decision.
    """
    enough = math.ceil(tables.demanded * weeds - 1e-9)
    return min(total, enough) - min(total - killed, enough)


@compiled
def treat(
    tables: Tables,
    work: Any,
    worlds: Worlds,
    w: int,
    mode: int,
    track: int,
    along_m: float,
    across_m: float,
    share: float,
) -> tuple[float, float, float, float]:
    """Work on a place and whatever grows within the tool's reach of it.

    Gives the weeds that die, what they count, the crop plants that die, and the leaf area that crop plants lose, in
    whole plants.

    ``share`` is what the ground leaves of the dose, 1 where it is a plane.
    """
    totals, reach_m = worlds.totals[w], work.reach_m
    plant, doses = worlds.plant[w], worlds.plant_dose[w]
    limits, kinds = worlds.plant_tolerance[w], worlds.plant_kind[w]
    # Weeds are sorted along: from the nearest to the aim to both sides, as far as the tool reaches.
    before = PAD + worlds.track_near[w, track, N.weed]
    behind = before + 1
    while before > 0 and along_m - plant[before, G.along] <= reach_m:
        before -= 1
    while behind < tables.weeds_end and plant[behind, G.along] - along_m <= reach_m:
        behind += 1
    counts = worlds.plant_worth[w]
    killed, worth = strike(
        work, plant, doses, limits, kinds, counts, mode, before + 1, behind, along_m, across_m, share
    )
    crop, beside = tables.weeds_end + worlds.track_near[w, track, N.crop], tables.crop_beside
    # Leaves of a plant that dies go with it: what they lose is counted while it lives.
    leaves = strip_leaves(tables, work.leaf_m[mode], worlds, w, crop, along_m, across_m)
    first, end = crop - beside, crop + beside + 1
    crops, _ = strike(work, plant, doses, limits, kinds, counts, mode, first, end, along_m, across_m, share)
    totals[T.killed] += killed
    totals[T.worth] += worth
    totals[T.crop] += crops
    totals[T.leaves] += leaves
    totals[T.shots] += 1.0
    totals[T.joules] += tables.energy_j[mode]
    totals[T.last_shot] = totals[T.time]
    if killed > 0.0:
        totals[T.last_kill] = totals[T.time]
    if not worlds.track_real[w, track]:
        totals[T.blanks] += 1.0
    return killed, worth, crops, leaves


@compiled
def note(
    work: Any,
    half: Array,
    report: Array,
    features: NDArray[np.float32],
    track: int,
    oldest: int,
    in_order: bool,
    mode: int,
    along_m: float,
    across_m: float,
) -> None:
    """Add a work at a place to what tracks of a world show as done: its dose there, of what kills half of their kind.

    The track that it was meant for is not shown again. Reports (T, 2) may lie in order along the row; then those before
    the ``oldest`` that is shown are not either.
    """
    first, reach_m = 0, work.reach_m
    if in_order:
        first = track
        while first > oldest and along_m - report[first - 1, G.along] <= reach_m:
            first -= 1
    for k in range(first, len(report)):
        along, across = report[k, G.along] - along_m, report[k, G.across] - across_m
        if in_order and along > reach_m:
            break
        if k != track and along * along + across * across <= reach_m * reach_m:
            feature = features[k]
            species, stage = int(feature[L.grass]), 0
            while stage < L.four_leaf - L.cotyledon and feature[L.cotyledon + stage] == 0.0:
                stage += 1
            share = dose(work, mode, along, across, stage) / half[species, stage]
            feature[L.done] = min(feature[L.done] + share, LIMIT)


@compiled
def strip_leaves(
    tables: Tables, hit_m: float, worlds: Worlds, w: int, crop: int, along_m: float, across_m: float
) -> float:
    """Take the leaves within ``hit_m`` of a place off the crop plants about ``crop``; gives what that was, in plants.

    Leaves spread evenly over a disc about the stem, so that a plant loses the share of its disc that is hit. Shares
    add up to all of a plant at most; where works lie over one another they count twice until then.
    """
    plant, first, end = worlds.plant[w], tables.weeds_end, worlds.plant.shape[1]
    lost, reach_m = 0.0, hit_m + tables.leaf_m
    # Crop plants are sorted along: from the nearest to both sides, as far as leaves reach.
    before = crop
    while before >= first and along_m - plant[before, G.along] < reach_m:
        before -= 1
    behind = crop + 1
    while behind < end and plant[behind, G.along] - along_m < reach_m:
        behind += 1
    for i in range(before + 1, behind):
        # Plants beyond the strip's ends, and places where none stands, take any dose.
        if not worlds.plant_dose[w, i] < worlds.plant_tolerance[w, i] < math.inf:
            continue
        along, across = plant[i, G.along] - along_m, plant[i, G.across] - across_m
        share = covered_share(hit_m, tables.leaf_m, math.sqrt(along * along + across * across))
        before_share = worlds.leaf_lost[w, i - first]
        worlds.leaf_lost[w, i - first] = min(before_share + share, 1.0)
        lost += worlds.leaf_lost[w, i - first] - before_share
    return lost


@compiled
def strike(
    work: Any,
    plant: Array,
    doses: Array,
    limits: Array,
    kinds: NDArray[np.int64],
    counts: Array,
    mode: int,
    first: int,
    end: int,
    along_m: float,
    across_m: float,
    share: float,
) -> tuple[float, float]:
    """Add a share of the work's dose on the plants of a world from ``first`` to before ``end``.

    Gives how many die, and what they count.
    """
    dead, worth = 0.0, 0.0
    for i in range(first, end):
        along, across = plant[i, G.along] - along_m, plant[i, G.across] - across_m
        if abs(along) <= work.reach_m and abs(across) <= work.reach_m:
            before = doses[i]
            doses[i] = before + share * dose(work, mode, along, across, kinds[i])
            if before < limits[i] <= doses[i]:
                dead += 1.0
                worth += counts[i]
    return dead, worth


@compiled
def move_up(tables: Tables, worlds: Worlds, w: int) -> None:
    """Drop what has left the window, close the gaps, and let the tracks that are known by now move up."""
    slots, empty = worlds.slot_track.shape[1], worlds.track_real.shape[1] - 1
    exit_m = worlds.cart[w] - tables.exit_m
    filled = 0
    for k in range(slots):
        track = worlds.slot_track[w, k]
        if track != empty and worlds.track_report[w, track, G.along] >= exit_m:
            worlds.slot_track[w, filled] = track
            filled += 1
    known_m = worlds.cart[w] - worlds.speed[w] * tables.delay_s
    cursor = worlds.cursor[w]
    while filled < slots and cursor < worlds.track_count[w]:
        # Tracks that left while the slots were full are passed over.
        if worlds.track_report[w, cursor, G.along] >= exit_m:
            if worlds.track_known_m[w, cursor] > known_m:
                break
            worlds.slot_track[w, filled] = cursor
            filled += 1
        cursor += 1
    worlds.cursor[w] = cursor
    for k in range(filled, slots):
        worlds.slot_track[w, k] = empty
