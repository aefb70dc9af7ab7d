"""Reset after reset, for ``torture.py``: what a reset leaves behind is found by the memory that is never given back."""

from __future__ import annotations

import gc
from typing import Any

import gymnasium as gym
import numpy as np

from fieldgym.scripts.torture_actions import own_ids
from fieldgym.scripts.torture_parts import Tally, check_observation, resident_mb

FLAT_MB = 4.0
"""What an allocator's own ups and downs come to; 10 000 resets that keep 400 bytes each are more."""
WARM = 0.1
"""Share of the resets before memory is first looked at."""
STEPS_EVERY, STEPS = 20, 5
PYBULLET = 0.02
"""Resets with a machine, by those without."""


def case(rng: np.random.Generator, number: int, tally: Tally, resets: int) -> None:
    """All resets of one environment: without a machine and, fewer, with one."""
    ids = own_ids()
    for backend, count in (("analytic", resets), ("pybullet", max(round(PYBULLET * resets), 2))):
        _reset(rng, ids[number % len(ids)], backend, count, tally)


def _reset(rng: np.random.Generator, env_id: str, backend: str, count: int, tally: Tally) -> None:
    perception = str(rng.choice(["perfect", "model"]))
    env: Any = gym.make(env_id, backend=backend, perception=perception, disable_env_checker=True).unwrapped
    warm_mb, what = float("nan"), f"{env_id} {backend} {perception}"
    for i in range(count):
        if i == int(WARM * count) + 1:
            gc.collect()
            warm_mb = resident_mb()
        observation, _ = env.reset(seed=int(rng.integers(2**31)) if i % 3 else None)
        check_observation(env.observation_space, observation, tally, what)
        if i % STEPS_EVERY == 0:
            for _ in range(STEPS):
                _, _, terminated, truncated, _ = env.step(int(rng.choice(np.flatnonzero(env.action_masks()))))
                if terminated or truncated:
                    break
    gc.collect()
    end_mb = resident_mb()
    env.close()
    tally.counts[f"resets {backend}"] += count
    name = f"{env_id.partition('/')[2]} {backend}"
    tally.figures[f"{name}, warm MB"], tally.figures[f"{name}, end MB"] = warm_mb, end_mb
    # NaN, where the system does not tell, is no fault.
    tally.hold(not end_mb - warm_mb > FLAT_MB, f"{what}: {warm_mb:.1f} MB grew to {end_mb:.1f} in {count} resets")
