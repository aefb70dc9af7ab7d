"""Where a pinhole camera looks from, as the rasteriser, detectors and PyBullet's renderer have it."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..kernels import compiled
from ..perception.frames import Camera, CameraPose
from .raster import View
from .shapes import Array

_GL, _GL_4 = np.diag([1.0, -1.0, -1.0]), np.diag([1.0, -1.0, -1.0, 1.0])
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
    turn, shift = np.empty((3, 3)), np.empty(3)
    with np.errstate(all="ignore"):
        finite = _stand(place, middle, top, turn, shift)
    if not finite:
        raise ValueError(
            f"a camera at {place.tolist()} towards {middle.tolist()} with {top.tolist()} up sees nothing: give finite "
            "points apart from each other, and a direction up across the view"
        )
    return View(
        turn,
        shift,
        float(0.5 * camera.height / np.tan(0.5 * camera.field_of_view_rad)),
        0.5 * camera.width,
        0.5 * camera.height - 1.0,
        camera.near_m,
        camera.far_m,
        False,
    )


@compiled
def _stand(
    place: NDArray[np.float32], middle: NDArray[np.float32], top: NDArray[np.float32], turn: Array, shift: Array
) -> bool:
    """Write a camera's turn (3, 3) and shift (3,), from points and a direction (3,); whether they are numbers."""
    here, one = (place[0], place[1], place[2]), np.float32(1.0)
    ahead = _unit((middle[0] - here[0], middle[1] - here[1], middle[2] - here[2]), one)
    right = _unit(_cross(ahead, _unit((top[0], top[1], top[2]), one)), one)
    above = _cross(right, ahead)
    back = (-ahead[0], -ahead[1], -ahead[2])
    for i in range(3):
        turn[0, i], turn[1, i], turn[2, i] = right[i], -above[i], ahead[i]
    shift[0], shift[1], shift[2] = -_dot(right, here), _dot(above, here), _dot(back, here)
    return bool(np.isfinite(turn).all() and np.isfinite(shift).all())


def pose_of(view: View) -> CameraPose:
    """The camera as detectors want it."""
    intrinsics = np.array([[view.focal, 0.0, view.centre_x], [0.0, view.focal, view.centre_y], [0.0, 0.0, 1.0]])
    # OpenGL's matrix is turned back as a whole, so that poses are what they always were, to the last bit.
    world_from_gl = np.eye(4)
    world_from_gl[:3, :3], world_from_gl[:3, 3] = _GL @ view.turn, _GL @ view.shift
    world_from_camera = np.linalg.inv(world_from_gl) @ _GL_4
    return CameraPose(intrinsics, np.asarray(world_from_camera, np.float64))


def sun_view(towards: Array, middle: Array, half_m: float, pixels: int, far_m: float = 10.0) -> View:
    """A view without perspective along the light onto ``half_m`` about a place (3,)."""
    ahead = -towards
    right = np.array(_unit(_cross((0.0, 1.0, 0.0), tuple(ahead.tolist())), 1.0))
    turn = np.stack([right, _cross(ahead, right), ahead])
    shift = np.array([0.0, 0.0, 0.5 * far_m]) - np.array([_dot(axis, middle) for axis in turn])
    return View(turn, shift, 0.5 * pixels / half_m, 0.5 * pixels, 0.5 * pixels, 0.0, far_m, True)


def fall_of_rays(view: View) -> NDArray[np.float32]:
    """How far rays of depth one fall, (3,): at pixel (0, 0), more a column, more a row."""
    a, b, c = view.turn[:, 2]
    across, down = -a / view.focal, -b / view.focal
    return np.array([-c - across * view.centre_x - down * view.centre_y, across, down], np.float32)


@compiled
def _cross(a, b):  # type: ignore[no-untyped-def]
    return a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]


@compiled
def _dot(a, b):  # type: ignore[no-untyped-def]
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]


@compiled
def _unit(a, one):  # type: ignore[no-untyped-def]
    scale = one / np.sqrt(_dot(a, a))
    return a[0] * scale, a[1] * scale, a[2] * scale
