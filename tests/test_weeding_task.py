"""The weeding rules on strips that can be checked by hand, the aim against its own inverse, and the process."""

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fieldgym  # noqa: F401
from fieldgym.agents import make_policy
from fieldgym.envs.core import NominalExecutor
from fieldgym.envs.dice import draw_blocks
from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.drawing import Strip, draw_plants
from fieldgym.envs.weeding.field import strip
from fieldgym.envs.weeding.perception import PerceptionModel
from fieldgym.envs.weeding.process import dose
from fieldgym.envs.weeding.state import NOTHING, PAD, WAIT, T
from fieldgym.envs.weeding.timing import Place, approach, move_time, way_of, ways_of
from fieldgym.envs.weeding.tools.laser.aim import LaserArm, LaserReach, poses, spot
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.env import laser_core
from fieldgym.envs.weeding.tools.laser.process import (
    Burn,
    ProcessConfig,
)
from fieldgym.motion import QUINTIC
from fieldgym.simulation.weeder_model import WeederParameters

REACH = LaserReach()
ARM = LaserArm.of(REACH, early_s=0.4)
MIDDLE = Place(0.0, 0.0, 0.0)


def toy(weeds, crops=(), aim=None, **changes):
    """A core whose strip holds the given two-leaf broadleaves, which 20 J kill, and crop plants, which 15 J kill."""
    core = laser_core(WeedingConfig(**changes), PerceptionModel.perfect())
    process = ProcessConfig()
    luck = rank(20.0 / process.ed50_j, process.slope), rank(15.0 / process.crop_ed50_j, process.crop_slope)
    field: Any = strip(weeds, crops, luck=luck[0], crop_luck=luck[1])
    if aim is not None:
        along, across = np.array([aim]).T
        field = replace(field, reports=replace(field.reports, aim_along_m=along, aim_across_m=across))
    core.load(np.zeros(1, np.int64), core.stack([core.complete(field, np.random.default_rng(0))]))
    return core


def rank(ratio, slope):
    """Uniform luck of a plant that takes ``ratio`` times the dose which kills half of its kind."""
    return ratio**slope / (1.0 + ratio**slope)


def act(core, action):
    plan = core.plan(np.array([action]))
    return plan, core.apply(plan, NominalExecutor(core).execute(plan))


def test_a_shot_takes_move_correction_and_burn_and_the_cart_drives_on():
    core = toy([(0.0, 0.1), (0.1, -0.1)])
    cart, speed = float(core.state.cart[0]), core.config.speed_m_s
    # Both weeds are 0.45 m and 0.55 m ahead of the cart; the window begins at 0.35 m.
    assert not any(core.option_legal(0, option) for option in range(6))
    while not core.option_legal(0, 1):
        plan, result = act(core, 3 * core.config.slots)
        assert plan.kind[0] == WAIT and result.phases_s.sum() >= core.config.cart.moment_s - 1e-12
    waited = float(core.state.totals[0, T.time])
    assert core.state.cart[0] == pytest.approx(cart + speed * waited, abs=1e-12)
    plan, result = act(core, 1)
    move, wait, correct, burn, pause = result.phases_s[0]
    stroke = plan.target[0] - plan.start[0]
    assert move == pytest.approx(move_time(ARM, *stroke.tolist()), abs=1e-12)
    assert (correct, burn, pause) == (0.05, 75.0 / 200.0, 0.0)
    assert wait <= core.config.cart.early_s
    # The platform stands over ground, its lean meets the weed: at the end it is still within its travel.
    assert plan.target[0, 0] + plan.target[0, 1] == pytest.approx(0.0, abs=1e-12)
    assert abs(plan.target[0, 0] - core.state.cart[0]) <= REACH.travel_m + 1e-9
    # 75 J centred kill a tolerance of 20 J; reward terms by hand.
    elapsed = move + wait + 0.05 + 0.375
    assert result.rewards[0] == pytest.approx([1.0, 0.0, -0.05 * elapsed, -0.0005 * 75.0, 0.0])
    scores = dict(zip(core.score_names, core.scores()[0], strict=True))
    assert scores["net_rate"] == 0.5 and scores["missed"] == 1.0 and scores["joules_per_weed"] == 75.0
    assert scores["cycle_time_s"] == pytest.approx(waited + elapsed)


