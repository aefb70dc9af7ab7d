"""Finds safflower heads in an RGB-D picture from above: orange-red filaments, their depth, their stage.

Seen from above a tuft is a disc of known width, whatever hangs over it. A head is where such a disc explains the
filaments best: its pixels are filaments at the tuft's depth, or hidden by something nearer, but do not show what lies
deeper. That joins what a leaf has cut in two, parts what touches, and puts the middle of the half that shows where the
middle of the whole is.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled
from .frames import Frame
from .regions import regions

Array = NDArray[np.float64]
Signs = NDArray[np.int8]
"""What the pixels of a square window say of a tuft: 1 filaments at its depth, -1 what lies deeper, 0 nothing."""
Part = tuple[NDArray[np.int64], NDArray[np.int64]]
"""Rows and columns of pixels."""

_STEPS, _STRIDE = 4, 3
"""A disc is tried at so many places to either side, each on every so manieth pixel each way."""
_ROUNDS, _GAIN = 6, 0.7
"""How often a disc is moved on, and by which share of what it is off."""


@dataclass(frozen=True)
class BloomSettings:
    """Thresholds of the detector. Hue and saturation as OpenCV counts them: hue 0-179, saturation and value 0-255.

    Attributes:
        hue_range: filaments from brown-red to yellow-orange.
        min_saturation: below it soil and wood.
        min_value: below it deep shade.
        range_m: depths at which heads can be; pots and soil lie beyond.
        min_area_m2: where less of a tuft shows, no head is reported.
        head_area_m2: filaments of an average tuft seen from above (identified: on rendered rows).
        head_spread_m: spread of that tuft (published mean).
        disc_m: radius of the disc that a tuft of any width fills.
        tuft_m: filaments within this distance of a tuft's middle are its own.
        nearer_m: what lies this much nearer than a tuft's top hides it.
        deeper_m: what lies this much deeper than a tuft's top is none of it.
        sharp: of two places for a disc, the one that explains this share of its pixels better counts e times as much.
        depth_step_m: a larger step between neighbouring pixels separates two heads.
        split_share: cores of touching tufts are where the distance to the edge exceeds this share of the largest.
        late_hue: above it fresh (yellow-orange), below it late (orange-red).
        dry_value: filaments darker than this are dry.
        tuft_half_height_m: from the visible top of a tuft to its centre.
    """

    hue_range: tuple[int, int] = (0, 24)
    min_saturation: int = 120
    min_value: int = 50
    range_m: tuple[float, float] = (0.30, 0.74)
    min_area_m2: float = 6.0e-5
    head_area_m2: float = 1.08e-3
    head_spread_m: float = 0.04785
    disc_m: float = 0.019
    tuft_m: float = 0.022
    nearer_m: float = 0.006
    deeper_m: float = 0.020
    sharp: float = 0.03
    depth_step_m: float = 0.012
    split_share: float = 0.62
    late_hue: float = 14.0
    dry_value: float = 150.0
    tuft_half_height_m: float = 0.006


@dataclass(frozen=True)
class Blooms:
    """Detected heads.

    Attributes:
        position: (n, 3), world metres, estimated centre of the tuft.
        stage: (n,), 1 fresh, 2 late, 3 dry.
        spread_m: (n,), filament spread that the visible area stands for.
        confidence: (n,), visible share of a whole tuft, at most 1.
    """

    position: Array
    stage: NDArray[np.int64]
    spread_m: Array
    confidence: Array


def filament_mask(
    rgb: NDArray[np.uint8], depth_m: NDArray[np.float32], settings: BloomSettings
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Pixels of filaments (0 or 255) and the picture in hue, saturation and value."""
    hsv = cv2.cvtColor(rgb, cv2.COLOR_RGB2HSV)
    low = (settings.hue_range[0], settings.min_saturation, settings.min_value)
    mask = cv2.inRange(hsv, low, (settings.hue_range[1], 255, 255))
    mask = cv2.bitwise_or(mask, cv2.inRange(hsv, (172, *low[1:]), (179, 255, 255)))
    mask[(depth_m <= settings.range_m[0]) | (depth_m >= settings.range_m[1])] = 0
    return np.asarray(mask, np.uint8), np.asarray(hsv, np.uint8)


