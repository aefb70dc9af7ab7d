"""Compare the transplanter's policies on paired seeds: cycle time, net rate, rate, and the gains over the fixed order.

    python scripts/transplanting_policies.py [--seeds 100] [--scenarios fill,replug] [--motion stop-quintic]

All seeds of a scenario run as one batch with the analytic backend and the measured cameras. Length and time are counted
a planted seedling; gains are 1 - policy / fixed order, seed by seed. Every interval is a 95 % bootstrap interval.
"""

from __future__ import annotations

import argparse

import numpy as np
from rich.console import Console
from rich.table import Column, Table

import fieldgym
from fieldgym.agents import policy_names, reference_policy
from fieldgym.benchmark.statistics import mean, paired_difference
from fieldgym.envs.transplanting.config import MOTIONS, SCENARIOS
from fieldgym.scripts.comparison import play, words

ENV_ID = next(env_id for env_id in fieldgym.env_ids() if "Transplanting" in env_id)


def main() -> None:
    """Play and print."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--seeds", type=int, default=100, help="seeds 0 ... N - 1 (default 100)")
    parser.add_argument("--scenarios", default=",".join(SCENARIOS), help="names, with commas between")
    parser.add_argument("--motion", default="stop-quintic", choices=MOTIONS)
    options = parser.parse_args()
    console, reference, seeds = Console(), reference_policy(ENV_ID), range(options.seeds)
    for scenario in options.scenarios.split(","):
        table = Table(
            Column("policy", no_wrap=True),
            *("cycle time, s", "net rate, %", "seedlings/min", "shorter way, %", "shorter time, %"),
            title=f"{scenario}, {options.motion}, seeds 0-{options.seeds - 1}",
        )
        settings = {"scenario": scenario, "motion": options.motion}
        base = play(ENV_ID, reference, seeds, **settings).scorecard
        for name in policy_names(ENV_ID):
            found = base if name == reference else play(ENV_ID, name, seeds, **settings).scorecard
            gains = []
            for measure in ("travel_m", "duration_s"):
                each, other = (scores[measure] / np.maximum(scores["done"], 1.0) for scores in (found, base))
                gains.append(paired_difference(1.0 - each / other, np.zeros(options.seeds)))
            table.add_row(
                name,
                words(mean(found["cycle_time_s"]), 3),
                words(mean(found["net_rate"]), 2, 100.0),
                words(mean(found["throughput_per_min"]), 2),
                *("-" if name == reference else words(gain, 2, 100.0) for gain in gains),
            )
        console.print(table)


if __name__ == "__main__":
    main()
