"""Puts rows into worlds, as machine code: heads with their luck, and reports with what policies are shown of them."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled, fill
from ..core import Array, Rows
from .batch import Heads, Plants, Tracks
from .drawing import Reach, half_width_m
from .features import ACROSS_SCALE_M, HEIGHT_SCALE_M, SIZE_SCALE_M, C
from .rules import fill_slots, shown
from .state import T, Tables, Worlds
from .timing import level_s


class Looks(NamedTuple):
    """What pictures show of B worlds and the rules do not ask for; see ``Heads`` and ``Plants``."""

    exists: NDArray[np.bool_]
    occluded: NDArray[np.bool_]
    size_m: Array
    plant: NDArray[np.int64]
    base: Array
    count: NDArray[np.int64]  # type: ignore[assignment]
    height_m: Array
    crown_m: Array


class Outset(NamedTuple):
    """What a beginning depends on beside the rules' tables.

    Attributes:
        frame: world (along, across, up) of the arm plane's (cart, u, v) = 0.
        reach: of the arm.
        luck_logit: standard deviation of a head's luck on the logit scale.
        recognise_s: for the first picture.
    """

    frame: tuple[float, float, float]
    reach: Reach
    luck_logit: float
    recognise_s: float


@compiled
def begin_worlds(
    tables: Tables,
    outset: Outset,
    worlds: Worlds,
    looks: Looks,
    rows: Rows,
    heads: Heads,
    plants: Plants,
    mass_g: Array,
) -> None:
    """Put rows into the worlds ``rows`` and the carts at their first stop, without a report.

    Args:
        tables: what the rules look up.
        outset: see there.
        worlds: is written.
        looks: is written.
        rows: of the worlds, one a row of the batch.
        heads: of the batch.
        plants: of the batch.
        mass_g: (R,), filaments of all heads of each.
    """
    for r, w in enumerate(rows):
        put_heads(outset, worlds, looks, w, heads, r)
        for p in range(plants.height_m.shape[1]):
            for axis in range(3):
                looks.base[w, p, axis] = plants.base[r, p, axis]
            looks.height_m[w, p], looks.crown_m[w, p] = plants.height_m[r, p], plants.crown_m[r, p]
        looks.count[w] = plants.count[r]
        laden = 0.0
        for i in range(heads.mass_g.shape[1]):
            laden += 1.0 if heads.mass_g[r, i] != 0.0 else 0.0
        totals = worlds.totals[w]
        fill(totals, 0.0)
        totals[T.total], totals[T.missed] = mass_g[r], laden
        totals[T.time], totals[T.recognise] = outset.recognise_s, outset.recognise_s
        for axis in range(3):
            worlds.pose[w, axis] = tables.look_pose[0, axis]
        worlds.rise_s[w], worlds.stop[w] = 0.0, 0
        fill(worlds.first[w], 0)
        for k in range(worlds.track_head.shape[1]):
            fill(worlds.track_feature[w, k], 0.0)
            worlds.track_legal[w, k], worlds.track_head[w, k] = False, worlds.head_mass_g.shape[1] - 1
        fill_slots(worlds, w)


@compiled
def put_heads(outset: Outset, worlds: Worlds, looks: Looks, w: int, heads: Heads, r: int) -> None:
    """Put the heads of the batch's world ``r``, and their empty places, into the world ``w``."""
    fill(worlds.head_visited[w], False)
    for i in range(heads.exists.shape[1]):
        for axis in range(3):
            worlds.head_position[w, i, axis] = heads.position[r, i, axis] - outset.frame[axis]
        worlds.head_stage[w, i], worlds.head_mass_g[w, i] = heads.stage[r, i], heads.mass_g[r, i]
        cut, fall = heads.cut_luck[r, i], heads.drop_luck[r, i]
        # An exponential takes a while, and its result for no luck is known.
        worlds.head_odds[w, i, 0] = math.exp(outset.luck_logit * cut) if cut != 0.0 else 1.0
        worlds.head_odds[w, i, 1] = math.exp(outset.luck_logit * fall) if fall != 0.0 else 1.0
        looks.exists[w, i], looks.occluded[w, i] = heads.exists[r, i], heads.occluded[r, i]
        looks.size_m[w, i], looks.plant[w, i] = heads.size_m[r, i], heads.plant[r, i]


@compiled
def begin_tracks(tables: Tables, outset: Outset, worlds: Worlds, rows: Rows, tracks: Tracks) -> None:
    """Put all reports into the worlds ``rows``, which have just begun, and show those of the first stop."""
    for r, w in enumerate(rows):
        for stop in range(tracks.first.shape[1]):
            worlds.first[w, stop] = tracks.first[r, stop]
        put_tracks(tables, outset, worlds, w, 0, int(tracks.first[r, -1]), tracks, r)
        fill_slots(worlds, w)


@compiled
def put_tracks(
    tables: Tables, outset: Outset, worlds: Worlds, w: int, start: int, count: int, tracks: Tracks, r: int
) -> None:
    """Write ``count`` reports of the batch's world ``r``, and what policies are shown of them wherever the arm is.

    They become the reports of the world ``w`` from ``start`` on.
    """
    frame = outset.frame
    for k in range(count):
        t, place, target = start + k, tracks.position[r, k], worlds.track_target[w, start + k]
        for axis in range(3):
            target[axis] = place[axis] - frame[axis]
        level = target[2]
        legal = abs(place[1]) <= half_width_m(outset.reach, level, -1.0, -1.0) and level <= tables.rates.clear_m
        feature = worlds.track_feature[w, t]
        fill(feature, 0.0)
        feature[C.present] = 1.0
        feature[C.across] = shown(place[1], ACROSS_SCALE_M)
        feature[C.height] = shown(level - tables.rates.clear_m, HEIGHT_SCALE_M)
        feature[C.bud + tracks.stage[r, k]] = 1.0
        feature[C.size] = shown(tracks.size_m[r, k], SIZE_SCALE_M)
        feature[C.reachable] = 1.0 if legal else 0.0
        worlds.track_descent_s[w, t], worlds.track_legal[w, t] = level_s(tables.rates, level), legal
        worlds.track_head[w, t] = tracks.head[r, k]


@compiled
def take_tracks(tables: Tables, outset: Outset, worlds: Worlds, w: int, tracks: Tracks) -> None:
    """Take a camera's reports of the present stop, the only world of a batch, into the world ``w``; show the first."""
    stop, end = worlds.stop[w], worlds.track_head.shape[1] - 1
    start = worlds.first[w, stop]
    count = min(tracks.head.shape[1], end - start)
    put_tracks(tables, outset, worlds, w, start, count, tracks, 0)
    fill(worlds.first[w, stop + 1 :], start + count)
    fill_slots(worlds, w)
