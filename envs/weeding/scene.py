"""The weeders' world in a render client: soil, crop rows, weeds, the front camera; tools add their machine."""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

from ...perception.frames import Camera, Frame
from ...simulation.camera import below_ground, look
from ...simulation.client import PhysicsClient
from ...simulation.meshes import (
    Mesh,
    Pool,
    box,
    flat_shaded,
    frustum,
    merged,
    rotation_z,
    surface_of_revolution,
    turned,
    yaw,
)
from ..core import Array
from .config import FieldTask

Quaternion = tuple[float, float, float, float]
Rgba = tuple[float, float, float, float]

SOIL, CLOD, STONE = (0.40, 0.31, 0.23, 1.0), (0.34, 0.26, 0.19, 1.0), (0.52, 0.48, 0.43, 1.0)
MOSS = (0.36, 0.40, 0.24, 1.0)
WEED_GREEN, GRASS_GREEN, BEET, MAIZE = (
    (0.33, 0.55, 0.22, 1.0),
    (0.40, 0.60, 0.26, 1.0),
    (0.20, 0.47, 0.20, 1.0),
    (0.30, 0.55, 0.18, 1.0),
)
SCORCHED = (0.07, 0.05, 0.04, 1.0)
FRONT_SIGHT = (0.98, 0.80, 0.25, 1.0)
_BEHIND_M, _AHEAD_M, _REPLANT_M = 1.0, 1.3, 0.25
_SENSOR_NOISE = 4.0
_SHADE = 0.55


def blade(
    length_m: float, width_m: float, rise_m: float, droop_m: float, pieces: int = 5, *, grass: bool = False
) -> Mesh:
    """Leaf along +x from the origin on an arched vein, seen from above.

    Broadleaves have an ellipse-like outline; a ``grass`` is widest at its sheath and tapers to a point.
    """
    along = np.linspace(0.0, 1.0, pieces + 1)
    outline = 1.0 - along**2.5 if grass else np.sin(np.pi * np.clip(along, 0.04, 0.97)) ** 0.7
    half = 0.5 * width_m * np.maximum(outline, 0.05)
    x = length_m * along
    z = rise_m * along - (rise_m + droop_m) * along**2 + 0.001
    left = np.stack([x, half, z + 0.15 * half], -1)
    right = np.stack([x, -half, z + 0.15 * half], -1)
    i, n = np.arange(pieces), pieces + 1
    faces = np.concatenate([np.stack([i, n + i, n + i + 1], -1), np.stack([i, n + i + 1, i + 1], -1)])
    vertices = np.concatenate([left, right])
    mesh = flat_shaded(vertices, faces)
    if mesh.normals[:, 2].mean() < 0.0:
        mesh = flat_shaded(vertices, faces[:, ::-1])
    return mesh


def rosette(leaf: Mesh, count: int, turn_rad: float, start_rad: float = 0.0, height_m: float = 0.004) -> Mesh:
    """``count`` leaves about a stem, ``turn_rad`` apart."""
    return merged(*(turned(leaf, rotation_z(start_rad + k * turn_rad), (0.0, 0.0, height_m)) for k in range(count)))


def weed_mesh(species: int, stage: int) -> Mesh:
    """Seedling of a species and stage; sizes are assumed."""
    half = np.pi
    if species == 0:
        cotyledons = rosette(blade(0.009, 0.005, 0.004, 0.000), 2, half)
        if stage == 0:
            return cotyledons
        if stage == 1:
            return merged(cotyledons, rosette(blade(0.017, 0.009, 0.008, 0.000), 2, half, 0.5 * half, 0.008))
        big = blade(0.028, 0.014, 0.012, 0.002)
        return merged(cotyledons, rosette(big, 4, 0.5 * half, 0.4, 0.010))
    if stage == 0:
        return rosette(blade(0.024, 0.0024, 0.020, 0.002, grass=True), 1, half)
    if stage == 1:
        return rosette(blade(0.038, 0.0032, 0.028, 0.004, grass=True), 2, 0.85 * half)
    return rosette(blade(0.060, 0.0042, 0.040, 0.010, grass=True), 4, 0.55 * half)


