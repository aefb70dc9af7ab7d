"""Draws strips of field: crop plants, weeds, and what the cameras would make of them.

Each world hands over one block of uniform and one of normal numbers for the field and one each for the cameras from
its own generator; everything else is array arithmetic over the worlds, so a world's strip does not depend on how many
worlds are drawn beside it, and the field is the same whatever the perception is.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...kernels.sums import in_order
from ..core import Array
from ..dice import Block, poisson_table
from .batch import Plants, Tracks, nearest_along, nearest_crop, nearest_weed
from .config import CartConfig, ScenarioConfig
from .perception import PerceptionModel, Q, SightingTable, within_gate
from .state import FAR_M
from .timing import G

_MARGIN_M = 0.15
"""Clusters are centred up to three cluster sigmas outside the strip."""


def _table(mean: float) -> Array:
    """Cumulative Poisson probabilities of 0, 1, ... up to where they no longer matter."""
    return poisson_table(mean, 5.0, 3)


def _counts(scenario: ScenarioConfig) -> tuple[Array, Array, Array]:
    """Tables for the numbers of clusters, of weeds in a cluster, and of the background."""
    length, width = scenario.strip_m + 2.0 * _MARGIN_M, scenario.band_m + 2.0 * _MARGIN_M
    area = length * width
    parents = scenario.clumped * scenario.density_per_m2 / scenario.cluster_size * area
    background = (1.0 - scenario.clumped) * scenario.density_per_m2 * area
    return _table(parents), _table(scenario.cluster_size), _table(background)


def draw_plants(scenario: ScenarioConfig, uniform: Array, normal: Array) -> Plants:
    """Grow the strips of R worlds from their random blocks (R, .).

    Weeds are a Thomas process (Poisson cluster centres, Poisson numbers of weeds each, Gaussian places about the
    centre) over a Poisson background, on an area larger than the band by three cluster sigmas; those outside the
    band do not exist.
    """
    u, z = Block(uniform), Block(normal)
    rows, n = len(uniform), scenario.max_weeds
    parents, cluster, background = _counts(scenario)
    low = np.array([-_MARGIN_M, -0.5 * scenario.band_m - _MARGIN_M])
    size = np.array([scenario.strip_m, scenario.band_m]) + 2.0 * _MARGIN_M
    centre = low + size * u.take(len(parents), 2)
    number = np.searchsorted(cluster, u.take(len(parents)), side="right")
    number *= np.arange(len(parents)) < np.searchsorted(parents, u.take(1), side="right")
    loose = np.searchsorted(background, u.take(1)[:, 0], side="right")
    # Weed j of a world belongs to the cluster in whose turn it is; after the clusters comes the background.
    ends = np.concatenate([np.zeros((rows, 1), np.int64), number.cumsum(axis=1)], axis=1)
    total = ends[:, -1]
    limit = _draws(scenario)
    owner = np.zeros((rows, limit), np.int64)
    first = ends[:, :-1] + limit * np.arange(rows)[:, None]
    marks = np.bincount(first[(number > 0) & (ends[:, :-1] < limit)], minlength=rows * limit)
    which = np.flatnonzero(number.reshape(-1) > 0)
    begun = marks.cumsum()
    within = np.arange(limit) < np.minimum(total, limit)[:, None]
    if len(which):
        kept = which[(ends[:, :-1].reshape(-1)[which] < limit)]
        owner = np.where(within, kept[np.maximum(begun - 1, 0)].reshape(rows, limit), 0)
    place_u, place_z = u.take(limit, 2), z.take(limit, 2)
    clustered = centre.reshape(-1, 2).take(owner, axis=0) if len(parents) else np.zeros((rows, limit, 2))
    clustered = clustered + scenario.cluster_sigma_m * place_z
    place = np.where(within[..., None], clustered, low + size * place_u)
    there = np.arange(limit) < np.minimum(total + loose, limit)[:, None]
    there &= (place[..., G.along] >= 0.0) & (place[..., G.along] <= scenario.strip_m)
    there &= np.abs(place[..., G.across]) <= 0.5 * scenario.band_m
    order = np.argsort(np.where(there, place[..., G.along], FAR_M), axis=1, kind="stable")[:, :n]
    exists = np.take_along_axis(there, order, axis=1)
    weed = np.where(exists[..., None], np.take_along_axis(place, order[..., None], axis=1), FAR_M)

    stage_u = u.take(n)
    limits = np.cumsum(scenario.stage_shares)
    stage = (stage_u > limits[0]).astype(np.int64) + (stage_u > limits[1])
    species = (u.take(n) < scenario.grass_share).astype(np.int64)
    luck, look = u.take(n), u.take(n)
    crops = scenario.crops
    crop = np.zeros((rows, crops, 2))
    crop[..., G.along] = scenario.crop_pitch_m * (np.arange(crops) - 0.5)
    crop += np.asarray(scenario.crop_jitter_m) * np.clip(z.take(crops, 2), -3.0, 3.0)
    crop_luck = u.take(crops)
    # Where plants stand nearer than they stray, a later one may stand before an earlier one.
    order = np.argsort(crop[..., G.along], axis=1, kind="stable")
    crop = np.take_along_axis(crop, order[..., None], axis=1)
    return Plants(weed, exists, species, stage, luck, look, crop, crop_luck, crop_luck[:, -1])


def _draws(scenario: ScenarioConfig) -> int:
    """Weeds that are drawn on the enlarged area; beyond five standard deviations nothing is kept."""
    parents, _, background = _counts(scenario)
    if not len(parents):
        return max(len(background), scenario.max_weeds)
    mean = scenario.density_per_m2 * (scenario.strip_m + 2.0 * _MARGIN_M) * (scenario.band_m + 2.0 * _MARGIN_M)
    # Variance of a cluster process's count: mean times (1 + cluster size) for the clumped part.
    spread = np.sqrt(mean * (1.0 + scenario.clumped * scenario.cluster_size))
    return max(int(np.ceil(mean + 5.0 * spread)), scenario.max_weeds)


def false_means(scenario: ScenarioConfig, perception: PerceptionModel) -> tuple[float, float, float]:
    """Expected false tracks of a strip: parts of weeds, at crop plants, elsewhere."""
    area = scenario.strip_m * scenario.band_m
    at_weed, at_crop, loose = perception.false_rates
    return at_weed * scenario.density_per_m2 * area, at_crop * _crops_inside(scenario), loose * area


def _crops_inside(scenario: ScenarioConfig) -> int:
    """Crop plants whose undisturbed places lie in the strip; the first of them has index 1."""
    return scenario.crops - 3


def track_capacity(scenario: ScenarioConfig, perception: PerceptionModel | None) -> int:
    """Most tracks of a strip."""
    if perception is None:
        return 4 * scenario.max_weeds
    return scenario.max_weeds + len(_table(in_order(false_means(scenario, perception))))


def random_numbers(scenario: ScenarioConfig, perception: PerceptionModel) -> tuple[int, int, int, int]:
    """Lengths of a world's blocks: uniform and normal numbers for the field, then for the cameras."""
    parents, _, _ = _counts(scenario)
    n, limit, crops = scenario.max_weeds, _draws(scenario), scenario.crops
    false = track_capacity(scenario, perception) - n
    field = 3 * len(parents) + 2 + 2 * limit + 4 * n + crops
    return field, 2 * limit + 2 * crops, 1 + 2 * n + 5 * false, 1


