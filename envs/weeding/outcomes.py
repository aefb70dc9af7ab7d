"""What a shot at a track does on average, by what is reported of it: tables that planners reckon with.

A planner sees reports, not plants: a track may be false, its kind and place may be wrong, and what stands beside it
is hit too. How often what dies is measured here on drawn strips, with the statistics of the cameras. Of a plant's luck
the mean is taken (its tolerance is logistic, see ``response``), of places, kinds and recall a sample.

Every weed *belongs* to the nearest report, so that what a shot kills is counted once: what belongs to its own track or
to none is its own, the rest is beside it. A kill is what the weed counts, see ``ScenarioConfig.worth``.
"""

from __future__ import annotations

import hashlib
import json
import math
from functools import lru_cache
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled
from ...kernels.config_fields import plain
from ...kernels.seeds import OUTCOMES
from ...simulation.assets import asset_text
from ..arrays import allocated, shaped
from ..core import Array
from ..dice import draw_blocks
from .batch import Plants, Tracks
from .config import SPECIES, STAGES, FieldTask
from .drawing import Strip, draw_plants
from .perception import PerceptionModel
from .process import WeedingProcess, dose
from .response import Response
from .sighting import Cameras, draw_tracks
from .state import CROP_KIND, MODES
from .timing import G

KINDS = len(SPECIES) * len(STAGES)
CROP_GAPS_M = (0.015, 0.030, 0.050, 0.065, 0.080, 0.110)
"""Ascending distances to the nearest crop plant that part the classes of own kills."""
NEIGHBOUR_GAPS_M = (0.006, 0.012, 0.020, 0.030, 0.050)
"""The same for the nearest other report."""
CONFIDENCES = (0.4, 0.7, 0.84)
"""The same for how sure the cameras are: of six pictures all, all but one, and many fewer."""
STEP_M, STEPS = 0.005, 10
"""Distances between two reports are told apart in steps; farther ones have nothing to do with each other."""
CROP_STEP_M, CROP_STEPS = 0.0025, 32
"""The same between a report and the nearest crop plant, for what crop plants suffer."""
FAR_M = STEP_M * STEPS
SHIPPED = "outcomes/weeding.json"
STRIPS = 400
"""Strips that tables are measured on where none ship."""
_TRUST = 20.0
"""A class of own kills counts as if so many samples had the mean of all that are as sure."""
_TOGETHER = 50
"""Strips that are drawn together."""


class Outcomes(NamedTuple):
    """Expected outcomes of shots by reported kind, ``3 species + stage``, and by mode.

    Attributes:
        own: (kinds, crop gaps, neighbour gaps, confidences, modes), kills among what belongs to the track.
        own_count: (kinds, crop gaps, neighbour gaps, confidences), samples behind it.
        beside: (kinds, steps, confidences, modes), kills of a shot so far away among what belongs to a track.
        beside_count: (kinds, steps, confidences).
        after: (kinds, steps, modes before, modes), share of a track's own kills that a shot so far away leaves.
        left: (kinds, steps, own modes, modes), kills of a shot so far away among what a shot at the track has left.
        harm: (crop steps, modes), crop plants that die.
        harm_count: (crop steps,).
        per_m: (1,), reports a metre.
    """

    own: Array
    own_count: Array
    beside: Array
    beside_count: Array
    after: Array
    left: Array
    harm: Array
    harm_count: Array
    per_m: Array


class Sums(NamedTuple):
    """What is added up; see ``Outcomes``. The leading axis has length 1."""

    own: Annotated[Array, shaped("kinds", "crops", "neighbours", "confidences", "modes")]
    own_count: Annotated[Array, shaped("kinds", "crops", "neighbours", "confidences")]
    beside: Annotated[Array, shaped("kinds", "steps", "confidences", "modes")]
    beside_count: Annotated[Array, shaped("kinds", "steps", "confidences")]
    alone: Annotated[Array, shaped("kinds", "steps", "modes")]
    """Kills among what belongs to a track where nothing was done before; ``after`` is a share of it."""
    after: Annotated[Array, shaped("kinds", "steps", "modes", "modes")]
    left: Annotated[Array, shaped("kinds", "steps", "modes", "modes")]
    harm: Annotated[Array, shaped("crop_steps", "modes")]
    harm_count: Annotated[Array, shaped("crop_steps")]


