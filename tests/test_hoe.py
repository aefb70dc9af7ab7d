"""The hoe on strips that can be checked by hand: overlap, times, uprooting, crop loss; the machine beside the rules."""

from dataclasses import replace
from itertools import permutations, product
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fieldgym  # noqa: F401
from fieldgym.agents import make_policy, policy_names
from fieldgym.envs.core import NominalExecutor
from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.core import WeedingCore
from fieldgym.envs.weeding.field import strip
from fieldgym.envs.weeding.perception import PerceptionModel
from fieldgym.envs.weeding.process import dose
from fieldgym.envs.weeding.state import NOTHING, PAD, WAIT, T
from fieldgym.envs.weeding.timing import Place, approach, move_time
from fieldgym.envs.weeding.tools.hoe.arm import HoeArm, HoeReach
from fieldgym.envs.weeding.tools.hoe.config import HoeWeedingConfig
from fieldgym.envs.weeding.tools.hoe.env import hoe_core
from fieldgym.envs.weeding.tools.hoe.machine import poses, tip_way
from fieldgym.envs.weeding.tools.hoe.process import (
    HoeProcessConfig,
    Stir,
    circle_s,
    crop_loss,
)
from fieldgym.kernels.discs import covered_share
from fieldgym.motion import QUINTIC

ENV_ID = "fieldgym/HoeWeeding-v0"
HOE = HoeProcessConfig()
GENTLE, NORMAL, DEEP = range(3)


def toy(weeds, crops=(), tolerance_m=0.010, **changes) -> WeedingCore:
    """A core whose strip holds the given two-leaf broadleaves and crop plants, which 6 mm lose."""
    core = hoe_core(HoeWeedingConfig(**changes), PerceptionModel.perfect())
    luck = rank(tolerance_m / HOE.depth50_m, HOE.slope), rank(0.006 / HOE.crop_depth50_m, HOE.crop_slope)
    field = strip(weeds, crops, luck=luck[0], crop_luck=luck[1])
    core.load(np.zeros(1, np.int64), core.stack([core.complete(field, np.random.default_rng(0))]))
    return core


def rank(ratio, slope):
    """Uniform luck of a plant that takes ``ratio`` times the depth which uproots half of its kind."""
    return ratio**slope / (1.0 + ratio**slope)


def act(core, action):
    plan = core.plan(np.array([action]))
    return plan, core.apply(plan, NominalExecutor(core).execute(plan))


def drive_until(core, slot):
    """Wait until the weed in a slot can be worked on."""
    while not core.option_legal(0, 3 * slot + DEEP):
        plan, result = act(core, 3 * core.config.slots)
        assert plan.kind[0] == WAIT and not result.terminated[0]


# What the blade sweeps.


@pytest.mark.parametrize("sweep", [0.019, 0.027])
@pytest.mark.parametrize("root", [0.006, 0.010, 0.016])
def test_covered_share_is_the_share_of_points_that_are_covered(sweep, root):
    step = np.arange(-1.0, 1.0, 1.0 / 400.0) + 1.0 / 800.0
    x, y = (root * part.ravel() for part in np.meshgrid(step, step))
    x, y = x[x * x + y * y < root * root], y[x * x + y * y < root * root]
    for distance in np.linspace(0.0, 1.1 * (sweep + root), 12):
        counted = np.mean((x - distance) ** 2 + y**2 < sweep * sweep)
        assert covered_share(sweep, root, float(distance)) == pytest.approx(counted, abs=2e-3)


def test_covered_share_by_hand():
    # Equal discs, one through the other's middle: 2/3 - sqrt(3) / (2 pi).
    assert covered_share(0.02, 0.02, 0.02) == pytest.approx(2.0 / 3.0 - np.sqrt(3.0) / (2.0 * np.pi))
    assert covered_share(0.01, 0.02, 0.0) == pytest.approx(0.25)
    assert covered_share(0.02, 0.01, 0.01) == 1.0
    assert covered_share(0.02, 0.01, 0.03) == 0.0


@settings(max_examples=200, deadline=None)
@given(sweep=st.floats(0.005, 0.05), root=st.floats(0.002, 0.05), near=st.floats(0.0, 0.11), far=st.floats(0.0, 0.11))
def test_covered_share_never_grows_with_the_distance(sweep, root, near, far):
    near, far = sorted((near, far))
    assert 1.0 >= covered_share(sweep, root, near) >= covered_share(sweep, root, far) - 1e-9 >= -1e-9


