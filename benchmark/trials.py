"""Many episodes of one policy at once, in a batch of worlds, with numbers or eyes that are not the task's own."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from ..agents.rollout import batch_decisions
from ..envs.rates import HOUR_S, JOULES_PER_KWH, Rates, items
from ..envs.references import resolved
from ..envs.task import factories, task
from .rates import ACCEPTED, AREA_KWH, EACH_J, EACH_S, HECTARES, MET, WORK

Array = NDArray[np.float64]
Eyes = Callable[[Any], Any]
"""Changes a perception model."""


def trial(
    env_id: str,
    seeds: range,
    numbers: Mapping[str, Any] | None = None,
    eyes: Eyes | None = None,
    policy: str | None = None,
    scenario: str | None = None,
    perception: str = "model",
) -> dict[str, Array]:
    """Play an episode of each seed with the analytic backend, all side by side.

    Args:
        env_id: of the task.
        seeds: of the fields, without gaps.
        numbers: of the configuration that are changed, by dotted name.
        eyes: makes of the task's perception model the one that sees.
        policy: its name; None for the task's reference.
        scenario: its name; None for the headline.
        perception: ``"model"`` or ``"perfect"``.

    Returns:
        Scores (n,) by name: the scorecard, what ``rates`` derives from it, and ``return``.
    """
    spec = task(env_id)
    kind: Any = resolved(spec.vector_entry_point)
    parts, _ = kind.equipped({})
    if eyes is not None:
        seen = replace(parts, measured=lambda config, own=parts.measured: eyes(own(config)))
        kind = type(kind.__name__, (kind,), {"equipped": staticmethod(lambda settings: (seen, settings))})
    env = kind(
        len(seeds), scenario=scenario, perception=perception, overrides=numbers, autoreset_mode=AutoresetMode.DISABLED
    )
    try:
        observation, _ = env.reset(seed=seeds.start)
        player = resolved(factories(env_id)[policy or spec.reference])(env, 0)
        total, scores = np.zeros(len(seeds)), {}
        for decision in batch_decisions(env, player, observation):
            total += np.where(decision.under_way, decision.rewards, 0.0)
            if decision.ending.any():
                for name, values in decision.info["scorecard"].items():
                    if not name.startswith("_"):
                        kept = scores.setdefault(name, np.full(len(seeds), np.nan))
                        kept[decision.ending] = values[decision.ending]
        rates = items() if parts.rates is None else parts.rates(env.core.config)
    finally:
        env.close()
    scores["cycle_time_s"] = np.where(scores["done"] > 0.0, scores["cycle_time_s"], np.nan)
    return {**scores, **_rated(rates, scores), "return": total}


def _rated(rates: Rates, scores: Mapping[str, Array]) -> dict[str, Array]:
    """What the scorecards come to in a grower's units."""
    cards = [dict(zip(scores, values, strict=True)) for values in zip(*scores.values(), strict=True)]
    work = np.array([rates.per_h(card) for card in cards])
    joules = np.array([rates.joules(card) for card in cards])
    found = {WORK: work, EACH_S: scores["throughput_per_min"] / 60.0}
    found[EACH_J] = joules / np.where(scores["done"] > 0.0, scores["done"], np.nan)
    if rates.demanded > 0.0:
        met = scores["net_rate"] >= rates.demanded
        found |= {MET: met.astype(float), ACCEPTED: np.where(met, work, 0.0)}
    if rates.unit == HECTARES:
        found[AREA_KWH] = joules / JOULES_PER_KWH / (work * scores["duration_s"] / HOUR_S)
    return found
