"""The picker's world: plants as instances, the machine, its camera and one for people."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...mechanisms.batching import as_points
from ...perception.frames import Camera, Frame
from ...rendering.instances import Instances, about_z, instances, joined, upright_to
from ...rendering.plants import spiny_leaf, tuft, whorl
from ...rendering.shapes import Mesh, box, merged, surface_of_revolution, tube, turned
from ...rendering.shots import Viewpoint
from ...simulation.hose import Hose
from ...simulation.looks import MachineLooks
from ...simulation.picker_model import (
    HOSE_INLET_M,
    HOSE_RADIUS_M,
    PickerParameters,
    hose_outlet_m,
    picker_joints,
    picker_robot,
)
from ...simulation.stage import Scene, Stage
from ..core import Array

GREEN, LEAF, STALK = (0.42, 0.56, 0.24, 1.0), (0.25, 0.44, 0.19, 1.0), (0.48, 0.58, 0.30, 1.0)
TERRACOTTA, SOIL, WOOD = (0.66, 0.36, 0.25, 1.0), (0.32, 0.25, 0.19, 1.0), (0.72, 0.58, 0.40, 1.0)
GROUND, FURROW = (0.47, 0.40, 0.32, 1.0), (0.41, 0.34, 0.27, 1.0)
BLOOM = {1: (1.00, 0.66, 0.10, 1.0), 2: (0.93, 0.30, 0.07, 1.0), 3: (0.45, 0.17, 0.10, 1.0)}
"""Filaments by stage: fresh yellow-orange, late orange-red, dry brown-red."""

POT_HEIGHT_M = 0.16
_BULB_DROP_M = 0.014
"""The bulb's top lies this far below the middle of the tuft."""
_TUFT_RADII_M, _TUFT_HEIGHT_M = (0.0217, 0.0239, 0.0261), 0.022
"""Tufts are drawn in three widths, a standard deviation (published 3.73 mm of 47.85 mm) and a little apart."""
_LONG_RODS_M = tuple(np.arange(0.24, 1.00, 0.07).round(2).tolist())
_BRANCHES_M = (0.07, 0.10, 0.13, 0.16, 0.20, 0.25)
_BEHIND_M, _AHEAD_M = 0.90, 1.20
"""Only what stands within this stretch around the arm is drawn."""
_REACH_M = 0.35
"""No part of a plant or pot is farther than this along the row from its middle."""


HOSE = (0.85, 0.85, 0.83)


@dataclass(frozen=True)
class Looks:
    """What grows in a row, as the scene draws it.

    Attributes:
        head_position: (n, 3), world metres, centre of the filament tuft.
        head_stage: (n,), 0 bud, 1 fresh, 2 late, 3 dry.
        head_spread_m: (n,), width of the filament tuft; three widths are drawn.
        head_plant: (n,), index of its plant.
        head_occluded: (n,), whether a leaf hangs over it.
        plant_base: (p, 3), where the pot stands, or the stem leaves the soil.
        plant_height_m: (p,).
        crown_m: (p,), width.
        potted: pots on blocks instead of a field row.
    """

    head_position: Array
    head_stage: NDArray[np.int64]
    head_spread_m: Array
    head_plant: NDArray[np.int64]
    head_occluded: NDArray[np.bool_]
    plant_base: Array
    plant_height_m: Array
    crown_m: Array
    potted: bool


