"""Fields of several worlds side by side, in the rules' padded slots, and the way from fields to them and back."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import allocated, shaped
from ..core import Array
from ..field import Camera
from . import field
from .config import PerceptionModel, SafflowerConfig, ScenarioConfig
from .field import SafflowerField


class Heads(NamedTuple):
    """True heads of R worlds, N slots each; what does not exist has no mass and lies at the origin."""

    position: Annotated[Array, shaped("heads", 3)]
    """World metres (along, across, up)."""
    exists: Annotated[NDArray[np.bool_], shaped("heads")]
    """Whether a head is in the slot."""
    stage: Annotated[NDArray[np.int64], shaped("heads")]
    """Index into ``STAGES``."""
    mass_g: Annotated[Array, shaped("heads")]
    """Useful filaments: open heads only."""
    size_m: Annotated[Array, shaped("heads")]
    """Filament spread."""
    occluded: Annotated[NDArray[np.bool_], shaped("heads")]
    """Whether leaves hang over it."""
    cut_luck: Annotated[Array, shaped("heads")]
    """Standard normal."""
    drop_luck: Annotated[Array, shaped("heads")]
    """Standard normal."""
    plant: Annotated[NDArray[np.int64], shaped("heads")]
    """Index of its plant."""


class Plants(NamedTuple):
    """Plants of R worlds, P slots each."""

    base: Annotated[Array, shaped("plants", 3)]
    """Where the stem leaves the ground."""
    height_m: Annotated[Array, shaped("plants")]
    """Of the plant."""
    crown_m: Annotated[Array, shaped("plants")]
    """Width of the crown."""
    count: Annotated[NDArray[np.int64], shaped()]  # type: ignore[override]
    """How many of them there are."""


class Tracks(NamedTuple):
    """What the camera reports, M slots a world, in the fixed order: by stop, lane by lane, to and fro."""

    position: Annotated[Array, shaped("tracks", 3)]
    """Reported world position."""
    stage: Annotated[NDArray[np.int64], shaped("tracks")]
    """Reported stage."""
    size_m: Annotated[Array, shaped("tracks")]
    """Reported filament spread."""
    head: Annotated[NDArray[np.int64], shaped("tracks", empty="heads")]
    """Index of the true head, N where there is none."""
    first: Annotated[NDArray[np.int64], shaped("stops")]
    """Index of each stop's first report; the last entry ends the last stop."""


class Batch(NamedTuple):
    """Fields of R worlds.

    ``tracks`` is None where a camera still has to look, ``luck`` (R, J) where no drive errs, ``stands`` (R, S, 3) on
    level ground.
    """

    heads: Heads
    plants: Plants
    tracks: Tracks | None
    luck: Array | None = None
    stands: Array | None = None


def stop_centres(scenario: ScenarioConfig) -> Array:
    """Middle of every stop's window along the row, shape (S,), metres."""
    offset = 0.0 if scenario.potted else 0.5 * scenario.window_m
    return offset + scenario.window_m * np.arange(scenario.stops, dtype=np.float64)


