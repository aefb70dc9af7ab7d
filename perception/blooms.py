"""Finds safflower heads in an RGB-D picture from above: orange-red filaments, their depth, their stage."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from .frames import Frame

Array = NDArray[np.float64]


@dataclass(frozen=True)
class BloomSettings:
    """Thresholds of the detector. Hue and saturation as OpenCV counts them: hue 0-179, saturation and value 0-255.

    Attributes:
        hue_range: filaments from brown-red to yellow-orange.
        min_saturation: below it soil and wood.
        min_value: below it deep shade.
        range_m: depths at which heads can be; pots and soil lie beyond.
        min_area_m2: smaller patches are no head.
        head_area_m2: filaments of an average tuft seen from above (identified: median of the unhidden tufts in
            rendered pots).
        head_spread_m: spread of that tuft (published mean).
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
    min_area_m2: float = 2.5e-4
    head_area_m2: float = 8.5e-4
    head_spread_m: float = 0.04785
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
    near = (depth_m > settings.range_m[0]) & (depth_m < settings.range_m[1])
    mask[~near] = 0
    # Facets in shade leave pinholes; single stray pixels are edges of leaves against pots.
    kernel = np.ones((3, 3), np.uint8)
    mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, kernel)
    # One tuft before another: the step in depth between them is no part of either.
    mask[cv2.morphologyEx(depth_m, cv2.MORPH_GRADIENT, kernel) > settings.depth_step_m] = 0
    return np.asarray(cv2.morphologyEx(mask, cv2.MORPH_OPEN, kernel), np.uint8), np.asarray(hsv, np.uint8)


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
    labels = _split_touching(mask, depth_m, settings)
    focal = float(intrinsics[0, 0])
    positions, stages, areas = [], [], []
    for rows, columns in _pixels_of(labels):
        depth = depth_m[rows, columns]
        pixel_area = (float(np.median(depth)) / focal) ** 2
        area = len(rows) * pixel_area
        if area < settings.min_area_m2:
            continue
        top = float(np.percentile(depth, 20.0)) + settings.tuft_half_height_m
        u, v = float(columns.mean()), float(rows.mean())
        ray = np.array([(u - intrinsics[0, 2]) / focal, (v - intrinsics[1, 2]) / focal, 1.0])
        positions.append(world_from_camera[:3, :3] @ (ray * top) + world_from_camera[:3, 3])
        stages.append(_stage(hsv[rows, columns], settings))
        areas.append(area)
    area_m2 = np.array(areas)
    return Blooms(
        np.array(positions).reshape(-1, 3),
        np.array(stages, dtype=np.int64),
        settings.head_spread_m * np.sqrt(area_m2 / settings.head_area_m2),
        np.minimum(area_m2 / settings.head_area_m2, 1.0),
    )


def _pixels_of(labels: NDArray[np.int32]) -> list[tuple[NDArray[np.intp], NDArray[np.intp]]]:
    """Rows and columns of every label above 0, in ascending order of the labels; one pass over the picture."""
    rows, columns = np.nonzero(labels)
    if len(rows) == 0:
        return []
    owner = labels[rows, columns]
    order = np.argsort(owner, kind="stable")
    cuts = np.flatnonzero(np.diff(owner[order])) + 1
    return list(zip(np.split(rows[order], cuts), np.split(columns[order], cuts), strict=True))


def _stage(pixels: NDArray[np.uint8], settings: BloomSettings) -> int:
    hue = np.where(pixels[:, 0] > 90, pixels[:, 0].astype(float) - 180.0, pixels[:, 0])
    if np.median(pixels[:, 2]) < settings.dry_value:
        return 3
    return 1 if np.median(hue) > settings.late_hue else 2


def _split_touching(
    mask: NDArray[np.uint8], depth_m: NDArray[np.float32], settings: BloomSettings
) -> NDArray[np.int32]:
    """Label tufts; patches larger than one tuft are split at their necks: each pixel goes to the nearest core."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats(mask, connectivity=8)
    result = labels.astype(np.int32)
    following = count
    for label in range(1, count):
        x, y, w, h = stats[label, :4]
        window = slice(y, y + h), slice(x, x + w)
        here = labels[window] == label
        if min(w, h) < 5:
            continue
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