SIZES = {
    "kinds": KINDS,
    "crops": len(CROP_GAPS_M) + 1,
    "neighbours": len(NEIGHBOUR_GAPS_M) + 1,
    "confidences": len(CONFIDENCES) + 1,
    "steps": STEPS,
    "crop_steps": CROP_STEPS,
    "modes": MODES,
}


@compiled
def class_of(edges: tuple[float, ...], value: float) -> int:
    """How many of the ascending edges a value has reached."""
    reached = 0
    for edge in edges:
        if value >= edge:
            reached += 1
    return reached


@compiled
def crop_step(gap_m: float) -> int:
    """Row of ``Outcomes.harm``."""
    return min(int(gap_m / CROP_STEP_M), CROP_STEPS - 1)


@compiled
def share_killed(response: Response, species: int, stage: int, arrives: float) -> float:
    """Probability that a dose kills a weed."""
    if arrives <= 0.0:
        return 0.0
    half = response.half * response.stage_factor[stage] * (response.grass_factor if species == 1 else 1.0)
    return 1.0 / (1.0 + math.pow(half / arrives, response.slope))


@compiled
def belongs(plants: Plants, tracks: Tracks, r: int, weeds: int, owner: NDArray[np.int64]) -> None:
    """Write the track that each weed of a world belongs to; -1 where none is within ``FAR_M``."""
    report = tracks.report[r]
    for i in range(weeds):
        nearest_m, owner[i] = FAR_M, -1
        for k in range(tracks.count[r]):
            along = report[k, G.along] - plants.weed[r, i, G.along]
            if abs(along) < nearest_m:
                gap_m = math.hypot(along, report[k, G.across] - plants.weed[r, i, G.across])
                if gap_m < nearest_m:
                    nearest_m, owner[i] = gap_m, k


