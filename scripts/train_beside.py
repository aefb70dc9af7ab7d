"""What stands beside a learner while it learns: scores of others on the seeds that its weights are chosen on."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from fieldgym.kernels.seeds import CHOOSING, POLICY_SEEDS

if TYPE_CHECKING:
    from fieldgym.agents.learning.runs import Progress

BOUNDED = 8
"""Fields whose bound is computed: a weeder's takes seconds, and the learner waits."""
WINDOW_S = 60.0
"""The time left is told from the pace of so many seconds, or of the last two updates where they took longer."""


def beside(env_id: str, scenario: str | None, episodes: int) -> dict[str, float]:
    """Mean returns of the reference, of ``best`` and of the bound on the first ``episodes`` seeds that runs choose on.

    The bound's is that of ``best`` plus how far above it the bound lies on ``BOUNDED`` of the fields.

    Args:
        env_id: of the task.
        scenario: its name or file; None for the headline.
        episodes: how many.

    Returns:
        By name, in this order; where ``best`` is the reference, or there is no bound, it is missing.
    """
    from fieldgym.agents.evaluation import evaluate
    from fieldgym.agents.sources import policy_source
    from fieldgym.bounds import instance
    from fieldgym.envs.task import BEST, task

    spec, seeds = task(env_id), CHOOSING.take(episodes)
    meant = spec.recommended(scenario or spec.headline)

    def returns(name: str) -> Any:
        source = policy_source(env_id, name)
        return evaluate(lambda env: source.make(env, POLICY_SEEDS + seeds[0]), env_id, seeds, scenario=scenario).returns

    reference = returns(spec.reference)
    best = reference if meant == spec.reference else returns(meant)
    found = {spec.reference: float(reference.mean())}
    if meant != spec.reference:
        found[f"{BEST} ({meant})"] = float(best.mean())
    if spec.bound is not None:
        known = [instance(env_id, seed, scenario=scenario, carried_out=False) for seed in seeds[:BOUNDED]]
        limits = [each.bound().episode_return for each in known]
        found["bound"] = float(best.mean() + (limits - best[:BOUNDED]).mean())
    return found


def told(scores: Mapping[str, float]) -> str:
    """Scores in words, names first."""
    return ", ".join(f"{name} {value:.3f}" for name, value in scores.items())


class TimeLeft:
    """Seconds that a run still takes at its latest pace; what it did before, or before a resume, does not count."""

    def __init__(self) -> None:
        """Begin with nothing."""
        self._seen: deque[tuple[float, int]] = deque()

    def after(self, progress: Progress, now_s: float | None = None) -> float | None:
        """From one update to the next; None before the second, or where nothing was learned since.

        Args:
            progress: of the run.
            now_s: time of a clock; the machine's by default.
        """
        now_s = time.perf_counter() if now_s is None else now_s
        self._seen.append((now_s, progress.steps))
        while len(self._seen) > 3 and now_s - self._seen[1][0] >= WINDOW_S:
            self._seen.popleft()
        (before_s, before), (_, steps) = self._seen[0], self._seen[-1]
        if steps <= before:
            return None
        return max(progress.total - steps, 0) * (now_s - before_s) / (steps - before)
