"""Where a pinhole camera looks from, as the rasteriser, detectors and PyBullet's renderer have it."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..perception.frames import Camera, CameraPose
from .raster import View
from .shapes import Array

_GL = np.diag([1.0, -1.0, -1.0])
"""From OpenGL's axes (y up, z behind) to a camera's (y down, z ahead), and back."""


def view_of(camera: Camera, eye: ArrayLike, target: ArrayLike, up: ArrayLike) -> View:
    """The camera at ``eye`` towards ``target``, points (3,) in metres, its picture's top towards ``up`` (3,).

    In single precision, operation by operation as PyBullet does it: so both renderers see the same to the last bit, on
    every processor.
    A picture's samples lie at whole pixel coordinates, the middle of its axis at (w / 2, h / 2 - 1).

    Raises:
        ValueError: the eye is on the target, it looks along ``up``, or something is no number.
    """
    place, middle, top = (np.asarray(v, np.float64).astype(np.float32) for v in (eye, target, up))
    with np.errstate(all="ignore"):
        ahead = _unit(middle - place)
        right = _unit(_cross(ahead, _unit(top)))
        above = _cross(right, ahead)
        turn = np.stack([right, above, -ahead])
        shift = -np.stack([_dot(axis, place) for axis in turn])
    if not (np.isfinite(turn).all() and np.isfinite(shift).all()):
        raise ValueError(
            f"a camera at {place.tolist()} towards {middle.tolist()} with {top.tolist()} up sees nothing: give finite "
            "points apart from each other, and a direction up across the view"
        )
    turn, shift = turn.astype(np.float64), shift.astype(np.float64)
    return View(
        np.ascontiguousarray(turn * np.array([[1.0], [-1.0], [-1.0]])),
        shift * np.array([1.0, -1.0, -1.0]),
        float(0.5 * camera.height / np.tan(0.5 * camera.field_of_view_rad)),
        0.5 * camera.width,
        0.5 * camera.height - 1.0,
        camera.near_m,
        camera.far_m,
        False,
    )


def pose_of(view: View) -> CameraPose:
    """The camera as detectors want it."""
    intrinsics = np.array([[view.focal, 0.0, view.centre_x], [0.0, view.focal, view.centre_y], [0.0, 0.0, 1.0]])
    # OpenGL's matrix is turned back as a whole, so that poses are what they always were, to the last bit.
    world_from_gl = np.eye(4)
    world_from_gl[:3, :3], world_from_gl[:3, 3] = _GL @ view.turn, _GL @ view.shift
    world_from_camera = np.linalg.inv(world_from_gl) @ np.diag([1.0, -1.0, -1.0, 1.0])
    return CameraPose(intrinsics, np.asarray(world_from_camera, np.float64))


def sun_view(towards: Array, middle: Array, half_m: float, pixels: int, far_m: float = 10.0) -> View:
    """A view without perspective along the light onto ``half_m`` about a place (3,)."""
    ahead = -towards
    right = _unit(_cross(np.array([0.0, 1.0, 0.0]), ahead))
    turn = np.stack([right, _cross(ahead, right), ahead])
    shift = np.array([0.0, 0.0, 0.5 * far_m]) - np.array([_dot(axis, middle) for axis in turn])
    return View(turn, shift, 0.5 * pixels / half_m, 0.5 * pixels, 0.5 * pixels, 0.0, far_m, True)


def fall_of_rays(view: View) -> NDArray[np.float32]:
    """How far rays of depth one fall, (3,): at pixel (0, 0), more a column, more a row."""
    a, b, c = view.turn[:, 2]
    across, down = -a / view.focal, -b / view.focal
    return np.array([-c - across * view.centre_x - down * view.centre_y, across, down], np.float32)


def _cross(a: NDArray[Any], b: NDArray[Any]) -> NDArray[Any]:
    return np.stack([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]])


def _dot(a: NDArray[Any], b: NDArray[Any]) -> Any:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


def _unit(a: NDArray[Any]) -> NDArray[Any]:
    return a * (a.dtype.type(1.0) / np.sqrt(_dot(a, a)))
