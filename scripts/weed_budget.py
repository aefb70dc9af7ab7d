"""Where the weeders' cameras lose kills: what would be won if only one of their faults were gone.

    python scripts/weed_budget.py [--eyes classical --eyes learned] [--pictures easy] [--fields 20]
        [--scenario load-1.0] [--policy edf] [--played] [--no-budget]

Both cameras look at rendered strips that nothing was trained, fitted or chosen on. Every weed is put into one category;
then the tracks are handed to the rules as reports of a field, as they are and with one category after the other put
right, and a policy works on each. Differences are paired by field. ``--played`` also has the policy drive with the
cameras themselves, which the reports stand for; with ``--no-budget`` it only drives.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Annotated, Any, NamedTuple

import gymnasium as gym
import numpy as np
import typer
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

import fieldgym  # noqa: F401
from fieldgym.agents import make_policy
from fieldgym.agents.rollout import batch_decisions, decisions
from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.field import Reports, WeedField
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.env import laser_core
from fieldgym.scripts.weed_looks import (
    CATEGORIES,
    FRESH_SEED,
    RIGHT,
    Strip,
    by_confidence,
    by_gap,
    by_kind,
    figures,
    look,
)

MODEL_DRAWS = 10
"""Times that the cameras' model reports of every field, each time anew."""


def told(strip: Strip, right: Sequence[str] = (), false: bool = True, named: bool = False) -> WeedField:
    """A strip with its tracks, those of some categories put right, without false ones or with right names."""
    seen, rows, half_m = strip.seen, [], 0.5 * WeedingConfig().scenario.band_m
    for j, i in enumerate(strip.pair.tolist()):
        exact = strip.category[j] in right
        if i < 0 and not exact:
            continue
        place, aim = (seen.weed[j], seen.weed[j]) if exact else (seen.told[i], seen.aim[i])
        rows.append(
            (*place, *aim, *(seen.kind[j] if exact or named else seen.named[i]), 1.0 if i < 0 else seen.confidence[i])
        )
    rows += [(*seen.told[i], *seen.aim[i], *seen.named[i], seen.confidence[i]) for i in (strip.false if false else ())]
    table = np.array(rows, float).reshape(-1, 7)
    # What the odometry puts beside the band is not told of.
    table = table[np.abs(table[:, 1]) <= half_m]
    reports = replace(
        Reports.empty(len(table)),
        along_m=table[:, 0],
        across_m=table[:, 1],
        aim_along_m=table[:, 2],
        aim_across_m=table[:, 3],
        species=table[:, 4].astype(np.int64),
        stage=table[:, 5].astype(np.int64),
        confidence=table[:, 6],
    )
    return replace(strip.field, reports=reports)


class Played(NamedTuple):
    """Kill share and crop loss in percent (fields,), and of every field which weeds died."""

    killed: NDArray[np.float64]
    crop: NDArray[np.float64]
    dead: list[NDArray[np.bool_]]


def played(
    scenario: str, policy: str, fields: Sequence[WeedField], seed: int = 0, perception: str = "model", **settings: Any
) -> Played:
    """Let a policy work on what is reported of fields, by themselves or by the cameras' model."""
    env: Any = gym.make_vec(
        "fieldgym/LaserWeeding-v0",
        num_envs=len(fields),
        vectorization_mode="vector_entry_point",
        scenario=scenario,
        perception=perception,
        autoreset_mode=AutoresetMode.DISABLED,
        **settings,
    ).unwrapped
    observation, _ = env.reset(seed=seed, options={"fields": fields})
    killed, crop, dead = np.zeros(len(fields)), np.zeros(len(fields)), [np.zeros(0, bool)] * len(fields)
    core = env.core
    for decision in batch_decisions(env, make_policy(policy, env, seed=1), observation):
        for i in np.flatnonzero(decision.ending).tolist():
            card = decision.info["scorecard"]
            killed[i], crop[i] = 100.0 * card["net_rate"][i], card["crop_loss_percent"][i]
            died = core.state.plant_dose[i] >= core.state.plant_tolerance[i]
            dead[i] = died[: core.weeds_end][core.plant_exists[i, : core.weeds_end]]
    env.close()
    return Played(killed, crop, dead)


def driven(eyes: str, pictures: str, scenario: str, policy: str, fields: int, first_seed: int = FRESH_SEED) -> Played:
    """Let a policy drive over the same fields with the cameras themselves."""
    env: Any = gym.make(
        "fieldgym/LaserWeeding-v0", scenario=scenario, backend="analytic", perception="camera", eyes=eyes,
        pictures=pictures,
    )  # fmt: skip
    chosen = make_policy(policy, env, seed=1)
    killed, crop = np.zeros(fields), np.zeros(fields)
    for field in range(fields):
        observation, _ = env.reset(seed=first_seed + field)
        card = {}
        for decision in decisions(env, chosen, observation):
            card = decision.info["scorecard"]
        killed[field], crop[field] = 100.0 * card["net_rate"], card["crop_loss_percent"]
    env.close()
    return Played(killed, crop, [])


