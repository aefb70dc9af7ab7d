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
from .regions import regions

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
_NEIGHBOURS = np.ones((3, 3), np.uint8)
_STRIDE = 8
"""Every so many-th pixel is tried before the others: neighbours are seen alike."""


class Rosette(NamedTuple):
    """One plant of a mask: its stem in (row, column), and its pixels (n, 2) in rows and columns."""

    stem: Array
    pixels: NDArray[np.int64]


@compiled
def sees(free: NDArray[np.int32], at: NDArray[np.int64], pixel: NDArray[np.int64]) -> bool:
    """Whether the straight line from one pixel (2,) to another one is free.

    Args:
        free: (h, w), 0 where no line may run; else how many steps away, in any of eight directions, what is in the
            way lies at least.
        at: the one.
        pixel: the other.
    """
    top, left = at[0], at[1]
    rows, columns = pixel[0] - top, pixel[1] - left
    steps = max(abs(rows), abs(columns))
    if steps < 2:
        return True
    # Fixed point: 65536 to a pixel, rounded by the half that both begin with. Quotients of such numbers are never
    # rounded up to the next whole one.
    r_step = np.int64(np.floor(65536.0 * rows / steps))
    c_step = np.int64(np.floor(65536.0 * columns / steps))
    r, c = (top << 16) + 32768, (left << 16) + 32768
    k = max(1, np.int64(free[top, left]))
    while k < steps:
        clear = np.int64(free[(r + k * r_step) >> 16, (c + k * c_step) >> 16])
        if clear == 0:
            return False
        # A step goes one row and one column on at most.
        k += clear
    return True