def fixed_order(
    config: SafflowerConfig, position: Array, seen: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sort reports (R, M, 3) into the fixed order; unseen ones come last.

    Returns:
        The order (R, M) and each stop's first place in it (R, S + 1).
    """
    scenario = config.scenario
    stops = scenario.stops
    left = stop_centres(scenario)[0] - 0.5 * scenario.window_m
    along = position[..., 0] - left
    stop = np.minimum(np.maximum(np.floor(along / scenario.window_m), 0), stops - 1)
    lane = np.minimum(np.maximum(np.floor((along - stop * scenario.window_m) / config.lane_m), 0), 99)
    across = np.where(lane % 2.0 == 0.0, position[..., 1], -position[..., 1])
    key = np.where(seen, 1000.0 * stop + 10.0 * lane + np.minimum(np.maximum(across, -4.0), 4.0), np.inf)
    order = np.argsort(key, axis=1, kind="stable")
    stops_before = stops * np.arange(len(seen))[:, None]
    counts = np.bincount((stop.astype(np.int64) + stops_before)[seen], minlength=len(seen) * stops)
    first = np.concatenate([np.zeros((len(seen), 1), int), counts.reshape(-1, stops).cumsum(axis=1)], axis=1)
    return order, first


def stack(config: SafflowerConfig, fields: Sequence[SafflowerField]) -> Batch:
    """The batch of fields in which nothing is missing and that fit; see ``filling``."""
    scenario, rows = config.scenario, len(fields)
    slots = scenario.plants * scenario.max_heads
    heads = allocated(Heads, rows, heads=slots)
    plants = allocated(Plants, rows, plants=scenario.plants)
    for row, one in enumerate(fields):
        slot = one.heads.slot
        heads.exists[row, slot] = True
        heads.position[row, slot] = places(one.heads)
        for name in ("stage", "mass_g", "size_m", "occluded", "cut_luck", "drop_luck", "plant"):
            getattr(heads, name)[row, slot] = getattr(one.heads, name)
        assert one.plants is not None
        count = plants.count[row] = len(one.plants)
        plants.base[row, :count] = places(one.plants)
        plants.height_m[row, :count], plants.crown_m[row, :count] = one.plants.height_m, one.plants.crown_m
    reports = [one.reports for one in fields if one.reports is not None]
    if len(reports) < rows:
        return Batch(heads, plants, None)
    return Batch(heads, plants, _tracks(config, slots, reports, [one.heads.slot for one in fields]))


def _tracks(
    config: SafflowerConfig, slots: int, reports: Sequence[field.Reports], slot: Sequence[NDArray[np.int64]]
) -> Tracks:
    """Reports in the fixed order; ``slot`` says where each row of the heads is kept."""
    most, stops = max(len(table) for table in reports), config.scenario.stops
    tracks = allocated(Tracks, len(reports), tracks=most, heads=slots + 1, stops=stops + 1)
    seen = np.zeros(tracks.head.shape, bool)
    for row, table in enumerate(reports):
        here = slice(len(table))
        seen[row, here], tracks.position[row, here] = True, places(table)
        tracks.stage[row, here], tracks.size_m[row, here] = table.stage, table.size_m
        # The last entry stands for the head -1: none.
        tracks.head[row, here] = np.append(slot[row], slots)[table.head]
    order, first = fixed_order(config, tracks.position, seen)
    rows = np.arange(len(reports))[:, None]
    return Tracks._make([*(values[rows, order] for values in tracks[:-1]), first])


def places(table: field.Plants | field.Heads | field.Reports) -> Array:
    """World positions (n, 3) of a table's rows."""
    return np.column_stack([table.along_m, table.across_m, table.up_m])


def unstack(batch: Batch, perception: PerceptionModel | None) -> list[SafflowerField]:
    """The fields of a batch, whose reports, where there are any, are those of ``perception``."""
    camera = None if perception is None or batch.tracks is None else Camera.of(perception)
    return [_field(batch, row, camera) for row in range(len(batch.heads.exists))]


def _field(batch: Batch, row: int, camera: Camera | None) -> SafflowerField:
    heads, plants, tracks = batch[:3]
    slot, count = np.flatnonzero(heads.exists[row]), int(plants.count[row])
    names = ("stage", "mass_g", "size_m", "occluded", "cut_luck", "drop_luck", "plant")
    reports = None
    if tracks is not None:
        here = slice(int(tracks.first[row, -1]))
        place = np.full(heads.exists.shape[1] + 1, -1)
        place[slot] = np.arange(len(slot))
        stage, size_m, head = tracks.stage[row, here], tracks.size_m[row, here], place[tracks.head[row, here]]
        reports = field.Reports(*tracks.position[row, here].T, stage=stage, size_m=size_m, head=head)
    return SafflowerField(
        field.Heads(
            *heads.position[row, slot].T, **{name: getattr(heads, name)[row, slot] for name in names}, slot=slot
        ),
        field.Plants(
            *plants.base[row, :count].T, height_m=plants.height_m[row, :count], crown_m=plants.crown_m[row, :count]
        ),
        reports,
        camera,
    )
