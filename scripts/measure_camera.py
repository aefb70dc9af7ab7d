"""Measure a task's cameras on rendered pictures and fit the statistical camera to them.

    python scripts/measure_camera.py {safflower,sorting,transplanting,weeding} [--size N] [--write]
        [--eyes learned] [--pictures field] [--times 2]

``fieldgym.envs.<task>.calibration`` says what is rendered, on seeds that no benchmark uses, and how it is counted. The
fit is printed; ``--write`` puts it into ``assets/perception/``. ``--thresholds`` searches the transplanter's detector
settings on other rows and prints them; they are copied into ``perception/trays.py`` by hand.
"""

from __future__ import annotations

import argparse
import json
import re
from pathlib import Path
from typing import Any

import numpy as np

from fieldgym.envs.safflower import calibration as safflower
from fieldgym.envs.sorting import calibration as sorting
from fieldgym.envs.transplanting import calibration as transplanting
from fieldgym.envs.transplanting.config import REPORTS
from fieldgym.envs.weeding.tools.laser import calibration as weeding
from fieldgym.kernels.files import replace_file
from fieldgym.perception.trays import TraySettings

FOLDER = Path(__file__).resolve().parents[1] / "assets" / "perception"


def of_safflower(stops: int = 220) -> dict[str, Any]:
    """At least so many stops of every scenario with a camera of its own, twice as many where heads hide others."""
    from fieldgym.envs.safflower.config import GAPS_M, SCENARIOS, STAGES

    fits = {
        name: safflower.measure(name, stops if scenario.potted else 2 * stops)
        for name, scenario in SCENARIOS.items()
        if scenario.camera_fit == name
    }
    told = {"stages": STAGES, "gaps_m": GAPS_M, "first_seed": safflower.FIRST_SEED, "published": safflower.PUBLISHED}
    return told | {"scenarios": fits}


def of_transplanting(rows: int = 100) -> dict[str, Any]:
    """So many rows a pair of presets and side."""
    data: dict[str, Any] = {"cameras": "RGB-D, straight down, over each row as it comes in"}
    data["reports"] = REPORTS
    for (side, cells), seen in sorted(transplanting.collect(rows, transplanting.MEASURE_SEED).items()):
        counts = transplanting.confusion(seen, TraySettings())
        rates = transplanting.shares(counts)
        rates[:, -1] = np.round(1.0 - rates[:, :-1].sum(axis=1), 5)
        found = {"rows": len(seen), "counts": counts.tolist(), "confusion": rates.tolist()}
        data.setdefault(side, {})[str(cells)] = found
    return data


def of_weeding(
    strips: int | None = None, eyes: str = "classical", pictures: str = "easy", times: int = 1
) -> dict[str, Any]:
    """So many strips of every tier, by default ``times`` as many as each needs."""
    from fieldgym.envs.weeding.eyes import eyes_of
    from fieldgym.envs.weeding.perception import PerceptionModel
    from fieldgym.envs.weeding.view import FRAME_EVERY_M

    usual = {tier: strips or times * needed for tier, needed in weeding.STRIPS.items()}
    parts = {tier: weeding.measure(tier, many, eyes, pictures) for tier, many in usual.items()}
    model = weeding.fit(list(parts.values()), eyes_of(eyes).calibrates)
    PerceptionModel.from_json(model)
    return {
        "comment": f"a picture every {FRAME_EVERY_M} m; drift and delay assumed",
        "model": model,
        "measured": {tier: weeding.summary(part) for tier, part in parts.items()},
    }


MEASURED = {
    "safflower": of_safflower,
    "sorting": sorting.measure,
    "transplanting": of_transplanting,
    "weeding": of_weeding,
}


def as_text(data: dict[str, Any]) -> str:
    """JSON with every list of plain values on a line."""
    return re.sub(r"\[[^][{}]*]", lambda found: " ".join(found.group().split()), json.dumps(data, indent=1)) + "\n"


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("task", choices=MEASURED)
    parser.add_argument("--size", type=int, help="stops a scenario, frames, rows a pair of presets, strips a tier")
    parser.add_argument("--write", action="store_true", help="write the fit into assets/perception/")
    parser.add_argument("--thresholds", action="store_true", help="search the transplanter's detector settings")
    parser.add_argument("--eyes", choices=("classical", "learned"), default="classical", help="of the weeders")
    parser.add_argument("--pictures", choices=("easy", "field"), default="easy", help="of the weeders' cameras")
    parser.add_argument("--times", type=int, default=1, help="so many times the weeders' usual strips")
    options = parser.parse_args()
    if options.size is not None and options.size < 1:
        parser.error(f"--size {options.size}: give at least 1")
    if options.times < 1:
        parser.error(f"--times {options.times}: give at least 1")
    size = () if options.size is None else (options.size,)
    if options.thresholds:
        looks = transplanting.collect(*(size or (100,)), transplanting.FIT_SEED)
        print(transplanting.fit([sample for seen in looks.values() for sample in seen]))
        return
    name, how, made_by = f"{options.task}.json", {}, f"scripts/measure_camera.py {options.task}"
    if options.task == "weeding":
        from fieldgym.envs.weeding.perception import fit_name

        how, name = {"eyes": options.eyes, "pictures": options.pictures}, fit_name(options.eyes, options.pictures)
        how |= {"times": options.times}
        made_by += "".join(f" --{word} {value}" for word, value in how.items() if value not in ("classical", "easy", 1))
    text = as_text({"made_by": made_by} | MEASURED[options.task](*size, **how))
    print(text, end="")
    if options.write:
        replace_file(FOLDER / name, text)


if __name__ == "__main__":
    main()
