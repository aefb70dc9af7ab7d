"""Drives that err: what the tool is off by, who sees it, and that nothing else changes."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym import bounds
from fieldgym.envs import env_ids, task
from fieldgym.envs.drives import DriveErrors, DriveLuck, LinearDrive, RotaryDrive, Servos, draw_luck
from fieldgym.envs.field import FieldError
from fieldgym.envs.field_files import read_field, write_field
from fieldgym.envs.safflower.process import Shears, cut_share
from fieldgym.testing import check_batch

TASKS = tuple(env_id for env_id in env_ids() if env_id.startswith("fieldgym/"))
NONE = {"scenario.drives": DriveErrors()}
ERRORS = DriveErrors(LinearDrive(3e-4, 2e-4, 1e-4), RotaryDrive(1e-3, 8e-4, 2e-4))


def made(env_id: str, backend: str = "analytic", **kwargs: Any) -> Any:
    kwargs = {"scenario": "field", "perception": "model", **kwargs}
    return gym.make(env_id, backend=backend, disable_env_checker=True, **kwargs).unwrapped


def works(env: Any, seed: int = 3) -> Any:
    """The plan of a decision that works on something, after a few that lead there."""
    _, info = env.reset(seed=seed)
    for _ in range(400):
        actions = np.flatnonzero(info["action_mask"])
        plan = env.core.plan(actions[:1])
        if actions[0] < env.action_space.n - 2 and plan.kind[0] < 3:
            return plan
        _, _, _, _, info = env.step(int(actions[-1]))
    raise AssertionError("nothing to work on")


@pytest.mark.parametrize("share", [0.004, 0.02, 0.1, 0.7, 5.0])
@pytest.mark.parametrize("since", [0.0, 0.4])
def test_what_is_left_of_a_motion_is_a_first_order_lag_s(share, since):
    """Integrated with 200,000 steps: a servo that follows the quintic law, then waits, then works."""
    motion_s, lag_s = 0.03, 0.03 * share
    since_s, work_s = since * lag_s, 0.5 * lag_s
    steps = 200_000
    time = np.linspace(0.0, motion_s, steps + 1)
    tau = time / motion_s
    rate = 30.0 * tau**2 * (1.0 - tau) ** 2 / motion_s
    weight = np.exp(-(motion_s - time) / lag_s)
    left = (rate * weight)[1:].sum() * motion_s / steps  # rate is zero at both ends
    during = np.exp(-(since_s + np.linspace(0.0, work_s, 2001)) / lag_s).mean()
    servos = Servos.of(DriveErrors(lag_s=lag_s), 0, 1)
    np.testing.assert_allclose(servos.rest(motion_s, since_s, work_s), left * during, rtol=2e-4, atol=1e-7)


def test_nothing_is_left_of_what_did_not_move_or_does_not_lag():
    assert Servos.of(DriveErrors(lag_s=0.1), 1, 0).rest(np.array([0.0, 0.05]))[0] == 0.0
    assert not Servos.of(ERRORS, 1, 2).rest(np.array([0.1, 1e-6])).any()


def test_joints_stay_behind_on_the_side_that_they_came_from():
    servos = Servos.of(ERRORS, 1, 2)
    off = servos.joint_error(np.array([2.0, -1.0, 0.5]), [0.3, -0.2, 1e-9])
    # Half of the play and the stiction against the motion; the last joint stood still.
    np.testing.assert_allclose(off, [2.0 * 3e-4 - 2e-4, -1e-3 + 6e-4, 5e-4], rtol=1e-12)


def expected(inverse: Any, forward: Any, pose: Any, came: Any, luck: Any, errors: tuple[Any, Any]) -> Any:
    """What a pose is off by, from differences of the kinematics alone.

    Args:
        inverse: joints of a pose.
        forward: pose of joints near a pose.
        pose: commanded.
        came: (m, k), steps by which the pose was reached, whose directions count alike.
        luck: of the joints.
        errors: standard deviations of the encoders, and how far joints stay behind.
    """
    joints = inverse(pose)
    sides = np.mean([np.sign(joints - inverse(pose - step)) for step in came], axis=0)
    off, step = errors[0] * luck - errors[1] * sides, 1e-6
    slopes = [
        (forward(joints + step * one, pose) - forward(joints - step * one, pose)) / (2.0 * step)
        for one in np.eye(len(joints))
    ]
    return np.transpose(slopes) @ off


def per_joint(linear: int, rotary: int) -> tuple[Any, Any]:
    """Standard deviations of ``ERRORS`` by joint, and how far joints stay behind: half of the play, and stiction."""
    counts = [linear, rotary]
    return np.repeat([3e-4, 1e-3], counts), np.repeat([1e-4 + 1e-4, 4e-4 + 2e-4], counts)


def prrs(mechanism: Any) -> tuple[Any, Any]:
    return mechanism.inverse, lambda joints, near: mechanism.forward(joints, near).pose


def picker_case(core: Any, plan: Any) -> Any:
    bar, errors = core.config.machine.picker.five_bar, per_joint(1, 2)
    arms = tuple(part[1:] for part in errors)
    tool = plan.target[0, 1:]
    went = np.sign(plan.target[0, 0] - plan.start[0, 0])
    cart = errors[0][0] * core.drive_luck[0, 0] - errors[1][0] * went
    below = np.array([[0.0, -1e-7]])
    return [cart, *expected(bar.inverse, lambda q, _: bar.forward(q), tool, below, core.drive_luck[0, 1:], arms)]


def transplanter_case(core: Any, plan: Any) -> Any:
    arm, bottom = core.config.machine.arm, core.config.machine.arm.window_m[0][1]
    ends = core.cells_of_pair(int(plan.pair[0]))
    points = [np.array([core.places.x_m[end], bottom]) for end in ends]
    below, errors = np.array([[0.0, -1e-7]]), per_joint(0, 2)
    return [
        expected(arm.inverse, lambda q, _: arm.forward(q), point, below, core.drive_luck[0], errors) for point in points
    ]


def sorter_case(core: Any, plan: Any) -> Any:
    w, x, y, z = plan.turn[0]
    tilt = np.arcsin(2.0 * (w * y - x * z))
    roll = np.arctan2(2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y))
    yaw = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
    pose, along = np.array([*plan.grip[0], roll, tilt, yaw]), 1e-7 * np.eye(6)[:1]
    mechanism = core.config.machine.sorter.mechanism
    return expected(*prrs(mechanism), pose, along, core.drive_luck[0], per_joint(3, 3))


def laser_case(core: Any, plan: Any) -> Any:
    reach, (carrier, lean, across) = core.config.reach, plan.target[0]
    phases = plan.phases_s[0]
    cart = plan.cart[0] + plan.speed[0, 0] * (phases[:3].sum() + 0.5 * phases[3])
    beta = np.arctan2(lean, reach.gap_m)
    pose = np.array([carrier - cart, reach.platform_z_m, np.arctan2(across * np.cos(beta), reach.gap_m), beta])
    back = -1e-7 * np.eye(4)[:1]
    return expected(*prrs(core.config.machine.mechanism), pose, back, core.drive_luck[0], per_joint(4, 0))


def hoe_case(core: Any, plan: Any) -> Any:
    process, kind, phases = core.config.process, int(plan.kind[0]), plan.phases_s[0]
    middle_s, stir_s, speed = phases[:3].sum() + 0.5 * phases[3], phases[3], plan.speed[0, 0]
    pose = np.zeros(6)
    pose[:2] = plan.target[0, 0] - plan.cart[0] - speed * middle_s, plan.target[0, 2]
    pose[2] = -process.depth_m[kind] - core.config.machine.lowest_tip_m
    round_m_s, angle = 2.0 * np.pi * process.stir_radius_m[kind] / stir_s, np.arange(8) * np.pi / 4.0
    steps = np.zeros((8, 6))
    steps[:, 0], steps[:, 1] = -round_m_s * np.sin(angle) - speed, round_m_s * np.cos(angle)
    mechanism = core.config.machine.mechanism
    return expected(*prrs(mechanism), pose, 1e-6 * steps, core.drive_luck[0], per_joint(3, 3))


CASES = {
    "SafflowerPicking": picker_case,
    "TrayTransplanting": transplanter_case,
    "ProduceSorting": sorter_case,
    "LaserWeeding": laser_case,
    "HoeWeeding": hoe_case,
}


@pytest.mark.parametrize("name", CASES)
def test_the_tool_is_where_the_kinematics_puts_joints_that_are_off(name):
    env = made(f"fieldgym/{name}-v0", overrides={"scenario.drives": ERRORS})
    for seed in range(2):
        plan = works(env, seed)
        error, wanted = env.core.tool_error(plan)[0], np.array(CASES[name](env.core, plan))
        assert np.abs(wanted).max() > 1e-4, seed
        np.testing.assert_allclose(error, wanted, rtol=0.02, atol=3e-6)


@pytest.mark.parametrize("env_id", TASKS)
def test_a_field_with_errors_is_the_same_field_and_without_them_there_are_none(env_id):
    erring, other = made(env_id), made(env_id, overrides=NONE)
    for seed in (0, 7):
        fields = [env.reset(seed=seed) and env.field for env in (erring, other)]
        assert fields[1].drives is None and len(fields[0].drives) == erring.core.joints > 0
        assert replace(fields[0], drives=None) == fields[1]
    assert not other.core.errs and other.core.joints == 0
    named = task(env_id).assembly.scenarios
    assert all(scenario.drives == DriveErrors() for name, scenario in named.items() if name != "field")


@pytest.mark.parametrize("env_id", TASKS)
def test_a_machine_s_errors_are_of_its_field_and_survive_files(env_id, tmp_path: Path):
    env = made(env_id)
    env.reset(seed=5)
    field = env.field
    for name in ("a.csv", "a.geojson"):
        write_field(field, tmp_path / name)
        assert read_field(tmp_path / name, env.core.field_type) == field
        env.reset(seed=99, options={"field": tmp_path / name})
        assert (env.core.drive_luck[0] == field.drives.encoder).all()
    env.reset(seed=99, options={"field": replace(field, drives=None)})
    drawn = env.core.drive_luck.copy()
    assert (drawn != field.drives.encoder).all()
    env.reset(seed=99, options={"field": replace(field, drives=None)})
    assert (env.core.drive_luck == drawn).all()
    with pytest.raises(FieldError, match=f"1 rows: this machine has {env.core.joints} driven joints"):
        env.reset(options={"field": replace(field, drives=DriveLuck(np.zeros(1)))})


def test_luck_is_standard_normal_and_takes_nothing_from_the_generator():
    generators = [np.random.default_rng(seed) for seed in range(20_000)]
    luck = draw_luck(generators, 3)
    assert np.abs(luck.mean(axis=0)).max() < 0.03 and np.abs(luck.std(axis=0) - 1.0).max() < 0.02
    following = np.array([generator.standard_normal(3) for generator in generators[:5]])
    assert (following == [np.random.default_rng(seed).standard_normal(3) for seed in range(5)]).all()
    assert np.abs(np.corrcoef(np.array([g.standard_normal(3) for g in generators]).T, luck.T)[:3, 3:]).max() < 0.03


def test_the_shears_see_the_error_and_policies_do_not():
    """Two machines of opposite luck: the same observations but for what they have gathered, other cuts."""
    overrides = {"scenario.drives": ERRORS, "scenario.ground.iso_class": "none", "process.luck_logit": 0.0}
    env = made("fieldgym/SafflowerPicking-v0", overrides=overrides)
    plan = works(env)
    core = env.core
    process, position = core.config.process, core.state.head_position[0, core.state.track_head[0, plan.report[0]]]
    effort = int(plan.kind[0])
    off = position - plan.target[0] - core.tool_error(plan)[0]
    share = cut_share(Shears.of(process), process.strokes[effort], off[0], off[1], off[2], 1.0)
    dropped = process.suction_loss * np.exp(-process.suction_s[effort] / process.suction_decay_s)
    mass = core.state.head_mass_g[0, core.state.track_head[0, plan.report[0]]]
    action = int(3 * plan.slot[0] + effort)
    before = core.observe()["candidates"].copy()
    core.drive_luck[:] *= -1.0
    assert (core.observe()["candidates"] == before).all()
    core.drive_luck[:] *= -1.0
    *_, info = env.step(action)
    gained = info["scorecard"]["collected_g"]
    np.testing.assert_allclose(gained, mass * share * (1.0 - dropped), rtol=1e-9)
    off = position - plan.target[0]
    exact = cut_share(Shears.of(process), process.strokes[effort], off[0], off[1], off[2], 1.0)
    assert abs(share - exact) > 1e-4


def test_a_gripper_that_is_too_far_off_loses_every_plug():
    encoder = {"scenario.drives": DriveErrors(rotary=RotaryDrive(encoder_rad=0.02))}
    cards = []
    for overrides in ({}, encoder):
        env = made("fieldgym/TrayTransplanting-v0", overrides=overrides, perception="perfect")
        plan = works(env, 1)
        while not plan.grips[0]:
            env.step(0)
            plan = env.core.plan(np.zeros(1, np.int64))
        error_m = env.core.nominal(plan).error_m[0]
        *_, info = env.step(int(3 * plan.pair[0] + plan.kind[0]))
        cards.append((error_m.max() > 0.004, info["scorecard"]["lost"]))
    assert cards == [(False, 0.0), (True, 1.0)]


@pytest.mark.parametrize("env_id", TASKS)
def test_a_batch_of_machines_that_err_is_its_single_ones(env_id):
    check_batch(env_id, "field", "SameStep", 4, 40, threads=2)


PHYSICS = {"SafflowerPicking": 4e-4, "TrayTransplanting": 1e-4, "LaserWeeding": 3e-4, "HoeWeeding": 3e-4}
"""By task, metres that the simulated tool may be from where the closed form says: weight bends the picker's arms."""


