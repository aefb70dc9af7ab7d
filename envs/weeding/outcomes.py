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
NEIGHBOUR_GAPS_M = (0.005, 0.010, 0.015, 0.020, 0.025, 0.030, 0.050)
"""The same for the nearest other report."""
CONFIDENCES = (0.3, 0.35, 0.4, 0.7, 0.84)
"""The same for how sure the cameras are: of six pictures all, all but one, and many fewer; learned eyes are least
sure of what is hardly ever there."""
CROWD_M = 0.12
CROWDS = (1, 2, 3, 5, 8)
"""The same for how many other reports lie within ``CROWD_M``: weeds stand in patches, false reports anywhere, so that
a report among many is more often true, and has more beside it that no camera has seen."""
STEP_M, STEPS = 0.005, 10
"""Distances between two reports are told apart in steps; farther ones have nothing to do with each other."""
CROP_STEP_M, CROP_STEPS = 0.0025, 32
"""The same between a report and the nearest crop plant, for what crop plants suffer."""
FAR_M = STEP_M * STEPS
SHIPPED = "outcomes/weeding.json"
STRIPS = 400
"""Strips that tables are measured on where none ship."""
_TRUST = 20.0
"""A class counts as if so many samples had the mean of a wider one, and that one likewise, see ``averaged``."""
_TOGETHER = 50
"""Strips that are drawn together."""