def working_plan(core, slot, mode):
    drive_until(core, slot)
    return core.plan(np.array([3 * slot + mode]))


@pytest.mark.parametrize("mode", [GENTLE, NORMAL, DEEP])
def test_the_blade_sweeps_the_whole_disc_and_nothing_beyond_and_keeps_its_limits(mode):
    core = toy([(0.0, 0.05)])
    plan = working_plan(core, 0, mode)
    phases = plan.phases_s
    # The last phases are plunge, stir, lift and an empty pause.
    begins = np.cumsum(phases[0])
    time = np.linspace(begins[1], begins[-1], 20001)
    tip = tip_way(HOE, plan, phases, time)
    step = time[1] - time[0]
    speed = np.linalg.norm(np.diff(tip, axis=0), axis=1) / step
    pull = np.linalg.norm(np.diff(tip, 2, axis=0), axis=1) / step**2
    stirring = (time[1:-1] > begins[2]) & (time[1:-1] < begins[3])
    assert speed.max() <= 1.001 * HOE.plunge_velocity_m_s
    assert pull[stirring].max() == pytest.approx(HOE.stir_acceleration_m_s2, rel=0.01)
    assert speed[1:][stirring].max() <= HOE.stir_velocity_m_s
    assert pull.max() <= 1.02 * np.hypot(HOE.plunge_acceleration_m_s2, 2.0)
    assert tip[:, 2].min() == pytest.approx(-HOE.depth_m[mode])
    # Every point of the disc is under the blade at some time of the turn; nothing farther out ever is.
    turn = tip[(time >= begins[2]) & (time <= begins[3])][::50, :2] - [0.0, 0.05]
    angle = np.linspace(0.0, 2.0 * np.pi, 36, endpoint=False)
    sweep = HOE.sweep_m[mode]
    ring = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    for share in (0.0, 0.3, 0.6, 0.9, 0.995):
        gap = np.linalg.norm(share * sweep * ring[:, None] - turn, axis=-1).min(axis=1)
        assert np.all(gap <= HOE.blade_radius_m + 1e-9)
    outside = np.linalg.norm(1.001 * sweep * ring[:, None] - turn, axis=-1).min(axis=1)
    assert np.all(outside > HOE.blade_radius_m)


def test_times_and_work_by_hand():
    depth = np.array(HOE.depth_m)
    plunge = [float(QUINTIC.duration(HOE.clearance_m + d, 1.0, 10.0)) for d in depth]
    assert HOE.work_s[:, 0] == pytest.approx(plunge) and HOE.work_s[:, 2] == pytest.approx(plunge)
    assert np.all(np.diff(HOE.work_s.sum(axis=1)) > 0.0)
    # Only the speed counts on a huge circle at a low limit: peak speed 2 pi r 15/8 / T.
    assert circle_s(1.0, 0.01, 10.0) == pytest.approx(2.0 * np.pi * 1.875 / 0.01)
    # Down and up: half the depth on average, twice the depth of way; around: the full depth over the circle.
    force = 4.0e4 * 2.0 * 0.014 * depth
    assert HOE.energy_j == pytest.approx(force * (2.0 * 0.5 * depth + 2.0 * np.pi * np.array(HOE.stir_radius_m)))


# What it does to plants.


def test_from_10_to_30_mm_the_share_of_uprooted_plants_doubles_around_one_half():
    even = replace(HOE, depth50_m=0.01667, stage_factor=(1.0, 1.0, 1.0))
    shallow, deep = even.response.chance(np.array([0.010, 0.030]), 0, 1)
    assert deep / shallow == pytest.approx(2.0, rel=0.03)
    assert 0.5 * (shallow + deep) == pytest.approx(0.51, abs=0.01)


def test_labels_rise_with_the_stage_and_crop_loss_falls_with_the_gap():
    labels = HOE.response.labels()[0].tolist()
    assert labels == sorted(labels) and labels[0] < labels[2]
    assert float(HOE.response.half_of(1, 2)) == pytest.approx(HOE.depth50_m * 2.0 * 1.3)
    loss = crop_loss(HOE, np.array([0.0, 0.02, 0.025, 0.03, 0.05]))
    assert loss.shape == (5, 3) and np.all(np.diff(loss, axis=0) <= 0.0) and np.all(np.diff(loss, axis=1) >= 0.0)
    assert loss[0, NORMAL] == pytest.approx(1.0 / (1.0 + (0.012 / 0.022) ** 2)) and np.all(loss[-1] < 1e-9)
    # Beets were hoed up to 10 mm from their middle without harm: the disc's edge may come that near.
    assert crop_loss(HOE, HOE.sweep_m[DEEP] + 0.010)[0, DEEP] < 1e-9


