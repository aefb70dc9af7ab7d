"""Fields of several worlds side by side, in the rules' padded slots, and the way from fields to them and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled
from ..core import Array
from ..field import Camera, Table
from . import field
from .config import ScenarioConfig
from .field import WeedField
from .state import FAR_M
from .timing import G


@dataclass(frozen=True)
class Plants:
    """True plants of R worlds; what does not exist lies at ``FAR_M``.

    Attributes:
        weed: (R, N, 2) places along and across, sorted along.
        exists: (R, N).
        species: (R, N), index into ``SPECIES``.
        stage: (R, N), index into ``STAGES``.
        luck: (R, N), uniform: the rank of the weed's tolerance.
        look: (R, N), uniform: whatever only looks need (yaw, size).
        crop: (R, C, 2) places of the crop plants of the middle row, sorted along; C spans one beyond each end.
        crop_luck: (R, C), uniform.
        ground_look: (R,), uniform: the odometry's error and the looks of the soil.
    """

    weed: Array
    exists: NDArray[np.bool_]
    species: NDArray[np.int64]
    stage: NDArray[np.int64]
    luck: Array
    look: Array
    crop: Array
    crop_luck: Array
    ground_look: Array


@dataclass(frozen=True)
class Tracks:
    """What the cameras make of R worlds, T slots each, sorted along; empty slots lie at ``FAR_M``.

    Attributes:
        report: (R, T, 2), place that the machine believes when it aims.
        aim: (R, T, 2), place that the tool is set on after its camera's correction.
        weed: (R, T), index of the nearest true weed along the row.
        real: (R, T), whether a weed is behind it.
        species: (R, T), reported.
        stage: (R, T), reported.
        crop_gap_m: (R, T), reported distance to the nearest crop plant.
        count: (R,).
    """

    report: Array
    aim: Array
    weed: NDArray[np.int64]
    real: NDArray[np.bool_]
    species: NDArray[np.int64]
    stage: NDArray[np.int64]
    crop_gap_m: Array
    count: NDArray[np.int64]


class Batch(NamedTuple):
    """Fields of R worlds; ``tracks`` is None where a camera still has to look."""

    plants: Plants
    tracks: Tracks | None


@compiled
def nearest_along(places_m: Array, along_m: Array) -> NDArray[np.int64]:
    """Index (R, T) of the nearest of ascending places (R, N) to each of (R, T) along the row; of equals the first."""
    rows, last = len(places_m), places_m.shape[1] - 1
    result = np.empty(along_m.shape, np.int64)
    for row in range(rows):
        for k in range(along_m.shape[1]):
            along = along_m[row, k]
            low, high = 0, last + 1
            while low < high:
                middle = (low + high) // 2
                if places_m[row, middle] < along:
                    low = middle + 1
                else:
                    high = middle
            left, right = max(low - 1, 0), min(low, last)
            nearer = along - places_m[row, left] <= places_m[row, right] - along
            result[row, k] = left if nearer else right
    return result


def crop_index(crop: Array, along_m: Array) -> NDArray[np.int64]:
    """Index (R, T) of the crop plant (R, C, 2) that is nearest along, but for those without a neighbour on a side."""
    return np.clip(nearest_along(crop[..., G.along], along_m), 1, crop.shape[1] - 2)


def nearest_crop(crop: Array, place: Array) -> Array:
    """Distance (R, T) from places (R, T, 2) to the nearest crop plant (R, C, 2) of the middle row."""
    index = crop_index(crop, place[..., G.along])
    best = np.full(place.shape[:-1], np.inf)
    for step in (-1, 0, 1):
        near = np.take_along_axis(crop, (index + step)[..., None], axis=1)
        offset = near - place
        best = np.minimum(best, np.hypot(offset[..., G.along], offset[..., G.across]))
    return best


def nearest_weed(weed: Array, looked_at: int = 6) -> Array:
    """Distance (R, N) from weeds (R, N, 2), sorted along, to the nearest of the next ones on either side along."""
    best = np.full(weed.shape[:-1], np.inf)
    for step in range(1, min(looked_at, weed.shape[1] - 1) + 1):
        offset = weed[:, step:] - weed[:, :-step]
        gap = np.hypot(offset[..., G.along], offset[..., G.across])
        np.minimum(best[:, step:], gap, out=best[:, step:])
        np.minimum(best[:, :-step], gap, out=best[:, :-step])
    return best


def places(table: Table, along: str = "along_m", across: str = "across_m") -> Array:
    """Places (n, 2) of a table's rows."""
    return np.column_stack([getattr(table, along), getattr(table, across)])


