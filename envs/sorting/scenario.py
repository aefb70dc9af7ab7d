"""Draws streams of produce: when and where items come down the belt, how they lie, and what a camera reports of them.

Each world hands over blocks of uniform and normal numbers from its own generator; everything else is array arithmetic
over the worlds, so a world's stream does not depend on how many worlds are drawn beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from ...motion.orientation import axes, tilted
from ..core import Array
from .config import PerceptionModel, ProduceConfig, ScenarioConfig, SortingConfig

FRUIT = 1
"""Kinds: 0 tuber, 1 fruit; grades 2 * kind and 2 * kind + 1."""

_FALSE_RESERVE = 5.0
_NEIGHBOURS = 5
_DRAWS, _NORMALS, _SEEN_DRAWS, _SEEN_NORMALS = 13, 3, 2, 9
_GHOST_DRAWS = 6


@dataclass(frozen=True)
class Items:
    """True items of R worlds, N slots each, in the order of arrival; what does not exist comes at infinity.

    Attributes:
        arrival_s: (R, N), when the centre passes x = 0.
        y_m: (R, N), centre across the belt.
        z_m: (R, N), centre above the belt: the ellipsoid touches it.
        yaw: (R, N), rad in (-pi/2, pi/2], direction of the long axis before the tilt.
        tilt: (R, N), rad, lean of the short axis.
        azimuth: (R, N), rad, where it leans to.
        length_m: (R, N), full axes' lengths; ``width`` and ``thickness`` (R, N) are fractions of the length.
        width: see ``length_m``.
        thickness: see ``length_m``.
        ripeness: (R, N), of fruits.
        skin: (R, N), ripeness that the skin's colour suggests.
        grade: (R, N), index into ``GRADES``.
        exists: (R, N).
        luck: (R, N, 2), uniform: the grip's and the way's.
        slip_m: (R, N, 2), how far, along and across, the item has left its place on the belt when it is gripped.
    """

    arrival_s: Array
    y_m: Array
    z_m: Array
    yaw: Array
    tilt: Array
    azimuth: Array
    length_m: Array
    width: Array
    thickness: Array
    ripeness: Array
    skin: Array
    grade: NDArray[np.int64]
    exists: NDArray[np.bool_]
    luck: Array
    slip_m: Array


@dataclass(frozen=True)
class Reports:
    """What the camera says of items, M a world, in any order; shapes (R, M).

    Attributes:
        arrival_s: when the reported centre will pass x = 0; infinite where nothing is reported.
        y_m: across the belt.
        z_m: centre above the belt.
        yaw: rad.
        tilt: rad.
        azimuth: rad.
        length_m: full length.
        width: fraction of the length.
        thickness: fraction of the length.
        grade: index into ``GRADES``.
        seen_s: when the report arrives.
        item: true item behind it, N for none; for scoring alone.
    """

    arrival_s: Array
    y_m: Array
    z_m: Array
    yaw: Array
    tilt: Array
    azimuth: Array
    length_m: Array
    width: Array
    thickness: Array
    grade: NDArray[np.int64]
    seen_s: Array
    item: NDArray[np.int64]


@lru_cache(maxsize=32)
def false_table(mean: float) -> Array:
    """Cumulative Poisson probabilities of 0, 1, ... false reports, up to where they no longer matter."""
    slots = int(np.ceil(mean + _FALSE_RESERVE * np.sqrt(mean) + 1.0)) if mean > 0.0 else 0
    return stats.poisson.cdf(np.arange(slots), mean)


def ghost_slots(config: SortingConfig, perception: PerceptionModel) -> int:
    """Most reports of nothing in one stream."""
    return len(false_table(perception.false_per_item * config.scenario.rate_hz * config.scenario.stream_s))


def random_numbers(config: SortingConfig, perception: PerceptionModel) -> tuple[int, int, int, int]:
    """Lengths of a world's blocks: uniform and normal numbers of the stream, then of the camera."""
    n = config.scenario.max_items
    return (
        _DRAWS * n,
        _NORMALS * n,
        _SEEN_DRAWS * n + 1 + _GHOST_DRAWS * ghost_slots(config, perception),
        _SEEN_NORMALS * n,
    )


def draw_blocks(generators: Sequence[np.random.Generator], lengths: tuple[int, int, int, int]) -> list[Array]:
    """One block (R, n) for each of ``random_numbers``' lengths; the stream's numbers come first."""
    rows = [
        (g.random(lengths[0]), g.standard_normal(lengths[1]), g.random(lengths[2]), g.standard_normal(lengths[3]))
        for g in generators
    ]
    return [np.stack(column) for column in zip(*rows, strict=True)]


