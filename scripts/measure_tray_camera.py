"""Measure what the row cameras report of rendered tray rows, and write the statistics that stand for them.

    python scripts/measure_tray_camera.py [--rows 100] [--fit] [--write]

Rows of every pair of presets (source trays, and target trays planted from them) are drawn at random, rendered and
classified on seeds that no benchmark uses: 100 rows a pair and side are 200 of each source tray, 400 of each target
tray. ``--fit`` searches the thresholds of ``perception.trays.TrayRule`` on other rows first and prints them; they are
copied into the rule by hand. ``--write`` puts the confusion matrices into ``assets/perception/transplanting.json``.
"""

from __future__ import annotations

import argparse
import itertools
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import Console
from rich.progress import track
from rich.table import Table

from fieldgym.envs.transplanting.config import (
    REPORTS,
    SCENARIOS,
    SOURCE_TRAYS,
    TARGET_TRAYS,
    TRAYS,
    MachineConfig,
    TransplantingConfig,
)
from fieldgym.envs.transplanting.field import draw_blocks, draw_field, random_numbers
from fieldgym.envs.transplanting.scene import SIDES, Side, TrayLine, TrayScene
from fieldgym.perception.trays import CellLook, TrayRule, decide, look_at_cells

TARGET_FILE = Path(__file__).resolve().parent.parent / "assets" / "perception" / "transplanting.json"
FIT_SEED, MEASURE_SEED = 7_000_000, 8_000_000
_EMPTY_SHARE, _POOR_SHARE = 0.20, 0.20
"""More gaps and poor seedlings than a benchmark has, so that each class is met often; rates are per class."""

Sample = tuple[NDArray[np.int8], CellLook]
Presets = dict[tuple[Side, int], list[Sample]]


def collect(rows: int, first_seed: int) -> Presets:
    """Cells and looks by side and preset, ``rows`` rendered rows for each pair of presets and side."""
    samples: Presets = {}
    for source, target in track(list(itertools.product(SOURCE_TRAYS, TARGET_TRAYS)), "rendering rows"):
        seed = first_seed + 1000 * source + 100 * target
        for side, seen in collect_pair(source, target, rows, seed).items():
            samples.setdefault((side, source if side == "source" else target), []).extend(seen)
    return samples


def collect_pair(source: int, target: int, rows: int, first_seed: int) -> dict[Side, list[Sample]]:
    """Cells and looks of ``rows`` rendered rows a side, the target tray's seedlings raised in the source tray."""
    work = replace(
        SCENARIOS["replug-high"],
        source=TRAYS[source],
        target=TRAYS[target],
        source_trays=1,
        target_trays=1,
        vacancy=_EMPTY_SHARE,
        poor=_POOR_SHARE,
    )
    samples: dict[Side, list[Sample]] = {side: [] for side in SIDES}
    scene, seed, gap_m = TrayScene(TransplantingConfig(scenario=work)), first_seed, MachineConfig().tray_gap_m
    while any(len(seen) < rows for seen in samples.values()):
        field = draw_field(work, *draw_blocks([np.random.default_rng(seed)], random_numbers(work)))
        seed += 1
        lines = (
            TrayLine(work.source, field.source[0], field.source_lot[0], np.zeros(field.source[0].shape, bool), gap_m),
            TrayLine(work.target, field.target[0], field.target_lot[0], np.ones(field.target[0].shape, bool), gap_m),
        )
        scene.set_lines(*lines, 0.0, 0.0)
        for side, line in zip(SIDES, lines, strict=True):
            for row in range(min(len(line.cells), rows - len(samples[side]))):
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
    parser.add_argument("--rows", type=int, default=100, help="rows a pair of presets and side (default 100)")
    parser.add_argument("--fit", action="store_true", help="search the thresholds on other rows first")
    parser.add_argument("--write", action="store_true", help="write assets/perception/transplanting.json")
    options = parser.parse_args()
    console = Console()
    rule = TrayRule()
    if options.fit:
        rule = fit([sample for seen in collect(options.rows, FIT_SEED).values() for sample in seen])
        console.print(rule)
    data: dict[str, Any] = {"cameras": "RGB-D, straight down, over each row as it comes in", "reports": REPORTS}
    for (side, cells), seen in sorted(collect(options.rows, MEASURE_SEED).items()):
        counts = confusion(seen, rule)
        rates = shares(counts)
        rates[:, -1] = np.round(1.0 - rates[:, :-1].sum(axis=1), 5)
        found = {"rows": len(seen), "counts": counts.tolist(), "confusion": rates.tolist()}
        data.setdefault(side, {})[str(cells)] = found
        table = Table(f"{side}, {cells} cells, {len(seen)} rows", *REPORTS)
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
