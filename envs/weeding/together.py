"""What a shot at one of several reports kills all together, against the sum of what is believed of each of them.

Tables of outcomes (``outcomes``) are means of one report at a time. Reports near each other may be of one weed: where
all are likely their sum is too much, where all are unlikely it is too little, since one of them stands for something.
And who shoots at the best of several reports picks what the tables promise too much of with it. So sums are held here
to what they bring on drawn strips, by their two parts and by whether a report near promises more.
"""

from __future__ import annotations

import json
import math
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled
from ...kernels.seeds import OUTCOMES
from ...simulation.assets import asset_text
from ..core import Array
from ..dice import draw_blocks
from .batch import Plants, Tracks
from .config import FieldTask
from .drawing import Strip, draw_plants
from .outcomes import (
    CONFIDENCES,
    CROP_GAPS_M,
    CROWD_M,
    CROWDS,
    FAR_M,
    KINDS,
    NEIGHBOUR_GAPS_M,
    STEP_M,
    STEPS,
    Outcomes,
    class_of,
    key_of,
    share_killed,
)
from .perception import PerceptionModel
from .process import WeedingProcess, dose
from .response import Response
from .sighting import Cameras, draw_tracks
from .state import MODES
from .timing import G

OWNS = (0.15, 0.45, 0.75, 0.92, 0.97, 1.03, 1.1)
"""Ascending kills among what belongs to a report that part classes of sums."""
BESIDES = (1e-6, 0.1, 0.35, 0.65, 0.85, 0.95, 1.1, 1.5, 1.8, 2.2, 2.8, 3.6)
"""The same beside it."""
REMAINS = (0.05, 0.1, 0.2, 0.35, 0.6, 0.85, 1.1)
"""The same of what a shot at one report still kills after one at another."""
SHIPPED_SUMS = "outcomes/together.json"
_TRUST = 50.0
"""A class counts as if so many kills more had been believed, and the share of all kinds of them had happened."""
_BATCH = 50
"""Strips that are drawn together."""


class Shares(NamedTuple):
    """What happens, as a share of what sums of beliefs say.

    Attributes:
        first: (kinds, 2, own kills, kills beside, modes), by the reported kind and by whether a report near promises
            more (0) or none does (1), of shots where there was none before.
        second: (kinds, steps, remains, modes before, modes), by how far away the shot before was and by how much is
            believed.
    """

    first: Array
    second: Array

    @classmethod
    def filled(cls, value: float) -> Shares:
        """One value everywhere."""
        return cls(
            np.full((KINDS, 2, len(OWNS) + 1, len(BESIDES) + 1, MODES), value),
            np.full((KINDS, STEPS, len(REMAINS) + 1, MODES, MODES), value),
        )


