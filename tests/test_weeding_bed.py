"""Crop rows within the working width, ridges under them and a taller crop: where plants stand, what Z costs."""

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.envs.weeding.bed_config import BedConfig
from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.eyes import ClassicalEyes
from fieldgym.envs.weeding.gaps import crop_gaps, crop_index, passed
from fieldgym.envs.weeding.ridges import Ridges, ridge_heights
from fieldgym.envs.weeding.state import FAR_M, PAD
from fieldgym.envs.weeding.timing import Place
from fieldgym.envs.weeding.tools.hoe import arm as hoe_arm
from fieldgym.envs.weeding.tools.hoe import motors as hoe_motors
from fieldgym.envs.weeding.tools.hoe.config import HoeWeedingConfig
from fieldgym.envs.weeding.tools.laser import aim
from fieldgym.envs.weeding.tools.laser import motors as laser_motors
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.scene import WeederScene
from fieldgym.envs.weeding.view import FrontCamera
from fieldgym.kernels.config import ConfigError
from fieldgym.motion import QUINTIC

LASER, HOE = "fieldgym/LaserWeeding-v0", "fieldgym/HoeWeeding-v0"
RIDGED = SCENARIOS["ridged"]
CREST_M = 0.10
"""Where a ridge is highest; the furrow lies in the middle."""


def core_of(env_id: str, worlds: int, **kwargs: Any) -> Any:
    env: Any = gym.make_vec(
        env_id, worlds, vectorization_mode="vector_entry_point", scenario="ridged", perception="model", **kwargs
    )
    env.reset(seed=5)
    return env.unwrapped.core


def test_crop_stands_in_two_rows_and_weeds_in_bands_about_them():
    core = core_of(LASER, 200)
    crop, weed = core.state.plant[:, core.weeds_end :], core.state.plant[:, PAD : core.weeds_end - PAD]
    assert crop.shape[1] == 2 * 53
    for side in (-1.0, 1.0):
        row = crop[(crop[..., 1] * side > 0.0).nonzero()]
        assert len(row) == 200 * 53
        assert abs(row[:, 1] - 0.10 * side).max() <= 3.0 * 0.008
        assert row[:, 1].mean() == pytest.approx(0.10 * side, abs=0.0005)
    assert (np.diff(crop[..., 0], axis=1) >= 0.0).all()
    across = weed[..., 1][weed[..., 0] < FAR_M]
    beside = abs(abs(across) - 0.10)
    assert beside.max() <= 0.06 and beside.max() > 0.059
    # As many to the square metre as everywhere, on two bands of 0.12 m.
    assert core.state.weeds.mean() == pytest.approx(40.0 * 8.0 * 0.24, rel=0.04)


@pytest.mark.parametrize(
    ("rows", "band_m", "weedy_m"),
    [(1, None, 0.40), (1, 0.10, 0.10), (2, 0.12, 0.24), (2, 0.30, 0.40), (3, 0.10, 0.20), (2, 0.25, 0.40)],
)
def test_what_weeds_grow_on_is_cut_to_the_width_and_counted_once(rows, band_m, weedy_m):
    scenario = replace(SCENARIOS["load-1.0"], row_m=0.20, bed=BedConfig(rows=rows, row_band_m=band_m))
    assert scenario.weedy_m == pytest.approx(weedy_m, abs=1e-12)
    config = WeedingConfig(scenario=scenario)
    load = 40.0 * weedy_m * config.speed_m_s * config.service_s
    assert load == pytest.approx(1.0, abs=0.01)


@pytest.mark.parametrize("rows", [1, 2, 3])
def test_the_nearest_crop_plant_is_that_of_any_row_and_none_in_reach_is_left_out(rows):
    rng, bed = np.random.default_rng(rows), BedConfig(rows=rows)
    along = np.repeat(0.16 * np.arange(20), rows) + 0.015 * rng.uniform(-3.0, 3.0, 20 * rows)
    crop = np.column_stack([along, np.tile(0.15 * (np.arange(rows) - 0.5 * (rows - 1)), 20)])
    crop = crop[np.argsort(along)]
    places = np.column_stack([np.sort(rng.uniform(0.5, 2.5, 500)), rng.uniform(-0.2, 0.2, 500)])
    apart = np.hypot(*(places[:, None] - crop[None]).transpose(2, 0, 1))
    assert np.array_equal(crop_gaps(crop, places), apart.min(axis=1))
    for place, far in zip(places, apart, strict=True):
        index = crop_index(crop, place[0], passed(crop, place[0], 0), bed.beside)
        near = np.flatnonzero(far <= 0.04)
        assert (abs(near - index) <= bed.beside).all()


def test_a_ridge_is_highest_under_its_row_and_ends_without_an_edge():
    ridges = Ridges.of(RIDGED)
    heights = ridge_heights(ridges, np.array([0.0, 0.02, CREST_M, -CREST_M, 0.14, 0.06, 0.18, 0.2]))
    half = 0.02 * 0.75**2
    assert heights + 0.045 == pytest.approx([0.0, 0.0, 0.02, 0.02, half, half, 0.0, 0.0], abs=1e-12)