def test_a_stir_takes_move_plunge_turn_and_lift_while_the_cart_drives_on():
    core = toy([(0.0, 0.05), (0.1, -0.1)])
    drive_until(core, 0)
    cart, begun = float(core.state.cart[0]), float(core.state.totals[0, T.time])
    plan, result = act(core, 3 * 0 + NORMAL)
    move, wait, plunge, stir, lift, pause = result.phases_s[0]
    stroke = plan.target[0] - plan.start[0]
    assert move == pytest.approx(move_time(core.machine, *stroke)) and pause == 0.0
    assert (plunge, stir, lift) == pytest.approx(tuple(HOE.work_s[NORMAL]))
    assert plan.target[0].tolist() == [0.0, 0.0, 0.05]
    elapsed = move + wait + plunge + stir + lift
    assert core.state.cart[0] == pytest.approx(cart + core.config.speed_m_s * elapsed)
    # 22 mm over the whole root zone against a tolerance of 10 mm; reward terms by hand.
    assert result.rewards[0] == pytest.approx([1.0, 0.0, -0.05 * elapsed, -0.0005 * HOE.energy_j[NORMAL], 0.0])
    scores = dict(zip(core.score_names, core.scores()[0], strict=True))
    assert scores["net_rate"] == 0.5 and scores["cycle_time_s"] == pytest.approx(begun + elapsed)
    assert scores["joules_per_weed"] == pytest.approx(HOE.energy_j[NORMAL])


def test_neighbours_get_what_the_disc_covers_of_their_roots_and_doses_add_up():
    core = toy([(0.0, 0.0), (0.025, 0.0)], tolerance_m=0.020)
    drive_until(core, 1)
    _, first = act(core, 0 + NORMAL)
    share = covered_share(0.023, 0.010, 0.025)
    assert 0.1 < share < 0.5
    assert core.state.plant_dose[0, PAD : PAD + 2] == pytest.approx([0.022, 0.022 * share])
    assert first.rewards[0, 0] == 1.0
    # Its slot moved up; gentle alone, 12 mm, would not do.
    drive_until(core, 0)
    _, second = act(core, 0 + GENTLE)
    assert core.state.plant_dose[0, PAD + 1] == pytest.approx(0.012 + 0.022 * share)
    assert second.rewards[0, 0] == (1.0 if 0.012 + 0.022 * share >= 0.020 else 0.0)
    assert core.state.plant_dose[0, PAD] == pytest.approx(0.022 + 0.012 * covered_share(0.019, 0.010, 0.025))


def test_a_crop_plant_whose_roots_are_swept_is_lost():
    for gap, lost in ((0.034, False), (0.020, True)):
        core = toy([(0.0, 0.0)], crops=[(0.0, gap)])
        drive_until(core, 0)
        _, result = act(core, DEEP)
        depth = 0.035 * covered_share(0.027, 0.010, gap)
        assert (depth >= 0.006) == lost
        assert result.rewards[0, 1] == (-5.0 if lost else 0.0) and core.state.totals[0, T.crop] == float(lost)


def test_an_illegal_stir_costs_time_and_nothing_else():
    core = toy([(0.0, 0.1)])
    plan, result = act(core, 7)
    assert plan.kind[0] == NOTHING and result.phases_s.sum() >= core.config.cart.illegal_s
    assert core.state.totals[0, T.illegal] == 1.0 and result.rewards[0, 0] == 0.0


@settings(max_examples=60, deadline=None)
@given(along=st.floats(-0.2, 0.3), across=st.floats(-0.22, 0.22), speed=st.floats(0.02, 0.3))
def test_a_legal_stir_keeps_the_blade_within_its_travel(along, across, speed):
    reach = HoeReach()
    arm = HoeArm.of(reach, 0.4)
    for stand in HOE.work_s.sum(axis=1).tolist():
        found = approach(arm, stand, Place(0.05, 0.0, 0.0), 0.0, speed, along, across)
        begins = along - speed * (found.move_s + found.wait_s)
        inside = begins <= reach.travel_m + 1e-9 and begins - speed * stand >= -reach.travel_m - 1e-9
        allowed = inside and found.wait_s <= 0.4 and abs(across) <= reach.half_width_m
        if found.legal:
            assert allowed
        elif min(abs(begins - speed * stand + reach.travel_m), abs(abs(across) - reach.half_width_m)) > 1e-9:
            assert not allowed


