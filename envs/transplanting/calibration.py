"""Fits the statistical cameras of the transplanter, and the thresholds behind them, to rendered tray rows.

Rows of every pair of presets (source trays, and target trays planted from them) are drawn at random, rendered and
classified on seeds that no benchmark uses.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...kernels.seeds import PICTURES, PLUGS
from ...perception.trays import CellLook, Cells, TraySettings, decide, look_at_cells
from .config import REPORTS, SCENARIOS, SOURCE_TRAYS, TARGET_TRAYS, TRAYS, MachineConfig, TransplantingConfig
from .field import draw_batch
from .scene import SIDES, Side, TrayLine, TrayScene

FIT_SEED, MEASURE_SEED = PICTURES.first, PLUGS.first
_EMPTY_SHARE, _POOR_SHARE = 0.20, 0.20
"""More gaps and poor seedlings than a benchmark has, so that each class is met often; rates are per class."""

Sample = tuple[NDArray[np.int8], CellLook]
Pair = tuple[int, int]
Presets = dict[tuple[Side, int], list[Sample]]


def collect(rows: int, first_seed: int, progress: Callable[[Sequence[Pair]], Iterable[Pair]] = iter) -> Presets:
    """Cells and looks by side and preset, ``rows`` rendered rows for each pair of presets and side."""
    samples: Presets = {}
    for source, target in progress(list(itertools.product(SOURCE_TRAYS, TARGET_TRAYS))):
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
        field = draw_batch(work, [np.random.default_rng(seed)])
        seed += 1
        lines = (
            TrayLine(work.source, field.source[0], field.source_lot[0], np.zeros(field.source[0].shape, bool), gap_m),
            TrayLine(work.target, field.target[0], field.target_lot[0], np.ones(field.target[0].shape, bool), gap_m),
        )
        scene.set_lines(*lines, 0.0, 0.0)
        for side, line in zip(SIDES, lines, strict=True):
            for row in range(min(len(line.cells), rows - len(samples[side]))):
                frame = scene.look(side, row)
                look = look_at_cells(frame, Cells(scene.cells_m(side), line.tray.pitch_m, work.source.pitch_m))
                samples[side].append((line.cells[row].copy(), look))
    scene.close()
    return samples


def confusion(samples: list[Sample], settings: TraySettings) -> NDArray[np.int64]:
    """Counts (3, 3): row = what the cell holds, column = report."""
    counts = np.zeros((len(REPORTS), len(REPORTS)), np.int64)
    for cells, look in samples:
        np.add.at(counts, (cells, decide(look, settings)), 1)
    return counts


def fit(samples: list[Sample]) -> TraySettings:
    """Thresholds with the best mean of the classes' recalls, over a grid."""
    best, found = -1.0, TraySettings()
    grid = itertools.product(np.linspace(0.02, 0.2, 10), np.linspace(0.16, 0.21, 11), np.linspace(0.40, 0.52, 25))
    for middle, area, height in grid:
        settings = TraySettings(empty_middle=float(middle), poor_area=float(area), poor_height=float(height))
        counts = confusion(samples, settings)
        score = float(np.mean(np.diag(counts) / counts.sum(axis=1)))
        if score > best:
            best, found = score, settings
    return found


def shares(counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """Confusion matrix; one extra report of each kind in a thousand keeps what was never met possible."""
    padded = counts + 1e-3 * counts.sum(axis=1, keepdims=True) / len(REPORTS)
    return np.round(padded / padded.sum(axis=1, keepdims=True), 5)