@pytest.mark.parametrize("tool", ["laser", "hoe"])
def test_going_up_a_ridge_costs_what_the_time_law_says(tool):
    """Limits along are so low that no move across takes as long."""
    if tool == "laser":
        reach = replace(aim.LaserReach(), travel_velocity_m_s=0.05, travel_acceleration_m_s2=0.5)
        arm: Any = aim.LaserArm.of(reach, 0.4, Ridges.of(RIDGED))
        way, limits = aim.approach, (0.05, 0.5)
        along = way(arm, 0.1, Place(0.0, 0.0, 0.0), 0.0, 0.1, 0.05, 0.0)
        start = Place(along.carrier_m, along.lean_m, 0.0)
        up = way(arm, 0.1, start, 0.0, 0.1, 0.05, CREST_M)
        level = way(arm._replace(ridges=Ridges(0.0, 0.1, 0.0, 1, 0.4)), 0.1, start, 0.0, 0.1, 0.05, CREST_M)
        assert level.move_s < 0.2
        assert up.move_s == pytest.approx(float(QUINTIC.duration(0.02, *limits)), abs=1e-12) and up.move_s > 0.7
    else:
        # Of the hoe, the same limits hold along, across and up: a high ridge takes longer to climb.
        steep = replace(RIDGED, bed=replace(RIDGED.bed, ridge_m=0.2, ridge_width_m=0.1))
        arm = hoe_arm.HoeArm.of(hoe_arm.HoeReach(), 0.4, Ridges.of(steep))
        up = hoe_arm.approach(arm, 0.1, Place(0.05, 0.0, 0.05), 0.0, 0.1, 0.05, CREST_M)
        assert up.move_s == pytest.approx(float(QUINTIC.duration(0.2, 1.0, 10.0)), abs=1e-12)


def test_waiting_from_a_ridge_sinks_into_the_furrow():
    """The way down alone, limits along being low; the hoe's way across is always longer."""
    core = core_of(LASER, 2, overrides={"reach.travel_acceleration_m_s2": 0.1})
    wait = np.full(2, core.base_actions - 1)
    core.state.place[:] = core.plan(wait).target
    core.state.place[:, 2] = CREST_M
    least_s = float(QUINTIC.duration(0.02, np.inf, 0.1))
    assert core.plan(wait).phases_s[:, 0] == pytest.approx([least_s, least_s], rel=1e-9)


def test_the_platform_keeps_its_height_over_ridge_and_crop_and_the_beam_its_spot():
    config = WeedingConfig(scenario=RIDGED)
    beam, cart = np.array([[2.05, 0.08, CREST_M], [2.05, 0.08, 0.0]]), np.array([2.0, 2.0])
    rise = ridge_heights(Ridges.of(RIDGED), beam[:, 2])
    pose = aim.poses(config.aim, beam, cart, rise)
    # 1.45 m to the level, 0.02 to the growing points, 0.85 and 10 mm for the crop, the ridge; the frame is higher.
    assert pose[:, 1] == pytest.approx([1.45 - 0.02 - 0.86 - 0.02 + 0.045, 1.45 - 0.02 - 0.86 + 0.045], abs=1e-12)
    assert aim.spot(config.aim, pose, cart, rise) == pytest.approx(
        np.column_stack([beam[:, 0] + 0.08, beam[:, 2]]), abs=1e-12
    )


def test_the_blade_passes_higher_and_takes_longer_down():
    config = HoeWeedingConfig(scenario=RIDGED)
    assert config.passing.clearance_m == pytest.approx(0.055 + 0.010 + 0.020, abs=1e-12)
    plunge = core_of(HOE, 1).process.work_s[:, 0]
    assert plunge == pytest.approx([float(QUINTIC.duration(0.085 + d, 1.0, 10.0)) for d in (0.012, 0.022, 0.035)])


def test_the_motors_of_the_shipped_machines_follow_the_ridges():
    for config, within in (
        (WeedingConfig(scenario=RIDGED), laser_motors.within_motors),
        (HoeWeedingConfig(scenario=RIDGED), hoe_motors.within_motors),
    ):
        assert within(config) == config  # type: ignore[arg-type]
    weak: Any = replace(WeedingConfig(scenario=RIDGED).machine, leg_force_limit_n=100.0)
    slow = laser_motors.within_motors(WeedingConfig(scenario=RIDGED, machine=weak)).reach
    assert slow.travel_acceleration_m_s2 < 10.0 and slow.gap_m == 0.85