class Outcomes(NamedTuple):
    """Expected outcomes of shots by reported kind, ``3 species + stage``, and by mode.

    Attributes:
        own: (kinds, crop gaps, neighbour gaps, confidences, crowds, modes), kills among what belongs to the track.
        own_count: (kinds, crop gaps, neighbour gaps, confidences, crowds), samples behind it.
        beside: (kinds, steps, confidences, confidences, modes), what a shot so far away kills of what belongs to a
            track, as a share of the track's own kills, by how sure the cameras are of the track and of the one that is
            shot at.
        beside_count: (kinds, steps, confidences, confidences).
        after: (kinds, steps, confidences, modes before, modes), share of a track's own kills that a shot so far away
            leaves.
        left: (kinds, steps, confidences, own modes, modes), kills of a shot so far away among what a shot at the track
            has left.
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

    own: Annotated[Array, shaped("kinds", "crops", "neighbours", "confidences", "crowds", "modes")]
    own_count: Annotated[Array, shaped("kinds", "crops", "neighbours", "confidences", "crowds")]
    beside: Annotated[Array, shaped("kinds", "steps", "confidences", "confidences", "modes")]
    beside_count: Annotated[Array, shaped("kinds", "steps", "confidences", "confidences")]
    alone: Annotated[Array, shaped("kinds", "steps", "confidences", "confidences", "modes")]
    """Kills among what belongs to a track where nothing was done before; ``beside`` and ``after`` are shares of it."""
    after: Annotated[Array, shaped("kinds", "steps", "confidences", "modes", "modes")]
    left: Annotated[Array, shaped("kinds", "steps", "confidences", "modes", "modes")]
    harm: Annotated[Array, shaped("crop_steps", "modes")]
    harm_count: Annotated[Array, shaped("crop_steps")]


SIZES = {
    "kinds": KINDS,
    "crops": len(CROP_GAPS_M) + 1,
    "neighbours": len(NEIGHBOUR_GAPS_M) + 1,
    "confidences": len(CONFIDENCES) + 1,
    "crowds": len(CROWDS) + 1,
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
            sure = class_of(CONFIDENCES, tracks.confidence[r, k])
            neighbour_m, others = np.inf, 0
            for j in range(n):
                along = report[j, G.along] - report[k, G.along]
                if j != k and abs(along) < CROWD_M:
                    gap_m = math.hypot(along, report[j, G.across] - report[k, G.across])
                    neighbour_m = min(neighbour_m, gap_m)
                    others += gap_m < CROWD_M
                    if gap_m < FAR_M:
                        of = 3 * tracks.species[r, j] + tracks.stage[r, j]
                        known = class_of(CONFIDENCES, tracks.confidence[r, j])
                        sums.beside_count[0, of, int(gap_m / STEP_M), known, sure] += 1.0
            crop, near = class_of(CROP_GAPS_M, tracks.crop_gap_m[r, k]), class_of(NEIGHBOUR_GAPS_M, neighbour_m)
            crowd = class_of(CROWDS, others)
            sums.own_count[0, kind, crop, near, sure, crowd] += 1.0
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
                        sums.own[0, kind, crop, near, sure, crowd, mode] += killed
                    else:
                        of = 3 * tracks.species[r, j] + tracks.stage[r, j]
                        known = class_of(CONFIDENCES, tracks.confidence[r, j])
                        sums.beside[0, of, int(apart_m / STEP_M), known, sure, mode] += killed
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
    kind, sure = 3 * tracks.species[r, k] + tracks.stage[r, k], class_of(CONFIDENCES, tracks.confidence[r, k])
    for j in range(tracks.count[r]):
        along = tracks.report[r, j, G.along] - tracks.report[r, k, G.along]
        if j == k or abs(along) >= FAR_M:
            continue
        gap_m = math.hypot(along, tracks.report[r, j, G.across] - tracks.report[r, k, G.across])
        if gap_m >= FAR_M:
            continue
        step, other_sure = int(gap_m / STEP_M), class_of(CONFIDENCES, tracks.confidence[r, j])
        along = plants.weed[r, i, G.along] - tracks.aim[r, j, G.along]
        across = plants.weed[r, i, G.across] - tracks.aim[r, j, G.across]
        within = abs(along) <= work.reach_m and abs(across) <= work.reach_m
        for mode in range(MODES):
            other[mode] = dose(work, mode, along, across, stage) if within else 0.0
        for mode in range(MODES):
            sums.alone[0, kind, step, sure, other_sure, mode] += worth * share_killed(
                response, species, stage, own[mode]
            )
            for before in range(MODES):
                gone = share_killed(response, species, stage, other[before])
                more = share_killed(response, species, stage, other[before] + own[mode]) - gone
                sums.after[0, kind, step, sure, before, mode] += worth * more
                gone = share_killed(response, species, stage, own[before])
                more = share_killed(response, species, stage, own[before] + other[mode]) - gone
                sums.left[0, kind, step, sure, before, mode] += worth * more


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
    """Means of what was added up on so many metres.

    A class with few samples leans on a wider one: own kills on those of any crop gap, those on any that are as sure,
    those on their kind; shares beside a track and after a shot on all of its own confidence, those on its kind.
    """
    totals = Sums(*(values[0] for values in sums))
    own, samples = totals.own, totals.own_count[..., None]
    mean = _leaning(own.sum(axis=(1, 2, 3, 4), keepdims=True), samples.sum(axis=(1, 2, 3, 4), keepdims=True), 0.0)
    for apart in ((1, 2, 4), (1,), ()):
        mean = _leaning(own.sum(axis=apart, keepdims=True), samples.sum(axis=apart, keepdims=True), mean)
    alone = totals.alone
    lies = _share(totals.beside.sum(axis=(2, 3), keepdims=True), alone.sum(axis=(2, 3), keepdims=True), 0.0)
    for apart in ((3,), ()):
        lies = _share(totals.beside.sum(axis=apart, keepdims=True), alone.sum(axis=apart, keepdims=True), lies)
    # A pair counts once for each of the two.
    pairs = totals.beside_count.sum(axis=3)[..., None, None]
    left = _leaning(totals.left.sum(axis=2, keepdims=True), pairs.sum(axis=2, keepdims=True), 0.0)
    alone = alone.sum(axis=3)[:, :, :, None]
    after = _share(totals.after.sum(axis=2, keepdims=True), alone.sum(axis=2, keepdims=True), 1.0)
    harm = totals.harm / np.maximum(totals.harm_count, 1.0)[:, None]
    return Outcomes(
        mean,
        totals.own_count,
        lies,
        totals.beside_count,
        _share(totals.after, alone, after),
        _leaning(totals.left, pairs, left),
        harm,
        totals.harm_count,
        np.array([totals.own_count.sum() / strip_m]),
    )


def _leaning(total: Array, samples: Array, mean: Array | float) -> Array:
    """Means of classes with so many samples that lean on a mean."""
    return (total + _TRUST * mean) / np.maximum(samples + (_TRUST if np.ndim(mean) else 0.0), 1.0)


def _share(part: Array, whole: Array, mean: Array | float) -> Array:
    """Shares of wholes that lean on a share; that share where a whole is nothing."""
    trust = _TRUST if np.ndim(mean) else 0.0
    there = whole + trust > 0.0
    return np.where(there, (part + trust * mean) / np.where(there, whole + trust, 1.0), mean)


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
