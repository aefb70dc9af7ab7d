"""Reachable regions in the plane: what a mechanism can cover, and how well a wanted shape fits into it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .batching import Array
from .regions import bisected, boundary_loops

Method = Literal["monte-carlo", "polar", "grid"]
Reachable = Callable[[Array], np.ndarray]


@dataclass(frozen=True)
class PlanarWorkspace:
    """A reachable region of the plane.

    Attributes:
        points: reachable sample points, shape (n, 2), metres.
        area_m2: area of the region.
        boundary: closed outline without the repeated first point, shape (m, 2), anticlockwise, metres; the outline of
            the largest part where the region falls apart.
        holes: outlines of the unreachable parts inside, clockwise; only the grid method looks for them.
        islands: outlines of the further parts, anticlockwise; only the grid method looks for them.
    """

    points: Array
    area_m2: float
    boundary: Array
    holes: tuple[Array, ...] = ()
    islands: tuple[Array, ...] = ()


def planar_workspace(
    reachable: Reachable,
    lower: tuple[float, float],
    upper: tuple[float, float],
    method: Method = "monte-carlo",
    samples: int = 200_000,
    seed: int = 0,
) -> PlanarWorkspace:
    """Measure the region of a box in which ``reachable`` holds.

    ``"monte-carlo"`` (the method of the safflower paper, Fig. 6) throws uniform points into the box, so the share of
    hits is the area without bias. ``"polar"`` searches outwards on rays from the region's centre and bisects the last
    reachable stretch; it assumes that every ray meets the region in one piece. ``"grid"`` samples a lattice, traces all
    boundaries with bisected crossings and so knows holes and islands.

    Args:
        reachable: maps positions (n, 2) to booleans (n,).
        lower: lower left corner of the search box, metres.
        upper: upper right corner of the search box, metres.
        method: see above.
        samples: points thrown, tried in all on the rays, or laid out.
        seed: seed of the thrown points.

    Raises:
        ValueError: unknown method, or nothing in the box is reachable.
    """
    low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    if method == "grid":
        return _grid_workspace(reachable, low, high, max(round(samples**0.5), 8))
    thrown = low + (high - low) * np.random.default_rng(seed).random((samples, 2))
    hits = thrown[reachable(thrown)]
    if len(hits) == 0:
        raise _nothing_reachable(low, high)
    rays = 360
    boundary = _polar_boundary(reachable, hits.mean(axis=0), float(np.linalg.norm(high - low)), rays, samples // rays)
    if method == "monte-carlo":
        area = float(np.prod(high - low)) * len(hits) / samples
    elif method == "polar":
        area = polygon_area(boundary)
    else:
        raise ValueError(f"method {method!r} is unknown: choose 'monte-carlo', 'polar' or 'grid'")
    return PlanarWorkspace(points=hits, area_m2=area, boundary=boundary)


def polygon_area(vertices: Array) -> float:
    """Area enclosed by a polygon (n, 2), positive when its vertices run anticlockwise."""
    x, y = vertices[:, 0], vertices[:, 1]
    return float(0.5 * np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))


def equilateral_triangle(side_m: float, centre: tuple[float, float], apex_down: bool) -> Array:
    """Vertices (3, 2) of an equilateral triangle with one horizontal side, anticlockwise."""
    angles = np.deg2rad([90.0, 210.0, 330.0]) + (np.pi if apex_down else 0.0)
    return np.asarray(centre) + side_m / np.sqrt(3.0) * np.stack([np.cos(angles), np.sin(angles)], axis=-1)


def inside_convex(points: Array, vertices: Array) -> np.ndarray:
    """Which points (n, 2) lie inside the convex, anticlockwise polygon (m, 2)."""
    edges = np.roll(vertices, -1, axis=0) - vertices
    offsets = points[:, None, :] - vertices
    return np.all(edges[:, 0] * offsets[..., 1] - edges[:, 1] * offsets[..., 0] >= 0.0, axis=1)


def best_triangle(points: Array, area_m2: float, side_m: float) -> tuple[Array, float]:
    """Place an equilateral triangle so that it overlaps a region best.

    Args:
        points: uniform sample of the region, shape (n, 2), metres.
        area_m2: the region's area.
        side_m: side of the triangle.

    Returns:
        The vertices (3, 2) and the overlap as intersection over union.
    """
    share = area_m2 / len(points)
    triangle_area = np.sqrt(3.0) / 4.0 * side_m**2
    best: tuple[Array, float] = (equilateral_triangle(side_m, (0.0, 0.0), False), -1.0)
    middle = points.mean(axis=0)
    for step in (0.03, 0.01, 0.003, 0.001):
        start = middle
        for shift in np.stack(np.meshgrid(np.arange(-4, 5), np.arange(-4, 5)), axis=-1).reshape(-1, 2) * step:
            centre = start + shift
            for apex_down in (False, True):
                triangle = equilateral_triangle(side_m, (centre[0], centre[1]), apex_down)
                shared = np.count_nonzero(inside_convex(points, triangle)) * share
                overlap = shared / (area_m2 + triangle_area - shared)
                if overlap > best[1]:
                    best, middle = (triangle, float(overlap)), centre
    return best


def _nothing_reachable(low: Array, high: Array) -> ValueError:
    box = f"{low.tolist()}..{high.tolist()}"
    return ValueError(f"no point of the box {box} m is reachable: widen the box or the limits")


def _grid_workspace(reachable: Reachable, low: Array, high: Array, cells: int) -> PlanarWorkspace:
    def in_box(points: Array) -> np.ndarray:
        # What reaches beyond the box is cut off at its rim, so that every boundary closes.
        return reachable(points) & np.all((points >= low) & (points <= high), axis=-1)

    step = (high - low) / (cells - 1)
    x, y = (np.linspace(low[k] - step[k], high[k] + step[k], cells + 2) for k in (0, 1))
    lattice = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
    points = lattice[in_box(lattice)]
    if len(points) == 0:
        raise _nothing_reachable(low, high)
    loops = boundary_loops(in_box, x, y)
    areas = np.array([polygon_area(loop) for loop in loops])
    order = [int(i) for i in np.argsort(-areas)]
    outlines = tuple(loops[i] for i in order if areas[i] > 0.0)
    holes = tuple(loops[i] for i in reversed(order) if areas[i] < 0.0)
    return PlanarWorkspace(points, float(areas.sum()), outlines[0], holes, outlines[1:])


def _polar_boundary(reachable: Reachable, centre: Array, radius_m: float, rays: int, per_ray: int) -> Array:
    angles = np.linspace(0.0, 2.0 * np.pi, rays, endpoint=False)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    distances = np.linspace(0.0, radius_m, per_ray)
    tried = centre + directions[:, None, :] * distances[:, None]
    hit = reachable(tried.reshape(-1, 2)).reshape(rays, per_ray)
    last = per_ray - 1 - np.argmax(hit[:, ::-1], axis=1)
    inner = np.where(hit.any(axis=1), distances[last], 0.0)
    outer = np.minimum(inner + distances[1], radius_m)
    last_m = bisected(lambda away: reachable(centre + directions * away[:, None]), inner, outer, 40)
    return centre + directions * last_m[:, None]
