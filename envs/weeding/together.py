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
from typing import Any

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
SHIPPED_SUMS = "outcomes/together.json"
_TRUST = 50.0
"""A class counts as if so many kills more had been believed, and the share of all kinds of them had happened."""
_BATCH = 50
"""Strips that are drawn together."""


def classes() -> tuple[int, int, int, int, int]:
    """Of sums: reported kinds, whether a report near promises more or none does, own kills, kills beside, modes."""
    return KINDS, 2, len(OWNS) + 1, len(BESIDES) + 1, MODES


@compiled
def add_up(
    work: Any,
    response: Response,
    worth: Array,
    tables: Outcomes,
    plants: Plants,
    tracks: Tracks,
    believed: Array,
    happened: Array,
) -> None:
    """Add what shots at all tracks of R worlds are believed to kill, and what they do, by ``classes``.

    ``worth`` (species, stage) is what weeds count.
    """
    room = tracks.report.shape[1]
    kind, sure = np.empty(room, np.int64), np.empty(room, np.int64)
    own, whole = np.empty((room, MODES)), np.empty((room, MODES))
    apart_m = np.empty((room, room))
    killed = np.empty(MODES)
    for r in range(len(tracks.count)):
        n = tracks.count[r]
        look_up(tables, tracks, r, kind, sure, own, whole, apart_m)
        for k in range(n):
            kills_of(work, response, worth, plants, tracks, r, k, killed)
            for mode in range(MODES):
                best = 1
                for j in range(n):
                    if apart_m[k, j] < FAR_M and whole[j, mode] > whole[k, mode]:
                        best = 0
                c, d = class_of(OWNS, own[k, mode]), class_of(BESIDES, whole[k, mode] - own[k, mode])
                believed[kind[k], best, c, d, mode] += whole[k, mode]
                happened[kind[k], best, c, d, mode] += killed[mode]


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
    work: Any, response: Response, worth: Array, plants: Plants, tracks: Tracks, r: int, k: int, killed: Array
) -> None:
    """Write what shots at track ``k`` kill, (modes,)."""
    aim, weed = tracks.aim[r], plants.weed[r]
    for mode in range(MODES):
        killed[mode] = 0.0
    for i in range(plants.exists.shape[1]):
        if not plants.exists[r, i]:
            break
        along, across = weed[i, G.along] - aim[k, G.along], weed[i, G.across] - aim[k, G.across]
        if abs(along) <= work.reach_m and abs(across) <= work.reach_m:
            species, stage = plants.species[r, i], plants.stage[r, i]
            for mode in range(MODES):
                arrives = dose(work, mode, along, across, stage)
                killed[mode] += worth[species, stage] * share_killed(response, species, stage, arrives)


def measured_sums(
    config: FieldTask, perception: PerceptionModel, process: WeedingProcess, tables: Outcomes, strips: int
) -> Array:
    """Shares, by ``classes``, of what ``tables`` believe that happen on level ground, on so many drawn strips.

    Rare classes lean on those of all kinds.
    """
    scenario = config.scenario
    strip, cameras = Strip.of(scenario), Cameras.of(scenario, config.cart, perception)
    lengths = (*strip.random_numbers, *cameras.random_numbers(scenario.max_weeds))
    worth, seeds = np.array(scenario.worth, float), OUTCOMES.take(strips)
    believed, happened = np.zeros(classes()), np.zeros(classes())
    for begin in range(0, strips, _BATCH):
        generators = [np.random.default_rng(seed) for seed in seeds[begin : begin + _BATCH]]
        uniform, normal, camera_uniform, camera_normal = draw_blocks(generators, lengths)
        plants = draw_plants(strip, uniform, normal)
        tracks = draw_tracks(cameras, plants, camera_uniform, camera_normal)
        add_up(process.work, process.response, worth, tables, plants, tracks, believed, happened)
    every = (happened.sum(axis=0) + _TRUST) / (believed.sum(axis=0) + _TRUST)
    return (happened + _TRUST * every) / (believed + _TRUST)


@lru_cache(maxsize=1)
def _shipped() -> dict[str, Array]:
    return {entry["key"]: np.array(entry["share"], float) for entry in json.loads(asset_text(SHIPPED_SUMS))["tables"]}


def sums_of(config: FieldTask, perception: PerceptionModel, process: WeedingProcess) -> Array:
    """The shares that ship for a configuration; all 1 where none do."""
    found = _shipped().get(key_of(config, perception, process))
    return np.ones(classes()) if found is None else found


def set_right(
    shares: Array, kind: NDArray[np.int64], own: Array, whole: Array, most: Array, mode: NDArray[np.int64]
) -> Array:
    """What shots (B,) kill all together.

    Args:
        shares: see ``measured_sums``.
        kind: (B,), reported, see ``Outcomes``.
        own: (B,), believed kills among what belongs to the report itself.
        whole: (B,), the same with what is believed of those beside it.
        most: (B,), the largest sum that a report within ``FAR_M`` has.
        mode: (B,).
    """
    best = (most <= whole).astype(np.int64)
    itself, beside = np.searchsorted(OWNS, own, side="right"), np.searchsorted(BESIDES, whole - own, side="right")
    return shares[kind, best, itself, beside, mode] * whole
