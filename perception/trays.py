"""Tells empty cells, healthy and poor seedlings of a tray row apart in an RGB-D image from above."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

EMPTY, HEALTHY, POOR = 0, 1, 2


class CellLook(NamedTuple):
    """What was measured of the cells of a row, each (n,).

    Attributes:
        middle: leaf area near a cell's middle over the area of the disc that was looked at, in [0, 1].
        area: leaf area over the whole cell, in squares of the nursery pitch.
        yellow: share of that area whose leaves are yellow.
    """

    middle: Array
    area: Array
    yellow: Array


@dataclass(frozen=True)
class TrayRule:
    """Thresholds of the classification [identified: fitted to rendered rows, see scripts/measure_tray_camera.py].

    Attributes:
        leaf_excess: excess green 2 g - r - b of chromatic coordinates above which a pixel is leaf.
        leaf_value: brightness (0-255) below which a pixel is shadow or tray.
        yellow_hue: OpenCV hue (0-179) below which a leaf is yellow.
        middle_radius: of the disc about a cell's middle, in nursery pitches.
        empty_middle: below this share of leaf in the disc the cell is empty.
        poor_area: below this leaf area the seedling is stunted.
        yellow_share: above this share of yellow leaf it is chlorotic.
    """

    leaf_excess: float = 0.10
    leaf_value: float = 60.0
    yellow_hue: float = 37.0
    middle_radius: float = 0.16
    empty_middle: float = 0.08
    poor_area: float = 0.19
    yellow_share: float = 0.30


def look_at_cells(
    rgb: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
    intrinsics: ArrayLike,
    world_from_camera: ArrayLike,
    cells_m: ArrayLike,
    pitch_m: float,
    nursery_pitch_m: float,
    rule: TrayRule | None = None,
) -> CellLook:
    """Measure the leaves over each cell.

    The depth takes every leaf pixel to its true place over the tray: without it, leaves 50 mm above the cells would
    lean outwards by several millimetres at the row's ends.

    Args:
        rgb: picture (h, w, 3).
        depth_m: depth along the view, (h, w), metres.
        intrinsics: (3, 3), pixels.
        world_from_camera: (4, 4), camera axes as OpenCV's.
        cells_m: middles of the cells' upper faces in the world, (n, 3).
        pitch_m: distance of the cells.
        nursery_pitch_m: distance of the cells that the seedlings grew in, the unit of their size.
        rule: thresholds.

    Raises:
        ValueError: the picture and the depth have different sizes.
    """
    if rgb.shape[:2] != depth_m.shape:
        raise ValueError(f"the picture is {rgb.shape[:2]} and the depth {depth_m.shape}: give one camera's pair")
    rule = rule or TrayRule()
    matrix, pose = np.asarray(intrinsics, np.float64), np.asarray(world_from_camera, np.float64)
    cells = np.asarray(cells_m, np.float64)
    blurred = cv2.GaussianBlur(rgb, (3, 3), 0)
    colour = blurred.astype(np.float32)
    total = np.maximum(colour.sum(axis=2), 1.0)
    excess = (2.0 * colour[..., 1] - colour[..., 0] - colour[..., 2]) / total
    hsv = cv2.cvtColor(blurred, cv2.COLOR_RGB2HSV)
    leaf = ((excess > rule.leaf_excess) & (hsv[..., 2] > rule.leaf_value)).astype(np.uint8)
    leaf = cv2.morphologyEx(leaf, cv2.MORPH_OPEN, np.ones((2, 2), np.uint8))
    rows, columns = np.nonzero(leaf)
    depth = depth_m[rows, columns].astype(np.float64)
    focal = matrix[0, 0], matrix[1, 1]
    ray = np.stack([(columns - matrix[0, 2]) / focal[0], (rows - matrix[1, 2]) / focal[1], np.ones(len(rows))])
    place = pose[:3, :3] @ (ray * depth) + pose[:3, 3:]
    pixel_m2 = depth * depth / (focal[0] * focal[1])
    yellow = hsv[rows, columns, 0] < rule.yellow_hue
    offset = place[None, :2] - cells[:, :2, None]
    over = np.abs(offset).max(axis=1) <= 0.5 * pitch_m
    radius = rule.middle_radius * nursery_pitch_m
    near = (offset * offset).sum(axis=1) <= radius * radius
    area = over @ pixel_m2
    return CellLook(
        middle=near @ pixel_m2 / (np.pi * radius * radius),
        area=area / nursery_pitch_m**2,
        yellow=over @ (pixel_m2 * yellow) / np.maximum(area, 1e-12),
    )


def decide(look: CellLook, rule: TrayRule | None = None) -> NDArray[np.int8]:
    """Reports (n,): ``EMPTY``, ``HEALTHY`` or ``POOR``."""
    rule = rule or TrayRule()
    poor = (look.area < rule.poor_area) | (look.yellow > rule.yellow_share)
    return np.where(look.middle < rule.empty_middle, EMPTY, np.where(poor, POOR, HEALTHY)).astype(np.int8)


def classify_row(
    rgb: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
    intrinsics: ArrayLike,
    world_from_camera: ArrayLike,
    cells_m: ArrayLike,
    pitch_m: float,
    nursery_pitch_m: float,
    rule: TrayRule | None = None,
) -> tuple[NDArray[np.int8], CellLook]:
    """Reports (n,) of the cells of a row, and what they rest on; arguments as for ``look_at_cells``."""
    look = look_at_cells(rgb, depth_m, intrinsics, world_from_camera, cells_m, pitch_m, nursery_pitch_m, rule)
    return decide(look, rule), look
