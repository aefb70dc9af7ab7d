"""The sorting cell: belt, bins, gantry, machine, produce, its camera and one for people."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ...motion.orientation import LEVEL, axes, from_euler, product
from ...perception.frames import Camera, Frame
from ...rendering.instances import Instances, instances, joined
from ...rendering.library import MeshLibrary
from ...rendering.shapes import Mesh, box, ellipsoid, merged, rotation_z, turned
from ...rendering.shots import Viewpoint
from ...simulation.prrs_looks import PrrsLooks
from ...simulation.prrs_model import GANTRY_LEVEL_M
from ...simulation.stage import Scene, Stage
from ..core import Array
from .config import GRADES, BeltConfig, SortingConfig

BELT, RIB, FRAME = (0.13, 0.27, 0.36, 1.0), (0.10, 0.22, 0.30, 1.0), (0.80, 0.82, 0.84, 1.0)
POST, FLOOR, DARK = (0.20, 0.36, 0.55, 1.0), (0.66, 0.67, 0.66, 1.0), (0.10, 0.10, 0.11, 1.0)
BIN = {"ware": (0.78, 0.60, 0.36, 1.0), "seed": (0.60, 0.44, 0.26, 1.0), "ripe": (0.80, 0.16, 0.12, 1.0),
       "green": (0.36, 0.62, 0.20, 1.0)}  # fmt: skip
"""Bins wear the colour of what belongs into them."""

BELT_START_M, BELT_END_M = -0.95, 0.55
RIB_PITCH_M = 0.06
CAMERA_HEIGHT_M = 0.52
"""Of the camera above the belt."""
OPEN_M = 0.036
"""From the middle of the gripper to either pad when it is open."""
_MARGIN_M = 0.05
"""A picture of what can be chosen reaches so far beyond the camera's place and the end of the reach."""
BIN_HOLDS = 9
"""Items in a bin before it is exchanged: two layers of four and one on top."""
_BIN_FLOOR_M, _BIN_HEIGHT_M, _BIN_PITCH_M, _LAYER_M = 0.135, 0.100, 0.034, 0.046
_TUBER, _GREEN_HUE, _RED_HUE = (0.70, 0.53, 0.32), 95.0, 6.0


class ShownItem(NamedTuple):
    """An item as it is drawn: identity, world position (3,), quaternion (w, x, y, z), full axes (3,), colour."""

    key: int
    position: Array
    quaternion: Array
    axes_m: tuple[float, float, float]
    colour: tuple[float, float, float, float]


def item_colour(fruit: bool, ripeness: float, shade: float) -> tuple[float, float, float, float]:
    """Colour of an item: tubers are tan, fruits go from green over yellow to red; ``shade`` in [0, 1] varies it."""
    bright = 0.90 + 0.20 * shade
    if not fruit:
        red, green, blue = (float(bright * part) for part in _TUBER)
    else:
        hue = (_GREEN_HUE + (_RED_HUE - _GREEN_HUE) * ripeness) / 60.0
        value, saturation = min(0.80 * bright, 1.0), 0.82
        low = value * (1.0 - saturation)
        up = low + (value - low) * (hue if hue < 1.0 else 2.0 - hue)
        red, green, blue = (value, up, low) if hue < 1.0 else (up, value, low)
    return (round(red, 3), round(green, 3), round(blue, 3), 1.0)


