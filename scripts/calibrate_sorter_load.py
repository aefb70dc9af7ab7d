"""Find the sorter's reference cycle, by which the scenarios' loads are counted.

    python scripts/calibrate_sorter_load.py [--streams 200]

It runs ``fifo`` on the heaviest scenario with a perfect camera and prints the mean time of a grip, waiting left out:
what a machine needs for one item when it never lacks any. ``REFERENCE_CYCLE_S`` holds the figure.
"""

from __future__ import annotations

from typing import Annotated

import numpy as np
import typer

from fieldgym.agents.policies.sorting import Fifo
from fieldgym.envs.core import NominalExecutor
from fieldgym.envs.sorting.config import REFERENCE_CYCLE_S, SCENARIOS, PerceptionModel, SortingConfig
from fieldgym.envs.sorting.core import SortingCore
from fieldgym.envs.sorting.state import PICK


def busy_cycle_s(streams: int, scenario: str = "load-1.6") -> float:
    """Mean seconds of a grip without the wait before it."""
    core = SortingCore(SortingConfig(scenario=SCENARIOS[scenario]), PerceptionModel.perfect(), streams)
    executor, policy = NominalExecutor(core), Fifo()
    core.reset_rows(np.arange(streams), [np.random.default_rng(9_000_000 + row) for row in range(streams)])
    running, seconds, grips = np.ones(streams, bool), 0.0, 0
    while running.any():
        plan = core.plan(policy.act(core.observe()))
        outcome = executor.execute(plan)
        chosen = (plan.kind == PICK) & running
        seconds += float(outcome.phases_s[chosen, 1:].sum())
        grips += int(chosen.sum())
        running &= ~core.apply(plan, outcome).terminated
    return seconds / grips


def main(streams: Annotated[int, typer.Option(min=1)] = 200) -> None:
    """Find the sorter's reference cycle, by which the scenarios' loads are counted."""
    print(f"busy cycle {busy_cycle_s(streams):.3f} s; REFERENCE_CYCLE_S = {REFERENCE_CYCLE_S}")


if __name__ == "__main__":
    typer.run(main)
