"""Reachable regions in space at a fixed orientation: volume, extent, sections and their holes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..kernels.sums import in_order
from .batching import Array
from .regions import bisected, boundary_loops, enclosed_voids, label_regions
from .workspace import polygon_area

SpatialMethod = Literal["monte-carlo", "polar", "grid"]
Reachable = Callable[[Array], np.ndarray]

_ZOOM_CELLS, _ZOOMS = 9, 10
_BISECTIONS = 26


@dataclass(frozen=True)
class Section:
    """A plane cut through a reachable region.

    Attributes:
        axis: axis that the plane is perpendicular to, 0, 1 or 2.
        level_m: where it cuts that axis.
        outlines: outer boundaries, (m, 2) each, anticlockwise, in the two remaining axes in their order.
        holes: boundaries of the unreachable parts inside, (m, 2) each.
        area_m2: area of the region, holes left out.
    """

    axis: int
    level_m: float
    outlines: tuple[Array, ...]
    holes: tuple[Array, ...]
    area_m2: float

    def in_space(self, outline: Array) -> Array:
        """An outline's points (m, 2) with the third coordinate put back, (m, 3)."""
        return np.insert(outline, self.axis, self.level_m, axis=1)


@dataclass(frozen=True)
class SpatialWorkspace:
    """A reachable region of space.

    Attributes:
        points: reachable sample points, shape (n, 3), metres.
        volume_m3: volume of the region.
        lower: smallest reachable coordinates, (3,), metres.
        upper: largest reachable coordinates, (3,), metres.
        sections: cuts perpendicular to z, from below; empty for Monte Carlo.
        voids: cavities that the region encloses, their volumes in m3; only the grid method looks for them.
    """

    points: Array
    volume_m3: float
    lower: Array
    upper: Array
    sections: tuple[Section, ...] = ()
    voids: tuple[float, ...] = ()

    @property
    def hollow_sections(self) -> int:
        """Sections with a hole; a cavity or a tunnel shows in them, if it is larger than their resolution."""
        return sum(bool(section.holes) for section in self.sections)


