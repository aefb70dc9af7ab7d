"""What the statistical cameras make of strips: which weeds become tracks, which tracks are false, how far all err."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled
from ...kernels.orders import count_below, count_upto, rank
from ...kernels.sums import in_order
from ..arrays import allocated
from ..core import Array
from ..dice import Block
from .batch import Plants, Tracks
from .config import CartConfig, ScenarioConfig
from .drawing import poisson_sums
from .gaps import LOOKED_AT, gap_to_crop, gap_to_weed, nearest_along, passed
from .perception import TOOL_GATE_M, PerceptionModel, Q
from .straying import NOWHERE_M, Carrying, strayed
from .timing import G

AT_WEED, AT_CROP = 0, 1
"""Where a false track may be; the third is anywhere."""


class Cameras(NamedTuple):
    """What tracks are drawn from: perception model and scenario in the shape that a kernel takes.

    Attributes:
        recall: (alone or not, species, stage), chance that a weed becomes a track, see ``PerceptionModel``.
        reach_m: (species, stage), how far from its stem a weed's leaves reach.
        crop_gap_m: ascending distances from these to a crop plant that part ``crop_odds``.
        crop_odds: factors on the odds of becoming a track.
        weed_gap_m: as ``crop_gap_m``, to the leaves of the nearest other weed.
        weed_odds: see ``crop_odds``.
        crowded_m: nearer than that a weed is at a crop plant, beside another weed.
        alone_m: how much farther the nearest other weed is makes no difference.
        sightings: (n, 8), rows of every class, see ``Sighting``.
        first: where each class begins.
        holds: how many each class has.
        false_sightings: (n, 8), the same of false tracks.
        false_first: see ``first``.
        false_holds: see ``holds``.
        false: cumulative probabilities of 0, 1, ... false tracks.
        kinds: cumulative shares of those at weeds and at crop plants.
        drift_m: standard deviation of the odometry's error from the camera's view to the tool.
        length_m: of the strip.
        band_m: its width.
        crops_inside: crop plants whose undisturbed places lie in the strip.
        crops_before: of those that are not; the first of the others has this index.
    """

    recall: Array
    reach_m: Array
    crop_gap_m: Array
    crop_odds: Array
    weed_gap_m: Array
    weed_odds: Array
    crowded_m: tuple[float, float]
    alone_m: float
    sightings: Array
    first: NDArray[np.int64]
    holds: NDArray[np.int64]
    false_sightings: Array
    false_first: NDArray[np.int64]
    false_holds: NDArray[np.int64]
    false: Array
    kinds: tuple[float, float]
    drift_m: float
    length_m: float
    band_m: float
    crops_inside: int
    crops_before: int

    @classmethod
    def of(cls, scenario: ScenarioConfig, cart: CartConfig, perception: PerceptionModel) -> Cameras:
        """The numbers of a configuration."""
        area, inside = scenario.strip_m * scenario.band_m, scenario.crops - 3 * scenario.bed.rows
        true, false = perception.sighting_table, perception.false_table
        at_weed, at_crop, loose = perception.false_rates
        # Expected false tracks of a strip: parts of weeds, at crop plants, elsewhere.
        means = at_weed * scenario.density_per_m2 * scenario.strip_m * scenario.weedy_m, at_crop * inside, loose * area
        first, second, _ = (np.cumsum(means) / max(in_order(means), 1e-12)).tolist()
        return cls(
            recall=np.array(perception.recall, float),
            reach_m=np.array(perception.reach_m, float),
            crop_gap_m=np.array(perception.crop_gap_m, float),
            crop_odds=np.array(perception.odds_near_crop, float),
            weed_gap_m=np.array(perception.weed_gap_m, float),
            weed_odds=np.array(perception.odds_near_weed, float),
            crowded_m=(float(perception.crowded_m[0]), float(perception.crowded_m[1])),
            alone_m=float(max(*perception.weed_gap_m, *perception.crowded_m)),
            sightings=true.rows,
            first=true.first,
            holds=true.holds,
            false_sightings=false.rows,
            false_first=false.first,
            false_holds=false.holds,
            false=poisson_sums(in_order(means)),
            kinds=(first, second),
            drift_m=float(cart.unseen_m * perception.drift_share),
            length_m=float(scenario.strip_m),
            band_m=float(scenario.band_m),
            crops_inside=inside,
            crops_before=int(scenario.bed.rows),
        )

    def capacity(self, weeds: int) -> int:
        """Most tracks of a strip with room for so many weeds."""
        return weeds + len(self.false)

    def random_numbers(self, weeds: int) -> tuple[int, int]:
        """Uniform and normal numbers that the tracks of a world with room for so many weeds are drawn from."""
        return 1 + 2 * weeds + 5 * len(self.false), 1


class Lots(NamedTuple):
    """The random numbers of R strips' tracks, in the order in which they lie in the blocks; ``drift`` is normal."""

    seen: Array
    sighting: Array
    false_count: Array
    false_kind: Array
    false_owner: Array
    false_place: Array
    false_sighting: Array
    drift: Array

    @classmethod
    def of(cls, cameras: Cameras, weeds: int, uniform: Array, normal: Array) -> Lots:
        """Cut the blocks (R, .)."""
        u, false = Block(uniform), len(cameras.false)
        return cls(
            seen=u.take(weeds),
            sighting=u.take(weeds),
            false_count=u.take(1),
            false_kind=u.take(false),
            false_owner=u.take(false),
            false_place=u.take(false, 2),
            false_sighting=u.take(false),
            drift=normal,
        )


