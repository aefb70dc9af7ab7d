"""Measure what shots of the weeders do on average: ``python -m fieldgym.scripts.measure_outcomes``.

Planners reckon with these tables (``envs/weeding/outcomes.py``). They follow from the cameras' statistics and the
tools' laws alone; measure them again when either changes. Prints the classes; ``--write`` puts the tables, with their
numbers of samples, into ``assets/outcomes/weeding.json``. ``--check N`` plays N shown seeds instead and holds what the
planner believed of every shot to what the shot did; ``--plot FILE`` draws that.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Iterator, Sequence
from itertools import pairwise, product
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from fieldgym.agents.policies.weeding_horizon import RecedingHorizon
from fieldgym.agents.policies.weeding_outlook import outlook
from fieldgym.agents.rollout import batch_decisions
from fieldgym.envs.task import task
from fieldgym.envs.weeding.config import SPECIES, STAGES
from fieldgym.envs.weeding.features import C, candidate_table
from fieldgym.envs.weeding.outcomes import KINDS, SHIPPED, Outcomes, key_of, measured
from fieldgym.envs.weeding.state import MODES
from fieldgym.kernels.files import replace_file
from fieldgym.kernels.seeds import OUTCOMES, SHOWN

FILE = Path(__file__).resolve().parents[1] / "assets" / SHIPPED
IDS = ("fieldgym/LaserWeeding-v0", "fieldgym/HoeWeeding-v0")
MADE_FOR = ((IDS[0], "load-1.25"), (IDS[0], "worth"), (IDS[1], "load-1.25"))
"""Other scenarios have their tables in common with these where only loads, speeds and energy differ."""
LOOKS = (("learned", "field"), ("classical", "easy"))
"""Eyes and pictures: the defaults, and what the weeders had before there were others."""
DIGITS = 4
EDGES = (0.0, 0.5, 0.75, 1.0, 1.5, 9.0)
"""Of kills expected, between which beliefs are held to what happened."""


def table(env_id: str, scenario: str, eyes: str, pictures: str, strips: int) -> tuple[Outcomes, dict[str, Any]]:
    """The tables of a task's scenario and cameras, and what is written of them."""
    config = task(env_id).assembly.configured(scenario, overrides={"eyes": eyes, "pictures": pictures})
    tool = outlook(config)
    outcomes = measured(config, tool.perception, tool.process, strips)
    told = {
        "key": key_of(config, tool.perception, tool.process),
        "made_for": f"{env_id}, {scenario}, model perception, {eyes} eyes, {pictures} pictures, level ground, "
        "drives that do not err",
        "strips": strips,
        "seeds": [OUTCOMES.first, OUTCOMES.first + strips - 1],
    }
    values = {name: np.round(getattr(outcomes, name), DIGITS).tolist() for name in Outcomes._fields}
    return outcomes, told | values


class Played(NamedTuple):
    """Shots of a planner on seeds; n of them, kinds and modes as ``Outcomes`` numbers them."""

    believed: NDArray[np.float64]
    killed: NDArray[np.float64]
    kind: NDArray[np.int64]
    mode: NDArray[np.int64]

    def classes(self, least: int = 200) -> Iterator[tuple[str, NDArray[np.int64]]]:
        """Name and shots of every class by kind, mode and kills expected, with so many shots at least."""
        for kind in range(KINDS):
            for mode in range(MODES):
                for low, high in pairwise(EDGES):
                    inside = (self.believed >= low) & (self.believed < high)
                    rows = np.flatnonzero(inside & (self.kind == kind) & (self.mode == mode))
                    if len(rows) >= least:
                        yield f"{STAGES[kind % 3]} {SPECIES[kind // 3]}, mode {mode}, {low:g} to {high:g}", rows


