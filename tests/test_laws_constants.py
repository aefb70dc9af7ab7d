"""What ships stays what it is: every number of every task with its range, unit and source, cameras, thresholds.

They stand in ``shipped_constants.txt``, a line each. A change that is meant is written there too, with its source:
``python tests/test_laws_constants.py > tests/shipped_constants.txt``, and read in the difference.
"""

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from fieldgym.envs.safflower.config import SCENARIOS as PICKER_SCENARIOS
from fieldgym.envs.safflower.config import PerceptionModel as PickerEyes
from fieldgym.envs.safflower.config import SafflowerConfig
from fieldgym.envs.sorting.config import SCENARIOS as SORTER_SCENARIOS
from fieldgym.envs.sorting.config import PerceptionModel as SorterEyes
from fieldgym.envs.sorting.config import SortingConfig
from fieldgym.envs.transplanting.config import SCENARIOS as TRAY_SCENARIOS
from fieldgym.envs.transplanting.config import PerceptionModel as TrayEyes
from fieldgym.envs.transplanting.config import TransplantingConfig
from fieldgym.envs.weeding.config import BATTERY, DEMANDS, WORTH
from fieldgym.envs.weeding.config import SCENARIOS as WEEDING_SCENARIOS
from fieldgym.envs.weeding.perception import PerceptionModel as WeederEyes
from fieldgym.envs.weeding.tools.hoe.config import HoeWeedingConfig
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.kernels.config_tables import rows
from fieldgym.perception.blooms import BloomSettings
from fieldgym.perception.produce import ProduceSettings
from fieldgym.perception.stems import StemSettings
from fieldgym.perception.trays import TraySettings
from fieldgym.perception.weeds import WeedSettings

FILE = Path(__file__).with_name("shipped_constants.txt")
TASKS = SafflowerConfig, TransplantingConfig, WeedingConfig, HoeWeedingConfig, SortingConfig
SCENARIOS = {
    "safflower": PICKER_SCENARIOS,
    "transplanting": TRAY_SCENARIOS,
    "weeding": WEEDING_SCENARIOS | DEMANDS | BATTERY | WORTH,
    "sorting": SORTER_SCENARIOS,
}


def lines() -> Iterator[str]:
    """Every number that ships, a line each; of scenarios what is not as in the task's own."""
    own = {}
    for task in TASKS:
        for row in rows(task):
            allowed = "" if row.low is None and row.high is None else f" within {row.low} ... {row.high}"
            yield f"{task.__name__} {row.name} = {told(row.default)} {row.unit}{allowed} [{row.source}]"
    for task, scenarios in SCENARIOS.items():
        for name, scenario in scenarios.items():
            here = {row.name: told(row.default) for row in rows(scenario)}
            own.setdefault(task, here)
            changed = [f"{key} = {value}" for key, value in here.items() if value != own[task][key]]
            yield f"{task} scenario {name}: {', '.join(changed)}"
    for settings in (BloomSettings(), ProduceSettings(), TraySettings(), WeedSettings(), StemSettings()):
        for name, value in asdict(settings).items():
            yield f"{type(settings).__name__} {name} = {told(value)}"
    eyes: dict[str, Any] = {f"safflower {fit}": PickerEyes.measured(fit) for fit in ("pots", "row")}
    eyes |= {
        "transplanting": TrayEyes.measured(),
        "sorting": SorterEyes.measured(),
        "weeding": WeederEyes.measured("classical", "easy"),
    }
    for name, model in eyes.items():
        for row in rows(model):
            yield f"camera {name} {row.name} = {told(row.default)}"


def told(value: Any) -> str:
    """A value as JSON; of long tables the number of rows, and every column's mean and standard deviation."""
    text = json.dumps(value, default=float)
    if len(text) < 400:
        return text
    if isinstance(value[0][0], list | tuple):
        return "; ".join(told(part) for part in value)
    table = np.array(value, float)
    columns = zip(table.mean(axis=0), table.std(axis=0), strict=True)
    return f"{len(table)} rows of " + ", ".join(f"{mean:.6g} +- {off:.6g}" for mean, off in columns)


def test_what_ships_is_what_is_written_down():
    known, found = FILE.read_text("utf-8").splitlines(), list(lines())
    assert [line for line in found if line not in set(known)] == [], "these are not written down"
    assert [line for line in known if line not in set(found)] == [], "these do not ship"
    assert known == found and len(known) == len(set(known))


def test_a_changed_number_would_be_noticed():
    """The check above can fail: one digit is enough."""
    known = set(FILE.read_text("utf-8").splitlines())
    changed = [line.replace("7.304", "7.305") for line in lines()]
    assert sum(line not in known for line in changed) == 1


if __name__ == "__main__":
    print("\n".join(lines()))
