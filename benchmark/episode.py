"""One episode of one policy, from reset to the end, as a record of plain JSON values."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from .suites import Episode

if TYPE_CHECKING:
    import gymnasium as gym

Record = dict[str, Any]
"""What an episode leaves: its conditions (``env_id``, ``scenario``, ``backend``, ``perception``, ``policy``, ``seed``),
then ``return``, ``rewards``, ``steps``, ``terminated``, ``scorecard``, ``wall_s``, ``decision_s``; or ``error``."""

MAX_STEPS = 20_000
"""Decisions after which an episode is called endless: a policy that never drives on must not hang a benchmark."""


POLICY_SEEDS = 1_000_000
"""Added to the environment's seed for the policy's: with equal seeds both would draw the same numbers."""


class EpisodeCancelledError(Exception):
    """The benchmark is being stopped; the episode leaves no record."""


def identity(episode: Episode) -> Record:
    """The fields of a record that tell one episode from all others."""
    condition = episode.condition
    return {
        "env_id": condition.env_id,
        "scenario": condition.scenario,
        "backend": condition.backend,
        "perception": condition.perception,
        "policy": episode.policy,
        "seed": episode.seed,
    }


def run_episode(episode: Episode, cancelled: Callable[[], bool] = lambda: False) -> Record:
    """Run one episode to its end.

    Args:
        episode: what to run.
        cancelled: asked before every decision; once true, the episode is given up.

    Returns:
        The record; an exception inside the environment or the policy becomes its ``error``.

    Raises:
        EpisodeCancelledError: ``cancelled`` said so.
    """
    try:
        return {**identity(episode), **_play(episode, cancelled)}
    except EpisodeCancelledError:
        raise
    except Exception as error:
        return failed(episode, f"{type(error).__name__}: {error}")


def failed(episode: Episode, reason: str) -> Record:
    """The record of an episode that has no result."""
    return {**identity(episode), "error": " ".join(reason.split())}


def _play(episode: Episode, cancelled: Callable[[], bool]) -> Record:
    from ..agents import act_single, make_policy

    started = time.perf_counter()
    env = _make(episode)
    try:
        policy = make_policy(episode.policy, env, seed=POLICY_SEEDS + episode.seed)
        observation, info = env.reset(seed=episode.seed)
        policy.reset(np.ones(1, dtype=bool))
        total, decision_s, steps, terms = 0.0, 0.0, 0, dict.fromkeys(info["rewards"], 0.0)
        terminated = truncated = False
        while not (terminated or truncated):
            if cancelled():
                raise EpisodeCancelledError
            if steps >= MAX_STEPS:
                raise RuntimeError(f"no end after {MAX_STEPS} decisions: the policy never finishes this scenario")
            before = time.perf_counter()
            action = act_single(policy, observation)
            decision_s += time.perf_counter() - before
            observation, reward, terminated, truncated, info = env.step(action)
            total += float(reward)
            steps += 1
            for name, value in info["rewards"].items():
                terms[name] += float(value)
    finally:
        env.close()
    return {
        "return": _number(total),
        "rewards": plain(terms),
        "steps": steps,
        "terminated": bool(terminated),
        "scorecard": plain(info["scorecard"]),
        "wall_s": time.perf_counter() - started,
        "decision_s": decision_s,
    }


def _make(episode: Episode) -> gym.Env[Any, Any]:
    import gymnasium as gym

    from .. import envs  # noqa: F401  registers the ids

    condition = episode.condition
    return gym.make(
        condition.env_id,
        scenario=condition.scenario,
        backend=condition.backend,
        perception=condition.perception,
        disable_env_checker=True,
    )


def plain(values: Mapping[str, Any]) -> dict[str, float | None]:
    """Named values as JSON numbers; what is not finite (the cycle time of an episode without a cycle) is None."""
    return {name: _number(value) for name, value in values.items()}


def _number(value: Any) -> float | None:
    return float(value) if math.isfinite(value) else None
