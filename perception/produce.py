"""Finds produce on a belt in one RGB-D image: place, orientation, size and grade of every ellipsoid.

The outline, the slope and the mean height of the visible half of an ellipsoid determine it, if it lies on a known
plane. Seen along w, with u and v across, a matrix S of the ellipsoid {p : p' S^-1 p = 1} shows the outline S_uv, and
the outline lies in the plane w = l.(u, v) with S_uw = S_uv l. The visible surface stands sqrt(1 - r^2) h above that
plane, r = 1 on the outline, so a least-squares plane through it has exactly the slope l and is 2/3 h higher. What is
left, h, follows from where the ellipsoid touches the belt.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled
from .frames import Frame
from .regions import regions

Array = NDArray[np.float64]

_SOLID = 0.955
"""A blob that fills less of its convex hull than this is more than one item; a rasterised ellipse fills 0.97."""
_SEED_PIXELS = 16
_CROSS = cv2.getStructuringElement(cv2.MORPH_CROSS, (3, 3))


@dataclass(frozen=True)
class ProduceSettings:
    """How images are read; all chosen for the look of the produce, none fitted to the truth of single images."""

    warm: int = 24
    """A pixel belongs to produce when its red or green exceeds its blue by this much: the belt is blue."""
    lowest_m: float = 0.003
    """And when it lies this much above the belt."""
    smallest_m2: float = 4.0e-4
    largest_m2: float = 8.0e-3
    """Area of an item's outline."""
    tuber_saturation: float = 0.68
    """Tubers are duller than fruits."""
    ripe_hue_deg: float = 50.1
    """Fruits with a lower hue (towards red) are ripe [identified: the hue that a skin of the threshold has]."""
    rim_m: float = 0.0005
    """The outline is this much wider than its pixels' middles show [identified on rendered items]."""
    belt_rgb: tuple[float, float, float] = (67.1, 97.0, 115.1)
    """Mean colour of the bare belt while no channel's gain has drifted [identified: rendered fruits' hues come out]."""
    most_drift: float = 0.15
    """Gains are taken to drift no farther than this from 1: what differs more is another belt."""
    ware_from_m: float = 0.061
    """Tubers at least this long are ware."""


class Produce(NamedTuple):
    """Items in an image, nearest to its middle row first; shapes (n, ...).

    Attributes:
        position: (n, 3), centres, world metres.
        yaw: (n,), rad, direction of the long axis before the tilt, in (-pi/2, pi/2].
        tilt: (n,), rad, lean of the short axis.
        azimuth: (n,), rad, where it leans to.
        axes_m: (n, 3), full lengths, longest first.
        grade: (n,), 0 ware, 1 seed, 2 ripe, 3 green.
        hue_deg: (n,), median hue.
    """

    position: Array
    yaw: Array
    tilt: Array
    azimuth: Array
    axes_m: Array
    grade: NDArray[np.int64]
    hue_deg: Array

    def where(self, chosen: NDArray[np.bool_]) -> Produce:
        """Only the chosen ones (n,)."""
        return Produce._make(column[chosen] for column in self)


class Belt(NamedTuple):
    """What has to be known to read a picture: ``height_m``, world height of the belt."""

    height_m: float