@pytest.mark.parametrize(
    ("kind", "changes", "words"),
    [
        (
            WeedingConfig,
            {"ridge_m": 0.2},
            "ridge_m = 0.2: the legs do not hold the platform 0.380 m below",
        ),
        (WeedingConfig, {"crop_height_m": 0.6}, "scenario.bed.crop_height_m = 0.6: the legs do not hold"),
        (WeedingConfig, {"ridge_m": 0.0, "frame_m": 0.2}, "scenario.bed.crop_height_m = 0.05: the legs do not hold"),
        (HoeWeedingConfig, {"ridge_m": 0.05}, "ridge_m = 0.05: the arms do not hold the blade at 0.155 m"),
        (HoeWeedingConfig, {"crop_height_m": 0.2}, "scenario.bed.crop_height_m = 0.2: the arms do not hold the blade"),
    ],
)
def test_heights_that_are_out_of_reach_are_refused_in_one_line(kind, changes, words):
    with pytest.raises(ConfigError) as refused:
        kind(scenario=replace(SCENARIOS["load-1.0"], bed=BedConfig(**changes)))
    assert words in str(refused.value) and "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"rows": 3}, "bed.rows = 3: the outer rows stand 0.4 m beside the middle"),
        ({"rows": 2, "ridge_m": 0.02, "ridge_width_m": 0.5}, "bed.ridge_width_m = 0.5: ridges would overlap"),
    ],
)
def test_rows_that_do_not_fit_are_refused(changes, words):
    with pytest.raises(ConfigError, match=words.replace(".", r"\.")):
        replace(SCENARIOS["load-1.0"], bed=BedConfig(**changes))


def test_as_it_stands_nothing_is_raised_and_the_row_is_one():
    laser, hoe = WeedingConfig(), HoeWeedingConfig()
    assert laser.aim is laser.reach and hoe.passing is hoe.process
    assert laser.scenario.rows_m == (0.0,) and laser.scenario.weedy_m == 0.40 and laser.scenario.crops == 53


def test_the_neighbouring_rows_are_painted_beside_the_outer_ones():
    config = WeedingConfig(scenario=RIDGED)
    scene = WeederScene(config, config.parameters)
    own = np.array([[0.1, -0.1], [0.1, 0.1]])
    scene.load(np.zeros((0, 2)), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), own, 3.5e-6)
    scene.plant_around(0.0)
    assert np.unique(scene.stage.things("plants").shift[:, 1].round(9)).tolist() == [-0.3, -0.1, 0.1, 0.3]
    scene.close()


@pytest.mark.parametrize("env_id", [LASER, HOE])
def test_backends_agree_on_ridges(env_id):
    """Every decision of a short field: the same time, and the tool where it was sent, at its height over the ground."""
    # Over the growing points and the usual crop; over the ground, with the platform's own height over the blade.
    over_m = 0.02 + 0.86 if env_id == LASER else 0.085 + 0.040
    cards = {}
    for backend in ("analytic", "pybullet"):
        env: Any = gym.make(
            env_id,
            scenario="ridged",
            backend=backend,
            perception="model",
            overrides={"scenario.strip_m": 0.8},
            disable_env_checker=True,
        ).unwrapped
        for seed in (0, 1):
            _, info = env.reset(seed=seed)
            over, heights = False, []
            while not over:
                action = int(np.flatnonzero(info["action_mask"])[0])
                before = env.core.state.cart.copy()
                *_, terminated, truncated, info = env.step(action)
                over = terminated or truncated
                assert (env.core.state.cart > before).all()
                if backend == "pybullet":
                    machine = env.executor._machine
                    stands = machine._machine.point("platform")[2] if env_id == LASER else machine.platform()[0][2]
                    ground = ridge_heights(Ridges.of(RIDGED), env.core.state.place[:, 2])[0]
                    heights.append(stands - ground)
            cards[backend, seed] = info["scorecard"]
            if heights:
                assert np.array(heights) == pytest.approx(over_m, abs=5e-4) and len(heights) > 3
        env.close()
    for seed in (0, 1):
        one, other = cards["analytic", seed], cards["pybullet", seed]
        assert other["net_rate"] == pytest.approx(one["net_rate"], abs=0.01)
        assert other["duration_s"] == pytest.approx(one["duration_s"], rel=0.02)
    assert cards["analytic", 0]["done"] + cards["analytic", 1]["done"] > 0


def test_the_front_camera_knows_the_crop_of_both_rows():
    config = WeedingConfig(scenario=RIDGED, pictures="easy")
    scene = WeederScene(config, config.parameters)
    crop = np.array([[0.16 * i, across] for i in range(12) for across in (-CREST_M, CREST_M)])
    scene.load(np.zeros((0, 2)), np.zeros(0, np.int64), np.zeros(0, np.int64), np.zeros(0), crop, 3.5e-6)
    front = FrontCamera(scene, 0.0, 0.0, ClassicalEyes())
    front.drive(0.1)
    assert front.last is not None
    found = front.last[1]
    inside = abs(found.position[:, 1]) < 0.2
    assert np.count_nonzero(inside) >= 4 and found.crop[inside].all()
    scene.close()
