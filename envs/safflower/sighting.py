"""What the statistical camera makes of rows: which heads it reports, as what, how far off, and what is not there."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...kernels import compiled
from ...kernels.orders import count_upto
from ..arrays import allocated
from ..core import Array
from ..dice import begins, poisson_table
from .batch import Heads, Lanes, Tracks, in_lanes
from .config import GAPS_M, PerceptionModel, SafflowerConfig
from .crowding import chain, gap_m, stretches
from .field import SPREAD_M

_FALSE_RESERVE = 4.0
_FALSE_ACROSS_M = 0.12
_FALSE_BELOW_M = 0.04, 0.10


class Sight(NamedTuple):
    """What reports are drawn from: perception model and scenario in the shape that a kernel takes.

    Attributes:
        recall: (2, 4), chance that a head is reported that no other hides, free and occluded, by stage.
        below: (2, G + 1), what is left of it under a higher head, by the class of the gap.
        gaps_m: (G,), where these classes end.
        bias_m: (3,), mean error of the place.
        sigma_m: (3,), its standard deviation.
        limits: (4, 3), cumulative shares of the reported stages by true stage.
        size_sigma: relative error of the size.
        false: (G,), cumulative probabilities of 0, 1, ... reports of nothing in a row.
        false_along_m: where along the row these begin, and the range.
        false_top_m: they lie below this height.
        lanes: of the fixed order.
        most: reports that are kept.
        stretches: that the row is taken as, see ``crowding``.
    """

    recall: Array
    below: Array
    gaps_m: Array
    bias_m: Array
    sigma_m: Array
    limits: Array
    size_sigma: float
    false: Array
    false_along_m: tuple[float, float]
    false_top_m: float
    lanes: Lanes
    most: int
    stretches: int

    @classmethod
    def of(cls, config: SafflowerConfig, perception: PerceptionModel) -> Sight:
        """The numbers of a configuration."""
        scenario, lanes = config.scenario, Lanes.of(config)
        return cls(
            recall=np.array(perception.recall, float),
            below=np.column_stack([np.array(perception.below, float), np.ones(2)]),
            gaps_m=np.array(GAPS_M),
            bias_m=np.array(perception.bias_m, float),
            sigma_m=np.array(perception.sigma_m, float),
            limits=np.cumsum(np.asarray(perception.stage_confusion, float), axis=1)[:, :-1].copy(),
            size_sigma=float(perception.size_sigma),
            false=poisson_table(perception.false_per_stop * scenario.stops, _FALSE_RESERVE, 1),
            false_along_m=(lanes.begin_m, float(scenario.stops * scenario.window_m)),
            false_top_m=float(scenario.motor_height_m + config.machine.clear_level_m - _FALSE_BELOW_M[0]),
            lanes=lanes,
            most=int(scenario.max_tracks),
            stretches=stretches(scenario.stops * scenario.window_m),
        )

    def random_numbers(self, heads: int) -> tuple[int, int]:
        """Uniform and normal numbers that the reports of a world with room for so many heads are drawn from."""
        return 2 * heads + 1 + 4 * len(self.false), 4 * heads


class Lots(NamedTuple):
    """Where in a world's blocks the numbers of its reports begin, in this order; normal ones end in ``_z``."""

    seen: int
    stage: int
    number: int
    along: int
    across: int
    up: int
    false_stage: int
    place_z: int
    size_z: int

    @classmethod
    def of(cls, sight: Sight, heads: int) -> Lots:
        """The places for a world with room for so many heads."""
        uniform = [heads, heads, 1] + [len(sight.false)] * 4
        return cls(*begins(uniform), *begins([3 * heads, heads]))


def draw_tracks(sight: Sight, heads: Heads, uniform: Array, normal: Array) -> Tracks:
    """What the statistical camera reports of R worlds, from random blocks (R, .) of its own."""
    rows, room = heads.exists.shape
    most, stops = min(room + len(sight.false), sight.most), sight.lanes.stops
    tracks = allocated(Tracks, rows, tracks=most, heads=room + 1, stops=stops + 1)
    look(sight, Lots.of(sight, room), heads, uniform, normal, tracks)
    return tracks


@compiled
def look(sight: Sight, at: Lots, heads: Heads, uniform: Array, normal: Array, tracks: Tracks) -> None:
    """Write the reports of R worlds, in the fixed order."""
    nothing = heads.exists.shape[1]
    room = nothing + len(sight.false)
    place, size, keys = np.empty((room, 3)), np.empty(room), np.empty(room)
    stage, head, every = np.empty(room, np.int64), np.empty(room, np.int64), np.arange(room)
    order, spare = np.empty(room, np.int64), np.empty(room, np.int64)
    begin_m, first_of, after = sight.false_along_m[0], np.empty(sight.stretches, np.int64), np.empty(nothing, np.int64)
    for r in range(len(tracks.head)):
        u, z, count = uniform[r], normal[r], 0
        chain(begin_m, heads.position[r], heads.exists[r], first_of, after)
        for i in range(nothing):
            true = heads.stage[r, i]
            hidden = 1 if heads.occluded[r, i] else 0
            recall = sight.recall[hidden, true]
            if not (heads.exists[r, i] and u[at.seen + i] < recall):
                continue
            gap = count_upto(sight.gaps_m, gap_m(begin_m, heads.position[r], first_of, after, i))
            if not u[at.seen + i] < recall * sight.below[hidden, gap]:
                continue
            for axis in range(3):
                error_m = sight.sigma_m[axis] * z[at.place_z + 3 * i + axis]
                place[count, axis] = heads.position[r, i, axis] + sight.bias_m[axis] + error_m
            stage[count], head[count] = 0, i
            for limit in sight.limits[true]:
                stage[count] += 1 if u[at.stage + i] > limit else 0
            size[count] = heads.size_m[r, i] * (1.0 + sight.size_sigma * z[at.size_z + i])
            count += 1
        for g in range(count_upto(sight.false, u[at.number])):
            place[count, 0] = sight.false_along_m[0] + sight.false_along_m[1] * u[at.along + g]
            place[count, 1] = _FALSE_ACROSS_M * (2.0 * u[at.across + g] - 1.0)
            place[count, 2] = sight.false_top_m - _FALSE_BELOW_M[1] * u[at.up + g]
            stage[count], head[count] = 1 + (1 if u[at.false_stage + g] > 0.5 else 0), nothing
            size[count] = SPREAD_M
            count += 1
        first = tracks.first[r]
        in_lanes(sight.lanes, place, every, count, keys, order, spare, first)
        kept = min(count, tracks.head.shape[1])
        for stop in range(len(first)):
            first[stop] = min(first[stop], kept)
        for k in range(kept):
            i = order[k]
            for axis in range(3):
                tracks.position[r, k, axis] = place[i, axis]
            tracks.stage[r, k], tracks.size_m[r, k], tracks.head[r, k] = stage[i], size[i], head[i]
