"""The weeder's cameras on rendered strips, their tracks in the rules, the statistical cameras, pictures for people."""

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.envs.dice import draw_blocks
from fieldgym.envs.weeding.config import SCENARIOS, CartConfig
from fieldgym.envs.weeding.drawing import Strip, draw_plants
from fieldgym.envs.weeding.eyes import TOOL_SETTINGS
from fieldgym.envs.weeding.gaps import LOOKED_AT, crop_gaps, weed_gaps
from fieldgym.envs.weeding.perception import PerceptionModel
from fieldgym.envs.weeding.scene import SOIL
from fieldgym.envs.weeding.sighting import Cameras, draw_tracks
from fieldgym.envs.weeding.state import FAR_M
from fieldgym.envs.weeding.tools.hoe.process import HoeProcessConfig
from fieldgym.envs.weeding.tools.laser.calibration import KEPT, MATCH_M, factors, kept, match
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.scene import WeederScene
from fieldgym.motion.orientation import axes, from_euler
from fieldgym.perception.weeds import detect
from fieldgym.rendering.renderer import GroundLook, level_colour

SCENARIO = SCENARIOS["load-1.0"]
EASY = PerceptionModel.measured("classical", "easy")
STRIP = 7.5e-6
"""Look of the strip whose number is 7."""


@pytest.fixture(scope="module")
def scene():
    config = WeedingConfig(pictures="easy")
    made = WeederScene(config, config.parameters)
    yield made
    made.close()


def show(scene, weeds, crop=((5.0, 0.0),)):
    """Put weeds (x, y, species, stage) and crop plants into a scene."""
    table = np.array(weeds, float).reshape(-1, 4)
    kinds = table[:, 2:].astype(np.int64)
    scene.load(table[:, :2], kinds[:, 0], kinds[:, 1], np.linspace(0.1, 0.9, len(table)), np.array(crop), STRIP)


def look(scene, cart_m=-0.85):
    frame = scene.look_front(cart_m)
    return detect(frame)


KINDS = [(x, y, s, g) for s, y in ((0, 0.11), (1, -0.11)) for g, x in ((0, -0.1), (1, 0.0), (2, 0.1))]


def test_the_front_camera_sees_each_kind_of_weed_for_what_it_is_and_where_it_stands(scene):
    show(scene, KINDS)
    found = look(scene)
    for x, y, species, stage in KINDS:
        gap = np.hypot(*(found.position - [x, y]).T)
        nearest = int(gap.argmin())
        assert gap[nearest] < 0.0035
        assert (found.species[nearest], found.stage[nearest]) == (species, stage)
    assert not found.crop.any()


def test_a_weed_beside_a_crop_plants_leaves_is_seen_and_the_crop_plant_is_one(scene):
    show(scene, [(0.0, 0.062, 0, 1)], crop=[(0.0, 0.0)])
    found = look(scene)
    assert found.crop.sum() == 1
    assert np.hypot(*found.position[found.crop][0]) < 0.012
    weeds = found.position[~found.crop]
    assert np.hypot(*(weeds - [0.0, 0.062]).T).min() < 0.008


def test_painted_ground_looks_like_drawn_ground(scene):
    show(scene, KINDS, crop=[(0.2, 0.0)])
    scene.plant_around(0.0)
    eye = np.array([0.0, 0.05, 0.85])
    still = GroundLook(SOIL, 1.0, 0, 0.0, 0)
    view = scene.front, eye, np.array([0.02, 0.1, 0.0]), (1.0, 0.0, 0.0)
    painted = scene.stage.look(*view, "plants", "soil", ground=still).rgb
    drawn = scene.stage.look(*view, "plants", "soil", "ground").rgb
    # Where a clod dips into the ground, rounding may decide differently.
    assert (painted != drawn).any(axis=-1).mean() < 1e-4
    assert (painted == level_colour(SOIL)).all(axis=-1).mean() > 0.5


def test_one_side_is_in_the_shade_and_everything_is_noisy(scene):
    show(scene, [])
    rgb = scene.look_front(-0.85).rgb.astype(float)
    edge = int((0.35 + 0.3 * np.sin(7.0)) * scene.front.width)
    soil = level_colour(SOIL).astype(float)
    assert np.median(rgb[:, : edge - 2], axis=(0, 1)) == pytest.approx(0.55 * soil, abs=1.0)
    assert np.median(rgb[:, edge + 2 :], axis=(0, 1)) == pytest.approx(soil, abs=1.0)
    # Half of the noise of 4 lies within 0.67 of its deviation; clods and crop plants are outliers.
    assert np.median(np.abs(rgb[:, edge + 2 :, 0] - soil[0])) == pytest.approx(0.67 * 4.0, abs=0.4)


