"""Finding seedlings in pictures from above: colour index, blobs, crop or weed, and tracks over many pictures."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import cv2
import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled
from .frames import Frame
from .regions import regions
from .rosettes import blade_foot, broad_bodies, part, slenderness

Array = NDArray[np.float64]


@dataclass(frozen=True)
class WeedSettings:
    """Thresholds of the detector; found on rendered pictures of other fields than those that are measured.

    Attributes:
        green: normalised excess green (2g - r - b over r + g + b) from which a pixel counts as plant.
        close_m: gaps up to this width are closed: thin grass breaks up.
        smallest_m2: plants below are dirt, or crumbs of other plants.
        rim_m: what lies within this distance of a broad leaf belongs to it.
        row_half_m: crop plants stand within this distance of a row's middle.
        crop_m2: plants in the row from this area on are crop plants.
        crop_leaf_m: half the width that only the leaves of crop plants have.
        leaf_m2: (broadleaf, grass) pairs of areas that part cotyledon, two-leaf and four-leaf.
        slender: share of the smallest enclosing circle that a plant fills, below which it is a grass.
        whole: whether plants at the first and last row of the picture are left out.
        stem_m: (broadleaf, grass) heights at which the leaves of the three stages leave the stem.
    """

    green: float = 0.14
    close_m: float = 0.0021
    smallest_m2: float = 1.5e-5
    rim_m: float = 0.004
    row_half_m: float = 0.05
    crop_m2: float = 2.2e-3
    crop_leaf_m: float = 0.0085
    leaf_m2: tuple[tuple[float, float], tuple[float, float]] = ((1.6e-4, 6.0e-4), (1.0e-4, 4.5e-4))
    slender: float = 0.20
    whole: bool = True
    stem_m: tuple[tuple[float, float, float], tuple[float, float, float]] = (
        (0.006, 0.009, 0.011),
        (0.006, 0.006, 0.006),
    )


class Seedlings(NamedTuple):
    """Plants of one picture, n of them.

    Attributes:
        position: (n, 2), world metres.
        species: (n,), 0 broadleaf, 1 grass.
        stage: (n,), 0 cotyledon, 1 two-leaf, 2 four-leaf.
        crop: (n,), taken for a crop plant.
        box: (n, 4), left, top, width, height in pixels.
        score: (n,), how sure that there is a plant: a probability.
    """

    position: Array
    species: NDArray[np.int64]
    stage: NDArray[np.int64]
    crop: NDArray[np.bool_]
    box: NDArray[np.int64]
    score: Array


def plant_mask(rgb: NDArray[np.uint8], limit: float, close_px: int) -> NDArray[np.uint8]:
    """Pixels (h, w) of plants, 0 or 255: excess green over the sum of the channels, which shade hardly changes.

    Args:
        rgb: a picture.
        limit: from which on a pixel counts as plant.
        close_px: width of the gaps that are closed.
    """
    red, green, blue = (np.asarray(channel, np.uint8) for channel in cv2.split(rgb))
    mask = _greener(red, green, blue, limit)
    if close_px > 1:
        mask = cv2.morphologyEx(mask, cv2.MORPH_CLOSE, _disc(close_px))
    return np.asarray(mask, np.uint8)


@compiled
def _greener(
    red: NDArray[np.uint8], green: NDArray[np.uint8], blue: NDArray[np.uint8], limit: float
) -> NDArray[np.uint8]:
    """Where the index of a picture, blurred over 3 x 3 pixels (1, 2, 1 each way), exceeds ``limit``: 255, else 0."""
    height, width = red.shape
    two, least, most = np.float32(2.0), np.float32(30.0), np.float32(limit)
    half, quarter = np.float32(0.5), np.float32(0.25)
    # Beyond an edge the picture goes on as in a mirror in its outermost pixels.
    index, blurred = np.empty(width + 2, np.float32), np.empty((height, width), np.float32)
    mask = np.empty((height, width), np.uint8)
    for y in range(height):
        for x in range(width):
            r, g, b = np.float32(red[y, x]), np.float32(green[y, x]), np.float32(blue[y, x])
            index[x + 1] = (two * g - r - b) / max(r + g + b, least)
        index[0], index[width + 1] = index[min(2, width)], index[max(width - 1, 1)]
        for x in range(width):
            blurred[y, x] = (index[x] + index[x + 2]) * quarter + index[x + 1] * half
    for y in range(height):
        above = blurred[y - 1 if y > 0 else min(1, height - 1)]
        here, below = blurred[y], blurred[y + 1 if y + 1 < height else max(height - 2, 0)]
        for x in range(width):
            mask[y, x] = 255 if (above[x] + below[x]) * quarter + here[x] * half > most else 0
    return mask


def _disc(width_px: int) -> NDArray[np.uint8]:
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (width_px, width_px)), np.uint8)


class Rows(NamedTuple):
    """What has to be known to tell crop from weed: ``across_m``, where the crop rows run."""

    across_m: tuple[float, ...] = (0.0,)


MIDDLE_ROW = Rows()


def detect(frame: Frame, context: Rows = MIDDLE_ROW, settings: WeedSettings | None = None) -> Seedlings:
    """Segment a picture from above, part plants that touch, and say what stands where.

    Args:
        frame: a picture; its depth is not looked at, the ground is taken for a plane.
        context: the crop rows under it.
        settings: thresholds.
    """
    rgb, _, (intrinsics, world_from_camera) = frame
    chosen = settings or WeedSettings()
    pixel_m = world_from_camera[2, 3] / intrinsics[0, 0]
    close = max(1, round(chosen.close_m / pixel_m) // 2 * 2 + 1)
    mask = plant_mask(rgb, chosen.green, close)
    smallest = max(int(chosen.smallest_m2 / pixel_m**2), 4)
    stems, areas, fills, boxes = [], [], [], []

    def add(stem: Array, pixels: NDArray[np.int64], fill: float) -> None:
        low, high = pixels.min(axis=0), pixels.max(axis=0)
        # What the picture's first or last row cuts off is whole in another picture.
        if chosen.whole and (low[0] <= 0 or high[0] >= len(rgb) - 1):
            return
        stems.append(stem[::-1])
        areas.append(len(pixels))
        fills.append(fill)
        boxes.append((low[1], low[0], high[1] - low[1] + 1, high[0] - low[0] + 1))

    labels, blobs = regions(mask)
    found = broad_bodies(labels, blobs, chosen.crop_leaf_m / pixel_m, int(chosen.crop_m2 / pixel_m**2))
    if found:
        bodies = np.zeros_like(mask)
        for pixels in found:
            add(pixels.mean(axis=0), pixels, 1.0)
            bodies[pixels[:, 0], pixels[:, 1]] = 1
        mask[cv2.dilate(bodies, _disc(2 * round(chosen.rim_m / pixel_m) + 1)) > 0] = 0
        labels, blobs = regions(mask)
    for i, (x, y, w, h, size) in enumerate(blobs.tolist()):
        if size < smallest:
            continue
        # A free pixel all around: lines of sight may run beside a plant.
        blob = np.zeros((h + 2, w + 2), np.uint8)
        blob[1:-1, 1:-1] = labels[y : y + h, x : x + w] == i
        for plant in part(blob, smallest):
            fill = slenderness(plant.pixels)
            one_blade = fill < chosen.slender and len(plant.pixels) * pixel_m**2 < chosen.leaf_m2[1][0]
            stem = blade_foot(plant) if one_blade else plant.stem
            corner = np.array([y - 1, x - 1])
            add(stem + corner, plant.pixels + corner, fill)
    area = np.array(areas, float) * pixel_m**2
    species = (np.array(fills, float) < chosen.slender).astype(np.int64)
    stage = (area[:, None] > np.array(chosen.leaf_m2)[species]).sum(axis=1)
    height = np.array(chosen.stem_m)[species, stage]
    position = on_plane(np.array(stems, float).reshape(-1, 2), intrinsics, world_from_camera, height)
    beside = np.abs(position[:, 1:] - np.array(context.across_m)).min(axis=1)
    crop = (area >= chosen.crop_m2) & (beside <= chosen.row_half_m)
    return Seedlings(position, species, stage, crop, np.array(boxes, np.int64).reshape(-1, 4), np.ones(len(position)))


def on_plane(pixels: Array, intrinsics: Array, world_from_camera: Array, height_m: Array | float) -> Array:
    """World places (n, 2) where the rays of pixels (n, 2) meet horizontal planes at heights (n,) or one height."""
    rays = np.column_stack([pixels, np.ones(len(pixels))]) @ np.linalg.inv(intrinsics).T @ world_from_camera[:3, :3].T
    eye = world_from_camera[:3, 3]
    return eye[:2] + rays[:, :2] * ((height_m - eye[2]) / rays[:, 2])[:, None]


@dataclass
class Track:
    """A plant followed over pictures; places are in the world of the odometry.

    Attributes:
        places: where the pictures that showed it saw it.
        first_m: cart position of the first of them.
        last_m: cart position of the last of them.
        looks: pictures in whose middle it lay, whether they showed it or not.
        least: how sure its pictures have to be, or it is doubtful.
        confirmed_m: cart position at which enough pictures had shown it.
        votes: (2, 3), pictures by species and stage, each counted by how sure it was.
        voted: all of these.
        crop_votes: those that took it for a crop plant, likewise.
        best: how sure the surest picture was.
        treated: whether the tool has been sent to it.
    """

    places: list[Array]
    first_m: float
    last_m: float
    looks: int = 0
    least: float = 0.75
    confirmed_m: float = np.inf
    votes: Array = field(default_factory=lambda: np.zeros((2, 3)))
    voted: float = 0.0
    crop_votes: float = 0.0
    best: float = 0.0
    treated: bool = False
    _median: tuple[int, Array] = field(default_factory=lambda: (0, np.zeros(2)), repr=False)

    @property
    def place(self) -> Array:
        """Median place (2,): a picture in which it was joined with a neighbour does not count for much."""
        if self._median[0] != len(self.places):
            # Asked for at every decision, another one after a picture only.
            self._median = len(self.places), np.median(np.array(self.places), axis=0)
        return self._median[1]

    @property
    def is_crop(self) -> bool:
        """Whether most pictures took it for a crop plant."""
        return 2.0 * self.crop_votes > self.voted

    @property
    def confidence(self) -> float:
        """How sure the pictures are that it is a weed, from 0 to 1.

        The share of the pictures that showed it as one, or should have, each counted by how sure it was; one more is
        taken to have shown nothing, so that many pictures are surer than few.
        """
        weed = max(self.voted - self.crop_votes, 0.0)
        return weed / (max(self.looks, len(self.places)) + 1.0)

    @property
    def is_doubtful(self) -> bool:
        """Whether pictures that should have shown it did not, or not for sure.

        How sure they were on average counts as much as how sure the surest was, from where a plant that leaves hide
        elsewhere may have shown: the mean of both is less than ``least``. Where every picture is sure of what it shows,
        0.75 asks that half of them show it.
        """
        return self.voted + self.best * self.looks < 2.0 * self.least * self.looks


class WeedTracker:
    """Joins the plants of successive pictures: nearest pairs within a gate, confirmed after enough hits."""

    def __init__(self, gate_m: float = 0.012, hits: int = 2, least: float = 0.75):
        """Set the gate, the number of pictures that confirm a track, and how sure they have to be."""
        self.gate_m, self.hits, self.least = gate_m, hits, least
        self.tracks: list[Track] = []

    def update(self, seedlings: Seedlings, cart_m: float, view_m: tuple[float, float]) -> None:
        """Take the plants of the picture that was taken at a cart position.

        Args:
            seedlings: plants, in the world of the odometry.
            cart_m: position of the cart.
            view_m: plants between these places along would be in the picture as a whole.
        """
        low, high = view_m
        recent = [t for t in self.tracks if cart_m - t.last_m < 0.45]
        places = np.array([t.place for t in recent]).reshape(-1, 2)
        for track, place in zip(recent, places, strict=True):
            track.looks += bool(low <= place[0] <= high)
        gap = np.hypot(*(seedlings.position[:, None] - places[None]).transpose(2, 0, 1))
        pairs: dict[int, Track] = {}
        taken: set[int] = set()
        for flat in np.argsort(gap, axis=None, kind="stable").tolist():
            i, j = divmod(flat, max(len(recent), 1))
            if gap[i, j] > self.gate_m:
                break
            if i not in pairs and j not in taken:
                pairs[i] = recent[j]
                taken.add(j)
        for i in range(len(seedlings.position)):
            track = pairs.get(i)
            if track is None:
                looks = int(low <= seedlings.position[i, 0] <= high)
                track = Track([], cart_m, cart_m, looks, self.least)
                self.tracks.append(track)
            track.places.append(seedlings.position[i].copy())
            track.last_m = cart_m
            track.votes[seedlings.species[i], seedlings.stage[i]] += seedlings.score[i]
            # Asked for at every decision, another one after a picture only.
            track.voted = float(track.votes.sum())
            track.crop_votes += seedlings.score[i] * seedlings.crop[i]
            track.best = max(track.best, float(seedlings.score[i]))
            if len(track.places) == self.hits:
                track.confirmed_m = cart_m
