"""Draws instances of a library's meshes: frames for cameras, pictures for people."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..perception.frames import Camera, Frame
from .cameras import fall_of_rays, pose_of, sun_view, view_of
from .instances import Instances
from .library import MeshLibrary
from .noise import stream
from .optics import blurred, sensed, taps
from .outdoor import Outdoors, resolve_outdoor, tile
from .raster import Layers, Light, View, draw
from .shading import Ground, resolve, resolve_ground, resolve_picture
from .shapes import Array

_TOWARDS = np.array([0.6, -0.5, 1.6])
_TOWARDS /= np.sqrt((_TOWARDS * _TOWARDS).sum())
SUN = Light(_TOWARDS, 0.62, 0.50, 0.03, np.array([1.0, 0.98, 0.94]))
"""The light that all statistics of cameras were measured in."""

_WHITE = np.full(3, 255, np.uint8)
_SKY = (176.0, 205.0, 232.0), (236.0, 241.0, 243.0)
"""Colour of the sky at the upper and at the lower edge of a picture for people."""
_MAP_PIXELS, _MAP_HALF_M = 1024, 1.6
_NEAR_PIXELS, _NEAR_HALF_M = 640, 0.40
"""The same of what throws shadows before a camera over the ground."""
_DARK = 0.35
"""Share of the sun's light that a shadow keeps."""
_CASTER_M = 2.5
"""What is larger, ground and floors, throws no shadow."""


class GroundLook(NamedTuple):
    """Bare ground below a camera: painted, which takes a fraction of drawing it, and seen through a noisy sensor.

    Attributes:
        colour: (3,), red, green, blue in [0, 1].
        shade: share of its colour that the shaded side of the picture keeps.
        shaded: columns of the picture in the shade.
        noise: standard deviation of what is added to all colours of a pixel, out of 255.
        seed: of the noise.
    """

    colour: tuple[float, ...]
    shade: float
    shaded: int
    noise: float
    seed: int


class Look(NamedTuple):
    """A frame and what its pixels show.

    Attributes:
        frame: the picture with its depth.
        identity: (h, w) int32, the ``identity`` of the instance that a pixel shows, -1 for what has none.
    """

    frame: Frame
    identity: NDArray[np.int32]