def test_the_same_place_gives_the_same_picture_whatever_was_looked_at_before(scene):
    show(scene, KINDS)
    before = look(scene)
    look(scene, 2.0)
    assert np.array_equal(before.position, look(scene).position)


def test_the_tool_camera_finds_the_stem_within_its_gate(scene):
    show(scene, KINDS)
    reach = scene.config.reach
    for x, y, species, stage in KINDS:
        told = np.array([x + 0.007, y - 0.002])
        centre = np.array([told[0] - 0.02, 0.0, reach.target_height_m + reach.gap_m])
        frame = scene.look_tool(centre, told)
        found = detect(frame, settings=TOOL_SETTINGS)
        assert np.hypot(*(found.position - [x, y]).T).min() < 0.003, (species, stage)


@pytest.fixture(scope="module")
def env():
    made = gym.make(
        "fieldgym/LaserWeeding-v0",
        backend="analytic",
        perception="camera",
        eyes="classical",
        pictures="easy",
        render_mode="rgb_array",
    ).unwrapped
    yield made
    made.close()


@pytest.mark.slow
def test_camera_tracks_reach_the_rules_and_shots_are_corrected_and_not_repeated(env):
    _, info = env.reset(seed=4)
    state = env.core.state
    shots = []
    for _ in range(200):
        # The first candidate that can be reached, at its lowest dose; else wait.
        action = int(info["action_mask"].argmax())
        slot = action // 3
        track = int(state.slot_track[0, slot]) if slot < env.core.config.slots else -1
        _, _, over, cut, info = env.step(action)
        if track >= 0:
            shots.append(state.track_aim[0, track].copy())
            assert track not in state.slot_track[0]
        if over or cut or len(shots) == 4:
            break
    assert len(shots) == 4
    truth = state.plant[0, : env.core.weeds_end]
    error = [np.hypot(*(truth - shot).T).min() for shot in shots]
    assert np.median(error) < 0.003


@pytest.mark.slow
def test_one_seed_is_one_sequence_of_observations(env):
    def run():
        observation, info = env.reset(seed=11)
        seen = [observation["candidates"]]
        for _ in range(12):
            observation, *_, info = env.step(int(info["action_mask"].argmax()))
            seen.append(observation["candidates"])
        return np.array(seen)

    assert np.array_equal(run(), run())


@pytest.mark.slow
def test_pictures_show_the_field_the_front_camera_and_the_gauge(env):
    _, info = env.reset(seed=4)
    first = env.render()
    assert first.shape == (480, 720, 3) and first.dtype == np.uint8
    wait = env.core.base_actions - 1
    while int(info["action_mask"].argmax()) == wait:
        *_, info = env.step(wait)
    frames = []
    env.record(frames.append, 4.0)
    try:
        *_, info = env.step(int(info["action_mask"].argmax()))
    finally:
        env.record(None)
    assert info["scorecard"]["shots"] == 1.0
    assert len(frames) == np.ceil(4.0 * sum(info["phases_s"].values()))
    assert all(frame.shape == first.shape for frame in frames)
    # White frames about the small pictures; the green gauge.
    assert np.array_equal(frames[-1][8, -20], [245, 245, 245])
    assert np.abs(frames[-1].astype(int) - first).mean() > 1.0


