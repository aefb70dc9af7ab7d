"""Draws streams of produce: when and where items come down the belt, how they lie, and what a camera reports of them.

Each world's own generator begins two quick ones, of its stream and of what the camera makes of it. They hand out
numbers item by item, as many as there are items: a stream depends neither on the camera nor on what is drawn beside it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...kernels import compiled, fill
from ...kernels.angles import bearing, sine_cosine
from ...kernels.sfc import SEEDS, begun
from ...kernels.ziggurat import exponentials, normals, uniform, uniforms
from ..core import Array
from ..dice import draw_blocks, poisson_table
from .chances import ERROR, GHOST, SEEN, WAIT, U, Z
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


@np.errstate(over="ignore")
def draw_streams(
    stream: Stream, camera: CameraModel, generators: Sequence[np.random.Generator], items: int, reports: int
) -> Streams:
    """Draw a stream and what the camera reports of it for each generator.

    Args:
        stream: what streams are drawn from.
        camera: what reports are drawn from.
        generators: one a world.
        items: most items of a world.
        reports: most reports of a world; 0: nothing is reported.
    """
    worlds = len(generators)
    (first,) = draw_blocks(generators, (1 + 2 * SEEDS,))
    drawn = Streams(
        np.empty((worlds, items + 1, len(Item._fields))),
        np.empty((worlds, reports, len(Report._fields))),
        (first[:, 0] * 2.0**52).astype(np.int64),
    )
    draw_items(stream, drawn.items, first[:, 1 : 1 + SEEDS])
    if reports:
        draw_reports(stream, camera, drawn.items, first[:, 1 + SEEDS :], drawn.reports)
    return drawn


@np.errstate(over="ignore")
def report_streams(
    stream: Stream, camera: CameraModel, items: Array, generator: np.random.Generator, reports: int
) -> Array:
    """What the camera reports (R, reports, REPORT) of items (R, N + 1, ITEM) that were not drawn with it."""
    drawn = np.empty((len(items), reports, len(Report._fields)))
    draw_reports(stream, camera, items, generator.random((len(items), SEEDS)), drawn)
    return drawn


@compiled
def gap_s(stream: Stream, wait: float, together: float) -> float:
    """Seconds to the next arrival from an exponential and a uniform number: short within a clump."""
    return wait * stream.gap_s[0 if together < stream.stay else 1]


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
    lean, upright = sine_cosine(tilt)
    sine, cosine = sine_cosine(azimuth - yaw)
    long_up = -lean * cosine
    wide_up = -lean * sine * width
    short_up = thickness * upright
    return 0.5 * length_m * math.sqrt(long_up * long_up + wide_up * wide_up + short_up * short_up)


@compiled
def on_raster(stream: Stream, kind: int, size: int, draw: float) -> float:
    """A value on the raster over a range: ``size`` 0 length, 1 width, 2 thickness."""
    levels = stream.levels[kind, size]
    return stream.low[kind, size] + stream.span[kind, size] * (math.floor(draw * levels) / max(levels - 1.0, 1.0))


@compiled
def draw_items(stream: Stream, items: Array, seeds: Array) -> None:
    """Lay the items (R, N + 1, ITEM) of worlds, in order of arrival, from numbers (R, SEEDS) that begin a generator."""
    wait, u, z = np.empty(len(WAIT)), np.empty(len(U)), np.empty(len(Z))
    for r in range(len(items)):
        state, lane = begun(seeds[r]), items[r]
        start_s, count = 0.0, 0
        while count < len(lane) - 1:
            state = normals(uniforms(exponentials(state, wait), u), z)
            start_s += gap_s(stream, wait[WAIT.gap], u[U.together])
            if start_s >= stream.stream_s:
                break
            draw_item(stream, lane[count], wait[WAIT.tilt], u, z)
            lane[count, ITEM.passing_s] = start_s
            lane[count, ITEM.passing_s] = delayed_s(lane, count, stream.speed_m_s)
            count += 1
        for i in range(count):
            lane[i, ITEM.passing_s] -= stream.start_s
        for i in range(count, len(lane)):
            fill(lane[i], np.inf)


@compiled
def draw_item(stream: Stream, item: Array, tilt: float, u: Array, z: Array) -> None:
    """What one item is and how it lies, from its exponential, uniform and normal numbers."""
    kind = 1 if u[U.kind] < stream.fruit_share else 0
    item[ITEM.across_m] = stream.half_width_m * (2.0 * u[U.across] - 1.0)
    item[ITEM.yaw_rad], item[ITEM.azimuth_rad] = math.pi * (u[U.yaw] - 0.5), 2.0 * math.pi * u[U.azimuth]
    item[ITEM.tilt_rad] = min(stream.tilt_sigma_rad * math.sqrt(2.0 * tilt), stream.tilt_max_rad)
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
def draw_reports(stream: Stream, camera: CameraModel, items: Array, seeds: Array, reports: Array) -> None:
    """Write what the statistical camera reports (R, M, REPORT) of items (R, N + 1, ITEM); ``seeds`` as above."""
    u, z, n = np.empty(len(SEEN)), np.empty(len(ERROR)), items.shape[1] - 1
    for r in range(len(items)):
        state, said = begun(seeds[r]), reports[r]
        fill(said[:, REPORT.passing_s], np.inf)
        fill(said[:, REPORT.item], n)
        for i in range(n):
            if items[r, i, ITEM.passing_s] == np.inf:
                break
            state = normals(uniforms(state, u), z)
            if u[SEEN.seen] < camera.recall:
                draw_report(stream, camera, items[r, i], u[SEEN.grade], z, said[i])
                said[i, REPORT.item] = i
        draw_ghosts(stream, camera, state, said[n:])
        for m in range(len(said)):
            said[m, REPORT.seen_s] = said[m, REPORT.passing_s] + camera.report_s


@compiled
def draw_report(stream: Stream, camera: CameraModel, item: Array, u: float, z: Array, report: Array) -> None:
    """What the camera says of one item that it sees."""
    true_grade = int(item[ITEM.grade])
    lean = camera.tilt_sigma_rad[true_grade // 2]
    sine, cosine = sine_cosine(item[ITEM.azimuth_rad])
    lean_x = item[ITEM.tilt_rad] * cosine + lean * z[ERROR.lean_x]
    lean_y = item[ITEM.tilt_rad] * sine + lean * z[ERROR.lean_y]
    length = 1.0 + camera.length_sigma * z[ERROR.length]
    report[REPORT.passing_s] = (
        item[ITEM.passing_s] - (camera.bias_m[0] + camera.sigma_m[0] * z[ERROR.along]) / stream.speed_m_s
    )
    report[REPORT.across_m] = item[ITEM.across_m] + camera.bias_m[1] + camera.sigma_m[1] * z[ERROR.across]
    report[REPORT.up_m] = item[ITEM.up_m] + camera.bias_m[2] + camera.sigma_m[2] * z[ERROR.up]
    report[REPORT.yaw_rad] = item[ITEM.yaw_rad] + camera.yaw_sigma_rad[true_grade // 2] * z[ERROR.yaw]
    report[REPORT.tilt_rad] = math.sqrt(lean_x * lean_x + lean_y * lean_y)
    report[REPORT.azimuth_rad] = bearing(lean_y, lean_x)
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
def draw_ghosts(stream: Stream, camera: CameraModel, state: Any, reports: Array) -> None:
    """Reports (G, REPORT) of nothing: a stain on the belt that looks like a small level item."""
    u = np.empty(len(GHOST))
    number, state = uniform(state)
    for g in range(len(camera.ghosts)):
        # The number of ghosts is the first whose cumulative probability exceeds the draw.
        if number < camera.ghosts[g]:
            break
        state, report = uniforms(state, u), reports[g]
        report[REPORT.passing_s] = stream.stream_s * u[GHOST.passing] - stream.start_s
        report[REPORT.across_m] = stream.half_width_m * (2.0 * u[GHOST.across] - 1.0)
        report[REPORT.up_m] = _GHOST_CENTRE_M
        report[REPORT.yaw_rad] = math.pi * (u[GHOST.yaw] - 0.5)
        report[REPORT.tilt_rad] = report[REPORT.azimuth_rad] = 0.0
        report[REPORT.length_m] = camera.ghost_length_m + 0.01 * u[GHOST.length]
        report[REPORT.width], report[REPORT.thickness] = 0.65 + 0.3 * u[GHOST.width], _GHOST_THICKNESS
        report[REPORT.grade] = min(math.floor(4.0 * u[GHOST.grade]), 3.0)
