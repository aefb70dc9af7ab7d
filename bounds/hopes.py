"""What a weeding tool's shots do on average, given all that is reported: options for a bound in expectation.

A policy sees reports and never what a shot did. So nobody gets more on average than the means of what shots do, given
the reports, add up to: they take the place of the luck (see the package). The means are those of measured tables
(``envs.weeding.outcomes``): what belongs to a track dies by its own shot, by those at tracks beside it, or by both.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..envs.weeding.features import CROP_GAP_SCALE_M, L
from ..envs.weeding.outcomes import (
    CONFIDENCES,
    CROP_GAPS_M,
    CROWD_M,
    CROWDS,
    FAR_M,
    NEIGHBOUR_GAPS_M,
    STEP_M,
    Outcomes,
    class_of,
    crop_step,
)
from ..envs.weeding.state import MODES, R
from .shots import Option, Shots, in_row, undominated

Array = NDArray[np.float64]

FAINT = 1e-3
"""Kills on average below which a shot at one track is not followed up at another, but granted."""
_EVEN = 0.5
"""Chance up to which doses on a crop plant add up to more than their chances do: a logistic is steep there."""


def hoped_shots(core: Any, row: int, tables: Outcomes) -> Shots:
    """Options of the tracks that lie in the rules, by what they kill on average.

    Things are first the tracks, served once each and whole, then what belongs to those with others beside them, which
    shots kill by shares and which cannot die more than once. So that a track is served once, a shot at it pays in
    advance for the most that it may bring (``Shots.advance``).

    Args:
        core: the rules.
        row: the world.
        tables: what shots do on average.
    """
    state = core.state
    n = int(state.track_count[row])
    aim, told, feature = (part[row, :n] for part in (state.track_aim, state.track_report, state.track_feature))
    kind = 3 * (feature[:, L.grass] > 0.5) + feature[:, L.cotyledon : L.four_leaf + 1].argmax(axis=1)
    crop_gap_m = feature[:, L.crop_gap].astype(float) * CROP_GAP_SCALE_M
    sure = feature[:, L.confidence].astype(float)
    apart_m = np.hypot(*np.moveaxis(told[:, None] - told[None], -1, 0))
    np.fill_diagonal(apart_m, np.inf)
    nearest_m = apart_m.min(axis=1, initial=np.inf)
    others, known = (apart_m < CROWD_M).sum(axis=1), [class_of(CONFIDENCES, value) for value in sure.tolist()]
    own = np.array(
        [
            tables.own[
                kind[k],
                class_of(CROP_GAPS_M, crop_gap_m[k]),
                class_of(NEIGHBOUR_GAPS_M, nearest_m[k]),
                known[k],
                class_of(CROWDS, others[k]),
            ]
            for k in range(n)
        ]
    ).reshape(n, MODES)
    # Of each track what shots at it and at others kill, and the most that all of them together do.
    kills: list[dict[int, Array]] = [{k: own[k]} for k in range(n)]
    most, faint = own.max(axis=1, initial=0.0), np.zeros((n, MODES))
    for j in range(n):
        left = np.zeros(MODES)
        for k in np.flatnonzero(apart_m[j] < FAR_M).tolist():
            step = int(apart_m[j, k] / STEP_M)
            # Before its own shot or after it, whatever is more.
            beside = np.maximum(
                tables.beside[kind[j], step, known[j], known[k]] * own[j],
                tables.left[kind[j], step, known[j]].max(axis=0),
            )
            if beside.max() > FAINT:
                kills[j][k] = beside
            else:
                faint[k] += beside
            left += tables.left[kind[j], step, known[j]].max(axis=1)
        most[j] = max((own[j] + left).max(), *(float(shot.max()) for shot in kills[j].values()))
    shared = [j for j in range(n) if len(kills[j]) > 1]
    place = {j: n + i for i, j in enumerate(shared)}
    brings = faint.copy()
    for j in range(n):
        for k, shot in kills[j].items():
            brings[k] += shot
    top = brings.max(axis=1, initial=0.0)
    cost = -float(core.tables.weights[R.crop]) * harmed(core, row, tables, crop_gap_m)
    cost -= float(core.tables.weights[R.energy]) * core.tables.energy_j
    options: list[Option] = []
    for k in range(n):
        ways = []
        for mode in np.flatnonzero(brings[k] > FAINT).tolist():
            shares = {k: 1.0}
            # What a mode cannot kill it does not serve, and a share of nothing has no price.
            shares |= {
                place[j]: float(kills[j][k][mode] / most[j])
                for j in shared
                if k in kills[j] and kills[j][k][mode] > 0.0
            }
            apart = float(faint[k, mode]) + (0.0 if k in place else float(own[k, mode]))
            stand_s, energy_j = float(core.tables.stand_s[mode]), float(core.tables.energy_j[mode])
            paid = float(top[k]) - apart
            ways.append(Option(told[k], aim[k], 0.0, stand_s, float(cost[k, mode]), energy_j, shares, k, mode, paid))
        options += undominated(ways)
    worth = np.concatenate([top, most[shared]])
    return in_row(options, worth, whole=np.arange(len(worth)) < n)


def harmed(core: Any, row: int, tables: Outcomes, crop_gap_m: Array) -> Array:
    """Crop plants (n, M) that shots at the tracks kill at least, on average.

    Doses of several shots on one plant add up, and their chances with them as long as those are small; where they are
    not, each track carries its part of what at least one does.
    """
    state, n = core.state, len(crop_gap_m)
    harm = np.array([tables.harm[crop_step(gap)] for gap in crop_gap_m.tolist()]).reshape(n, MODES)
    crops = state.plant[row, core.tables.weeds_end :]
    told = state.track_report[row, :n]
    nearest = np.hypot(*np.moveaxis(told[:, None] - crops[None], -1, 0)).argmin(axis=1) if n else np.zeros(0, int)
    for crop in set(nearest.tolist()):
        here = nearest == crop
        chance = harm[here].max(axis=1)
        most = max(_EVEN, float(chance.max()))
        harm[here] *= min(1.0, most / max(float(chance.sum()), 1e-12))
    return harm
