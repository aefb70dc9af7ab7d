"""Finding seedlings in pictures from above: colour index, blobs, crop or weed, and tracks over many pictures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WeedDetectorSettings:
    """Thresholds of the detector; found on rendered pictures of other fields than those that are measured.

    Attributes:
        green: normalised excess green (2g - r - b over r + g + b) from which a pixel counts as plant.
        close_m: gaps up to this width are closed: thin grass breaks up.
        smallest_m2: blobs below are dirt.
        row_half_m: crop plants stand within this distance of the row's middle.
        crop_m2: blobs in the row from this area on are crop plants.
        leaf_m2: (broadleaf, grass) pairs of areas that part cotyledon, two-leaf and four-leaf.
        slender: share of the smallest enclosing circle that a blob fills, below which it is a grass.
    """

    green: float = 0.10
    close_m: float = 0.0021
    smallest_m2: float = 1.2e-5
    row_half_m: float = 0.05
    crop_m2: float = 1.3e-3
    leaf_m2: tuple[tuple[float, float], tuple[float, float]] = ((1.5e-4, 6.0e-4), (6.0e-5, 2.0e-4))
    slender: float = 0.30


class Seedlings(NamedTuple):
    """Blobs of one picture, n of them.

    Attributes:
        position: (n, 2), world metres.
        area_m2: (n,).
        species: (n,), 0 broadleaf, 1 grass.
        stage: (n,), 0 cotyledon, 1 two-leaf, 2 four-leaf.
        crop: (n,), taken for a crop plant.
        box: (n, 4), left, top, width, height in pixels.
    """

    position: Array
    area_m2: Array
    species: NDArray[np.int64]
    stage: NDArray[np.int64]
    crop: NDArray[np.bool_]
    box: NDArray[np.int64]


def plant_mask(rgb: NDArray[np.uint8], green: float, close_px: int) -> NDArray[np.uint8]:
    """Pixels (h, w) of plants, 0 or 255: excess green over the sum of the channels, which shade hardly changes."""
    r, g, b = (rgb[..., c].astype(np.float32) for c in range(3))
    index = (2.0 * g - r - b) / np.maximum(r + g + b, 30.0)
    mask = (cv2.GaussianBlur(index, (3, 3), 0.0) > green).astype(np.uint8) * 255
    if close_px > 1:
        mask = cv2.morphologyEx(
            mask, cv2.MORPH_CLOSE, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (close_px, close_px))
        )
    return np.asarray(mask, np.uint8)


def detect_seedlings(
    rgb: NDArray[np.uint8],
    intrinsics: Array,
    world_from_camera: Array,
    height_m: float,
    row_across_m: float = 0.0,
    settings: WeedDetectorSettings | None = None,
) -> Seedlings:
    """Segment a picture from above and say what stands where.

    Args:
        rgb: (h, w, 3), uint8.
        intrinsics: (3, 3), pixels.
        world_from_camera: (4, 4), OpenCV axes.
        height_m: height of the plane that the plants are taken to lie in.
        row_across_m: where the crop row runs.
        settings: thresholds.
    """
    chosen = settings or WeedDetectorSettings()
    pixel_m = abs(world_from_camera[2, 3] - height_m) / intrinsics[0, 0]
    close = max(1, round(chosen.close_m / pixel_m) // 2 * 2 + 1)
    mask = plant_mask(rgb, chosen.green, close)
    count, labels, stats, centres = cv2.connectedComponentsWithStats(mask, connectivity=8)
    # What the picture's first or last row cuts off is whole in another picture.
    top, bottom = stats[:, cv2.CC_STAT_TOP], stats[:, cv2.CC_STAT_TOP] + stats[:, cv2.CC_STAT_HEIGHT]
    whole = (top > 0) & (bottom < len(rgb)) & (stats[:, cv2.CC_STAT_AREA] * pixel_m**2 >= chosen.smallest_m2)
    rows = [i for i in range(1, count) if whole[i]]
    area = stats[rows, cv2.CC_STAT_AREA] * pixel_m**2
    box = stats[rows, :4].astype(np.int64)
    fill = np.array([_fill(labels, i, stats[i]) for i in rows])
    species = (fill < chosen.slender).astype(np.int64)
    limits = np.array(chosen.leaf_m2)[species] if len(rows) else np.zeros((0, 2))
    stage = (area[:, None] > limits).sum(axis=1)
    position = on_plane(np.asarray(centres[rows], np.float64), intrinsics, world_from_camera, height_m)
    crop = (area >= chosen.crop_m2) & (np.abs(position[:, 1] - row_across_m) <= chosen.row_half_m)
    return Seedlings(position, area, species, stage, crop, box)


def on_plane(pixels: Array, intrinsics: Array, world_from_camera: Array, height_m: float) -> Array:
    """World places (n, 2) where the rays of pixels (n, 2) meet a horizontal plane."""
    rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(intrinsics).T @ world_from_camera[:3, :3].T
    eye = world_from_camera[:3, 3]
    return eye[:2] + rays[:, :2] * ((height_m - eye[2]) / rays[:, 2])[:, None]


def _fill(labels: NDArray[Any], label: int, stat: NDArray[Any]) -> float:
    x, y, w, h = (int(v) for v in stat[:4])
    part = (labels[y : y + h, x : x + w] == label).astype(np.uint8)
    points = cv2.findNonZero(part)
    _, radius = cv2.minEnclosingCircle(points)
    return float(stat[cv2.CC_STAT_AREA]) / (np.pi * (radius + 0.5) ** 2)


@dataclass
class Track:
    """A plant followed over pictures; places are in the world of the odometry."""

    place: Array
    hits: int
    first_m: float
    last_m: float
    confirmed_m: float = np.inf
    votes: Array = field(default_factory=lambda: np.zeros((2, 3)))
    crop_votes: int = 0
    treated: bool = False

    @property
    def is_crop(self) -> bool:
        """Whether most pictures took it for a crop plant."""
        return 2 * self.crop_votes > self.hits


class WeedTracker:
    """Joins the blobs of successive pictures: nearest neighbour within a gate, confirmed after enough hits."""

    def __init__(self, gate_m: float = 0.012, hits: int = 2):
        """Set the gate and the number of pictures that confirm a track."""
        self.gate_m, self.hits = gate_m, hits
        self.tracks: list[Track] = []

    def update(self, seedlings: Seedlings, cart_m: float) -> None:
        """Take the blobs of the picture that was taken at a cart position."""
        recent = [t for t in self.tracks if cart_m - t.last_m < 0.45]
        places = np.array([t.place for t in recent]).reshape(-1, 2)
        taken: set[int] = set()
        for i in np.argsort(-seedlings.area_m2, kind="stable").tolist():
            track = None
            if len(places):
                gap = np.hypot(*(places - seedlings.position[i]).T)
                for j in np.argsort(gap)[:3].tolist():
                    if gap[j] <= self.gate_m and j not in taken:
                        track = recent[j]
                        taken.add(j)
                        break
            if track is None:
                track = Track(seedlings.position[i].copy(), 0, cart_m, cart_m)
                self.tracks.append(track)
            track.hits += 1
            track.last_m = cart_m
            # The mean of all pictures, the newest with a little more weight.
            track.place = track.place + (seedlings.position[i] - track.place) / min(track.hits, 3)
            track.votes[seedlings.species[i], seedlings.stage[i]] += 1
            track.crop_votes += int(seedlings.crop[i])
            if track.hits == self.hits:
                track.confirmed_m = cart_m