def draw_tracks(
    cameras: Cameras, plants: Plants, uniform: Array, normal: Array, carrying: Carrying | None = None
) -> Tracks:
    """What the statistical cameras make of R worlds, from random blocks (R, .) of their own.

    By default the ground is level and the odometry errs by what the cameras' statistics say.
    """
    rows, weeds = plants.exists.shape
    tracks = allocated(Tracks, rows, tracks=cameras.capacity(weeds))
    carrying = carrying or Carrying.level(rows)
    if not carrying.told:
        carrying = carrying._replace(drift_m=cameras.drift_m * normal[:, 0])
    look(cameras, plants, Lots.of(cameras, weeds, uniform, normal), carrying, tracks)
    return tracks


@compiled
def look(cameras: Cameras, plants: Plants, lots: Lots, carrying: Carrying, tracks: Tracks) -> None:
    """Write the tracks of R worlds, sorted along."""
    room = tracks.real.shape[1]
    told, gap_m, along_m = np.empty((room, len(Q))), np.empty(room), np.empty(room)
    order, spare = np.empty(room, np.int64), np.empty(room, np.int64)
    for r in range(len(tracks.real)):
        weeds = 0
        while weeds < plants.exists.shape[1] and plants.exists[r, weeds]:
            weeds += 1
        true = see_weeds(cameras, plants, lots, carrying, r, weeds, told, gap_m)
        count = see_what_is_not(cameras, plants, lots, carrying, r, weeds, told, gap_m, true)
        for i in range(count):
            along_m[i] = told[i, Q.along]
        rank(along_m[:count], order, spare)
        tracks.count[r] = count
        weed, before = plants.weed[r], 0
        report, aim, nearest = tracks.report[r], tracks.aim[r], tracks.weed[r]
        for k in range(count):
            i = order[k]
            report[k, G.along], report[k, G.across] = told[i, Q.along], told[i, Q.across]
            aim[k, G.along], aim[k, G.across] = told[i, Q.aim_along], told[i, Q.aim_across]
            before = passed(weed, aim[k, G.along], before)
            nearest[k] = nearest_along(weed, aim[k, G.along], before)
            tracks.species[r, k], tracks.stage[r, k] = int(told[i, Q.species]), int(told[i, Q.stage])
            tracks.real[r, k], tracks.crop_gap_m[r, k] = i < true, gap_m[i]
            tracks.confidence[r, k] = told[i, Q.confidence]


@compiled
def see_weeds(
    cameras: Cameras, plants: Plants, lots: Lots, carrying: Carrying, r: int, weeds: int, told: Array, gap_m: Array
) -> int:
    """Write what is told of a world's weeds, and how far they are from the crop; gives how many are told of."""
    count, weed, crop, half_m = 0, plants.weed[r], plants.crop[r], 0.5 * cameras.band_m
    chance, lot = lots.seen[r], lots.sighting[r]
    recall, first, holds, before = cameras.recall, cameras.first, cameras.holds, 0
    reach_m = np.empty(weeds)
    for i in range(weeds):
        reach_m[i] = cameras.reach_m[int(plants.species[r, i]), int(plants.stage[r, i])]
    for i in range(weeds):
        along, across = weed[i, G.along], weed[i, G.across]
        species, stage = int(plants.species[r, i]), int(plants.stage[r, i])
        before = passed(crop, along, before)
        crop_gap = gap_to_crop(crop, along, across, before)
        weed_gap = gap_to_weed(weed, reach_m, weeds, i, LOOKED_AT, cameras.alone_m)
        at_crop, at_weed = (
            count_below(cameras.crop_gap_m, crop_gap - reach_m[i]),
            count_below(cameras.weed_gap_m, weed_gap),
        )
        crowded = at_crop < len(cameras.crop_gap_m) or at_weed < len(cameras.weed_gap_m)
        odds = cameras.crop_odds[at_crop] * cameras.weed_odds[at_weed]
        if chance[i] < track_chance(float(recall[int(crowded), species, stage]), odds):
            kind = 6 * neighbourhood(cameras.crowded_m, crop_gap - reach_m[i], weed_gap) + 3 * species + stage
            row = int(first[kind]) + int(holds[kind] * lot[i])
            gap_m[count] = crop_gap
            count = tell(told, count, cameras.sightings, row, carrying, r, along, across, half_m)
    return count