def test_doses_add_up_and_miss_with_distance():
    core = toy([(0.0, 0.0)], aim=(0.002, 0.0), process=replace(ProcessConfig(), dose_j=(12.0, 30.0, 200.0)))
    while not core.option_legal(0, 0):
        act(core, 3 * core.config.slots)
    _, result = act(core, 0)
    share = np.exp(-2.0 * 0.002**2 / (0.003**2 + ProcessConfig().meristem_m[int(core.state.plant_kind[0, PAD])] ** 2))
    assert core.state.plant_dose[0, PAD] == pytest.approx(12.0 * share)
    assert result.rewards[0, 0] == 0.0
    # What was shot at is off the list, whether it died or not.
    assert not core.observe()["action_mask"][0, :-1].any()


def test_a_crop_plant_beside_the_beam_dies():
    core = toy([(0.0, 0.0)], crops=[(0.004, 0.0)])
    while not core.option_legal(0, 2):
        act(core, 3 * core.config.slots)
    _, result = act(core, 1)
    dose = 75.0 * np.exp(-2.0 * 0.004**2 / (0.003**2 + 0.006**2))
    assert dose > 15.0 and result.rewards[0, 1] == -5.0
    assert core.state.totals[0, T.crop] == 1.0


def test_weeds_that_nobody_shoots_leave_and_count_as_missed():
    core = toy([(0.0, 0.1), (0.1, -0.1), (7.9, 0.0)])
    over = False
    while not over:
        _, result = act(core, 3 * core.config.slots)
        over = bool(result.terminated[0])
    scores = dict(zip(core.score_names, core.scores()[0], strict=True))
    assert scores["missed"] == 3.0 and scores["net_rate"] == 0.0 and scores["shots"] == 0.0
    assert core.state.cart[0] >= 7.9 + core.machine.front_m - 0.05


def test_an_illegal_shot_costs_time_and_nothing_else():
    core = toy([(0.0, 0.1)])
    plan, result = act(core, 7)
    assert plan.kind[0] == NOTHING and result.rewards[0, 0] == 0.0
    assert result.phases_s.sum() >= core.config.cart.illegal_s
    assert core.state.totals[0, T.illegal] == 1.0


def test_tracks_of_a_camera_stay_listed_until_they_leave_and_end_the_strip():
    core = laser_core(WeedingConfig(), None)
    core.reset_rows(np.zeros(1, np.int64), [np.random.default_rng(0)])
    wait = 3 * core.config.slots
    cart = core.config.scenario.strip_m - core.config.cart.unseen_m + 0.05
    core.state.place[0, 0] += cart - core.state.cart[0]
    core.state.cart[0] = cart
    report = np.array([[cart + 0.4, 0.0], [cart - core.machine.front_m - 0.01, 0.0], [cart + 0.3, 0.1]])
    kinds = np.zeros(3, np.int64)

    def receive():
        core.receive(0, report, kinds, kinds, np.ones(3), np.ones(3), np.zeros(3, bool))

    receive()
    assert core.state.slot_track[0, :3].tolist() == [2, 0, core.capacity]
    over, waits = False, 0
    while not over:
        # The camera's view has left the strip, but what it has seen is still to come.
        assert core.state.slot_track[0, 0] != core.capacity
        over = bool(act(core, wait)[1].terminated[0])
        receive()
        waits += 1
    assert core.state.cart[0] == pytest.approx(cart + 0.4 + core.machine.front_m, abs=0.02) and waits > 10


def test_slots_are_in_the_order_of_leaving_and_move_up():
    core = toy([(0.02 * i, 0.0) for i in range(30)], slots=4)
    assert core.state.slot_track[0].tolist() == [0, 1, 2, 3]
    while not core.option_legal(0, 3 * 1 + 0):
        act(core, 12)
    act(core, 3)
    assert core.state.slot_track[0].tolist() == [0, 2, 3, 4]


@settings(max_examples=60, deadline=None)
@given(lean=st.floats(-0.2, 0.2), across=st.floats(-0.2, 0.2), travel=st.floats(-0.2, 0.2), cart=st.floats(-5.0, 50.0))
def test_poses_put_the_spot_where_it_should_be(lean, across, travel, cart):
    beam = np.array([cart + travel, lean, across])
    pose = poses(REACH, beam, cart)
    assert spot(REACH, pose, cart) == pytest.approx([cart + travel + lean, across], abs=1e-9)


def test_everything_that_the_aim_may_command_is_within_the_mechanism():
    # Moves may overshoot the range along the row by 0.05 m.
    side = np.linspace(-1.0, 1.0, 11)
    ranges = side * (REACH.travel_m + 0.05), side * REACH.lean_m, side * REACH.half_width_m
    beam = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, 3)
    margins = WeederParameters().mechanism.margins(poses(REACH, beam, np.zeros(len(beam))))
    assert min(float(values.min()) for values in margins.values()) > 0.0


