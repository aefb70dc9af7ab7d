"""What a policy scores on given seeds: all worlds in one batch where that is possible, else one by one."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from os import PathLike
from typing import Any

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from ..envs.task import task
from .policies.base import Policy
from .rollout import batch_decisions, begin, decisions

Array = NDArray[np.float64]
Fields = Sequence[str | PathLike[str]] | None

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
    fields: Sequence[str | PathLike[str]] | None = None,
    on_episode: Callable[[int], None] = lambda finished: None,
    **kwargs: Any,
) -> Scores:
    """Play one episode a seed.

    Args:
        make_policy: gets the environment (``Env`` or ``VectorEnv``) and returns the policy.
        env_id: registered id.
        seeds: of the environment: the same seed is the same instance with the same luck for every policy.
        backend: ``"analytic"`` or ``"pybullet"``.
        fields: files that are played instead of drawn fields, one a seed, which draws what the file leaves open.
        on_episode: called with the number of finished episodes.
        **kwargs: of the environment (``scenario``, ``perception``, ...).

    Raises:
        ValueError: no seeds, or not as many fields.
        RuntimeError: an episode does not end.
    """
    if len(seeds) == 0:
        raise ValueError("seeds are empty: give at least one")
    if fields is not None and len(fields) != len(seeds):
        raise ValueError(f"{len(fields)} fields for {len(seeds)} seeds: give one a seed")
    batched = backend == "analytic" and kwargs.get("perception") != "camera" and task(env_id).vector_entry_point
    play = _together if batched else partial(_alone, backend=backend)
    parts: list[Scores] = []
    for part in play(make_policy, env_id, [int(seed) for seed in seeds], fields, kwargs):
        parts.append(part)
        on_episode(sum(len(each.seeds) for each in parts))
    decisions = np.concatenate([part.decisions for part in parts])
    return Scores(
        np.array(seeds),
        np.concatenate([part.returns for part in parts]),
        decisions,
        {name: np.concatenate([part.scorecard[name] for part in parts]) for name in parts[0].scorecard},
        sum(part.decision_s * part.decisions.sum() for part in parts) / float(max(decisions.sum(), 1)),
    )


def _together(
    make_policy: Callable[[Any], Policy], env_id: str, seeds: list[int], fields: Fields, kwargs: dict[str, Any]
) -> Iterator[Scores]:
    """A batch of episodes at a time."""
    for start in range(0, len(seeds), BATCH):
        some = slice(start, start + BATCH)
        n = len(seeds[some])
        env: Any = gym.make_vec(
            env_id,
            n,
            vectorization_mode="vector_entry_point",
            autoreset_mode=gym.vector.AutoresetMode.DISABLED,
            **kwargs,
        )
        try:
            policy = make_policy(env)
            options = None if fields is None else {"fields": list(fields[some])}
            observation, _ = env.reset(seed=seeds[some], options=options)
            returns, counts, thought_s = np.zeros(n), np.zeros(n, np.int64), 0.0
            scorecard: dict[str, Array] = {name: np.zeros(n) for name in env.unwrapped.core.score_names}
            for decision in batch_decisions(env, policy, observation):
                under_way, ending = decision.under_way, decision.ending
                thought_s += decision.thought_s
                returns[under_way] += decision.rewards[under_way]
                counts += under_way
                if ending.any():
                    for name, values in scorecard.items():
                        values[ending] = decision.info["scorecard"][name][ending]
        finally:
            env.close()
        yield Scores(np.array(seeds[some]), returns, counts, scorecard, thought_s / float(counts.sum()))


def _alone(
    make_policy: Callable[[Any], Policy],
    env_id: str,
    seeds: list[int],
    fields: Fields,
    kwargs: dict[str, Any],
    backend: str,
) -> Iterator[Scores]:
    """An episode at a time."""
    env: Any = gym.make(env_id, backend=backend, disable_env_checker=True, **kwargs)
    try:
        policy = make_policy(env)
        for number, seed in enumerate(seeds):
            observation, info = begin(env, seed, None if fields is None else fields[number])
            total, steps, thought_s = 0.0, 0, 0.0
            for decision in decisions(env, policy, observation):
                thought_s += decision.thought_s
                total, steps, info = total + decision.reward, steps + 1, decision.info
            card = {name: np.array([float(value)]) for name, value in info["scorecard"].items()}
            yield Scores(np.array([seed]), np.array([total]), np.array([steps]), card, thought_s / max(steps, 1))
    finally:
        env.close()


def mean(values: Array) -> float:
    """Mean of the finite ones, NaN without any."""
    finite = values[np.isfinite(values)]
    return float(finite.mean()) if len(finite) else math.nan
