"""How an episode is played: the one loop in which a policy decides, for one environment and for a batch."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .policies.base import Actions, Observation, Policy, act_single

MOST_DECISIONS = 20_000
"""Decisions after which an episode is called endless: a policy that never drives on must not hang anything."""


class Decision(NamedTuple):
    """One decision of one environment, once it is carried out.

    Attributes:
        observation: what the policy saw.
        action: what it chose.
        thought_s: how long it thought, on the clock that was asked for.
        reward: what that brought.
        terminated: the task is over.
        truncated: the time is up.
        info: of the environment, after it.
        after: what there is to see then.
    """

    observation: Observation
    action: int
    thought_s: float
    reward: float
    terminated: bool
    truncated: bool
    info: dict[str, Any]
    after: Observation

    @property
    def last(self) -> bool:
        """Whether the episode ends with it."""
        return self.terminated or self.truncated


class BatchDecision(NamedTuple):
    """One decision in every world of a batch, once it is carried out.

    Attributes:
        observation: what the policy saw, arrays with a leading world axis.
        actions: what it chose, (B,).
        thought_s: how long it thought.
        rewards: (B,); of worlds that were over before they mean nothing.
        under_way: (B,), worlds whose episode was not over before it.
        ending: (B,), those of them whose episode ends with it.
        info: of the environment, after it.
    """

    observation: Observation
    actions: Actions
    thought_s: float
    rewards: NDArray[np.float64]
    under_way: NDArray[np.bool_]
    ending: NDArray[np.bool_]
    info: dict[str, Any]


def decisions(
    env: Any, policy: Policy, observation: Observation, clock: Callable[[], float] = time.perf_counter
) -> Iterator[Decision]:
    """Play an episode to its end; whoever stops asking stops it.

    Args:
        env: was reset just now.
        policy: begins anew.
        observation: of the reset.
        clock: seconds by which thinking is measured.

    Raises:
        RuntimeError: the episode does not end.
    """
    policy.reset(np.ones(1, bool))
    for _ in range(MOST_DECISIONS):
        before = clock()
        action = act_single(policy, observation)
        thought_s = clock() - before
        seen = observation
        observation, reward, terminated, truncated, info = env.step(action)
        yield Decision(seen, action, thought_s, float(reward), bool(terminated), bool(truncated), info, observation)
        if terminated or truncated:
            return
    raise RuntimeError(_endless())


def batch_decisions(env: Any, policy: Policy, observation: Observation) -> Iterator[BatchDecision]:
    """Play an episode in every world until all are over; worlds that are over step along and do not count.

    Args:
        env: a ``VectorEnv`` without autoreset, reset just now.
        policy: begins anew in every world.
        observation: of the reset.

    Raises:
        RuntimeError: an episode does not end.
    """
    under_way = np.ones(env.num_envs, bool)
    policy.reset(under_way.copy())
    for _ in range(MOST_DECISIONS):
        before = time.perf_counter()
        actions = policy.act(observation)
        thought_s = time.perf_counter() - before
        seen = observation
        observation, rewards, terminated, truncated, info = env.step(actions)
        ending = under_way & (terminated | truncated)
        yield BatchDecision(seen, actions, thought_s, rewards, under_way, ending, info)
        under_way = under_way & ~ending
        if not under_way.any():
            return
    raise RuntimeError(_endless())


def begin(env: Any, seed: int, field: str | PathLike[str] | None = None) -> tuple[Observation, dict[str, Any]]:
    """Reset an environment to a seed, or to a field and a seed for what the field leaves open."""
    return env.reset(seed=seed) if field is None else env.reset(seed=seed, options={"field": field})


def _endless() -> str:
    return f"no end after {MOST_DECISIONS} decisions: the policy never finishes this scenario"
