"""The transplanter's world: trays on conveyors, seedlings, the machine, the cameras."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...mechanisms.batching import as_points
from ...perception.frames import Camera, Frame
from ...rendering.instances import Instances, from_quaternion, instances, joined
from ...rendering.library import MeshLibrary
from ...rendering.plants import whorl
from ...rendering.shapes import Mesh, box, flat_shaded, merged, surface_of_revolution, tube, turned
from ...rendering.shots import MACHINE, Viewpoint
from ...simulation.looks import MachineLooks
from ...simulation.stage import Scene, Stage
from ...simulation.transplanter_model import (
    looks_joints,
    transplanter_joints,
    transplanter_robot,
)
from ..core import Array
from .config import DAMAGED, EMPTY, POOR, TransplantingConfig, Tray

Side = Literal["source", "target"]
SIDES: tuple[Side, Side] = ("source", "target")

TRAY_TOP_M = 0.800
"""Height of the trays' and the plugs' upper faces."""
_TRAY_HEIGHT_M, _POCKET_M = 0.045, 0.028
_PLUG_M = 0.040
CAMERA_AHEAD_M, CAMERA_ABOVE_M = 0.160, 0.950
"""A row camera stands this far before the arm's plane, out of the arm's way, and this high over the trays: it sees a
row come in, before it is presented [assumed]."""
_IN_VIEW_M = 0.14
"""Only rows within this distance of a row camera's middle are drawn for it."""
_INFEED_M, _OUTFEED_M = 0.42, 0.68
"""Stretch of the conveyors that is shown, before and behind the arm's plane; a hood hides what is still to come."""
_HOOD_VIEW_M = 0.15
"""How far one sees in under the hood."""

HEALTHY_SIZES = (0.60, 0.75, 0.90, 1.05, 1.20)
POOR_SIZES = (0.35, 0.50, 0.65)
"""Spread of a seedling's leaves over 0.8 of its cell's pitch [assumed]; poor ones are stunted, most of them yellow."""
_SPREAD_SHARE = 1.25
_OFF_CENTRE = 0.12
"""Seedlings stand up to this share of the pitch off their cell's middle, both ways [assumed]."""
_YELLOW_SHARE = 0.6

SOIL, HOLLOW, TRAY = (0.27, 0.20, 0.15, 1.0), (0.05, 0.05, 0.05, 1.0), (0.17, 0.18, 0.19, 1.0)
GREENS = ((0.24, 0.52, 0.16, 1.0), (0.30, 0.58, 0.20, 1.0), (0.20, 0.46, 0.17, 1.0))
YELLOWS = ((0.66, 0.64, 0.20, 1.0), (0.58, 0.60, 0.22, 1.0), (0.70, 0.60, 0.26, 1.0))
WITHERED = (0.44, 0.38, 0.20, 1.0)
BELT, STEEL_GREY, FLOOR, CHUTE = (0.10, 0.24, 0.20, 1.0), (0.62, 0.65, 0.68, 1.0), (0.60, 0.60, 0.57, 1.0), (
    0.90, 0.52, 0.12, 1.0,
)  # fmt: skip


@dataclass
class TrayLine:
    """Trays of one conveyor, tray behind tray, as the scene draws them.

    Attributes:
        tray: their kind.
        cells: (rows, columns), what each cell holds.
        looks: (rows, columns), a number in [0, 1) that each seedling's size, colour and lean come from.
        hollow: (rows, columns), whether an empty cell has lost its plug too; otherwise it shows bare soil.
        gap_m: between a tray and the next.
    """

    tray: Tray
    cells: NDArray[np.int8]
    looks: Array
    hollow: NDArray[np.bool_]
    gap_m: float

    def offsets_m(self) -> Array:
        """Distance (rows,) that the conveyor has to travel until each row is presented."""
        row = np.arange(len(self.cells))
        which, number = row // self.tray.rows, row % self.tray.rows
        return which * (self.tray.length_m + self.gap_m) + number * self.tray.pitch_m


