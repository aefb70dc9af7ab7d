"""The transplanter's world in a render client: trays on conveyors, seedlings from pools, the machine, the cameras."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...perception.frames import Camera, Frame
from ...simulation.camera import look
from ...simulation.client import PhysicsClient
from ...simulation.meshes import Mesh, Pool, box, flat_shaded, merged, surface_of_revolution, tube, turned, whorl
from ...simulation.transplanter import TransplanterMachine
from ...simulation.transplanter_model import TransplanterParameters
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


class TrayScene:
    """Draws two conveyors with trays and the transplanter over them. Bodies are made once and only moved."""

    def __init__(self, config: TransplantingConfig, *, window: bool = False):
        """Make the client, the pools and the machine.

        Args:
            config: the task's; its trays and the arm are drawn.
            window: show a window instead of drawing off screen.

        Raises:
            RuntimeError: a window was asked for and there is no display.
        """
        machine, scenario = config.machine, config.scenario
        self.parameters = TransplanterParameters(arm=machine.arm)
        self._client = PhysicsClient(self.parameters.physics_hz, gui=window)
        self._machine = TransplanterMachine(self.parameters, self._client, looks=True)
        self._centre_m = {"source": -machine.tray_centre_m, "target": machine.tray_centre_m}
        trays = {"source": scenario.source, "target": scenario.target}
        self._nursery_pitch_m = scenario.source.pitch_m
        self._plants = {
            size: _Stock(self._client, _seedling(_SPREAD_SHARE * size * self._nursery_pitch_m), GREENS[0])
            for size in {*HEALTHY_SIZES, *POOR_SIZES}
        }
        self._plugs = _Stock(self._client, _plug_mesh(self._nursery_pitch_m), SOIL)
        self._trays = {
            name: [_Stock(self._client, mesh, colour) for mesh, colour in _tray_meshes(kind)]
            for name, kind in trays.items()
        }
        _furnish(self._client, machine.tray_centre_m, scenario.source.width_m)
        self._lines: dict[Side, TrayLine] = {}
        self._travel_m = {"source": 0.0, "target": 0.0}
        self._held: tuple[int, float] | None = None
        self._tip_m = np.zeros(3)
        self._stale = True
        # The row's 280 mm fill the picture's width, some five of its pitches the height.
        focal_span = 2.0 * np.arctan(0.5 * 0.110 / CAMERA_ABOVE_M)
        self._eye = Camera(432, 160, float(focal_span), 0.30, 2.0)

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
        """
        self._require_open()
        self._machine.place(tool, opening)
        x, y = np.asarray(tool, dtype=np.float64)
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

    def look(self, side: Side, row: int) -> Frame:
        """What the side's camera saw when ``row`` passed under it."""
        self._require_open()
        self._clear()
        offsets = self._lines[side].offsets_m()
        self._lay(side, offsets[row] - CAMERA_AHEAD_M, -CAMERA_AHEAD_M - _IN_VIEW_M, -CAMERA_AHEAD_M + _IN_VIEW_M)
        self._stale = True
        eye = np.array([-CAMERA_AHEAD_M, self._centre_m[side], TRAY_TOP_M + CAMERA_ABOVE_M])
        return look(self._eye, self._client, eye, eye - np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]))

    def render(self, width: int = 640, height: int = 480) -> NDArray[np.uint8]:
        """Picture (height, width, 3) of machine and trays, from behind the outgoing rows."""
        self._require_open()
        if self._stale:
            self._clear()
            for side in self._lines:
                self._lay(side, self._travel_m[side], -_INFEED_M - _HOOD_VIEW_M, _OUTFEED_M)
            if self._held is not None:
                top = self._tip_m + np.array([0.0, 0.0, 0.020])
                self._plant(top, *self._held)
            self._stale = False
        camera = Camera(width, height, np.deg2rad(40.0), 0.1, 12.0)
        # Shadows would cost three times as much as all the rest.
        eye, middle = np.array([1.45, 0.80, 1.95]), np.array([-0.02, 0.0, 1.18])
        return look(camera, self._client, eye, middle, np.array([0.0, 0.0, 1.0])).rgb

    def close(self) -> None:
        """Close the client; idempotent."""
        self._client.close()

    def _require_open(self) -> None:
        if self._client.closed:
            raise RuntimeError("the scene is closed: make a new one")

    def _clear(self) -> None:
        self._plugs.clear()
        for pool in [*self._plants.values(), *(pool for pools in self._trays.values() for pool in pools)]:
            pool.clear()

    def _lay(self, side: Side, travel_m: float, low_m: float, high_m: float) -> None:
        """Place what lies on a conveyor between two places along it."""
        line = self._lines[side]
        kind, middle = line.tray, self._centre_m[side]
        along = travel_m - line.offsets_m()
        across = middle + (np.arange(kind.columns) - 0.5 * (kind.columns - 1)) * kind.pitch_m
        for first in range(0, len(along), kind.rows):
            x = float(along[first]) - 0.5 * (kind.rows - 1) * kind.pitch_m
            if low_m - 0.5 * kind.length_m < x < high_m + 0.5 * kind.length_m:
                for pool in self._trays[side]:
                    pool.place((x, middle, TRAY_TOP_M))
        for row in np.flatnonzero((along > low_m) & (along < high_m)):
            for column in range(kind.columns):
                content = int(line.cells[row, column])
                if content == EMPTY and line.hollow[row, column]:
                    continue
                place = np.array([along[row], across[column], TRAY_TOP_M - 0.002])
                self._plant(place, content, float(line.looks[row, column]))

    def _plant(self, top_m: Array, content: int, look: float) -> None:
        """Place a plug and what grows on it."""
        self._plugs.place(top_m)
        if content == EMPTY:
            return
        size, shade, turn, lean, way, tone, ahead, across = _parts_of(look)
        sizes = POOR_SIZES if content == POOR else HEALTHY_SIZES
        colours = YELLOWS if content == POOR and tone < _YELLOW_SHARE else GREENS
        colour = colours[int(shade * len(colours))]
        tilt = 0.25 * lean
        foot_m = top_m + 2.0 * _OFF_CENTRE * self._nursery_pitch_m * np.array([ahead - 0.5, across - 0.5, 0.0])
        if content == DAMAGED:
            colour, tilt = WITHERED, 1.25
        self._plants[sizes[int(size * len(sizes))]].place(foot_m, _leaning(2.0 * np.pi * turn, tilt, way), colour)


