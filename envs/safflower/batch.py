"""Fields of several worlds side by side, in the rules' padded slots, and the way from fields to them and back."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..core import Array
from ..field import Camera
from . import field
from .config import PerceptionModel, SafflowerConfig, ScenarioConfig
from .field import SafflowerField


@dataclass(frozen=True)
class Heads:
    """True heads of R worlds, N slots each; what does not exist has no mass and lies at the origin.

    Attributes:
        position: (R, N, 3), world metres (along, across, up).
        exists: (R, N).
        stage: (R, N), index into ``STAGES``.
        mass_g: (R, N), useful filaments: open heads only.
        size_m: (R, N), filament spread.
        occluded: (R, N).
        cut_luck: (R, N), standard normal.
        drop_luck: (R, N), standard normal.
        plant: (R, N), index of its plant.
    """

    position: Array
    exists: NDArray[np.bool_]
    stage: NDArray[np.int64]
    mass_g: Array
    size_m: Array
    occluded: NDArray[np.bool_]
    cut_luck: Array
    drop_luck: Array
    plant: NDArray[np.int64]


@dataclass(frozen=True)
class Plants:
    """Plants of R worlds, P slots each.

    Attributes:
        base: (R, P, 3), where the stem leaves the ground.
        height_m: (R, P).
        crown_m: (R, P).
        count: (R,), how many of them there are.
    """

    base: Array
    height_m: Array
    crown_m: Array
    count: NDArray[np.int64]


@dataclass(frozen=True)
class Tracks:
    """What the camera reports, M slots a world, in the fixed order: by stop, lane by lane, to and fro.

    Attributes:
        position: (R, M, 3), reported world position.
        stage: (R, M), reported stage.
        size_m: (R, M), reported filament spread.
        head: (R, M), index of the true head, N where there is none.
        first: (R, S + 1), index of each stop's first report; the last entry ends the last stop.
    """

    position: Array
    stage: NDArray[np.int64]
    size_m: Array
    head: NDArray[np.int64]
    first: NDArray[np.int64]


PartT = TypeVar("PartT", Heads, Plants, Tracks)


def _row(part: PartT, at: int) -> PartT:
    return type(part)(*(values[at : at + 1] for values in vars(part).values()))


class Batch(NamedTuple):
    """Fields of R worlds; ``tracks`` is None where a camera still has to look."""

    heads: Heads
    plants: Plants
    tracks: Tracks | None

    def row(self, at: int) -> Batch:
        """One of the fields, as a batch of one that shares the arrays."""
        tracks = None if self.tracks is None else _row(self.tracks, at)
        return Batch(_row(self.heads, at), _row(self.plants, at), tracks)


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
    heads = Heads(
        position=np.zeros((rows, slots, 3)),
        exists=np.zeros((rows, slots), bool),
        stage=np.zeros((rows, slots), np.int64),
        mass_g=np.zeros((rows, slots)),
        size_m=np.zeros((rows, slots)),
        occluded=np.zeros((rows, slots), bool),
        cut_luck=np.zeros((rows, slots)),
        drop_luck=np.zeros((rows, slots)),
        plant=np.zeros((rows, slots), np.int64),
    )
    base, height, crown = (np.zeros((rows, scenario.plants, *more)) for more in ((3,), (), ()))
    plants = Plants(base, height, crown, np.zeros(rows, np.int64))
    for row, one in enumerate(fields):
        slot = one.heads.slot
        heads.exists[row, slot] = True
        heads.position[row, slot] = places(one.heads)
        for name in ("stage", "mass_g", "size_m", "occluded", "cut_luck", "drop_luck", "plant"):
            getattr(heads, name)[row, slot] = getattr(one.heads, name)
        assert one.plants is not None
        count = plants.count[row] = len(one.plants)
        base[row, :count] = places(one.plants)
        height[row, :count], crown[row, :count] = one.plants.height_m, one.plants.crown_m
    reports = [one.reports for one in fields if one.reports is not None]
    if len(reports) < rows:
        return Batch(heads, plants, None)
    return Batch(heads, plants, _tracks(config, slots, reports, [one.heads.slot for one in fields]))


def _tracks(
    config: SafflowerConfig, slots: int, reports: Sequence[field.Reports], slot: Sequence[NDArray[np.int64]]
) -> Tracks:
    """Reports in the fixed order; ``slot`` says where each row of the heads is kept."""
    shape = len(reports), max(len(table) for table in reports)
    position, size = np.zeros((*shape, 3)), np.zeros(shape)
    stage, head, seen = np.zeros(shape, np.int64), np.full(shape, slots), np.zeros(shape, bool)
    for row, table in enumerate(reports):
        here = slice(len(table))
        seen[row, here], position[row, here] = True, places(table)
        stage[row, here], size[row, here] = table.stage, table.size_m
        # The last entry stands for the head -1: none.
        head[row, here] = np.append(slot[row], slots)[table.head]
    order, first = fixed_order(config, position, seen)
    rows = np.arange(shape[0])[:, None]
    return Tracks(position[rows, order], stage[rows, order], size[rows, order], head[rows, order], first)


def places(table: field.Plants | field.Heads | field.Reports) -> Array:
    """World positions (n, 3) of a table's rows."""
    return np.column_stack([table.along_m, table.across_m, table.up_m])


def unstack(batch: Batch, perception: PerceptionModel | None) -> list[SafflowerField]:
    """The fields of a batch, whose reports, where there are any, are those of ``perception``."""
    camera = None if perception is None or batch.tracks is None else Camera.of(perception)
    return [_field(batch, row, camera) for row in range(len(batch.heads.exists))]


def _field(batch: Batch, row: int, camera: Camera | None) -> SafflowerField:
    heads, plants, tracks = batch
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