class Renderer:
    """Draws the meshes of one library.

    It keeps buffers between pictures: threads need one each. What it draws depends on its arguments alone.

    Attributes:
        library: the meshes.
    """

    def __init__(self, library: MeshLibrary):
        """Take the meshes."""
        self.library = library
        self._layers: dict[tuple[str, int, int], tuple[NDArray[np.float32], NDArray[np.int32]]] = {}
        self._owner, self._light = np.zeros(0, np.int32), np.zeros((0, 4))
        self._point, self._shine = np.zeros((0, 6)), np.zeros(0)
        self._shaded: tuple[Instances, Array, View, NDArray[np.float32]] | None = None

    def look(
        self,
        things: Instances,
        camera: Camera,
        eye: ArrayLike,
        target: ArrayLike,
        up: ArrayLike,
        ground: GroundLook | Outdoors | None = None,
        *,
        identities: bool = True,
    ) -> Look:
        """What a camera sees.

        Args:
            things: what stands in the scene.
            camera: its size and opening.
            eye: (3,), metres.
            target: (3,), what is in the middle of the picture.
            up: (3,), the direction of its top.
            ground: painted wherever nothing stands above the plane z = 0, or everything outdoors; nothing is added
                where it is left out.
            identities: say whom the pixels show; it takes a part of the time.
        """
        view = view_of(camera, eye, target, up)
        if isinstance(ground, Outdoors):
            return self._outdoors(things, camera, view, ground, identities)
        layers = self._cleared(things, camera.width, camera.height)
        draw(self.library.meshes, things, 0, len(things.mesh), view, SUN, layers, True)
        shape = camera.height, camera.width
        rgb, depth = np.empty((*shape, 3), np.uint8), np.empty(shape, np.float32)
        identity = np.empty(shape if identities else (0, 0), np.int32)
        pose = pose_of(view)
        if ground is None:
            resolve(things, layers, SUN, camera.far_m, _WHITE, rgb, depth, identity)
        else:
            height = float(pose.world_from_camera[2, 3])
            look = Ground(
                level_colour(ground.colour),
                height,
                fall_of_rays(view),
                ground.shade,
                ground.shaded,
                ground.noise,
                stream(ground.seed),
            )
            # Random words run over; where kernels are not compiled, NumPy would warn of it.
            with np.errstate(over="ignore"):
                resolve_ground(things, layers, SUN, camera.far_m, look, rgb, depth, identity)
        return Look(Frame(rgb, depth, pose), identity)

    def looks(
        self,
        scenes: Sequence[Instances],
        camera: Camera,
        eye: ArrayLike,
        target: ArrayLike,
        up: ArrayLike,
    ) -> tuple[NDArray[np.uint8], NDArray[np.float32], NDArray[np.int32]]:
        """What cameras in several scenes see: colours (k, h, w, 3), depths and identities (k, h, w).

        Args:
            scenes: k of them.
            camera: the size and opening of all.
            eye: (k, 3), metres.
            target: (k, 3).
            up: (3,), of all.
        """
        shape = len(scenes), camera.height, camera.width
        rgb, depth, identity = np.empty((*shape, 3), np.uint8), np.empty(shape, np.float32), np.empty(shape, np.int32)
        for k, (things, place, aim) in enumerate(zip(scenes, np.asarray(eye), np.asarray(target), strict=True)):
            view = view_of(camera, place, aim, up)
            layers = self._cleared(things, camera.width, camera.height)
            draw(self.library.meshes, things, 0, len(things.mesh), view, SUN, layers, True)
            resolve(things, layers, SUN, camera.far_m, _WHITE, rgb[k], depth[k], identity[k])
        return rgb, depth, identity

    def picture(
        self,
        things: Instances,
        casters: Instances,
        camera: Camera,
        eye: ArrayLike,
        target: ArrayLike,
        shaded_about: ArrayLike,
        up: ArrayLike = (0.0, 0.0, 1.0),
    ) -> NDArray[np.uint8]:
        """A picture (h, w, 3) for people: sky, four samples a pixel, shadows.

        Args:
            things: what stands in the scene.
            casters: what of it throws shadows; the shadows of the last call's arrays are kept.
            camera: its size and opening.
            eye: (3,), metres.
            target: (3,), what is in the middle of the picture.
            shaded_about: (3,), the middle of what throws shadows.
            up: (3,), direction of the picture's top.
        """
        meshes = self.library.meshes
        sun, sunlit = self._shadows(casters, np.asarray(shaded_about, np.float64))
        view = view_of(camera, eye, target, up)
        view = _twice(view)
        layers = self._cleared(things, 2 * camera.width, 2 * camera.height)
        draw(meshes, things, 0, len(things.mesh), view, SUN, layers, True)
        rgb = np.empty((camera.height, camera.width, 3), np.uint8)
        sky = np.linspace(*_SKY, camera.height)
        resolve_picture(things, layers, SUN, view, sun, sunlit, _DARK, sky, rgb)
        return rgb

    def _outdoors(self, things: Instances, camera: Camera, view: View, outdoors: Outdoors, identities: bool) -> Look:
        """``look`` with soil, sun and sky, and what the camera makes of them."""
        pose, meshes, light = pose_of(view), self.library.meshes, outdoors.light
        eye, ahead = pose.world_from_camera[:3, 3], pose.world_from_camera[:3, 2]
        middle = eye - eye[2] / ahead[2] * ahead
        sun = sun_view(light.towards, np.array([middle[0], middle[1], 0.0]), _NEAR_HALF_M, _NEAR_PIXELS)
        layers = self._cleared(things, _NEAR_PIXELS, _NEAR_PIXELS, "near sun")
        draw(meshes, things, 0, len(things.mesh), sun, light, layers, False)
        sunlit, view = layers.inverse, _twice(view)
        layers = self._cleared(things, 2 * camera.width, 2 * camera.height)
        draw(meshes, things, 0, len(things.mesh), view, light, layers, True)
        shape = camera.height, camera.width
        image, depth = np.empty((*shape, 3), np.float32), np.empty(shape, np.float32)
        identity = np.empty(shape if identities else (0, 0), np.int32)
        resolve_outdoor(
            things, layers, view, light, sun, sunlit, outdoors.dark, outdoors.soil, outdoors.shade, tile(), image,
            depth, identity,
        )  # fmt: skip
        optics = outdoors.optics
        image = blurred(image, taps(optics.lens_px, 0.0), taps(optics.lens_px, optics.moved_px))
        with np.errstate(over="ignore"):
            rgb = sensed(image, optics.gain, optics.read, optics.shot, optics.corner, stream(outdoors.seed))
        return Look(Frame(rgb, depth, pose), identity)

    def _shadows(self, casters: Instances, middle: Array) -> tuple[View, NDArray[np.float32]]:
        """The sun's view about a place (3,), and how far before its far end it meets something."""
        if self._shaded is None or self._shaded[0] is not casters or np.any(self._shaded[1] != middle):
            sun = sun_view(SUN.towards, middle, _MAP_HALF_M, _MAP_PIXELS)
            small = casters.where(self.library.meshes.radius[casters.mesh] < _CASTER_M)
            layers = self._cleared(small, _MAP_PIXELS, _MAP_PIXELS, "sun")
            draw(self.library.meshes, small, 0, len(small.mesh), sun, SUN, layers, False)
            self._shaded = casters, middle.copy(), sun, layers.inverse
        return self._shaded[2], self._shaded[3]

    def _cleared(self, things: Instances, width: int, height: int, use: str = "eye") -> Layers:
        """Empty layers of a size, with room for everything."""
        meshes = self.library.meshes
        faces = int((meshes.first_face[things.mesh + 1] - meshes.first_face[things.mesh]).sum())
        vertices = self.library.largest
        if faces > len(self._owner):
            self._owner, self._light = np.empty(2 * faces, np.int32), np.empty((2 * faces, 4))
        if vertices > len(self._shine):
            self._point, self._shine = np.empty((vertices, 6)), np.empty(vertices)
        size = use, width, height
        if size not in self._layers:
            self._layers[size] = np.empty((height, width), np.float32), np.empty((height, width), np.int32)
        inverse, slot = self._layers[size]
        inverse.fill(0.0)
        slot.fill(-1)
        return Layers(inverse, slot, self._owner, self._light, self._point, self._shine)


def _twice(view: View) -> View:
    """A view of twice the size each way; the four samples lie about the one that a camera's frame would take."""
    return view._replace(focal=2.0 * view.focal, centre_x=2.0 * view.centre_x + 0.5, centre_y=2.0 * view.centre_y + 0.5)


@cache
def level_colour(colour: tuple[float, ...]) -> NDArray[np.uint8]:
    """Colour (3,), not to be written to, that level ground of a colour in [0, 1] has in the light."""
    towards, base = SUN.towards, np.floor(255.0 * np.asarray(colour[:3]))
    mirrored = max(0.0, 2.0 * towards[2] - towards[2])
    shine = (towards[2] + SUN.specular * mirrored * mirrored / SUN.diffuse) * SUN.diffuse
    lit = np.minimum(255.0, base * (SUN.ambient + shine * SUN.colour)).astype(np.uint8)
    lit.setflags(write=False)
    return lit
