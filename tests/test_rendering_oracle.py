"""The package's scenes through our renderer and through PyBullet's: whom pixels show, how far it is, what is found."""

from typing import Any

import cv2
import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.perception import blooms, trays, weeds
from fieldgym.simulation.stage import Stage
from fieldgym.simulation.tiny import TinyWorld


def env(name: str, **settings: Any) -> Any:
    made: Any = gym.make(f"fieldgym/{name}-v0", backend="analytic", perception="model", **settings).unwrapped
    made.reset(seed=3)
    return made


def compared(stage: Any, view: tuple[Any, ...], *groups: str) -> tuple[float, float, float, float]:
    """Share of equal identities off edges, median and 99th percentile of depth error, share of equal colours."""
    number = 0
    for name in groups or tuple(stage._groups):
        things = stage._groups[name]
        stage.put(name, things._replace(identity=np.arange(number, number + len(things.mesh), dtype=np.int32)))
        number += len(things.mesh)
    own, tiny = stage.seen(*view, *groups), by_pybullet(stage, *view, *groups)
    edges = cv2.dilate(own.identity.astype(np.float32), np.ones((3, 3))) != cv2.erode(
        own.identity.astype(np.float32), np.ones((3, 3))
    )
    error = np.abs(own.frame.depth_m - tiny.frame.depth_m)[~edges]
    assert 0.2 < (~edges).mean() < 1.0
    same = (own.identity == tiny.identity)[~edges].mean()
    return same, np.median(error), np.percentile(error, 99), (own.frame.rgb == tiny.frame.rgb).all(axis=-1).mean()


def straight(scene: Any, camera: Any, eye: np.ndarray, up: tuple[float, float, float]) -> tuple[Any, ...]:
    return camera, eye, eye - np.array([0.0, 0.0, 1.0]), up


def by_pybullet(stage: Any, camera: Any, eye: Any, target: Any, up: Any, *groups: str) -> Any:
    with TinyWorld(stage.library, stage.things(*groups)) as world:
        return world.look(camera, eye, target, up)


def look_both(look: Any) -> list[Any]:
    own = look()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Stage, "look", lambda *view: by_pybullet(*view).frame)
        return [own, look()]


@pytest.mark.parametrize("scenario", ["pots", "row"])
def test_the_pickers_camera(scenario):
    picker = env("SafflowerPicking", scenario=scenario)
    picker.view.look()
    scene = picker.view._scene
    found = [blooms.detect(frame) for frame in look_both(scene.look)]
    assert len(found[0].stage) > 0 and found[0].stage.tolist() == found[1].stage.tolist()
    assert np.abs(found[0].position - found[1].position).max() < 1e-5
    eye = np.array([scene._cart_x_m + scene.parameters.camera_ahead_m, 0.0, scene.parameters.motor_height_m + 0.15])
    same, median, most, colours = compared(scene.stage, straight(scene, scene._eye, eye, (0.0, 1.0, 0.0)))
    assert same >= 0.999 and median < 2e-6 and most < 1e-5 and colours > 0.99


@pytest.mark.parametrize("side", ["source", "target"])
def test_the_tray_cameras(side):
    task = env("TrayTransplanting", scenario="replug")
    task.view._follow()
    scene, line = task.view._scene, task.view._lines[side]
    cells = trays.Cells(scene.cells_m(side), line.tray.pitch_m, task.view._lines["source"].tray.pitch_m)
    found = [trays.detect(frame, cells) for frame in look_both(lambda: scene.look(side, 2))]
    assert np.array_equal(found[0], found[1])
    along = line.offsets_m()[2] + (-0.160)
    scene.stage.put("row", scene._laid(side, along, -0.30, -0.02))
    eye = np.array([-0.160, scene._centre_m[side], 1.75])
    view = straight(scene, scene._eye, eye, (1.0, 0.0, 0.0))
    same, median, most, colours = compared(scene.stage, view, "room", "machine", "row")
    # Cells' edges run exactly through samples: there both are right.
    assert same >= 0.999 and median < 2e-6 and most < 1e-5 and colours > 0.99


def test_the_weeders_cameras():
    """Without ground, which is painted: plants, clods, stones, moss."""
    weeder = env("LaserWeeding", scenario="dense")
    scene = weeder.view.camera_scene()
    weeder.view.show_strip(scene)
    scene.plant_around(1.0)
    front = straight(scene, scene.front, np.array([1.3, 0.0, 0.85]), (1.0, 0.0, 0.0))
    tool = scene.tool, np.array([1.0, 0.0, 0.87]), np.array([1.03, 0.08, 0.02]), (1.0, 0.0, 0.0)
    for view in (front, tool):
        same, median, most, colours = compared(scene.stage, view, "plants", "soil", "ground")
        assert same >= 0.999 and median < 3e-6 and most < 1e-5 and colours > 0.9995
    frames = look_both(lambda: scene.stage.look(*front, "plants", "soil", "ground"))
    found = [weeds.detect(frame) for frame in frames]
    assert len(found[0].position) > 5
    assert np.abs(found[0].position - found[1].position).max() < 1e-5


def test_the_sorters_camera():
    sorter = env("ProduceSorting", scenario="clumped-1.25")
    scene = sorter.view._scene
    sorter.view.take(9)
    eye = np.array([sorter.core.config.belt.camera_x_m, 0.0, scene._top + 0.52])
    same, median, most, colours = compared(scene.stage, straight(scene, scene._eye, eye, (1.0, 0.0, 0.0)))
    # Light is worked out at corners here, at every pixel there: some pixels of produce differ by a few levels.
    assert same >= 0.999 and median < 2e-6 and most < 1e-5 and colours > 0.85
