"""Puts strips into worlds, as machine code: plants with what they can take, tracks with what policies are shown."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled, fill
from ..core import Array
from .batch import Plants, Tracks
from .features import show_track
from .gaps import crop_index, passed
from .response import Response, crop_tolerance, tolerance
from .rules import move_up
from .state import PAD, N, Tables, Worlds
from .timing import A, G, ready


class Looks(NamedTuple):
    """What pictures show of B worlds and the rules do not ask for, by plant, the ground's apart.

    Attributes:
        exists: whether something grows there.
        species: index into ``SPECIES``.
        look: uniform.
        ground: uniform, (B,).
    """

    exists: NDArray[np.bool_]
    species: NDArray[np.int64]
    look: Array
    ground: Array


@compiled
def begin_worlds(
    tables: Tables,
    arm: Any,
    response: Response,
    worlds: Worlds,
    looks: Looks,
    rows: NDArray[np.int64],
    plants: Plants,
    speed_m_s: float,
) -> None:
    """Put plants into the worlds ``rows`` and the carts before their beginning, already driving, without a track."""
    for r, w in enumerate(rows):
        worlds.weeds[w], worlds.crops_in_strip[w] = 0.0, 0.0
        fill(worlds.plant_dose[w], 0.0)
        fill(worlds.leaf_lost[w], 0.0)
        put_weeds(tables, response, worlds, looks, w, plants, r)
        put_crops(tables, response, worlds, looks, w, plants, r)
        looks.ground[w] = plants.ground_look[r]
        fill(worlds.totals[w], 0.0)
        fill(worlds.phases_s[w], 0.0)
        worlds.cart[w], worlds.speed[w], worlds.set_speed[w] = -tables.start_m, speed_m_s, speed_m_s
        place = ready(arm, -tables.start_m)
        worlds.place[w, A.carrier], worlds.place[w, A.lean] = place.carrier_m, place.lean_m
        worlds.place[w, A.across] = place.across_m
        worlds.track_count[w], worlds.cursor[w] = 0, 0
        for k in range(worlds.track_real.shape[1]):
            fill(worlds.track_feature[w, k], 0.0)
        fill(worlds.slot_track[w], worlds.track_real.shape[1] - 1)


@compiled
def put_weeds(tables: Tables, response: Response, worlds: Worlds, looks: Looks, w: int, plants: Plants, r: int) -> None:
    """Put the weeds of the batch's world ``r``, and their empty places, into the world ``w``."""
    place, kind, limit = worlds.plant[w, PAD:], worlds.plant_kind[w, PAD:], worlds.plant_tolerance[w, PAD:]
    there, what, look = looks.exists[w, PAD:], looks.species[w, PAD:], looks.look[w, PAD:]
    counts = worlds.plant_worth[w, PAD:]
    weed, exists, luck = plants.weed[r], plants.exists[r], plants.luck[r]
    count, worth = 0.0, 0.0
    for i in range(len(exists)):
        place[i, G.along], place[i, G.across] = weed[i, G.along], weed[i, G.across]
        species, stage = plants.species[r, i], plants.stage[r, i]
        there[i], what[i], look[i] = exists[i], species, plants.look[r, i]
        kind[i], limit[i], counts[i] = stage, np.inf, tables.worth[species, stage]
        if exists[i]:
            count += 1.0
            worth += counts[i]
            limit[i] = tolerance(response, species, stage, luck[i])
    worlds.weeds[w], worlds.worth[w] = count, worth


@compiled
def put_crops(tables: Tables, response: Response, worlds: Worlds, looks: Looks, w: int, plants: Plants, r: int) -> None:
    """Put the crop plants of the batch's world ``r`` into the world ``w``; beyond the strip's ends they cannot die."""
    place, limit = worlds.plant[w, tables.weeds_end :], worlds.plant_tolerance[w, tables.weeds_end :]
    there, crop, luck = looks.exists[w, tables.weeds_end :], plants.crop[r], plants.crop_luck[r]
    count = 0.0
    for i in range(len(crop)):
        place[i, G.along], place[i, G.across] = crop[i, G.along], crop[i, G.across]
        there[i], limit[i] = 0.0 <= crop[i, G.along] <= tables.strip_m, np.inf
        if there[i]:
            count += 1.0
            limit[i] = crop_tolerance(response, luck[i])
    worlds.crops_in_strip[w] = count


@compiled
def begin_tracks(
    tables: Tables,
    worlds: Worlds,
    rows: NDArray[np.int64],
    plants: Plants,
    tracks: Tracks,
    seen_ahead_m: float,
    frames_m: float,
) -> None:
    """Put tracks into the worlds ``rows``, which have just begun; the first that are known move up.

    Args:
        tables: what the rules look up.
        worlds: is written.
        rows: of the worlds, one a row of the batch.
        plants: of the batch.
        tracks: of the batch.
        seen_ahead_m: from where on a weed is in the front camera's view.
        frames_m: what the cart drives from then until a track is confirmed.
    """
    for r, w in enumerate(rows):
        worlds.track_count[w] = tracks.count[r]
        report, aim, near = worlds.track_report[w], worlds.track_aim[w], worlds.track_near[w]
        known_m, feature, crop = worlds.track_known_m[w], worlds.track_feature[w], plants.crop[r]
        for k in range(tracks.real.shape[1]):
            report[k, G.along], report[k, G.across] = tracks.report[r, k, G.along], tracks.report[r, k, G.across]
            aim[k, G.along], aim[k, G.across] = tracks.aim[r, k, G.along], tracks.aim[r, k, G.across]
            known_m[k] = report[k, G.along] - seen_ahead_m + frames_m
            near[k, N.weed], near[k, N.crop], worlds.track_real[w, k] = (
                tracks.weed[r, k],
                tables.crop_beside,
                tracks.real[r, k],
            )
        before = 0
        for k in range(tracks.count[r]):
            before = passed(crop, aim[k, G.along], before)
            near[k, N.crop] = crop_index(crop, aim[k, G.along], before, tables.crop_beside)
            species, stage, gap_m = tracks.species[r, k], tracks.stage[r, k], tracks.crop_gap_m[r, k]
            show_track(feature[k], report[k, G.across], species, stage, gap_m, tracks.confidence[r, k])
        move_up(tables, worlds, w)
