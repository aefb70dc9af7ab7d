"""Draws strips of field: crop plants and weeds.

Each world hands over one block of uniform and one of normal numbers for the field and one each for the cameras from
its own generator; everything else follows from them world by world, so a world's strip does not depend on how many
worlds are drawn beside it, and the field is the same whatever the perception is.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernels import compiled, copy
from ...kernels.orders import count_upto, rank
from ..arrays import allocated
from ..core import Array
from ..dice import Block, poisson_table
from .batch import Plants
from .config import ScenarioConfig
from .timing import G

_CELLS = 128
"""Of the area along the row, within each of which patches are even."""
_MARGIN_M = 0.15
"""Clusters are centred up to three cluster sigmas outside the strip."""
_MOST_SIGMAS = 3.0
"""A crop plant strays no farther from its place."""


class Strip(NamedTuple):
    """What a strip is grown from: the scenario in the shape that a kernel takes.

    Weeds are a Thomas process (Poisson cluster centres, Poisson numbers of weeds each, Gaussian places about the
    centre) over a Poisson background, on an area larger than the band by three cluster sigmas; those outside the
    band do not exist.

    Attributes:
        parents: cumulative Poisson probabilities of 0, 1, ... clusters.
        cluster: the same of weeds in a cluster.
        background: the same of weeds outside them.
        low_m: along and across, where the area begins.
        size_m: its size, along and across.
        sigma_m: of a weed's distance from its cluster's centre, per axis.
        length_m: of the strip.
        half_width_m: of the band.
        stages: cumulative shares of the stages.
        grass_share: of the weeds.
        pitch_m: of the crop plants.
        jitter_m: of their places, along and across.
        drawn: weeds that are drawn on the area.
        weeds: most weeds of the strip.
        crops: crop plants.
        rows: that the crop plants stand in.
        row_m: from row to row.
        row_half_m: half the width about a row in which weeds grow, infinite where they grow anywhere.
        missing: share of them that did not emerge.
        contrast: of the patches, 1 without any.
        patch_m: from patch to patch.
    """

    parents: Array
    cluster: Array
    background: Array
    low_m: tuple[float, float]
    size_m: tuple[float, float]
    sigma_m: float
    length_m: float
    half_width_m: float
    stages: tuple[float, float]
    grass_share: float
    pitch_m: float
    jitter_m: tuple[float, float]
    drawn: int
    weeds: int
    crops: int
    rows: int
    row_m: float
    row_half_m: float
    missing: float
    contrast: float
    patch_m: float

    @classmethod
    def of(cls, scenario: ScenarioConfig) -> Strip:
        """The numbers of a scenario."""
        length, width = scenario.strip_m + 2.0 * _MARGIN_M, scenario.band_m + 2.0 * _MARGIN_M
        expected = scenario.density_per_m2 * length * width
        area = length * width
        parents = poisson_sums(scenario.clumped * scenario.density_per_m2 / scenario.cluster_size * area)
        background = poisson_sums((1.0 - scenario.clumped) * scenario.density_per_m2 * area)
        # Variance of a cluster process's count: mean times (1 + cluster size) for the clumped part. Beyond five
        # standard deviations nothing is kept.
        spread = np.sqrt(expected * (1.0 + scenario.clumped * scenario.cluster_size))
        drawn = int(np.ceil(expected + 5.0 * spread)) if len(parents) else len(background)
        first, second, _ = np.cumsum(scenario.stage_shares).tolist()
        return cls(
            parents=parents,
            cluster=poisson_sums(scenario.cluster_size),
            background=background,
            low_m=(-_MARGIN_M, -0.5 * scenario.band_m - _MARGIN_M),
            size_m=(length, width),
            sigma_m=float(scenario.cluster_sigma_m),
            length_m=float(scenario.strip_m),
            half_width_m=0.5 * scenario.band_m,
            stages=(first, second),
            grass_share=float(scenario.grass_share),
            pitch_m=float(scenario.crop_pitch_m),
            jitter_m=(float(scenario.crop_jitter_m[0]), float(scenario.crop_jitter_m[1])),
            drawn=max(drawn, scenario.max_weeds),
            weeds=int(scenario.max_weeds),
            crops=int(scenario.crops),
            rows=int(scenario.bed.rows),
            row_m=float(scenario.row_m),
            row_half_m=np.inf if scenario.bed.row_band_m is None else 0.5 * float(scenario.bed.row_band_m),
            missing=float(scenario.crop_missing),
            contrast=float(scenario.patch_contrast),
            patch_m=float(scenario.patch_m),
        )

    @property
    def random_numbers(self) -> tuple[int, int]:
        """Uniform and normal numbers that a world's strip is drawn from."""
        uniform = 3 * len(self.parents) + 2 + 2 * self.drawn + 4 * self.weeds + self.crops
        return uniform, 2 * self.drawn + 2 * self.crops


