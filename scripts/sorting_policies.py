"""Compare sorting policies over the tiers of offered load, on paired streams.

    python scripts/sorting_policies.py [--seeds 100] [--first-seed 20000] [--scenarios load-0.7,load-1.0]
        [--perception model]

Analytic backend; every policy meets the same streams. No parameter was set on seeds from 20000 on. "Over fifo" is how
many points of net rate a policy is ahead of the queue, stream by stream; intervals hold 95 % (bootstrap over streams).
"""

from __future__ import annotations

import argparse

from rich.console import Console
from rich.table import Column, Table

import fieldgym
from fieldgym.agents import policy_names, reference_policy
from fieldgym.agents.evaluation import Scores
from fieldgym.benchmark.statistics import mean, paired_difference
from fieldgym.envs.sorting.config import SCENARIOS
from fieldgym.scripts.comparison import play, words

ENV_ID = next(env_id for env_id in fieldgym.env_ids() if "Sorting" in env_id)
REFERENCE = reference_policy(ENV_ID)


def table_of(title: str, found: dict[str, Scores]) -> Table:
    """Policies in the order of their net rate."""
    table = Table(
        Column("policy", no_wrap=True),
        *("net rate, %", f"over {REFERENCE}, points", "value rate, %", "cycle time, s", "picks/min"),
        *("misplaced, %", "dropped, %", "wasted grips, %", "waiting, %"),
        title=title,
    )
    base = found[REFERENCE].scorecard["net_rate"]
    for name in sorted(found, key=lambda name: -found[name].scorecard["net_rate"].mean()):
        card = found[name].scorecard
        items, time_s = card["total"].sum(), card["duration_s"].sum()
        grips = sum(card[part].sum() for part in ("done", "misplaced", "damaged", "wasted"))
        table.add_row(
            name,
            words(mean(card["net_rate"]), 1, 100.0),
            "-" if name == REFERENCE else words(paired_difference(card["net_rate"], base), 1, 100.0),
            words(mean(card["value_rate"]), 1, 100.0),
            words(mean(card["cycle_time_s"]), 2),
            f"{mean(card['picks_per_min']).value:.1f}",
            *(f"{100.0 * card[part].sum() / items:.1f}" for part in ("misplaced", "damaged")),
            f"{100.0 * card['wasted'].sum() / grips:.1f}",
            f"{100.0 * card['phase_wait_s'].sum() / time_s:.0f}",
        )
    return table


def main() -> None:
    """Play and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seeds", type=int, default=100, help="number of streams (default 100)")
    parser.add_argument("--first-seed", type=int, default=20000)
    parser.add_argument("--scenarios", default=",".join(SCENARIOS), help="names, with commas between")
    parser.add_argument("--perception", default="model", choices=("model", "perfect"))
    options = parser.parse_args()
    console, seeds = Console(width=160), range(options.first_seed, options.first_seed + options.seeds)
    for scenario in options.scenarios.split(","):
        settings = {"scenario": scenario, "perception": options.perception}
        found = {name: play(ENV_ID, name, seeds, **settings) for name in policy_names(ENV_ID)}
        title = f"{scenario}, {options.perception} perception, seeds {seeds[0]}-{seeds[-1]}"
        console.print(table_of(title, found))


if __name__ == "__main__":
    main()