@compiled
def see_what_is_not(
    cameras: Cameras,
    plants: Plants,
    lots: Lots,
    carrying: Carrying,
    r: int,
    weeds: int,
    told: Array,
    gap_m: Array,
    count: int,
) -> int:
    """Write what is told of no further weed behind the first ``count``; gives how many are told of now."""
    weed, crop, half_m = plants.weed[r], plants.crop[r], 0.5 * cameras.band_m
    place = lots.false_place[r]
    for g in range(count_upto(cameras.false, lots.false_count[r, 0])):
        lot, owner = lots.false_kind[r, g], lots.false_owner[r, g]
        kind = (1 if lot > cameras.kinds[0] else 0) + (1 if lot > cameras.kinds[1] else 0)
        if kind == AT_WEED:
            if weeds == 0:
                continue
            along, across = weed[int(weeds * owner), G.along], weed[int(weeds * owner), G.across]
        elif kind == AT_CROP:
            plant = cameras.crops_before + int(cameras.crops_inside * owner)
            along, across = crop[plant, G.along], crop[plant, G.across]
        else:
            along, across = place[g, G.along] * cameras.length_m, place[g, G.across] * cameras.band_m - half_m
        row = cameras.false_first[kind] + int(cameras.false_holds[kind] * lots.false_sighting[r, g])
        known = count
        count = tell(told, count, cameras.false_sightings, row, carrying, r, along, across, half_m)
        if count > known:
            seen_along, seen_across = told[known, Q.along], told[known, Q.across]
            gap_m[known] = gap_to_crop(crop, seen_along, seen_across, passed(crop, seen_along, 0))
    return count


@compiled
def tell(
    told: Array,
    count: int,
    sightings: Array,
    row: int,
    carrying: Carrying,
    r: int,
    along_m: float,
    across_m: float,
    half_m: float,
) -> int:
    """Write what is told of a place behind the first ``count``, if it seems to lie in the band; gives how many are.

    Args:
        told: (n, 8), as ``Sighting``, but for the places, which are the world's.
        count: rows that are written.
        sightings: (m, 8), see ``Sighting``.
        row: which of them it is.
        carrying: from the front camera's view to the tool.
        r: the world.
        along_m: the place, ``across_m`` alike.
        across_m: see ``along_m``.
        half_m: half the band's width.
    """
    seen_along = along_m + sightings[row, Q.along] + carrying.drift_m[r]
    seen_across = across_m + sightings[row, Q.across]
    if carrying.surface.shape[1] > 0:
        stray_along, stray_across = strayed(carrying, r, along_m, across_m)
        seen_along += stray_along
        seen_across += stray_across
    if abs(seen_across) > half_m:
        return count
    told[count, Q.along], told[count, Q.across] = seen_along, seen_across
    told[count, Q.aim_along], told[count, Q.aim_across] = seen_along, seen_across
    aim_along, aim_across = along_m + sightings[row, Q.aim_along], across_m + sightings[row, Q.aim_across]
    found = carrying.camera and sightings[row, Q.found] > 0.0
    # Where the tool camera looks after the move, the rules know only then whether what it sees is near enough.
    if found and (carrying.after or within_gate(aim_along - seen_along, aim_across - seen_across)):
        told[count, Q.aim_along], told[count, Q.aim_across] = aim_along, aim_across
    elif carrying.after:
        told[count, Q.aim_across] = NOWHERE_M
    told[count, Q.species], told[count, Q.stage] = sightings[row, Q.species], sightings[row, Q.stage]
    told[count, Q.confidence] = sightings[row, Q.confidence]
    return count + 1


@compiled
def within_gate(along_m: float, across_m: float) -> bool:
    """Whether a plant is near enough for the tool camera: so far from where it was told to look."""
    return along_m * along_m + across_m * across_m <= TOOL_GATE_M * TOOL_GATE_M


@compiled
def track_chance(recall: float, odds: float) -> float:
    """Probability that a weed becomes a track: the odds of its kind times those of its neighbourhood."""
    return recall * odds / (1.0 - recall + recall * odds)


@compiled
def neighbourhood(crowded_m: tuple[float, float], crop_gap_m: float, weed_gap_m: float) -> int:
    """0 where a weed stands alone, 1 beside another weed, 2 at a crop plant; see ``Cameras.crowded_m``."""
    if crop_gap_m < crowded_m[0]:
        return 2
    return 1 if weed_gap_m < crowded_m[1] else 0
