"""A decision in one kernel is the decision in separate ones, whatever was changed before it."""

import copy
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from numba import typeof
from numba.core import config

from fieldgym.envs import env_ids
from fieldgym.envs.core import StepResult, TaskCore
from fieldgym.envs.kernel_core import KernelCore
from fieldgym.envs.safflower.core import SafflowerCore
from fieldgym.kernels import desk, stamps

IDS = env_ids()
WORLDS = 3


def rules_of(env_id: str, worlds: int = WORLDS) -> Any:
    """Rules of a task in worlds that stand at their beginning."""
    env: Any = gym.make_vec(env_id, num_envs=worlds, vectorization_mode="vector_entry_point")
    env.reset(seed=11)
    return env.core


def legal(core: Any, rng: np.random.Generator) -> np.ndarray:
    return np.array([rng.choice(np.flatnonzero(mask)) for mask in core.observe()["action_mask"]])


def same(a: Any, b: Any) -> None:
    """Hold two values to each other, bit for bit."""
    if isinstance(a, np.ndarray):
        assert a.dtype == b.dtype and a.shape == b.shape and a.tobytes() == b.tobytes()
    else:
        for left, right in zip(a, b, strict=True):
            same(left, right)


@pytest.mark.parametrize("env_id", IDS)
def test_one_kernel_decides_as_separate_ones_do(env_id: str) -> None:
    core, rng = rules_of(env_id), np.random.default_rng(0)
    other = copy.deepcopy(core)
    assert isinstance(core, KernelCore)
    for number in range(60):
        actions = legal(core, rng)
        if number % 10 == 9:  # what is possible and what is not
            actions[:] = rng.integers(core.action_space.n, size=WORLDS)
        page = core.decide(actions)
        plan = other.plan(actions)
        result = other.apply(plan, other.nominal(plan))
        same(list(page.observation.values()), list(other.observe().values()))
        assert list(page.observation) == list(other.observe())
        same(page.numbers, np.hstack([result.rewards, result.phases_s, other.scores()]))
        same(core.result_of(page), result)
        same(core.planned, plan)
        same(core.state, other.state)


@pytest.mark.parametrize("env_id", IDS)
def test_only_the_rows_that_are_shown_are_written(env_id: str) -> None:
    core, rng = rules_of(env_id), np.random.default_rng(1)
    before = core.show()
    kept = copy.deepcopy(before)
    core.decide(legal(core, rng))
    after = core.show(np.array([1]), before)
    fresh = core.show()
    for name, values in fresh.observation.items():
        same(after.observation[name][1], values[1])
        same(after.observation[name][[0, 2]], kept.observation[name][[0, 2]])
    same(after.numbers[1], fresh.numbers[1])
    same(after.numbers[[0, 2]], kept.numbers[[0, 2]])


def test_a_step_of_ones_own_is_taken() -> None:
    class Generous(SafflowerCore):
        def apply(self, plan: Any, outcome: Any) -> StepResult:
            result = super().apply(plan, outcome)
            return result._replace(rewards=result.rewards + 1.0)

    core = rules_of(IDS[0])
    own = Generous(core.config, core.perception, WORLDS)
    own.reset_rows(np.arange(WORLDS), [np.random.default_rng(i) for i in range(WORLDS)])
    core.reset_rows(np.arange(WORLDS), [np.random.default_rng(i) for i in range(WORLDS)])
    actions = legal(core, np.random.default_rng(2))
    terms = len(core.reward_names)
    ours, theirs = own.decide(actions).numbers, core.decide(actions).numbers
    same(ours[:, :terms], theirs[:, :terms] + 1.0)
    same(ours[:, terms:], theirs[:, terms:])
    assert own.planned is not None and Generous.decide is TaskCore.decide


def test_other_tables_and_another_state_are_noticed() -> None:
    core, rng = rules_of(IDS[0]), np.random.default_rng(3)
    core.decide(legal(core, rng))
    other = copy.deepcopy(core)
    actions = legal(core, rng)
    core.tables = core.tables._replace(time_limit_s=1.0)
    assert core.decide(actions).truncated.all()
    assert not other.decide(actions).truncated.any()
    core.state = copy.deepcopy(core.state)
    core.state.totals[:] = 0.0
    other.state.totals[:] = 0.0
    same(core.show().numbers, other.show().numbers)


def test_a_copy_remembers_the_plan_and_goes_on_by_itself() -> None:
    core, rng = rules_of(IDS[0]), np.random.default_rng(4)
    core.decide(legal(core, rng))
    other = copy.deepcopy(core)
    same(other.planned, core.planned)
    totals = core.state.totals.copy()
    other.decide(legal(other, rng))
    same(core.state.totals, totals)


@pytest.mark.skipif(bool(config.DISABLE_JIT), reason="kernels run as Python")  # type: ignore[attr-defined]
def test_a_stamp_sees_what_lies_on_a_desk() -> None:
    picker, trays = rules_of(IDS[0]), rules_of(IDS[1])
    tables, state, plan = (picker.tables,), picker.state, picker.planned
    lying = typeof(desk(tables, state, plan))
    stamp = stamps.stamp(SafflowerCore.deciding, [lying])
    assert stamp == stamps.stamp(SafflowerCore.deciding, [typeof(desk(tables, state, plan))])
    for parts in ((trays.rules(), state, plan), (tables, trays.state, plan), (tables, state, trays.planned)):
        assert stamp != stamps.stamp(SafflowerCore.deciding, [typeof(desk(*parts))])