def detect(frame: Frame, context: None = None, settings: BloomSettings | None = None) -> Blooms:
    """Find heads.

    Args:
        frame: a picture from above.
        context: nothing has to be known beforehand.
        settings: thresholds.
    """
    settings = settings or BloomSettings()
    rgb, depth_m, (intrinsics, world_from_camera) = frame
    mask, hsv = filament_mask(rgb, depth_m, settings)
    focal = float(intrinsics[0, 0])
    free = mask > 0
    positions, stages, areas, shares = [], [], [], []
    # The largest first: they say best where their tufts are, and so what of their surroundings belongs to them.
    parts = sorted(_parts(mask, depth_m, focal, settings), key=lambda part: -len(part[0]))
    for part in parts:
        left = free[part]
        rows, columns = part[0][left], part[1][left]
        if len(rows) == 0:
            continue
        top_m = _quantile(depth_m[rows, columns], 0.2)
        pixel_m2, disc_px, tuft_px = (
            (top_m / focal) ** 2,
            settings.disc_m * focal / top_m,
            settings.tuft_m * focal / top_m,
        )
        if len(rows) * pixel_m2 < settings.min_area_m2:
            continue
        signs, y, x = _signs(
            mask,
            free,
            depth_m,
            (int(rows.mean()), int(columns.mean())),
            int(disc_px + tuft_px) + 2,
            (top_m - settings.nearer_m, top_m + settings.deeper_m),
        )
        v, u, shown = balanced(signs, *placed(signs, disc_px, settings.sharp), disc_px, tuft_px)
        own = _within(signs, v, u, tuft_px)
        own = own[0] + y, own[1] + x
        free[own] = False
        if len(own[0]) * pixel_m2 < settings.min_area_m2:
            continue
        # What lies too far off for this tuft may be of another one.
        rest = free[rows, columns]
        if np.count_nonzero(rest) * pixel_m2 >= settings.min_area_m2:
            parts.extend(_apart(rows[rest], columns[rest]))
        middle_m = _quantile(depth_m[own], 0.2) + settings.tuft_half_height_m
        ray = np.array([(u + x - intrinsics[0, 2]) / focal, (v + y - intrinsics[1, 2]) / focal, 1.0])
        positions.append(world_from_camera[:3, :3] @ (ray * middle_m) + world_from_camera[:3, 3])
        stages.append(_stage(hsv[own], settings))
        areas.append(len(own[0]) * pixel_m2)
        shares.append(shown)
    area_m2 = np.array(areas)
    return Blooms(
        np.array(positions).reshape(-1, 3),
        np.array(stages, dtype=np.int64),
        settings.head_spread_m * np.sqrt(area_m2 / np.array(shares) / settings.head_area_m2),
        np.minimum(area_m2 / settings.head_area_m2, 1.0),
    )


@compiled
def _signs(
    mask: NDArray[np.uint8],
    free: NDArray[np.bool_],
    depth_m: NDArray[np.float32],
    middle: tuple[int, int],
    reach: int,
    within_m: tuple[float, float],
) -> tuple[Signs, int, int]:
    """What pixels within ``reach`` of a ``middle`` say of a tuft between two depths; the window's first row, column."""
    top, left, side = middle[0] - reach, middle[1] - reach, 2 * reach + 1
    signs = np.zeros((side, side), np.int8)
    for y in range(max(top, 0), min(top + side, mask.shape[0])):
        for x in range(max(left, 0), min(left + side, mask.shape[1])):
            if depth_m[y, x] < within_m[0]:
                continue
            if mask[y, x] == 0 or depth_m[y, x] > within_m[1]:
                signs[y - top, x - left] = -1
            elif free[y, x]:
                # What another tuft has taken says nothing.
                signs[y - top, x - left] = 1
    return signs, top, left


