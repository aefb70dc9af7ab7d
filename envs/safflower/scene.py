"""The picker's world in a render client: plants from pools, the machine, its camera and one for people."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...perception.frames import Camera, Frame
from ...simulation.camera import look
from ...simulation.client import PhysicsClient
from ...simulation.meshes import (
    Mesh,
    Pool,
    box,
    merged,
    spiny_leaf,
    surface_of_revolution,
    tube,
    tuft,
    turned,
    upright_to,
    whorl,
    yaw,
)
from ...simulation.picker import PickerMachine
from ...simulation.picker_model import PickerParameters
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
_BEHIND_M, _AHEAD_M = 0.70, 1.00
_REPLANT_M = 0.20
"""Only plants within this stretch around the arm are drawn; they are placed anew when the cart has gone this far."""


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


class PickerScene:
    """Draws a field and the picker in it. Bodies are made once; loading a field only moves them."""

    def __init__(self, parameters: PickerParameters | None = None, *, window: bool = False):
        """Make the client, the pools and the machine.

        Args:
            parameters: the machine's; its ``motor_height_m`` sets the frame and the camera.
            window: show a window instead of drawing off screen.

        Raises:
            RuntimeError: a window was asked for and there is no display.
        """
        self.parameters = parameters or PickerParameters()
        self._client = PhysicsClient(self.parameters.physics_hz, gui=window)
        self._machine = PickerMachine(self.parameters, self._client)
        self._eye = Camera(480, 360, np.deg2rad(46.0), 0.10, 2.0)
        self._pools: dict[str, Pool] = {}
        self._potted: bool | None = None
        self._field: Looks | None = None
        self._cart_x_m = 0.0
        self._planted_at_m = np.inf
        self._tuft_of_head: dict[int, tuple[int, int]] = {}
        self._picked: set[int] = set()

    def load(self, field: Looks) -> None:
        """Show another field, unpicked."""
        if field.potted != self._potted:
            # A scene serves one scenario: it makes its bodies once, and only as many as that one shows.
            for pool in self._pools.values():
                pool.clear()
            self._potted, self._pools = field.potted, _make_pools(self._client, field.potted)
        self._field = field
        self._picked.clear()
        self._planted_at_m = np.inf

    def set_machine(self, cart_x_m: float, tool: ArrayLike) -> None:
        """Put the machine at a cart position with its tool at (u, v) in the arm's plane."""
        self._require_open()
        self._cart_x_m = cart_x_m
        self._machine.place(cart_x_m, tool)

    def set_picked(self, head: int) -> None:
        """Take the filaments off a head."""
        self._picked.add(head)
        if head in self._tuft_of_head:
            width, copy = self._tuft_of_head[head]
            self._pools[f"tuft{width}"].park(copy)

    def look(self) -> Frame:
        """What the machine's camera sees, straight down on the window in front of the arm."""
        self._plant()
        p = self.parameters
        eye = np.array([self._cart_x_m + p.camera_ahead_m, 0.0, p.motor_height_m + p.camera_above_motors_m])
        # The image's long side lies along the row. Drawing only what can be in it halves the time of a look.
        view = eye, eye - np.array([0.0, 0.0, 1.0]), np.array([0.0, 1.0, 0.0])
        for pool in self._pools.values():
            pool.show(self._eye.sees(pool.places, pool.reach_m, *view))
        return look(self._eye, self._client, *view)

    def render(self, width: int = 640, height: int = 480) -> NDArray[np.uint8]:
        """Picture (height, width, 3) of machine and plants from beside the row."""
        self._plant()
        for pool in self._pools.values():
            pool.show(np.ones(len(pool.places), dtype=bool))
        camera = Camera(width, height, np.deg2rad(38.0), 0.1, 12.0)
        middle = np.array([self._cart_x_m + 0.08, 0.0, 0.5 * self.parameters.motor_height_m + 0.18])
        eye = middle + np.array([0.62, -2.15, 0.80])
        frame = look(camera, self._client, eye, middle, np.array([0.0, 0.0, 1.0]), shadows=True)
        empty = frame.depth_m > 0.99 * camera.far_m
        sky = np.linspace((176, 205, 232), (236, 241, 243), height).astype(np.uint8)
        return np.where(empty[..., None], sky[:, None], frame.rgb)

    def close(self) -> None:
        """Close the client; idempotent."""
        self._client.close()

    def _require_open(self) -> None:
        if self._client.closed:
            raise RuntimeError("the scene is closed: make a new one")

    def _plant(self) -> None:
        """Place the plants around the machine, if it has come far enough since the last time."""
        self._require_open()
        field = self._field
        if field is None or abs(self._cart_x_m - self._planted_at_m) < _REPLANT_M:
            return
        self._planted_at_m = self._cart_x_m
        for pool in self._pools.values():
            pool.clear()
        self._tuft_of_head.clear()
        low, high = self._cart_x_m - _BEHIND_M - _REPLANT_M, self._cart_x_m + _AHEAD_M + _REPLANT_M
        near = (field.plant_base[:, 0] > low) & (field.plant_base[:, 0] < high)
        for plant in np.flatnonzero(near).tolist():
            self._place_plant(field, plant)
        for head in np.flatnonzero(near[field.head_plant]).tolist():
            self._place_head(field, head)
        middle = round(self._cart_x_m / 0.5) * 0.5
        self._pools["ground"].place((middle, 0.0, -0.01))
        if not field.potted:
            for side in (-0.33, 0.33):
                self._pools["furrow"].place((middle, side, 0.0))

    def _place_plant(self, field: Looks, plant: int) -> None:
        base = field.plant_base[plant]
        turn = _scatter(plant, 0) * 2.0 * np.pi
        if field.potted:
            self._pools["pot"].place(base, yaw(turn))
            self._pools["soil"].place(base + np.array([0.0, 0.0, POT_HEIGHT_M - 0.012]))
            if base[2] > 0.0:
                self._pools["block"].place(base, yaw(0.0))
            return
        height = float(field.plant_height_m[plant])
        self._rod("rod", _LONG_RODS_M, base + np.array([0.0, 0.0, height - 0.10]), np.array([0.0, 0.0, -1.0]), height)
        for level in np.arange(0.12, height - 0.22, 0.10):
            spin = yaw(turn + 7.0 * level)
            self._pools["whorl"].place(base + np.array([0.0, 0.0, level]), spin)

    def _place_head(self, field: Looks, head: int) -> None:
        centre = field.head_position[head]
        plant = int(field.head_plant[head])
        base = field.plant_base[plant]
        neck = centre - np.array([0.0, 0.0, _BULB_DROP_M + 0.020])
        spin = yaw(2.0 * np.pi * _scatter(head, 1))
        if field.potted:
            root = base + np.array([0.0, 0.0, POT_HEIGHT_M])
            root[:2] += 0.35 * np.clip(centre[:2] - base[:2], -0.18, 0.18)
            self._rod("rod", _LONG_RODS_M, neck, root - neck, float(np.linalg.norm(root - neck)))
            for share in (0.22, 0.45, 0.68):
                self._pools["whorl"].place(neck + share * (root - neck) - np.array([0.0, 0.0, 0.04]), spin)
        else:
            joint = base.copy()
            joint[2] = neck[2] - 0.06 - 0.6 * float(np.linalg.norm(centre[:2] - base[:2]))
            self._rod("branch", _BRANCHES_M, neck, joint - neck, float(np.linalg.norm(joint - neck)))
        self._pools["bulb"].place(centre - np.array([0.0, 0.0, _BULB_DROP_M]), spin)
        stage = int(field.head_stage[head])
        if stage in BLOOM and head not in self._picked:
            width = int(np.abs(np.array(_TUFT_RADII_M) - 0.5 * field.head_spread_m[head]).argmin())
            copy = self._pools[f"tuft{width}"].place(centre, spin, BLOOM[stage])
            if copy is not None:
                self._tuft_of_head[head] = width, copy
        if field.head_occluded[head]:
            angle = 2.0 * np.pi * _scatter(head, 2)
            reach = np.array([np.cos(angle), np.sin(angle), 0.0])
            aside = 0.013 * np.array([-reach[1], reach[0], 0.0])
            self._pools["leaf"].place(centre - 0.055 * reach + aside + np.array([0.0, 0.0, 0.026]), yaw(angle))

    def _rod(self, kind: str, lengths: tuple[float, ...], top: Array, down: Array, length_m: float) -> None:
        """A rod from ``top`` downwards, of the shortest pooled length that reaches; the rest goes into the soil."""
        index = min(int(np.searchsorted(lengths, length_m)), len(lengths) - 1)
        self._pools[f"{kind}{index}"].place(top, upright_to(down))


