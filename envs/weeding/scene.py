"""The weeders' world: soil, crop rows, weeds, the front camera; tools add their machine."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...perception.frames import Camera, Frame
from ...rendering.cameras import pose_of, view_of
from ...rendering.instances import NOBODY, Instances, about_z, instances, joined
from ...rendering.outdoor import Outdoors
from ...rendering.renderer import GroundLook
from ...rendering.shapes import box, frustum, surface_of_revolution
from ...rendering.shots import MACHINE, Viewpoint
from ...simulation.stage import Scene, Stage
from ..core import Array
from .config import FieldTask
from .growing import Foliage, Nursery, together
from .outdoors import Day, Litter, day_of, seen_by
from .seedlings import crop_mesh, weed_mesh
from .standing import Standing

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
"""What stands this far behind and ahead is drawn; it is chosen anew when the middle has gone the last distance."""
_SENSOR_NOISE = 4.0
_BESIDE_M, _CHOSEN_AHEAD_M = 0.06, 0.75
"""Of a picture of what can be chosen: wider than the band by this, and reaching this far before the cart."""
_SHADE = 0.55


class FieldScene(Scene):
    """Draws one strip. Tools add their machine.

    Attributes:
        stage: what is drawn: the groups ``plants`` (weeds under their numbers, crop plants under theirs behind the
            weeds), ``soil`` (clods, stones, moss), ``ground``, and what tools add. Cameras see plants and soil.
        front: the camera in front of the cart.
        eye_m: its height.
        tool_m: (3,), where the machine's tool works.
    """

    usual_px = 720, 480

    mark_radius_m, mark_colour = 0.008, SCORCHED
    """Of the spots that the tool leaves on the ground."""
    side_eye_m = (0.30, -2.55, 1.55)
    """From what people are shown, ``side_middle_m`` above the row, to where they look from."""
    side_middle_m = 0.50
    side_view_rad = np.deg2rad(36.0)
    """How much they see from top to bottom."""
    far_eye_m, far_middle_m = (1.25, -2.60, 1.40), 0.35
    """The same of the whole cart."""

    def __init__(self, config: FieldTask, camera_height_m: float):
        """Add the meshes of field and camera."""
        self.config = config
        self.stage = Stage()
        self.eye_m = camera_height_m
        self.front = Camera(400, 320, 2.0 * np.arctan(0.5 * config.cart.camera_view_m / camera_height_m), 0.10, 2.0)
        library = self.stage.library
        self._weed_mesh = np.array([[library.add(weed_mesh(k, stage)) for stage in (0, 1, 2)] for k in (0, 1)])
        self._crop_mesh = library.add(crop_mesh(config.scenario.crop))
        self._soil = library.add(box((8.0, 5.0, 0.02), bottom=False))
        clod = surface_of_revolution(np.array([0.012, 0.010, 0.0]), np.array([-0.002, 0.005, 0.008]), 6)
        pebble = surface_of_revolution(np.array([0.007, 0.006, 0.0]), np.array([-0.002, 0.003, 0.005]), 5)
        moss = surface_of_revolution(np.array([0.009, 0.0]), np.array([0.0005, 0.001]), 7)
        self._litter = [
            (library.add(clod), CLOD, len("clod"), 0.012),
            (library.add(pebble), STONE, len("stone"), 0.05),
            (library.add(moss), MOSS, len("moss"), 0.5),
        ]
        mark = surface_of_revolution(np.array([self.mark_radius_m, 0.0]), np.array([0.001, 0.0012]), 10)
        self._mark = library.add(mark)
        half = camera_height_m * np.tan(0.5 * self.front.field_of_view_rad)
        sides = half, half * self.front.width / self.front.height
        self._front_frustum = library.add(frustum(sides, camera_height_m - 0.004))
        self._weed, self._crop = np.zeros((0, 2)), np.zeros((0, 2))
        self._species, self._stage, self._look = np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0)
        self._dead_weed, self._dead_crop = np.zeros(0, bool), np.zeros(0, bool)
        self._marks: list[Array] = []
        self._plants: Instances = joined([])
        self._cart_m, self._planted_m = 0.0, np.inf
        self._strip, self._ground_look = 0, 0.0
        self._day: Day | None = None
        if config.pictures == "field":
            self._nursery, self._scattered = Nursery(library, config.scenario.crop), Litter(library)
        self.tool_m = np.zeros(3)
        self.standing: Standing | None = None

    def load(
        self,
        weed: Array,
        species: NDArray[np.int64],
        stage: NDArray[np.int64],
        look: Array,
        crop: Array,
        ground_look: float,
        standing: Standing | None = None,
    ) -> None:
        """Show another strip: weeds (n, 2) with their kinds and looks in [0, 1), crop plants (m, 2), its own look.

        ``standing`` is its ground where that is no plane.
        """
        self.standing = standing
        self._weed, self._species, self._stage, self._look = weed, species, stage, look
        self._crop = crop
        self._dead_weed, self._dead_crop = np.zeros(len(weed), bool), np.zeros(len(crop), bool)
        self._marks = []
        self._strip, self._ground_look = int(1e6 * ground_look) % 1009, ground_look
        if self.config.pictures == "field":
            self._day = day_of(ground_look)
            crop_look = np.random.default_rng([int(ground_look * 2.0**53), 3]).random(len(crop))
            self._foliage = self._nursery.weeds(species, stage, look), self._nursery.crops(crop_look)
        self._grow()

    def set_dead(self, weed: NDArray[np.bool_], crop: NDArray[np.bool_], marks: list[Array]) -> None:
        """Show plants as dead and mark where the tool worked, places (2,), on the ground."""
        if np.any(weed != self._dead_weed) or np.any(crop != self._dead_crop) or len(marks) != len(self._marks):
            self._dead_weed, self._dead_crop, self._marks = weed.copy(), crop.copy(), list(marks)
            self._grow()

    def look_front(self, cart_m: float) -> Frame:
        """What the front camera sees, straight down; the top of the picture is ahead."""
        self.plant_around(cart_m)
        eye = np.array([cart_m + self.config.cart.camera_ahead_m, 0.0, self.eye_m])
        return self.look_shaken(self.front, cart_m, eye, eye - np.array([0.0, 0.0, 1.0]))

    def sight_camera(self, rows: int, behind_m: float) -> Camera:
        """A camera of that many rows over the stretch that can be chosen from; its long side lies along the row."""
        across_m, along_m = self.config.scenario.band_m + _BESIDE_M, behind_m + _CHOSEN_AHEAD_M
        width, angle = round(rows * along_m / across_m), 2.0 * np.arctan(0.5 * across_m / self.eye_m)
        return Camera(width, rows, float(angle), self.front.near_m, self.front.far_m)

    def look_along(self, cart_m: float, rows: int, behind_m: float) -> Frame:
        """What that camera sees: pictures of the front camera, put together by the odometry, would show the same.

        Args:
            cart_m: position of the cart.
            rows: of the picture.
            behind_m: where behind the cart plants leave the tool's window.
        """
        self.plant_around(cart_m)
        eye = np.array([cart_m + 0.5 * (_CHOSEN_AHEAD_M - behind_m), 0.0, self.eye_m])
        camera, down = self.sight_camera(rows, behind_m), eye - np.array([0.0, 0.0, 1.0])
        ground = self.bare_ground(camera, eye)
        return self.stage.look(camera, eye, down, (0.0, 1.0, 0.0), "plants", "soil", ground=ground)

    def render(self, width: int | None = None, height: int | None = None, camera: str = MACHINE) -> NDArray[np.uint8]:
        """Picture (height, width, 3) of machine and field."""
        self.plant_around(self._cart_m)
        return super().render(width, height, camera)

    def viewpoint(self, camera: str) -> Viewpoint:
        """From where the tool is seen best; from beside the row and farther; at the tool; from the front camera."""
        middle = np.array([self._cart_m + 0.02, 0.0, self.side_middle_m])
        if camera == "overview":
            far = np.array([self._cart_m + 0.15, 0.0, self.far_middle_m])
            return Viewpoint(far + np.array(self.far_eye_m), far, self._lit_about, np.deg2rad(38.0))
        if camera == "tool":
            eye = self.tool_m + np.array([-0.26, -0.34, 0.26])
            return Viewpoint(eye, self.tool_m, self._lit_about, np.deg2rad(40.0))
        if camera == "front":
            eye = np.array([self._cart_m + self.config.cart.camera_ahead_m, 0.0, self.eye_m])
            down = eye - np.array([0.0, 0.0, 1.0])
            return Viewpoint(eye, down, self._lit_about, self.front.field_of_view_rad, (1.0, 0.0, 0.0))
        return Viewpoint(middle + np.array(self.side_eye_m), middle, self._lit_about, float(self.side_view_rad))

    def close_up(self, place: Array, width: int = 224, height: int = 168) -> NDArray[np.uint8]:
        """Picture (height, width, 3) of what happens at a place (2,) on the ground, from behind it."""
        middle = np.array([place[0], place[1], 0.015])
        eye = middle + np.array([-0.13, -0.15, 0.15])
        camera = Camera(width, height, np.deg2rad(40.0), 0.05, 3.0)
        return self.stage.picture(camera, eye, middle, self._lit_about)

    def dead_looks(self, at: Array, turn: Array) -> tuple[Array, Array, Rgba]:
        """Positions (n, 3), rotations (n, 3, 3) and colour of dead plants that stood ``at`` places with ``turn``."""
        return at, turn, SCORCHED

    def show_front_frustum(self, cart_m: float) -> None:
        """Show people what the front camera sees from a cart position."""
        place = (cart_m + self.config.cart.camera_ahead_m, 0.0, self.eye_m)
        self.stage.put("sight", instances(self._front_frustum, place, None, FRONT_SIGHT), shadow=False)

    def look_down(self, camera: Camera, eye: Array, target: Array) -> Frame:
        """What a camera over the ground sees from ``eye`` (3,) towards ``target`` (3,), its noise included."""
        view, ground = (camera, eye, target, (1.0, 0.0, 0.0)), self.bare_ground(camera, eye)
        return self.stage.look(*view, "plants", "soil", ground=ground)

    def look_shaken(self, camera: Camera, cart_m: float, eye: Array, target: Array) -> Frame:
        """What a camera of the frame sees, which is at ``eye`` and looks towards ``target`` if the frame stands level.

        Whoever reads the picture believes that it does: nothing measures how the frame stands.
        """
        if self.standing is None:
            return self.look_down(camera, eye, target)
        up = np.array([1.0, 0.0, 0.0])
        real, middle, top = (self.standing.put(cart_m, point) for point in (eye, target, eye + up))
        ground = self.bare_ground(camera, eye)
        seen = self.stage.look(camera, real, middle, top - real, "plants", "soil", ground=ground)
        return Frame(seen.rgb, seen.depth_m, pose_of(view_of(camera, eye, target, up)))

    def plant_around(self, middle_m: float) -> None:
        """Show what stands around ``middle_m``, if it is not shown."""
        if abs(middle_m - self._planted_m) < _REPLANT_M:
            return
        self._planted_m = middle_m
        low, high = middle_m - _BEHIND_M - _REPLANT_M, middle_m + _AHEAD_M + _REPLANT_M
        soil = SOIL if self._day is None else (*(self._day.soil.colour / 255.0).tolist(), 1.0)
        self.stage.put("ground", instances(self._soil, (middle_m + 0.2, 0.0, -0.01), None, soil))
        along = self._plants.shift[:, 0]
        crop = BEET if self.config.scenario.crop == "beet" else MAIZE
        pitch, row = self.config.scenario.crop_pitch_m, self.config.scenario.row_m
        parts = [self._plants.where((along > low) & (along < high))]
        i = np.arange(int(np.floor(low / pitch)), int(np.ceil(high / pitch)))
        for side in (-1, 1):
            across = side * (0.5 * (self.config.scenario.bed.rows + 1) * row)
            at = np.stack([pitch * (i + 0.1 * _scatter(i, side + 5)), np.full(len(i), across), 0.0 * i], axis=-1)
            if self._day is None:
                parts.append(instances(self._crop_mesh, at, about_z(2.0 * np.pi * _scatter(i, side + 9)), crop))
            else:
                beside = self._nursery.crops(_scatter(i, side + 9))
                parts.append(_leaves(beside, at, np.eye(3)[None].repeat(len(i), 0), None, np.full(len(i), NOBODY)))
        self.stage.put("plants", joined(parts))
        if self._day is not None:
            half_m = 0.5 * self.config.scenario.band_m + _BESIDE_M
            self.stage.put("soil", joined([*self._scattered.between(low, high, half_m, self._ground_look, self._day)]))
            return
        parts = []
        for mesh, colour, salt, each_m in self._litter:
            i = np.arange(int(low / each_m), int(high / each_m))
            across = 0.62 * (2.0 * _scatter(i, 3 * self._strip + salt) - 1.0)
            parts.append(instances(mesh, np.stack([each_m * i, across, 0.0 * i], axis=-1), about_z(i), colour))
        self.stage.put("soil", joined(parts))

    @property
    def _lit_about(self) -> Array:
        """Middle of what throws shadows in pictures for people."""
        return np.array([self._cart_m, 0.0, 0.3])

    def bare_ground(self, camera: Camera, eye: Array) -> GroundLook | Outdoors:
        """Bare ground, the light and the shade on it, and the sensor's noise; the same for the same place."""
        edge = round((0.35 + 0.3 * np.sin(2.1 * float(eye[0]) + self._strip)) * camera.width)
        key = (round(float(eye[0]) * 1e4) * 7919 + round(float(eye[1]) * 1e4) + 31 * self._strip) % 2**32
        if self._day is not None:
            pixel_m = 2.0 * float(eye[2]) * np.tan(0.5 * camera.field_of_view_rad) / camera.height
            return seen_by(self._day, eye, self.config.speed_m_s, pixel_m, key)
        return GroundLook(SOIL, _SHADE, max(edge, 0), _SENSOR_NOISE, key)

    def _grow(self) -> None:
        """Work out the strip's own plants and the tool's marks."""
        n, m = len(self._weed), len(self._crop)
        bright = 0.85 + 0.3 * ((self._look * 7.3) % 1.0)
        green = np.array([WEED_GREEN, GRASS_GREEN])[self._species, :3] * bright[:, None]
        crop = np.array(BEET if self.config.scenario.crop == "beet" else MAIZE)[:3]
        looks = np.concatenate([self._look, _scatter(np.arange(m), self._strip)])
        turn = about_z(2.0 * np.pi * looks)
        places = np.concatenate([self._weed, self._crop])
        heights = np.zeros(n + m) if self.standing is None else self.standing.heights_m(places)
        at = np.column_stack([places, heights])
        colour = np.concatenate([green, np.tile(crop, (m, 1))])
        dead = np.concatenate([self._dead_weed, self._dead_crop])
        at[dead], turn[dead], withered = self.dead_looks(at[dead], turn[dead])
        colour[dead] = withered[:3]
        if self._day is None:
            mesh = np.concatenate([self._weed_mesh[self._species, self._stage], np.full(m, self._crop_mesh)])
            plants = instances(mesh, at, turn, colour, np.arange(n + m))
        else:
            weeds, crops = self._foliage
            whole = together(weeds, crops._replace(plant=crops.plant + n))
            plants = _leaves(whole, at, turn, np.where(dead[:, None], colour, np.nan), np.arange(n + m))
        spots = np.column_stack([np.array(self._marks).reshape(-1, 2), np.zeros(len(self._marks))])
        self._plants = joined([plants, instances(self._mark, spots, None, self.mark_colour)])
        self._planted_m = np.inf


def _leaves(foliage: Foliage, at: Array, turn: Array, colour: Array | None, identity: NDArray[np.int64]) -> Instances:
    """The leaves of plants that stand at (n, 3) with turns (n, 3, 3), in their own colours where (n, 3) says none."""
    whose = foliage.plant
    turned = np.einsum("kij,kjl->kil", turn[whose], foliage.turn)
    place = at[whose] + np.einsum("kij,kj->ki", turn[whose], foliage.shift)
    own = foliage.colour if colour is None else np.where(np.isnan(colour[whose]), foliage.colour, colour[whose])
    return instances(foliage.mesh, place, turned, own, identity[whose])


def _scatter(index: NDArray[np.int64], salt: int) -> Array:
    """Fixed, irregular numbers (n,) in [0, 1) for the looks of bodies ``index`` (n,); nothing is drawn."""
    return np.modf(np.abs(np.sin(12.9898 * index + 78.233 * (salt + 1))) * 43758.5453)[0]
