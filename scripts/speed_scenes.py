"""The scenes whose pictures ``speed.py`` times: every camera, and what people are shown."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import gymnasium as gym
import numpy as np

from fieldgym.perception.frames import Camera
from fieldgym.simulation.tiny import TinyWorld

Timed = tuple[str, float, Callable[[], object], Callable[[], object]]
"""Name, target in milliseconds, a picture drawn by the package, the same scene drawn by PyBullet."""


def picture_scenes() -> Iterator[Timed]:
    """Each camera's scene and each task's picture; what one needs is made and freed as it is reached."""
    for scenario, target_ms in (("pots", 2.0), ("row", 3.5), ("row-dense", 5.0)):
        env = _made("SafflowerPicking", scenario)
        env.view.look()
        scene = env.view._scene
        p = scene.parameters
        eye = [scene._cart_x_m + p.camera_ahead_m, 0.0, p.motor_height_m + p.camera_above_motors_m]
        yield from _beside(f"picker's camera, {scenario}", target_ms, scene, scene.look, _down(scene._eye, eye, "y"))
        yield from _people(f"picker, {scenario}", scene)
    env = _made("LaserWeeding", "load-1.25")
    view = env.view
    scene = view.camera_scene()
    view.show_strip(scene)
    place = np.array([1.0, 0.0, 0.87]), np.array([1.05, 0.05])
    front, tool = (lambda: scene.look_front(1.0)), (lambda: scene.look_tool(*place))
    front()
    grown = "plants", "soil"
    eye = [1.0 + env.core.config.cart.camera_ahead_m, 0.0, scene.eye_m]
    yield from _beside("weeders' front camera, load-1.25", 0.8, scene, front, _down(scene.front, eye, "x"), *grown)
    slant = scene.tool, place[0], np.array([*place[1], 0.02]), (1.0, 0.0, 0.0)
    yield from _beside("laser's tool camera", 0.25, scene, tool, slant, *grown)
    view.frame()
    yield from _people("laser weeding", view._stage)
    env = _made("HoeWeeding", "dense")
    env.view.frame()
    yield from _people("hoe weeding, dense", env.view._stage)
    env = _made("ProduceSorting", "load-1.25")
    env.view.take(9)
    scene = env.view._scene
    eye = [env.core.config.belt.camera_x_m, 0.0, scene._top + 0.52]
    yield from _beside("sorter's camera", 0.6, scene, scene.look, _down(scene._eye, eye, "x"))
    yield from _people("sorting", scene)
    env = _made("TrayTransplanting", "fill")
    env.view.frame()
    scene = env.view._scene
    scene.stage.put("row", scene._laid("source", scene._lines["source"].offsets_m()[3] - 0.16, -0.30, -0.02))
    eye, groups = [-0.16, scene._centre_m["source"], 1.75], ("room", "machine", "row")
    look = _down(scene._eye, eye, "x")
    yield from _beside("tray camera, source row", 1.2, scene, lambda: scene.look("source", 3), look, *groups)
    env.view.frame()
    yield from _people("trays", scene)


def _made(name: str, scenario: str) -> Any:
    env: Any = gym.make(f"fieldgym/{name}-v0", scenario=scenario, backend="analytic", perception="model").unwrapped
    env.reset(seed=3)
    return env


def _down(camera: Camera, eye: list[float], up: str) -> tuple[Any, ...]:
    return camera, np.array(eye), np.array(eye) - [0.0, 0.0, 1.0], (1.0, 0.0, 0.0) if up == "x" else (0.0, 1.0, 0.0)


def _beside(
    name: str, target_ms: float, scene: Any, draw: Callable[[], object], view: tuple[Any, ...], *groups: str
) -> Iterator[Timed]:
    with TinyWorld(scene.stage.library, scene.stage.things(*groups)) as world:
        yield name, target_ms, draw, lambda: world.look(*view)


def _people(name: str, scene: Any) -> Iterator[Timed]:
    """A picture of 640 x 480, its shadows drawn anew each time, as in a video."""
    camera, eye = Camera(640, 480, np.deg2rad(40.0), 0.1, 12.0), (1.2, -2.0, 1.6)

    def draw() -> object:
        scene.stage._casters = None
        return scene.render(640, 480)

    with TinyWorld(scene.stage.library, scene.stage.things()) as world:
        yield (
            f"picture for people, {name}",
            24.0,
            draw,
            lambda: world.look(camera, eye, (0.0, 0.0, 0.5), (0.0, 0.0, 1.0), shadow=True),
        )
