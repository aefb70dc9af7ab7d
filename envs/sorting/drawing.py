"""Draws streams of produce: when and where items come down the belt, how they lie, and what a camera reports of them.

Each world hands over blocks of uniform and normal numbers from its own generator; everything else follows from them
world by world, so a world's stream does not depend on how many worlds are drawn beside it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...kernels import compiled, fill
from ..core import Array
from ..dice import draw_blocks, poisson_table
from .chances import ERROR, GHOST, SEEN, U, Z
from .columns import ITEM, REPORT, Item, Report
from .config import PerceptionModel, SortingConfig
from .field import Streams

FRUIT = 1
"""Kinds: 0 tuber, 1 fruit; grades 2 * kind and 2 * kind + 1."""

_FALSE_RESERVE = 5.0
_NEIGHBOURS = 5
_GHOST_CENTRE_M, _GHOST_THICKNESS = 0.014, 0.5


class Stream(NamedTuple):
    """What a stream is drawn from: the configuration in the shape that a kernel takes.

    Attributes:
        stay: chance that the next item belongs to the same clump.
        gap_s: (2,), mean time between the items of a clump, and between clumps.
        stream_s: items come for this long.
        start_s: when an item passes x = 0 that lies at the beginning of the belt at time 0, negated.
        speed_m_s: of the belt.
        half_width_m: item centres keep to this distance from the belt's middle.
        fruit_share: share of fruits.
        low: (2, 3), by kind: smallest length, width / length and thickness / width.
        span: (2, 3), how much larger the largest is.
        levels: (2, 3), number of values on the raster.
        tilt_sigma_rad: of the Rayleigh law.
        tilt_max_rad: largest tilt.
        ware_from_m: tubers at least this long are ware.
        ripe_from: fruits at least this ripe are ripe.
        skin_sigma: how far the skin's colour is from the ripeness.
        slip_sigma_m: how far an item has left its place, along and across.
    """

    stay: float
    gap_s: Array
    stream_s: float
    start_s: float
    speed_m_s: float
    half_width_m: float
    fruit_share: float
    low: Array
    span: Array
    levels: Array
    tilt_sigma_rad: float
    tilt_max_rad: float
    ware_from_m: float
    ripe_from: float
    skin_sigma: float
    slip_sigma_m: float

    @classmethod
    def of(cls, config: SortingConfig) -> Stream:
        """The numbers of a configuration."""
        scenario, produce, belt = config.scenario, config.produce, config.belt
        stay = 1.0 - 1.0 / scenario.clump
        apart_s = scenario.clump * (1.0 / scenario.rate_hz - stay * scenario.clump_gap_s)
        ranges = np.array(
            [
                [produce.tuber_length_m, produce.tuber_width, produce.thickness],
                [produce.fruit_length_m, produce.fruit_width, produce.thickness],
            ]
        )
        levels = np.full((2, 3), float(produce.shape_levels))
        levels[:, 0] = np.round((ranges[:, 0, 1] - ranges[:, 0, 0]) / produce.length_step_m) + 1.0
        return cls(
            stay=float(stay),
            gap_s=np.array([scenario.clump_gap_s, apart_s]),
            stream_s=float(scenario.stream_s),
            start_s=float(belt.start_x_m / belt.speed_m_s),
            speed_m_s=float(belt.speed_m_s),
            half_width_m=float(belt.item_half_width_m),
            fruit_share=float(produce.fruit_share),
            low=ranges[..., 0].copy(),
            span=ranges[..., 1] - ranges[..., 0],
            levels=levels,
            tilt_sigma_rad=float(produce.tilt_sigma_rad),
            tilt_max_rad=float(produce.tilt_max_rad),
            ware_from_m=float(produce.ware_from_m),
            ripe_from=float(produce.ripe_from),
            skin_sigma=float(produce.skin_sigma),
            slip_sigma_m=float(belt.slip_sigma_m),
        )


class CameraModel(NamedTuple):
    """What reports are drawn from: the perception model in the shape that a kernel takes.

    Attributes:
        recall: share of items that are reported.
        limits: (4, 3), cumulative confusion by true grade.
        bias_m: (3,), of the reported centre.
        sigma_m: (3,), of the reported centre.
        yaw_sigma_rad: (2,), by kind.
        tilt_sigma_rad: (2,), by kind and horizontal component.
        length_sigma: relative error of the reported axes.
        ghosts: (G,), cumulative probabilities of 0, 1, ... reports of nothing.
        ghost_length_m: shortest reported length of nothing.
        report_s: from when a centre passes x = 0 to when its report arrives.
    """

    recall: float
    limits: Array
    bias_m: Array
    sigma_m: Array
    yaw_sigma_rad: Array
    tilt_sigma_rad: Array
    length_sigma: float
    ghosts: Array
    ghost_length_m: float
    report_s: float

    @classmethod
    def of(cls, config: SortingConfig, perception: PerceptionModel) -> CameraModel:
        """The numbers of a configuration."""
        scenario, belt = config.scenario, config.belt
        return cls(
            recall=float(perception.recall),
            limits=np.cumsum(np.asarray(perception.confusion, float), axis=1)[:, :-1].copy(),
            bias_m=np.array(perception.bias_m, float),
            sigma_m=np.array(perception.sigma_m, float),
            yaw_sigma_rad=np.array(perception.yaw_sigma_rad, float),
            tilt_sigma_rad=np.array(perception.tilt_sigma_rad, float),
            length_sigma=float(perception.length_sigma),
            ghosts=poisson_table(perception.false_per_item * scenario.rate_hz * scenario.stream_s, _FALSE_RESERVE, 1),
            ghost_length_m=float(config.produce.tuber_length_m[0]),
            report_s=float((belt.camera_x_m + 0.5 * belt.camera_step_m) / belt.speed_m_s + belt.latency_s),
        )


def draw_streams(
    stream: Stream, camera: CameraModel, generators: Sequence[np.random.Generator], items: int, reports: int
) -> Streams:
    """Draw a stream and what the camera reports of it from each generator; the stream's numbers come first.

    Args:
        stream: what streams are drawn from.
        camera: what reports are drawn from.
        generators: one a world.
        items: most items of a world.
        reports: most reports of a world; 0: nothing is reported.
    """
    worlds = len(generators)
    looks = len(SEEN) * items + 1 + len(GHOST) * len(camera.ghosts)
    uniform, normal, seen, errors = draw_blocks(generators, (len(U) * items, len(Z) * items, looks, len(ERROR) * items))
    drawn = Streams(
        np.empty((worlds, items + 1, len(Item._fields))),
        np.empty((worlds, reports, len(Report._fields))),
        (seen[:, 0] * 2.0**52).astype(np.int64),
    )
    draw_items(stream, drawn.items, uniform, normal)
    if reports:
        draw_reports(stream, camera, drawn.items, seen, errors, drawn.reports)
    return drawn


def report_streams(
    stream: Stream, camera: CameraModel, items: Array, generator: np.random.Generator, reports: int
) -> Array:
    """What the camera reports (R, reports, REPORT) of items (R, N + 1, ITEM) that were not drawn with it."""
    worlds, n = len(items), items.shape[1] - 1
    seen = generator.random((worlds, len(SEEN) * n + 1 + len(GHOST) * len(camera.ghosts)))
    drawn = np.empty((worlds, reports, len(Report._fields)))
    draw_reports(stream, camera, items, seen, generator.standard_normal((worlds, len(ERROR) * n)), drawn)
    return drawn


@compiled
def gap_s(stream: Stream, wait: float, together: float) -> float:
    """Seconds to the next arrival from uniform numbers: exponential, short within a clump."""
    return -math.log1p(-wait) * stream.gap_s[0 if together < stream.stay else 1]


@compiled
def delayed_s(lane: Array, i: int, speed_m_s: float) -> float:
    """When item ``i`` of a world comes, at the earliest, so that it overlaps none of the five before it."""
    earliest = lane[i, ITEM.passing_s]
    for j in range(max(i - _NEIGHBOURS, 0), i):
        reach = 0.5 * lane[j, ITEM.length_m] + 0.5 * lane[i, ITEM.length_m]
        across = lane[j, ITEM.across_m] - lane[i, ITEM.across_m]
        square = reach * reach - across * across
        # Items that pass beside each other do not wait for each other at all.
        if square > 0.0:
            earliest = max(earliest, lane[j, ITEM.passing_s] + math.sqrt(square) * (1.0 / speed_m_s))
    return earliest


@compiled
def centre_height_m(length_m: float, width: float, thickness: float, yaw: float, tilt: float, azimuth: float) -> float:
    """Height of an ellipsoid's centre over the plane it touches."""
    # The third row of the turned frame: how much of each axis points up.
    lean = math.sin(tilt)
    long_up = -lean * math.cos(azimuth - yaw)
    wide_up = -lean * math.sin(azimuth - yaw) * width
    short_up = thickness * math.cos(tilt)
    return 0.5 * length_m * math.sqrt(long_up * long_up + wide_up * wide_up + short_up * short_up)


