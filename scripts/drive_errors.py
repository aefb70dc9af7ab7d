"""What drives that err cost: the reference policy on ``field``, with them and without.

    python scripts/drive_errors.py [--task LaserWeeding] [--seeds 200] [--physics 8] [--level]

Prints net rates in % and their paired difference with its 95 % interval, on how many fields there is none and how large
it is on the worst, and with ``--physics N`` what PyBullet adds to the cycle time in % and to the net rate in points on
the first N fields. ``--level`` takes the fields' rough ground away.
"""

from __future__ import annotations

import argparse
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fieldgym.agents import make_policy, reference_policy
from fieldgym.agents.evaluation import evaluate
from fieldgym.envs.drives import DriveErrors
from fieldgym.envs.weeding.ground_config import GroundConfig
from fieldgym.kernels.seeds import DRIVES

LEVEL = {
    "SafflowerPicking": {"scenario.ground.iso_class": "none"},
    "LaserWeeding": {"scenario.ground": GroundConfig()},
    "HoeWeeding": {"scenario.ground": GroundConfig()},
}
"""Tasks whose fields lie on rough ground, and what takes it away."""
TASKS = ("SafflowerPicking", "TrayTransplanting", "ProduceSorting", "LaserWeeding", "HoeWeeding")


def played(
    task: str, errs: bool, seeds: int, backend: str, level: bool = False
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Net rates in % and cycle times in s of the reference policy, one a field, with drives that err or without."""
    env_id = f"fieldgym/{task}-v0"
    overrides: dict[str, Any] = {} if errs else {"scenario.drives": DriveErrors()}
    overrides |= LEVEL[task] if level else {}
    overrides |= {"eyes": "classical", "pictures": "easy"} if "Weeding" in task else {}
    scores = evaluate(
        partial(make_policy, reference_policy(env_id)),
        env_id,
        DRIVES.take(seeds),
        backend=backend,
        perception="model",
        scenario="field",
        overrides=overrides,
    )
    return 100.0 * np.asarray(scores.scorecard["net_rate"]), np.asarray(scores.scorecard["cycle_time_s"])


def main() -> None:
    """Print what is asked for."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--task", choices=TASKS, action="append")
    parser.add_argument("--seeds", type=int, default=200)
    parser.add_argument("--physics", type=int, default=0)
    parser.add_argument("--level", action="store_true")
    options = parser.parse_args()
    for task in options.task or (LEVEL if options.level else TASKS):
        if options.level and task not in LEVEL:
            parser.error(f"--level: the fields of {task} have no ground, leave it out")
        (off, _), (on, _) = (played(task, errs, options.seeds, "analytic", options.level) for errs in (False, True))
        lost = on - off
        half = 1.96 * lost.std(ddof=1) / np.sqrt(options.seeds)
        spread = f"none on {(lost == 0.0).sum()} fields, {lost.min():+.1f} on the worst"
        print(f"{task}: {off.mean():.2f} -> {on.mean():.2f}, {lost.mean():+.2f} +- {half:.2f}; {spread}", flush=True)
        if options.physics:
            (planned, planned_s), (driven, driven_s) = (
                played(task, True, options.physics, backend, options.level) for backend in ("analytic", "pybullet")
            )
            longer = 100.0 * (driven_s.mean() / planned_s.mean() - 1.0)
            print(f"  PyBullet: {longer:+.2f} %, {driven.mean() - planned.mean():+.2f}", flush=True)


if __name__ == "__main__":
    main()
