"""Where ground that is not level puts a frame, its tool and its camera: for rules, machines and views alike.

A frame stands on four wheels; what it does is heave, pitch, roll, sway (beside the row) and yaw about a point over its
tool's middle: the one whose place along the row the odometry counts. A wheel stands on the mean height under its
footprint; the frame is the plane that fits its four wheels best. Between the lines left, middle and right the ground
rises evenly.

Nothing on the machine measures any of this: the rules command the tool as if the frame stood level, and the tool works
where that takes it (``lands``). A camera beside the tool shares the tool's error, so what it sees corrects it.
"""

from __future__ import annotations

import math
from typing import Annotated, NamedTuple

import numpy as np

from ..kernels import compiled
from .columns import Says, numbered
from .core import Array


class Surface(NamedTuple):
    """The ground of one world along the row, a row every ``Shape.step_m``."""

    left: Annotated[int, Says("m", "height under the left wheels' line")]
    middle: Annotated[int, Says("m", "height under the crop row")]
    right: Annotated[int, Says("m", "height under the right wheels' line")]
    left_sum: Annotated[int, Says("m2", "integral of the left height from the first row on")]
    right_sum: Annotated[int, Says("m2", "integral of the right height from the first row on")]
    slip: Annotated[int, Says("m", "way that the odometry has counted too much or too little since the first row")]
    sway: Annotated[int, Says("m", "the wheels' way beside the row, to the left")]


U = numbered(Surface)


class Shape(NamedTuple):
    """What kernels have to know of frame, tool and ground; the same in every world.

    Attributes:
        first_m: where the ground's first row lies along.
        step_m: from row to row.
        wheel_base_m: see ``GroundConfig``; ``track_m`` and ``footprint_m`` alike.
        track_m: see ``wheel_base_m``.
        footprint_m: see ``wheel_base_m``.
        pivot_m: height of the point whose place along the odometry counts.
        gap_m: where the tool's line begins, over what it works on.
        low_m: height over the ground of what it works on.
        beside: 1 where the tool's line begins over its place across, 0 where over the frame's middle.
    """

    first_m: float
    step_m: float
    wheel_base_m: float
    track_m: float
    footprint_m: float
    pivot_m: float
    gap_m: float
    low_m: float
    beside: float


class Frame(NamedTuple):
    """How a frame stands over its place along the row.

    Attributes:
        heave_m: upwards.
        pitch_rad: nose down.
        roll_rad: left side up.
        sway_m: to the left.
        yaw_rad: nose to the left.
    """

    heave_m: float
    pitch_rad: float
    roll_rad: float
    sway_m: float
    yaw_rad: float


@compiled
def at_line(surface: Array, shape: Shape, column: int, along_m: float) -> float:
    """Value of a column (S, .) at a place along; beyond the ends that of the end."""
    last = surface.shape[0] - 1
    place = min(max((along_m - shape.first_m) / shape.step_m, 0.0), float(last))
    i = min(int(place), last - 1)
    return surface[i, column] + (place - i) * (surface[i + 1, column] - surface[i, column])


@compiled
def summed(surface: Array, shape: Shape, height: int, sums: int, along_m: float) -> float:
    """Integral of a height from the first row to a place along."""
    last = surface.shape[0] - 1
    place = (along_m - shape.first_m) / shape.step_m
    if place <= 0.0:
        return place * shape.step_m * surface[0, height]
    if place >= last:
        return surface[last, sums] + (place - last) * shape.step_m * surface[last, height]
    i = min(int(place), last - 1)
    part, low = place - i, surface[i, height]
    return surface[i, sums] + shape.step_m * part * (low + 0.5 * part * (surface[i + 1, height] - low))


@compiled
def under_wheel(surface: Array, shape: Shape, height: int, sums: int, along_m: float) -> float:
    """Height of a wheel: the mean under its footprint."""
    half = 0.5 * shape.footprint_m
    before = summed(surface, shape, height, sums, along_m - half)
    return (summed(surface, shape, height, sums, along_m + half) - before) / shape.footprint_m


@compiled
def frame_at(surface: Array, shape: Shape, cart_m: float) -> Frame:
    """How the frame stands with its tool's middle over a place along."""
    front, rear = cart_m + 0.5 * shape.wheel_base_m, cart_m - 0.5 * shape.wheel_base_m
    front_left = under_wheel(surface, shape, U.left, U.left_sum, front)
    front_right = under_wheel(surface, shape, U.right, U.right_sum, front)
    rear_left = under_wheel(surface, shape, U.left, U.left_sum, rear)
    rear_right = under_wheel(surface, shape, U.right, U.right_sum, rear)
    rise = 0.5 * (rear_left + rear_right - front_left - front_right)
    lift = 0.5 * (front_left + rear_left - front_right - rear_right)
    ahead, behind = at_line(surface, shape, U.sway, front), at_line(surface, shape, U.sway, rear)
    return Frame(
        0.25 * (front_left + front_right + rear_left + rear_right),
        math.atan(rise / shape.wheel_base_m),
        math.atan(lift / shape.track_m),
        0.5 * (ahead + behind),
        math.atan((ahead - behind) / shape.wheel_base_m),
    )


@compiled
def height_at(surface: Array, shape: Shape, along_m: float, across_m: float) -> float:
    """Height of the ground at a place; level beyond the wheels' lines."""
    middle = at_line(surface, shape, U.middle, along_m)
    side = U.left if across_m > 0.0 else U.right
    share = min(2.0 * abs(across_m) / shape.track_m, 1.0)
    return middle + share * (at_line(surface, shape, side, along_m) - middle)


