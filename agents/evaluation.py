"""What a policy scores on given seeds: all worlds in one batch on the analytic backend, one by one on PyBullet."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from .policies.base import Policy, act_single

Array = NDArray[np.float64]

MOST_DECISIONS = 20_000
BATCH = 256
"""Worlds stepped together; a batch gives what as many single environments give."""


@dataclass(frozen=True)
class Scores:
    """Results of n episodes, in the order of their seeds.

    Attributes:
        seeds: (n,).
        returns: (n,), sum of rewards.
        decisions: (n,), steps.
        scorecard: name -> (n,), at the end of each episode.
        decision_s: mean wall seconds that the policy took for a decision.
    """

    seeds: NDArray[np.int64]
    returns: Array
    decisions: NDArray[np.int64]
    scorecard: dict[str, Array]
    decision_s: float


def evaluate(
    make_policy: Callable[[Any], Policy],
    env_id: str,
    seeds: Sequence[int],
    *,
    backend: str = "analytic",
    on_episode: Callable[[int], None] = lambda finished: None,
    **kwargs: Any,
) -> Scores:
    """Play one episode a seed.

    Args:
        make_policy: gets the environment (``Env`` or ``VectorEnv``) and returns the policy.
        env_id: registered id.
        seeds: of the environment: the same seed is the same instance with the same luck for every policy.
        backend: ``"analytic"`` or ``"pybullet"``.
        on_episode: called with the number of finished episodes.
        **kwargs: of the environment (``scenario``, ``perception``, ...).

    Raises:
        ValueError: no seeds.
        RuntimeError: an episode does not end.
    """
    if len(seeds) == 0:
        raise ValueError("seeds are empty: give at least one")
    play = _alone if backend == "pybullet" else _together
    return play(make_policy, env_id, [int(seed) for seed in seeds], on_episode, kwargs)


def _together(
    make_policy: Callable[[Any], Policy],
    env_id: str,
    seeds: list[int],
    on_episode: Callable[[int], None],
    kwargs: dict[str, Any],
) -> Scores:
    parts = []
    for start in range(0, len(seeds), BATCH):
        parts.append(_batch(make_policy, env_id, seeds[start : start + BATCH], kwargs))
        on_episode(min(start + BATCH, len(seeds)))
    names = parts[0].scorecard
    decisions = np.concatenate([part.decisions for part in parts])
    return Scores(
        np.array(seeds),
        np.concatenate([part.returns for part in parts]),
        decisions,
        {name: np.concatenate([part.scorecard[name] for part in parts]) for name in names},
        sum(part.decision_s * part.decisions.sum() for part in parts) / float(decisions.sum()),
    )


def _batch(make_policy: Callable[[Any], Policy], env_id: str, seeds: list[int], kwargs: dict[str, Any]) -> Scores:
    n = len(seeds)
    env: Any = gym.make_vec(
        env_id, n, vectorization_mode="vector_entry_point", autoreset_mode=gym.vector.AutoresetMode.DISABLED, **kwargs
    )
    policy = make_policy(env)
    observation, _ = env.reset(seed=seeds)
    policy.reset(np.ones(n, bool))
    returns, decisions, over = np.zeros(n), np.zeros(n, np.int64), np.zeros(n, bool)
    scorecard: dict[str, Array] = {name: np.zeros(n) for name in env.unwrapped.core.score_names}
    thought_s = 0.0
    for _ in range(MOST_DECISIONS):
        began = time.perf_counter()
        actions = policy.act(observation)
        thought_s += time.perf_counter() - began
        observation, reward, terminated, truncated, info = env.step(actions)
        # Worlds that are over step along in the batch; nothing of that is counted.
        running = ~over
        returns[running] += reward[running]
        decisions += running
        ending = running & (terminated | truncated)
        if ending.any():
            for name, values in scorecard.items():
                values[ending] = info["scorecard"][name][ending]
            over |= ending
            if over.all():
                break
    else:
        raise RuntimeError(f"no end after {MOST_DECISIONS} decisions: the policy never finishes this scenario")
    env.close()
    return Scores(np.array(seeds), returns, decisions, scorecard, thought_s / float(decisions.sum()))


def _alone(
    make_policy: Callable[[Any], Policy],
    env_id: str,
    seeds: list[int],
    on_episode: Callable[[int], None],
    kwargs: dict[str, Any],
) -> Scores:
    env: Any = gym.make(env_id, backend="pybullet", disable_env_checker=True, **kwargs)
    returns, decisions, cards, thought_s = [], [], [], 0.0
    try:
        policy = make_policy(env)
        for number, seed in enumerate(seeds):
            observation, info = env.reset(seed=seed)
            policy.reset(np.ones(1, bool))
            total, steps, over = 0.0, 0, False
            while not over:
                if steps >= MOST_DECISIONS:
                    raise RuntimeError(f"no end after {MOST_DECISIONS} decisions: the policy never finishes")
                began = time.perf_counter()
                action = act_single(policy, observation)
                thought_s += time.perf_counter() - began
                observation, reward, terminated, truncated, info = env.step(action)
                total, steps, over = total + reward, steps + 1, terminated or truncated
            returns.append(total)
            decisions.append(steps)
            cards.append(info["scorecard"])
            on_episode(number + 1)
    finally:
        env.close()
    return Scores(
        np.array(seeds),
        np.array(returns),
        np.array(decisions),
        {name: np.array([float(card[name]) for card in cards]) for name in cards[0]},
        thought_s / max(sum(decisions), 1),
    )


def mean(values: Array) -> float:
    """Mean of the finite ones, NaN without any."""
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else math.nan