@settings(max_examples=40, deadline=None)
@given(along=st.floats(-0.5, 0.6), across=st.floats(-0.22, 0.22), speed=st.floats(0.02, 0.3))
def test_legal_shots_stay_within_the_travel_and_the_choice_of_the_lean_is_the_best(along, across, speed):
    for stand in (0.2, 0.425, 1.05):
        way = approach(ARM, stand, MIDDLE, 0.0, speed, along, across)
        if way.legal:
            start = way.carrier_m - speed * (way.move_s + way.wait_s)
            end = start - speed * stand
            assert way.carrier_m + way.lean_m == pytest.approx(along, abs=1e-12)
            assert start <= REACH.travel_m + 1e-9 and end >= -REACH.travel_m - 1e-9
            assert abs(way.lean_m) <= REACH.lean_m + 1e-12
        assert not way.legal or speed * stand <= 2.0 * REACH.travel_m


def test_the_lean_has_the_largest_smallest_margin_of_all():
    speed, stand, along = 0.1, 0.425, 0.12
    way = approach(ARM, stand, MIDDLE, 0.0, speed, along, 0.0)
    middle = along - speed * (REACH.expected_move_s + 0.5 * stand)
    half = REACH.travel_m - 0.5 * speed * stand

    def margin(lean):
        return np.minimum(1.0 - np.abs(lean) / REACH.lean_m, 1.0 - np.abs(middle - lean) / half)

    grid = np.linspace(-REACH.lean_m, REACH.lean_m, 20001)
    assert margin(way.lean_m) >= margin(grid).max() - 1e-12


def test_move_times_are_the_quintic_under_its_limits():
    stroke = np.array([0.1, -0.05, 0.2])
    by_hand = max(
        float(QUINTIC.duration(0.1, REACH.travel_velocity_m_s, REACH.travel_acceleration_m_s2)),
        float(QUINTIC.duration(0.2, REACH.lean_velocity_m_s, REACH.lean_acceleration_m_s2)),
    )
    assert move_time(ARM, *stroke.tolist()) == pytest.approx(by_hand)


@pytest.mark.parametrize(
    ("before", "after", "time_s"), [(0.1, 0.2, 0.5), (0.2, 0.1, 0.1), (0.1, 0.1, 1.0), (0.05, 0.2, 0.2)]
)
def test_the_cart_s_way_against_summation(before, after, time_s):
    way, last = way_of(before, after, 0.3, time_s)
    steps = np.linspace(0.0, time_s, 20001)
    velocity = before + np.clip(after - before, -0.3 * steps, 0.3 * steps)
    assert way == pytest.approx(float(np.sum((velocity[1:] + velocity[:-1]) / 2) * steps[1]), rel=1e-6)
    assert last == pytest.approx(velocity[-1])
    assert ways_of(before, after, 0.3, steps)[-1] == way


def test_the_published_dose_kills_95_percent():
    process = ProcessConfig()
    assert process.response.chance(54.0, 0, 1) == pytest.approx(0.95)
    assert process.response.half_of(1, 2) == pytest.approx(process.ed50_j * 3.0 * 1.75)
    labels = process.response.labels()
    assert (np.diff(labels, axis=1) >= 0).all() and labels[0].tolist() == [0, 1, 2]


def test_a_shot_reaches_all_that_grows_there_and_nothing_else():
    """Doses of one shot in a dense tuft against the formula over every plant of the field."""
    rng = np.random.default_rng(4)
    tuft = 0.05 + np.sort(rng.normal(0.0, 0.002, 12))
    core = toy([(float(x), float(y)) for x, y in zip(tuft, rng.normal(0.0, 0.0015, 12), strict=True)])
    while not core.option_legal(0, 3 * 5 + 2):
        act(core, 3 * core.config.slots)
    plan, _ = act(core, 3 * 5 + 2)
    burn = Burn.of(ProcessConfig())
    offset = core.state.plant[0] - plan.aim[0]
    expected = [dose(burn, 2, x, y, kind) for (x, y), kind in zip(offset, core.state.plant_kind[0], strict=True)]
    assert np.count_nonzero(core.state.plant_dose[0] > 1.0) > 5
    assert core.state.plant_dose[0] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("tier", ["load-1.0", "load-1.0-even", "dense"])