class Chances(NamedTuple):
    """The random numbers of R strips, in the order in which they lie in the blocks; normal ones end in ``_z``."""

    centre: Array
    number: Array
    clusters: Array
    loose: Array
    place: Array
    stage: Array
    species: Array
    luck: Array
    look: Array
    crop_luck: Array
    place_z: Array
    crop_z: Array

    @classmethod
    def of(cls, strip: Strip, uniform: Array, normal: Array) -> Chances:
        """Cut the blocks (R, .)."""
        u, z, parents = Block(uniform), Block(normal), len(strip.parents)
        return cls(
            centre=u.take(parents, 2),
            number=u.take(parents),
            clusters=u.take(1),
            loose=u.take(1),
            place=u.take(strip.drawn, 2),
            stage=u.take(strip.weeds),
            species=u.take(strip.weeds),
            luck=u.take(strip.weeds),
            look=u.take(strip.weeds),
            crop_luck=u.take(strip.crops),
            place_z=z.take(strip.drawn, 2),
            crop_z=z.take(strip.crops, 2),
        )


def poisson_sums(mean: float) -> Array:
    """Cumulative Poisson probabilities of 0, 1, ... up to where they no longer matter."""
    return poisson_table(mean, 5.0, 3)


def draw_plants(strip: Strip, uniform: Array, normal: Array) -> Plants:
    """Grow the strips of R worlds from their random blocks (R, .)."""
    plants = allocated(Plants, len(uniform), weeds=strip.weeds, crops=strip.crops)
    grow(strip, Chances.of(strip, uniform, normal), plants)
    return plants


