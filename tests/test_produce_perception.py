"""Produce in rendered images: what the detector finds against what lies there."""

import json
from pathlib import Path

import cv2
import numpy as np
import pytest

from fieldgym.envs.core import NominalExecutor
from fieldgym.envs.sorting import calibration
from fieldgym.envs.sorting.columns import ITEM, REWARD, TOTAL
from fieldgym.envs.sorting.config import SCENARIOS, BeltConfig, PerceptionModel, SortingConfig
from fieldgym.envs.sorting.core import SortingCore
from fieldgym.envs.sorting.drawing import centre_height_m
from fieldgym.envs.sorting.reports import wrapped
from fieldgym.envs.sorting.scene import OPEN_M, ShownItem, SorterScene, item_colour
from fieldgym.envs.sorting.view import SorterView, sensor_noise
from fieldgym.motion.orientation import axes, tilted
from fieldgym.perception.frames import Frame
from fieldgym.perception.produce import Belt, ProduceSettings, detect, produce_mask

BELT_M = SortingConfig().machine.sorter.belt_height_m


@pytest.fixture(scope="module")
def scene():
    made = SorterScene(SortingConfig())
    yield made
    made.close()


def lay(scene, key, x, y, shape, yaw=0.0, tilt=0.0, azimuth=0.0, fruit=False, ripeness=1.0):
    length, width, thickness = shape
    height = centre_height_m(length, width / length, thickness / length, yaw, tilt, azimuth)
    where = np.array([BeltConfig().camera_x_m + x, y, BELT_M + height])
    return ShownItem(key, where, tilted(tilt, azimuth, yaw), shape, item_colour(fruit, ripeness, 0.5))


def find(scene, items, noise=None):
    scene.set_items(items)
    look = scene.look()
    look = look if noise is None else sensor_noise(look, noise, 0)
    return detect(look, Belt(BELT_M))


@pytest.mark.parametrize("noise", [None, 3])
@pytest.mark.parametrize(
    ("yaw", "tilt", "azimuth"), [(0.0, 0.0, 0.0), (1.2, 0.0, 0.0), (-0.7, 0.25, 0.5), (0.4, 0.35, -2.0)]
)
def test_an_ellipsoid_is_found_where_and_how_it_lies(scene, yaw, tilt, azimuth, noise):
    shape = (0.066, 0.046, 0.035)
    seen = find(scene, [lay(scene, 1, 0.02, -0.06, shape, yaw, tilt, azimuth)], noise)
    truth = scene_centre(scene, shape, yaw, tilt, azimuth)
    assert len(seen.grade) == 1 and seen.grade[0] == 0
    assert seen.position[0] == pytest.approx(truth, abs=1.2e-3)
    assert abs(float(wrapped(seen.yaw - yaw)[0])) < np.deg2rad(2.5)
    lean = seen.tilt[0] * np.array([np.cos(seen.azimuth[0]), np.sin(seen.azimuth[0])])
    assert lean == pytest.approx(tilt * np.array([np.cos(azimuth), np.sin(azimuth)]), abs=np.deg2rad(5.0))
    assert seen.axes_m[0] == pytest.approx(shape, rel=0.05)


def scene_centre(scene, shape, yaw, tilt, azimuth):
    return lay(scene, 0, 0.02, -0.06, shape, yaw, tilt, azimuth).position