@compiled
def placed(signs: Signs, disc_px: float, sharp: float) -> tuple[float, float]:
    """Row and column where a disc explains the signs best: a mean over places, each as likely as it explains them."""
    many, grid, middle = 2 * _STEPS + 1, disc_px / _STEPS, len(signs) // 2
    score, best, top, left = np.empty((many, many)), -np.inf, 0, 0
    for a in range(many):
        for b in range(many):
            v, u = middle + (a - _STEPS) * grid, middle + (b - _STEPS) * grid
            score[a, b] = explained(signs, v, u, disc_px)
            if score[a, b] > best:
                best, top, left = score[a, b], a, b
    total, down, aside = 0.0, 0.0, 0.0
    for a in range(many):
        for b in range(many):
            # Elsewhere there may be another tuft.
            if (a - top) * (a - top) + (b - left) * (b - left) <= (_STEPS // 2) * (_STEPS // 2):
                weight = math.exp((score[a, b] - best) / sharp)
                total += weight
                down += weight * (a - _STEPS)
                aside += weight * (b - _STEPS)
    return middle + grid * down / total, middle + grid * aside / total


@compiled
def explained(signs: Signs, v: float, u: float, radius: float) -> float:
    """Mean sign of a disc."""
    told, count, last = 0, 0, len(signs) - 1
    for y in range(max(math.ceil(v - radius), 0), min(math.floor(v + radius), last) + 1, _STRIDE):
        half = math.sqrt(radius * radius - (y - v) * (y - v))
        for x in range(max(math.ceil(u - half), 0), min(math.floor(u + half), last) + 1, _STRIDE):
            told += signs[y, x]
            count += 1
    return told / max(count, 1)


@compiled
def balanced(signs: Signs, v: float, u: float, disc_px: float, tuft_px: float) -> tuple[float, float, float]:
    """Where the filaments within ``tuft_px`` and what shows of a disc have the same middle; and which share shows."""
    shown = 1.0
    for _ in range(_ROUNDS):
        own, own_v, own_u, seen, seen_v, seen_u, every = 0, 0.0, 0.0, 0, 0.0, 0.0, 0
        for y in range(max(int(v - tuft_px), 0), min(int(v + tuft_px) + 2, len(signs))):
            for x in range(max(int(u - tuft_px), 0), min(int(u + tuft_px) + 2, len(signs))):
                square, sign = (y - v) * (y - v) + (x - u) * (x - u), signs[y, x]
                if sign > 0 and square <= tuft_px * tuft_px:
                    own += 1
                    own_v += y
                    own_u += x
                if square <= disc_px * disc_px:
                    every += 1
                    if sign != 0:
                        seen += 1
                        seen_v += y
                        seen_u += x
        if own == 0 or seen == 0:
            break
        shown = seen / every
        v += _GAIN * (own_v / own - seen_v / seen)
        u += _GAIN * (own_u / own - seen_u / seen)
    return v, u, shown


@compiled
def _within(signs: Signs, v: float, u: float, radius: float) -> Part:
    """Filaments within a distance."""
    rows, columns, count = np.empty(signs.size, np.int64), np.empty(signs.size, np.int64), 0
    for y in range(max(int(v - radius), 0), min(int(v + radius) + 2, len(signs))):
        for x in range(max(int(u - radius), 0), min(int(u + radius) + 2, len(signs))):
            if signs[y, x] > 0 and (y - v) * (y - v) + (x - u) * (x - u) <= radius * radius:
                rows[count], columns[count] = y, x
                count += 1
    return rows[:count], columns[:count]


def _quantile(values: NDArray[np.generic], share: float) -> float:
    place = int(share * len(values))
    return float(np.partition(values, place)[place])


def _stage(pixels: NDArray[np.uint8], settings: BloomSettings) -> int:
    if _quantile(pixels[:, 2], 0.5) < settings.dry_value:
        return 3
    # Hues above 90 count as below zero: bytes begin anew behind 255.
    return 1 if _quantile(pixels[:, 0] + np.uint8(165), 0.5) > settings.late_hue + 165 else 2


def _parts(mask: NDArray[np.uint8], depth_m: NDArray[np.float32], focal: float, settings: BloomSettings) -> list[Part]:
    """Pieces of filaments between steps in depth; what is larger than half a tuft is cut at its necks."""
    kernel = np.ones((3, 3), np.uint8)
    # Facets in shade leave pinholes; single stray pixels are edges of leaves against pots.
    whole = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, kernel)
    # One tuft before another: the step in depth between them is no part of either.
    whole[cv2.morphologyEx(depth_m, cv2.MORPH_GRADIENT, kernel) > settings.depth_step_m] = 0
    whole = np.asarray(cv2.morphologyEx(whole, cv2.MORPH_OPEN, kernel), np.uint8)
    return _pixels_of(_cut(whole, 0.5 * settings.head_area_m2 * (focal / settings.range_m[1]) ** 2, settings))


def _pixels_of(labels: NDArray[np.int32]) -> list[Part]:
    """Rows and columns of every label above 0, in ascending order of the labels; one pass over the picture."""
    rows, columns = np.nonzero(labels)
    if len(rows) == 0:
        return []
    owner = labels[rows, columns]
    order = np.argsort(owner, kind="stable")
    cuts = np.flatnonzero(np.diff(owner[order])) + 1
    return list(zip(np.split(rows[order], cuts), np.split(columns[order], cuts), strict=True))


def _apart(rows: NDArray[np.int64], columns: NDArray[np.int64]) -> list[Part]:
    """Connected parts of pixels."""
    top, left = rows.min(), columns.min()
    there = np.zeros((rows.max() - top + 1, columns.max() - left + 1), np.uint8)
    there[rows - top, columns - left] = 1
    return [(y + top, x + left) for y, x in _pixels_of(regions(there)[0])]


def _cut(mask: NDArray[np.uint8], least: float, settings: BloomSettings) -> NDArray[np.int32]:
    """Label patches; from ``least`` pixels on they are cut at their necks: each pixel goes to the nearest core."""
    labels, boxes = regions(mask)
    result, following = labels.copy(), len(boxes)
    for label, (x, y, w, h, pixels) in enumerate(boxes.tolist()):
        if pixels < least:
            continue
        window = slice(y, y + h), slice(x, x + w)
        here = labels[window] == label
        distance = cv2.distanceTransform(np.pad(here.astype(np.uint8), 1), cv2.DIST_L2, 5)[1:-1, 1:-1]
        cores = distance > settings.split_share * distance.max()
        parts, core_labels = cv2.connectedComponents(cores.astype(np.uint8), connectivity=8)
        if parts <= 2:
            continue
        # Every pixel belongs to the nearest core; OpenCV numbers the cores anew.
        _, nearest = cv2.distanceTransformWithLabels((~cores).astype(np.uint8), cv2.DIST_L2, 5)
        for part in range(2, parts):
            owner = nearest[core_labels == part][0]
            result[window][here & (nearest == owner)] = following
            following += 1
    return result