class PickerScene(Scene):
    """Draws a field and the picker in it.

    Attributes:
        stage: what is drawn: the groups ``machine``, ``ground``, ``plants`` and ``tufts``, each head's parts under its
            index.
    """

    def __init__(self, parameters: PickerParameters | None = None):
        """Add the meshes; ``parameters`` are the machine's, its ``motor_height_m`` sets the frame and the camera."""
        self.parameters = parameters or PickerParameters()
        self.stage = Stage()
        self._machine = MachineLooks(self.stage.library, [picker_robot(self.parameters)])
        self._hose = Hose(self.stage.library, 0.75, HOSE_RADIUS_M, HOSE)
        self._meshes = {name: self.stage.library.add(mesh) for name, mesh in _meshes().items()}
        self._eye = Camera(480, 360, np.deg2rad(46.0), 0.10, 2.0)
        self._plants, self._tufts = joined([]), joined([])
        self._standing = np.zeros(0, bool)
        self._potted = False
        self._cart_x_m, self._tool_m = 0.0, np.zeros(3)
        self._platform = self._machine.links.index("platform")

    def load(self, field: Looks) -> None:
        """Show another field, unpicked."""
        self._potted = field.potted
        self._plants = joined([_stands(field, self._meshes), *_heads(field, self._meshes)])
        self._tufts = _tufts(field, self._meshes)
        self._standing = np.ones(len(self._tufts.mesh), bool)
        self._show_field()

    def set_machine(self, cart_x_m: float, tool: ArrayLike) -> None:
        """Put the machine at a cart position with its tool at (u, v) in the arm's plane.

        Raises:
            UnreachablePoseError: the tool position is beyond the reach of a leg.
        """
        tools = as_points(tool, 2, "tool").reshape(1, 2)
        joints = picker_joints(self.parameters, np.array([cart_x_m], np.float64), tools)[0]
        parts, turn, shift = self._machine.place(joints)
        outlet = turn[self._platform] @ hose_outlet_m(self.parameters.five_bar) + shift[self._platform]
        inlet = np.array(HOSE_INLET_M) + np.array([cart_x_m, 0.0, 0.0])
        self._tool_m = shift[self._platform]
        hose = self._hose.lay(outlet, (0.0, 0.0, 0.22), inlet, (0.14, 0.0, 0.0))
        self.stage.put("machine", joined([parts, hose]))
        self.set_cart(cart_x_m)

    def set_cart(self, cart_x_m: float) -> None:
        """Show what stands about a cart position."""
        if cart_x_m != self._cart_x_m:
            self._cart_x_m = cart_x_m
            self._show_field()

    def set_picked(self, head: int) -> None:
        """Take the filaments off a head."""
        self._standing = self._standing & (self._tufts.identity != head)
        self._show_field()

    def look(self) -> Frame:
        """What the machine's camera sees, straight down on the window in front of the arm."""
        p = self.parameters
        eye = np.array([self._cart_x_m + p.camera_ahead_m, 0.0, p.motor_height_m + p.camera_above_motors_m])
        # The image's long side lies along the row.
        return self.stage.look(self._eye, eye, eye - np.array([0.0, 0.0, 1.0]), (0.0, 1.0, 0.0))

    def sight_camera(self, rows: int) -> Camera:
        """The machine's camera with that many rows."""
        return replace(self._eye, width=round(rows * self._eye.width / self._eye.height), height=rows)

    def look_without_machine(self, camera: Camera) -> Frame:
        """What a camera in the place of the machine's would see, were there no machine."""
        p = self.parameters
        eye = np.array([self._cart_x_m + p.camera_ahead_m, 0.0, p.motor_height_m + p.camera_above_motors_m])
        down = eye - np.array([0.0, 0.0, 1.0])
        return self.stage.look(camera, eye, down, (0.0, 1.0, 0.0), "ground", "plants", "tufts")

    def viewpoint(self, camera: str) -> Viewpoint:
        """From beside the row; from farther; at the tool; from the machine's own camera, straight down."""
        p = self.parameters
        middle = np.array([self._cart_x_m + 0.08, 0.0, 0.5 * p.motor_height_m + 0.18])
        if camera == "overview":
            return Viewpoint(middle + np.array([1.25, -2.90, 1.55]), middle, middle, np.deg2rad(38.0))
        if camera == "tool":
            return Viewpoint(self._tool_m + np.array([0.24, -0.62, 0.26]), self._tool_m, middle, np.deg2rad(38.0))
        if camera == "front":
            eye = np.array([self._cart_x_m + p.camera_ahead_m, 0.0, p.motor_height_m + p.camera_above_motors_m])
            return Viewpoint(eye, eye - np.array([0.0, 0.0, 1.0]), middle, self._eye.field_of_view_rad, (0.0, 1.0, 0.0))
        return Viewpoint(middle + np.array([0.62, -2.15, 0.80]), middle, middle, np.deg2rad(38.0))

    def _show_field(self) -> None:
        """Show the stretch of the field that the machine is in."""
        low, high = self._cart_x_m - _BEHIND_M - _REACH_M, self._cart_x_m + _AHEAD_M + _REACH_M
        for group, things, there in (("plants", self._plants, True), ("tufts", self._tufts, self._standing)):
            along = things.shift[:, 0]
            self.stage.put(group, things.where(there & (along > low) & (along < high)))
        middle = round(self._cart_x_m / 0.5) * 0.5
        ground = [instances(self._meshes["ground"], (middle, 0.0, -0.01), None, GROUND)]
        if not self._potted:
            sides = [(middle, -0.33, 0.0), (middle, 0.33, 0.0)]
            ground.append(instances(self._meshes["furrow"], sides, None, FURROW))
        self.stage.put("ground", joined(ground))


