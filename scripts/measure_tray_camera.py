"""Measure what the row cameras report of rendered tray rows, and write the statistics that stand for them.

    python scripts/measure_tray_camera.py [--rows 300] [--fit] [--write]

Rows of every kind (source trays of 128 and 72 cells, planted target trays of 72 cells) are drawn at random, rendered
and classified on seeds that no benchmark uses. ``--fit`` searches the thresholds of ``perception.trays.TrayRule`` on
other rows first and prints them; they are copied into the rule by hand. ``--write`` puts the confusion matrices into
``assets/perception/transplanting.json``.
"""

from __future__ import annotations

import argparse
import itertools
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.table import Table

from fieldgym.envs.transplanting.config import REPORTS, SCENARIOS, TRAYS, TransplantingConfig
from fieldgym.envs.transplanting.scenario import draw_blocks, draw_field, random_numbers
from fieldgym.envs.transplanting.scene import SIDES, Side, TrayLine, TrayScene
from fieldgym.perception.trays import CellLook, TrayRule, decide, look_at_cells

TARGET_FILE = Path(__file__).resolve().parent.parent / "assets" / "perception" / "transplanting.json"
FIT_SEED, MEASURE_SEED = 7_000_000, 8_000_000
SOURCES = (128, 72)
_EMPTY_SHARE, _POOR_SHARE = 0.20, 0.20
"""More gaps and poor seedlings than a benchmark has, so that each class is met often; rates are per class."""

Sample = tuple[NDArray[np.int8], CellLook]


def collect(rows: int, first_seed: int) -> dict[Side, list[Sample]]:
    """Cells and looks of at least ``rows`` rendered rows a side, half of them from each kind of source tray."""
    samples: dict[Side, list[Sample]] = {side: [] for side in SIDES}
    for kind in SOURCES:
        work = replace(
            SCENARIOS["replug-high"],
            source=TRAYS[kind],
            source_trays=1,
            target_trays=1,
            vacancy=_EMPTY_SHARE,
            poor=_POOR_SHARE,
        )
        scene = TrayScene(TransplantingConfig(scenario=work))
        seed, enough = first_seed + kind * 1000, {side: len(samples[side]) + -(-rows // len(SOURCES)) for side in SIDES}
        while any(len(samples[side]) < enough[side] for side in SIDES):
            field = draw_field(work, *draw_blocks([np.random.default_rng(seed)], random_numbers(work)))
            seed += 1
            lines = (
                TrayLine(
                    work.source, field.source[0], field.source_lot[0], np.zeros(field.source[0].shape, bool), 0.04
                ),
                TrayLine(work.target, field.target[0], field.target_lot[0], np.ones(field.target[0].shape, bool), 0.04),
            )
            scene.set_lines(*lines, 0.0, 0.0)
            for side, line in zip(SIDES, lines, strict=True):
                for row in range(len(line.cells)):
                    if len(samples[side]) >= enough[side]:
                        break
                    frame = scene.look(side, row)
                    look = look_at_cells(
                        frame.rgb,
                        frame.depth_m,
                        frame.camera.intrinsics,
                        frame.camera.world_from_camera,
                        scene.cells_m(side),
                        line.tray.pitch_m,
                        work.source.pitch_m,
                    )
                    samples[side].append((line.cells[row].copy(), look))
        scene.close()
    return samples


def confusion(samples: list[Sample], rule: TrayRule) -> NDArray[np.int64]:
    """Counts (3, 3): row = what the cell holds, column = report."""
    counts = np.zeros((len(REPORTS), len(REPORTS)), np.int64)
    for cells, look in samples:
        np.add.at(counts, (cells, decide(look, rule)), 1)
    return counts


def fit(samples: list[Sample]) -> TrayRule:
    """Thresholds with the best mean of the classes' recalls, over a grid."""
    best, found = -1.0, TrayRule()
    grid = itertools.product(np.linspace(0.02, 0.6, 30), np.linspace(0.05, 0.40, 36), (0.3, 0.4, 0.5, 0.6, 0.7))
    for middle, area, yellow in grid:
        rule = replace(TrayRule(), empty_middle=float(middle), poor_area=float(area), yellow_share=float(yellow))
        counts = confusion(samples, rule)
        score = float(np.mean(np.diag(counts) / counts.sum(axis=1)))
        if score > best:
            best, found = score, rule
    return found


def shares(counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Confusion matrix; one extra report of each kind in a thousand keeps what was never met possible."""
    padded = counts + 1e-3 * counts.sum(axis=1, keepdims=True) / len(REPORTS)
    return np.round(padded / padded.sum(axis=1, keepdims=True), 5)


def main() -> None:
    """Fit, measure, print, write."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n")[0])
    parser.add_argument("--rows", type=int, default=300, help="rows a side (default 300)")
    parser.add_argument("--fit", action="store_true", help="search the thresholds on other rows first")
    parser.add_argument("--write", action="store_true", help="write assets/perception/transplanting.json")
    options = parser.parse_args()
    console = Console()
    rule = TrayRule()
    if options.fit:
        found = collect(options.rows, FIT_SEED)
        rule = fit(found["source"] + found["target"])
        console.print(rule)
    measured = collect(options.rows, MEASURE_SEED)
    data: dict[str, object] = {"cameras": "RGB-D, straight down, over each row as it comes in", "reports": REPORTS}
    for side in SIDES:
        counts = confusion(measured[side], rule)
        rates = shares(counts)
        rates[:, -1] = np.round(1.0 - rates[:, :-1].sum(axis=1), 5)
        data[side] = {
            "rows": len(measured[side]),
            "counts": counts.tolist(),
            "confusion": rates.tolist(),
        }
        table = Table(f"{side}, {len(measured[side])} rows", *REPORTS)
        for name, line, rate in zip(REPORTS, counts, rates, strict=True):
            table.add_row(name, *(f"{count} ({100 * share:.2f} %)" for count, share in zip(line, rate, strict=True)))
        console.print(table)
    if options.write:
        draft = TARGET_FILE.with_name(TARGET_FILE.name + ".new")
        draft.write_text(json.dumps(data, indent=2) + "\n", encoding="utf-8")
        draft.replace(TARGET_FILE)
        console.print(f"wrote {TARGET_FILE}")


if __name__ == "__main__":
    main()