@compiled
def add_up(
    work: Any,
    response: Response,
    worth: Array,
    tables: Outcomes,
    plants: Plants,
    tracks: Tracks,
    believed: Shares,
    happened: Shares,
) -> None:
    """Add what shots at all tracks of R worlds are believed to kill, and what they do, alone and as second ones.

    Second ones come after the one at a report within ``FAR_M`` that promises at least as much. ``worth`` (species,
    stage) is what weeds count.
    """
    room = tracks.report.shape[1]
    kind, sure = np.empty(room, np.int64), np.empty(room, np.int64)
    own, whole = np.empty((room, MODES)), np.empty((room, MODES))
    apart_m = np.empty((room, room))
    killed, more, remains = np.empty(MODES), np.empty((MODES, MODES)), np.empty((MODES, MODES))
    for r in range(len(tracks.count)):
        n = tracks.count[r]
        look_up(tables, tracks, r, kind, sure, own, whole, apart_m)
        for k in range(n):
            kills_of(work, response, worth, plants, tracks, r, k, k, killed, more)
            for mode in range(MODES):
                best = 1
                for j in range(n):
                    if apart_m[k, j] < FAR_M and whole[j, mode] > whole[k, mode]:
                        best = 0
                c, d = class_of(OWNS, own[k, mode]), class_of(BESIDES, whole[k, mode] - own[k, mode])
                believed.first[kind[k], best, c, d, mode] += whole[k, mode]
                happened.first[kind[k], best, c, d, mode] += killed[mode]
            for s in range(n):
                if s == k or not apart_m[k, s] < FAR_M:
                    continue
                step = int(apart_m[k, s] / STEP_M)
                kills_of(work, response, worth, plants, tracks, r, k, s, killed, more)
                for before in range(MODES):
                    for mode in range(MODES):
                        remains[before, mode] = tables.left[kind[s], step, sure[s], before, mode]
                        remains[before, mode] += own[k, mode] * tables.after[kind[k], step, sure[k], before, mode]
                for j in range(n):
                    if j == k or j == s or not apart_m[k, j] < FAR_M:
                        continue
                    for before in range(MODES):
                        for mode in range(MODES):
                            share = tables.beside[kind[j], int(apart_m[k, j] / STEP_M), sure[j], sure[k], mode]
                            if apart_m[j, s] < FAR_M:
                                share *= tables.after[kind[j], int(apart_m[j, s] / STEP_M), sure[j], before, mode]
                            remains[before, mode] += share * own[j, mode]
                for before in range(MODES):
                    if whole[s, before] < whole[k, before]:
                        continue
                    for mode in range(MODES):
                        c = class_of(REMAINS, remains[before, mode])
                        believed.second[kind[k], step, c, before, mode] += remains[before, mode]
                        happened.second[kind[k], step, c, before, mode] += more[before, mode]


@compiled
def look_up(
    tables: Outcomes,
    tracks: Tracks,
    r: int,
    kind: NDArray[np.int64],
    sure: NDArray[np.int64],
    own: Array,
    whole: Array,
    apart_m: Array,
) -> None:
    """Write what is believed of a world's tracks: own kills and their sum with those beside, and all distances."""
    n, report = tracks.count[r], tracks.report[r]
    for k in range(n):
        kind[k] = 3 * tracks.species[r, k] + tracks.stage[r, k]
        sure[k] = class_of(CONFIDENCES, tracks.confidence[r, k])
        nearest_m, others = np.inf, 0
        for j in range(n):
            along = report[j, G.along] - report[k, G.along]
            apart_m[k, j] = np.inf
            if j != k and abs(along) < CROWD_M:
                apart_m[k, j] = math.hypot(along, report[j, G.across] - report[k, G.across])
                nearest_m = min(nearest_m, apart_m[k, j])
                others += apart_m[k, j] < CROWD_M
        crop, near = class_of(CROP_GAPS_M, tracks.crop_gap_m[r, k]), class_of(NEIGHBOUR_GAPS_M, nearest_m)
        crowd = class_of(CROWDS, others)
        for mode in range(MODES):
            own[k, mode] = tables.own[kind[k], crop, near, sure[k], crowd, mode]
    for k in range(n):
        for mode in range(MODES):
            whole[k, mode] = own[k, mode]
        for j in range(n):
            if apart_m[k, j] < FAR_M:
                for mode in range(MODES):
                    share = tables.beside[kind[j], int(apart_m[k, j] / STEP_M), sure[j], sure[k], mode]
                    whole[k, mode] += share * own[j, mode]


