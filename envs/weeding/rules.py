"""The rules of weeding from a moving cart, one world after the other, as machine code, for any tool.

``core`` prepares what the kernels work on; ``timing`` and ``process`` say what they ask of the tool.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..compiled import compiled
from ..core import Array, StepResult
from .field import PAD
from .process import dose
from .timing import Approach, approach, move_time, ready, way_of

MODES = 3
WAIT, NOTHING = MODES, MODES + 1
"""Kinds of decision after the three modes: wait a moment, an illegal action."""
MOVE, LINGER = 0, 1
"""Phases before the process's own; the last phase is the pause."""
BLOCKS = 3
"""The speed variant's blocks of actions: hold the speed, slower, faster."""
CROP_KIND = 3
"""Kind of a crop plant; the kinds before it are the weeds' stages."""

TIME, KILLED, CROP, ILLEGAL, SHOTS, BLANKS, JOULES, LAST = range(8)
"""Columns of the running totals."""
TOTALS = LAST + 1


class Tables(NamedTuple):
    """What the rules look up; the same in every world.

    Attributes:
        work_s: (M, P), seconds of each phase on the target by mode.
        stand_s: (M,), their sums.
        energy_j: (M,).
        pause_s: (2,), what waiting a moment and an illegal action take at least.
        weights: (4,), of the reward's terms.
        weeds_end: weeds lie before this place of the plants, crop plants behind it.
        start_m: the cart begins this far before the strip.
        strip_m: length of the strip.
        end_m: cart position at which the strip has passed the window.
        blind_m: way of the cart from which the front camera's view has left a place until it has left the window.
        exit_m: the window's rear edge behind the cart.
        delay_s: from a picture to the use of what it showed.
        speed_control: whether actions include the cart's speed.
        notch_m_s: step of the commanded speed.
        speed_range_m_s: of the commanded speed.
        acceleration_m_s2: of the cart.
        ha_s_per_m_h: hectares an hour at a metre a second.
        time_limit_s: when the episode is cut off.
    """

    work_s: Array
    stand_s: Array
    energy_j: Array
    pause_s: Array
    weights: Array
    weeds_end: int
    start_m: float
    strip_m: float
    end_m: float
    blind_m: float
    exit_m: float
    delay_s: float
    speed_control: bool
    notch_m_s: float
    speed_range_m_s: tuple[float, float]
    acceleration_m_s2: float
    ha_s_per_m_h: float
    time_limit_s: float


class Worlds(NamedTuple):
    """State of B worlds with N places for plants, T for tracks and K slots; places are metres along and across.

    Attributes:
        plant: (B, N, 2), weeds sorted along with empty places before and after them, then the crop plants in order.
        plant_kind: (B, N), stage of a weed, 3 for a crop plant.
        plant_tolerance: (B, N), dose that kills; infinite where nothing grows.
        plant_dose: (B, N), dose so far.
        weeds: (B,), true weeds of the strip.
        crops_in_strip: (B,).
        track_report: (B, T + 1, 2), where the machine believes a plant when it aims; track T stands for none.
        track_aim: (B, T + 1, 2), where the tool is set after its correction.
        track_known_m: (B, T + 1), cart position from which on a track is known, not counting the delay; ascending.
        track_near: (B, T + 1, 2), nearest weed along and nearest crop plant, counted without the empty places; for
            scoring alone.
        track_real: (B, T + 1), whether a weed is behind it; for scoring alone.
        track_feature: (B, T + 1, F), what does not depend on where the machine is.
        track_count: (B,).
        slot_track: (B, K), track in each slot.
        cursor: (B,), next track that has not been in a slot.
        cart: (B,), metres along the row.
        speed: (B,), m/s.
        set_speed: (B,), the commanded one.
        place: (B, 3), where the arm stands; see ``timing``.
        totals: (B, TOTALS).
        phases_s: (B, phases), seconds so far.
    """

    plant: Array
    plant_kind: NDArray[np.int64]
    plant_tolerance: Array
    plant_dose: Array
    weeds: Array
    crops_in_strip: Array
    track_report: Array
    track_aim: Array
    track_known_m: Array
    track_near: NDArray[np.int64]
    track_real: NDArray[np.bool_]
    track_feature: NDArray[np.float32]
    track_count: NDArray[np.int64]
    slot_track: NDArray[np.int64]
    cursor: NDArray[np.int64]
    cart: Array
    speed: Array
    set_speed: Array
    place: Array
    totals: Array
    phases_s: Array


