"""Fields of several worlds side by side, in the rules' padded slots, and the way from fields to them and back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import allocated, shaped
from ..core import Array
from ..field import Camera, Table
from . import field
from .config import ScenarioConfig
from .field import WeedField
from .gaps import nearest_weeds
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
    """Places of the crop plants of all rows, sorted along; they span one of each row beyond each end."""
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
    confidence: Annotated[Array, shaped("tracks")]
    """How sure the cameras are that it is a weed."""
    count: Annotated[NDArray[np.int64], shaped()]  # type: ignore[override]
    """How many there are."""


_TOLD = ("species", "stage", "crop_gap_m", "confidence")
"""What reports and tracks call the same."""


class Batch(NamedTuple):
    """Fields of R worlds.

    ``tracks`` is None where a camera still has to look, ``luck`` (R, J) where no drive errs, and there are no
    ``profiles`` on level ground.
    """

    plants: Plants
    tracks: Tracks | None
    luck: Array | None = None
    profiles: tuple[field.Profile, ...] = ()


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
    tracks = _tracks(plants, capacity, reports) if len(reports) == len(fields) else None
    return Batch(plants, tracks, profiles=tuple(one.profile for one in fields if one.profile is not None))


def _tracks(plants: Plants, capacity: int, reports: Sequence[field.Reports]) -> Tracks:
    tracks = allocated(Tracks, len(reports), tracks=capacity)
    for row, table in enumerate(reports):
        n = tracks.count[row] = len(table)
        tracks.report[row, :n], tracks.aim[row, :n] = places(table), places(table, "aim_along_m", "aim_across_m")
        for name in _TOLD:
            getattr(tracks, name)[row, :n] = getattr(table, name)
        tracks.real[row, :n] = table.behind == 1
    return tracks._replace(weed=nearest_weeds(plants.weed, tracks.aim))


def unstack(batch: Batch, camera: Camera | None) -> list[WeedField]:
    """The fields of a batch, whose reports, where there are any, are those of ``camera``."""
    return [_field(batch, row, camera) for row in range(len(batch.plants.exists))]


def _field(batch: Batch, row: int, camera: Camera | None) -> WeedField:
    plants, tracks, _, profiles = batch
    there = plants.exists[row]
    crops = plants.crop[row, :, G.along] < FAR_M
    names = ("species", "stage", "luck", "look")
    reports = None
    if tracks is not None:
        here = row, slice(int(tracks.count[row]))
        told = {name: getattr(tracks, name)[here] for name in _TOLD}
        behind = tracks.real[here].astype(np.int64)
        reports = field.Reports(*tracks.report[here].T, *tracks.aim[here].T, **told, behind=behind)
    return WeedField(
        field.Weeds(*plants.weed[row, there].T, **{name: getattr(plants, name)[row, there] for name in names}),
        field.Crops(*plants.crop[row, crops].T, luck=plants.crop_luck[row, crops]),
        field.Ground(plants.ground_look[row : row + 1]),
        reports,
        None if tracks is None else camera,
        profile=profiles[row] if profiles else None,
    )
