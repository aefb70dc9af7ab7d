"""What the scripts that compare rules over a task's tiers share."""

from __future__ import annotations

from typing import Any

from fieldgym.agents import make_policy
from fieldgym.agents.evaluation import Scores, evaluate
from fieldgym.benchmark.episode import POLICY_SEEDS
from fieldgym.benchmark.statistics import Estimate


def play(env_id: str, policy: str, seeds: range, **settings: Any) -> Scores:
    """Scores of a policy by name, an episode a seed; ``settings`` of the environment."""

    def make(env: Any) -> Any:
        return make_policy(policy, env, seed=POLICY_SEEDS)

    return evaluate(make, env_id, seeds, **settings)


def words(estimate: Estimate, digits: int, scale: float = 1.0) -> str:
    """An estimate with its interval."""
    value, low, high = (scale * x for x in (estimate.value, estimate.low, estimate.high))
    return f"{value:.{digits}f} [{low:.{digits}f}, {high:.{digits}f}]"
