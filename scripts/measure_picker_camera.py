"""Measure the picker's camera on rendered stops and fit the statistical camera to it.

    python scripts/measure_picker_camera.py [--stops 220] [--only SCENARIO] [--out assets/perception/safflower.json]

In every scenario it renders stops of fields that no benchmark uses and runs the detector; see
``fieldgym.envs.safflower.calibration``.
"""

from __future__ import annotations

import argparse
import json
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.progress import track
from rich.table import Table

from fieldgym.envs.safflower.calibration import FIRST_SEED, PUBLISHED, measure
from fieldgym.envs.safflower.config import SCENARIOS, STAGES
from fieldgym.kernels.files import replace_file


def main() -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--stops", type=int, default=220, help="least number of stops a scenario (default 220)")
    parser.add_argument("--out", type=Path, default=Path(__file__).parents[1] / "assets/perception/safflower.json")
    parser.add_argument("--only", choices=list(SCENARIOS), help="measure one scenario and keep the other fits")
    options = parser.parse_args()
    fits = json.loads(options.out.read_text("utf-8"))["scenarios"] if options.only else {}
    for name in SCENARIOS if options.only is None else [options.only]:
        fits[name] = measure(name, options.stops, partial(track, description=f"{name:>10}", transient=True))
    table = Table("", *fits, "published")
    rows = {
        "stops": lambda f: str(f["stops"]),
        "recall, free fresh / late / dry": lambda f: " / ".join(f"{r:.3f}" for r in f["recall"][0][1:]),
        "recall, occluded": lambda f: " / ".join(f"{r:.3f}" for r in f["recall"][1][1:]),
        "precision": lambda f: f"{f['precision']:.3f}",
        "false reports a stop": lambda f: f"{f['false_per_stop']:.3f}",
        "mean radial error, mm": lambda f: f"{1e3 * f['radial_error_m']:.2f}",
        "bias x / y / z, mm": lambda f: " / ".join(f"{1e3 * e:.2f}" for e in f["position_bias_m"]),
        "sigma x / y / z, mm": lambda f: " / ".join(f"{1e3 * e:.2f}" for e in f["position_sigma_m"]),
        "stage right, fresh / late / dry": lambda f: " / ".join(f"{f['stage_confusion'][i][i]:.3f}" for i in (1, 2, 3)),
        "size error, relative": lambda f: f"{f['size_sigma']:.3f}",
    }
    published = {"recall, free fresh / late / dry": "detection 0.91", "mean radial error, mm": "x/y/z 2.42/2.86/3.18"}
    for name, cell in rows.items():
        table.add_row(name, *(cell(fit) for fit in fits.values()), published.get(name, ""))
    console = Console(width=120)
    console.print(table)
    console.print(
        "Rendered pictures have no lens, sensor or calibration error, so free heads are placed better than the "
        "published field figures; what is left is occlusion, touching heads and the detector itself."
    )
    data = {"stages": STAGES, "first_seed": FIRST_SEED, "published": PUBLISHED, "scenarios": fits}
    options.out.parent.mkdir(parents=True, exist_ok=True)
    replace_file(options.out, json.dumps(data, indent=1) + "\n")
    console.print(f"written: {options.out}")


if __name__ == "__main__":
    main()
