"""What the picker's camera sees follows from the field alone: not from fields, pictures or cart moves before."""

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from fieldgym.envs.safflower.scene import Looks, PickerScene
from fieldgym.perception.blooms import Blooms, detect
from fieldgym.simulation.picker_model import PickerParameters

PARAMETERS = PickerParameters()
PARKED = (0.5 * PARAMETERS.five_bar.base_m, -0.28)
AHEAD_M = PARAMETERS.camera_ahead_m


def field(stages: tuple[int, ...] = (1, 2, 3), occluded: tuple[bool, ...] = (False, False, False)) -> Looks:
    """Two plants in a row with three heads in the middle of the window, well apart."""
    return Looks(
        head_position=np.array([[AHEAD_M - 0.12, 0.05, 0.86], [AHEAD_M, -0.06, 0.84], [AHEAD_M + 0.13, 0.03, 0.82]]),
        head_stage=np.array(stages),
        head_spread_m=np.full(3, 0.04785),
        head_plant=np.array([0, 0, 1]),
        head_occluded=np.array(occluded),
        plant_base=np.array([[AHEAD_M - 0.07, 0.0, 0.0], [AHEAD_M + 0.10, 0.0, 0.0]]),
        plant_height_m=np.array([0.88, 0.85]),
        crown_m=np.array([0.25, 0.25]),
        potted=False,
    )


@pytest.fixture(scope="module")
def scene() -> Iterator[PickerScene]:
    scene = PickerScene(PARAMETERS)
    yield scene
    scene.close()


def blooms(scene: PickerScene, shown: Looks) -> Blooms:
    scene.load(shown)
    scene.set_machine(0.0, PARKED)
    look = scene.look()
    found = detect(look)
    order = np.argsort(found.position[:, 0])
    return Blooms(found.position[order], found.stage[order], found.spread_m[order], found.confidence[order])


def test_a_look_is_the_same_after_another_field_a_picture_and_a_drive(scene):
    scene.load(field())
    scene.set_machine(0.0, PARKED)
    first = scene.look()
    scene.render(64, 48)
    again = scene.look()
    scene.set_picked(1)
    scene.load(replace(field((2, 2, 1)), head_position=field().head_position + np.array([0.05, 0.02, -0.03])))
    scene.set_machine(1.5, PARKED)
    scene.look()
    scene.load(field())
    scene.set_machine(0.0, PARKED)
    returned = scene.look()
    for other in (again, returned):
        assert np.array_equal(first.rgb, other.rgb)
        assert np.array_equal(first.depth_m, other.depth_m)


def test_two_scenes_see_the_same(scene):
    scene.load(field())
    scene.set_machine(0.0, PARKED)
    with_history = scene.look()
    fresh = PickerScene(PARAMETERS)
    fresh.load(field())
    fresh.set_machine(0.0, PARKED)
    assert np.array_equal(with_history.rgb, fresh.look().rgb)
    fresh.close()


def test_free_heads_are_found_within_two_millimetres_with_their_stages(scene):
    found = blooms(scene, field())
    assert found.stage.tolist() == [1, 2, 3]
    error = found.position - field().head_position
    assert np.linalg.norm(error[:, :2], axis=1).max() < 2e-3
    assert np.abs(error[:, 2]).max() < 2e-3
    assert found.spread_m == pytest.approx(0.04785, rel=0.12)
    assert found.confidence.min() > 0.85


def test_buds_and_picked_heads_have_no_filaments(scene):
    assert blooms(scene, field((0, 1, 0))).stage.tolist() == [1]
    scene.set_picked(1)
    look = scene.look()
    assert len(detect(look).stage) == 0


def test_a_leaf_over_a_head_lowers_the_confidence_and_hardly_misplaces_it(scene):
    free, hidden = blooms(scene, field()), blooms(scene, field(occluded=(True, False, False)))
    assert len(hidden.stage) == 3
    assert hidden.confidence[0] < free.confidence[0] - 0.2
    assert hidden.confidence[1:] == pytest.approx(free.confidence[1:], abs=0.02)
    assert np.linalg.norm((hidden.position - field().head_position)[0, :2]) < 3e-3


def test_the_cart_carries_the_camera(scene):
    ahead, still = np.array([0.7, 0.0, 0.0]), field()
    moved = replace(still, head_position=still.head_position + ahead, plant_base=still.plant_base + ahead)
    here = blooms(scene, field())
    scene.load(moved)
    scene.set_machine(0.7, PARKED)
    look = scene.look()
    there = detect(look)
    assert np.sort(there.position[:, 0]) - 0.7 == pytest.approx(np.sort(here.position[:, 0]), abs=1e-3)


def test_a_closed_scene_says_what_to_do():
    scene = PickerScene(PARAMETERS)
    scene.load(field())
    scene.close()
    scene.close()
    for act in (scene.look, scene.render, lambda: scene.set_machine(0.0, PARKED)):
        with pytest.raises(RuntimeError, match="make a new one"):
            act()
