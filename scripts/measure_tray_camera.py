"""Measure what the row cameras report of rendered tray rows, and write the statistics that stand for them.

    python scripts/measure_tray_camera.py [--rows 100] [--fit] [--write]

100 rows a pair of presets and side are 200 of each source tray, 400 of each target tray; see
``fieldgym.envs.transplanting.calibration``. ``--fit`` searches the thresholds of ``perception.trays.TraySettings`` on
other rows first and prints them; they are copied by hand. ``--write`` puts the confusion matrices into
``assets/perception/transplanting.json``.
"""

from __future__ import annotations

import argparse
import json
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import track
from rich.table import Table

from fieldgym.envs.transplanting.calibration import FIT_SEED, MEASURE_SEED, collect, confusion, fit, shares
from fieldgym.envs.transplanting.config import REPORTS
from fieldgym.kernels.files import replace_file
from fieldgym.perception.trays import TraySettings

TARGET_FILE = Path(__file__).resolve().parent.parent / "assets" / "perception" / "transplanting.json"


def main() -> None:
    """Fit, measure, print, write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--rows", type=int, default=100, help="rows a pair of presets and side (default 100)")
    parser.add_argument("--fit", action="store_true", help="search the thresholds on other rows first")
    parser.add_argument("--write", action="store_true", help="write assets/perception/transplanting.json")
    options = parser.parse_args()
    console = Console()
    rendering = partial(track, description="rendering rows")
    settings = TraySettings()
    if options.fit:
        settings = fit([sample for seen in collect(options.rows, FIT_SEED, rendering).values() for sample in seen])
        console.print(settings)
    data: dict[str, Any] = {"cameras": "RGB-D, straight down, over each row as it comes in", "reports": REPORTS}
    for (side, cells), seen in sorted(collect(options.rows, MEASURE_SEED, rendering).items()):
        counts = confusion(seen, settings)
        rates = shares(counts)
        rates[:, -1] = np.round(1.0 - rates[:, :-1].sum(axis=1), 5)
        found = {"rows": len(seen), "counts": counts.tolist(), "confusion": rates.tolist()}
        data.setdefault(side, {})[str(cells)] = found
        table = Table(f"{side}, {cells} cells, {len(seen)} rows", *REPORTS)
        for name, line, rate in zip(REPORTS, counts, rates, strict=True):
            table.add_row(name, *(f"{count} ({100 * share:.2f} %)" for count, share in zip(line, rate, strict=True)))
        console.print(table)
    if options.write:
        replace_file(TARGET_FILE, json.dumps(data, indent=2) + "\n")
        console.print(f"wrote {TARGET_FILE}")


if __name__ == "__main__":
    main()