@compiled
def grow(strip: Strip, chances: Chances, plants: Plants) -> None:
    """Let weeds and crop plants of R worlds grow from their chances."""
    place, along = np.empty((strip.drawn + 1, len(G))), np.empty(strip.drawn)
    room = max(strip.drawn, strip.crops)
    order, spare = np.empty(room, np.int64), np.empty(room, np.int64)
    crop = np.empty((strip.crops, len(G)))
    for r in range(len(plants.exists)):
        count = lay_weeds(strip, chances, r, place)
        for j in range(count):
            along[j] = place[j, G.along]
        rank(along[:count], order, spare)
        for i in range(min(count, strip.weeds)):
            plants.exists[r, i] = True
            plants.weed[r, i, G.along] = place[order[i], G.along]
            plants.weed[r, i, G.across] = place[order[i], G.across]
        stage, species = plants.stage[r], plants.species[r]
        for i in range(strip.weeds):
            lot = chances.stage[r, i]
            stage[i] = (1 if lot > strip.stages[0] else 0) + (1 if lot > strip.stages[1] else 0)
            species[i] = 1 if chances.species[r, i] < strip.grass_share else 0
        copy(chances.luck[r], plants.luck[r])
        copy(chances.look[r], plants.look[r])
        there = 0
        for i in range(strip.crops):
            if strip.missing > 0.0 and fine(chances.crop_luck[r, i]) < strip.missing:
                continue
            stray_along = min(max(chances.crop_z[r, i, G.along], -_MOST_SIGMAS), _MOST_SIGMAS)
            stray_across = min(max(chances.crop_z[r, i, G.across], -_MOST_SIGMAS), _MOST_SIGMAS)
            crop[there, G.along] = strip.pitch_m * (i // strip.rows - 0.5) + strip.jitter_m[G.along] * stray_along
            crop[there, G.across] = (i % strip.rows - 0.5 * (strip.rows - 1)) * strip.row_m + strip.jitter_m[
                G.across
            ] * stray_across
            plants.crop_luck[r, there] = chances.crop_luck[r, i]
            there += 1
        # Where plants stand nearer than they stray, a later one may stand before an earlier one.
        rank(crop[:there, G.along], order, spare)
        for i in range(there):
            plants.crop[r, i, G.along] = crop[order[i], G.along]
            plants.crop[r, i, G.across] = crop[order[i], G.across]
        plants.ground_look[r] = chances.crop_luck[r, strip.crops - 1]


@compiled
def lay_weeds(strip: Strip, chances: Chances, r: int, place: Array) -> int:
    """Write the places of a world's weeds, cluster by cluster and then the background; gives how many there are."""
    low_m, size_m, sigma_m, drawn, kept = strip.low_m, strip.size_m, strip.sigma_m, 0, 0
    centre, evenly, normal = chances.centre[r], chances.place[r], chances.place_z[r]
    phase = fine(chances.loose[r, 0])
    for parent in range(count_upto(strip.parents, chances.clusters[r, 0])):
        centre_along = low_m[G.along] + size_m[G.along] * patched(strip, phase, centre[parent, G.along])
        centre_across = low_m[G.across] + size_m[G.across] * centre[parent, G.across]
        for _ in range(min(count_upto(strip.cluster, chances.number[r, parent]), strip.drawn - drawn)):
            place[kept, G.along] = centre_along + sigma_m * normal[drawn, G.along]
            place[kept, G.across] = centre_across + sigma_m * normal[drawn, G.across]
            drawn += 1
            kept += grows(strip, place[kept, G.along], place[kept, G.across])
    for _ in range(min(count_upto(strip.background, chances.loose[r, 0]), strip.drawn - drawn)):
        place[kept, G.along] = low_m[G.along] + size_m[G.along] * patched(strip, phase, evenly[drawn, G.along])
        place[kept, G.across] = low_m[G.across] + size_m[G.across] * evenly[drawn, G.across]
        drawn += 1
        kept += grows(strip, place[kept, G.along], place[kept, G.across])
    return kept


@compiled
def grows(strip: Strip, along_m: float, across_m: float) -> int:
    """1 for a place within the strip's width and near enough to one of its rows."""
    if not (0.0 <= along_m <= strip.length_m and abs(across_m) <= strip.half_width_m):
        return 0
    for row in range(strip.rows):
        if abs(across_m - (row - 0.5 * (strip.rows - 1)) * strip.row_m) <= strip.row_half_m:
            return 1
    return 0


@compiled
def fine(chance: float) -> float:
    """The last digits of a uniform number: another one, for what was not drawn when the numbers were counted."""
    scaled = chance * 65536.0
    return scaled - np.floor(scaled)


@compiled
def patched(strip: Strip, phase: float, share: float) -> float:
    """Where along the area a place at a ``share`` of its weeds lies, as a share of its length: patches move weeds.

    The density goes up and down in straight lines between 1 and the contrast, from ``phase`` of a patch on.
    """
    if strip.contrast == 1.0:
        return share
    step = 1.0 / _CELLS
    total = 0.0
    for cell in range(_CELLS):
        total += patch_density(strip, phase, (cell + 0.5) * step)
    left = share * total
    for cell in range(_CELLS):
        here = patch_density(strip, phase, (cell + 0.5) * step)
        if left <= here:
            return (cell + left / here) * step
        left -= here
    return 1.0


@compiled
def patch_density(strip: Strip, phase: float, share: float) -> float:
    """Density at a share of the area's length over that where it is thinnest."""
    turn = share * strip.size_m[G.along] / strip.patch_m + phase
    return 1.0 + (strip.contrast - 1.0) * abs(2.0 * (turn - np.floor(turn)) - 1.0)
