"""Pictures with depth, and the cameras that take them: rendered ones and real ones alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class CameraPose(NamedTuple):
    """Where a camera stands: intrinsic matrix (3, 3) in pixels and world-from-camera transform (4, 4).

    Camera axes follow OpenCV: x to the right of the image, y down, z along the view.
    """

    intrinsics: Array
    world_from_camera: Array


class Frame(NamedTuple):
    """A picture with depth: ``rgb`` uint8 (h, w, 3), ``depth_m`` float32 (h, w) along the view, and the camera."""

    rgb: NDArray[np.uint8]
    depth_m: NDArray[np.float32]
    camera: CameraPose


@dataclass(frozen=True)
class Camera:
    """Size and opening of a camera.

    Attributes:
        width: pixels.
        height: pixels.
        field_of_view_rad: vertical opening angle.
        near_m: nearest depth that is drawn.
        far_m: farthest depth that is drawn.
    """

    width: int = 640
    height: int = 480
    field_of_view_rad: float = np.deg2rad(50.0)
    near_m: float = 0.05
    far_m: float = 8.0

    def sees(self, centre: Array, radius_m: Array | float, eye: Array, target: Array, up: Array) -> NDArray[np.bool_]:
        """Which balls about ``centre`` (n, 3), radii (n,) or one for all, may show in the picture from ``eye``.

        A ball that misses the opening's pyramid never shows; one near an edge of the pyramid may be let through.
        """
        ahead = (target - eye) / np.linalg.norm(target - eye)
        right = np.cross(ahead, up) / np.linalg.norm(np.cross(ahead, up))
        offset = centre - eye
        depth, across, along = offset @ ahead, offset @ right, offset @ np.cross(right, ahead)
        upright = 0.5 * self.field_of_view_rad
        sideways = np.arctan(np.tan(upright) * self.width / self.height)
        beside = np.abs(across) * np.cos(sideways) - depth * np.sin(sideways)
        above = np.abs(along) * np.cos(upright) - depth * np.sin(upright)
        return (beside <= radius_m) & (above <= radius_m) & (depth <= self.far_m + radius_m)
