"""Fields of several worlds side by side, in the rules' padded slots, and the way from fields to them and back."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled, fill
from ...kernels.orders import rank
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
    level ground, ``closings`` (R, N, 2) where nothing wilts.
    """

    heads: Heads
    plants: Plants
    tracks: Tracks | None
    luck: Array | None = None
    stands: Array | None = None
    closings: Array | None = None


def stop_centres(scenario: ScenarioConfig) -> Array:
    """Middle of every stop's window along the row, shape (S,), metres."""
    offset = 0.0 if scenario.potted else 0.5 * scenario.window_m
    return offset + scenario.window_m * np.arange(scenario.stops, dtype=np.float64)


class Lanes(NamedTuple):
    """What the fixed order of reports depends on.

    Attributes:
        begin_m: where the first stop's window begins along the row.
        window_m: length of a stop's window.
        lane_m: width of a lane across the arm's way.
        stops: how many there are.
    """

    begin_m: float
    window_m: float
    lane_m: float
    stops: int

    @classmethod
    def of(cls, config: SafflowerConfig) -> Lanes:
        """The numbers of a configuration."""
        scenario = config.scenario
        begin_m = float(stop_centres(scenario)[0] - 0.5 * scenario.window_m)
        return cls(begin_m, float(scenario.window_m), float(config.lane_m), int(scenario.stops))


def fixed_order(
    config: SafflowerConfig, position: Array, seen: NDArray[np.bool_]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Sort reports (R, M, 3) into the fixed order; unseen ones come last.

    Returns:
        The order (R, M) and each stop's first place in it (R, S + 1).
    """
    lanes = Lanes.of(config)
    order = np.empty(seen.shape, np.int64)
    first = np.empty((len(seen), lanes.stops + 1), np.int64)
    _sort(lanes, np.ascontiguousarray(position, np.float64), seen, order, first)
    return order, first


@compiled
def _sort(
    lanes: Lanes, position: Array, seen: NDArray[np.bool_], order: NDArray[np.int64], first: NDArray[np.int64]
) -> None:
    room = seen.shape[1]
    reports, keys, spare = np.empty(room, np.int64), np.empty(room), np.empty(room, np.int64)
    for r in range(len(seen)):
        count = 0
        for i in range(room):
            if seen[r, i]:
                reports[count] = i
                count += 1
        in_lanes(lanes, position[r], reports, count, keys, order[r], spare, first[r])
        for i in range(room):
            if not seen[r, i]:
                order[r, count] = i
                count += 1


@compiled
def in_lanes(
    lanes: Lanes,
    position: Array,
    reports: NDArray[np.int64],
    count: int,
    keys: Array,
    order: NDArray[np.int64],
    spare: NDArray[np.int64],
    first: NDArray[np.int64],
) -> None:
    """Write the first ``count`` reports of a world in the fixed order, and each stop's first place in it.

    Args:
        lanes: see there.
        position: places of all reports (M, 3), world metres.
        reports: which of them there are, ascending.
        count: how many.
        keys: room for as many numbers.
        order: is written.
        spare: room for as many places.
        first: is written, (S + 1,).
    """
    fill(first, 0)
    for k in range(count):
        along, across = position[reports[k], 0] - lanes.begin_m, position[reports[k], 1]
        stop = min(max(math.floor(along / lanes.window_m), 0.0), lanes.stops - 1.0)
        lane = min(max(math.floor((along - stop * lanes.window_m) / lanes.lane_m), 0.0), 99.0)
        aside = across if lane % 2.0 == 0.0 else -across
        keys[k] = 1000.0 * stop + 10.0 * lane + min(max(aside, -4.0), 4.0)
        first[int(stop) + 1] += 1
    for stop in range(lanes.stops):
        first[stop + 1] += first[stop]
    rank(keys[:count], order, spare)
    for k in range(count):
        order[k] = reports[order[k]]


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