def stack(scenario: ScenarioConfig, capacity: int, fields: Sequence[WeedField]) -> Batch:
    """The batch of fields in which nothing is missing and that fit; see ``filling``.

    Args:
        scenario: says how much room there is.
        capacity: most tracks.
        fields: one a world.
    """
    rows, n, c = len(fields), scenario.max_weeds, scenario.crops
    plants = Plants(
        weed=np.full((rows, n, 2), FAR_M),
        exists=np.zeros((rows, n), bool),
        species=np.zeros((rows, n), np.int64),
        stage=np.zeros((rows, n), np.int64),
        luck=np.zeros((rows, n)),
        look=np.zeros((rows, n)),
        crop=np.full((rows, c, 2), FAR_M),
        crop_luck=np.zeros((rows, c)),
        ground_look=np.zeros(rows),
    )
    for row, one in enumerate(fields):
        assert one.crops is not None and one.ground is not None
        weeds, crops = slice(len(one.weeds)), slice(len(one.crops))
        plants.weed[row, weeds], plants.exists[row, weeds] = places(one.weeds), True
        for name in ("species", "stage", "luck", "look"):
            getattr(plants, name)[row, weeds] = getattr(one.weeds, name)
        plants.crop[row, crops], plants.crop_luck[row, crops] = places(one.crops), one.crops.luck
        plants.ground_look[row] = one.ground.look[0]
    reports = [one.reports for one in fields if one.reports is not None]
    return Batch(plants, _tracks(plants, capacity, reports) if len(reports) == rows else None)


def _tracks(plants: Plants, capacity: int, reports: Sequence[field.Reports]) -> Tracks:
    shape = len(reports), capacity
    report, aim = np.full((*shape, 2), FAR_M), np.full((*shape, 2), FAR_M)
    species, stage, real = np.zeros(shape, np.int64), np.zeros(shape, np.int64), np.zeros(shape, bool)
    gap, count = np.zeros(shape), np.zeros(len(reports), np.int64)
    for row, table in enumerate(reports):
        n = count[row] = len(table)
        report[row, :n], aim[row, :n] = places(table), places(table, "aim_along_m", "aim_across_m")
        species[row, :n], stage[row, :n] = table.species, table.stage
        gap[row, :n], real[row, :n] = table.crop_gap_m, table.behind == 1
    weed = nearest_along(plants.weed[..., G.along], aim[..., G.along])
    return Tracks(report, aim, weed, real, species, stage, gap, count)


def unstack(batch: Batch, camera: Camera | None) -> list[WeedField]:
    """The fields of a batch, whose reports, where there are any, are those of ``camera``."""
    return [_field(batch, row, camera) for row in range(len(batch.plants.exists))]


def _field(batch: Batch, row: int, camera: Camera | None) -> WeedField:
    plants, tracks = batch
    there = plants.exists[row]
    crops = plants.crop[row, :, G.along] < FAR_M
    names = ("species", "stage", "luck", "look")
    reports = None
    if tracks is not None:
        here = row, slice(int(tracks.count[row]))
        report, aim = tracks.report[here], tracks.aim[here]
        reports = field.Reports(
            along_m=report[:, G.along],
            across_m=report[:, G.across],
            aim_along_m=aim[:, G.along],
            aim_across_m=aim[:, G.across],
            species=tracks.species[here],
            stage=tracks.stage[here],
            crop_gap_m=tracks.crop_gap_m[here],
            behind=tracks.real[here].astype(np.int64),
        )
    return WeedField(
        weeds=field.Weeds(
            along_m=plants.weed[row, there, G.along],
            across_m=plants.weed[row, there, G.across],
            **{name: getattr(plants, name)[row, there] for name in names},
        ),
        crops=field.Crops(
            along_m=plants.crop[row, crops, G.along],
            across_m=plants.crop[row, crops, G.across],
            luck=plants.crop_luck[row, crops],
        ),
        ground=field.Ground(plants.ground_look[row : row + 1]),
        reports=reports,
        camera=None if tracks is None else camera,
    )