def _stands(field: Looks, meshes: dict[str, int]) -> Instances:
    """Pots on their blocks, or stems with their whorls of leaves."""
    base, number = field.plant_base, np.arange(len(field.plant_base))
    turn = 2.0 * np.pi * _scatter(number, 0)
    if field.potted:
        soil = base + np.array([0.0, 0.0, POT_HEIGHT_M - 0.012])
        return joined(
            [
                instances(meshes["pot"], base, about_z(turn), TERRACOTTA),
                instances(meshes["soil"], soil, None, SOIL),
                instances(meshes["block"], base[base[:, 2] > 0.0], None, WOOD),
            ]
        )
    top = base + np.stack([0.0 * turn, 0.0 * turn, field.plant_height_m - 0.10], axis=-1)
    stems = _rods("rod", _LONG_RODS_M, meshes, top, np.tile([0.0, 0.0, -1.0], (len(base), 1)), field.plant_height_m)
    levels = [np.arange(0.12, height - 0.22, 0.10) for height in field.plant_height_m.tolist()]
    plant = np.repeat(number, [len(level) for level in levels])
    level = np.concatenate(levels) if levels else np.zeros(0)
    place = base[plant] + np.stack([0.0 * level, 0.0 * level, level], axis=-1)
    return joined([stems, instances(meshes["whorl5"], place, about_z(turn[plant] + 7.0 * level), LEAF)])


def _heads(field: Looks, meshes: dict[str, int]) -> list[Instances]:
    """Branches, bulbs and the leaves that hang over some heads."""
    centre, number = field.head_position, np.arange(len(field.head_position))
    base = field.plant_base[field.head_plant]
    neck = centre - np.array([0.0, 0.0, _BULB_DROP_M + 0.020])
    spin = about_z(2.0 * np.pi * _scatter(number, 1))
    parts = []
    if field.potted:
        root = base + np.array([0.0, 0.0, POT_HEIGHT_M])
        root[:, :2] += 0.35 * np.clip(centre[:, :2] - base[:, :2], -0.18, 0.18)
        parts.append(_rods("rod", _LONG_RODS_M, meshes, neck, root - neck, np.linalg.norm(root - neck, axis=1)))
        for share in (0.22, 0.45, 0.68):
            place = neck + share * (root - neck) - np.array([0.0, 0.0, 0.04])
            parts.append(instances(meshes["whorl6"], place, spin, LEAF))
    else:
        joint = base.copy()
        joint[:, 2] = neck[:, 2] - 0.06 - 0.6 * np.linalg.norm(centre[:, :2] - base[:, :2], axis=1)
        parts.append(_rods("branch", _BRANCHES_M, meshes, neck, joint - neck, np.linalg.norm(joint - neck, axis=1)))
    parts.append(instances(meshes["bulb"], centre - np.array([0.0, 0.0, _BULB_DROP_M]), spin, GREEN, number))
    hidden = np.flatnonzero(field.head_occluded)
    angle = 2.0 * np.pi * _scatter(hidden, 2)
    reach = np.stack([np.cos(angle), np.sin(angle), 0.0 * angle], axis=-1)
    aside = 0.013 * np.stack([-reach[:, 1], reach[:, 0], 0.0 * angle], axis=-1)
    over = centre[hidden] - 0.055 * reach + aside + np.array([0.0, 0.0, 0.026])
    parts.append(instances(meshes["leaf"], over, about_z(angle), LEAF, hidden))
    return parts