def detect(frame: Frame, context: Belt, settings: ProduceSettings | None = None) -> Produce:
    """Items that are wholly in the picture.

    Args:
        frame: a picture from above.
        context: the belt under it.
        settings: how to read the picture.
    """
    settings = settings or ProduceSettings()
    rgb, depth_m, camera = frame
    world, belt_m = camera.world_from_camera, context.height_m
    found = []
    mask = produce_mask(frame, context, settings)
    gains = _gains(rgb, mask, settings)
    for top, left, body in _separate(mask):
        rows, columns = np.nonzero(body)
        if len(rows) == 0:
            continue
        rows, columns = rows + top, columns + left
        if rows[0] == 0 or rows[-1] == len(rgb) - 1 or columns.min() == 0 or columns.max() == rgb.shape[1] - 1:
            continue
        depth = depth_m[rows, columns].astype(np.float64)
        # A pixel's share of the outline grows with the square of its distance.
        weight = depth**2
        area = float(weight.sum()) / float(camera.intrinsics[0, 0] * camera.intrinsics[1, 1])
        if not settings.smallest_m2 <= area <= settings.largest_m2:
            continue
        points = (_rays(camera.intrinsics, rows, columns) * depth[:, None]) @ world[:3, :3].T + world[:3, 3]
        shape = _ellipsoid(points, weight, world[:3, 3], belt_m, settings.rim_m)
        if shape is None:
            continue
        hue, saturation = _colour(rgb, gains, top, left, body)
        found.append((*shape, _grade(settings, hue, saturation, float(shape[2][0])), hue))
    return _table(found)


