"""What the weeders see with: detectors of the front camera and of the camera beside the tool, by name."""

from __future__ import annotations

from functools import lru_cache
from typing import Protocol

import cv2
import numpy as np

from ...perception import stems, weeds
from ...perception.frames import CameraPose, Frame
from ...perception.stems import StemNet, StemSettings
from ...perception.weeds import Rows, Seedlings, WeedSettings
from ...simulation.assets import asset_path
from ..core import Array
from .perception import TOOL_GATE_M

TOOL_SETTINGS = WeedSettings(close_m=0.0012, whole=False)
"""Of the classical detector behind the tool camera, whose view is not much larger than the largest weed."""
TOOL_SMALLER = 2
"""The network looks at the tool camera's picture in this part of its size."""


class Eyes(Protocol):
    """Detectors of both cameras.

    Attributes:
        least: how sure the pictures of a track have to be, see ``Track.is_doubtful``.
        calibrates: whether the odometry learns from what the tool camera sees.
    """

    least: float
    calibrates: bool

    def front(self, frame: Frame, rows: Rows) -> Seedlings:
        """Plants in a picture of the front camera."""
        ...

    def tool(self, frame: Frame, told: Array, off_m: float) -> Array | None:
        """The plant (2,) in a tool camera's picture that it was sent to; None where none is near.

        Args:
            frame: the picture.
            told: (2,), where the plant should be.
            off_m: deviation of that from where it is.
        """
        ...


class ClassicalEyes:
    """Excess green, blobs, and where leaves meet; see ``perception.weeds``."""

    least, calibrates = 0.75, False

    def front(self, frame: Frame, rows: Rows) -> Seedlings:
        """See ``Eyes``."""
        return weeds.detect(frame, rows)

    def tool(self, frame: Frame, told: Array, off_m: float) -> Array | None:
        """See ``Eyes``; the nearest one, however far off it may be."""
        found = weeds.detect(frame, settings=TOOL_SETTINGS)
        return _chosen(found.position, told, np.hypot(*(found.position - told).T))


class LearnedEyes:
    """A network for each camera; see ``perception.stems``."""

    least, calibrates = 0.44, True

    def __init__(self, front: StemNet, tool: StemNet):
        """Take the networks."""
        self._front, self._tool = front, tool
        self._front_settings, self._tool_settings = StemSettings(), StemSettings(row_half_m=np.inf)

    def front(self, frame: Frame, rows: Rows) -> Seedlings:
        """See ``Eyes``."""
        return stems.detect(self._front, frame, rows, self._front_settings)

    def tool(self, frame: Frame, told: Array, off_m: float) -> Array | None:
        """See ``Eyes``; the likeliest one, by how sure it is and how far off."""
        found = stems.detect(self._tool, smaller(frame, TOOL_SMALLER), settings=self._tool_settings)
        weed = ~found.crop
        place, gap_m = found.position[weed], np.hypot(*(found.position[weed] - told).T)
        return _chosen(place, told, 0.5 * (gap_m / off_m) ** 2 - np.log(found.score[weed]))


def smaller(frame: Frame, times: int) -> Frame:
    """A frame in a part of its size; its depth, which is not scaled, is left out."""
    rgb, _, (intrinsics, world_from_camera) = frame
    high, wide, _ = rgb.shape
    small = cv2.resize(rgb, (wide // times, high // times), interpolation=cv2.INTER_AREA)
    # Middles of pixels lie at whole numbers.
    scaled = intrinsics / np.array([[times], [times], [1.0]])
    scaled[:2, 2] -= 0.5 * (times - 1) / times
    return Frame(np.asarray(small, np.uint8), np.zeros((0, 0), np.float32), CameraPose(scaled, world_from_camera))


def _chosen(place: Array, told: Array, cost: Array) -> Array | None:
    """The place of the least cost, if it is near enough to where the camera was sent."""
    gap_m = np.hypot(*(place - told).T)
    cost = np.where(gap_m <= TOOL_GATE_M, cost, np.inf)
    return place[int(cost.argmin())] if np.isfinite(cost).any() else None


@lru_cache(maxsize=1)
def learned_eyes() -> LearnedEyes:
    """Those that ship with the package."""
    return LearnedEyes(net_of("front"), net_of("tool"))


def net_of(camera: str) -> StemNet:
    """The network that ships for a camera, ``"front"`` or ``"tool"``."""
    with asset_path(f"perception/weed-eyes.{camera}.npz") as path, np.load(path, allow_pickle=False) as arrays:
        return StemNet({name: arrays[name] for name in list(arrays)})


def eyes_of(name: str) -> Eyes:
    """Eyes by their name in a configuration, ``"classical"`` or ``"learned"``."""
    return learned_eyes() if name == "learned" else ClassicalEyes()