@compiled
def kills_of(
    work: Any,
    response: Response,
    worth: Array,
    plants: Plants,
    tracks: Tracks,
    r: int,
    k: int,
    s: int,
    killed: Array,
    more: Array,
) -> None:
    """Write what shots at track ``k`` kill, (modes,), and after shots at ``s``, (modes before, modes)."""
    aim, weed = tracks.aim[r], plants.weed[r]
    for mode in range(MODES):
        killed[mode] = 0.0
        for before in range(MODES):
            more[before, mode] = 0.0
    for i in range(plants.exists.shape[1]):
        if not plants.exists[r, i]:
            break
        along, across = weed[i, G.along] - aim[k, G.along], weed[i, G.across] - aim[k, G.across]
        if abs(along) > work.reach_m or abs(across) > work.reach_m:
            continue
        species, stage = plants.species[r, i], plants.stage[r, i]
        first_along, first_across = weed[i, G.along] - aim[s, G.along], weed[i, G.across] - aim[s, G.across]
        within = abs(first_along) <= work.reach_m and abs(first_across) <= work.reach_m
        for mode in range(MODES):
            arrives = dose(work, mode, along, across, stage)
            killed[mode] += worth[species, stage] * share_killed(response, species, stage, arrives)
            if s == k:
                continue
            for before in range(MODES):
                there = dose(work, before, first_along, first_across, stage) if within else 0.0
                gone = share_killed(response, species, stage, there)
                both = share_killed(response, species, stage, there + arrives)
                more[before, mode] += worth[species, stage] * (both - gone)


def measured_sums(
    config: FieldTask, perception: PerceptionModel, process: WeedingProcess, tables: Outcomes, strips: int
) -> Shares:
    """What happens of what ``tables`` believe on level ground, on so many drawn strips."""
    scenario = config.scenario
    strip, cameras = Strip.of(scenario), Cameras.of(scenario, config.cart, perception)
    lengths = (*strip.random_numbers, *cameras.random_numbers(scenario.max_weeds))
    worth, seeds = np.array(scenario.worth, float), OUTCOMES.take(strips)
    believed, happened = Shares.filled(0.0), Shares.filled(0.0)
    for begin in range(0, strips, _BATCH):
        generators = [np.random.default_rng(seed) for seed in seeds[begin : begin + _BATCH]]
        uniform, normal, camera_uniform, camera_normal = draw_blocks(generators, lengths)
        plants = draw_plants(strip, uniform, normal)
        tracks = draw_tracks(cameras, plants, camera_uniform, camera_normal)
        add_up(process.work, process.response, worth, tables, plants, tracks, believed, happened)
    return Shares(*(_shares(one, other) for one, other in zip(happened, believed, strict=True)))


def _shares(happened: Array, believed: Array) -> Array:
    """What happened of what was believed, by classes whose first axis are kinds; rare ones lean on all kinds."""
    every = (happened.sum(axis=0) + _TRUST) / (believed.sum(axis=0) + _TRUST)
    return (happened + _TRUST * every) / (believed + _TRUST)


@lru_cache(maxsize=1)
def _shipped() -> dict[str, Shares]:
    entries = json.loads(asset_text(SHIPPED_SUMS))["tables"]
    return {entry["key"]: Shares(*(np.array(entry[name], float) for name in Shares._fields)) for entry in entries}


def sums_of(config: FieldTask, perception: PerceptionModel, process: WeedingProcess) -> Shares:
    """The shares that ship for a configuration; all 1 where none do."""
    return _shipped().get(key_of(config, perception, process)) or Shares.filled(1.0)


def set_right(
    shares: Shares,
    kind: NDArray[np.int64],
    own: Array,
    whole: Array,
    most: Array,
    mode: NDArray[np.int64],
    before_m: Array,
    before: NDArray[np.int64],
) -> Array:
    """What shots (B,) kill all together.

    Args:
        shares: of what is believed.
        kind: (B,), reported, see ``Outcomes``.
        own: (B,), believed kills among what belongs to the report itself.
        whole: (B,), the same with what is believed of those beside it.
        most: (B,), the largest sum that a report within ``FAR_M`` has.
        mode: (B,).
        before_m: (B,), how far away the nearest shot before was.
        before: (B,), its mode.
    """
    best = (most <= whole).astype(np.int64)
    itself, beside = np.searchsorted(OWNS, own, side="right"), np.searchsorted(BESIDES, whole - own, side="right")
    first, second = shares.first[kind, best, itself, beside, mode], before_m < FAR_M
    step = (np.where(second, before_m, 0.0) / STEP_M).astype(np.int64)
    then = shares.second[kind, step, np.searchsorted(REMAINS, whole, side="right"), before, mode]
    return whole * np.where(second, then, first)
