"""The closed-loop picker and the analytic one do the same."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.agents import act_single, make_policy
from fieldgym.envs.safflower.config import SCENARIOS
from fieldgym.envs.safflower.machine import trajectory
from fieldgym.envs.safflower.timing import NOTHING

ID = "fieldgym/SafflowerPicking-v0"


def fixed_order(backend: str, scenario: str, seeds: range) -> np.ndarray:
    """Cycle time and net rate of the fixed order, a row a seed."""
    env: Any = gym.make(ID, backend=backend, scenario=scenario, perception="perfect")
    policy = make_policy("fixed-order", env)
    rows = []
    for seed in seeds:
        observation, info = env.reset(seed=seed)
        over = False
        while not over:
            observation, _, end, cut, info = env.step(act_single(policy, observation))
            over = end or cut
        rows.append((info["scorecard"]["cycle_time_s"], info["scorecard"]["net_rate"]))
    env.close()
    return np.array(rows)


@pytest.mark.slow
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_pybullet_agrees_with_analytic(scenario):
    computed, simulated = (fixed_order(backend, scenario, range(2)) for backend in ("analytic", "pybullet"))
    assert simulated[:, 0] == pytest.approx(computed[:, 0], rel=1e-9)
    assert simulated[:, 1] == pytest.approx(computed[:, 1], abs=0.001)


def test_the_machine_stands_where_the_plan_ends():
    env: Any = gym.make(ID, backend="pybullet", perception="perfect").unwrapped
    env.reset(seed=0)
    for _ in range(4):
        legal = np.flatnonzero(env.action_masks())
        plan = env.core.plan(np.array([legal[0]]))
        outcome = env.executor.execute(plan)
        assert outcome.tool == pytest.approx(plan.target, abs=5e-4)
        assert outcome.phases_s.sum() == pytest.approx(plan.phases_s.sum(), abs=1e-9)
        env.core.apply(plan, outcome)
    env.close()


def test_commands_keep_to_the_limits_and_the_workspace():
    env: Any = gym.make(ID, backend="analytic", perception="perfect").unwrapped
    env.reset(seed=1)
    core, picker, step_s = env.core, env.core.config.machine.picker, 1.0 / 240.0
    policy = make_policy("nearest", gym.make(ID, backend="analytic"))
    observation, *_ = env.reset(seed=1)
    for _ in range(25):
        plan = core.plan(policy.act({name: values[None] for name, values in observation.items()}))
        cart, tool, duration_s = trajectory(plan, core.config.machine.clear_level_m, step_s)
        assert len(cart) == len(tool) == int(np.ceil(duration_s / step_s)) + 1
        assert np.abs(np.diff(cart)).max() <= picker.cart_velocity_m_s * step_s * 1.001
        assert np.linalg.norm(np.diff(tool, axis=0), axis=1).max() <= picker.tool_velocity_m_s * step_s * 1.001
        assert picker.five_bar.reachable(tool).all()
        assert plan.kind[0] != NOTHING
        observation, *_ = env.step(int(plan.slot[0]) * 3 + min(int(plan.kind[0]), 2) * (int(plan.slot[0]) < 16))


def test_a_batch_of_machines_is_refused():
    from fieldgym.envs.safflower.config import PerceptionModel, SafflowerConfig
    from fieldgym.envs.safflower.core import SafflowerCore
    from fieldgym.envs.safflower.machine import PyBulletPicker

    with pytest.raises(ValueError, match="one machine"):
        PyBulletPicker(SafflowerCore(SafflowerConfig(), PerceptionModel.perfect(), 2))


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["pots", "row"])
def test_a_loaded_field_looks_as_the_drawn_one(scenario):
    env: Any = gym.make(ID, backend="analytic", perception="camera", scenario=scenario).unwrapped
    starts = []
    for seed, options in ((4, None), (9, {})):
        if options is not None:
            options["field"] = env.field
        observation, _ = env.reset(seed=seed, options=options)
        env.step(0)
        last = env.step(env.action_space.n - 1)
        starts.append((observation["candidates"], last[0]["candidates"], last[-1]["scorecard"]))
        assert env.field.reports is None and env.field.camera is None
    env.close()
    assert starts[0][0].any() and np.array_equal(starts[0][0], starts[1][0])
    assert np.array_equal(starts[0][1], starts[1][1]) and starts[0][2] == starts[1][2]