def gaps(scenario: ScenarioConfig, wait: Array, together: Array) -> Array:
    """Seconds between arrivals from uniform numbers (...): exponential, or short ones within clumps."""
    stay = 1.0 - 1.0 / scenario.clump
    apart = scenario.clump * (1.0 / scenario.rate_hz - stay * scenario.clump_gap_s)
    return -np.log1p(-wait) * np.where(together < stay, scenario.clump_gap_s, apart)


def keep_apart(arrival_s: Array, y_m: Array, radius_m: Array, speed_m_s: float) -> Array:
    """Delay items (R, N), in order of arrival, until none overlaps one of the five before it.

    Every item comes as soon as it may: the delays are passed on down the belt until nothing changes any more.
    """
    n = arrival_s.shape[1]
    time = arrival_s.copy()
    count = min(_NEIGHBOURS, n - 1)
    clear_s = []
    for back in range(1, count + 1):
        reach = radius_m[:, :-back] + radius_m[:, back:]
        across = y_m[:, :-back] - y_m[:, back:]
        square = reach * reach - across * across
        # Items that pass beside each other do not wait for each other at all.
        clear_s.append(np.where(square > 0.0, np.sqrt(np.maximum(square, 0.0)) * (1.0 / speed_m_s), -np.inf))
    for _ in range(n):
        before = time.copy()
        for back, clear in enumerate(clear_s, start=1):
            np.maximum(time[:, back:], before[:, :-back] + clear, out=time[:, back:])
        if np.array_equal(time, before):
            break
    return time


def centre_height_m(length_m: Array, width: Array, thickness: Array, yaw: Array, tilt: Array, azimuth: Array) -> Array:
    """Height (...) of an ellipsoid's centre over the plane it touches."""
    # The third row of the turned frame: how much of each axis points up.
    lean = np.sin(tilt)
    long_up = -lean * np.cos(azimuth - yaw)
    wide_up = -lean * np.sin(azimuth - yaw)
    square = long_up**2 + (width * wide_up) ** 2 + (thickness * np.cos(tilt)) ** 2
    return 0.5 * length_m * np.sqrt(square)


def grades(produce: ProduceConfig, kind: NDArray[np.int64], length_m: Array, ripeness: Array) -> NDArray[np.int64]:
    """Grade (...) by kind, a tuber's length and a fruit's ripeness."""
    second = np.where(kind == FRUIT, ripeness < produce.ripe_from, length_m < produce.ware_from_m)
    return 2 * kind + second


def draw_items(config: SortingConfig, uniform: Array, normal: Array) -> Items:
    """Lay the items of R worlds on the belt from their random blocks (R, .)."""
    scenario, produce, belt = config.scenario, config.produce, config.belt
    n = scenario.max_items
    u = np.ascontiguousarray(uniform.reshape(len(uniform), _DRAWS, n).swapaxes(0, 1))
    z = np.ascontiguousarray(normal.reshape(len(normal), _NORMALS, n).swapaxes(0, 1))
    kind = (u[6] < produce.fruit_share).astype(np.int64)

    def pick(tuber: tuple[float, float], fruit: tuple[float, float], levels: Array, draw: Array) -> Array:
        """A value on a raster of ``levels`` over the range of each item's kind."""
        low, high = np.array([tuber, fruit]).T
        count = levels[kind]
        return low[kind] + (high - low)[kind] * (np.floor(draw * count) / np.maximum(count - 1.0, 1.0))

    lengths = np.array([produce.tuber_length_m, produce.fruit_length_m])
    steps = np.round((lengths[:, 1] - lengths[:, 0]) / produce.length_step_m) + 1.0
    ratios = np.full(2, float(produce.shape_levels))
    length = pick(produce.tuber_length_m, produce.fruit_length_m, steps, u[7])
    width = pick(produce.tuber_width, produce.fruit_width, ratios, u[8])
    thickness = width * pick(produce.thickness, produce.thickness, ratios, u[9])
    start = np.cumsum(gaps(scenario, u[0], u[1]), axis=1)
    exists = start < scenario.stream_s
    y = belt.item_half_width_m * (2.0 * u[2] - 1.0)
    yaw = np.pi * (u[3] - 0.5)
    tilt = np.minimum(produce.tilt_sigma_rad * np.sqrt(-2.0 * np.log1p(-u[4])), produce.tilt_max_rad)
    azimuth = 2.0 * np.pi * u[5]
    arrival = keep_apart(start, y, 0.5 * length, belt.speed_m_s) - belt.start_x_m / belt.speed_m_s
    return Items(
        arrival_s=np.where(exists, arrival, np.inf),
        y_m=y,
        z_m=centre_height_m(length, width, thickness, yaw, tilt, azimuth),
        yaw=yaw,
        tilt=tilt,
        azimuth=azimuth,
        length_m=length,
        width=width,
        thickness=thickness,
        ripeness=u[10],
        skin=np.clip(u[10] + produce.skin_sigma * z[2], 0.0, 1.0),
        grade=grades(produce, kind, length, u[10]),
        exists=exists,
        luck=np.stack([u[11], u[12]], axis=-1),
        slip_m=belt.slip_sigma_m * np.stack([z[0], z[1]], axis=-1),
    )


