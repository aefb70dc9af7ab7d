"""What a second thread brings to a batch, beside what a second process brings to this machine."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from typing import Any

import gymnasium as gym
import numpy as np

from fieldgym.envs import env_ids
from fieldgym.scripts.speed_lines import Line

WORLDS = {1_024: 1.7, 8_192: None}
"""Worlds of a batch, and what two threads should bring on two idle cores."""
_SPIN = "import time; a = time.perf_counter(); sum(i * i for i in range({})); print(time.perf_counter() - a)"


def threads(quick: bool) -> Iterator[Line]:
    """Steps by the wall's clock: two threads beside one, in turn, in one process."""
    yield Line("two processes at once, beside one", processes(2_000_000 if quick else 6_000_000), "x", note="control")
    for env_id in env_ids():
        name = env_id.removeprefix("fieldgym/").removesuffix("-v0")
        for worlds, target in WORLDS.items():
            gain = speed_up(env_id, worlds, (10 if quick else 40) if worlds > 2_000 else (40 if quick else 150))
            yield Line(f"{name}, 2 threads, batch of {worlds:,}", gain, "x", target)


def processes(count: int) -> float:
    """How much work two processes do at once, as multiples of what one does alone in that time; 2 on two idle cores."""

    def spin(copies: int) -> float:
        code = [sys.executable, "-c", _SPIN.format(count)]
        running = [subprocess.Popen(code, stdout=subprocess.PIPE, text=True) for _ in range(copies)]
        return max(float(one.communicate()[0]) for one in running)

    return 2.0 * min(spin(1) for _ in range(3)) / min(spin(2) for _ in range(3))


def speed_up(env_id: str, worlds: int, steps: int) -> float:
    """How many times as fast two threads step a batch as one does, resets included: the middle one of five stretches.

    Both play the same decisions, the first that are possible, in turns.
    """
    envs: list[Any] = [
        gym.make_vec(env_id, num_envs=worlds, vectorization_mode="vector_entry_point", threads=number)
        for number in (1, 2)
    ]
    for env in envs:
        env.reset(seed=0)
    spent: list[list[float]] = [[], []]
    for _ in range(5):
        for env, stretches in zip(envs, spent, strict=True):
            seconds = 0.0
            for _ in range(max(1, steps // 5)):
                actions = np.argmax(env.action_masks(), axis=1)
                start = time.perf_counter()
                env.step(actions)
                seconds += time.perf_counter() - start
            stretches.append(seconds)
    for env in envs:
        env.close()
    # The same stretch of both holds the same resets.
    return float(np.median([one / two for one, two in zip(*spent, strict=True)]))