class TrayScene(Scene):
    """Draws two conveyors with trays and the transplanter over them.

    Attributes:
        stage: what is drawn: the groups ``room``, ``machine``, ``trays`` and ``held``; a row camera sees ``row``
            instead of the trays. Plants and plugs are told apart by their cell's number in its line.
    """

    def __init__(self, config: TransplantingConfig):
        """Add the meshes of the task's trays, plants and arm."""
        machine, scenario = config.machine, config.scenario
        self.parameters = machine.parameters
        self.stage = Stage()
        library = self.stage.library
        self._machine = MachineLooks(library, [transplanter_robot(self.parameters, looks=True)])
        self._centre_m = {"source": -machine.tray_centre_m, "target": machine.tray_centre_m}
        trays = {"source": scenario.source, "target": scenario.target}
        self._nursery_pitch_m = scenario.source.pitch_m
        self._plants = {
            size: library.add(_seedling(_SPREAD_SHARE * size * self._nursery_pitch_m))
            for size in {*HEALTHY_SIZES, *POOR_SIZES}
        }
        self._plug = library.add(_plug_mesh(self._nursery_pitch_m))
        self._trays = {
            name: [(library.add(mesh), colour) for mesh, colour in _tray_meshes(kind)] for name, kind in trays.items()
        }
        self.stage.put("room", _furniture(library, machine.tray_centre_m, scenario.source.width_m))
        self._lines: dict[Side, TrayLine] = {}
        self._grown: dict[Side, tuple[bytes, Instances]] = {}
        self._travel_m = {"source": 0.0, "target": 0.0}
        self._held: tuple[int, float] | None = None
        self._tip_m = np.zeros(3)
        self._stale = True
        # The row's 280 mm fill the picture's width, some five of its pitches the height.
        focal_span = 2.0 * np.arctan(0.5 * 0.110 / CAMERA_ABOVE_M)
        self._eye = Camera(432, 160, float(focal_span), 0.30, 2.0)
        (left, low), (right, _) = self.parameters.arm.window_m
        self.set_tool([0.5 * (left + right), low])

    def set_lines(self, source: TrayLine, target: TrayLine, source_m: float, target_m: float) -> None:
        """Show trays (they are kept, not copied) with the conveyors ``..._m`` on from their first rows."""
        self._lines = {"source": source, "target": target}
        self._travel_m = {"source": source_m, "target": target_m}
        self._stale = True

    def set_tool(self, tool: ArrayLike, opening: float = 1.0, held: tuple[int, float] | None = None) -> None:
        """Put the machine's tool at (x, y) of its plane.

        Args:
            tool: (2,), metres.
            opening: of the gripper's needles.
            held: what the gripper carries: a cell's content and look.

        Raises:
            UnreachablePoseError: the tool position is beyond the reach of a leg.
        """
        tools = as_points(tool, 2, "tool").reshape(1, 2)
        joints = looks_joints(transplanter_joints(self.parameters, tools)[0], opening)
        self.stage.put("machine", self._machine.place([joints[name] for name in self._machine.joints])[0])
        x, y = tools[0]
        p = self.parameters
        self._tip_m = np.array([0.0, x, p.motor_height_m + y - p.gripper_drop_m])
        if self._held is not None or held is not None:
            self._stale = True
        self._held = held

    def cells_m(self, side: Side) -> Array:
        """Middles (columns, 3) of the upper faces of a row's cells under that side's camera."""
        kind = self._lines[side].tray
        across = self._centre_m[side] + (np.arange(kind.columns) - 0.5 * (kind.columns - 1)) * kind.pitch_m
        return np.column_stack([np.full(kind.columns, -CAMERA_AHEAD_M), across, np.full(kind.columns, TRAY_TOP_M)])

    def sight_camera(self, rows: int, width: int | None = None) -> Camera:
        """A row camera with that many rows."""
        return replace(self._eye, width=width or round(rows * self._eye.width / self._eye.height), height=rows)

    def look(self, side: Side, row: int, camera: Camera | None = None) -> Frame:
        """What the side's camera, or another in its place, saw when ``row`` passed under it."""
        offsets = self._lines[side].offsets_m()
        stretch = -CAMERA_AHEAD_M - _IN_VIEW_M, -CAMERA_AHEAD_M + _IN_VIEW_M
        self.stage.put("row", self._laid(side, offsets[row] - CAMERA_AHEAD_M, *stretch))
        eye = np.array([-CAMERA_AHEAD_M, self._centre_m[side], TRAY_TOP_M + CAMERA_ABOVE_M])
        view = camera or self._eye, eye, eye - np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
        frame = self.stage.look(*view, "room", "machine", "row")
        self.stage.put("row", joined([]))
        return frame

    def render(self, width: int | None = None, height: int | None = None, camera: str = MACHINE) -> NDArray[np.uint8]:
        """Picture (height, width, 3) of machine and trays."""
        if self._stale:
            sides = [
                self._laid(side, self._travel_m[side], -_INFEED_M - _HOOD_VIEW_M, _OUTFEED_M) for side in self._lines
            ]
            self.stage.put("trays", joined(sides))
            held = []
            if self._held is not None:
                content, look = self._held
                top = self._tip_m + np.array([0.0, 0.0, 0.020])
                held.append(self._planted(top[None], np.array([content]), np.array([look]), np.array([-1])))
            self.stage.put("held", joined(held))
            self._stale = False
        return super().render(width, height, camera)

    def viewpoint(self, camera: str) -> Viewpoint:
        """From behind the outgoing rows; from farther; at the gripper."""
        middle, lit_about = np.array([-0.02, 0.0, 1.18]), np.array([0.1, 0.0, TRAY_TOP_M])
        if camera == "overview":
            return Viewpoint(np.array([2.35, 1.35, 2.65]), middle, lit_about, np.deg2rad(40.0))
        if camera == "tool":
            return Viewpoint(self._tip_m + np.array([0.50, 0.26, 0.26]), self._tip_m, lit_about, np.deg2rad(40.0))
        return Viewpoint(np.array([1.45, 0.80, 1.95]), middle, lit_about, np.deg2rad(40.0))

    def _laid(self, side: Side, travel_m: float, low_m: float, high_m: float) -> Instances:
        """What lies on a conveyor between two places along it."""
        line = self._lines[side]
        kind, middle = line.tray, self._centre_m[side]
        offsets = line.offsets_m()
        first = travel_m - offsets[:: kind.rows] - 0.5 * (kind.rows - 1) * kind.pitch_m
        half = 0.5 * kind.length_m
        trays = first[(first > low_m - half) & (first < high_m + half)]
        place = np.column_stack([trays, np.full(len(trays), middle), np.full(len(trays), TRAY_TOP_M)])
        parts = [instances(mesh, place, None, colour) for mesh, colour in self._trays[side]]
        grown = self._rows(side)
        row = grown.identity // kind.columns
        along = (travel_m - offsets)[row]
        return joined([*parts, grown.where((along > low_m) & (along < high_m)).moved((travel_m, 0.0, 0.0))])

    def _rows(self, side: Side) -> Instances:
        """All plugs and plants of a line, with its first row presented; worked out anew when a cell has changed."""
        line = self._lines[side]
        key = line.cells.tobytes() + line.hollow.tobytes() + line.looks.tobytes()
        if side not in self._grown or self._grown[side][0] != key:
            kind = line.tray
            across = self._centre_m[side] + (np.arange(kind.columns) - 0.5 * (kind.columns - 1)) * kind.pitch_m
            row, column = np.nonzero(~((line.cells == EMPTY) & line.hollow))
            top = np.column_stack([-line.offsets_m()[row], across[column], np.full(len(row), TRAY_TOP_M - 0.002)])
            number = row * kind.columns + column
            grown = self._planted(top, line.cells[row, column], line.looks[row, column], number)
            self._grown = {**self._grown, side: (key, grown)}
        return self._grown[side][1]

    def _planted(self, top_m: Array, content: NDArray[np.integer], look: Array, number: NDArray[np.int64]) -> Instances:
        """Plugs with their upper faces at (n, 3), and what grows on them."""
        plugs = instances(self._plug, top_m, None, SOIL, number)
        grows = content != EMPTY
        content, top_m, number = content[grows], top_m[grows], number[grows]
        _, shade, turn, lean, way, _, ahead, across = np.mod(look[grows, None] * 1e4 * _STRETCHES, 1.0).T
        damaged, (size, yellow) = content == DAMAGED, looks_of(content, look[grows])
        mesh = np.array([self._plants[one] for one in size.tolist()], np.int64)
        greens, yellows = (np.array(c)[(shade * len(c)).astype(int)] for c in (GREENS, YELLOWS))
        colour = np.where(yellow[:, None], yellows, greens)
        colour = np.where(damaged[:, None], np.array(WITHERED), colour)
        tilt = np.where(damaged, 1.25, 0.25 * lean)
        aside = np.stack([ahead - 0.5, across - 0.5, 0.0 * ahead], axis=-1)
        foot = top_m + 2.0 * _OFF_CENTRE * self._nursery_pitch_m * aside
        return joined([plugs, instances(mesh, foot, _leaning(2.0 * np.pi * turn, tilt, way), colour, number)])


