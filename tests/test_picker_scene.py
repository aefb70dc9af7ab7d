"""The picker's camera, plants and detector: geometry to a fraction of a pixel, scenes that do not grow."""

from typing import Any

import cv2
import gymnasium as gym
import numpy as np
import pytest

from fieldgym.perception.blooms import BloomSettings, detect
from fieldgym.perception.frames import Camera, CameraPose, Frame
from fieldgym.rendering.instances import instances, upright_to
from fieldgym.rendering.plants import spiny_leaf, tuft
from fieldgym.rendering.shapes import box, capsule, cylinder, surface_of_revolution
from fieldgym.simulation.stage import Stage

ID = "fieldgym/SafflowerPicking-v0"


@pytest.fixture(scope="module")
def picker():
    env: Any = gym.make(ID, backend="analytic", perception="camera", render_mode="rgb_array").unwrapped
    env.reset(seed=0)
    yield env
    env.close()


def test_camera_geometry_is_right_to_a_fifth_of_a_pixel():
    camera, stage = Camera(480, 360, np.deg2rad(46.0), 0.1, 2.0), Stage()
    disc = stage.library.add(surface_of_revolution(np.array([0.03, 0.0]), np.zeros(2), 48))
    for place in ([0.0, 0.0, 0.0], [0.17, 0.11, 0.0], [-0.2, 0.05, 0.1], [0.1, -0.12, -0.05]):
        stage.put("disc", instances(disc, place, None, (1.0, 0.0, 0.0)))
        eye = np.array([0.0, 0.0, 0.6])
        frame = stage.look(camera, eye, eye - [0.0, 0.0, 1.0], np.array([0.0, 1.0, 0.0]))
        rows, columns = np.nonzero(frame.rgb[..., 0].astype(int) - frame.rgb[..., 2] > 60)
        focal, depth = frame.camera.intrinsics[0, 0], float(np.median(frame.depth_m[rows, columns]))
        pixel = np.array([columns.mean(), rows.mean(), 1.0])
        ray = np.linalg.solve(frame.camera.intrinsics, pixel)
        found = frame.camera.world_from_camera @ np.append(depth * ray, 1.0)
        assert depth == pytest.approx(0.6 - place[2], abs=5e-4)
        assert np.abs(found[:2] - place[:2]).max() < 0.2 * depth / focal


def test_heads_in_pots_are_found_where_they_are(picker):
    core = picker.core
    for seed in range(3):
        picker.reset(seed=seed)
        for stop in (0, 7, 14):
            core.state.pose[0, 0] = core.tables.look_pose[stop, 0]
            look = picker.view.look()
            blooms = detect(look)
            truth = core.state.head_position[0, :-1][core.head_exists[0]] + core.frame
            inside = truth[np.abs(truth[:, 0] - core.tables.stop_pose[stop, 0]) < 0.2]
            gaps = np.linalg.norm(inside[:, None] - blooms.position[None], axis=-1).min(axis=1)
            assert gaps.max() < 0.006


def test_a_camera_episode_is_repeatable_and_finds_most_heads(picker):
    results, info = [], {}
    for _ in range(2):
        picker.reset(seed=4)
        for _ in range(12):
            legal = np.flatnonzero(picker.action_masks())
            *_, info = picker.step(int(legal[1] if len(legal) > 1 else legal[0]))
        results.append(info["scorecard"])
    assert results[0] == results[1]
    assert results[0]["done"] >= 6


def test_new_fields_add_no_meshes(picker):
    picker.render()
    meshes = len(picker.view._scene.stage.library.sources)
    for seed in range(20):
        picker.reset(seed=seed)
    assert len(picker.view._scene.stage.library.sources) == meshes


def test_picking_takes_the_filaments_out_of_the_picture(picker):
    picker.reset(seed=1)
    core = picker.core
    before = int(core.state.remaining[0])
    picker.step(2)
    core.state.pose[0] = core.tables.look_pose[0]
    look = picker.view.look()
    blooms = detect(look)
    assert np.count_nonzero(np.abs(blooms.position[:, 0] - core.tables.stop_pose[0, 0]) < 0.22) == before - 1


def test_the_picture_shows_the_machine_and_flowers(picker):
    picker.reset(seed=2)
    frame = picker.render()
    assert frame.shape == (480, 640, 3) and frame.dtype == np.uint8
    hue = cv2.cvtColor(frame, cv2.COLOR_RGB2HSV)
    assert np.count_nonzero(cv2.inRange(hue, (0, 150, 120), (24, 255, 255))) > 300
    assert np.count_nonzero(cv2.inRange(hue, (35, 80, 40), (85, 255, 255))) > 1000