class WeederPlan(NamedTuple):
    """What the machine has to do in each world.

    Attributes:
        kind: (B,), mode, ``WAIT`` or ``NOTHING``.
        slot: (B,), candidate slot, ``slots`` when none.
        track: (B,), track behind it.
        start: (B, 3), place of the arm now.
        target: (B, 3), where it stands during the work, the tool camera's correction included.
        aim: (B, 2), where the tool works in the world, metres; far away when it does not.
        cart: (B,), cart position at the beginning.
        speed: (B, 2), its speed at the beginning and the one that it changes to, m/s.
        phases_s: (B, P), nominal seconds of each phase, in order: move, wait, the process's own, pause.
    """

    kind: NDArray[np.int64]
    slot: NDArray[np.int64]
    track: NDArray[np.int64]
    start: Array
    target: Array
    aim: Array
    cart: Array
    speed: Array
    phases_s: Array


@compiled
def approach_slot(tables: Tables, arm: Any, worlds: Worlds, w: int, slot: int, mode: int) -> Approach:
    """How the machine would work on the candidate in a slot."""
    track = worlds.slot_track[w, slot]
    along, across = worlds.track_report[w, track, 0], worlds.track_report[w, track, 1]
    place = worlds.place[w, 0], worlds.place[w, 1], worlds.place[w, 2]
    return approach(arm, tables.stand_s[mode], place, worlds.cart[w], worlds.speed[w], along, across)


@compiled
def legal_option(tables: Tables, arm: Any, worlds: Worlds, w: int, option: int) -> bool:
    """Whether a shot, an action of the first block, is possible now in one world."""
    slot = option // MODES
    if slot >= worlds.slot_track.shape[1] or worlds.slot_track[w, slot] == worlds.track_real.shape[1] - 1:
        return False
    return approach_slot(tables, arm, worlds, w, slot, option % MODES).legal