def crop_mesh(kind: str) -> Mesh:
    """Crop plant: a beet's rosette or a young maize."""
    if kind == "beet":
        return rosette(blade(0.055, 0.030, 0.030, 0.005, 6), 6, 2.399, 0.0, 0.008)
    return rosette(blade(0.090, 0.016, 0.080, 0.010, 6), 4, 0.9 * np.pi, 0.0, 0.012)


class FieldScene:
    """Draws one strip. Bodies are made once; another strip only moves them. Tools add their machine.

    Attributes:
        client: the world that it draws in.
        front: the camera in front of the cart.
    """

    mark_radius_m, mark_colour = 0.008, SCORCHED
    """Of the spots that the tool leaves on the ground."""
    side_eye_m = (0.30, -2.55, 1.55)
    """From what people are shown, ``side_middle_m`` above the row, to where they look from."""
    side_middle_m = 0.50
    side_view_rad = np.deg2rad(36.0)
    """How much they see from top to bottom."""

    def __init__(self, config: FieldTask, camera_height_m: float, physics_hz: float, *, window: bool = False):
        """Make the client and the pools."""
        self.config = config
        self.client = PhysicsClient(physics_hz, gui=window)
        self._eye_m = camera_height_m
        self.front = Camera(400, 320, 2.0 * np.arctan(0.5 * config.cart.camera_view_m / camera_height_m), 0.10, 2.0)
        self._pools = self._make_pools()
        self._soil = self._soil_in_pictures()
        self._front_frustum: Pool | None = None
        self._weed, self._crop = np.zeros((0, 2)), np.zeros((0, 2))
        self._species, self._stage, self._look = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
        self._dead_weed, self._dead_crop = np.zeros(0, bool), np.zeros(0, bool)
        self._marks: list[Array] = []
        self._cart_m, self._planted_m = 0.0, np.inf
        self._strip = 0

    def load(
        self,
        weed: Array,
        species: NDArray[np.int64],
        stage: NDArray[np.int64],
        look: Array,
        crop: Array,
        strip: int,
    ) -> None:
        """Show another strip: weeds (n, 2) with their kinds and looks in [0, 1), crop plants (m, 2), its number."""
        self._weed, self._species, self._stage, self._look = weed, species, stage, look
        self._crop = crop
        self._dead_weed, self._dead_crop = np.zeros(len(weed), bool), np.zeros(len(crop), bool)
        self._marks = []
        self._strip = strip
        self._planted_m = np.inf

    def set_dead(self, weed: NDArray[np.bool_], crop: NDArray[np.bool_], marks: list[Array]) -> None:
        """Show plants as dead and mark where the tool worked, places (2,), on the ground."""
        if np.any(weed != self._dead_weed) or np.any(crop != self._dead_crop) or len(marks) != len(self._marks):
            self._dead_weed, self._dead_crop, self._marks = weed.copy(), crop.copy(), list(marks)
            self._planted_m = np.inf

    def look_front(self, cart_m: float) -> Frame:
        """What the front camera sees, straight down; the top of the picture is ahead."""
        self.plant_around(cart_m)
        eye = np.array([cart_m + self.config.cart.camera_ahead_m, 0.0, self._eye_m])
        return self.look_down(self.front, eye, eye - np.array([0.0, 0.0, 1.0]))

    def render(self, width: int = 720, height: int = 480) -> NDArray[np.uint8]:
        """Picture (height, width, 3) of machine and field from beside the row."""
        self.plant_around(self._cart_m)
        for pool in self._pools.values():
            pool.show(np.ones(len(pool.places), dtype=bool))
        middle = np.array([self._cart_m + 0.02, 0.0, self.side_middle_m])
        eye = middle + np.array(self.side_eye_m)
        return self._show(Camera(width, height, self.side_view_rad, 0.1, 14.0), eye, middle)

    def close_up(self, place: Array, width: int = 224, height: int = 168) -> NDArray[np.uint8]:
        """Picture (height, width, 3) of what happens at a place (2,) on the ground, from behind it."""
        middle = np.array([place[0], place[1], 0.015])
        eye = middle + np.array([-0.13, -0.15, 0.15])
        return self._show(Camera(width, height, np.deg2rad(40.0), 0.05, 3.0), eye, middle)

    def _show(self, camera: Camera, eye: Array, middle: Array) -> NDArray[np.uint8]:
        frame = look(camera, self.client, eye, middle, np.array([0.0, 0.0, 1.0]), shadows=True)
        empty = frame.depth_m > 0.99 * camera.far_m
        sky = np.linspace((176, 205, 232), (236, 241, 243), camera.height).astype(np.uint8)
        return np.where(empty[..., None], sky[:, None], frame.rgb)

    def dead_looks(self, at: Array, turn: Quaternion) -> tuple[Array, Quaternion, Rgba]:
        """Position, quaternion and colour of a dead plant that stood ``at`` a place with a ``turn``."""
        return at, turn, SCORCHED

    def show_front_frustum(self, cart_m: float) -> None:
        """Show people what the front camera sees from a cart position."""
        if self._front_frustum is None:
            half = self._eye_m * np.tan(0.5 * self.front.field_of_view_rad)
            sides = half, half * self.front.width / self.front.height
            self._front_frustum = Pool(self.client, frustum(sides, self._eye_m - 0.004), FRONT_SIGHT, 1)
        self._front_frustum.clear()
        self._front_frustum.place((cart_m + self.config.cart.camera_ahead_m, 0.0, self._eye_m))

    def close(self) -> None:
        """Close the client; idempotent."""
        self.client.close()

    def look_down(self, camera: Camera, eye: Array, target: Array) -> Frame:
        """What a camera over the ground sees from ``eye`` (3,) towards ``target`` (3,), its noise included."""
        up = np.array([1.0, 0.0, 0.0])
        # One look for all pools: a dozen small ones would take a quarter of the picture's time.
        pools = list(self._pools.values())
        pools.remove(self._pools["ground"])
        places = [pool.places for pool in pools]
        counts = [len(p) for p in places]
        reach = np.repeat([pool.reach_m for pool in pools], counts)
        seen = camera.sees(np.concatenate(places), reach, eye, target, up)
        for pool, visible in zip(pools, np.split(seen, np.cumsum(counts)[:-1]), strict=True):
            pool.show(visible)
        # The ground is flat and of one colour: painting it takes a third of the time that drawing it does.
        self._pools["ground"].show(np.zeros(1, bool))
        frame = look(camera, self.client, eye, target, up)
        soil = np.tile(self._soil, (camera.height, camera.width, 1))
        covered = np.asarray(cv2.copyTo(soil, below_ground(frame).view(np.uint8), frame.rgb), np.uint8)
        return frame._replace(rgb=self._sensor(covered, eye))

    def _soil_in_pictures(self) -> NDArray[np.uint8]:
        """Colour (3,) of lit ground; to be asked before anything else stands in the world."""
        self._pools["ground"].place((0.0, 0.0, -0.01))
        above, ahead = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0])
        picture = look(Camera(9, 9), self.client, above, np.zeros(3), ahead).rgb
        self._pools["ground"].clear()
        return picture[4, 4]

    def _sensor(self, rgb: NDArray[np.uint8], eye: Array) -> NDArray[np.uint8]:
        """Shade of the cart over one side of the picture and the sensor's noise; the same for the same picture."""
        h, w, _ = rgb.shape
        edge = round((0.35 + 0.3 * np.sin(2.1 * float(eye[0]) + self._strip)) * w)
        picture = rgb.astype(np.float32)
        picture[:, : max(edge, 0)] *= _SHADE
        key = (round(float(eye[0]) * 1e4) * 7919 + round(float(eye[1]) * 1e4) + 31 * self._strip) % 2**32
        noise = np.random.default_rng(key).standard_normal((h, w), dtype=np.float32) * np.float32(_SENSOR_NOISE)
        picture += cv2.merge((noise, noise, noise))
        return np.asarray(cv2.convertScaleAbs(np.maximum(picture, 0.0, out=picture)), np.uint8)

    def _make_pools(self) -> dict[str, Pool]:
        client = self.client
        pools = {
            f"weed{species}{stage}": Pool(client, weed_mesh(species, stage), (WEED_GREEN, GRASS_GREEN)[species], 70)
            for species in (0, 1)
            for stage in (0, 1, 2)
        }
        pools["crop"] = Pool(client, crop_mesh(self.config.scenario.crop), BEET, 54)
        pools["ground"] = Pool(client, box((8.0, 5.0, 0.02), bottom=False), SOIL, 1)
        clod = surface_of_revolution(np.array([0.012, 0.010, 0.0]), np.array([-0.002, 0.005, 0.008]), 6)
        pools["clod"] = Pool(client, clod, CLOD, 240)
        pebble = surface_of_revolution(np.array([0.007, 0.006, 0.0]), np.array([-0.002, 0.003, 0.005]), 5)
        pools["stone"] = Pool(client, pebble, STONE, 60)
        moss = surface_of_revolution(np.array([0.009, 0.0]), np.array([0.0005, 0.001]), 7)
        pools["moss"] = Pool(client, moss, MOSS, 30)
        mark = surface_of_revolution(np.array([self.mark_radius_m, 0.0]), np.array([0.001, 0.0012]), 10)
        pools["mark"] = Pool(client, mark, self.mark_colour, 80)
        return pools

    def plant_around(self, middle_m: float) -> None:
        """Place what grows around ``middle_m``, if it has not been."""
        if abs(middle_m - self._planted_m) < _REPLANT_M:
            return
        self._planted_m = middle_m
        for pool in self._pools.values():
            pool.clear()
        low, high = middle_m - _BEHIND_M - _REPLANT_M, middle_m + _AHEAD_M + _REPLANT_M
        self._pools["ground"].place((middle_m + 0.2, 0.0, -0.01))
        for i in np.flatnonzero((self._weed[:, 0] > low) & (self._weed[:, 0] < high)).tolist():
            species, stage = int(self._species[i]), int(self._stage[i])
            green = (WEED_GREEN, GRASS_GREEN)[species]
            shade = 0.85 + 0.3 * float((self._look[i] * 7.3) % 1.0)
            colour = (green[0] * shade, green[1] * shade, green[2] * shade, 1.0)
            at, turn = np.append(self._weed[i], 0.0), yaw(2.0 * np.pi * float(self._look[i]))
            if self._dead_weed[i]:
                at, turn, colour = self.dead_looks(at, turn)
            self._pools[f"weed{species}{stage}"].place(at, turn, colour)
        green = BEET if self.config.scenario.crop == "beet" else MAIZE
        pitch, row = self.config.scenario.crop_pitch_m, self.config.scenario.row_m
        for i in np.flatnonzero((self._crop[:, 0] > low) & (self._crop[:, 0] < high)).tolist():
            at, turn, colour = np.append(self._crop[i], 0.0), yaw(2.0 * np.pi * _scatter(i, self._strip)), green
            if self._dead_crop[i]:
                at, turn, colour = self.dead_looks(at, turn)
            self._pools["crop"].place(at, turn, colour)
        for side in (-1, 1):
            for i in range(int(np.floor(low / pitch)), int(np.ceil(high / pitch))):
                at = (pitch * (i + 0.1 * _scatter(i, side + 5)), side * row, 0.0)
                self._pools["crop"].place(at, yaw(2.0 * np.pi * _scatter(i, side + 9)), green)
        for mark in self._marks:
            if low < mark[0] < high:
                self._pools["mark"].place((*mark, 0.0))
        for name, each_m in (("clod", 0.012), ("stone", 0.05), ("moss", 0.5)):
            for i in range(int(low / each_m), int(high / each_m)):
                across = 0.62 * (2.0 * _scatter(i, 3 * self._strip + len(name)) - 1.0)
                self._pools[name].place((each_m * i, across, 0.0), yaw(i))


def _scatter(index: int, salt: int) -> float:
    """A fixed, irregular number in [0, 1) for the looks of body ``index``; nothing is drawn."""
    return float(np.modf(abs(np.sin(12.9898 * index + 78.233 * (salt + 1))) * 43758.5453)[0])