@compiled
def carried(frame: Frame, pivot_m: float, cart_m: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """World place of a point of the frame, given from the ground under its tool's middle as if it stood level."""
    z -= pivot_m
    c, s = math.cos(frame.roll_rad), math.sin(frame.roll_rad)
    y, z = c * y - s * z, s * y + c * z
    c, s = math.cos(frame.pitch_rad), math.sin(frame.pitch_rad)
    x, z = c * x + s * z, c * z - s * x
    c, s = math.cos(frame.yaw_rad), math.sin(frame.yaw_rad)
    x, y = c * x - s * y, s * x + c * y
    return cart_m + x, frame.sway_m + y, frame.heave_m + pivot_m + z


@compiled
def given_back(frame: Frame, pivot_m: float, cart_m: float, x: float, y: float, z: float) -> tuple[float, float, float]:
    """The point of the frame that ``carried`` takes to a world place."""
    x, y, z = x - cart_m, y - frame.sway_m, z - frame.heave_m - pivot_m
    c, s = math.cos(frame.yaw_rad), math.sin(frame.yaw_rad)
    x, y = c * x + s * y, c * y - s * x
    c, s = math.cos(frame.pitch_rad), math.sin(frame.pitch_rad)
    x, z = c * x - s * z, c * z + s * x
    c, s = math.cos(frame.roll_rad), math.sin(frame.roll_rad)
    return x, c * y + s * z, c * z - s * y + pivot_m


@compiled
def lands(
    surface: Array, shape: Shape, cart_m: float, carrier_m: float, lean_m: float, across_m: float
) -> tuple[float, float]:
    """World place where a tool really works that was sent to (carrier + lean, across).

    Its line through the frame meets what it works on at that thing's height over the ground there.
    """
    frame, along_m = frame_at(surface, shape, cart_m), carrier_m + lean_m
    high = shape.low_m + shape.gap_m
    ox, oy, oz = carried(frame, shape.pivot_m, cart_m, carrier_m - cart_m, shape.beside * across_m, high)
    px, py, pz = carried(frame, shape.pivot_m, cart_m, along_m - cart_m, across_m, shape.low_m)
    level = height_at(surface, shape, along_m, across_m) + shape.low_m
    share = (oz - level) / (oz - pz)
    return ox + share * (px - ox), oy + share * (py - oy)


@compiled
def sinks_m(surface: Array, shape: Shape, cart_m: float, along_m: float, across_m: float) -> float:
    """How much deeper than it was sent a tool works at a place: the ground there stands over the frame's own level."""
    frame = frame_at(surface, shape, cart_m)
    _, _, level = carried(frame, shape.pivot_m, cart_m, along_m - cart_m, across_m, shape.low_m)
    return height_at(surface, shape, along_m, across_m) + shape.low_m - level


@compiled
def believed(
    surface: Array, shape: Shape, cart_m: float, ahead_m: float, eye_m: float, along_m: float, across_m: float
) -> tuple[float, float]:
    """Where a camera of the frame that takes it for level, and the ground for a plane, sees a place on the ground.

    Args:
        surface: of the world.
        shape: see ``Shape``.
        cart_m: the cart's place.
        ahead_m: the camera before the tool's middle; it looks straight down.
        eye_m: its height.
        along_m: the place; ``across_m`` alike.
        across_m: see ``along_m``.
    """
    frame, level = frame_at(surface, shape, cart_m), height_at(surface, shape, along_m, across_m)
    x, y, z = given_back(frame, shape.pivot_m, cart_m, along_m, across_m, level)
    share = eye_m / (eye_m - z)
    return cart_m + ahead_m + (x - ahead_m) * share, y * share


@compiled
def frames_at(surface: Array, shape: Shape, carts_m: Array) -> Array:
    """``frame_at`` of carts (n,), one a row (n, 5)."""
    frames = np.empty((len(carts_m), 5))
    for i in range(len(carts_m)):
        frame = frame_at(surface, shape, carts_m[i])
        frames[i, 0], frames[i, 1], frames[i, 2] = frame.heave_m, frame.pitch_rad, frame.roll_rad
        frames[i, 3], frames[i, 4] = frame.sway_m, frame.yaw_rad
    return frames


@compiled
def ways_at(surface: Array, shape: Shape, carts_m: Array) -> Array:
    """Where a rail lies on which a cart at x (n,) stands as the frame does: position and quaternion (x, y, z, w)."""
    ways = np.empty((len(carts_m), 7))
    for i in range(len(carts_m)):
        frame = frame_at(surface, shape, carts_m[i])
        ways[i, 0], ways[i, 1], ways[i, 2] = carried(frame, shape.pivot_m, carts_m[i], -carts_m[i], 0.0, 0.0)
        cr, sr = math.cos(0.5 * frame.roll_rad), math.sin(0.5 * frame.roll_rad)
        cp, sp = math.cos(0.5 * frame.pitch_rad), math.sin(0.5 * frame.pitch_rad)
        cy, sy = math.cos(0.5 * frame.yaw_rad), math.sin(0.5 * frame.yaw_rad)
        ways[i, 3], ways[i, 4] = sr * cp * cy - cr * sp * sy, cr * sp * cy + sr * cp * sy
        ways[i, 5], ways[i, 6] = cr * cp * sy - sr * sp * cy, cr * cp * cy + sr * sp * sy
    return ways


@compiled
def heights_at(surface: Array, shape: Shape, places_m: Array) -> Array:
    """``height_at`` of places (n, 2)."""
    heights = np.empty(len(places_m))
    for i in range(len(places_m)):
        heights[i] = height_at(surface, shape, places_m[i, 0], places_m[i, 1])
    return heights