def test_fields_have_the_density_and_the_clumping_that_their_tier_says(tier):
    scenario = SCENARIOS[tier]
    generators = [np.random.default_rng(seed) for seed in range(300)]
    law = Strip.of(scenario)
    plants = draw_plants(law, *draw_blocks(generators, law.random_numbers))
    counts = plants.exists.sum(axis=1)
    mean = scenario.density_per_m2 * scenario.strip_m * scenario.band_m
    assert counts.mean() == pytest.approx(mean, rel=4.0 * counts.std() / np.sqrt(300) / mean)
    # Counts on quadrats 0.2 m long: a Poisson field has variance = mean, a clustered one more.
    quadrats = np.floor(plants.weed[..., 0] / 0.2)
    table = np.stack([(plants.exists & (quadrats == q)).sum(axis=1) for q in range(int(scenario.strip_m / 0.2))])
    ratio = table.var() / table.mean()
    assert (0.9 < ratio < 1.1) if scenario.clumped == 0.0 else ratio > 1.5
    assert counts.max() < scenario.max_weeds
    assert np.all(np.diff(np.where(plants.exists, plants.weed[..., 0], 1e3), axis=1) >= 0.0)


def test_the_field_is_the_same_whatever_the_perception_and_the_worlds_beside():
    first = laser_core(WeedingConfig(), PerceptionModel.perfect())
    other = laser_core(WeedingConfig(), PerceptionModel.measured("classical", "easy"), 3)
    first.reset_rows(np.zeros(1, np.int64), [np.random.default_rng(7)])
    other.reset_rows(np.arange(3), [np.random.default_rng(seed) for seed in (5, 7, 9)])
    assert np.array_equal(first.state.plant[0], other.state.plant[1])
    assert np.array_equal(first.state.plant_tolerance[0], other.state.plant_tolerance[1])


@pytest.mark.parametrize("scenario", sorted(SCENARIOS))
def test_every_tier_runs(scenario):
    env = gym.make("fieldgym/LaserWeeding-v0", backend="analytic", scenario=scenario)
    _, info = env.reset(seed=0)
    for _ in range(20):
        info = env.step(int(info["action_mask"].argmax()))[-1]
    assert info["scorecard"]["weeds"] > 20


def test_the_load_is_what_its_name_says():
    for name, scenario in SCENARIOS.items():
        config = WeedingConfig(scenario=scenario)
        load = scenario.density_per_m2 * scenario.weedy_m * config.speed_m_s * config.service_s
        assert load == pytest.approx(scenario.offered_load, rel=0.02), name


@pytest.mark.parametrize("policy", ["random", "fifo", "edf", "nearest", "shortest-dwell", "kill-per-second"])
def test_policies_choose_legal_actions_and_beat_chance(policy):
    env = gym.make_vec(
        "fieldgym/LaserWeeding-v0", num_envs=6, vectorization_mode="vector_entry_point", scenario="load-1.0"
    )
    rule = make_policy(policy, env, seed=1)
    observation, info = env.reset(seed=0)
    for _ in range(60):
        action = rule.act(observation)
        assert np.all(observation["action_mask"][np.arange(6), action] == 1)
        observation, _, _, _, info = env.step(action)
    assert np.all(info["scorecard"]["illegal"] == 0.0) and info["scorecard"]["done"].sum() > 0


def test_looking_ahead_beats_the_deadline_and_chance_under_load():
    """With full depth and width it serves every weed of a small backlog that can be served; FIFO loses some."""
    results = {}
    for policy in ("receding-horizon", "edf", "random"):
        env = gym.make_vec(
            "fieldgym/LaserWeeding-v0",
            num_envs=8,
            vectorization_mode="vector_entry_point",
            scenario="load-1.6",
            perception="perfect",
            autoreset_mode="Disabled",
        )
        rule = make_policy(policy, env, seed=1)
        observation, info = env.reset(seed=0)
        over = np.zeros(8, bool)
        net = np.zeros(8)
        while not over.all():
            observation, _, end, cut, info = env.step(rule.act(observation))
            ended = (end | cut) & ~over
            net[ended] = info["scorecard"]["net_rate"][ended]
            over |= ended
        results[policy] = net.mean()
    assert results["receding-horizon"] > results["edf"] > results["random"]


def test_speed_variant_changes_speed_by_notches_within_its_range():
    env: Any = gym.make("fieldgym/LaserWeedingSpeed-v0", backend="analytic", scenario="load-1.0")
    env.reset(seed=0)
    core = env.unwrapped.core
    wait, block = core.base_actions - 1, core.base_actions
    before = float(core.state.set_speed[0])
    for _ in range(30):
        env.step(2 * block + wait)
    assert core.state.set_speed[0] == pytest.approx(core.config.cart.speed_range_m_s[1])
    for _ in range(2):
        env.step(block + wait)
    assert core.state.set_speed[0] == pytest.approx(core.config.cart.speed_range_m_s[1] - 0.04)
    assert core.state.speed[0] > before
