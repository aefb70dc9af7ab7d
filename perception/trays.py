"""Tells empty cells, healthy and poor seedlings of a tray row apart in an RGB-D image from above."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .frames import Frame

Array = NDArray[np.float64]

EMPTY, HEALTHY, POOR = 0, 1, 2


class CellLook(NamedTuple):
    """What was measured of the cells of a row, each (n,).

    Attributes:
        middle: leaf area near a cell's middle over the area of the disc that was looked at, in [0, 1].
        area: leaf area over the whole cell, in squares of the nursery pitch.
        height: of the seedling over its stem, in nursery pitches; minus infinity where nothing grows near the middle.
        yellow: share of that area whose leaves are yellow.
    """

    middle: Array
    area: Array
    height: Array
    yellow: Array


@dataclass(frozen=True)
class TraySettings:
    """Thresholds of the classification [identified: fitted to rendered rows, see scripts/measure_camera.py].

    Attributes:
        leaf_excess: excess green 2 g - r - b of chromatic coordinates above which a pixel is leaf.
        leaf_value: brightness (0-255) below which a pixel is shadow or tray.
        yellow_hue: OpenCV hue (0-179) below which a leaf is yellow.
        middle_radius: of the disc about a cell's middle, in nursery pitches.
        empty_middle: below this share of leaf in the disc the cell is empty.
        poor_area: below this leaf area the seedling is stunted.
        height_radius: of the disc about a cell's middle in which its own leaves reach highest, in nursery pitches.
        height_share: so many of the leaf's pixels in that disc lie below the height: tips of neighbours do not count.
        stem_m: height over the tray below which seedlings of all sizes are stem [identified: it makes the heights of
            one size alike in all trays].
        poor_height: below this height over the stem the seedling is stunted, whatever hangs over it.
        yellow_share: above this share of yellow leaf it is chlorotic.
    """

    leaf_excess: float = 0.10
    leaf_value: float = 60.0
    yellow_hue: float = 37.0
    middle_radius: float = 0.16
    empty_middle: float = 0.08
    poor_area: float = 0.185
    height_radius: float = 0.35
    height_share: float = 0.95
    stem_m: float = 0.018
    poor_height: float = 0.465
    yellow_share: float = 0.30


class Cells(NamedTuple):
    """The row of cells in a picture.

    Attributes:
        middle_m: middles of the cells' upper faces in the world, (n, 3).
        pitch_m: distance of the cells.
        nursery_pitch_m: distance of the cells that the seedlings grew in, the unit of their size.
    """

    middle_m: ArrayLike
    pitch_m: float
    nursery_pitch_m: float


def look_at_cells(frame: Frame, context: Cells, settings: TraySettings | None = None) -> CellLook:
    """Measure the leaves over each cell.

    The depth takes every leaf pixel to its true place over the tray: without it, leaves 50 mm above the cells would
    lean outwards by several millimetres at the row's ends.

    Args:
        frame: a picture from above.
        context: which cells.
        settings: thresholds.

    Raises:
        ValueError: the picture and the depth have different sizes.
    """
    rgb, depth_m, camera = frame
    if rgb.shape[:2] != depth_m.shape:
        raise ValueError(f"the picture is {rgb.shape[:2]} and the depth {depth_m.shape}: give one camera's pair")
    settings = settings or TraySettings()
    matrix, pose = (np.asarray(part, np.float64) for part in camera)
    cells = np.asarray(context.middle_m, np.float64)
    pitch_m, nursery_pitch_m = context.pitch_m, context.nursery_pitch_m
    blurred = cv2.GaussianBlur(rgb, (3, 3), 0)
    colour = blurred.astype(np.float32)
    total = np.maximum(colour.sum(axis=2), 1.0)
    excess = (2.0 * colour[..., 1] - colour[..., 0] - colour[..., 2]) / total
    hsv = cv2.cvtColor(blurred, cv2.COLOR_RGB2HSV)
    leaf = ((excess > settings.leaf_excess) & (hsv[..., 2] > settings.leaf_value)).astype(np.uint8)
    leaf = cv2.morphologyEx(leaf, cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
    rows, columns = np.nonzero(leaf)
    depth = depth_m[rows, columns].astype(np.float64)
    focal = matrix[0, 0], matrix[1, 1]
    ray = np.stack([(columns - matrix[0, 2]) / focal[0], (rows - matrix[1, 2]) / focal[1], np.ones(len(rows))])
    place = pose[:3, :3] @ (ray * depth) + pose[:3, 3:]
    pixel_m2 = depth * depth / (focal[0] * focal[1])
    yellow = hsv[rows, columns, 0] < settings.yellow_hue
    offset = place[None, :2] - cells[:, :2, None]
    over = np.abs(offset).max(axis=1) <= 0.5 * pitch_m
    square = (offset * offset).sum(axis=1)
    radius = settings.middle_radius * nursery_pitch_m
    near = square <= radius * radius
    around = square <= (settings.height_radius * nursery_pitch_m) ** 2
    height_m = np.array([_height_m(place[2, own], settings.height_share) for own in around]) - cells[:, 2]
    area, yellow_m2 = (over @ np.column_stack([pixel_m2, pixel_m2 * yellow])).T
    return CellLook(
        middle=near @ pixel_m2 / (np.pi * radius * radius),
        area=area / nursery_pitch_m**2,
        height=(height_m - settings.stem_m) / nursery_pitch_m,
        yellow=yellow_m2 / np.maximum(area, 1e-12),
    )


def _height_m(height_m: Array, share: float) -> float:
    """Height below which that share of leaf pixels lies; minus infinity of none."""
    if len(height_m) == 0:
        return -np.inf
    place = int(share * len(height_m))
    return float(np.partition(height_m, place)[place])


def decide(look: CellLook, settings: TraySettings | None = None) -> NDArray[np.int8]:
    """Reports (n,): ``EMPTY``, ``HEALTHY`` or ``POOR``."""
    settings = settings or TraySettings()
    stunted = (look.area < settings.poor_area) | (look.height < settings.poor_height)
    poor = stunted | (look.yellow > settings.yellow_share)
    return np.where(look.middle < settings.empty_middle, EMPTY, np.where(poor, POOR, HEALTHY)).astype(np.int8)


def detect(frame: Frame, context: Cells, settings: TraySettings | None = None) -> NDArray[np.int8]:
    """Reports (n,) of the cells of a row; arguments as for ``look_at_cells``."""
    return decide(look_at_cells(frame, context, settings), settings)
