"""One episode of one policy, from reset to the end, as a record of plain JSON values."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from . import limits
from .record import Record, failed, identity, plain, plain_number
from .report.timeline import TimelineRecorder
from .suites import BOUND, Episode

if TYPE_CHECKING:
    import gymnasium as gym

MAX_STEPS = 20_000
"""Decisions after which an episode is called endless: a policy that never drives on must not hang a benchmark."""


POLICY_SEEDS = 1_000_000
"""Added to the environment's seed for the policy's: with equal seeds both would draw the same numbers."""


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
    from ..agents import act_single, make_policy

    started = time.perf_counter()
    env = _make(episode)
    try:
        observation, info = env.reset(seed=episode.seed)
        # What loads or compiles at a first decision is no thinking: another policy of the same name decides it before.
        act_single(make_policy(episode.policy, env, seed=POLICY_SEEDS + episode.seed), observation)
        policy = make_policy(episode.policy, env, seed=POLICY_SEEDS + episode.seed)
        policy.reset(np.ones(1, dtype=bool))
        recorder, words = TimelineRecorder(), [] if episode.timeline else None
        began_s = float(info["scorecard"]["duration_s"])
        total, terms = 0.0, dict.fromkeys(info["rewards"], 0.0)
        thinking: list[float] = []
        last_s = thought_before_last_s = 0.0
        terminated = truncated = False
        while not (terminated or truncated):
            if cancelled():
                raise EpisodeCancelledError
            if len(thinking) >= MAX_STEPS:
                raise RuntimeError(f"no end after {MAX_STEPS} decisions: the policy never finishes this scenario")
            before = time.thread_time()
            action = act_single(policy, observation)
            thinking.append(time.thread_time() - before)
            cycle_time_s = info["scorecard"]["cycle_time_s"]
            observation, reward, terminated, truncated, info = env.step(action)
            recorder.add(info)
            if words is not None:
                words.append(env.unwrapped.describe_last_decision())  # type: ignore[attr-defined]
            if info["scorecard"]["cycle_time_s"] != cycle_time_s:  # a target was finished
                last_s, thought_before_last_s = float(info["scorecard"]["duration_s"]), sum(thinking)
            total += float(reward)
            for name, value in info["rewards"].items():
                terms[name] += float(value)
    finally:
        env.close()
    return {
        "return": plain_number(total),
        "rewards": plain(terms),
        "steps": len(thinking),
        "terminated": bool(terminated),
        "scorecard": plain(info["scorecard"]),
        "last_s": last_s,
        "wall_s": time.perf_counter() - started,
        "decision_s": sum(thinking),
        "decision_p95_ms": 1000.0 * float(np.percentile(thinking, 95.0)),
        "decision_before_last_s": thought_before_last_s,
        "curve": recorder.curve(),
        **({} if words is None else {"timeline": {"began_s": began_s, "words": words, **recorder.timeline()}}),
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
