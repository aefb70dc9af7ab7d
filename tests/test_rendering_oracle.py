"""The package's scenes through our renderer and through PyBullet's: whom pixels show, how far it is, what is found."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.perception import blooms, trays, weeds
from fieldgym.scripts.beside_tiny import both, by_tiny, likeness
from fieldgym.scripts.takes import takes

COLOURS = {"picker": 0.99, "laser": 0.9995, "hoe": 0.9995, "sorter": 0.85, "trays": 0.99}
"""Where light is worked out at corners here and at every pixel there, pixels differ by a few levels."""


def env(name: str, **settings: Any) -> Any:
    made: Any = gym.make(f"fieldgym/{name}-v0", backend="analytic", perception="model", **settings).unwrapped
    made.reset(seed=3)
    return made


def look_both(look: Any) -> list[Any]:
    own = look()
    with by_tiny():
        return [own, look()]


@pytest.mark.parametrize("group", COLOURS)
def test_cameras_see_what_pybullet_draws(group):
    for take in takes(group):
        if take.name.endswith("row-dense"):
            break  # more of what the row shows
        if take.people:
            continue
        alike = likeness(*both(take))
        # Cells' edges run exactly through samples: there both are right.
        assert alike.identities >= 0.999 and alike.depth_m < 2e-6 and alike.depth_99_m < 1e-5, take.name
        assert alike.colours > COLOURS[group], take.name


@pytest.mark.parametrize("scenario", ["pots", "row"])
def test_the_pickers_camera_finds_the_same(scenario):
    picker = env("SafflowerPicking", scenario=scenario)
    picker.view.look()
    found = [blooms.detect(frame) for frame in look_both(picker.view._scene.look)]
    assert len(found[0].stage) > 0 and found[0].stage.tolist() == found[1].stage.tolist()
    assert np.abs(found[0].position - found[1].position).max() < 1e-5


@pytest.mark.parametrize("side", ["source", "target"])
def test_the_tray_cameras_find_the_same(side):
    task = env("TrayTransplanting", scenario="replug")
    task.view._follow()
    scene, line = task.view._scene, task.view._lines[side]
    cells = trays.Cells(scene.cells_m(side), line.tray.pitch_m, task.view._lines["source"].tray.pitch_m)
    found = [trays.detect(frame, cells) for frame in look_both(lambda: scene.look(side, 2))]
    assert np.array_equal(found[0], found[1])


def test_the_weeders_front_camera_finds_the_same():
    """With soil, shade and noise: the same plants, for hardly a pixel is another one."""
    weeder = env("LaserWeeding", scenario="dense", eyes="classical", pictures="easy")
    scene = weeder.view.camera_scene()
    weeder.view.show_strip(scene)
    frames = look_both(lambda: scene.look_front(0.45))
    assert (frames[0].rgb == frames[1].rgb).all(axis=-1).mean() > 0.999
    found = [weeds.detect(frame) for frame in frames]
    assert len(found[0].position) > 5
    assert np.abs(found[0].position - found[1].position).max() < 1e-5