def test_everything_that_the_rules_may_command_is_within_the_mechanism():
    config = HoeWeedingConfig()
    reach = config.reach
    # Moves may overshoot the range along the row by 0.04 m; the largest circle is added to both ranges.
    circle, side = max(config.process.stir_radius_m), np.linspace(-1.0, 1.0, 25)
    heights = np.array([-max(config.process.depth_m), config.process.clearance_m])
    ranges = side * (reach.travel_m + max(circle, 0.04)), side * (reach.half_width_m + circle), heights
    tip = np.stack(np.meshgrid(*ranges, indexing="ij"), axis=-1).reshape(-1, 3)
    margins = config.parameters.mechanism.margins(poses(config.parameters, tip, np.zeros(len(tip))))
    assert min(float(values.min()) for values in margins.values()) > 0.0
    # Resting over ground the blade falls behind the cart by at most 0.147 of the way that the cart drives meanwhile.
    worst_s = float(QUINTIC.duration(2.0 * reach.half_width_m, reach.velocity_m_s, reach.acceleration_m_s2))
    for scenario in SCENARIOS.values():
        speed = HoeWeedingConfig(scenario=scenario).speed_m_s
        assert 0.147 * speed * (worst_s + config.cart.early_s) < 0.04


def test_the_load_is_what_its_name_says():
    for name, scenario in SCENARIOS.items():
        config = HoeWeedingConfig(scenario=scenario)
        load = scenario.density_per_m2 * scenario.weedy_m * config.speed_m_s * config.service_s
        assert load == pytest.approx(scenario.offered_load, rel=0.03), name


# Choosing.


def best_of_all(weeds, **changes):
    """Most weeds that any order of normal stirs uproots, by trying all of them."""
    best = 0.0
    for order in permutations(range(len(weeds))):
        core = toy(weeds, **changes)
        for weed in order:
            slots = core.state.slot_track[0].tolist()
            while weed in slots:
                option = 3 * slots.index(weed) + NORMAL
                act(core, option if core.option_legal(0, option) else 3 * core.config.slots)
                slots = core.state.slot_track[0].tolist()
        best = max(best, float(core.state.totals[0, T.killed]))
    return best


def test_brute_force_on_three_weeds_by_hand():
    """Three abreast at a crawl can all be had; at speed, in a window that one stir takes up, only one can."""
    weeds = [(0.0, -0.15), (0.0, 0.0), (0.0, 0.15)]
    slow = replace(SCENARIOS["load-0.7"], density_per_m2=40.0)
    assert best_of_all(weeds, scenario=slow) == 3.0
    # 0.28 m of window at 0.2 m/s are 1.4 s: 0.77 s of work and a move of at least 0.3 s each.
    fast = replace(SCENARIOS["load-1.0"], offered_load=3.3)
    assert HoeWeedingConfig(scenario=fast).speed_m_s == pytest.approx(0.2, abs=0.01)
    assert best_of_all(weeds, scenario=fast) == 1.0


@pytest.mark.slow
def test_policies_choose_legal_actions_and_the_worse_ones_are_worse():
    net: dict[str, float] = {}
    for name in policy_names(ENV_ID):
        env = gym.make_vec(
            ENV_ID,
            num_envs=8,
            vectorization_mode="vector_entry_point",
            scenario="load-1.0",
            perception="perfect",
            autoreset_mode="Disabled",
        )
        rule = make_policy(name, env, seed=1)
        observation, _ = env.reset(seed=0)
        over, result = np.zeros(8, bool), np.zeros(8)
        while not over.all():
            action = rule.act(observation)
            assert np.all(observation["action_mask"][np.arange(8), action] == 1)
            observation, _, end, cut, info = env.step(action)
            ended = (end | cut) & ~over
            result[ended] = info["scorecard"]["net_rate"][ended]
            over |= ended
        net[name] = float(result.mean())
    assert min(net, key=net.__getitem__) == "random"
    assert net["receding-horizon"] >= net["edf"]