@compiled
def plan_worlds(tables: Tables, arm: Any, worlds: Worlds, actions: NDArray[np.int64]) -> WeederPlan:
    """Turn actions (B,) into what the machine has to do."""
    n, slots, empty = actions.size, worlds.slot_track.shape[1], worlds.track_real.shape[1] - 1
    own, base = tables.work_s.shape[1], MODES * slots + 1
    kind, chosen, track = np.empty(n, np.int64), np.empty(n, np.int64), np.empty(n, np.int64)
    target, aim, speed = np.empty((n, 3)), np.empty((n, 2)), np.empty((n, 2))
    phases_s = np.zeros((n, own + 3))
    for w in range(n):
        speed[w, 0] = worlds.speed[w]
        speed[w, 1] = new_speed(tables, worlds.set_speed[w], actions[w] // base)
        option = actions[w] % base
        slot, mode = option // MODES, option % MODES
        kind[w], chosen[w], track[w] = WAIT if slot == slots else NOTHING, slots, empty
        if legal_option(tables, arm, worlds, w, option):
            way = approach_slot(tables, arm, worlds, w, slot, mode)
            kind[w], chosen[w], track[w] = mode, slot, worlds.slot_track[w, slot]
            # The carrier takes the tool camera's correction along the row.
            target[w, 0] = way.carrier_m + (worlds.track_aim[w, track[w], 0] - worlds.track_report[w, track[w], 0])
            target[w, 1] = way.lean_m
            target[w, 2] = way.across_m + (worlds.track_aim[w, track[w], 1] - worlds.track_report[w, track[w], 1])
            phases_s[w, MOVE], phases_s[w, LINGER] = way.move_s, way.wait_s
            for phase in range(own):
                phases_s[w, LINGER + 1 + phase] = tables.work_s[mode, phase]
        else:
            # Waiting keeps the machine near the front edge of the window while the ground passes by.
            pause_s = float(tables.pause_s[kind[w] - WAIT])
            way_m, _ = way_of(speed[w, 0], speed[w, 1], tables.acceleration_m_s2, pause_s)
            target[w, 0], target[w, 1], target[w, 2] = ready(arm, worlds.cart[w] + way_m)
            start = worlds.place[w, 0], worlds.place[w, 1], worlds.place[w, 2]
            move_s = move_time(arm, target[w, 0] - start[0], target[w, 1] - start[1], target[w, 2] - start[2])
            phases_s[w, MOVE], phases_s[w, LINGER + 1 + own] = move_s, max(pause_s - move_s, 0.0)
        aim[w, 0], aim[w, 1] = worlds.track_aim[w, track[w], 0], worlds.track_aim[w, track[w], 1]
    return WeederPlan(kind, chosen, track, worlds.place.copy(), target, aim, worlds.cart.copy(), speed, phases_s)


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
    rewards, terminated, truncated = np.zeros((n, 4)), np.empty(n, np.bool_), np.empty(n, np.bool_)
    for w in range(n):
        kind, totals = plan.kind[w], worlds.totals[w]
        elapsed = 0.0
        for phase in range(phases_s.shape[1]):
            elapsed += phases_s[w, phase]
            worlds.phases_s[w, phase] += phases_s[w, phase]
        totals[TIME] += elapsed
        rewards[w, 2] = elapsed * tables.weights[2]
        if kind < WAIT:
            killed, crops = treat(tables, work, worlds, w, kind, plan.track[w], hit[w, 0], hit[w, 1])
            rewards[w, 0], rewards[w, 1] = killed * tables.weights[0], crops * tables.weights[1]
            rewards[w, 3] = tables.energy_j[kind] * tables.weights[3]
            worlds.slot_track[w, plan.slot[w]] = empty
        elif kind == NOTHING:
            totals[ILLEGAL] += 1.0
        way, worlds.speed[w] = way_of(plan.speed[w, 0], plan.speed[w, 1], tables.acceleration_m_s2, elapsed)
        worlds.cart[w] += way
        worlds.set_speed[w] = plan.speed[w, 1]
        for axis in range(3):
            worlds.place[w, axis] = plan.target[w, axis]
        move_up(tables, worlds, w)
        # Behind the strip's end the front camera sees nothing new: without tracks, none will come.
        nothing_left = worlds.slot_track[w, 0] == empty and worlds.cart[w] + tables.blind_m > tables.end_m
        terminated[w] = worlds.cart[w] >= tables.end_m or nothing_left
        truncated[w] = totals[TIME] >= tables.time_limit_s and not terminated[w]
    return StepResult(rewards, phases_s, terminated, truncated)


@compiled
def treat(
    tables: Tables, work: Any, worlds: Worlds, w: int, mode: int, track: int, along_m: float, across_m: float
) -> tuple[float, float]:
    """Work on a place and whatever grows within the tool's reach of it; gives the weeds and crop plants that die."""
    totals = worlds.totals[w]
    killed = 0.0
    # Weeds are sorted along: from the nearest to the aim to both sides, as far as the tool reaches.
    middle = PAD + worlds.track_near[w, track, 0]
    i = middle
    while along_m - worlds.plant[w, i, 0] <= work.reach_m and i > 0:
        killed += strike(work, worlds, w, mode, i, along_m, across_m)
        i -= 1
    i = middle + 1
    while worlds.plant[w, i, 0] - along_m <= work.reach_m and i < tables.weeds_end:
        killed += strike(work, worlds, w, mode, i, along_m, across_m)
        i += 1
    crops = 0.0
    nearest = tables.weeds_end + worlds.track_near[w, track, 1]
    for i in range(nearest - 1, nearest + 2):
        crops += strike(work, worlds, w, mode, i, along_m, across_m)
    totals[KILLED] += killed
    totals[CROP] += crops
    totals[SHOTS] += 1.0
    totals[JOULES] += tables.energy_j[mode]
    totals[LAST] = totals[TIME]
    if not worlds.track_real[w, track]:
        totals[BLANKS] += 1.0
    return killed, crops


@compiled
def strike(work: Any, worlds: Worlds, w: int, mode: int, plant: int, along_m: float, across_m: float) -> float:
    """Add the work's dose on one plant; gives 1 when it dies of it."""
    along = worlds.plant[w, plant, 0] - along_m
    if abs(along) > work.reach_m:
        return 0.0
    across = worlds.plant[w, plant, 1] - across_m
    if abs(across) > work.reach_m:
        return 0.0
    before, limit = worlds.plant_dose[w, plant], worlds.plant_tolerance[w, plant]
    after = before + dose(work, mode, along, across, worlds.plant_kind[w, plant])
    worlds.plant_dose[w, plant] = after
    return 1.0 if before < limit <= after else 0.0


@compiled
def move_up(tables: Tables, worlds: Worlds, w: int) -> None:
    """Drop what has left the window, close the gaps, and let the tracks that are known by now move up."""
    slots, empty = worlds.slot_track.shape[1], worlds.track_real.shape[1] - 1
    exit_m = worlds.cart[w] - tables.exit_m
    filled = 0
    for k in range(slots):
        track = worlds.slot_track[w, k]
        if track != empty and worlds.track_report[w, track, 0] >= exit_m:
            worlds.slot_track[w, filled] = track
            filled += 1
    known_m = worlds.cart[w] - worlds.speed[w] * tables.delay_s
    cursor = worlds.cursor[w]
    while filled < slots and cursor < worlds.track_count[w]:
        # Tracks that left while the slots were full are passed over.
        if worlds.track_report[w, cursor, 0] >= exit_m:
            if worlds.track_known_m[w, cursor] > known_m:
                break
            worlds.slot_track[w, filled] = cursor
            filled += 1
        cursor += 1
    worlds.cursor[w] = cursor
    for k in range(filled, slots):
        worlds.slot_track[w, k] = empty


@compiled
def move_up_rows(tables: Tables, worlds: Worlds, rows: NDArray[np.int64]) -> None:
    """``move_up`` in the worlds ``rows``."""
    for w in rows:
        move_up(tables, worlds, w)