def draw_tracks(
    scenario: ScenarioConfig,
    cart: CartConfig,
    perception: PerceptionModel,
    plants: Plants,
    uniform: Array,
    normal: Array,
) -> Tracks:
    """What the statistical cameras make of R worlds, from random blocks (R, .) of their own."""
    u = Block(uniform)
    n = plants.exists.shape[1]
    chances, lots = u.take(n), u.take(n)
    false_place, false_there, false_sighting = _draw_false(scenario, perception, plants, u)
    # Strips are far from full: what does not exist lies at the end and is not worked through.
    used = max(int(np.count_nonzero(plants.exists, axis=1).max()), 1)
    weed, species, stage = plants.weed[:, :used], plants.species[:, :used], plants.stage[:, :used]
    crop_gap, weed_gap = nearest_crop(plants.crop, weed), nearest_weed(weed)
    noticed = chances[:, :used] < track_chance(perception, species, stage, crop_gap, weed_gap)
    kind = 6 * neighbourhood(perception, crop_gap, weed_gap) + 3 * species + stage
    sighting = _draw_sightings(perception.sighting_table, kind, lots[:, :used])

    place = np.concatenate([weed, false_place], axis=1)
    sighting = np.concatenate([sighting, false_sighting], axis=1)
    there = np.concatenate([noticed & plants.exists[:, :used], false_there], axis=1)
    # From the front camera's view to the tool the odometry carries a track along the strip.
    report = place + sighting[..., [Q.along, Q.across]]
    report[..., G.along] += cart.unseen_m * perception.drift_share * normal
    seen = place + sighting[..., [Q.aim_along, Q.aim_across]]
    aim = np.where((sighting[..., Q.found] > 0.0)[..., None] & within_gate(seen, report), seen, report)
    there &= np.abs(report[..., G.across]) <= 0.5 * scenario.band_m
    gap = np.concatenate([crop_gap, nearest_crop(plants.crop, report[:, used:])], axis=1)

    count = np.count_nonzero(there, axis=1)
    order = np.argsort(np.where(there, report[..., G.along], FAR_M), axis=1, kind="stable")[:, : count.max()]
    there = np.take_along_axis(there, order, axis=1)
    shape = len(uniform), track_capacity(scenario, perception)

    def pick(values: NDArray[Any], empty: float) -> NDArray[Any]:
        full = np.full(shape + values.shape[2:], empty, values.dtype)
        if values.ndim == 3:
            full[:, : order.shape[1]] = np.where(
                there[..., None], np.take_along_axis(values, order[..., None], axis=1), empty
            )
        else:
            full[:, : order.shape[1]] = np.where(there, np.take_along_axis(values, order, axis=1), empty)
        return full

    report, aim = pick(report, FAR_M), pick(aim, FAR_M)
    weeds = np.zeros(shape, np.int64)
    weeds[:, : order.shape[1]] = nearest_along(plants.weed[..., G.along], aim[:, : order.shape[1], G.along])
    real = np.zeros(shape, bool)
    real[:, : order.shape[1]] = there & (order < used)
    return Tracks(
        report=report,
        aim=aim,
        weed=weeds,
        real=real,
        species=pick(sighting[..., Q.species], 0.0).astype(np.int64),
        stage=pick(sighting[..., Q.stage], 0.0).astype(np.int64),
        crop_gap_m=pick(gap, 0.0),
        count=count,
    )


