"""A schedule that knows everything, carried out by the weeding rules themselves: how near a bound can be reached."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np

from ..envs.weeding.core import WeederOutcome
from ..envs.weeding.process import dose
from ..envs.weeding.state import CROP_KIND, MODES, PAD, N, T
from ..envs.weeding.timing import G, Place, approach


def tended(core: Any, urgency: float) -> tuple[float, float]:
    """What the weeds killed count, and the return: of the shots that kill, always the one that is done soonest.

    Args:
        core: the rules of one world right after a reset; they stay as they are.
        urgency: seconds of work that a second less until a weed leaves is worth.
    """
    core = copy.deepcopy(core)
    state, tables, work, arm = core.state, core.tables, core.process.work, core.machine
    k, base = core.config.slots, core.base_actions
    total, over = 0.0, False
    kills: dict[int, tuple[int, int]] = {}
    while not over:
        mask = core.observe()["action_mask"][0, : base - 1].reshape(k, MODES)
        cart, speed = float(state.cart[0]), float(state.speed[0])
        best, action = np.inf, base - 1
        for slot in np.flatnonzero(mask.any(axis=1)).tolist():
            track = int(state.slot_track[0, slot])
            if track not in kills:
                kills[track] = _kill(state, work, track)
            mode, weed = kills[track]
            if mode < 0 or not mask[slot, mode] or state.plant_dose[0, weed] >= state.plant_tolerance[0, weed]:
                continue
            along, across = state.track_report[0, track, [G.along, G.across]].tolist()
            stand = float(tables.stand_s[mode])
            way = approach(arm, stand, Place(*state.place[0].tolist()), cart, speed, along, across)
            key = way.move_s + way.wait_s + stand + urgency * (along - cart) / speed
            if key < best:
                best, action = key, slot * MODES + mode
        plan = core.plan(np.array([action]))
        result = core.apply(plan, WeederOutcome(plan.phases_s, plan.aim))
        total += float(result.rewards.sum())
        over = bool(result.terminated[0] or result.truncated[0])
    return float(core.state.totals[0, T.worth]), total


def _kill(state: Any, work: Any, track: int) -> tuple[int, int]:
    """Lowest mode in which a track's shot kills a weed that stands near, and the weed; -1 where there is none."""
    aim = state.track_aim[0, track]
    middle = PAD + int(state.track_near[0, track, N.weed])
    for mode in range(MODES):
        for weed in range(max(middle - 3, 0), middle + 4):
            along, across = (state.plant[0, weed] - aim)[[G.along, G.across]].tolist()
            reached = abs(along) <= work.reach_m and state.plant_kind[0, weed] != CROP_KIND
            if reached and dose(work, mode, along, across, int(state.plant_kind[0, weed])) >= float(
                state.plant_tolerance[0, weed]
            ):
                return mode, weed
    return -1, 0
