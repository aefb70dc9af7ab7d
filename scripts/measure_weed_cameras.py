"""Measure the weeder's cameras on rendered pictures and fit the statistical perception to them.

Writes the fit to ``assets/perception/weeding.json``; see ``fieldgym.envs.weeding.tools.laser.calibration``. With
``--compare`` it then plays whole episodes on other seeds with the cameras, with the fit and with perfect perception,
side by side.

Run: ``python scripts/measure_weed_cameras.py [--write] [--compare SEEDS [--policy edf ...]]``.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from fieldgym.agents import act_single, make_policy
from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.perception import PerceptionModel
from fieldgym.envs.weeding.tools.laser.calibration import STRIPS, fit, measure, summary
from fieldgym.envs.weeding.view import FRAME_EVERY_M
from fieldgym.kernels.files import replace_file

FIRST_COMPARED = 950_000
OUTPUT = Path(__file__).resolve().parent.parent / "assets" / "perception" / "weeding.json"


def play(scenario: str, policy: str, perception: str, seeds: int) -> list[dict[str, float]]:
    """The scorecards of episodes, one a seed."""
    env: Any = gym.make("fieldgym/LaserWeeding-v0", backend="analytic", perception=perception, scenario=scenario)
    rule, cards = make_policy(policy, env, seed=1), []
    for seed in range(FIRST_COMPARED, FIRST_COMPARED + seeds):
        observation, info = env.reset(seed=seed)
        over = False
        while not over:
            observation, _, end, cut, info = env.step(act_single(rule, observation))
            over = end or cut
        cards.append(info["scorecard"])
    env.close()
    return cards


def compare(scenario: str, policies: Sequence[str], seeds: int) -> None:
    """Print net rates and what goes with them, paired by seed, for cameras, fit and perfect perception."""
    fields = "net_rate", "crop_loss_percent", "tracks", "shots", "blank_shots", "cycle_time_s"
    for policy in policies:
        cards = {p: play(scenario, policy, p, seeds) for p in ("camera", "model", "perfect")}
        for name, rows in cards.items():
            means = {f: round(float(np.mean([row[f] for row in rows])), 4) for f in fields}
            print(f"{scenario} {policy:16s} {name:8s} {json.dumps(means)}", flush=True)
        difference = np.array(
            [m["net_rate"] - c["net_rate"] for m, c in zip(cards["model"], cards["camera"], strict=True)]
        )
        error = difference.std(ddof=1) / np.sqrt(seeds) if seeds > 1 else np.nan
        print(f"{scenario} {policy:16s} model - camera {difference.mean():+.4f} +- {error:.4f} (1 s.e., {seeds} seeds)")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit status."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--write", action="store_true", help="measure, and write the fit to the package's assets")
    parser.add_argument("--compare", type=int, default=0, metavar="SEEDS", help="play this many episodes of each kind")
    parser.add_argument("--policy", nargs="+", default=["edf", "receding-horizon"])
    parser.add_argument("--scenario", default="load-1.0", choices=sorted(SCENARIOS))
    chosen = parser.parse_args(arguments)
    if chosen.write or not chosen.compare:
        parts = {tier: measure(tier, strips) for tier, strips in STRIPS.items()}
        for tier, strips in parts.items():
            print(tier, json.dumps(summary(strips)), flush=True)
        model = fit(list(parts.values()))
        PerceptionModel.from_json(model)
        if chosen.write:
            write(model, {tier: summary(strips) for tier, strips in parts.items()})
    if chosen.compare:
        compare(chosen.scenario, chosen.policy, chosen.compare)
    return 0


def write(model: dict[str, Any], measured: dict[str, Any]) -> None:
    """Write the fit, one sighting a line at most."""
    comment = f"scripts/measure_weed_cameras.py; a picture every {FRAME_EVERY_M} m; drift and delay assumed"
    fields = ",\n".join(f"  {json.dumps(name)}: {json.dumps(value)}" for name, value in model.items())
    text = f'{{\n "comment": {json.dumps(comment)},\n "model": {{\n{fields}\n }},\n'
    text += f' "measured": {json.dumps(measured, indent=1)}\n}}\n'
    json.loads(text)
    replace_file(OUTPUT, text)
    print(f"wrote {OUTPUT}")


if __name__ == "__main__":
    sys.exit(main())
