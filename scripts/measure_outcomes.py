"""Measure what shots of the weeders do on average: ``python -m fieldgym.scripts.measure_outcomes``.

Planners reckon with these tables (``envs/weeding/outcomes.py``). They follow from the cameras' statistics and the
tools' laws alone; measure them again when either changes. Prints the classes; ``--write`` puts the tables, with their
numbers of samples, into ``assets/outcomes/weeding.json``, and what sums of them bring (``envs/weeding/together.py``)
into ``together.json`` beside it: on the same strips, and of ``--shots`` shots that the hoe's planner fires on others,
which takes longest.

``--check N`` plays N seeds that nothing else plays instead, behind the first ``--skip M`` of these, and holds what the
planners of all tasks (``beliefs.ACCOUNTS``), or those whose name contains ``--only NAME``, believed of every decision
to what it brought; ``--plot FILE`` draws that.
"""

from __future__ import annotations

import argparse
import json
from itertools import product
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np

from fieldgym.agents.policies.weeding_horizon import RecedingHorizon
from fieldgym.agents.policies.weeding_outlook import outlook
from fieldgym.agents.rollout import batch_decisions
from fieldgym.envs.task import task
from fieldgym.envs.weeding.config import SPECIES, STAGES
from fieldgym.envs.weeding.outcomes import SHIPPED, Outcomes, key_of, measured
from fieldgym.envs.weeding.together import SHIPPED_SUMS, Chosen, Shares, measured_played, measured_sums
from fieldgym.kernels.files import replace_file
from fieldgym.kernels.seeds import BELIEFS, OUTCOMES
from fieldgym.scripts.beliefs import ACCOUNTS, SHOTS, TOGETHER, Account, Array, Cell, drawn, told

ASSETS = Path(__file__).resolve().parents[1] / "assets"
IDS = ("fieldgym/LaserWeeding-v0", "fieldgym/HoeWeeding-v0")
MADE_FOR = ((IDS[0], "load-1.25", False), (IDS[0], "worth", False), (IDS[1], "load-1.25", True))
"""Other scenarios have their tables in common with these where only loads, speeds and energy differ. Planners that have
little energy or choose the speed fire others of the laser's shots: only the hoe's are held to those that were fired."""
LOOKS = (("learned", "field"), ("classical", "easy"))
"""Eyes and pictures: the defaults, and what the weeders had before there were others."""
DIGITS = 4


def table(
    env_id: str, scenario: str, eyes: str, pictures: str, strips: int, shots: int
) -> tuple[Outcomes, dict[str, Any], dict[str, Any]]:
    """The tables of a task's scenario and cameras, and what is written of them and of sums; with no shots of strips."""
    config = task(env_id).assembly.configured(scenario, overrides={"eyes": eyes, "pictures": pictures})
    tool = outlook(config)
    seen = config, tool.perception, tool.process
    outcomes = Outcomes(*(np.round(values, DIGITS) for values in measured(*seen, strips)))
    told = {
        "key": key_of(*seen),
        "made_for": f"{env_id}, {scenario}, model perception, {eyes} eyes, {pictures} pictures, level ground, "
        "drives that do not err",
        "strips": strips,
        "seeds": [OUTCOMES.first, OUTCOMES.first + strips - 1],
    }
    values = {name: getattr(outcomes, name).tolist() for name in Outcomes._fields}
    sums = Shares(*(np.round(share, DIGITS) for share in measured_sums(*seen, outcomes, strips)))
    fired = {"fields": 0, "shots": 0}
    if shots:
        shot, killed, fields = shots_fired(env_id, scenario, eyes, pictures, outcomes, strips, shots)
        sums = sums._replace(played=np.round(measured_played(sums, shot, killed), DIGITS))
        fired = {"fields": fields, "shots": len(killed)}
    of = {name: getattr(sums, name).tolist() for name in Shares._fields}
    return outcomes, told | values, told | fired | of