@compiled
def tally(work: Any, response: Response, worth: Array, plants: Plants, tracks: Tracks, sums: Sums) -> None:
    """Add what shots at all tracks of R worlds would do, each by itself and after one at a neighbour.

    ``worth`` (species, stage) is what weeds count.
    """
    room = plants.exists.shape[1]
    owner, first, second = np.empty(room, np.int64), np.empty(MODES), np.empty(MODES)
    for r in range(len(tracks.count)):
        weeds, n, report, aim = 0, tracks.count[r], tracks.report[r], tracks.aim[r]
        while weeds < room and plants.exists[r, weeds]:
            weeds += 1
        belongs(plants, tracks, r, weeds, owner)
        for k in range(n):
            kind = 3 * tracks.species[r, k] + tracks.stage[r, k]
            neighbour_m = np.inf
            for j in range(n):
                along = report[j, G.along] - report[k, G.along]
                if j != k and abs(along) < FAR_M:
                    gap_m = math.hypot(along, report[j, G.across] - report[k, G.across])
                    neighbour_m = min(neighbour_m, gap_m)
                    if gap_m < FAR_M:
                        of = 3 * tracks.species[r, j] + tracks.stage[r, j]
                        known = class_of(CONFIDENCES, tracks.confidence[r, j])
                        sums.beside_count[0, of, int(gap_m / STEP_M), known] += 1.0
            crop, near = class_of(CROP_GAPS_M, tracks.crop_gap_m[r, k]), class_of(NEIGHBOUR_GAPS_M, neighbour_m)
            sure = class_of(CONFIDENCES, tracks.confidence[r, k])
            sums.own_count[0, kind, crop, near, sure] += 1.0
            step = crop_step(tracks.crop_gap_m[r, k])
            sums.harm_count[0, step] += 1.0
            for c in range(plants.crop.shape[1]):
                along, across = (
                    plants.crop[r, c, G.along] - aim[k, G.along],
                    plants.crop[r, c, G.across] - aim[k, G.across],
                )
                if abs(along) <= work.reach_m and abs(across) <= work.reach_m:
                    for mode in range(MODES):
                        arrives = dose(work, mode, along, across, CROP_KIND)
                        if arrives > 0.0:
                            taken = 1.0 + math.pow(response.crop_half / arrives, response.crop_slope)
                            sums.harm[0, step, mode] += 1.0 / taken
            for i in range(weeds):
                along, across = (
                    plants.weed[r, i, G.along] - aim[k, G.along],
                    plants.weed[r, i, G.across] - aim[k, G.across],
                )
                if abs(along) > work.reach_m or abs(across) > work.reach_m:
                    continue
                species, stage, j = plants.species[r, i], plants.stage[r, i], owner[i]
                apart_m = 0.0
                if j >= 0 and j != k:
                    apart_m = math.hypot(
                        report[j, G.along] - report[k, G.along], report[j, G.across] - report[k, G.across]
                    )
                for mode in range(MODES):
                    first[mode] = dose(work, mode, along, across, stage)
                    killed = worth[species, stage] * share_killed(response, species, stage, first[mode])
                    if j < 0 or j == k or apart_m >= FAR_M:
                        sums.own[0, kind, crop, near, sure, mode] += killed
                    else:
                        of = 3 * tracks.species[r, j] + tracks.stage[r, j]
                        known = class_of(CONFIDENCES, tracks.confidence[r, j])
                        sums.beside[0, of, int(apart_m / STEP_M), known, mode] += killed
                if j == k:
                    both(work, response, float(worth[species, stage]), plants, tracks, r, k, i, first, second, sums)


@compiled
def both(
    work: Any,
    response: Response,
    worth: float,
    plants: Plants,
    tracks: Tracks,
    r: int,
    k: int,
    i: int,
    own: Array,
    other: Array,
    sums: Sums,
) -> None:
    """Add what a shot at track ``k`` and one at each of its neighbours do to weed ``i``, which belongs to ``k``.

    ``own`` (M,) holds the doses of the first, ``other`` is written; ``worth`` is what the weed counts.
    """
    species, stage = plants.species[r, i], plants.stage[r, i]
    kind = 3 * tracks.species[r, k] + tracks.stage[r, k]
    for j in range(tracks.count[r]):
        along = tracks.report[r, j, G.along] - tracks.report[r, k, G.along]
        if j == k or abs(along) >= FAR_M:
            continue
        gap_m = math.hypot(along, tracks.report[r, j, G.across] - tracks.report[r, k, G.across])
        if gap_m >= FAR_M:
            continue
        step = int(gap_m / STEP_M)
        along = plants.weed[r, i, G.along] - tracks.aim[r, j, G.along]
        across = plants.weed[r, i, G.across] - tracks.aim[r, j, G.across]
        within = abs(along) <= work.reach_m and abs(across) <= work.reach_m
        for mode in range(MODES):
            other[mode] = dose(work, mode, along, across, stage) if within else 0.0
        for mode in range(MODES):
            sums.alone[0, kind, step, mode] += worth * share_killed(response, species, stage, own[mode])
            for before in range(MODES):
                gone = share_killed(response, species, stage, other[before])
                more = share_killed(response, species, stage, other[before] + own[mode]) - gone
                sums.after[0, kind, step, before, mode] += worth * more
                gone = share_killed(response, species, stage, own[before])
                more = share_killed(response, species, stage, own[before] + other[mode]) - gone
                sums.left[0, kind, step, before, mode] += worth * more