def test_recorded_frames_follow_the_decision(picker):
    frames: list[np.ndarray] = []
    picker.reset(seed=3)
    picker.record(frames.append, 2.0)
    *_, info = picker.step(1)
    picker.record(None)
    assert len(frames) == pytest.approx(2.0 * sum(info["phases_s"].values()), abs=4)
    assert not np.array_equal(frames[0], frames[-1])
    with pytest.raises(ValueError, match="frames_per_second"):
        picker.record(frames.append, 0.0)


def test_a_closed_scene_says_so():
    env: Any = gym.make(ID, backend="analytic", perception="camera").unwrapped
    env.reset(seed=0)
    view = env.view
    env.close()
    env.close()
    with pytest.raises(RuntimeError, match="closed"):
        view.frame()


def synthetic(discs: list[tuple[int, int, int]], depth_m: float = 0.5) -> Frame:
    """A look at flat discs (u, v, radius in pixels) of fresh filaments on leaves, 850 px focal length."""
    rgb = np.full((360, 480, 3), (60, 110, 45), np.uint8)
    depth = np.full((360, 480), 0.7, np.float32)
    for u, v, radius in discs:
        cv2.circle(rgb, (u, v), radius, (250, 165, 25), -1)
        cv2.circle(depth, (u, v), radius, depth_m, -1)
    intrinsics = np.array([[850.0, 0.0, 240.0], [0.0, 850.0, 179.0], [0.0, 0.0, 1.0]])
    return Frame(rgb, depth, CameraPose(intrinsics, np.diag([1.0, -1.0, -1.0, 1.0])))


def test_touching_heads_are_told_apart():
    blooms = detect(synthetic([(200, 180, 34), (262, 180, 34)]))
    assert len(blooms.stage) == 2
    assert sorted(blooms.position[:, 0]) == pytest.approx([-40 * 0.506 / 850, 22 * 0.506 / 850], abs=1.5e-3)


def test_what_is_too_small_too_far_or_green_is_no_head():
    assert len(detect(synthetic([(200, 180, 4)])).stage) == 0
    assert len(detect(synthetic([(200, 180, 34)], depth_m=0.9)).stage) == 0
    assert len(detect(synthetic([])).stage) == 0


@pytest.mark.parametrize(("colour", "stage"), [((250, 165, 25), 1), ((235, 80, 20), 2), ((110, 45, 25), 3)])
def test_colour_tells_the_stage(colour, stage):
    frame = synthetic([(200, 180, 34)])
    frame.rgb[(frame.rgb == (250, 165, 25)).all(axis=-1)] = colour
    assert detect(frame).stage.tolist() == [stage]
    assert BloomSettings().head_spread_m == 0.04785


def test_meshes_are_closed_where_they_should_be_and_normals_are_unit():
    for mesh in (box((0.1, 0.2, 0.3)), tuft(0.02, 0.02), spiny_leaf(0.1, 0.03, 0.01), capsule(0.01, 0.1)):
        assert np.allclose(np.linalg.norm(mesh.normals, axis=1), 1.0, atol=1e-6)
        assert mesh.triangles.max() < len(mesh.vertices)
    turned_rings = surface_of_revolution(np.array([0.0, 0.1, 0.1, 0.0]), np.array([0.0, 0.0, 0.2, 0.2]), 64)
    pill = np.pi * 0.01 * 0.2 + 4.0 / 3.0 * np.pi * 0.001
    for solid, wanted in (
        (turned_rings, np.pi * 0.01 * 0.2),
        (cylinder(0.1, 0.2, 64), np.pi * 0.01 * 0.2),
        (capsule(0.1, 0.2, 40, 64), pill),
    ):
        a, b, c = (solid.vertices[solid.triangles[:, i]] for i in range(3))
        assert np.sum(a * np.cross(b, c)) / 6.0 == pytest.approx(wanted, rel=6e-3)
    for ahead in ([0.3, -0.4, 0.2], [0.0, 0.0, -1.0]):
        turn = upright_to(ahead)[0]
        assert turn[:, 2] == pytest.approx(np.array(ahead) / np.linalg.norm(ahead))
        assert turn @ turn.T == pytest.approx(np.eye(3)) and np.linalg.det(turn) == pytest.approx(1.0)
