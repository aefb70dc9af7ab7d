"""The Gymnasium contract of the sorter: checks, masks, determinism, and a batch that equals single worlds."""

import hashlib
import subprocess
import sys
import warnings
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from fieldgym.envs import register

ID = "fieldgym/ProduceSorting-v0"
BACKENDS = ("analytic", "pybullet")


def legal_actions(mask: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    """A random legal action of every row."""
    return np.array([rng.choice(np.flatnonzero(row)) for row in mask])


def digest(value: object) -> bytes:
    if isinstance(value, dict):
        return b"".join(name.encode() + digest(part) for name, part in value.items())
    return np.asarray(value).tobytes()


def trajectory_hash(backend: str, seeds: range = range(8), decisions: int = 12) -> str:
    total = hashlib.sha256()
    env = gym.make(ID, backend=backend)
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


def test_registration_is_idempotent_and_named_module_works():
    register()
    env = gym.make("fieldgym:" + ID, backend="analytic")
    assert env.spec is not None and env.spec.id == ID
    assert gym.spec(ID).to_json()


@pytest.mark.parametrize("backend", BACKENDS)
def test_gymnasium_checker_has_nothing_to_say(backend):
    env = gym.make(ID, backend=backend, disable_env_checker=True)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(env.unwrapped, skip_render_check=backend == "analytic")
    env.close()
    env.close()


@pytest.mark.parametrize("backend", BACKENDS)
def test_stable_baselines_checker_has_nothing_to_say(backend):
    checker = pytest.importorskip("stable_baselines3.common.env_checker")
    env = gym.make(ID, backend=backend)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        checker.check_env(env, warn=True, skip_render_check=True)
        checker.check_env(env.unwrapped, warn=True, skip_render_check=True)
    env.close()


@pytest.mark.parametrize("backend", BACKENDS)
def test_same_trajectories_in_different_processes(backend):
    code = f"import test_sorting_contract as t; print(t.trajectory_hash({backend!r}))"
    command, folder = [sys.executable, "-c", code], Path(__file__).parent
    runs = [subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True) for _ in range(2)]
    hashes = {run.communicate()[0].split()[-1] for run in runs}
    assert all(run.returncode == 0 for run in runs)
    assert len(hashes) == 1


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("scenario", ["load-1.25", "clumped-1.25"])
def test_batch_equals_single_worlds_through_episode_ends(mode, scenario):
    worlds, decisions = 12, 150
    batch = gym.make_vec(
        ID, num_envs=worlds, vectorization_mode="vector_entry_point", scenario=scenario, autoreset_mode=mode
    )
    singles = [gym.make(ID, backend="analytic", scenario=scenario) for _ in range(worlds)]
    together, info = batch.reset(seed=100)
    apart = [env.reset(seed=100 + i) for i, env in enumerate(singles)]
    over = np.zeros(worlds, bool)
    rng = np.random.default_rng(0)
    ends = 0
    for _ in range(decisions):
        for i, (observation, single_info) in enumerate(apart):
            for name, values in observation.items():
                assert np.array_equal(values, together[name][i])
            for part in ("rewards", "phases_s", "scorecard"):
                assert single_info[part] == {key: info[part][key][i] for key in single_info[part]}
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
                ends += 1
                last = info["final_obs"][i]
                assert all(np.array_equal(values, last[name]) for name, values in observation.items())
                final = info["final_info"]["scorecard"]
                assert single_info["scorecard"] == {key: final[key][i] for key in single_info["scorecard"]}
                apart[i] = env.reset()
            else:
                apart[i] = observation, single_info
        ends += int(over.sum()) if mode == "NextStep" else 0
        over = next_over
    assert ends >= worlds // 4
    assert batch.metadata["autoreset_mode"].value == mode