def budget(scenario: str, policy: str, strips: Sequence[Strip], **settings: Any) -> Table:
    """What is won if only one fault were gone, with these cameras."""
    table = Table("if only this were right", "weeds", "killed now", "kill share, %", "won, points", "crop loss, %")
    base = played(scenario, policy, [told(s) for s in strips], **settings)
    category = np.concatenate([s.category for s in strips])
    dead = np.concatenate(base.dead)

    def row(name: str, count: str, fields: Sequence[WeedField] | None, now: str = "") -> None:
        got = base if fields is None else played(scenario, policy, fields, **settings)
        won = got.killed - base.killed
        spread = won.std(ddof=1) / np.sqrt(len(won)) if len(won) > 1 else 0.0
        difference = "" if fields is None else f"{won.mean():+.1f} +- {spread:.1f}"
        table.add_row(name, count, now, f"{got.killed.mean():.1f}", difference, f"{got.crop.mean():.2f}")

    def counted(name: str) -> tuple[str, str]:
        own = category == name
        return f"{own.sum()} ({100.0 * own.mean():.1f} %)", f"{dead[own].mean():.2f}"

    row("as it is", str(len(category)), None, f"{dead.mean():.2f}")
    table.add_row(RIGHT, *counted(RIGHT))
    for name in CATEGORIES:
        if (category == name).any():
            count, now = counted(name)
            row(name, count, [told(s, (name,)) for s in strips], now)
    row("no false tracks", str(sum(len(s.false) for s in strips)), [told(s, false=False) for s in strips])
    row("right names", "", [told(s, named=True) for s in strips])
    groups = {
        "nothing missed but the hidden": [c for c in CATEGORIES if c.startswith("missed")],
        "every aim right": [c for c in CATEGORIES if c.startswith("aim")],
    }
    for name, group in groups.items():
        row(name, "", [told(s, group) for s in strips])
    row("all but the hidden", "", [told(s, CATEGORIES[1:], False, True) for s in strips])
    row("everything", "", [told(s, CATEGORIES, False, True) for s in strips])
    return table


def bootstrapped(differences: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Mean of differences (n,) and its 95 % interval over resampled fields."""
    rng = np.random.default_rng(0)
    means = differences[rng.integers(0, len(differences), (2000, len(differences)))].mean(axis=1)
    return float(differences.mean()), np.percentile(means, [2.5, 97.5])


def main(
    eyes: Annotated[list[str] | None, typer.Option(help="classical, learned; may be repeated.")] = None,
    pictures: Annotated[str, typer.Option(help="easy or field.")] = "easy",
    fields: int = 20,
    scenario: str = "load-1.0",
    policy: str = "edf",
    drive: Annotated[bool, typer.Option("--played", help="Also drive with the cameras themselves.")] = False,
    losses: Annotated[bool, typer.Option("--budget/--no-budget", help="Look, and print where weeds are lost.")] = True,
    first_seed: Annotated[int, typer.Option(help="Of the fields.")] = FRESH_SEED,
) -> None:
    """Look, sort out, play."""
    console, names = Console(width=120), eyes or ["classical", "learned"]
    core = laser_core(replace(WeedingConfig(), scenario=SCENARIOS[scenario]), None)
    bare = [core.draw_field(np.random.default_rng(first_seed + field)) for field in range(fields)]
    for name in names if losses else ():
        strips = look(name, pictures, scenario, fields, first_seed)
        console.print(f"[bold]{name} eyes, {pictures} pictures, {scenario}, {policy}, {fields} fields[/bold]")
        console.print("  ".join(f"{key} {value:.3f}" for key, value in figures(strips).items()))
        for table in (by_kind(strips), by_gap(strips, "crop"), by_gap(strips, "weed"), by_confidence(strips)):
            console.print(table)
        console.print(budget(scenario, policy, strips, eyes=name, pictures=pictures))
    perfect = played(scenario, policy, bare, perception="perfect").killed
    console.print(f"[bold]{pictures} pictures, {scenario}, {policy}, {fields} fields[/bold]")
    console.print(f"perfect perception kills {said(perfect)}")
    first: NDArray[np.float64] | None = None
    for name in names if drive else ():
        got = driven(name, pictures, scenario, policy, fields, first_seed)
        console.print(f"the cameras with {name} eyes kill {said(got.killed)}, crop loss {got.crop.mean():.2f} %")
        if first is not None:
            won, ends = bootstrapped(got.killed - first)
            way = 100.0 * won / (perfect - first).mean()
            console.print(f"  {won:+.1f} [{ends[0]:.1f}, {ends[1]:.1f}] points, {way:.0f} % of the way to perfect")
        first = got.killed if first is None else first
        draws = [
            played(scenario, policy, bare, seed, eyes=name, pictures=pictures).killed for seed in range(MODEL_DRAWS)
        ]
        gap, ends = bootstrapped(np.mean(draws, axis=0) - got.killed)
        console.print(f"  their model kills {np.mean(draws):.1f} %: {gap:+.1f} [{ends[0]:.1f}, {ends[1]:.1f}] points")


def said(killed: NDArray[np.float64]) -> str:
    """Kill shares (fields,) with one standard error."""
    return f"{killed.mean():.1f} +- {killed.std(ddof=1) / np.sqrt(len(killed)):.1f} %"


if __name__ == "__main__":
    typer.run(main)
