"""Parting plants that touch, and finding their stems: leaves radiate from a stem, so the stem sees the whole plant.

A pixel of a plant is *seen* from another one when the straight line between them stays within the plant. Of all pixels
of a blob, those near a rosette's middle see most of it. The first stem is where most is seen; what it sees is taken
away, and what is left is another plant, or a crumb.
"""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled

Array = NDArray[np.float64]
Mask = NDArray[np.uint8]

_CANDIDATES, _PIXELS = 48, 240
"""Most places that are tried as stems, and most pixels that they are tried on; larger blobs are thinned out."""
_AS_GOOD = 0.93
"""A place that sees this share of what the best one sees may be the stem as well; the stem is in their middle."""
_CONVEX = 0.86
"""A blob that fills this share of its convex hull is one plant, and all of it sees all of it."""
_END = 0.30
"""Share of a blade's length that is compared at both of its ends."""


class Rosette(NamedTuple):
    """One plant of a mask: its stem in (row, column), and its pixels (n, 2) in rows and columns."""

    stem: Array
    pixels: NDArray[np.int64]


@compiled
def _count_seen(road: Mask, at: NDArray[np.int64], pixels: NDArray[np.int64]) -> NDArray[np.int64]:  # pragma: no cover
    """How many of ``pixels`` (p, 2) each place ``at`` (c, 2) sees; lines run where ``road`` is not zero."""
    seen = np.zeros(len(at), np.int64)
    for i in range(len(at)):
        top, left = at[i, 0], at[i, 1]
        for j in range(len(pixels)):
            rows, columns = pixels[j, 0] - top, pixels[j, 1] - left
            steps = max(abs(rows), abs(columns))
            clear = True
            if steps > 1:
                # Fixed point: 65536 to a pixel, rounded by the half that both begin with.
                r_step, c_step = (rows << 16) // steps, (columns << 16) // steps
                r, c = (top << 16) + 32768, (left << 16) + 32768
                for _ in range(steps - 1):
                    r += r_step
                    c += c_step
                    if road[r >> 16, c >> 16] == 0:
                        clear = False
                        break
            if clear:
                seen[i] += 1
    return seen


def part(blob: Mask, smallest_px: int, most: int = 6) -> list[Rosette]:
    """Plants of one connected blob, the largest first.

    Args:
        blob: (h, w), zero outside the blob.
        smallest_px: what is smaller after other plants are taken away is a crumb.
        most: plants that one blob may hold at most.
    """
    found: list[Rosette] = []
    queue = [(blob > 0).astype(np.uint8)]
    # Thin blades are stairs of pixels: lines may run one pixel beside them.
    road = cv2.dilate(queue[0], np.ones((3, 3), np.uint8))
    while queue and len(found) < most:
        rest = queue.pop(0)
        plant = _first(rest, np.asarray(road, np.uint8))
        found.append(plant)
        taken = np.zeros_like(rest)
        taken[plant.pixels[:, 0], plant.pixels[:, 1]] = 1
        left = rest & (1 - cv2.dilate(taken, np.ones((5, 5), np.uint8)))
        if np.count_nonzero(left) < smallest_px:
            continue
        count, labels, stats, _ = cv2.connectedComponentsWithStats(np.asarray(left, np.uint8), connectivity=8)
        sizes = stats[:, cv2.CC_STAT_AREA]
        queue += [(labels == i).astype(np.uint8) for i in range(1, count) if sizes[i] >= smallest_px]
        queue.sort(key=lambda m: -int(m.sum()))
    return found


def _first(rest: Mask, road: Mask) -> Rosette:
    pixels = np.argwhere(rest)
    if _is_convex(rest, len(pixels)):
        return Rosette(pixels.mean(axis=0), pixels)
    tried = _thinned(pixels, _PIXELS)
    at = _thinned(pixels, _CANDIDATES)
    seen = _count_seen(road, at, tried)
    good = at[seen >= _AS_GOOD * seen.max()]
    # Coarse, then fine: all around the good ones of a grid of places there are better ones.
    margin = 1.5 * np.sqrt(len(pixels) / len(at)) + 1.0
    near = ((pixels >= good.min(axis=0) - margin) & (pixels <= good.max(axis=0) + margin)).all(axis=1)
    at = _thinned(pixels[near], _CANDIDATES)
    seen = _count_seen(road, at, tried)
    good = at[seen >= _AS_GOOD * seen.max()]
    stem = good.mean(axis=0)
    nearest = good[np.square(good - stem).sum(axis=1).argmin()]
    lit = _count_seen(road, pixels, nearest[None].astype(np.int64)) > 0
    return Rosette(stem, pixels[lit])


def _thinned(pixels: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    step = -(-len(pixels) // most)
    return pixels[step // 2 :: step]


def _is_convex(mask: Mask, count: int) -> bool:
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(outlines, key=len)
    hull = cv2.convexHull(outline)
    # Outlines run through the middles of pixels: half a pixel is missing all around.
    return count >= _CONVEX * (cv2.contourArea(hull) + 0.5 * cv2.arcLength(hull, True) + 1.0)


def broad_bodies(mask: Mask, half_width_px: float, smallest_px: int) -> list[NDArray[np.int64]]:
    """Parts of a mask (h, w) into which a disc of a half width fits, their pixels (n, 2): leaves broader than a weed's.

    An opening of the mask, by way of its distance transform; thin leaves that touch broad ones fall away from them.
    """
    deep = np.asarray(cv2.distanceTransform((mask > 0).astype(np.uint8), cv2.DIST_L2, 5))
    away = np.asarray(cv2.distanceTransform((deep < half_width_px).astype(np.uint8), cv2.DIST_L2, 5))
    bodies = (away < half_width_px) if (deep >= half_width_px).any() else np.zeros(mask.shape, bool)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(bodies.astype(np.uint8), connectivity=8)
    found = []
    for i in range(1, count):
        x, y, w, h, size = (int(v) for v in stats[i])
        if size >= smallest_px:
            found.append(np.argwhere(labels[y : y + h, x : x + w] == i) + np.array([y, x]))
    return found


def slenderness(pixels: NDArray[np.int64]) -> float:
    """Share of the smallest enclosing circle that a plant's pixels (n, 2) fill: small for grasses."""
    _, radius = cv2.minEnclosingCircle(pixels.astype(np.float32))
    return float(len(pixels) / (np.pi * (radius + 0.5) ** 2))


def blade_foot(plant: Rosette) -> Array:
    """Foot (2,) of a grass's single blade: its wider end.

    A seedling's blade is widest above its sheath and tapers to a point.
    """
    centred = plant.pixels - plant.pixels.mean(axis=0)
    _, axes = np.linalg.eigh(centred.T @ centred / len(centred))
    along = centred @ axes[:, 1]
    low, high = along.min(), along.max()
    reach = _END * (high - low)
    at_low, at_high = along < low + reach, along > high - reach
    foot = at_low if np.count_nonzero(at_low) >= np.count_nonzero(at_high) else at_high
    # The foot itself is where the blade ends, a blade's width from its outermost pixels at most.
    edge = np.abs(along - (low if foot is at_low else high)) <= 0.08 * (high - low) + 1.0
    return np.asarray(plant.pixels[edge].mean(axis=0))
