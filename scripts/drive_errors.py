"""What drives that err cost: the reference policy on ``field``, with them and without.

    python scripts/drive_errors.py [--task LaserWeeding] [--seeds 200] [--physics 8]

Prints net rates in % and their paired difference with its 95 % interval, and with ``--physics N`` what PyBullet adds to
the cycle time in % and to the net rate in points on the first N fields.
"""

from __future__ import annotations

import argparse
from functools import partial

import numpy as np
from numpy.typing import NDArray

from fieldgym.agents import make_policy, reference_policy
from fieldgym.agents.evaluation import evaluate
from fieldgym.envs.drives import DriveErrors

FIRST_SEED = 700_000
TASKS = ("SafflowerPicking", "TrayTransplanting", "ProduceSorting", "LaserWeeding", "HoeWeeding")


def played(task: str, errs: bool, seeds: int, backend: str) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Net rates in % and cycle times in s of the reference policy, one a field, with drives that err or without."""
    env_id = f"fieldgym/{task}-v0"
    scores = evaluate(
        partial(make_policy, reference_policy(env_id)),
        env_id,
        range(FIRST_SEED, FIRST_SEED + seeds),
        backend=backend,
        perception="model",
        scenario="field",
        overrides={} if errs else {"scenario.drives": DriveErrors()},
    )
    return 100.0 * np.asarray(scores.scorecard["net_rate"]), np.asarray(scores.scorecard["cycle_time_s"])


def main() -> None:
    """Print what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", choices=TASKS, action="append")
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--physics", type=int, default=0)
    options = parser.parse_args()
    for task in options.task or TASKS:
        (off, _), (on, _) = (played(task, errs, options.seeds, "analytic") for errs in (False, True))
        half = 1.96 * (on - off).std(ddof=1) / np.sqrt(options.seeds)
        print(f"{task}: {off.mean():.2f} -> {on.mean():.2f}, {(on - off).mean():+.2f} +- {half:.2f}", flush=True)
        if options.physics:
            (planned, planned_s), (driven, driven_s) = (
                played(task, True, options.physics, backend) for backend in ("analytic", "pybullet")
            )
            longer = 100.0 * (driven_s.mean() / planned_s.mean() - 1.0)
            print(f"  PyBullet: {longer:+.2f} %, {driven.mean() - planned.mean():+.2f}", flush=True)


if __name__ == "__main__":
    main()