class SorterScene(Scene):
    """Draws the cell.

    Attributes:
        stage: what is drawn: the groups ``cell``, ``ribs``, ``machine``, ``pads`` and ``items``, each under
            its key.
    """

    def __init__(self, config: SortingConfig):
        """Add the meshes of the cell, the machine and the produce."""
        self._config = config
        sorter = config.machine.sorter
        self._top = sorter.belt_height_m
        self.stage = Stage()
        library = self.stage.library
        self.stage.put("cell", self._build(library, config.belt, sorter.origin_height_m))
        self._machine = PrrsLooks(library, sorter)
        self._ball = library.add(ellipsoid((1.0, 1.0, 1.0)))
        self._eye = Camera(320, 240, 2.0 * float(np.arctan2(0.125, CAMERA_HEIGHT_M)), 0.2, 1.5)
        self.set_machine(sorter.mechanism.home_pose)

    def set_machine(self, pose: ArrayLike, gap_m: float = OPEN_M) -> None:
        """Put the platform at a pose (6,) of the mechanism, the pads ``gap_m`` from the gripper's middle."""
        sorter, centre = self._config.machine.sorter, np.asarray(pose, dtype=np.float64)
        self.stage.put("machine", self._machine.place(centre))
        turn = from_euler(centre[3:])
        turns = axes(np.stack([product(turn, half_turn) for half_turn in (LEVEL, np.array([0.0, 0.0, 0.0, 1.0]))]))
        pads = centre[:3] + turns @ np.array([0.0, gap_m, -sorter.tool_m]) + [0.0, 0.0, sorter.origin_height_m]
        self.stage.put("pads", instances(self._pad, pads, turns, DARK))
        self._tool_m = pads.mean(axis=0)

    def set_belt(self, travel_m: float) -> None:
        """Show the belt after it has run ``travel_m``."""
        self.stage.put("ribs", instances(self._ribs, (travel_m % RIB_PITCH_M, 0.0, self._top), None, RIB))

    def set_items(self, items: Sequence[ShownItem]) -> None:
        """Show these items and no others."""
        if not items:
            self.stage.put("items", joined([]))
            return
        key, position, quaternion, axes_m, colour = (np.array(column) for column in zip(*items, strict=True))
        # One ball for all: an item is its turn after a stretch to its half axes.
        turns = axes(quaternion) * (0.5 * axes_m)[:, None, :]
        self.stage.put("items", instances(self._ball, position, turns, colour, key))

    def look(self) -> Frame:
        """What the cell's camera sees, straight down on the belt upstream; the image's long side lies across it."""
        eye = np.array([self._config.belt.camera_x_m, 0.0, self._top + CAMERA_HEIGHT_M])
        return self.stage.look(self._eye, eye, eye - np.array([0.0, 0.0, 1.0]), (1.0, 0.0, 0.0))

    def sight_camera(self, rows: int) -> Camera:
        """A camera of that many rows over what can be chosen from; its long side lies along the belt."""
        belt = self._config.belt
        along_m, across_m = belt.exit_x_m + _MARGIN_M - belt.camera_x_m + _MARGIN_M, belt.width_m
        width, angle = round(rows * along_m / across_m), 2.0 * np.arctan(0.5 * across_m / CAMERA_HEIGHT_M)
        return Camera(width, rows, float(angle), self._eye.near_m, self._eye.far_m)

    def look_along(self, rows: int) -> Frame:
        """What that camera sees: the machine over the belt is left out."""
        belt = self._config.belt
        eye = np.array([0.5 * (belt.camera_x_m + belt.exit_x_m), 0.0, self._top + CAMERA_HEIGHT_M])
        down = eye - np.array([0.0, 0.0, 1.0])
        return self.stage.look(self.sight_camera(rows), eye, down, (0.0, 1.0, 0.0), "cell", "ribs", "items")

    def viewpoint(self, camera: str) -> Viewpoint:
        """From beside the belt; from farther; at the gripper."""
        middle, lit_about = np.array([-0.10, 0.0, self._top + 0.23]), np.array([-0.1, 0.0, self._top])
        if camera == "overview":
            return Viewpoint(middle + np.array([1.30, -2.00, 1.20]), middle, lit_about, np.deg2rad(41.0))
        if camera == "tool":
            eye = self._tool_m + np.array([0.26, -0.42, 0.22])
            return Viewpoint(eye, self._tool_m, lit_about, np.deg2rad(41.0))
        return Viewpoint(middle + np.array([0.72, -1.15, 0.72]), middle, lit_about, np.deg2rad(41.0))

    def _build(self, library: MeshLibrary, belt: BeltConfig, origin_m: float) -> Instances:
        """Belt, gantry, camera, floor and bins; adds the meshes of ribs and pads, which move."""
        parts: list[Instances] = []
        top, half = self._top, 0.5 * belt.width_m
        length, middle = BELT_END_M - BELT_START_M, 0.5 * (BELT_START_M + BELT_END_M)
        belts = [_at(box((length, belt.width_m, 0.04)), (middle, 0.0, top - 0.021))]
        frame = []
        for side in (-1.0, 1.0):
            frame.append(_at(box((length + 0.05, 0.016, 0.075)), (middle, side * (half + 0.010), top - 0.040)))
            for x in (BELT_START_M + 0.08, middle + 0.1, BELT_END_M - 0.08):
                frame.append(_at(box((0.04, 0.04, top - 0.07)), (x, side * (half - 0.03), 0.5 * (top - 0.07))))
        ribs = [
            _at(box((0.004, belt.width_m - 0.01, 0.002)), (x, 0.0, 0.0))
            for x in np.arange(BELT_START_M, BELT_END_M - 1.5 * RIB_PITCH_M, RIB_PITCH_M)
        ]
        high = origin_m + GANTRY_LEVEL_M
        # A column behind the belt carries the beam: machine and camera hang from it, nothing stands in front.
        posts = [_at(box((0.10, 0.10, high + 0.10)), (0.0, 0.46, 0.5 * (high + 0.10)))]
        posts.append(_at(box((0.11, 0.60, 0.08)), (0.0, 0.21, high + 0.04)))
        posts.append(_at(box((-belt.camera_x_m + 0.02, 0.04, 0.04)), (0.5 * belt.camera_x_m, 0.0, high + 0.06)))
        eye = top + CAMERA_HEIGHT_M
        posts.append(
            _at(box((0.03, 0.03, high + 0.04 - eye)), (belt.camera_x_m - 0.02, 0.0, 0.5 * (high + 0.08 + eye)))
        )
        feet = [_at(box((0.34, 0.24, 0.03)), (0.0, 0.46, 0.015))]
        lens = [_at(box((0.05, 0.10, 0.035)), (belt.camera_x_m, 0.0, eye + 0.022))]
        ground = [_at(box((10.0, 10.0, 0.02)), (0.0, 0.0, -0.012))]
        for meshes, colour in (
            (belts, BELT), (frame, FRAME), (posts, POST), (feet + lens, DARK), (ground, FLOOR)
        ):  # fmt: skip
            parts.append(instances(library.add(merged(*meshes)), (0.0, 0.0, 0.0), None, colour))
        self._ribs = library.add(merged(*ribs))
        # A pad on a pin that slides through its finger; the fingers themselves belong to the platform.
        pad = merged(_at(box((0.026, 0.005, 0.024)), (0.0, 0.0025, 0.0)), _at(box((0.006, 0.030, 0.006)), (0, 0.02, 0)))
        self._pad = library.add(pad)
        self.bin_floor_m = top - _BIN_FLOOR_M
        tub = library.add(_bin(0.148, 0.150, _BIN_HEIGHT_M))
        leg = library.add(box((0.03, 0.03, self.bin_floor_m)))
        for grade, (x, y) in zip(GRADES, belt.bins_m, strict=True):
            outside = np.copysign(half + 0.024 + 0.075, y)
            parts.append(instances(tub, (x, outside, self.bin_floor_m), None, BIN[grade]))
            parts.append(instances(leg, (x, outside, 0.5 * self.bin_floor_m - 0.005), None, FRAME))
        return joined(parts)

    def bin_place(self, grade: int, number: int) -> Array:
        """World position (3,) of the ``number``-th item that was put into a grade's bin."""
        x, y = self._config.belt.bins_m[grade]
        half = 0.5 * self._config.belt.width_m
        outside = float(np.copysign(half + 0.024 + 0.075, y))
        layer, corner = divmod(number % BIN_HOLDS, 4)
        up = self.bin_floor_m + 0.030 + _LAYER_M * layer
        if layer == 2:
            return np.array([x, outside, up])
        # The second layer lies in the gaps of the first.
        angle = 0.5 * np.pi * corner + (0.25 * np.pi if layer == 0 else 0.0)
        radius = _BIN_PITCH_M * (np.sqrt(2.0) if layer == 0 else 1.0)
        return np.array([x + radius * np.cos(angle), outside + radius * np.sin(angle), up])


def _at(mesh: Mesh, shift: tuple[float, float, float]) -> Mesh:
    return turned(mesh, rotation_z(0.0), shift)


def _bin(length_m: float, width_m: float, height_m: float) -> Mesh:
    """An open box on its floor at z = 0."""
    wall = 0.004
    parts = [_at(box((length_m, width_m, wall)), (0.0, 0.0, 0.0))]
    for side in (-0.5, 0.5):
        parts.append(_at(box((wall, width_m, height_m)), (side * length_m, 0.0, 0.5 * height_m)))
        parts.append(_at(box((length_m, wall, height_m)), (0.0, side * width_m, 0.5 * height_m)))
    return merged(*parts)