@pytest.mark.slow
def test_pictures_follow_the_blade_into_the_ground_and_show_what_it_did(monkeypatch):
    hoe = HoeProcessConfig()
    env: Any = gym.make(
        "fieldgym/HoeWeeding-v0",
        backend="analytic",
        perception="perfect",
        pictures="easy",
        overrides={"scenario.strip_m": 2.0},
        render_mode="rgb_array",
    )
    _, info = env.reset(seed=0)
    view = env.unwrapped.view
    tips: list[float] = []
    pictures: list[np.ndarray] = []
    while not info["action_mask"][2]:
        info = env.step(int(info["action_mask"].size - 1))[-1]

    env.render()
    scene, parameters = view._stage, view._stage._machine.parameters
    move = scene.set_machine

    def watched(cart_m: float, pose: Any) -> None:
        # The tool leans with the platform: its axis is the third of the platform's.
        up_m = pose[2] - parameters.tool_m * axes(from_euler(np.asarray(pose)[3:]))[2, 2]
        place.append(float(up_m + parameters.origin_height_m))
        move(cart_m, pose)

    def keep(picture: np.ndarray) -> None:
        pictures.append(picture)
        tips.append(place[-1])

    place: list[float] = []
    monkeypatch.setattr(scene, "set_machine", watched)
    env.unwrapped.record(keep, 12.0)
    env.step(2)
    env.unwrapped.record(None)
    assert len(pictures) > 10 and pictures[0].shape[2] == 3
    # Down to the depth and up again.
    assert min(tips) == pytest.approx(-hoe.depth_m[2], abs=2e-3)
    assert tips[0] == pytest.approx(hoe.clearance_m) and max(tips) <= hoe.clearance_m + 1e-6
    assert np.mean(np.any(pictures[0] != pictures[-1], axis=-1)) > 0.01
    assert env.render().shape == pictures[0].shape
    env.close()
    env.close()


def drawn(perception, worlds=200):
    generators = [np.random.default_rng(seed) for seed in range(worlds)]
    law, cameras = Strip.of(SCENARIO), Cameras.of(SCENARIO, CartConfig(), perception)
    room = SCENARIO.max_weeds
    blocks = draw_blocks(generators, (*law.random_numbers, *cameras.random_numbers(room)))
    plants = draw_plants(law, blocks[0], blocks[1])
    return plants, draw_tracks(cameras, plants, blocks[2], blocks[3])


def test_perfect_perception_reports_every_weed_where_and_what_it_is():
    plants, tracks = drawn(PerceptionModel.perfect(), 20)
    assert np.array_equal(tracks.count, plants.exists.sum(axis=1))
    for row in range(20):
        n = tracks.count[row]
        assert np.allclose(tracks.report[row, :n], plants.weed[row, :n])
        assert np.array_equal(tracks.aim[row, :n], tracks.report[row, :n])
        assert np.array_equal(tracks.species[row, :n], plants.species[row, :n])
        assert np.array_equal(tracks.stage[row, :n], plants.stage[row, :n])
        assert np.all(tracks.confidence[row, :n] == 1.0)
        assert np.all(tracks.report[row, n:] == FAR_M)


def test_the_model_finds_as_many_weeds_as_its_chances_say():
    model = replace(EASY, false_rates=(0.0, 0.0, 0.0))
    plants, tracks = drawn(model)
    chance = np.zeros(plants.exists.shape)
    for row, there in enumerate(plants.exists):
        weed, kind = plants.weed[row][there], (plants.species[row][there], plants.stage[row][there])
        reach_m = np.array(model.reach_m)[kind]
        at_crop = np.searchsorted(model.crop_gap_m, crop_gaps(plants.crop[row], weed) - reach_m)
        at_weed = np.searchsorted(model.weed_gap_m, weed_gaps(weed, reach_m, LOOKED_AT))
        alone = (at_crop == len(model.crop_gap_m)) & (at_weed == len(model.weed_gap_m))
        odds = np.array(model.odds_near_crop)[at_crop] * np.array(model.odds_near_weed)[at_weed]
        recall = np.where(alone, np.array(model.recall)[0][kind], np.array(model.recall)[1][kind])
        chance[row, : len(weed)] = recall * odds / (1.0 - recall + recall * odds)
    assert np.all((chance >= 0.0) & (chance <= 1.0))
    spread = np.sqrt((chance * (1.0 - chance)).sum())
    # A few tracks end outside the treated band: they are not reported.
    assert tracks.count.sum() == pytest.approx(chance.sum(), abs=4.0 * spread + 0.02 * chance.sum())
    assert tracks.count.max() <= Cameras.of(SCENARIO, CartConfig(), model).capacity(SCENARIO.max_weeds)


def test_false_tracks_come_at_their_rates():
    model = replace(EASY, recall=(((0.0,) * 3,) * 2,) * 2, false_rates=(0.05, 0.02, 1.0))
    _, tracks = drawn(model, 400)
    area = SCENARIO.strip_m * SCENARIO.band_m
    mean = 0.05 * SCENARIO.density_per_m2 * area + 0.02 * (SCENARIO.crops - 3) + area
    assert not tracks.real.any()
    assert tracks.count.mean() == pytest.approx(mean, rel=0.08)


