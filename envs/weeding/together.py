"""What a shot at one of several reports kills all together, against the sum of what is believed of each of them.

Tables of outcomes (``outcomes``) are means of one report at a time. Reports near each other may be of one weed: where
all are likely their sum is too much, where all are unlikely it is too little, since one of them stands for something.
And who shoots at the best of several reports picks what the tables promise too much of with it. So sums are held here
to what they bring on drawn strips, by their two parts and by whether a report near promises more. Tips of a crop
plant's leaves are reported for weeds at some distances from it more often than the tables' few classes of them tell, so
that reports beside a crop plant are held to what they bring once more.

What a planner shoots at is no sample of what is reported: it takes what promises most, in the mode that promises most,
and a second shot depends on why the first was fired. So what is believed by then is held, coarsely, to what it brought
when the planner played.
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
TIPS_M = (0.015, 0.022, 0.030, 0.038, 0.050)
"""Ascending distances to the nearest crop plant that part classes of reports beside it."""
PLAYED = (0.2, 0.5, 0.75, 0.95, 1.05, 1.5)
"""Ascending kills in all that part classes of shots that a planner fired."""
SHIPPED_SUMS = "outcomes/together.json"
_TRUST = 50.0
"""A class counts as if so many kills more had been believed, and the share of all kinds of them had happened; beside
crop plants, as many as were believed."""
_TRUST_PLAYED = 20.0
"""The same where a planner played [chosen, with ``PLAYED``, on tuned seeds]."""
_BATCH = 50
"""Strips that are drawn together."""


class Shares(NamedTuple):
    """Which shares of what is believed of shots happen.

    Attributes:
        whole: (kinds, 2, own kills, kills beside, modes), by ``OWNS`` and ``BESIDES``; the second axis is whether a
            report near promises more (0) or none does.
        tips: (kinds, confidences, crop gaps, modes), of what is left of beliefs after that, by ``TIPS_M``.
        played: (kinds, 2, sums, modes), of what is left after both when a planner plays, by ``PLAYED``; the second axis
            is whether an own shot is remembered near by, which both others are not for.
    """

    whole: Array
    tips: Array
    played: Array

    @classmethod
    def plain(cls) -> Shares:
        """What is believed happens."""
        return cls(
            np.ones((KINDS, 2, len(OWNS) + 1, len(BESIDES) + 1, MODES)),
            np.ones((KINDS, len(CONFIDENCES) + 1, len(TIPS_M) + 1, MODES)),
            np.ones((KINDS, 2, len(PLAYED) + 1, MODES)),
        )


@compiled
def add_up(
    work: Any,
    response: Response,
    worth: Array,
    tables: Outcomes,
    shares: Shares,
    plants: Plants,
    tracks: Tracks,
    believed: Shares,
    happened: Shares,
) -> None:
    """Add what shots at all tracks of R worlds are believed to kill, and what they do.

    ``worth`` (species, stage) is what weeds count. Beside crop plants ``shares.whole`` of it is believed.
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
            tip = class_of(TIPS_M, tracks.crop_gap_m[r, k])
            for mode in range(MODES):
                best = 1
                for j in range(n):
                    if apart_m[k, j] < FAR_M and whole[j, mode] > whole[k, mode]:
                        best = 0
                c, d = class_of(OWNS, own[k, mode]), class_of(BESIDES, whole[k, mode] - own[k, mode])
                believed.whole[kind[k], best, c, d, mode] += whole[k, mode]
                happened.whole[kind[k], best, c, d, mode] += killed[mode]
                told = shares.whole[kind[k], best, c, d, mode] * whole[k, mode]
                believed.tips[kind[k], sure[k], tip, mode] += told
                happened.tips[kind[k], sure[k], tip, mode] += killed[mode]


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
) -> Shares:
    """Shares of what ``tables`` believe that happen on level ground, on so many drawn strips; ``played`` is all 1.

    Rare classes lean on those of all kinds, beside crop plants on what is believed.
    """
    scenario = config.scenario
    strip, cameras = Strip.of(scenario), Cameras.of(scenario, config.cart, perception)
    lengths = (*strip.random_numbers, *cameras.random_numbers(scenario.max_weeds))
    worth, seeds, shares = np.array(scenario.worth, float), OUTCOMES.take(strips), Shares.plain()

    def added() -> tuple[Shares, Shares]:
        believed, happened = (Shares(*(np.zeros_like(values) for values in shares)) for _ in range(2))
        for begin in range(0, strips, _BATCH):
            generators = [np.random.default_rng(seed) for seed in seeds[begin : begin + _BATCH]]
            uniform, normal, camera_uniform, camera_normal = draw_blocks(generators, lengths)
            plants = draw_plants(strip, uniform, normal)
            tracks = draw_tracks(cameras, plants, camera_uniform, camera_normal)
            add_up(process.work, process.response, worth, tables, shares, plants, tracks, believed, happened)
        return believed, happened

    believed, happened = added()
    shares = shares._replace(whole=_leaning(believed.whole, happened.whole, _TRUST))
    believed, happened = added()
    tips = (happened.tips + _TRUST) / (believed.tips + _TRUST)
    tips[:, :, len(TIPS_M)] = 1.0
    return shares._replace(tips=tips)


