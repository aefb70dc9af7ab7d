"""Fields of several worlds side by side, in the rules' padded slots, and the way from fields to them and back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled
from ..arrays import allocated, shaped
from ..core import Array
from ..field import Camera, Table
from . import field
from .config import ScenarioConfig
from .field import WeedField
from .state import FAR_M
from .timing import G, Ground


class Plants(NamedTuple):
    """True plants of R worlds; what does not exist lies at ``FAR_M``."""

    weed: Annotated[Array, shaped("weeds", Ground, empty=FAR_M)]
    """Places along and across, sorted along."""
    exists: Annotated[NDArray[np.bool_], shaped("weeds")]
    """Whether a weed is in the slot."""
    species: Annotated[NDArray[np.int64], shaped("weeds")]
    """Index into ``SPECIES``."""
    stage: Annotated[NDArray[np.int64], shaped("weeds")]
    """Index into ``STAGES``."""
    luck: Annotated[Array, shaped("weeds")]
    """Uniform: the rank of the weed's tolerance."""
    look: Annotated[Array, shaped("weeds")]
    """Uniform: whatever only looks need (yaw, size)."""
    crop: Annotated[Array, shaped("crops", Ground, empty=FAR_M)]
    """Places of the crop plants of the middle row, sorted along; they span one beyond each end."""
    crop_luck: Annotated[Array, shaped("crops")]
    """Uniform."""
    ground_look: Annotated[Array, shaped()]
    """Uniform: the odometry's error and the looks of the soil."""


class Tracks(NamedTuple):
    """What the cameras make of R worlds, T slots each, sorted along; empty slots lie at ``FAR_M``."""

    report: Annotated[Array, shaped("tracks", Ground, empty=FAR_M)]
    """Place that the machine believes when it aims."""
    aim: Annotated[Array, shaped("tracks", Ground, empty=FAR_M)]
    """Place that the tool is set on after its camera's correction."""
    weed: Annotated[NDArray[np.int64], shaped("tracks")]
    """Index of the nearest true weed along the row."""
    real: Annotated[NDArray[np.bool_], shaped("tracks")]
    """Whether a weed is behind it."""
    species: Annotated[NDArray[np.int64], shaped("tracks")]
    """Reported."""
    stage: Annotated[NDArray[np.int64], shaped("tracks")]
    """Reported."""
    crop_gap_m: Annotated[Array, shaped("tracks")]
    """Reported distance to the nearest crop plant."""
    count: Annotated[NDArray[np.int64], shaped()]  # type: ignore[override]
    """How many there are."""


class Batch(NamedTuple):
    """Fields of R worlds; ``tracks`` is None where a camera still has to look, ``luck`` (R, J) where no drive errs."""

    plants: Plants
    tracks: Tracks | None
    luck: Array | None = None


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
    plants = allocated(Plants, len(fields), weeds=scenario.max_weeds, crops=scenario.crops)
    for row, one in enumerate(fields):
        assert one.crops is not None and one.ground is not None
        weeds, crops = slice(len(one.weeds)), slice(len(one.crops))
        plants.weed[row, weeds], plants.exists[row, weeds] = places(one.weeds), True
        for name in ("species", "stage", "luck", "look"):
            getattr(plants, name)[row, weeds] = getattr(one.weeds, name)
        plants.crop[row, crops], plants.crop_luck[row, crops] = places(one.crops), one.crops.luck
        plants.ground_look[row] = one.ground.look[0]
    reports = [one.reports for one in fields if one.reports is not None]
    return Batch(plants, _tracks(plants, capacity, reports) if len(reports) == len(fields) else None)


def _tracks(plants: Plants, capacity: int, reports: Sequence[field.Reports]) -> Tracks:
    tracks = allocated(Tracks, len(reports), tracks=capacity)
    for row, table in enumerate(reports):
        n = tracks.count[row] = len(table)
        tracks.report[row, :n], tracks.aim[row, :n] = places(table), places(table, "aim_along_m", "aim_across_m")
        for name in ("species", "stage", "crop_gap_m"):
            getattr(tracks, name)[row, :n] = getattr(table, name)
        tracks.real[row, :n] = table.behind == 1
    return tracks._replace(weed=nearest_along(plants.weed[..., G.along], tracks.aim[..., G.along]))


def unstack(batch: Batch, camera: Camera | None) -> list[WeedField]:
    """The fields of a batch, whose reports, where there are any, are those of ``camera``."""
    return [_field(batch, row, camera) for row in range(len(batch.plants.exists))]


def _field(batch: Batch, row: int, camera: Camera | None) -> WeedField:
    plants, tracks, _ = batch
    there = plants.exists[row]
    crops = plants.crop[row, :, G.along] < FAR_M
    names = ("species", "stage", "luck", "look")
    reports = None
    if tracks is not None:
        here = row, slice(int(tracks.count[row]))
        told = {name: getattr(tracks, name)[here] for name in ("species", "stage", "crop_gap_m")}
        behind = tracks.real[here].astype(np.int64)
        reports = field.Reports(*tracks.report[here].T, *tracks.aim[here].T, **told, behind=behind)
    return WeedField(
        field.Weeds(*plants.weed[row, there].T, **{name: getattr(plants, name)[row, there] for name in names}),
        field.Crops(*plants.crop[row, crops].T, luck=plants.crop_luck[row, crops]),
        field.Ground(plants.ground_look[row : row + 1]),
        reports,
        None if tracks is None else camera,
    )