def test_reports_lie_in_order_within_the_band():
    _, tracks = drawn(EASY, 50)
    for row in range(50):
        n = tracks.count[row]
        assert np.all(np.diff(tracks.report[row, :n, 0]) >= 0.0)
        assert np.all(np.abs(tracks.report[row, :n, 1]) <= 0.5 * SCENARIO.band_m)
        assert np.all(tracks.report[row, n:] == FAR_M)


def test_nearest_weed_is_brute_force():
    rng = np.random.default_rng(3)
    weed = rng.uniform([0.0, -0.2], [2.0, 0.2], (4, 40, 2))
    weed = np.take_along_axis(weed, np.argsort(weed[..., 0], axis=1)[..., None], axis=1)
    gap = np.hypot(*(weed[:, :, None] - weed[:, None]).transpose(3, 0, 1, 2)) + 9.0 * np.eye(40)
    assert np.allclose([weed_gaps(one, np.zeros(40), 40) for one in weed], gap.min(axis=2))
    # What stands within 2 cm is found although only the next six along are looked at.
    near = gap.min(axis=2) < 0.02
    found = np.array([weed_gaps(one, np.zeros(40), LOOKED_AT) for one in weed])
    assert np.allclose(found[near], gap.min(axis=2)[near])


def test_an_empty_class_of_sightings_is_refused():
    with pytest.raises(ValueError, match="every class"):
        _ = replace(PerceptionModel.perfect(), false_sightings=((), (), ())).false_table


def test_tracks_and_weeds_are_matched_one_to_one_nearest_first():
    truth = np.array([[0.0, 0.0], [0.012, 0.0]])
    assert sorted(match(np.array([[0.005, 0.0], [0.001, 0.0]]), truth)) == [(0, 1), (1, 0)]
    assert match(np.array([[0.1, 0.0]]), truth) == []
    # A track that lies off its weed but whose aim is on it belongs to it.
    assert match(np.array([[0.1, 0.0]]), truth, np.array([[0.011, 0.0]])) == [(0, 1)]


def test_fitted_odds_predict_as_many_hits_in_each_bin_as_there_were():
    rng = np.random.default_rng(1)
    kind, gap = rng.integers(0, 6, 6000), rng.integers(0, 3, 6000)
    true = np.linspace(1.0, 20.0, 6)[kind] * np.array([0.1, 0.5, 1.0])[gap]
    found = rng.random(6000) < true / (1.0 + true)
    odds = factors((kind, gap), (6, 3), found)
    product = odds[0][kind] * odds[1][gap]
    chance = product / (1.0 + product)
    for values, number in ((kind, 6), (gap, 3)):
        for i in range(number):
            # Half a success and half a failure are added to each of the nine bins.
            assert chance[values == i].sum() == pytest.approx(found[values == i].sum(), abs=4.5)
    assert odds[1] == pytest.approx([0.1, 0.5, 1.0], rel=0.2)
    assert odds[1][-1] == 1.0


def test_kept_sightings_keep_the_distribution_of_the_errors_and_are_never_none():
    rng = np.random.default_rng(2)
    rows = rng.standard_t(2.0, (900, 8))
    sample = np.array(kept(rows))
    assert len(sample) == KEPT
    error, all_errors = np.hypot(sample[:, 2], sample[:, 3]), np.hypot(rows[:, 2], rows[:, 3])
    for share in (25, 50, 75, 90):
        assert np.percentile(error, share) == pytest.approx(np.percentile(all_errors, share), rel=0.05)
    assert kept(np.zeros((0, 8))) == [[0.0] * 8]


def test_the_shipped_fit_names_what_it_was_measured_on():
    model = EASY
    assert len(model.sightings) == 18 and len(model.false_sightings) == 3
    for row in model.sighting_table.rows:
        # A track is a weed's when its place or its aim is near it.
        assert min(np.hypot(row[0], row[1]), np.hypot(row[2], row[3])) <= MATCH_M + 1e-4
        assert row[4] in (0.0, 1.0) and row[5] in (0.0, 1.0) and row[6] in (0.0, 1.0, 2.0)
    false = model.false_table.rows
    assert 0.0 < false[:, 7].mean() < model.sighting_table.rows[:, 7].mean() < 1.0