def spatial_workspace(
    reachable: Reachable,
    lower: Array,
    upper: Array,
    method: SpatialMethod = "polar",
    samples: int = 200_000,
    seed: int = 0,
) -> SpatialWorkspace:
    """Measure the region of a box in which ``reachable`` holds.

    ``"monte-carlo"`` throws uniform points; the share of hits is the volume without bias, the extent falls short.
    ``"polar"`` is the boundary search of the 3-PRRS paper (section 2): planes perpendicular to z, rays in each from
    the section's middle, the last reachable point of every ray bisected; the volume is the integral of the sections.
    ``"grid"`` samples a regular lattice, traces every section's boundary with its holes and finds enclosed cavities.
    Polar and grid find the extent to 1e-6 of the box with ``spatial_extent``.

    Args:
        reachable: maps positions (n, 3) to booleans (n,).
        lower: lower corner of the search box, (3,), metres.
        upper: upper corner, (3,), metres.
        method: see above.
        samples: points thrown, tried on rays or laid out, in all.
        seed: seed of the thrown points.

    Raises:
        ValueError: unknown method, or nothing in the box is reachable.
    """
    low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    if method == "monte-carlo":
        thrown = low + (high - low) * np.random.default_rng(seed).random((samples, 3))
        points = thrown[reachable(thrown)]
        if len(points) == 0:
            raise _nothing_reachable(low, high)
        volume = float(np.prod(high - low)) * len(points) / samples
        return SpatialWorkspace(points, volume, points.min(axis=0), points.max(axis=0))
    low, high = spatial_extent(reachable, low, high)
    if method == "polar":
        rays, steps = 120, 48
        count = max(samples // (rays * steps), 8)
        levels, weights = _gauss_levels(low[2], high[2], count)
        sections = tuple(polar_sections(reachable, low, high, 2, levels, rays, steps))
        volume = float(in_order(w * section.area_m2 for w, section in zip(weights, sections, strict=True)))
        points = np.concatenate([section.in_space(line) for section in sections for line in section.outlines])
        return SpatialWorkspace(points, volume, low, high, sections)
    if method == "grid":
        return _grid_workspace(reachable, low, high, max(round(samples ** (1.0 / 3.0)), 8))
    raise ValueError(f"method {method!r} is unknown: choose 'monte-carlo', 'polar' or 'grid'")


def spatial_extent(reachable: Reachable, lower: Array, upper: Array, cells: int = 24) -> tuple[Array, Array]:
    """Smallest and largest reachable coordinates, (3,) each.

    Along each axis the region's farthest point over a lattice of columns is bisected, and the lattice closes in on
    the highest column, to 1e-6 of the box.

    Args:
        reachable: maps positions (n, 3) to booleans (n,).
        lower: lower corner of the search box, (3,), metres.
        upper: upper corner, (3,), metres.
        cells: columns a side, and points tried on a column before bisection. What lies between them is missed.

    Raises:
        ValueError: no lattice point is reachable.
    """
    low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    extent = np.empty((2, 3))
    for axis in range(3):
        side_low, side_high = np.delete(low, axis), np.delete(high, axis)
        for end, (start, stop) in enumerate(((high[axis], low[axis]), (low[axis], high[axis]))):

            def farthest(columns: Array, axis: int = axis, start: float = start, stop: float = stop) -> Array:
                return _farthest(reachable, columns, axis, np.linspace(start, stop, cells))

            columns, step = _lattice(side_low, side_high, cells), (side_high - side_low) / (cells - 1)
            sign, best, place = (-1.0, 1.0)[end], -np.inf, columns[0]
            for _ in range(_ZOOMS):
                tops = sign * farthest(columns)
                top = int(np.argmax(np.where(np.isnan(tops), -np.inf, tops)))
                if tops[top] > best:
                    best, place = float(tops[top]), columns[top]
                if best == -np.inf:
                    raise _nothing_reachable(low, high)
                around = np.maximum(place - 1.5 * step, side_low), np.minimum(place + 1.5 * step, side_high)
                columns, step = _lattice(*around, _ZOOM_CELLS), 3.0 * step / (_ZOOM_CELLS - 1)
            extent[end, axis] = sign * best
    return extent[0], extent[1]


def polar_sections(
    reachable: Reachable,
    lower: Array,
    upper: Array,
    axis: int,
    levels: Sequence[float] | Array,
    rays: int = 120,
    steps: int = 48,
) -> list[Section]:
    """Sections by the polar boundary search: rays from each section's middle, last reachable point bisected.

    An unreachable patch between the rays' points that has no way out is a hole; its outline runs through the outer ends
    of the rays' stretches in it. A notch of the rim behind a reachable horn is counted as reachable (the method sees a
    ray's last reachable point); ``grid_section`` resolves it.

    Args:
        reachable: maps positions (n, 3) to booleans (n,).
        lower: lower corner of the search box, (3,), metres.
        upper: upper corner, (3,), metres.
        axis: the planes are perpendicular to it.
        levels: where they cut it, metres; levels without a reachable point give a section without outline.
        rays: number of rays.
        steps: points tried on a ray before bisection.
    """
    low, high = (np.delete(np.asarray(corner, dtype=float), axis) for corner in (lower, upper))
    angles = np.linspace(0.0, 2.0 * np.pi, rays, endpoint=False)
    # The rays' metric follows the box, so that a flat region gets its rays evenly.
    directions = 0.5 * (high - low) * np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    result = []
    for level in levels:

        def in_plane(points: Array, level: float = float(level)) -> np.ndarray:
            return reachable(np.insert(points.reshape(-1, 2), axis, level, axis=1)).reshape(points.shape[:-1])

        middle = _middle(in_plane, low, high)
        if middle is None:
            result.append(Section(axis, float(level), (), (), 0.0))
            continue
        farthest = 2.0 * np.sqrt(2.0)
        distances = np.linspace(0.0, farthest, steps)
        hit = in_plane(middle + directions[:, None, :] * distances[:, None])
        last = steps - 1 - np.argmax(hit[:, ::-1], axis=1)

        def on_rays(distance: Array, in_plane: Reachable = in_plane, middle: Array = middle) -> np.ndarray:
            return in_plane(middle + directions * distance[:, None])

        outer = bisected(on_rays, distances[last], distances[last] + distances[1], _BISECTIONS)
        outline = middle + directions * outer[:, None]
        area = abs(polygon_area(outline))
        holes: tuple[Array, ...] = ()
        for gap in _gaps(hit):
            ends = np.where(gap.any(axis=1), distances[steps - 1 - np.argmax(gap[:, ::-1], axis=1)], 0.0)
            holes = (*holes, middle + directions * ends[:, None])
            area -= abs(polygon_area(holes[-1]))
        result.append(Section(axis, float(level), (outline,), holes, area))
    return result


def grid_section(
    reachable: Reachable, lower: Array, upper: Array, axis: int, level_m: float, cells: int = 100
) -> Section:
    """One section from a lattice of ``cells`` x ``cells`` points: every outline and hole, edges bisected."""
    low, high = (np.delete(np.asarray(corner, dtype=float), axis) for corner in (lower, upper))

    def in_plane(points: Array) -> np.ndarray:
        return reachable(np.insert(points, axis, level_m, axis=1))

    # One step of unreachable margin on every side, so that all boundaries close.
    step = (high - low) / (cells - 1)
    loops = boundary_loops(in_plane, *(np.linspace(low[k] - step[k], high[k] + step[k], cells + 2) for k in (0, 1)))
    areas = [polygon_area(loop) for loop in loops]
    outlines = tuple(loop for loop, area in zip(loops, areas, strict=True) if area > 0.0)
    holes = tuple(loop for loop, area in zip(loops, areas, strict=True) if area < 0.0)
    return Section(axis, level_m, outlines, holes, float(in_order(areas)))


def _grid_workspace(reachable: Reachable, low: Array, high: Array, cells: int) -> SpatialWorkspace:
    step = (high - low) / cells
    # Cell middles, as a sum over them is the midpoint rule for the volume.
    points = _lattice(low + 0.5 * step, high - 0.5 * step, cells)
    hit = reachable(points)
    cell = float(np.prod(step))
    voids = tuple(float(count) * cell for count in enclosed_voids(hit.reshape(cells, cells, cells)))
    levels = low[2] + step[2] * (np.arange(cells) + 0.5)
    sections = tuple(grid_section(reachable, low, high, 2, float(level), cells) for level in levels)
    return SpatialWorkspace(points[hit], cell * np.count_nonzero(hit), low, high, sections, voids)


def _farthest(reachable: Reachable, columns: Array, axis: int, levels: Array) -> Array:
    """Last reachable coordinate (n,) on columns (n, 2) along the axis, searched through the levels; NaN if none."""

    def on_columns(coordinate: Array, chosen: Array) -> np.ndarray:
        return reachable(np.insert(chosen, axis, coordinate, axis=1))

    count = len(levels)
    hit = on_columns(np.tile(levels, len(columns)), np.repeat(columns, count, axis=0)).reshape(-1, count)
    last = count - 1 - np.argmax(hit[:, ::-1], axis=1)
    found = np.flatnonzero(hit.any(axis=1))
    result = np.full(len(columns), np.nan)
    inner = levels[last[found]]
    outer = np.where(last[found] == count - 1, inner, inner + levels[1] - levels[0])
    result[found] = bisected(lambda middle: on_columns(middle, columns[found]), inner, outer, _BISECTIONS)
    return result


def _gaps(hit: np.ndarray) -> list[np.ndarray]:
    """Unreachable patches of the polar lattice (rays, steps) that have no way out: holes, not notches of the rim."""
    labels = label_regions(~hit, wrap=(0,))
    outside = set(labels[:, -1].tolist())
    return [labels == label for label in range(1, labels.max() + 1) if label not in outside]


def _middle(in_plane: Reachable, low: Array, high: Array, cells: int = 15) -> Array | None:
    """Mean of the reachable lattice points, or the one nearest to it when it lies in a hole; None without any."""
    for refinement in (1, 4):
        points = _lattice(low, high, cells * refinement)
        hits = points[in_plane(points)]
        if len(hits):
            middle = hits.mean(axis=0)
            if in_plane(middle[None])[0]:
                return middle
            return hits[np.argmin(np.sum((hits - middle) ** 2, axis=1))]
    return None


def _gauss_levels(low: float, high: float, count: int) -> tuple[Array, Array]:
    """Gauss-Legendre levels and weights, in two halves, as the sections' area has a kink where the tip ends."""
    nodes, weights = np.polynomial.legendre.leggauss(max(count // 2, 4))
    half = 0.25 * (high - low)
    starts = (low, 0.5 * (low + high))
    levels = np.concatenate([start + half * (nodes + 1.0) for start in starts])
    return levels, np.concatenate([weights, weights]) * half


def _lattice(low: Array, high: Array, cells: int) -> Array:
    axes = [np.linspace(a, b, cells) for a, b in zip(low, high, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, len(axes))


def _nothing_reachable(low: Array, high: Array) -> ValueError:
    return ValueError(
        f"no point of the box {low.tolist()}..{high.tolist()} m is reachable: widen the box or the limits"
    )
