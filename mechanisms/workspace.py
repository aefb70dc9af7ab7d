"""Reachable regions in the plane: what a mechanism can cover, and how well a wanted shape fits into it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .batching import Array

Method = Literal["monte-carlo", "polar"]
Reachable = Callable[[Array], np.ndarray]


@dataclass(frozen=True)
class PlanarWorkspace:
    """A reachable region of the plane.

    Attributes:
        points: reachable sample points, shape (n, 2), metres.
        area_m2: area of the region.
        boundary: closed outline without the repeated first point, shape (m, 2), anticlockwise, metres.
    """

    points: Array
    area_m2: float
    boundary: Array


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
    reachable stretch; it assumes that every ray meets the region in one piece.

    Args:
        reachable: maps positions (n, 2) to booleans (n,).
        lower: lower left corner of the search box, metres.
        upper: upper right corner of the search box, metres.
        method: see above.
        samples: points thrown, or points tried in all on the rays.
        seed: seed of the thrown points.

    Raises:
        ValueError: unknown method, or nothing in the box is reachable.
    """
    low, high = np.asarray(lower, dtype=float), np.asarray(upper, dtype=float)
    thrown = low + (high - low) * np.random.default_rng(seed).random((samples, 2))
    hits = thrown[reachable(thrown)]
    if len(hits) == 0:
        raise ValueError(f"no point of the box {lower}..{upper} m is reachable: widen the box or the limits")
    rays = 360
    boundary = _polar_boundary(reachable, hits.mean(axis=0), float(np.linalg.norm(high - low)), rays, samples // rays)
    if method == "monte-carlo":
        area = float(np.prod(high - low)) * len(hits) / samples
    elif method == "polar":
        area = polygon_area(boundary)
    else:
        raise ValueError(f"method {method!r} is unknown: choose 'monte-carlo' or 'polar'")
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


def _polar_boundary(reachable: Reachable, centre: Array, radius_m: float, rays: int, per_ray: int) -> Array:
    angles = np.linspace(0.0, 2.0 * np.pi, rays, endpoint=False)
    directions = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    distances = np.linspace(0.0, radius_m, per_ray)
    tried = centre + directions[:, None, :] * distances[:, None]
    hit = reachable(tried.reshape(-1, 2)).reshape(rays, per_ray)
    last = per_ray - 1 - np.argmax(hit[:, ::-1], axis=1)
    inner = np.where(hit.any(axis=1), distances[last], 0.0)
    outer = np.minimum(inner + distances[1], radius_m)
    for _ in range(40):
        middle = 0.5 * (inner + outer)
        good = reachable(centre + directions * middle[:, None])
        inner, outer = np.where(good, middle, inner), np.where(good, outer, middle)
    return centre + directions * inner[:, None]