class _Stock:
    """Copies of one mesh that grow in number with what is shown: parked bodies cost as much to draw as shown ones."""

    _CHUNK = 12

    def __init__(self, client: PhysicsClient, mesh: Mesh, colour: tuple[float, ...]):
        self._client, self._mesh, self._colour = client, mesh, colour
        self._pools: list[Pool] = []
        self._filling = 0

    def clear(self) -> None:
        """Park all copies."""
        for pool in self._pools:
            pool.clear()
        self._filling = 0

    def place(
        self,
        position: Array | tuple[float, float, float],
        orientation: tuple[float, ...] = (0.0, 0.0, 0.0, 1.0),
        colour: tuple[float, ...] | None = None,
    ) -> None:
        """Show one more copy."""
        while self._filling < len(self._pools):
            if self._pools[self._filling].place(position, orientation, colour) is not None:
                return
            self._filling += 1
        self._pools.append(Pool(self._client, self._mesh, self._colour, self._CHUNK))
        self._pools[-1].place(position, orientation, colour)


def _parts_of(look: float) -> tuple[float, ...]:
    """Eight numbers in [0, 1) from one: the decimals that follow the first four, stretched by different factors."""
    return tuple(np.mod(look * 1e4 * _STRETCHES, 1.0).tolist())


_STRETCHES = np.array([1.0, 1.618034, 2.236068, 3.141593, 4.669201, 7.389056, 11.09017, 13.59141])


def _leaning(turn_rad: float, tilt_rad: float, way: float) -> tuple[float, float, float, float]:
    """Quaternion of a turn about z, then a tilt about a level axis."""
    axis = 2.0 * np.pi * way
    s, c = np.sin(0.5 * tilt_rad), np.cos(0.5 * tilt_rad)
    x, y, w = s * np.cos(axis), s * np.sin(axis), c
    sz, cz = np.sin(0.5 * turn_rad), np.cos(0.5 * turn_rad)
    return (x * cz + y * sz, y * cz - x * sz, w * sz, w * cz)


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


def _furnish(client: PhysicsClient, centre_m: float, width_m: float) -> None:
    """Conveyors, the chute between them, and the floor; one static body each."""
    belt = TRAY_TOP_M - _TRAY_HEIGHT_M
    length, along = _OUTFEED_M + _INFEED_M + 0.6, 0.5 * (_OUTFEED_M - _INFEED_M - 0.6)

    def put(size: tuple[float, float, float], place: tuple[float, float, float], colour: tuple[float, ...]) -> None:
        Pool(client, box(size), colour, 1).place(place)

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