def shots_fired(
    env_id: str, scenario: str, eyes: str, pictures: str, outcomes: Outcomes, skip: int, least: int
) -> tuple[Chosen, Array, int]:
    """So many shots of a planner or a few more, what each killed, and how many fields behind the first it played."""
    found: list[tuple[Any, ...]] = []
    fields = shots = 0
    while shots < least:
        seeds = OUTCOMES.take(TOGETHER, skip + fields)
        env: Any = gym.make_vec(
            env_id,
            len(seeds),
            vectorization_mode="vector_entry_point",
            autoreset_mode=gym.vector.AutoresetMode.DISABLED,
            scenario=scenario,
            perception="model",
            eyes=eyes,
            pictures=pictures,
        )
        config = env.unwrapped.core.config
        planner = RecedingHorizon(config, outcomes=outcomes, sums=Shares.plain())
        for decision in batch_decisions(env, planner, env.reset(seed=list(seeds))[0]):
            tried, _, killed = SHOTS.look(config, decision)
            shot = planner.last
            assert shot is not None, "it has decided"
            rows = tried & decision.under_way
            found.append((killed[rows], *(values[rows] for values in shot)))
            shots += int(rows.sum())
        fields += len(seeds)
        print(f"  {shots} of {least} shots fired on {fields} fields", flush=True)
    killed, *of = (np.concatenate(values) for values in zip(*found, strict=True))
    return Chosen(*of), killed, fields


def check(count: int, skip: int, only: str, plot: Path | None) -> None:
    """Hold planners whose name contains ``only`` to ``count`` seeds behind the first; perhaps draw a picture an id."""
    seen: dict[str, list[tuple[Account, list[Cell]]]] = {}
    for account in ACCOUNTS:
        if only in account.name:
            seen.setdefault(account.env_id, []).append((account, told(account, BELIEFS.take(count, skip))))
    if not seen:
        raise SystemExit(f"--only {only}: no planner of that name, there are {[one.name for one in ACCOUNTS]}")
    for env_id, accounts in seen.items():
        if plot is not None:
            drawn(accounts, plot.with_stem(f"{plot.stem}-{task(env_id).name}"))


def main() -> None:
    """Measure, print and perhaps write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strips", type=int, default=4000)
    parser.add_argument("--shots", type=int, default=40_000)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--check", type=int, default=0, metavar="N")
    parser.add_argument("--skip", type=int, default=0, metavar="M")
    parser.add_argument("--only", default="", metavar="NAME")
    parser.add_argument("--plot", type=Path)
    options = parser.parse_args()
    if options.check:
        check(options.check, options.skip, options.only, options.plot)
        return
    entries, sums = [], []
    for (env_id, scenario, play), (eyes, pictures) in product(MADE_FOR, LOOKS):
        shots = options.shots if play else 0
        outcomes, entry, sum_entry = table(env_id, scenario, eyes, pictures, options.strips, shots)
        entries.append(entry)
        sums.append(sum_entry)
        print(f"{env_id}, {scenario}, {eyes} eyes, {pictures} pictures: {outcomes.own_count.sum():.0f} reports")
        kinds = [f"{stage} {species}" for species in SPECIES for stage in STAGES]
        for kind, name in enumerate(kinds):
            share = outcomes.own_count[kind] / outcomes.own_count[kind].sum()
            own = (outcomes.own[kind] * share[..., None]).sum(axis=(0, 1, 2, 3))
            print(f"  {name:22} own kills {own.round(3)}, of {outcomes.own_count[kind].sum():.0f}")
        print(f"  {'crop plants lost':22} at 30-40 mm {outcomes.harm[12:16].mean(axis=0).round(3)}")
    if options.write:
        for name, tables in ((SHIPPED, entries), (SHIPPED_SUMS, sums)):
            replace_file(ASSETS / name, json.dumps({"tables": tables}, separators=(",", ":")) + "\n")
            print(f"wrote {ASSETS / name}")


if __name__ == "__main__":
    main()
