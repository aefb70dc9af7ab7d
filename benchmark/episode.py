"""One episode of one policy, from reset to the end, as a record of plain JSON values."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Protocol

import gymnasium as gym
import numpy as np

from .. import agents
from ..agents.policies.base import Policy, act_single
from ..agents.rollout import begin, decisions
from ..envs.task import task
from ..kernels.seeds import POLICY_SEEDS
from . import limits
from .record import Record, failed, identity, plain, plain_number
from .report.timeline import TimelineRecorder
from .suites import BOUND, Episode


def never() -> bool:
    """For episodes that nothing stops."""
    return False


class RunEpisode(Protocol):
    """What a worker calls: ``run_episode``, or a stand-in that can be pickled."""

    def __call__(self, episode: Episode, cancelled: Callable[[], bool]) -> Record:
        """Run ``episode``, asking ``cancelled`` now and then."""
        ...


class EpisodeCancelledError(Exception):
    """The benchmark is being stopped; the episode leaves no record."""


def run_episode(episode: Episode, cancelled: Callable[[], bool] = never) -> Record:
    """Run one episode to its end; for ``BOUND``, compute what none can beat.

    Args:
        episode: what to run.
        cancelled: asked before every decision; once true, the episode is given up.

    Returns:
        The record; an exception inside the environment or the policy becomes its ``error``.

    Raises:
        EpisodeCancelledError: ``cancelled`` said so.
    """
    try:
        result = limits.bound(episode) if episode.policy == BOUND else _play(episode, cancelled)
        return {**identity(episode), **result}
    except EpisodeCancelledError:
        raise
    except Exception as error:
        return failed(episode, f"{type(error).__name__}: {error}")


def _play(episode: Episode, cancelled: Callable[[], bool]) -> Record:
    started = time.perf_counter()
    where = episode.condition
    task(where.env_id)  # registers it
    env: Any = gym.make(where.env_id, backend=where.backend, disable_env_checker=True, **where.settings)
    try:
        observation, info = begin(env, episode.seed, None if episode.field is None else episode.field.path)
        # What loads or compiles at a first decision is no thinking: another policy of the same name decides it before.
        act_single(_policy(episode, env), observation)
        policy = _policy(episode, env)
        recorder, words = TimelineRecorder(), [] if episode.timeline else None
        began_s = float(info["scorecard"]["duration_s"])
        total, terms = 0.0, dict.fromkeys(info["rewards"], 0.0)
        thinking: list[float] = []
        last_s = thought_before_last_s = 0.0
        terminated = False
        if cancelled():
            raise EpisodeCancelledError
        for decision in decisions(env, policy, observation, time.thread_time):
            cycle_time_s, info = info["scorecard"]["cycle_time_s"], decision.info
            thinking.append(decision.thought_s)
            recorder.add(info)
            if words is not None:
                words.append(env.unwrapped.describe_last_decision())
            if info["scorecard"]["cycle_time_s"] != cycle_time_s:  # a target was finished
                last_s, thought_before_last_s = float(info["scorecard"]["duration_s"]), sum(thinking)
            total += decision.reward
            for name, value in info["rewards"].items():
                terms[name] += float(value)
            terminated = decision.terminated
            if not decision.last and cancelled():
                raise EpisodeCancelledError
    finally:
        env.close()
    return {
        "return": plain_number(total),
        "rewards": plain(terms),
        "steps": len(thinking),
        "terminated": terminated,
        "scorecard": plain(info["scorecard"]),
        "last_s": last_s,
        "wall_s": time.perf_counter() - started,
        "decision_s": sum(thinking),
        "decision_p95_ms": 1000.0 * float(np.percentile(thinking, 95.0)),
        "decision_before_last_s": thought_before_last_s,
        "curve": recorder.curve(),
        **({} if words is None else {"timeline": {"began_s": began_s, "words": words, **recorder.timeline()}}),
    }


def _policy(episode: Episode, env: Any) -> Policy:
    seed = POLICY_SEEDS + episode.seed
    if episode.source is not None:
        return episode.source.make(env, seed)
    return agents.make_policy(episode.policy, env, seed=seed)