def _tufts(field: Looks, meshes: dict[str, int]) -> Instances:
    """Filaments of open heads, of the drawn width nearest to theirs."""
    head = np.flatnonzero(np.isin(field.head_stage, list(BLOOM)))
    width = np.abs(np.array(_TUFT_RADII_M) - 0.5 * field.head_spread_m[head, None]).argmin(axis=1)
    mesh = np.array([meshes[f"tuft{k}"] for k in range(len(_TUFT_RADII_M))])[width]
    colour = np.array([BLOOM[stage] for stage in field.head_stage[head].tolist()]).reshape(-1, 4)
    spin = about_z(2.0 * np.pi * _scatter(head, 1))
    return instances(mesh, field.head_position[head], spin, colour, head)


def _rods(
    kind: str, lengths: tuple[float, ...], meshes: dict[str, int], top: Array, down: Array, length_m: Array
) -> Instances:
    """Rods from ``top`` downwards, each of the shortest length there is that reaches; the rest goes into the soil."""
    index = np.minimum(np.searchsorted(lengths, length_m), len(lengths) - 1)
    mesh = np.array([meshes[f"{kind}{k}"] for k in range(len(lengths))])[index]
    return instances(mesh, top, upright_to(down), STALK)


def _meshes() -> dict[str, Mesh]:
    """All parts of plants, pots and ground."""
    leaf = spiny_leaf(0.085, 0.030, 0.015, 3)
    meshes = {
        "bulb": _bulb(),
        "leaf": spiny_leaf(0.090, 0.030, 0.010, 3),
        "whorl5": whorl(5, leaf, 0.08),
        "whorl6": whorl(6, leaf, 0.08),
        "pot": _pot(),
        "soil": surface_of_revolution(np.array([0.115, 0.0]), np.zeros(2), 16),
        "block": turned(box((0.22, 0.22, 0.60)), np.eye(3), (0.0, 0.0, -0.30)),
        "ground": box((8.0, 5.0, 0.02), bottom=False),
        "furrow": box((8.0, 0.16, 0.03), bottom=False),
    }
    meshes |= {f"tuft{k}": tuft(radius, _TUFT_HEIGHT_M) for k, radius in enumerate(_TUFT_RADII_M)}
    meshes |= {f"rod{k}": tube(length, 0.0025, 0.0045) for k, length in enumerate(_LONG_RODS_M)}
    return meshes | {f"branch{k}": tube(length, 0.0020, 0.0028, 4) for k, length in enumerate(_BRANCHES_M)}


def _bulb() -> Mesh:
    """Egg-shaped flower base, 25 mm wide and 21 mm high, its top at the origin, with a collar of bracts."""
    body = surface_of_revolution(
        np.array([0.003, 0.0100, 0.0126, 0.0105, 0.0055]), np.array([-0.021, -0.017, -0.010, -0.003, 0.001]), 8
    )
    collar = whorl(5, spiny_leaf(0.030, 0.011, 0.004, 2), 0.0)
    return merged(body, turned(collar, np.eye(3), (0.0, 0.0, -0.017)))


def _pot() -> Mesh:
    return surface_of_revolution(
        np.array([0.0, 0.085, 0.118, 0.128, 0.128, 0.112]),
        np.array([0.0, 0.0, POT_HEIGHT_M - 0.03, POT_HEIGHT_M - 0.03, POT_HEIGHT_M, POT_HEIGHT_M - 0.004]),
        18,
    )


def _scatter(index: NDArray[np.int64], salt: int) -> Array:
    """Fixed, irregular numbers (n,) in [0, 1) for the looks of bodies ``index`` (n,); nothing is drawn."""
    return np.mod(index * 0.6180339887 + salt * 0.7548776662 + (index * index % 97) * 0.013, 1.0)