def draw_reports(
    config: SortingConfig, perception: PerceptionModel, items: Items, uniform: Array, normal: Array
) -> Reports:
    """What the statistical camera reports of R worlds, from random blocks (R, .) of its own."""
    belt = config.belt
    rows, n = items.exists.shape
    u = np.ascontiguousarray(uniform[:, : 2 * n].reshape(rows, 2, n).swapaxes(0, 1))
    z = np.ascontiguousarray(normal.reshape(rows, _SEEN_NORMALS, n).swapaxes(0, 1))
    kind = items.grade // 2
    seen = items.exists & (u[0] < perception.recall)
    limits = np.cumsum(np.asarray(perception.confusion), axis=1)[:, :-1]
    grade = sum((u[1] > limits[:, column][items.grade]).astype(np.int64) for column in range(limits.shape[1]))
    bias, sigma = perception.bias_m, perception.sigma_m
    yaw = items.yaw + np.asarray(perception.yaw_sigma_rad)[kind] * z[3]
    lean = np.asarray(perception.tilt_sigma_rad)[kind]
    lean_x = items.tilt * np.cos(items.azimuth) + lean * z[4]
    lean_y = items.tilt * np.sin(items.azimuth) + lean * z[5]
    scale = 1.0 + perception.length_sigma * z[6:9]
    arrival = items.arrival_s - (bias[0] + sigma[0] * z[0]) / belt.speed_m_s
    reports = {
        "arrival_s": np.where(seen, arrival, np.inf),
        "y_m": items.y_m + bias[1] + sigma[1] * z[1],
        "z_m": items.z_m + bias[2] + sigma[2] * z[2],
        "yaw": yaw,
        "tilt": np.sqrt(lean_x * lean_x + lean_y * lean_y),
        "azimuth": np.arctan2(lean_y, lean_x),
        "length_m": items.length_m * scale[0],
        "width": np.minimum(items.width * scale[1] / scale[0], 1.0),
        "thickness": np.minimum(items.thickness * scale[2] / scale[0], 1.0),
        "grade": grade,
        "item": np.broadcast_to(np.arange(n), seen.shape),
    }
    ghosts = ghost_slots(config, perception)
    if ghosts:
        for name, values in _ghosts(config, perception, uniform[:, 2 * n :], ghosts, n).items():
            reports[name] = np.concatenate([reports[name], values], axis=1)
    half_step = 0.5 * belt.camera_step_m
    reports["seen_s"] = reports["arrival_s"] + (belt.camera_x_m + half_step) / belt.speed_m_s + belt.latency_s
    return Reports(**reports)


def _ghosts(config: SortingConfig, perception: PerceptionModel, draws: Array, ghosts: int, nothing: int) -> dict:
    """Reports of nothing: a stain on the belt that looks like a small level item."""
    scenario, produce, belt = config.scenario, config.produce, config.belt
    table = false_table(perception.false_per_item * scenario.rate_hz * scenario.stream_s)
    there = np.arange(ghosts) < np.searchsorted(table, draws[:, 0], side="right")[:, None]
    u = np.ascontiguousarray(draws[:, 1:].reshape(len(draws), _GHOST_DRAWS, ghosts).swapaxes(0, 1))
    flat = np.zeros_like(u[0])
    return {
        "arrival_s": np.where(there, scenario.stream_s * u[0] - belt.start_x_m / belt.speed_m_s, np.inf),
        "y_m": belt.item_half_width_m * (2.0 * u[1] - 1.0),
        "z_m": flat + 0.014,
        "yaw": np.pi * (u[2] - 0.5),
        "tilt": flat,
        "azimuth": flat,
        "length_m": produce.tuber_length_m[0] + 0.01 * u[3],
        "width": 0.65 + 0.3 * u[4],
        "thickness": flat + 0.5,
        "grade": np.minimum((4.0 * u[5]).astype(np.int64), 3),
        "item": np.full(u[0].shape, nothing),
    }


def item_axes(yaw: Array, tilt: Array, azimuth: Array) -> tuple[Array, Array]:
    """Unit vectors (..., 3) of an item's long and short axes."""
    turned = axes(tilted(tilt, azimuth, yaw))
    return turned[..., :, 0], turned[..., :, 2]