def _make_pools(client: PhysicsClient, potted: bool) -> dict[str, Pool]:
    """All plant parts, pots and ground; the numbers cover the densest stretch that is drawn at once."""
    heads, whorls = (28, 72) if potted else (250, 96)
    leaf = spiny_leaf(0.085, 0.030, 0.015, 3)
    pools = {
        "bulb": Pool(client, _bulb(), GREEN, heads),
        "leaf": Pool(client, spiny_leaf(0.090, 0.030, 0.010, 3), LEAF, heads // 4),
        "whorl": Pool(client, whorl(6 if potted else 5, leaf, 0.08), LEAF, whorls),
        "pot": Pool(client, _pot(), TERRACOTTA, 6),
        "soil": Pool(client, surface_of_revolution(np.array([0.115, 0.0]), np.zeros(2), 16), SOIL, 6),
        "block": Pool(client, turned(box((0.22, 0.22, 0.60)), np.eye(3), (0.0, 0.0, -0.30)), WOOD, 6),
        "ground": Pool(client, box((8.0, 5.0, 0.02), bottom=False), GROUND, 1),
        "furrow": Pool(client, box((8.0, 0.16, 0.03), bottom=False), FURROW, 2),
    }
    for index, radius in enumerate(_TUFT_RADII_M):
        pools[f"tuft{index}"] = Pool(client, tuft(radius, _TUFT_HEIGHT_M), BLOOM[1], heads * 2 // 3)
    for index, length in enumerate(_LONG_RODS_M):
        pools[f"rod{index}"] = Pool(client, tube(length, 0.0025, 0.0045), STALK, 16)
    for index, length in enumerate(_BRANCHES_M):
        pools[f"branch{index}"] = Pool(client, tube(length, 0.0020, 0.0028, 4), STALK, 1 if potted else 80)
    return pools


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


def _scatter(index: int, salt: int) -> float:
    """A fixed, irregular number in [0, 1) for the looks of body ``index``; nothing is drawn."""
    return float((index * 0.6180339887 + salt * 0.7548776662 + (index * index % 97) * 0.013) % 1.0)
