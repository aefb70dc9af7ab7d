"""Decisions a second of every environment: one world, batches, the machine in PyBullet.

What the reference policy decides is written down first and then played again: nothing thinks between two timed steps.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from fieldgym.agents import act_single, make_policy, reference_policy
from fieldgym.envs import env_ids
from fieldgym.scripts.speed_lines import Line

UNIT = "decisions/s"
BATCHES = {1: 25_000.0, 64: 500_000.0, 1024: 1_000_000.0}
"""Worlds of a batch, and decisions a second that it should reach."""
DRAWN = {"fieldgym/ProduceSorting-v0": 450_000.0}
"""What 1024 worlds should reach where drawing a field is a large part of a step."""
PYBULLET = {"fieldgym/SafflowerPicking-v0": 186.0, "fieldgym/ProduceSorting-v0": 164.0}
"""Twice as many as with 240 steps a simulated second."""


def decisions(quick: bool) -> Iterator[Line]:
    """Of every environment, playing what its reference policy decided."""
    for env_id in env_ids():
        name = env_id.removeprefix("fieldgym/").removesuffix("-v0")
        yield Line(f"{name}, single", single_decisions(env_id, quick, backend="analytic"), UNIT, 40_000.0)
        for worlds, target in BATCHES.items():
            wanted = DRAWN.get(env_id, target) if worlds == max(BATCHES) else target
            yield Line(f"{name}, batch of {worlds:,}", batch_decisions(env_id, worlds, quick), UNIT, wanted)
        rate = single_decisions(env_id, quick, backend="pybullet", perception="perfect")
        yield Line(f"{name}, PyBullet", rate, UNIT, PYBULLET.get(env_id))


def single_decisions(env_id: str, quick: bool, **settings: Any) -> float:
    """Decisions a second of a single environment as ``gym.make`` gives it, resets included."""
    env = gym.make(env_id, **settings)
    policy = make_policy(reference_policy(env_id), env)
    steps = (60 if quick else 150) if settings["backend"] == "pybullet" else (500 if quick else 1_500)
    stretches = 3 if quick else 5

    def played(actions: Iterable[int] | None) -> Iterator[tuple[int, float]]:
        """Decisions, given or the policy's, and the seconds of each."""
        observation, _ = env.reset(seed=0)
        for action in actions or (act_single(policy, observation) for _ in range(stretches * steps)):
            start = time.thread_time()
            observation, _, end, cut, _ = env.step(action)
            if end or cut:
                observation, _ = env.reset()
            yield action, time.thread_time() - start

    actions = [action for action, _ in played(None)]
    seconds = np.array([spent for _, spent in played(actions)])
    env.close()
    return steps / seconds.reshape(stretches, steps).sum(axis=1).min()


def batch_decisions(env_id: str, worlds: int, quick: bool, **settings: Any) -> float:
    """Decisions a second of the vector environment, resets included."""
    env = gym.make_vec(env_id, num_envs=worlds, vectorization_mode="vector_entry_point", **settings)
    steps = max(60 if quick else 200, 1_000 // worlds)
    stepping = []
    for actions in chosen(env, reference_policy(env_id), steps):
        start = time.thread_time()
        env.step(actions)
        stepping.append(time.thread_time() - start)
    env.close()
    # Sums over stretches of steps keep the resets in; the best stretch is the least disturbed one.
    stretch = [sum(stepping[i : i + steps // 5]) for i in range(0, steps - steps // 5 + 1, steps // 5)]
    return worlds * (steps // 5) / min(stretch)


def chosen(env: Any, name: str, steps: int) -> list[NDArray[np.int64]]:
    """What a policy decides in a batch of environments, which then stands again where that began.

    A planner that thinks between two steps leaves the caches full of its own: a step after it took three times as long.
    """
    policy, decided = make_policy(name, env), []
    observation, _ = env.reset(seed=0)
    for _ in range(steps):
        decided.append(np.array(policy.act(observation)))
        observation, *_ = env.step(decided[-1])
    env.reset(seed=0)
    return decided
