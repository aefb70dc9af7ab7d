"""Where the cameras of picker, trays and sorter lose: what would be won if only one of their faults were gone.

    python scripts/sight_budget.py {picker,trays,sorter} [--scenario row] [--policy fixed-order] [--fields 30]
        [--save FILE] [--against FILE]

Everything that there is to see is put into one category; then a policy plays the same fields through the cameras as
they are, and with one category after the other reported as it is. Differences are paired by field. Nothing was chosen
or fitted on these fields. ``--save`` keeps what was played as it is; ``--against`` prints the difference to that, which
is how one detector is set against another. ``--model`` also plays with the statistical camera.
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import gymnasium as gym
import numpy as np
import typer

import fieldgym  # noqa: F401
from fieldgym.kernels.seeds import SHOWN
from fieldgym.scripts.sight_losses import Sights, budget, interval, played, shown
from fieldgym.scripts.sight_picker import PickerSights
from fieldgym.scripts.sight_sorter import SorterSights
from fieldgym.scripts.sight_trays import TraySights


class Eyes(NamedTuple):
    """Whose budget: environment, scenario, policy, and what stands between cameras and rules."""

    env_id: str
    scenario: str
    policy: str
    kind: type[Sights]


EYES = {
    "picker": Eyes("fieldgym/SafflowerPicking-v0", "row", "fixed-order", PickerSights),
    "trays": Eyes("fieldgym/TrayTransplanting-v0", "replug-high", "fixed-order", TraySights),
    "sorter": Eyes("fieldgym/ProduceSorting-v0", "load-1.0", "fifo", SorterSights),
}


def against(now: dict[str, list[float]], before: dict[str, list[float]]) -> str:
    """What was won since, paired by field."""
    lines = []
    for name, unit in (("net", "points of net rate"), ("gain", "of return")):
        mean, low, high = interval(np.array(now[name]) - np.array(before[name]))
        lines.append(f"{mean:+.3f} [{low:.3f}, {high:.3f}] {unit} against what was saved")
    return "\n".join(lines)


def by_model(eyes: Eyes, scenario: str, policy: str, fields: int, net: Any) -> str:
    """How far the statistical camera's net rate is from the cameras', paired by field."""
    env: Any = gym.make(eyes.env_id, scenario=scenario, backend="analytic", perception="model")
    told = played(env, policy, SHOWN.take(fields)).net
    env.close()
    mean, low, high = interval(told - net)
    return (
        f"the fitted model: net rate {told.mean():.2f} %, {mean:+.2f} [{low:.2f}, {high:.2f}] points from the cameras"
    )


def main(
    task: str,
    scenario: str | None = None,
    policy: str | None = None,
    fields: int = 30,
    save: Annotated[Path | None, typer.Option(metavar="FILE")] = None,
    before: Annotated[Path | None, typer.Option("--against", metavar="FILE")] = None,
    model: bool = False,
) -> None:
    """Look, sort out, play."""
    if task not in EYES:
        raise typer.BadParameter(f"{task!r}: give one of {', '.join(EYES)}")
    eyes = EYES[task]
    scenario, policy, seeds = scenario or eyes.scenario, policy or eyes.policy, SHOWN.take(fields)
    print(f"{task}, {scenario}, {policy}, {fields} fields from {seeds[0]} on\n")
    rows = budget(eyes.env_id, scenario, policy, seeds, eyes.kind)
    print(shown(rows))
    base = rows[0].played
    now = {"net": base.net.tolist(), "gain": base.gain.tolist()}
    if before is not None:
        print("\n" + against(now, json.loads(before.read_text("utf-8"))))
    if model:
        print("\n" + by_model(eyes, scenario, policy, fields, base.net))
    if save is not None:
        save.write_text(json.dumps(now), "utf-8")


if __name__ == "__main__":
    typer.run(main)
