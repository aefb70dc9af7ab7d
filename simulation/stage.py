"""A scene to look at: groups of instances of one library, drawn for cameras and for people."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from contextvars import ContextVar
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..perception.frames import Camera, Frame
from ..rendering.instances import Instances, joined
from ..rendering.library import MeshLibrary
from ..rendering.outdoor import Outdoors
from ..rendering.renderer import GroundLook, Look, Renderer
from ..rendering.shots import MACHINE, Shot, Viewpoint

SceneT = TypeVar("SceneT", bound="Scene")


class Spectator(NamedTuple):
    """Somebody who wants to have scenes, not pictures of them.

    Attributes:
        scene: takes a stage, the camera of a picture for people, where it stands and what is in its middle, (3,) each.
        look: takes what one of the machine's own cameras saw, and the camera.
    """

    scene: Callable[[Stage, Camera, ArrayLike, ArrayLike], None]
    look: Callable[[Camera, Frame], None]


_SPECTATOR: ContextVar[Spectator | None] = ContextVar("spectator", default=None)


@contextmanager
def watched(spectator: Spectator) -> Iterator[None]:
    """While the block runs, in its thread, pictures for people are not painted: the spectator is shown the scene.

    Whoever asked for a picture gets an empty one. What machines see stays as it is.
    """
    token = _SPECTATOR.set(spectator)
    try:
        yield
    finally:
        _SPECTATOR.reset(token)


class Stage:
    """Instances in groups by name, each replaced as a whole, and what is seen of them.

    Attributes:
        library: the meshes.
    """

    def __init__(self) -> None:
        """Start empty."""
        self.library = MeshLibrary()
        self._renderer = Renderer(self.library)
        self._groups: dict[str, Instances] = {}
        self._shadowless: set[str] = set()
        self._all: Instances | None = None
        self._casters: Instances | None = None
        self._open = True

    def another(self) -> Stage:
        """A stage with the same meshes that shows what this one shows, until either is changed."""
        one = copy.copy(self)
        one._groups, one._shadowless = dict(self._groups), set(self._shadowless)
        return one

    def put(self, group: str, things: Instances, *, shadow: bool = True) -> None:
        """Have these in a group, and nothing else; marks for people throw no ``shadow``.

        Raises:
            RuntimeError: the scene was closed.
        """
        self._require_open()
        self._groups[group] = things
        self._all = self._casters = None
        if not shadow:
            self._shadowless.add(group)

    @property
    def groups(self) -> Mapping[str, Instances]:
        """What stands in each group; a group that has not changed is the same object as before."""
        return self._groups

    def things(self, *groups: str) -> Instances:
        """What stands in some groups, or in all.

        Raises:
            RuntimeError: the scene was closed.
        """
        self._require_open()
        if groups:
            return joined([self._groups[name] for name in groups if name in self._groups])
        if self._all is None:
            self._all = joined(list(self._groups.values()))
        return self._all

    def look(
        self,
        camera: Camera,
        eye: ArrayLike,
        target: ArrayLike,
        up: ArrayLike,
        *groups: str,
        ground: GroundLook | Outdoors | None = None,
    ) -> Frame:
        """What a camera sees of some groups, or of all; ``seen`` says whom its pixels show."""
        frame = self._renderer.look(self.things(*groups), camera, eye, target, up, ground, identities=False).frame
        spectator = _SPECTATOR.get()
        if spectator is not None:
            spectator.look(camera, frame)
        return frame

    def seen(
        self,
        camera: Camera,
        eye: ArrayLike,
        target: ArrayLike,
        up: ArrayLike,
        *groups: str,
        ground: GroundLook | Outdoors | None = None,
    ) -> Look:
        """A frame with identities; see ``Renderer.look``.

        Args:
            camera: its size and opening.
            eye: (3,), metres.
            target: (3,), metres.
            up: (3,), direction.
            *groups: those to draw; all where none is named.
            ground: painted ground.
        """
        return self._renderer.look(self.things(*groups), camera, eye, target, up, ground)

    def picture(
        self,
        camera: Camera,
        eye: ArrayLike,
        target: ArrayLike,
        about: ArrayLike,
        up: ArrayLike = (0.0, 0.0, 1.0),
    ) -> NDArray[np.uint8]:
        """A picture (h, w, 3) for people, with sky and with the shadows of what is about a place (3,)."""
        spectator = _SPECTATOR.get()
        if spectator is not None:
            spectator.scene(self, camera, eye, target)
            return np.zeros((camera.height, camera.width, 3), np.uint8)
        things = self.things()
        if self._casters is None:
            self._casters = self.things(*(name for name in self._groups if name not in self._shadowless))
        return self._renderer.picture(things, self._casters, camera, eye, target, about, up)

    def close(self) -> None:
        """Look no more; idempotent."""
        self._open = False

    def _require_open(self) -> None:
        if not self._open:
            raise RuntimeError("the scene is closed: make a new one")


class Scene:
    """What a task's scenes share. What they hold is replaced, never written to, so that one may become two.

    Attributes:
        stage: what is drawn.
        usual_px: width and height of a picture for people that nobody has asked for in another size.
    """

    stage: Stage
    usual_px: tuple[int, int] = (640, 480)

    def viewpoint(self, camera: str) -> Viewpoint:
        """Where a camera for people stands; a task's assembly names those that there are."""
        raise NotImplementedError

    def render(self, width: int | None = None, height: int | None = None, camera: str = MACHINE) -> NDArray[np.uint8]:
        """Picture (height, width, 3) for people; of a size that is given by half the other half follows."""
        size = Shot(width, height).sized(self.usual_px)
        eye, middle, lit_about, view_rad, up = self.viewpoint(camera)
        return self.stage.picture(Camera(*size, view_rad, 0.05, 16.0), eye, middle, lit_about, up)

    def another(self: SceneT) -> SceneT:
        """A scene with the same meshes, for another world."""
        one = copy.copy(self)
        one.stage = self.stage.another()
        return one

    def close(self) -> None:
        """Look no more; idempotent."""
        self.stage.close()
