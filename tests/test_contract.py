"""The Gymnasium contract that every environment keeps: checks, masks, determinism, and a batch that equals singles."""

import hashlib
import subprocess
import sys
import warnings
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from fieldgym.envs import env_ids, register, task

MODES = ("NextStep", "SameStep")
BOTH = [(env_id, backend) for env_id in env_ids() for backend in task(env_id).backends]


def legal_actions(mask: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A random legal action of every row."""
    return np.array([rng.choice(np.flatnonzero(row)) for row in mask])


def digest(value: object) -> bytes:
    if isinstance(value, dict):
        return b"".join(name.encode() + digest(part) for name, part in value.items())
    return np.asarray(value).tobytes()


def trajectory_hash(env_id: str, backend: str, seeds: range = range(8), decisions: int = 6) -> str:
    total = hashlib.sha256()
    env = gym.make(env_id, backend=backend)
    for seed in seeds:
        observation, info = env.reset(seed=seed)
        rng = np.random.default_rng(seed)
        total.update(digest(observation) + digest(info))
        for _ in range(decisions):
            step = env.step(int(rng.choice(np.flatnonzero(info["action_mask"]))))
            info = step[-1]
            total.update(b"".join(digest(part) for part in step))
            if step[2] or step[3]:
                break
    env.close()
    return total.hexdigest()


@pytest.mark.parametrize("env_id", env_ids())
def test_registration_is_idempotent_and_named_module_works(env_id):
    register()
    env = gym.make("fieldgym:" + env_id, backend="analytic")
    assert env.spec is not None and env.spec.id == env_id
    assert gym.spec(env_id).to_json()


@pytest.mark.parametrize(("env_id", "backend"), BOTH)
def test_gymnasium_checker_has_nothing_to_say(env_id, backend):
    env = gym.make(env_id, backend=backend, disable_env_checker=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=True)
    env.close()
    env.close()


@pytest.mark.parametrize(("env_id", "backend"), BOTH)
def test_stable_baselines_checker_has_nothing_to_say(env_id, backend):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    env = gym.make(env_id, backend=backend)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(env, warn=True, skip_render_check=True)
        checker.check_env(env.unwrapped, warn=True, skip_render_check=True)
    env.close()


@pytest.mark.parametrize(("env_id", "backend"), BOTH)
def test_same_trajectories_in_different_processes(env_id, backend):
    code = f"import test_contract as t; print(t.trajectory_hash({env_id!r}, {backend!r}))"
    command, folder = [sys.executable, "-c", code], Path(__file__).parent
    runs = [subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    hashes = {run.communicate()[0].split()[-1] for run in runs}
    assert all(run.returncode == 0 for run in runs)
    assert len(hashes) == 1


@pytest.mark.parametrize("env_id", env_ids())
def test_masks_agree_and_arrays_are_never_shared(env_id):
    env = gym.make(env_id, backend="analytic")
    observation, info = env.reset(seed=1)
    rng = np.random.default_rng(1)
    for _ in range(5):
        masks = env.get_wrapper_attr("action_masks")()
        assert masks.dtype == bool and masks.any()
        assert np.array_equal(observation["action_mask"], info["action_mask"])
        assert np.array_equal(masks, info["action_mask"].astype(bool))
        kept = {name: values.copy() for name, values in observation.items()}
        following = env.step(int(rng.choice(np.flatnonzero(masks))))
        assert all(np.array_equal(values, kept[name]) for name, values in observation.items())
        assert not any(np.shares_memory(values, following[0][name]) for name, values in observation.items())
        assert following[-1].keys() == info.keys() and "episode" not in info
        assert [type(part) for part in following[1:4]] == [float, bool, bool]
        observation, info = following[0], following[-1]


BATCHES = [(env_id, task(env_id).headline, "NextStep", 64, 110) for env_id in env_ids()]
BATCHES += [(env_id, task(env_id).scenarios[-1], mode, 8, 400) for env_id in env_ids() for mode in MODES]


@pytest.mark.slow
@pytest.mark.parametrize(("env_id", "scenario", "mode", "worlds", "decisions"), BATCHES)
def test_batch_equals_single_worlds(env_id, scenario, mode, worlds, decisions):
    """On equal seeds and actions, every array of every world, through the ends of episodes."""
    batch = gym.make_vec(
        env_id, num_envs=worlds, vectorization_mode="vector_entry_point", scenario=scenario, autoreset_mode=mode
    )
    singles = [gym.make(env_id, backend="analytic", scenario=scenario) for _ in range(worlds)]
    together, info = batch.reset(seed=100)
    apart = [env.reset(seed=100 + i) for i, env in enumerate(singles)]
    over, ends = np.zeros(worlds, bool), 0
    rng = np.random.default_rng(0)
    for _ in range(decisions):
        for i, (observation, single_info) in enumerate(apart):
            for name, values in observation.items():
                assert np.array_equal(values, together[name][i])
            for part in ("rewards", "phases_s", "scorecard"):
                mine = np.array([single_info[part][key] for key in single_info[part]])
                theirs = np.array([info[part][key][i] for key in single_info[part]])
                assert np.array_equal(mine, theirs, equal_nan=True)
        actions = legal_actions(together["action_mask"], rng)
        together, reward, terminated, truncated, info = batch.step(actions)
        next_over = np.zeros(worlds, bool)
        for i, env in enumerate(singles):
            if mode == "NextStep" and over[i]:
                apart[i] = env.reset()
                assert reward[i] == 0.0 and not terminated[i] and not truncated[i]
                continue
            observation, single_reward, end, cut, single_info = env.step(int(actions[i]))
            assert (single_reward, end, cut) == (reward[i], terminated[i], truncated[i])
            next_over[i] = end or cut
            if mode == "SameStep" and next_over[i]:
                last = info["final_obs"][i]
                assert all(np.array_equal(values, last[name]) for name, values in observation.items())
                apart[i] = env.reset()
            else:
                apart[i] = observation, single_info
        over = next_over
        ends += int(over.sum())
    assert ends > 0 or decisions < 200
    assert batch.metadata["autoreset_mode"].value == mode