@compiled
def on_raster(stream: Stream, kind: int, size: int, draw: float) -> float:
    """A value on the raster over a range: ``size`` 0 length, 1 width, 2 thickness."""
    levels = stream.levels[kind, size]
    return stream.low[kind, size] + stream.span[kind, size] * (math.floor(draw * levels) / max(levels - 1.0, 1.0))


@compiled
def draw_items(stream: Stream, items: Array, uniform: Array, normal: Array) -> None:
    """Lay the items (R, N + 1, ITEM) of worlds, in order of arrival, from their random blocks (R, .)."""
    n = uniform.shape[1] // len(U)
    for r in range(len(items)):
        u, z, lane = uniform[r].reshape(len(U), n), normal[r].reshape(len(Z), n), items[r]
        for i in range(len(lane)):
            fill(lane[i], np.inf)
        start_s = 0.0
        for i in range(n):
            start_s += gap_s(stream, u[U.wait, i], u[U.together, i])
            if start_s >= stream.stream_s:
                break
            draw_item(stream, lane[i], u[:, i], z[:, i])
            lane[i, ITEM.passing_s] = start_s
            lane[i, ITEM.passing_s] = delayed_s(lane, i, stream.speed_m_s)
        for i in range(n):
            lane[i, ITEM.passing_s] -= stream.start_s


