"""The pictures that are timed and compared: every camera's, and what people are shown of every task."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import ArrayLike

from fieldgym.perception.frames import Camera
from fieldgym.rendering.instances import Instances
from fieldgym.rendering.renderer import GroundLook
from fieldgym.simulation.stage import Stage

PEOPLE_MS = 24.0
_PLACE = np.array([1.0, 0.0, 0.87]), np.array([1.05, 0.05])
"""Where the laser's tool camera stands, and what it is told to look at."""


class View(NamedTuple):
    """Whence a picture was taken, and of what.

    Attributes:
        camera: its size and opening.
        eye: (3,), metres.
        target: (3,), metres.
        up: (3,), direction.
        things: what stood in the scene.
        ground: painted ground, if any.
    """

    camera: Camera
    eye: ArrayLike
    target: ArrayLike
    up: ArrayLike
    things: Instances
    ground: GroundLook | None = None

    @property
    def whence(self) -> tuple[Camera, ArrayLike, ArrayLike, ArrayLike]:
        """What a look is told first."""
        return self.camera, self.eye, self.target, self.up


class Take(NamedTuple):
    """A picture that can be taken again.

    Attributes:
        name: of the camera and its scene, or of the task whose picture it is.
        target_ms: what it should take at most.
        people: it is for people: sky, shadows, four samples a pixel.
        draw: draws it, and gives a frame, or a picture for people.
        stage: holds the meshes.
        view: whence it is taken.
    """

    name: str
    target_ms: float
    people: bool
    draw: Callable[[], Any]
    stage: Stage
    view: View


def takes(group: str | None = None) -> Iterator[Take]:
    """Those of one of ``GROUPS``, or of all; what one needs is made as it is reached, and freed behind it."""
    for source in GROUPS.values() if group is None else [GROUPS[group]]:
        yield from source()


def _picker() -> Iterator[Take]:
    for scenario, target_ms in (("pots", 2.0), ("row", 3.5), ("row-dense", 5.0)):
        view = _made("SafflowerPicking", scenario).view
        view.look()
        scene = view._scene
        yield _camera(f"picker's camera, {scenario}", target_ms, scene, scene.look)
        yield _people(f"picker, {scenario}", scene)


def _laser() -> Iterator[Take]:
    view = _made("LaserWeeding", "load-1.25").view
    scene = view.camera_scene()
    view.show_strip(scene)
    yield _camera("weeders' front camera, load-1.25", 0.8, scene, lambda: scene.look_front(1.0))
    yield _camera("laser's tool camera", 0.25, scene, lambda: scene.look_tool(*_PLACE))
    view.frame()
    yield _people("laser weeding", view._stage)
    view = _made("LaserWeedingSpeed", "dense").view
    view.frame()
    yield _people("laser weeding with speed, dense", view._stage)


def _hoe() -> Iterator[Take]:
    view = _made("HoeWeeding", "dense").view
    scene = view.camera_scene()
    view.show_strip(scene)
    yield _camera("hoe's front camera, dense", 0.8, scene, lambda: scene.look_front(-0.2))
    view.frame()
    yield _people("hoe weeding, dense", view._stage)


def _sorter() -> Iterator[Take]:
    view = _made("ProduceSorting", "load-1.25").view
    view.take(9)
    yield _camera("sorter's camera", 0.6, view._scene, view._scene.look)
    yield _people("sorting", view._scene)


def _trays() -> Iterator[Take]:
    view = _made("TrayTransplanting", "fill").view
    view.frame()
    scene = view._scene
    yield _camera("tray camera, source row", 1.2, scene, lambda: scene.look("source", 3))
    yield _camera("tray camera, target row", 1.2, scene, lambda: scene.look("target", 3))
    view.frame()
    yield _people("trays", scene)


def _made(name: str, scenario: str) -> Any:
    # Weeders' easy pictures are what the two engines draw alike; the others are painted after either.
    easy: dict[str, Any] = {"pictures": "easy"} if "Weeding" in name else {}
    env: Any = gym.make(
        f"fieldgym/{name}-v0", scenario=scenario, backend="analytic", perception="model", **easy
    ).unwrapped
    env.reset(seed=3)
    return env


def _camera(name: str, target_ms: float, scene: Any, draw: Callable[[], Any]) -> Take:
    stage: Stage = scene.stage
    views: list[View] = []

    def look(
        camera: Camera, eye: ArrayLike, target: ArrayLike, up: ArrayLike, *groups: str, ground: GroundLook | None = None
    ) -> Any:
        shown = groups if ground is None else (*groups, "ground")
        views.append(View(camera, eye, target, up, stage.things(*shown), ground))
        return Stage.look(stage, camera, eye, target, up, *groups, ground=ground)

    _overheard(stage, "look", look, draw)
    return Take(name, target_ms, False, draw, stage, views[-1])


def _people(name: str, scene: Any) -> Take:
    """A picture whose shadows are drawn anew each time, as in a video."""
    stage: Stage = scene.stage
    views: list[View] = []

    def picture(camera: Camera, eye: ArrayLike, target: ArrayLike, about: ArrayLike, up: ArrayLike) -> Any:
        views.append(View(camera, eye, target, up, stage.things()))
        return Stage.picture(stage, camera, eye, target, about, up)

    def draw() -> Any:
        stage._casters = None
        return scene.render(640, 480)

    _overheard(stage, "picture", picture, draw)
    return Take(name, PEOPLE_MS, True, draw, stage, views[-1])


def _overheard(stage: Stage, method: str, instead: Callable[..., Any], draw: Callable[[], Any]) -> None:
    """Take a picture while ``instead`` stands for a method of its stage."""
    setattr(stage, method, instead)
    try:
        draw()
    finally:
        delattr(stage, method)


GROUPS: dict[str, Callable[[], Iterator[Take]]] = {
    "picker": _picker,
    "laser": _laser,
    "hoe": _hoe,
    "sorter": _sorter,
    "trays": _trays,
}