def produce_mask(frame: Frame, context: Belt, settings: ProduceSettings) -> NDArray[np.uint8]:
    """Pixels (h, w) of produce, 0 or 1: not of the belt's colour, and above it in the median of 5 x 5 pixels."""
    rgb, depth_m, (intrinsics, world) = frame
    warm, high = _warm_and_high(rgb, depth_m, intrinsics, world, settings.warm, context.height_m, settings.lowest_m)
    # A median of 25 is high where 13 of them are.
    most = cv2.boxFilter(high, -1, (5, 5), normalize=False, borderType=cv2.BORDER_REPLICATE) > 12
    mask = cv2.morphologyEx(warm & most.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    return np.asarray(mask, np.uint8)


@compiled
def _warm_and_high(
    rgb: NDArray[np.uint8],
    depth_m: NDArray[np.float32],
    intrinsics: Array,
    world_from_camera: Array,
    warm: int,
    belt_m: float,
    lowest_m: float,
) -> tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """Which pixels (h, w) have more red or green than blue, by ``warm``, and which lie ``lowest_m`` above the belt."""
    height, width = depth_m.shape
    colour, above = np.empty((height, width), np.uint8), np.empty((height, width), np.uint8)
    across, down, ahead, eye = world_from_camera[2]
    lowest = np.float32(lowest_m)
    for y in range(height):
        v = (y - intrinsics[1, 2]) / intrinsics[1, 1]
        for x in range(width):
            r, g, b = np.int64(rgb[y, x, 0]), np.int64(rgb[y, x, 1]), np.int64(rgb[y, x, 2])
            colour[y, x] = max(r, g) - b > warm
            depth = np.float64(depth_m[y, x])
            u = (x - intrinsics[0, 2]) / intrinsics[0, 0]
            z = u * depth * across + v * depth * down + depth * ahead + eye
            above[y, x] = np.float32(z - belt_m) > lowest
    return colour, above


def _rays(intrinsics: Array, rows: NDArray[np.int64], columns: NDArray[np.int64]) -> Array:
    """Camera rays (n, 3) of unit depth through pixels."""
    x = (columns - intrinsics[0, 2]) / intrinsics[0, 0]
    y = (rows - intrinsics[1, 2]) / intrinsics[1, 1]
    return np.stack([x, y, np.ones_like(x)], axis=-1)


def _separate(mask: NDArray[np.uint8]) -> Iterator[tuple[int, int, NDArray[np.uint8]]]:
    """Items as their first row, their first column, and a window that is 1 where they are.

    Those that touch are parted by shrinking their blob until it comes apart, and growing the pieces back.
    """
    blobs, boxes = regions(mask)
    for blob, (x, y, width, height, area) in enumerate(boxes.tolist()):
        if area < _SEED_PIXELS:
            continue
        body = (blobs[y : y + height, x : x + width] == blob).astype(np.uint8)
        # A frame of background, or the image's own border would hold the blob together.
        framed = cv2.copyMakeBorder(body, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=0)
        seeds = _seeds(framed)
        if len(seeds) == 1:
            yield y, x, body
            continue
        # Every pixel goes to the piece whose middle part is nearest.
        distance = np.stack([cv2.distanceTransform(1 - seed, cv2.DIST_L2, 5) for seed in seeds])
        nearest = distance.argmin(axis=0)[1:-1, 1:-1]
        for piece in range(len(seeds)):
            yield y, x, body & (nearest == piece)


def _seeds(body: NDArray[np.uint8]) -> list[NDArray[np.uint8]]:
    """Middle parts of the convex pieces of a blob, one for each; the blob itself where it is convex."""
    contours, _ = cv2.findContours(body, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(contours, key=cv2.contourArea)
    hull = cv2.contourArea(cv2.convexHull(outline))
    if cv2.contourArea(outline) >= _SOLID * hull:
        return [body]
    shrunk = body
    while True:
        shrunk = cv2.erode(shrunk, _CROSS)
        count, pieces, stats, _ = cv2.connectedComponentsWithStats(shrunk, connectivity=4)
        large = [piece for piece in range(1, count) if stats[piece, cv2.CC_STAT_AREA] >= _SEED_PIXELS]
        if not large:
            return [body]
        if len(large) > 1:
            return [seed for piece in large for seed in _seeds((pieces == piece).astype(np.uint8))]
        shrunk = (pieces == large[0]).astype(np.uint8)


def _ellipsoid(
    points: Array, weight: Array, eye: Array, belt_m: float, rim_m: float
) -> tuple[Array, tuple[float, float, float], Array] | None:
    """Centre (3,), (yaw, tilt, azimuth), full axes (3,) of the ellipsoid behind visible points; None if none fits."""
    weight = weight / weight.sum()
    middle = weight @ points
    toward = eye - middle
    toward /= np.linalg.norm(toward)
    across = _cross(np.array([0.0, 1.0, 0.0]), toward)
    across /= np.linalg.norm(across)
    frame = np.stack([across, _cross(toward, across), toward])
    local = (points - middle) @ frame.T
    outline = 4.0 * (local[:, :2] * weight[:, None]).T @ local[:, :2]
    if np.linalg.det(outline) < 1e-14:
        return None
    slope = np.linalg.solve(outline / 4.0, (local[:, :2] * weight[:, None]).T @ local[:, 2])
    squares, directions = np.linalg.eigh(outline)
    outline = (directions * (np.sqrt(squares) + rim_m) ** 2) @ directions.T
    lean = outline @ slope
    # Height of the centre (belt at zero) is a - b h, the matrix's vertical part c + d h^2; they touch where equal.
    up = frame[:, 2]
    a, b = middle[2] - belt_m, 2.0 / 3.0 * up[2]
    c = up[:2] @ outline @ up[:2] + 2.0 * up[2] * (up[:2] @ lean) + up[2] ** 2 * (slope @ lean)
    d = up[2] ** 2
    inside = (a * b) ** 2 - (b * b - d) * (a * a - c)
    if inside < 0.0 or a <= 0.0:
        return None
    half = (a * b - np.sqrt(inside)) / (b * b - d)
    if not half > 0.0:
        return None
    matrix = np.empty((3, 3))
    matrix[:2, :2], matrix[:2, 2], matrix[2, :2] = outline, lean, lean
    matrix[2, 2] = half * half + slope @ lean
    centre = middle - 2.0 / 3.0 * half * toward
    values, vectors = np.linalg.eigh(frame.T @ matrix @ frame)
    if values[0] <= 0.0:
        return None
    order = [2, 1, 0]
    if abs(vectors[2, 0]) < abs(vectors[2, 1]):
        # Lying on its side: what points up counts as the short axis.
        order = [2, 0, 1]
    values, vectors = values[order], vectors[:, order]
    return centre, _angles(vectors), 2.0 * np.sqrt(values)


def _angles(vectors: Array) -> tuple[float, float, float]:
    """Yaw, tilt and azimuth of axes in columns (long, wide, short)."""
    short = vectors[:, 2] * (1.0 if vectors[2, 2] >= 0.0 else -1.0)
    azimuth = float(np.arctan2(short[1], short[0]))
    tilt = float(np.arctan2(np.hypot(short[0], short[1]), short[2]))
    # Undo the tilt: turn the long axis back about the horizontal axis across the azimuth.
    axis = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    long = vectors[:, 0]
    turn = -tilt
    back = long * np.cos(turn) + _cross(axis, long) * np.sin(turn) + axis * (axis @ long) * (1.0 - np.cos(turn))
    yaw = float(np.arctan2(back[1], back[0]))
    return yaw - np.pi * float(np.ceil(yaw / np.pi - 0.5)), tilt, azimuth


def _cross(a: Array, b: Array) -> Array:
    """Product (3,) of two vectors; NumPy's own takes ten times as long for one pair."""
    (x, y, z), (u, v, w) = a.tolist(), b.tolist()
    return np.array([y * w - z * v, z * u - x * w, x * v - y * u])


def _gains(rgb: NDArray[np.uint8], mask: NDArray[np.uint8], settings: ProduceSettings) -> NDArray[np.float32]:
    """What channels (3,) have to be multiplied by for the bare belt's hue to be the usual one; 1 where none shows."""
    # Every fourth pixel each way is enough; beside items there is their shade.
    bare = cv2.dilate(np.ascontiguousarray(mask[::4, ::4]), np.ones((3, 3), np.uint8)) == 0
    if not bare.any():
        return np.ones(3, np.float32)
    drift = np.maximum(rgb[::4, ::4][bare].mean(axis=0), 1.0) / np.array(settings.belt_rgb)
    drift = np.clip(drift / drift.mean(), 1.0 - settings.most_drift, 1.0 + settings.most_drift)
    return (1.0 / drift).astype(np.float32)


def _colour(
    rgb: NDArray[np.uint8], gains: NDArray[np.float32], top: int, left: int, body: NDArray[np.uint8]
) -> tuple[float, float]:
    """Median hue in degrees and saturation in [0, 1] of an item's core; hues just below 360 count as below zero."""
    core = cv2.erode(cv2.copyMakeBorder(body, 2, 2, 2, 2, cv2.BORDER_CONSTANT, value=0), np.ones((5, 5), np.uint8))
    core = core[2:-2, 2:-2] if core.any() else body
    height, width = body.shape
    # Two pixels more all around, for the median.
    up, aside = min(top, 2), min(left, 2)
    around = np.ascontiguousarray(rgb[top - up : top + height + 2, left - aside : left + width + 2])
    inside = cv2.medianBlur(around, 5)[up : up + height, aside : aside + width][core > 0]
    pixels = np.asarray(cv2.cvtColor((inside * (gains / np.float32(255.0)))[None], cv2.COLOR_RGB2HSV))[0]
    hue = pixels[:, 0].astype(np.float64)
    return float(np.median(np.where(hue > 270.0, hue - 360.0, hue))), float(np.median(pixels[:, 1]))


def _grade(settings: ProduceSettings, hue_deg: float, saturation: float, length_m: float) -> int:
    if saturation < settings.tuber_saturation:
        return 0 if length_m >= settings.ware_from_m else 1
    return 2 if hue_deg < settings.ripe_hue_deg else 3


def _table(found: list[tuple[Array, tuple[float, float, float], Array, int, float]]) -> Produce:
    n = len(found)
    angles = np.array([item[1] for item in found]).reshape(n, 3)
    return Produce(
        position=np.array([item[0] for item in found]).reshape(n, 3),
        yaw=angles[:, 0],
        tilt=angles[:, 1],
        azimuth=angles[:, 2],
        axes_m=np.array([item[2] for item in found]).reshape(n, 3),
        grade=np.array([item[3] for item in found], dtype=np.int64),
        hue_deg=np.array([item[4] for item in found], dtype=np.float64),
    )
