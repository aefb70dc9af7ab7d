"""Frames of a pinhole RGB-D camera from PyBullet's software renderer."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..perception.frames import Array, Camera, CameraPose, Frame
from .client import PhysicsClient, pybullet


def look(
    camera: Camera, client: PhysicsClient, eye: Array, target: Array, up: Array, *, shadows: bool = False
) -> Frame:
    """Draw the world of ``client`` as seen from ``eye`` towards ``target``, points (3,) in metres."""
    view = pybullet.computeViewMatrix(list(eye), list(target), list(up))
    aspect = camera.width / camera.height
    opening = np.rad2deg(camera.field_of_view_rad)
    projection = pybullet.computeProjectionMatrixFOV(opening, aspect, camera.near_m, camera.far_m)
    _, _, rgba, buffer, _ = pybullet.getCameraImage(
        camera.width,
        camera.height,
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
    rgb = np.asarray(rgba, np.uint8).reshape(camera.height, camera.width, 4)[..., :3].copy()
    buffer = np.asarray(buffer, np.float64).reshape(camera.height, camera.width)
    depth = camera.far_m * camera.near_m / (camera.far_m - (camera.far_m - camera.near_m) * buffer)
    focal = 0.5 * camera.height / np.tan(0.5 * camera.field_of_view_rad)
    # The renderer samples at a pixel's left lower corner and turns its rows over: see the camera's tests.
    intrinsics = np.array([[focal, 0.0, 0.5 * camera.width], [0.0, focal, 0.5 * camera.height - 1.0], [0.0, 0.0, 1.0]])
    # OpenGL looks along -z with y up; the pose is given in OpenCV's axes.
    world_from_gl = np.linalg.inv(np.array(view).reshape(4, 4, order="F"))
    return Frame(rgb, depth.astype(np.float32), CameraPose(intrinsics, world_from_gl @ np.diag([1.0, -1.0, -1.0, 1.0])))


def below_ground(frame: Frame) -> NDArray[np.bool_]:
    """Pixels (h, w) that show what lies at or below the plane z = 0, or nothing; seen from above it."""
    height, width = frame.depth_m.shape
    turn = frame.camera.world_from_camera[2, :3]
    # Fall of a ray of depth one, linear in the pixel.
    across, down, at_corner = -(turn @ np.linalg.inv(frame.camera.intrinsics))
    fall = np.float32(at_corner) + np.float32(across) * np.arange(width, dtype=np.float32)
    fall = fall + (np.float32(down) * np.arange(height, dtype=np.float32))[:, None]
    return frame.depth_m * fall >= np.float32(frame.camera.world_from_camera[2, 3])