def measured(config: FieldTask, perception: PerceptionModel, process: WeedingProcess, strips: int = STRIPS) -> Outcomes:
    """The tables of a tool and cameras on level ground, from so many drawn strips."""
    scenario = config.scenario
    strip, cameras = Strip.of(scenario), Cameras.of(scenario, config.cart, perception)
    lengths = (*strip.random_numbers, *cameras.random_numbers(scenario.max_weeds))
    worth = np.array(scenario.worth, float)
    sums, seeds = allocated(Sums, 1, **SIZES), OUTCOMES.take(strips)
    for begin in range(0, strips, _TOGETHER):
        generators = [np.random.default_rng(seed) for seed in seeds[begin : begin + _TOGETHER]]
        uniform, normal, camera_uniform, camera_normal = draw_blocks(generators, lengths)
        plants = draw_plants(strip, uniform, normal)
        tracks = draw_tracks(cameras, plants, camera_uniform, camera_normal)
        tally(process.work, process.response, worth, plants, tracks, sums)
    return averaged(sums, strips * scenario.strip_m)


def averaged(sums: Sums, strip_m: float) -> Outcomes:
    """Means of what was added up on so many metres."""
    totals = Sums(*(values[0] for values in sums))
    kinds = totals.own.sum(axis=(1, 2, 3)) / np.maximum(totals.own_count.sum(axis=(1, 2, 3)), 1.0)[:, None]
    # Classes lean on the mean of what is as sure, and that on the mean of its kind.
    count = totals.own_count.sum(axis=(1, 2))[..., None]
    alike = (totals.own.sum(axis=(1, 2)) + _TRUST * kinds[:, None]) / (count + _TRUST)
    own = (totals.own + _TRUST * alike[:, None, None]) / (totals.own_count[..., None] + _TRUST)
    pairs = np.maximum(totals.beside_count.sum(axis=2), 1.0)
    together = totals.beside.sum(axis=2) / pairs[..., None]
    beside = (totals.beside + _TRUST * together[:, :, None]) / (totals.beside_count[..., None] + _TRUST)
    alone = totals.alone[:, :, None]
    after = np.where(alone > 0.0, totals.after / np.where(alone > 0.0, alone, 1.0), 1.0)
    harm = totals.harm / np.maximum(totals.harm_count, 1.0)[:, None]
    return Outcomes(
        own,
        totals.own_count,
        beside,
        totals.beside_count,
        after,
        totals.left / pairs[..., None, None],
        harm,
        totals.harm_count,
        np.array([totals.own_count.sum() / strip_m]),
    )


def key_of(config: FieldTask, perception: PerceptionModel, process: WeedingProcess) -> str:
    """Digest of everything that tables depend on, 16 digits."""
    scenario = plain(config.scenario)
    for name in ("offered_load", "demanded", "leaves_count", "leaf_radius_m", "energy_j", "drives", "ground", "name"):
        scenario.pop(name, None)
    told = [scenario, config.cart.unseen_m, plain(perception), process.work, process.response]
    return hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:16]


@lru_cache(maxsize=1)
def shipped() -> dict[str, dict[str, Any]]:
    """The tables that ship, by key."""
    return {entry["key"]: entry for entry in json.loads(asset_text(SHIPPED))["tables"]}


@lru_cache(maxsize=16)
def _outcomes(key: str) -> Outcomes | None:
    entry = shipped().get(key)
    return None if entry is None else Outcomes(*(np.array(entry[name], np.float64) for name in Outcomes._fields))


_MEASURED: dict[str, Outcomes] = {}


def outcomes_of(config: FieldTask, perception: PerceptionModel, process: WeedingProcess) -> Outcomes:
    """The tables of a configuration: those that ship, or fresh ones where none do."""
    key = key_of(config, perception, process)
    found = _outcomes(key) or _MEASURED.get(key)
    if found is None:
        found = _MEASURED[key] = measured(config, perception, process)
    return found
