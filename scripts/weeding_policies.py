"""Compare weeding policies over tiers of offered load, on paired strips.

    python scripts/weeding_policies.py [--id LaserWeeding] [--seeds 100] [--first-seed 20000]
        [--scenarios load-0.7,load-1.0] [--loads 0.3,0.5] [--perception model]

Analytic backend; every policy meets the same strips. No parameter was set on seeds from 20000 on. ``--loads`` adds
clumped tiers at other offered loads: they differ from the named ones in the cart's speed alone. "Behind" is how far a
policy stays behind the first of its table, strip by strip. Intervals hold 95 % (bootstrap over strips). "Busy" is the
share of the time in which the tool moves or works, "J/shot" says which doses are chosen.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
from rich.console import Console
from rich.table import Column, Table

import fieldgym
from fieldgym.agents import policy_names
from fieldgym.agents.evaluation import Scores
from fieldgym.agents.policies.weights import LEARNED
from fieldgym.benchmark.statistics import mean, paired_difference
from fieldgym.envs.weeding.config import SCENARIOS, ScenarioConfig
from fieldgym.scripts.comparison import play, words

WEEDING = {env_id.split("/")[1].split("-v")[0]: env_id for env_id in fieldgym.env_ids() if "Weeding" in env_id}


def tiers(names: list[str], loads: list[float]) -> dict[str, ScenarioConfig]:
    """Clumped tiers at other loads, then the named ones."""
    others = {f"load-{load:g}": replace(SCENARIOS["load-1.0"], offered_load=load) for load in loads}
    return others | {name: SCENARIOS[name] for name in names}


def config_of(env_id: str, scenario: ScenarioConfig) -> Any:
    """Configuration of an environment on a tier that need not have a name."""
    probe: Any = gym.make_vec(env_id, 1, vectorization_mode="vector_entry_point")
    return replace(probe.unwrapped.core.config, scenario=scenario)


def table_of(title: str, found: dict[str, Scores]) -> Table:
    """Policies in the order of their net rate."""
    table = Table(
        Column("policy", no_wrap=True),
        *("net rate, %", "behind, points", "return", "crop loss, %", "shots/weed", "J/shot", "kills/shot", "busy, %"),
        title=title,
    )
    order = sorted(found, key=lambda name: -found[name].scorecard["net_rate"].mean())
    best = found[order[0]].scorecard["net_rate"]
    for name in order:
        card = found[name].scorecard
        shots, time_s = np.maximum(card["shots"], 1.0).sum(), card["duration_s"].sum()
        idle_s = card["phase_pause_s"].sum() + card["phase_wait_s"].sum()
        behind = paired_difference(best, card["net_rate"])
        table.add_row(
            name,
            words(mean(card["net_rate"]), 2, 100.0),
            "-" if name == order[0] else words(behind, 2, 100.0),
            words(mean(found[name].returns), 1),
            f"{mean(card['crop_loss_percent']).value:.2f}",
            f"{shots / card['weeds'].sum():.3f}",
            f"{(card['joules_per_weed'] * card['done']).sum() / shots:.2f}",
            f"{card['done'].sum() / shots:.3f}",
            f"{100.0 * (1.0 - idle_s / time_s):.1f}",
        )
    return table


def main() -> None:
    """Play and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--id", default="LaserWeeding", choices=tuple(WEEDING))
    parser.add_argument("--seeds", type=int, default=100, help="number of strips (default 100)")
    parser.add_argument("--first-seed", type=int, default=20000)
    parser.add_argument("--scenarios", default=",".join(SCENARIOS), help="names, with commas between; may be empty")
    parser.add_argument("--loads", default="", help="further offered loads, with commas between")
    parser.add_argument("--perception", default="model", choices=("model", "perfect"))
    options = parser.parse_args()
    env_id, console = WEEDING[options.id], Console(width=160)
    seeds = range(options.first_seed, options.first_seed + options.seeds)
    names = [name for name in options.scenarios.split(",") if name]
    loads = [float(load) for load in options.loads.split(",") if load]
    for tier, scenario in tiers(names, loads).items():
        settings = {"config": config_of(env_id, scenario), "perception": options.perception}
        found = {name: play(env_id, name, seeds, **settings) for name in policy_names(env_id) if name != LEARNED}
        title = f"{options.id} {tier}, {options.perception} perception, seeds {seeds[0]}-{seeds[-1]}"
        console.print(table_of(title, found))


if __name__ == "__main__":
    main()