@compiled
def best(free: NDArray[np.int32], at: NDArray[np.int64], pixels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Those of the places ``at`` (c, 2) that see almost as many of ``pixels`` (p, 2) as the best of them does."""
    places, n = len(at), len(pixels)
    seen = np.zeros(places, np.int64)
    most = 0
    for turn in range(places):
        # From the middle on: the best ones lie there, and what cannot come near to them is soon told.
        i = (turn + places // 2) % places
        missed, least = 0, _AS_GOOD * most
        for begin in range(_STRIDE):
            for j in range(begin, n, _STRIDE):
                missed += not sees(free, at[i], pixels[j])
            if n - missed < least:
                break
        # Where it was given up, this is more than it sees, and still too few.
        seen[i] = n - missed
        most = max(most, seen[i])
    return at[seen >= _AS_GOOD * most]


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
    road = cv2.dilate(queue[0], _NEIGHBOURS)
    free: NDArray[np.int32] | None = None
    while queue and len(found) < most:
        rest = queue.pop(0)
        pixels = _pixels(rest)
        if _is_convex(rest, len(pixels)):
            found.append(Rosette(pixels.mean(axis=0), pixels))
            continue
        if free is None:
            # Where there is no end to the road, no distance is larger than what is to be crossed.
            free = np.minimum(cv2.distanceTransform(road, cv2.DIST_C, 3), max(road.shape)).astype(np.int32)
        found.append(Rosette(*_stem(free, pixels)))
        if len(pixels) - len(found[-1].pixels) < smallest_px:
            continue
        left, size = _without(rest, found[-1].pixels)
        if size < smallest_px:
            continue
        labels, boxes = regions(left)
        queue += [(labels == i).astype(np.uint8) for i in range(1, len(boxes)) if boxes[i, 4] >= smallest_px]
        queue.sort(key=lambda m: -int(m.sum()))
    return found


@compiled
def _pixels(mask: Mask) -> NDArray[np.int64]:
    """Rows and columns (n, 2) of what is not zero, row by row."""
    height, width = mask.shape
    n = 0
    for y in range(height):
        for x in range(width):
            n += mask[y, x] != 0
    pixels = np.empty((n, 2), np.int64)
    n = 0
    for y in range(height):
        for x in range(width):
            if mask[y, x] != 0:
                pixels[n, 0], pixels[n, 1] = y, x
                n += 1
    return pixels


@compiled
def _without(rest: Mask, pixels: NDArray[np.int64]) -> tuple[Mask, int]:
    """What is farther than two pixels from ``pixels`` (n, 2), rows or columns, and how many pixels that are."""
    height, width = rest.shape
    left = rest.copy()
    for i in range(len(pixels)):
        for y in range(max(pixels[i, 0] - 2, 0), min(pixels[i, 0] + 3, height)):
            for x in range(max(pixels[i, 1] - 2, 0), min(pixels[i, 1] + 3, width)):
                left[y, x] = 0
    n = 0
    for y in range(height):
        for x in range(width):
            n += left[y, x] != 0
    return left, n


@compiled
def _stem(free: NDArray[np.int32], pixels: NDArray[np.int64]) -> tuple[Array, NDArray[np.int64]]:
    """Where a rosette's leaves meet (2,), and the pixels (n, 2) that are seen from there."""
    tried = _thinned(pixels, _PIXELS)
    at = _thinned(pixels, _CANDIDATES)
    good = best(free, at, tried)
    # Coarse, then fine: all around the good ones of a grid of places there are better ones.
    margin = 1.5 * np.sqrt(len(pixels) / len(at)) + 1.0
    top, bottom = good[:, 0].min() - margin, good[:, 0].max() + margin
    left, right = good[:, 1].min() - margin, good[:, 1].max() + margin
    row, column = pixels[:, 0], pixels[:, 1]
    near = pixels[(row >= top) & (row <= bottom) & (column >= left) & (column <= right)]
    at = _thinned(near, _CANDIDATES)
    good = best(free, at, tried)
    stem = np.array([good[:, 0].sum() / len(good), good[:, 1].sum() / len(good)])
    nearest, least = 0, np.inf
    for i in range(len(good)):
        square = (good[i, 0] - stem[0]) ** 2 + (good[i, 1] - stem[1]) ** 2
        if square < least:
            nearest, least = i, square
    lit = np.empty(len(pixels), np.bool_)
    for i in range(len(pixels)):
        lit[i] = sees(free, good[nearest], pixels[i])
    return stem, pixels[lit]


@compiled
def _thinned(pixels: NDArray[np.int64], most: int) -> NDArray[np.int64]:
    """At most so many of the pixels (n, 2), evenly over their order."""
    step = -(-len(pixels) // most)
    return pixels[step // 2 :: step].copy()


def _is_convex(mask: Mask, count: int) -> bool:
    outlines, _ = cv2.findContours(mask, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(outlines, key=len)
    hull = cv2.convexHull(outline)
    # Outlines run through the middles of pixels: half a pixel is missing all around.
    return count >= _CONVEX * (cv2.contourArea(hull) + 0.5 * cv2.arcLength(hull, True) + 1.0)


def broad_bodies(
    labels: NDArray[np.int32], boxes: NDArray[np.int64], half_width_px: float, smallest_px: int
) -> list[NDArray[np.int64]]:
    """Parts of a mask into which a disc of a half width fits, their pixels (n, 2): leaves broader than a weed's.

    An opening of the mask, by way of its distance transform; thin leaves that touch broad ones fall away from them.

    Args:
        labels: (h, w), the mask's regions.
        boxes: (n, 5), about them.
        half_width_px: of the disc.
        smallest_px: what is smaller is left out.
    """
    bodies = None
    for i, (x, y, w, h, size) in enumerate(boxes.tolist()):
        # A body is no larger than what it is a part of.
        if size < max(smallest_px, 1):
            continue
        # With a free pixel on each side where the picture has one: behind its edges, plants go on.
        window = np.s_[max(y - 1, 0) : y + h + 1, max(x - 1, 0) : x + w + 1]
        deep = cv2.distanceTransform((labels[window] == i).astype(np.uint8), cv2.DIST_L2, 5)
        thin = (deep < half_width_px).astype(np.uint8)
        if thin.all():
            continue
        if bodies is None:
            bodies = np.zeros(labels.shape, np.uint8)
        bodies[window] |= np.asarray(cv2.distanceTransform(thin, cv2.DIST_L2, 5)) < half_width_px
    if bodies is None:
        return []
    labels, boxes = regions(bodies)
    return [
        np.argwhere(labels[y : y + h, x : x + w] == i) + np.array([y, x])
        for i, (x, y, w, h, size) in enumerate(boxes.tolist())
        if size >= max(smallest_px, 1)
    ]


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