def test_the_mask_is_that_of_a_median_of_heights(scene):
    settings = ProduceSettings()
    scene.set_items([lay(scene, k, 0.03 * k - 0.1, 0.04 * k - 0.12, (0.066, 0.046, 0.035), 0.5 * k) for k in range(7)])
    rng, (_, depth, camera) = np.random.default_rng(1), scene.look()
    rgb = rng.integers(0, 256, (*depth.shape, 3), dtype=np.uint8)
    depth = depth + rng.normal(0.0, 0.003, depth.shape).astype(np.float32)
    (place, world), look = camera, Frame(rgb, depth, camera)
    v, u = np.mgrid[: depth.shape[0], : depth.shape[1]]
    ray = np.stack([(u - place[0, 2]) / place[0, 0], (v - place[1, 2]) / place[1, 1], np.ones(depth.shape)], axis=-1)
    height = (ray * depth[..., None].astype(float)) @ world[2, :3] + world[2, 3] - BELT_M
    colour = rgb.astype(int)
    warm = np.maximum(colour[..., 0], colour[..., 1]) - colour[..., 2] > settings.warm
    high = cv2.medianBlur(height.astype(np.float32), 5) > settings.lowest_m
    assert 1000 < np.count_nonzero(warm & ~high) and 1000 < np.count_nonzero(warm & high)
    expected = cv2.morphologyEx((warm & high).astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    assert np.array_equal(produce_mask(look, Belt(BELT_M), settings), expected)


def test_grades_follow_colour_and_size(scene):
    items = [
        lay(scene, 1, 0.0, -0.09, (0.072, 0.05, 0.04)),
        lay(scene, 2, 0.0, -0.03, (0.050, 0.036, 0.03)),
        lay(scene, 3, 0.0, 0.03, (0.056, 0.054, 0.042), fruit=True, ripeness=0.9),
        lay(scene, 4, 0.0, 0.09, (0.056, 0.054, 0.042), fruit=True, ripeness=0.1),
    ]
    seen = find(scene, items)
    assert seen.grade[seen.position[:, 1].argsort()].tolist() == [0, 1, 2, 3]


def test_touching_items_are_told_apart(scene):
    shape = (0.056, 0.054, 0.042)
    items = [lay(scene, k, 0.0, y, shape, fruit=True, ripeness=1.0) for k, y in enumerate((-0.055, 0.0, 0.0545))]
    seen = find(scene, items)
    assert np.sort(seen.position[:, 1]) == pytest.approx([-0.055, 0.0, 0.0545], abs=3e-3)


def test_an_empty_belt_and_cut_off_items_give_nothing(scene):
    assert len(find(scene, []).grade) == 0
    assert len(find(scene, [lay(scene, 1, 0.125, 0.0, (0.07, 0.05, 0.04))]).grade) == 0


def test_every_item_is_reported_once_and_belongs_to_an_image():
    core = SortingCore(SortingConfig(scenario=SCENARIOS["load-1.0"]), None)
    core.reset_rows(np.array([0]), [np.random.default_rng(2)])
    view = SorterView(core)
    core.state.totals[0, TOTAL.time_s] = 20.0
    view.sense()
    speed, belt = core.config.belt.speed_m_s, core.config.belt
    reported = core.state.report_item[0, core.state.queue[0, : core.state.queued[0]]]
    assert len(set(reported.tolist())) == len(reported) and (reported < core.config.scenario.max_items).all()
    x = speed * (20.0 - core.items[0, :, ITEM.passing_s])
    # Everything between the camera's last image and the end of the reach.
    there = np.flatnonzero((x > belt.camera_x_m + 0.16) & (x < 0.10))
    assert set(there.tolist()) <= set(reported.tolist())
    picture = view.frame()
    assert picture.shape == (480, 640, 3) and picture.std() > 20.0
    view.close()
    view.close()


def test_noise_is_the_same_for_the_same_image(scene):
    look = scene.look()
    first, again, other = (sensor_noise(look, 5, number) for number in (1, 1, 2))
    assert np.array_equal(first.rgb, again.rgb) and np.array_equal(first.depth_m, again.depth_m)
    assert not np.array_equal(first.rgb, other.rgb)


def test_the_shipped_fit_is_a_measurement_of_at_least_200_images():
    path = Path(calibration.__file__).parents[2] / "assets/perception/sorting.json"
    data = json.loads(path.read_text("utf-8"))
    model = PerceptionModel.measured()
    assert data["frames"] >= 200 and data["items"] >= 200
    assert model.recall == data["recall"] and 0.5 < model.recall <= 1.0
    assert np.asarray(model.confusion).sum(axis=1) == pytest.approx(1.0, abs=1e-3)
    counts = np.array(data["measured"]["confusion_counts"])
    assert counts.sum() + sum(data["measured"]["missed_by_grade"]) == data["items"]


def test_a_small_measurement_agrees_with_the_shipped_one():
    result, shipped = calibration.measure(12), PerceptionModel.measured()
    assert result["frames"] == 12 and result["recall"] >= 0.9
    assert max(result["position_sigma_m"]) < 3.0 * max(shipped.sigma_m) + 2e-4


@pytest.mark.parametrize("frames_per_second", [2.0, 25.0])
def test_what_is_carried_is_drawn_between_the_fingers_at_any_rate_of_pictures(monkeypatch, frames_per_second):
    core = SortingCore(SortingConfig(scenario=SCENARIOS["load-1.25"]), PerceptionModel.perfect())
    core.reset_rows(np.array([0]), [np.random.default_rng(4)])
    view, executor, sorter = SorterView(core), NominalExecutor(core), core.config.machine.sorter
    gaps: list[float] = []

    def off(time_s, way, row, carried=None, gap_m=OPEN_M):
        gaps.append(gap_m)
        tool = way.position[row] - sorter.tool_m * axes(way.turn[row])[:, 2] + [0.0, 0.0, sorter.origin_height_m]
        return np.zeros(3) if carried is None else carried.position - tool

    monkeypatch.setattr(view, "_draw", off)
    carried = 0
    for _ in range(12):
        plan = core.plan(np.array([0]))
        result = core.apply(plan, executor.execute(plan))
        if result.rewards[0, REWARD.placed] > 0.0:
            shown = np.array(list(view.frames(plan, result, frames_per_second)))
            carried += int(shown.any(axis=1).sum())
            # The item lies up to three sigma of the belt's slip beside the place where it is reported.
            assert np.linalg.norm(shown, axis=1).max() < 3.0 * core.config.belt.slip_sigma_m + 1e-3
    assert carried > 5 and min(gaps) < 0.9 * OPEN_M
    view.close()