_STRETCHES = np.array([1.0, 1.618034, 2.236068, 3.141593, 4.669201, 7.389056, 11.09017, 13.59141])
"""Eight numbers in [0, 1) come from one: the decimals that follow its first four, stretched by different factors."""


def looks_of(content: NDArray[np.integer], look: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Sizes (n,) of seedlings and whether they are yellow (n,), from what they are and their numbers in [0, 1)."""
    size, tone = np.mod(look[:, None] * 1e4 * _STRETCHES[[0, 5]], 1.0).T
    poor = content == POOR
    sizes = (np.array(kind)[(size * len(kind)).astype(int)] for kind in (POOR_SIZES, HEALTHY_SIZES))
    return np.where(poor, *sizes), poor & (tone < _YELLOW_SHARE)


def _leaning(turn_rad: Array, tilt_rad: Array, way: Array) -> Array:
    """Rotations (n, 3, 3) of a turn about z, then a tilt about a level axis."""
    axis = 2.0 * np.pi * way
    s, c = np.sin(0.5 * tilt_rad), np.cos(0.5 * tilt_rad)
    x, y, w = s * np.cos(axis), s * np.sin(axis), c
    sz, cz = np.sin(0.5 * turn_rad), np.cos(0.5 * turn_rad)
    return from_quaternion(np.stack([x * cz + y * sz, y * cz - x * sz, w * sz, w * cz], axis=-1))


def _seedling(spread_m: float) -> Mesh:
    """Stem with two tiers of leaves that reach ``spread_m`` across; its foot at the origin."""
    reach = 0.5 * spread_m
    height = 0.022 + 1.1 * reach
    leaf = _leaf(reach, 0.56 * reach, 0.30 * reach, 0.12 * reach)
    small = _leaf(0.62 * reach, 0.34 * reach, 0.34 * reach, 0.36 * reach)
    return merged(
        tube(height, 0.0018, 0.0012, 4),
        turned(whorl(4, leaf, 0.35 * height), np.eye(3), (0.0, 0.0, 0.50 * height)),
        turned(whorl(3, small, 0.10 * height), np.eye(3), (0.0, 0.0, 0.90 * height)),
    )


def _leaf(length_m: float, width_m: float, rise_m: float, tip_m: float) -> Mesh:
    """A leaf of four facets along +x, folded along its vein; hundreds of them are drawn at once."""
    half = 0.5 * width_m
    foot, middle, tip = (0.0, 0.0, 0.0), (0.52 * length_m, 0.0, rise_m), (length_m, 0.0, tip_m)
    left, right = (0.50 * length_m, half, rise_m + 0.35 * half), (0.50 * length_m, -half, rise_m + 0.35 * half)
    facets = np.array([[0, 1, 3], [0, 4, 1], [1, 2, 3], [1, 4, 2]])
    return flat_shaded(np.array([foot, middle, tip, left, right]), facets, two_sided=True)


def _plug_mesh(pitch_m: float) -> Mesh:
    """A tapered plug with its upper face at the origin."""
    half = 0.5 * pitch_m - 0.002
    return surface_of_revolution(
        np.array([0.62 * half, 1.05 * half, 0.01 * half]), np.array([-_PLUG_M, -0.001, 0.0]), 7
    )


def _tray_meshes(kind: Tray) -> list[tuple[Mesh, tuple[float, ...]]]:
    """Ridges and rim, and the dark bottoms of the pockets; the middle of the tray's upper face is the origin."""
    parts = []
    ridge = 0.0035
    inner_x, inner_y = kind.rows * kind.pitch_m, kind.columns * kind.pitch_m
    middle = -0.5 * _POCKET_M
    for row in range(kind.rows + 1):
        parts.append((ridge, inner_y, (row - 0.5 * kind.rows) * kind.pitch_m, 0.0))
    for column in range(kind.columns + 1):
        parts.append((inner_x, ridge, 0.0, (column - 0.5 * kind.columns) * kind.pitch_m))
    rim_x, rim_y = 0.5 * (kind.length_m - inner_x), 0.5 * (kind.width_m - inner_y)
    for sign in (-1.0, 1.0):
        if rim_x > 1e-4:
            parts.append((rim_x, kind.width_m, sign * 0.5 * (inner_x + rim_x), 0.0))
        if rim_y > 1e-4:
            parts.append((kind.length_m, rim_y, 0.0, sign * 0.5 * (inner_y + rim_y)))
    walls = [turned(box((a, b, _POCKET_M)), np.eye(3), (x, y, middle)) for a, b, x, y in parts]
    body = turned(
        box((kind.length_m, kind.width_m, _TRAY_HEIGHT_M - _POCKET_M)),
        np.eye(3),
        (0.0, 0.0, -0.5 * (_TRAY_HEIGHT_M + _POCKET_M)),
    )
    return [(merged(*walls), TRAY), (body, HOLLOW)]


def _furniture(library: MeshLibrary, centre_m: float, width_m: float) -> Instances:
    """Conveyors, the chute between them, and the floor."""
    belt = TRAY_TOP_M - _TRAY_HEIGHT_M
    parts: list[Instances] = []
    length, along = _OUTFEED_M + _INFEED_M + 0.6, 0.5 * (_OUTFEED_M - _INFEED_M - 0.6)

    def put(size: tuple[float, float, float], place: tuple[float, float, float], colour: tuple[float, ...]) -> None:
        parts.append(instances(library.add(box(size)), place, None, colour))

    put((6.0, 6.0, 0.02), (0.0, 0.0, -0.01), FLOOR)
    for side in (-1.0, 1.0):
        put((length, width_m - 0.01, 0.035), (along, side * centre_m, belt - 0.0175), BELT)
        for edge in (-1.0, 1.0):
            put(
                (length, 0.010, 0.07),
                (along, side * centre_m + edge * (0.5 * width_m + 0.006), belt - 0.02),
                STEEL_GREY,
            )
        for x in (-0.55, 0.55):
            put((0.04, width_m, 0.04), (x, side * centre_m, belt - 0.08), STEEL_GREY)
            for y in (-1.0, 1.0):
                foot = side * centre_m + y * (0.5 * width_m - 0.02)
                put((0.04, 0.04, belt - 0.06), (x, foot, 0.5 * (belt - 0.06)), STEEL_GREY)
        hood = -_INFEED_M - 0.30
        put((0.60, width_m + 0.02, 0.006), (hood, side * centre_m, TRAY_TOP_M + 0.10), STEEL_GREY)
        for edge in (-1.0, 1.0):
            put((0.60, 0.006, 0.15), (hood, side * centre_m + edge * (0.5 * width_m + 0.010), belt + 0.07), STEEL_GREY)
    put((0.10, 0.026, 0.004), (0.0, 0.0, belt - 0.06), CHUTE)
    put((0.10, 0.10, 0.30), (0.0, 0.0, belt - 0.30), CHUTE)
    return joined(parts)