def track_chance(
    perception: PerceptionModel, species: NDArray[np.int64], stage: NDArray[np.int64], crop_gap: Array, weed_gap: Array
) -> Array:
    """Probability (...) that weeds become tracks: the odds of a kind times those of its neighbourhood."""
    recall = np.asarray(perception.recall)[species, stage]
    odds = np.asarray(perception.odds_near_crop)[np.searchsorted(perception.crop_gap_m, crop_gap)]
    odds = odds * np.asarray(perception.odds_near_weed)[np.searchsorted(perception.weed_gap_m, weed_gap)]
    return recall * odds / (1.0 - recall + recall * odds)


def neighbourhood(perception: PerceptionModel, crop_gap: Array, weed_gap: Array) -> NDArray[np.int64]:
    """0 where a weed stands alone, 1 beside another weed, 2 at a crop plant (...)."""
    near_crop, near_weed = crop_gap < perception.crowded_m[0], weed_gap < perception.crowded_m[1]
    return np.where(near_crop, 2, near_weed.astype(np.int64))


def _draw_sightings(table: SightingTable, kind: NDArray[np.int64], lots: Array) -> Array:
    """One sighting (..., 7) of each one's class."""
    return table.rows[table.first[kind] + (table.holds[kind] * lots).astype(np.int64)]


def _draw_false(
    scenario: ScenarioConfig, perception: PerceptionModel, plants: Plants, u: Block
) -> tuple[Array, NDArray[np.bool_], Array]:
    """Owners' places (R, G, 2) of the false tracks, which of them there are, and their sightings (R, G, 7)."""
    means = false_means(scenario, perception)
    table = _table(in_order(means))
    g = len(table)
    there = np.arange(g) < np.searchsorted(table, u.take(1), side="right")
    limits = np.cumsum(means) / max(in_order(means), 1e-12)
    lots = u.take(g)
    kind = (lots > limits[0]).astype(np.int64) + (lots > limits[1])
    weeds = np.count_nonzero(plants.exists, axis=1)[:, None]
    lots = u.take(g)
    weed = np.take_along_axis(plants.weed, (weeds * lots).astype(np.int64)[..., None], axis=1)
    crop = np.take_along_axis(plants.crop, 1 + (_crops_inside(scenario) * lots).astype(np.int64)[..., None], axis=1)
    loose = u.take(g, 2) * [scenario.strip_m, scenario.band_m] - [0.0, 0.5 * scenario.band_m]
    owner = np.where((kind == 0)[..., None], weed, np.where((kind == 1)[..., None], crop, loose))
    there &= (kind > 0) | (weeds > 0)
    return owner, there, _draw_sightings(perception.false_table, kind, u.take(g))