@compiled
def draw_item(stream: Stream, item: Array, u: Array, z: Array) -> None:
    """What one item is and how it lies, from its uniform and normal numbers."""
    kind = 1 if u[U.kind] < stream.fruit_share else 0
    item[ITEM.across_m] = stream.half_width_m * (2.0 * u[U.across] - 1.0)
    item[ITEM.yaw_rad], item[ITEM.azimuth_rad] = math.pi * (u[U.yaw] - 0.5), 2.0 * math.pi * u[U.azimuth]
    item[ITEM.tilt_rad] = min(stream.tilt_sigma_rad * math.sqrt(-2.0 * math.log1p(-u[U.tilt])), stream.tilt_max_rad)
    item[ITEM.length_m] = on_raster(stream, kind, 0, u[U.length])
    item[ITEM.width] = on_raster(stream, kind, 1, u[U.width])
    item[ITEM.thickness] = item[ITEM.width] * on_raster(stream, kind, 2, u[U.thickness])
    item[ITEM.up_m] = centre_height_m(
        item[ITEM.length_m],
        item[ITEM.width],
        item[ITEM.thickness],
        item[ITEM.yaw_rad],
        item[ITEM.tilt_rad],
        item[ITEM.azimuth_rad],
    )
    second = u[U.ripeness] < stream.ripe_from if kind == FRUIT else item[ITEM.length_m] < stream.ware_from_m
    item[ITEM.grade] = 2.0 * kind + (1.0 if second else 0.0)
    item[ITEM.ripeness] = u[U.ripeness]
    item[ITEM.skin] = min(max(u[U.ripeness] + stream.skin_sigma * z[Z.skin], 0.0), 1.0)
    item[ITEM.grip_luck], item[ITEM.way_luck] = u[U.grip], u[U.way]
    item[ITEM.slip_along_m] = stream.slip_sigma_m * z[Z.slip_along]
    item[ITEM.slip_across_m] = stream.slip_sigma_m * z[Z.slip_across]


