"""A pinhole RGB-D camera over PyBullet's software renderer."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .client import PhysicsClient, pybullet

Array = NDArray[np.float64]


class CameraPose(NamedTuple):
    """Where a camera stands: intrinsic matrix (3, 3) in pixels and world-from-camera transform (4, 4).

    Camera axes follow OpenCV: x to the right of the image, y down, z along the view.
    """

    intrinsics: Array
    world_from_camera: Array


class RgbdFrame(NamedTuple):
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

    def look(self, client: PhysicsClient, eye: Array, target: Array, up: Array, *, shadows: bool = False) -> RgbdFrame:
        """Draw the world of ``client`` as seen from ``eye`` towards ``target``, points (3,) in metres."""
        view = pybullet.computeViewMatrix(list(eye), list(target), list(up))
        aspect = self.width / self.height
        opening = np.rad2deg(self.field_of_view_rad)
        projection = pybullet.computeProjectionMatrixFOV(opening, aspect, self.near_m, self.far_m)
        _, _, rgba, buffer, _ = pybullet.getCameraImage(
            self.width,
            self.height,
            view,
            projection,
            shadow=int(shadows),
            lightDirection=[0.6, -0.5, 1.6],
            lightColor=[1.0, 0.98, 0.94],
            lightAmbientCoeff=0.62,
            lightDiffuseCoeff=0.50,
            lightSpecularCoeff=0.03,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=client.id,
        )
        rgb = np.asarray(rgba, np.uint8).reshape(self.height, self.width, 4)[..., :3].copy()
        buffer = np.asarray(buffer, np.float64).reshape(self.height, self.width)
        depth = self.far_m * self.near_m / (self.far_m - (self.far_m - self.near_m) * buffer)
        focal = 0.5 * self.height / np.tan(0.5 * self.field_of_view_rad)
        # The renderer samples at a pixel's left lower corner and turns its rows over: see the camera's tests.
        intrinsics = np.array([[focal, 0.0, 0.5 * self.width], [0.0, focal, 0.5 * self.height - 1.0], [0.0, 0.0, 1.0]])
        # OpenGL looks along -z with y up; the pose is given in OpenCV's axes.
        world_from_gl = np.linalg.inv(np.array(view).reshape(4, 4, order="F"))
        return RgbdFrame(
            rgb, depth.astype(np.float32), CameraPose(intrinsics, world_from_gl @ np.diag([1.0, -1.0, -1.0, 1.0]))
        )


def below_ground(frame: RgbdFrame) -> NDArray[np.bool_]:
    """Pixels (h, w) that show what lies at or below the plane z = 0, or nothing; seen from above it."""
    height, width = frame.depth_m.shape
    turn = frame.camera.world_from_camera[2, :3]
    # Fall of a ray of depth one, linear in the pixel.
    across, down, at_corner = -(turn @ np.linalg.inv(frame.camera.intrinsics))
    fall = np.float32(at_corner) + np.float32(across) * np.arange(width, dtype=np.float32)
    fall = fall + (np.float32(down) * np.arange(height, dtype=np.float32))[:, None]
    return frame.depth_m * fall >= np.float32(frame.camera.world_from_camera[2, 3])
