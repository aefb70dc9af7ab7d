"""A batch whose worlds see with cameras is what as many single environments are, through ends, states and copies."""

from __future__ import annotations

import copy
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.envs.task import tasks
from fieldgym.testing import check_batch

QUICK = {"eyes": "classical", "pictures": "easy"}
SHORT: dict[str, dict[str, Any]] = {
    "fieldgym/SafflowerPicking-v0": {"scenario": "pots", "overrides": {"scenario.plants": 2}},
    "fieldgym/TrayTransplanting-v0": {"scenario": "fill", "overrides": {"scenario.time_limit_s": 15.0}},
    "fieldgym/LaserWeeding-v0": {"scenario": "load-1.25", **QUICK, "overrides": {"scenario.strip_m": 1.5}},
    "fieldgym/LaserWeedingSpeed-v0": {"scenario": "load-1.25", **QUICK, "overrides": {"scenario.strip_m": 1.5}},
    "fieldgym/HoeWeeding-v0": {"scenario": "load-1.25", **QUICK, "overrides": {"scenario.strip_m": 1.5}},
    "fieldgym/ProduceSorting-v0": {"scenario": "load-1.25", "overrides": {"scenario.stream_s": 5.0}},
}
"""Episodes that end within the tests' decisions."""
IDS = tuple(SHORT)


def made(env_id: str, n: int, mode: str = "NextStep") -> Any:
    return gym.make_vec(
        env_id,
        num_envs=n,
        vectorization_mode="vector_entry_point",
        perception="camera",
        autoreset_mode=mode,
        **SHORT[env_id],
    )


def played(env: Any, masks: Any, decisions: int, seed: int = 3) -> list[list[bytes]]:
    """What each world shows under random legal actions, which depend on the world alone."""
    rngs, shown = [np.random.default_rng([seed, i]) for i in range(env.num_envs)], []
    for _ in range(decisions):
        actions = [int(rng.choice(np.flatnonzero(mask))) for rng, mask in zip(rngs, masks, strict=True)]
        observation, reward, terminated, truncated, info = env.step(np.array(actions))
        masks = observation["action_mask"]
        parts = *observation.values(), reward, terminated, truncated, info["scorecard"]["duration_s"]
        shown.append([b"".join(part[i].tobytes() for part in parts) for i in range(env.num_envs)])
    return shown


def test_every_task_with_a_camera_is_tested():
    assert set(IDS) == {spec.id for spec in tasks() if "camera" in spec.perceptions and spec.id.startswith("fieldgym/")}


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("env_id", IDS)
def test_a_batch_with_cameras_is_as_many_single_environments(env_id, mode):
    check_batch(env_id, mode=mode, worlds=2, decisions=40, perception="camera", **SHORT[env_id])


@pytest.mark.parametrize("env_id", ["fieldgym/SafflowerPicking-v0", "fieldgym/LaserWeeding-v0"])
def test_a_world_sees_the_same_whatever_is_beside_it(env_id):
    runs = []
    for n in (1, 3):
        env = made(env_id, n)
        masks = env.reset(seed=7)[0]["action_mask"]
        runs.append([shown[0] for shown in played(env, masks, 25)])
        env.close()
    assert runs[0] == runs[1]


@pytest.mark.parametrize("env_id", [name for name in IDS if "Speed" not in name])
def test_states_and_copies_remember_what_the_cameras_saw(env_id):
    env, other = made(env_id, 2), made(env_id, 2)
    masks = env.reset(seed=5)[0]["action_mask"]
    played(env, masks, 7)
    state, masks = pickle.loads(pickle.dumps(env.get_state())), env.action_masks()
    twin = copy.deepcopy(env)
    after = played(env, masks, 12, seed=8)
    assert played(twin, twin.action_masks(), 12, seed=8) == after
    other.reset(seed=1)
    observation, _ = other.set_state(state)
    np.testing.assert_array_equal(observation["action_mask"], masks)
    assert played(other, masks, 12, seed=8) == after
    # And back, in the environment that the state came from.
    env.set_state(state)
    assert played(env, masks, 12, seed=8) == after


@pytest.mark.parametrize("env_id", ["fieldgym/TrayTransplanting-v0", "fieldgym/ProduceSorting-v0"])
def test_worlds_reset_one_by_one_and_take_fields(env_id):
    env = made(env_id, 2, "Disabled")
    single: Any = gym.make(env_id, backend="analytic", perception="camera", **SHORT[env_id]).unwrapped
    env.reset(seed=2)
    single.reset(seed=40)
    alone, info = single.reset(seed=11, options={"field": single.field})
    both, _ = env.reset(seed=[None, 11], options={"reset_mask": np.array([False, True]), "fields": [single.field]})
    for _ in range(10):
        for name, values in alone.items():
            np.testing.assert_array_equal(both[name][1], values, err_msg=name)
        action = int(np.flatnonzero(info["action_mask"])[0])
        alone, _, ended, cut, info = single.step(action)
        both, *_ = env.step(np.array([np.flatnonzero(both["action_mask"][0])[-1], action]))
        if ended or cut:
            break
    resting = env.get_state()
    env.set_state(resting)
    env.close()