@compiled
def draw_reports(
    stream: Stream, camera: CameraModel, items: Array, uniform: Array, normal: Array, reports: Array
) -> None:
    """Write what the statistical camera reports (R, M, REPORT) of items (R, N + 1, ITEM), from blocks of its own."""
    n = normal.shape[1] // len(ERROR)
    for r in range(len(items)):
        u, z = uniform[r, : len(SEEN) * n].reshape(len(SEEN), n), normal[r].reshape(len(ERROR), n)
        fill(reports[r, :, REPORT.passing_s], np.inf)
        fill(reports[r, :, REPORT.item], items.shape[1] - 1.0)
        for i in range(n):
            if items[r, i, ITEM.passing_s] == np.inf:
                break
            if u[SEEN.seen, i] < camera.recall:
                draw_report(stream, camera, items[r, i], u[SEEN.grade, i], z[:, i], reports[r, i])
                reports[r, i, REPORT.item] = i
        draw_ghosts(stream, camera, uniform[r, len(SEEN) * n :], reports[r, n:])
        for m in range(reports.shape[1]):
            reports[r, m, REPORT.seen_s] = reports[r, m, REPORT.passing_s] + camera.report_s


@compiled
def draw_report(stream: Stream, camera: CameraModel, item: Array, u: float, z: Array, report: Array) -> None:
    """What the camera says of one item that it sees."""
    true_grade = int(item[ITEM.grade])
    lean = camera.tilt_sigma_rad[true_grade // 2]
    lean_x = item[ITEM.tilt_rad] * math.cos(item[ITEM.azimuth_rad]) + lean * z[ERROR.lean_x]
    lean_y = item[ITEM.tilt_rad] * math.sin(item[ITEM.azimuth_rad]) + lean * z[ERROR.lean_y]
    length = 1.0 + camera.length_sigma * z[ERROR.length]
    report[REPORT.passing_s] = (
        item[ITEM.passing_s] - (camera.bias_m[0] + camera.sigma_m[0] * z[ERROR.along]) / stream.speed_m_s
    )
    report[REPORT.across_m] = item[ITEM.across_m] + camera.bias_m[1] + camera.sigma_m[1] * z[ERROR.across]
    report[REPORT.up_m] = item[ITEM.up_m] + camera.bias_m[2] + camera.sigma_m[2] * z[ERROR.up]
    report[REPORT.yaw_rad] = item[ITEM.yaw_rad] + camera.yaw_sigma_rad[true_grade // 2] * z[ERROR.yaw]
    report[REPORT.tilt_rad] = math.sqrt(lean_x * lean_x + lean_y * lean_y)
    report[REPORT.azimuth_rad] = math.atan2(lean_y, lean_x)
    report[REPORT.length_m] = item[ITEM.length_m] * length
    report[REPORT.width] = min(item[ITEM.width] * (1.0 + camera.length_sigma * z[ERROR.width]) / length, 1.0)
    report[REPORT.thickness] = min(
        item[ITEM.thickness] * (1.0 + camera.length_sigma * z[ERROR.thickness]) / length, 1.0
    )
    report[REPORT.grade] = 0.0
    for column in range(camera.limits.shape[1]):
        if u > camera.limits[true_grade, column]:
            report[REPORT.grade] += 1.0


@compiled
def draw_ghosts(stream: Stream, camera: CameraModel, draws: Array, reports: Array) -> None:
    """Reports (G, REPORT) of nothing: a stain on the belt that looks like a small level item."""
    u = draws[1:].reshape(len(GHOST), len(camera.ghosts))
    for g in range(len(camera.ghosts)):
        # The number of ghosts is the first whose cumulative probability exceeds the draw.
        if draws[0] < camera.ghosts[g]:
            break
        report = reports[g]
        report[REPORT.passing_s] = stream.stream_s * u[GHOST.passing, g] - stream.start_s
        report[REPORT.across_m] = stream.half_width_m * (2.0 * u[GHOST.across, g] - 1.0)
        report[REPORT.up_m] = _GHOST_CENTRE_M
        report[REPORT.yaw_rad] = math.pi * (u[GHOST.yaw, g] - 0.5)
        report[REPORT.tilt_rad] = report[REPORT.azimuth_rad] = 0.0
        report[REPORT.length_m] = camera.ghost_length_m + 0.01 * u[GHOST.length, g]
        report[REPORT.width], report[REPORT.thickness] = 0.65 + 0.3 * u[GHOST.width, g], _GHOST_THICKNESS
        report[REPORT.grade] = min(math.floor(4.0 * u[GHOST.grade, g]), 3.0)