# The machine in PyBullet.


@pytest.mark.slow
def test_pybullet_agrees_with_the_plan():
    """Cycle time within 2 %, net rate within 1.5 points, the blade within 0.3 mm, over whole strips."""
    cycles, rates, errors = [], [], []
    for seed in range(2):
        pair = []
        for backend in ("analytic", "pybullet"):
            env: Any = gym.make(
                ENV_ID, backend=backend, perception="model", config=short_config(), disable_env_checker=True
            )
            rule = make_policy("edf", env)
            observation, info = env.reset(seed=seed)
            over = False
            while not over:
                batch = {name: values[None] for name, values in observation.items()}
                observation, _, end, cut, info = env.step(int(rule.act(batch)[0]))
                over = end or cut
                if backend == "pybullet":
                    errors.append(env.unwrapped.executor.last_result.final_error_m)
            pair.append(info["scorecard"])
            env.close()
        cycles.append(pair[1]["cycle_time_s"] / pair[0]["cycle_time_s"])
        rates.append(pair[1]["net_rate"] - pair[0]["net_rate"])
    assert np.abs(np.array(cycles) - 1.0).max() < 0.02
    assert np.abs(rates).max() < 0.015
    assert max(errors) < 3e-4


def short_config() -> HoeWeedingConfig:
    return HoeWeedingConfig(scenario=replace(SCENARIOS["load-1.0"], strip_m=2.0))


def test_an_unknown_tool_is_named():
    with pytest.raises(ValueError, match="tool"):
        gym.make(ENV_ID, tool="plough")


def test_reach_of_a_stir_is_where_its_dose_ends():
    work = Stir.of(HOE)
    for mode, kind in product(range(3), range(4)):
        assert dose(work, mode, work.reach_m + 1e-9, 0.0, kind) == 0.0
        assert dose(work, mode, 0.0, 0.0, kind) == pytest.approx(HOE.depth_m[mode])
    assert dose(work, DEEP, 0.6 * work.reach_m, 0.0, 2) > 0.0


def test_every_motion_that_the_rules_plan_is_within_every_limit_all_the_way():
    """What the machine is commanded at 240 Hz, over strips of random legal decisions, on the fastest tier too."""
    least, seen = np.inf, 0
    for scenario in ("load-1.0", "load-1.6"):
        env: Any = gym.make(ENV_ID, backend="analytic", scenario=scenario, perception="perfect")
        _, info = env.reset(seed=3)
        core = env.unwrapped.core
        parameters = core.config.parameters
        rng = np.random.default_rng(0)
        for _ in range(240):
            # Waiting is rare: the blade is where motions begin and end far apart.
            options = np.flatnonzero(info["action_mask"])
            action = int(rng.choice(options[:-1] if len(options) > 1 else options))
            plan = core.plan(np.array([action]))
            time = np.arange(0.0, float(plan.phases_s.sum()), 1.0 / 240.0)
            pose = poses(parameters, tip_way(HOE, plan, plan.phases_s, time), plan.cart[0] + plan.speed[0, 0] * time)
            least = min(least, min(float(values.min()) for values in parameters.mechanism.margins(pose).values()))
            seen += plan.kind[0] < WAIT
            *_, terminated, truncated, info = env.step(action)
            if terminated or truncated:
                _, info = env.reset()
    assert least > 0.0
    assert seen > 100


def test_tools_meet_the_same_field_and_a_wrong_configuration_is_named():
    cores = [gym.make(ENV_ID, backend="analytic", tool=tool).unwrapped.core for tool in ("hoe", "laser")]  # type: ignore[attr-defined]
    for core in cores:
        core.reset_rows(np.zeros(1, np.int64), [np.random.default_rng(5)])
    assert np.array_equal(cores[0].state.plant, cores[1].state.plant)
    assert np.array_equal(cores[0].state.track_report, cores[1].state.track_report)
    # Without a camera beside it the hoe works where the tracks say.
    assert np.array_equal(cores[0].state.track_aim, cores[0].state.track_report)
    assert not np.array_equal(cores[1].state.track_aim, cores[1].state.track_report)
    with pytest.raises(ValueError, match="HoeWeedingConfig"):
        gym.make(ENV_ID, backend="analytic", tool="laser", config=HoeWeedingConfig())
