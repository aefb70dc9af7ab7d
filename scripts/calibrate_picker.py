"""Find the picker's identified numbers from the paper's protocol: 16 s a head, 87.91 % net rate, Table 2's spread.

    python scripts/calibrate_picker.py [--worlds 4000] [--check]

Three numbers of ``ProcessConfig`` are identified, in this order: ``locate_s`` from the picking period (it is the only
time that the paper gives no other clue to), ``stroke_cut`` from the mean net rate and ``luck_logit`` from the standard
deviation between groups of three pots. The fixed order with normal effort picks the ``pots`` scenario with the
statistical camera on seeds that no benchmark uses. The script prints the numbers; they are copied into
``envs/safflower/config.py`` by hand, once, and then left alone.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated

import gymnasium as gym
import numpy as np
import typer
from rich.console import Console
from rich.table import Table

import fieldgym
from fieldgym.agents import make_policy
from fieldgym.envs.safflower.config import ProcessConfig, SafflowerConfig
from fieldgym.kernels.seeds import PICKER

PERIOD_S, NET_RATE, GROUP_SD = 16.0, 0.8791, 0.0160
POTS_IN_GROUP = 3


@dataclass(frozen=True)
class Protocol:
    """Outcome of the protocol over many runs: means, their standard errors, and the spread between groups."""

    period_s: float
    period_error_s: float
    net_rate: float
    net_rate_error: float
    group_mean: float
    group_sd: float


def run_protocol(process: ProcessConfig, worlds: int, perception: str = "model") -> Protocol:
    """Pick ``worlds`` potted fields in the fixed order and measure what the paper measured."""
    env = gym.make_vec(
        fieldgym.env_ids()[0],
        num_envs=worlds,
        vectorization_mode="vector_entry_point",
        scenario="pots",
        perception=perception,
        config=SafflowerConfig(process=process),
        autoreset_mode="Disabled",
    )
    policy = make_policy("fixed-order", env)
    observation, _ = env.reset(seed=PICKER.first)
    core = env.unwrapped.core  # type: ignore[attr-defined]
    mass = core.state.head_mass_g[:, :-1].copy()
    over = np.zeros(worlds, bool)
    scores = np.zeros((worlds, len(core.score_names)))
    gained = np.zeros_like(mass)
    rows, grams = np.arange(worlds), core.score_names.index("collected_g")
    while not over.all():
        actions = policy.act(observation)
        head = core.state.track_head[rows, core.state.slot_report[rows, actions // 3]]
        before = core.scores()[:, grams]
        observation, _, terminated, truncated, _ = env.step(actions)
        picked = ~over & (head < mass.shape[1])
        gained[rows[picked], head[picked]] += (core.scores()[:, grams] - before)[picked]
        ended = ~over & (terminated | truncated)
        scores[ended] = core.scores()[ended]
        over |= ended
    per_group = POTS_IN_GROUP * core.config.scenario.max_heads
    groups = gained.reshape(worlds, -1, per_group).sum(axis=2) / mass.reshape(worlds, -1, per_group).sum(axis=2)
    period, rate = (scores[:, core.score_names.index(name)] for name in ("cycle_time_s", "net_rate"))
    root = np.sqrt(worlds)
    # The paper's spread is that of one run's five groups; averaged over runs as a variance.
    spread = float(np.sqrt(groups.var(axis=1, ddof=1).mean()))
    return Protocol(
        float(period.mean()),
        float(period.std() / root),
        float(rate.mean()),
        float(rate.std() / root),
        float(groups.mean()),
        spread,
    )


def calibrate(worlds: int, rounds: int = 4) -> ProcessConfig:
    """Solve for the three numbers one after the other, a few times round."""
    process = ProcessConfig()
    for _ in range(rounds):
        period = run_protocol(process, worlds).period_s
        process = replace(process, locate_s=process.locate_s + PERIOD_S - period)
        process = _solve(process, "stroke_cut", 0.3, 0.999, lambda p: p.net_rate - NET_RATE, worlds)
        process = _solve(process, "luck_logit", 0.0, 2.0, lambda p: p.group_sd - GROUP_SD, worlds)
    return process


def _solve(process: ProcessConfig, name: str, low: float, high: float, excess, worlds: int) -> ProcessConfig:
    """Bisect one number for a measure that grows with it."""
    for _ in range(14):
        middle = 0.5 * (low + high)
        if excess(run_protocol(replace(process, **{name: middle}), worlds)) < 0.0:
            low = middle
        else:
            high = middle
    return replace(process, **{name: 0.5 * (low + high)})


def main(
    worlds: Annotated[int, typer.Option(help="Runs of the protocol a measurement.")] = 4000,
    check: Annotated[bool, typer.Option("--check", help="Measure the numbers as they are.")] = False,
) -> None:
    """Find the picker's three identified numbers from the paper's protocol, or measure what they give."""
    process = ProcessConfig() if check else calibrate(worlds)
    table = Table("", "published", *(f"computed, {p}" for p in ("model", "perfect")))
    results = [run_protocol(process, worlds, perception) for perception in ("model", "perfect")]
    table.add_row("period, s", "16", *(f"{r.period_s:.3f} +- {r.period_error_s:.3f}" for r in results))
    table.add_row("net rate, %", "87.91", *(f"{100 * r.net_rate:.3f} +- {100 * r.net_rate_error:.3f}" for r in results))
    table.add_row("mean of groups, %", "87.91", *(f"{100 * r.group_mean:.3f}" for r in results))
    table.add_row("SD between groups, points", "1.60", *(f"{100 * r.group_sd:.2f}" for r in results))
    console = Console()
    console.print(table)
    for name in ("locate_s", "stroke_cut", "luck_logit"):
        console.print(f"{name} = {getattr(process, name):.4f}")


if __name__ == "__main__":
    typer.run(main)