def played(env_id: str, seeds: Sequence[int], **settings: Any) -> Played:
    """What the planner believed and did on seeds of the headline scenario, in an environment with these settings."""
    n, found = len(seeds), []
    env: Any = gym.make_vec(
        env_id,
        n,
        vectorization_mode="vector_entry_point",
        autoreset_mode=gym.vector.AutoresetMode.DISABLED,
        scenario=task(env_id).headline,
        perception="model",
        **settings,
    )
    policy, slots, worlds = RecedingHorizon.make(env, 0), env.unwrapped.core.config.slots, np.arange(n)
    for decision in batch_decisions(env, policy, env.reset(seed=list(seeds))[0]):
        fired = (decision.actions < MODES * slots) & decision.under_way
        slot, mode = np.minimum(decision.actions // MODES, slots - 1), decision.actions % MODES
        candidate = candidate_table(decision.observation)[worlds, slot]
        kind = 3 * (candidate[:, C.grass] > 0.5) + candidate[:, C.cotyledon : C.four_leaf + 1].argmax(axis=-1)
        told = policy.believed, decision.info["rewards"]["killed"], kind, mode
        found.append([values[fired].copy() for values in told])
    return Played(*(np.concatenate(parts) for parts in zip(*found, strict=True)))


def check(env_id: str, strips: int, plot: Path | None) -> None:
    """Print the classes of ``Played`` with what was believed and what happened."""
    seen = played(env_id, SHOWN.take(strips))
    rows_of = list(seen.classes())
    points = []
    for name, rows in rows_of:
        error = seen.killed[rows] - seen.believed[rows]
        points.append((seen.believed[rows].mean(), seen.killed[rows].mean(), 1.96 * error.std() / np.sqrt(len(rows))))
        print(
            f"  {name:38} {len(rows):6} shots: {points[-1][0]:.3f} believed, {points[-1][1]:.3f} +- {points[-1][2]:.3f}"
        )
    off = np.array([[abs(killed - believed), sure] for believed, killed, sure in points])
    print(
        f"{env_id}: {len(seen.killed)} shots, {seen.believed.mean():.4f} believed, {seen.killed.mean():.4f} killed; "
        f"{(off[:, 0] <= 0.02).sum()} of {len(off)} classes within 2 points, {(off[:, 0] <= off[:, 1]).sum()} within "
        "their 95 % interval"
    )
    if plot is not None:
        import matplotlib.pyplot as plt

        figure, axes = plt.subplots(figsize=(5, 5))
        believed, killed, sure = np.array(points).T
        axes.errorbar(believed, killed, sure, fmt="o", markersize=3)
        axes.axline((0, 0), slope=1.0, linewidth=1)
        axes.set(xlabel="kills that the planner believed in", ylabel="kills", title=env_id)
        figure.savefig(plot.with_stem(f"{plot.stem}-{task(env_id).name}"))


def main() -> None:
    """Measure, print and perhaps write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strips", type=int, default=4000)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--check", type=int, default=0, metavar="N")
    parser.add_argument("--plot", type=Path)
    options = parser.parse_args()
    if options.check:
        for env_id in IDS:
            check(env_id, options.check, options.plot)
        return
    entries = []
    for (env_id, scenario), (eyes, pictures) in product(MADE_FOR, LOOKS):
        outcomes, entry = table(env_id, scenario, eyes, pictures, options.strips)
        entries.append(entry)
        print(f"{env_id}, {scenario}, {eyes} eyes, {pictures} pictures: {outcomes.own_count.sum():.0f} reports")
        kinds = [f"{stage} {species}" for species in SPECIES for stage in STAGES]
        for kind, name in enumerate(kinds):
            share = outcomes.own_count[kind] / outcomes.own_count[kind].sum()
            own = (outcomes.own[kind] * share[..., None]).sum(axis=(0, 1, 2, 3))
            print(f"  {name:22} own kills {own.round(3)}, of {outcomes.own_count[kind].sum():.0f}")
        print(f"  {'crop plants lost':22} at 30-40 mm {outcomes.harm[12:16].mean(axis=0).round(3)}")
    if options.write:
        replace_file(FILE, json.dumps({"tables": entries}, separators=(",", ":")) + "\n")
        print(f"wrote {FILE}")


if __name__ == "__main__":
    main()
