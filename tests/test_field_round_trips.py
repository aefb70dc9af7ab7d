"""Drawn, saved and loaded fields are the same episodes, bit for bit, for every task, single and batched."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.envs import env_ids, task
from fieldgym.envs.field_files import read_field, write_field

DECISIONS = 25


def told(value: Any, world: int | None = None) -> bytes:
    """Everything that a step gives of one world; a machine's fault, which no batch can have, apart."""
    if isinstance(value, Mapping):
        kept = {name: part for name, part in value.items() if name[0] != "_" and name != "fault"}
        return b"".join(name.encode() + told(part, world) for name, part in kept.items())
    return np.asarray(value if world is None else value[world]).tobytes()


def legal(mask: Any, dice: np.random.Generator) -> int:
    return int(dice.choice(np.flatnonzero(mask)))


def played(env: Any, seed: int, options: dict[str, Any] | None = None) -> list[bytes]:
    """What an episode of random legal actions tells, decision by decision."""
    observation, info = env.reset(seed=seed, options=options)
    told_so_far, dice = [told(observation) + told(info)], np.random.default_rng(3)
    for _ in range(DECISIONS):
        observation, reward, terminated, truncated, info = env.step(legal(info["action_mask"], dice))
        told_so_far.append(told(observation) + told(reward) + told(info))
        if terminated or truncated:
            break
    return told_so_far


def check(folder: Path, env_id: str, perception: str, fields: int) -> None:
    env: Any = gym.make(env_id, backend="analytic", perception=perception).unwrapped
    paths, episodes = [], []
    for seed in range(fields):
        episodes.append(played(env, seed))
        path = folder / f"{seed}.{('csv', 'geojson')[seed % 2]}"
        write_field(env.field, path)
        assert read_field(path, env.core.field_type) == env.field
        assert played(env, 1000 + seed, {"field": path}) == episodes[-1], path.name
        paths.append(path)
    env.close()
    batch: Any = gym.make_vec(env_id, fields, vectorization_mode="vector_entry_point", perception=perception)
    observation, info = batch.reset(seed=1000, options={"fields": paths})
    dice, rewards = [np.random.default_rng(3) for _ in paths], np.zeros(fields)
    for decision in range(DECISIONS + 1):
        for world, episode in enumerate(episodes):
            if decision < len(episode):
                reward = b"" if decision == 0 else told(rewards, world)
                assert told(observation, world) + reward + told(info, world) == episode[decision], (world, decision)
        actions = [legal(mask, dice[world]) for world, mask in enumerate(observation["action_mask"])]
        observation, rewards, _, _, info = batch.step(np.array(actions))
    batch.close()


def cases() -> list[Any]:
    return [
        pytest.param(env_id, perception, id=f"{env_id.split('/')[-1]}-{perception}")
        for env_id in env_ids()
        for perception in task(env_id).perceptions
        if perception != "camera"
    ]


@pytest.mark.parametrize(("env_id", "perception"), cases())
def test_a_loaded_field_is_the_same_episode(tmp_path: Path, env_id: str, perception: str):
    check(tmp_path, env_id, perception, fields=10)


@pytest.mark.slow
@pytest.mark.long
@pytest.mark.parametrize(("env_id", "perception"), cases())
def test_many_loaded_fields_are_the_same_episodes(tmp_path: Path, env_id: str, perception: str):
    check(tmp_path, env_id, perception, fields=200)