class Chosen(NamedTuple):
    """Shots that are told of, one a world.

    Attributes:
        kind: (B,), reported, see ``Outcomes``.
        mode: (B,).
        own: (B,), believed kills among what belongs to the report itself.
        whole: (B,), the same with what is believed of those beside it.
        most: (B,), the largest sum that a report within ``FAR_M`` has.
        confidence: (B,), how sure the cameras are of it.
        crop_gap_m: (B,), reported.
        touched: (B,), whether an own shot is remembered near by.
    """

    kind: NDArray[np.int64]
    mode: NDArray[np.int64]
    own: Array
    whole: Array
    most: Array
    confidence: Array
    crop_gap_m: Array
    touched: NDArray[np.bool_]


def measured_played(shares: Shares, shot: Chosen, killed: Array) -> Array:
    """``Shares.played`` from n shots that a planner fired and what each killed (n,).

    Rare classes lean on those of all kinds.
    """
    believed, happened = np.zeros_like(shares.played), np.zeros_like(shares.played)
    told = _before_play(shares, shot)
    place = _class_played(shot, told)
    np.add.at(believed, place, told)
    np.add.at(happened, place, killed)
    return _leaning(believed, happened, _TRUST_PLAYED)


def _before_play(shares: Shares, shot: Chosen) -> Array:
    best = (shot.most <= shot.whole).astype(np.int64)
    itself = np.searchsorted(OWNS, shot.own, side="right")
    beside = np.searchsorted(BESIDES, shot.whole - shot.own, side="right")
    sure = np.searchsorted(CONFIDENCES, shot.confidence, side="right")
    tip = np.searchsorted(TIPS_M, shot.crop_gap_m, side="right")
    share = shares.whole[shot.kind, best, itself, beside, shot.mode] * shares.tips[shot.kind, sure, tip, shot.mode]
    return np.where(shot.touched, 1.0, share) * shot.whole


def _class_played(shot: Chosen, told: Array) -> tuple[NDArray[np.int64], ...]:
    return shot.kind, shot.touched.astype(np.int64), np.searchsorted(PLAYED, told, side="right"), shot.mode


def _leaning(believed: Array, happened: Array, trust: float) -> Array:
    """Shares (kinds, ...) that lean, by so many kills, on those of all kinds."""
    every = (happened.sum(axis=0) + trust) / (believed.sum(axis=0) + trust)
    return (happened + trust * every) / (believed + trust)


@lru_cache(maxsize=1)
def _shipped() -> dict[str, Shares]:
    tables = json.loads(asset_text(SHIPPED_SUMS))["tables"]
    return {entry["key"]: Shares(*(np.array(entry[name], float) for name in Shares._fields)) for entry in tables}


def sums_of(config: FieldTask, perception: PerceptionModel, process: WeedingProcess) -> Shares:
    """The shares that ship for a configuration; all 1 where none do."""
    return _shipped().get(key_of(config, perception, process)) or Shares.plain()


def set_right(shares: Shares, shot: Chosen) -> Array:
    """What shots (B,) kill all together."""
    told = _before_play(shares, shot)
    return shares.played[_class_played(shot, told)] * told
