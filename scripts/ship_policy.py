"""Put a trained policy into ``assets/policies/`` with what it scores in its card.

    python scripts/ship_policy.py results/train/SafflowerPicking-v0-row-0/best.npz --weakness "Slower cycles than ..."

The scores are those of seeds that neither training nor the choice of the weights has seen. Given a policy that ships
already, as ``assets/policies/SafflowerPicking-v0.row.npz``, it renews its scores: cameras, streams and rules change.
"""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import numpy as np
import typer
from rich.console import Console

from fieldgym.agents import make_policy, policy_names
from fieldgym.agents.evaluation import Scores, evaluate
from fieldgym.agents.learning.portable import load, save
from fieldgym.agents.learning.runs import LAST
from fieldgym.agents.policies.weights import LEARNED
from fieldgym.benchmark.statistics import mean, paired_difference
from fieldgym.kernels.seeds import POLICY_SEEDS, TUNED

ASSETS = Path(__file__).resolve().parents[1] / "assets" / "policies"
QUICK = 16
"""Seeds of the short check that the tests repeat."""


def main(
    path: Annotated[Path, typer.Argument(help="best.npz of a run.")],
    episodes: Annotated[int, typer.Option(help="Seeds 0 to N - 1.")] = 200,
    weakness: Annotated[list[str] | None, typer.Option(help="What it is known to do badly; may be repeated.")] = None,
) -> None:
    """Evaluate, write the card, copy."""
    policy = load(path)
    card = dict(policy.card)
    if path.resolve().parent != ASSETS:
        # The weights may come from before the run's end.
        run = load(path.parent / LAST).card
        card["learning_curve"], card["settings"] = run["learning_curve"], run["settings"]
    env_id, scenario = str(card["env_id"]), str(card["scenario"])
    seeds = TUNED.take(episodes)

    def scores_of(name: str) -> Scores:
        def make(env: Any) -> Any:
            return policy.fitted(env) if name == LEARNED else make_policy(name, env, POLICY_SEEDS)

        return evaluate(make, env_id, seeds, scenario=scenario)

    own = scores_of(LEARNED)
    card["scores"] = {
        "backend": "analytic",
        "seeds": [0, episodes - 1],
        **{name: _three(mean(values)) for name, values in _figures(own).items()},
        "minus": {
            name: {
                key: _three(paired_difference(values, _figures(other)[key])) for key, values in _figures(own).items()
            }
            for name in policy_names(env_id)
            if name not in (LEARNED, "random")
            for other in (scores_of(name),)
        },
    }
    card["check"] = {"seeds": [0, QUICK - 1], "return": float(np.mean(own.returns[:QUICK]))}
    card["known_weaknesses"] = list(weakness or card.get("known_weaknesses", []))
    target = ASSETS / f"{env_id.split('/')[-1]}.{scenario}.npz"
    ASSETS.mkdir(parents=True, exist_ok=True)
    save(target, policy, card)
    Console().print(f"{target}: {target.stat().st_size} bytes; return {card['scores']['return']}")


def _figures(scores: Scores) -> dict[str, np.ndarray]:
    names = ("net_rate", "cycle_time_s", "throughput_per_min")
    return {"return": scores.returns, **{name: scores.scorecard[name] for name in names}}


def _three(estimate: Any) -> list[float]:
    """Value and interval."""
    return [round(float(value), 6) for value in (estimate.value, estimate.low, estimate.high)]


if __name__ == "__main__":
    typer.run(main)