@pytest.mark.parametrize("name", PHYSICS)
def test_pybullet_s_machine_goes_where_the_closed_form_says(name):
    env = made(f"fieldgym/{name}-v0", "pybullet")
    seen = 0
    for seed in (0, 1):
        plan = works(env, seed)
        env.executor.reset_rows(np.zeros(1, np.int64))
        for _ in range(2):  # from where the rules say it stands, and from where its errors left it
            told, got = env.core.nominal(plan)[1], env.executor.execute(plan)[1]
            assert not env.executor.fault
            assert np.abs(np.asarray(got) - np.asarray(told)).max() < PHYSICS[name]
            if name == "TrayTransplanting":
                break
            env.executor.reset_rows(np.zeros(1, np.int64))
        seen += 1
    assert seen == 2
    env.close()


def test_pybullet_s_sorter_closes_where_the_closed_form_says():
    env = made("fieldgym/ProduceSorting-v0", "pybullet", overrides={"scenario.drives": ERRORS})
    plan, poses = works(env, 2), []
    executor, grip = env.executor, env.core.grip
    env.core.grip = lambda plan, position, axes: (poses.append((position, axes)), grip(plan, position, axes))[1]
    want = env.core.nominal(plan)
    executor.execute(plan)
    assert not executor.fault and len(poses) == 2
    (told, told_axes), (got, got_axes) = poses
    assert np.abs(got - told).max() < 3e-4 and np.abs(got_axes - told_axes).max() < 2e-3
    assert np.abs(told - plan.grip).max() > 3e-4 and want is not None
    env.close()


def test_what_a_task_without_errors_shows_is_made_by_one_kernel():
    """A decision of machines without errors does not go step by step."""
    env = made("fieldgym/SafflowerPicking-v0", scenario="pots")
    _, info = env.reset(seed=0)
    env.core.apply = env.core.nominal = None
    env.step(int(np.flatnonzero(info["action_mask"])[0]))


@pytest.mark.parametrize("env_id", TASKS)
def test_a_field_scenario_says_where_its_numbers_come_from(env_id):
    drives = task(env_id).assembly.scenarios["field"].drives
    assert Servos.of(drives, 1, 1).on and drives.lag_s > 0.0


def test_the_bound_of_a_machine_that_errs_lets_it_work_anywhere():
    """As where a camera may have reported anything."""
    cases: Any = (
        {"scenario": "field", "perception": "model"},
        {"scenario": "row-dense", "perception": "camera"},
        {"scenario": "row-dense", "perception": "model"},
    )
    found = [
        replace(bounds.instance("fieldgym/SafflowerPicking-v0", 3, **kwargs).bound(), wall_s=0.0) for kwargs in cases
    ]
    assert found[0] == found[1] != found[2]
