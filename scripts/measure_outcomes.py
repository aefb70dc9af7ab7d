"""Measure what shots of the weeders do on average: ``python -m fieldgym.scripts.measure_outcomes``.

Planners reckon with these tables (``envs/weeding/outcomes.py``). They follow from the cameras' statistics and the
tools' laws alone; measure them again when either changes. Prints the classes; ``--write`` puts the tables, with their
numbers of samples, into ``assets/outcomes/weeding.json``, and what sums of them bring (``envs/weeding/together.py``)
into ``together.json`` beside it. ``--check N`` plays N seeds that nothing else plays instead and holds what the
planners of all tasks (``beliefs.ACCOUNTS``), or those whose name contains ``--only NAME``, believed of every decision
to what it brought; ``--plot FILE`` draws that.
"""

from __future__ import annotations

import argparse
import json
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from fieldgym.agents.policies.weeding_outlook import outlook
from fieldgym.envs.task import task
from fieldgym.envs.weeding.config import SPECIES, STAGES
from fieldgym.envs.weeding.outcomes import SHIPPED, Outcomes, key_of, measured
from fieldgym.envs.weeding.together import SHIPPED_SUMS, measured_sums
from fieldgym.kernels.files import replace_file
from fieldgym.kernels.seeds import BELIEFS, OUTCOMES
from fieldgym.scripts.beliefs import ACCOUNTS, Account, Cell, drawn, told

ASSETS = Path(__file__).resolve().parents[1] / "assets"
IDS = ("fieldgym/LaserWeeding-v0", "fieldgym/HoeWeeding-v0")
MADE_FOR = ((IDS[0], "load-1.25"), (IDS[0], "worth"), (IDS[1], "load-1.25"))
"""Other scenarios have their tables in common with these where only loads, speeds and energy differ."""
LOOKS = (("learned", "field"), ("classical", "easy"))
"""Eyes and pictures: the defaults, and what the weeders had before there were others."""
DIGITS = 4


def table(
    env_id: str, scenario: str, eyes: str, pictures: str, strips: int
) -> tuple[Outcomes, dict[str, Any], dict[str, Any]]:
    """The tables of a task's scenario and cameras, and what is written of them and of their sums."""
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
    share = np.round(measured_sums(*seen, outcomes, strips), DIGITS).tolist()
    return outcomes, told | values, told | {"share": share}


def check(count: int, only: str, plot: Path | None) -> None:
    """Hold planners whose name contains ``only`` to so many seeds, and perhaps draw a picture an environment."""
    seen: dict[str, list[tuple[Account, list[Cell]]]] = {}
    for account in ACCOUNTS:
        if only in account.name:
            seen.setdefault(account.env_id, []).append((account, told(account, BELIEFS.take(count))))
    if not seen:
        raise SystemExit(f"--only {only}: no planner of that name, there are {[one.name for one in ACCOUNTS]}")
    for env_id, accounts in seen.items():
        if plot is not None:
            drawn(accounts, plot.with_stem(f"{plot.stem}-{task(env_id).name}"))


def main() -> None:
    """Measure, print and perhaps write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--strips", type=int, default=4000)
    parser.add_argument("--write", action="store_true")
    parser.add_argument("--check", type=int, default=0, metavar="N")
    parser.add_argument("--only", default="", metavar="NAME")
    parser.add_argument("--plot", type=Path)
    options = parser.parse_args()
    if options.check:
        check(options.check, options.only, options.plot)
        return
    entries, sums = [], []
    for (env_id, scenario), (eyes, pictures) in product(MADE_FOR, LOOKS):
        outcomes, entry, sum_entry = table(env_id, scenario, eyes, pictures, options.strips)
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
