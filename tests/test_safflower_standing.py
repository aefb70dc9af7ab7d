"""A picker that stands tilted at its stops: how, what that does to the tool, and that nothing else changes."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

import fieldgym  # noqa: F401
from fieldgym import bounds
from fieldgym.envs.drives import DriveErrors
from fieldgym.envs.field import FieldError
from fieldgym.envs.field_files import read_field, write_field
from fieldgym.envs.rough import coherence
from fieldgym.envs.safflower.config import SCENARIOS, SafflowerConfig
from fieldgym.envs.safflower.field import Stands
from fieldgym.envs.safflower.process import Shears, cut_share
from fieldgym.envs.safflower.standing import draw_stands
from fieldgym.testing import check_batch

ID = "fieldgym/SafflowerPicking-v0"
SOUND = {"scenario.drives": DriveErrors(), "process.luck_logit": 0.0}


def made(iso_class: str = "C", backend: str = "analytic", **overrides: Any) -> Any:
    overrides = {**SOUND, "scenario.ground.iso_class": iso_class, **overrides}
    kwargs = {"scenario": "field", "perception": "model", "disable_env_checker": True}
    return gym.make(ID, backend=backend, overrides=overrides, **kwargs).unwrapped


def at_a_later_stop(env: Any, stop: int, seed: int = 3) -> int:
    """Drive on to a stop at which something can be picked; gives the first action that does."""
    _, info = env.reset(seed=seed)
    while True:
        actions = np.flatnonzero(info["action_mask"])
        if env.core.state.stop[0] >= stop and len(actions) > 1:
            return int(actions[0])
        *_, info = env.step(int(actions[-1]))


def off_by_hand(core: Any, tool: Any) -> Any:
    """Where the frame's turn about its axles' middle, and its heave, put a tool."""
    ground, stand, stop = core.config.scenario.ground, core.stands[0], int(core.state.stop[0])
    heave, pitch, roll = stand[stop]
    turn = Rotation.from_euler("xy", [roll, pitch])
    half, high = 0.5 * core.config.machine.picker.five_bar.base_m, core.config.scenario.motor_height_m
    arm = np.array([0.0, tool[1] - half, tool[2] + high - ground.pivot_m])
    return turn.apply(arm) - arm + [0.0, 0.0, heave]


def test_the_tool_is_where_the_frame_s_stand_puts_it_and_the_shears_see_it():
    env = made()
    # The first head of all: nothing is gathered yet.
    action = at_a_later_stop(env, 2)
    core, plan = env.core, env.core.plan(np.array([action]))
    stands = np.abs(core.stands[0])
    assert core.state.stop[0] >= 2 and (stands[:, 0] < 0.05).all() and (stands[:, 1:] < 0.05).all()
    off = off_by_hand(core, plan.target[0])
    np.testing.assert_allclose(core.nominal(plan).tool[0] - plan.target[0], off, rtol=0, atol=2e-9)
    assert np.abs(off).max() > 5e-4 and np.abs(off).max() < 0.03
    process, head = core.config.process, core.state.track_head[0, plan.report[0]]
    effort, mass = int(plan.kind[0]), core.state.head_mass_g[0, head]
    gap = core.state.head_position[0, head] - plan.target[0] - off
    share = cut_share(Shears.of(process), process.strokes[effort], gap[0], gap[1], gap[2], 1.0)
    dropped = process.suction_loss * np.exp(-process.suction_s[effort] / process.suction_decay_s)
    *_, info = env.step(action)
    np.testing.assert_allclose(info["scorecard"]["collected_g"], mass * share * (1.0 - dropped), rtol=1e-6)


@pytest.mark.parametrize("iso_class", ["B", "D"])
def test_stands_spread_as_the_ground_s_density_says(iso_class):
    scenario = SCENARIOS["field"]
    ground = replace(scenario.ground, iso_class=iso_class)
    config = SafflowerConfig(scenario=replace(scenario, ground=ground))
    stands = draw_stands(config, [np.random.default_rng(seed) for seed in range(600)])
    assert stands is not None
    base, track, foot = 0.74, 1.10, 0.10
    density = {"B": 64e-6, "D": 1024e-6}[iso_class]

    def spread(part):
        def power(n):
            across, half = (float(coherence(ground, np.array([n]), b)[0]) for b in (track, 0.5 * track))
            mean = np.sinc(n * foot)
            return density * (n / 0.1) ** -2.0 * part(np.pi * n * base, mean, across, half)

        return np.sqrt(quad(power, 0.05, 3.5, limit=400)[0])

    wanted = [
        spread(lambda a, m, c, h: (np.cos(a) * m) ** 2 * 0.5 * (1.0 + c) + 1.0 - 2.0 * np.cos(a) * m * h),
        spread(lambda a, m, c, h: (2.0 * np.sin(a) * m) ** 2 * 0.5 * (1.0 + c)) / base,
        spread(lambda a, m, c, h: (np.cos(a) * m) ** 2 * 2.0 * (1.0 - c)) / track,
    ]
    found = np.sqrt((stands**2).mean(axis=(0, 1)))
    np.testing.assert_allclose(found, wanted, rtol=0.05)
    assert stands.shape == (600, scenario.stops, 3)


def test_nothing_else_of_a_field_moves_and_policies_see_nothing():
    rough, level = made(), made("none")
    for seed in (0, 7):
        (shown, _), (plain, _) = (env.reset(seed=seed) for env in (rough, level))
        assert level.field.stands is None and len(rough.field.stands) == rough.core.config.scenario.stops
        assert replace(rough.field, stands=None) == level.field
        assert all((shown[name] == plain[name]).all() for name in plain)
    assert not level.core.stepwise and not level.core.rough and rough.core.stepwise
    assert [name for name, one in SCENARIOS.items() if one.ground.rough] == ["field"]
    assert SCENARIOS["field"].ground.iso_class == "C"


def test_stands_are_of_the_field_and_survive_files(tmp_path: Path):
    env = made()
    env.reset(seed=5)
    field = env.field
    for name in ("a.csv", "a.geojson"):
        write_field(field, tmp_path / name)
        assert read_field(tmp_path / name, env.core.field_type) == field
        env.reset(seed=99, options={"field": tmp_path / name})
        assert (env.core.stands[0] == np.column_stack([*vars(field.stands).values()])).all()
    env.reset(seed=99, options={"field": replace(field, stands=None)})
    drawn = env.core.stands.copy()
    assert drawn.any() and (drawn[0, :, 1] != field.stands.pitch_rad).all()
    with pytest.raises(FieldError, match=f"1 rows: this row has {len(field.stands)} stops"):
        env.reset(options={"field": replace(field, stands=Stands(*np.zeros((3, 1))))})
    level = made("none")
    level.reset(options={"field": field})
    assert level.field.stands is None


def test_the_simulated_machine_works_where_the_analytic_one_does():
    env = made(backend="pybullet")
    action = at_a_later_stop(env, 1)
    plan = env.core.plan(np.array([action]))
    told, got = env.core.nominal(plan).tool[0], env.executor.execute(plan).tool[0]
    assert not env.executor.fault and np.abs(told - plan.target[0]).max() > 1e-3
    # The tool's weight bends the arms.
    assert np.abs(got - told).max() < 4e-4
    env.close()


def test_a_batch_on_rough_ground_is_its_single_rows():
    check_batch(ID, "field", "SameStep", 3, 30, threads=2)


def test_the_bound_lets_a_tilted_machine_work_anywhere():
    """As where a camera may have reported anything."""
    level = bounds.instance(ID, 3, scenario="row-dense", perception="camera").bound()
    kwargs: dict[str, Any] = {"scenario": "row-dense", "perception": "model"}
    found = bounds.instance(ID, 3, overrides={"scenario.ground.iso_class": "C"}, **kwargs).bound()
    exact = bounds.instance(ID, 3, **kwargs).bound()
    assert replace(found, wall_s=0.0) == replace(level, wall_s=0.0) != replace(exact, wall_s=0.0)
