"""Fits the statistical camera of the sorter to rendered belts.

Reports are paired with the items nearest to them (25 mm at most, each once) and counted: recall, reports without an
item, confusion of grades, and errors of centre, yaw, tilt and axes. The fit takes plain standard deviations, tails
included.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...kernels.seeds import PRODUCE
from ...perception.produce import Produce
from ..pairing import nearest_pairs
from .columns import ITEM
from .config import SCENARIOS, SortingConfig
from .core import SortingCore
from .drawing import FRUIT
from .reports import wrapped
from .view import MATCH_RADIUS_M, SorterView

FIRST_SEED = PRODUCE.first
FRAMES_A_STREAM = 48


class Tally:
    """What was counted so far."""

    def __init__(self) -> None:
        """Start empty."""
        self.frames, self.items, self.false = 0, 0, 0
        self.confusion = np.zeros((4, 4), int)
        self.missed = np.zeros(4, int)
        self.centre: list[np.ndarray] = []
        self.yaw: tuple[list[float], list[float]] = ([], [])
        self.lean: tuple[list[np.ndarray], list[np.ndarray]] = ([], [])
        self.axes: list[np.ndarray] = []

    def add(self, seen: Produce, core: SortingCore, taken_s: float) -> None:
        """Count one image."""
        belt = core.config.belt
        x = belt.speed_m_s * (taken_s - core.items[0, :, ITEM.passing_s])
        half = 0.5 * belt.camera_step_m
        there = np.flatnonzero(np.abs(x - belt.camera_x_m) <= half)
        around = np.flatnonzero(np.abs(x - belt.camera_x_m) <= half + MATCH_RADIUS_M)
        near = np.flatnonzero(np.abs(seen.position[:, 0] - belt.camera_x_m) <= half + 0.5 * MATCH_RADIUS_M)
        self.frames += 1
        self.items += len(there)
        places = np.stack([x, core.items[0, :, ITEM.across_m]], axis=-1)
        distance = np.linalg.norm(seen.position[near][:, None, :2] - places[around][None], axis=-1)
        matched = [(report, int(around[index])) for report, index in nearest_pairs(distance, MATCH_RADIUS_M)]
        for report, item in matched:
            if item in there:
                self._pair(seen, int(near[report]), core, item, x[item])
        used, found = {report for report, _ in matched}, {item for _, item in matched}
        missed = core.items[0, [i for i in there if i not in found], ITEM.grade]
        self.missed += np.bincount(missed.astype(np.int64), minlength=4)
        inside = [r for r in range(len(near)) if abs(seen.position[near[r], 0] - belt.camera_x_m) <= half]
        self.false += sum(r not in used for r in inside)

    def _pair(self, seen: Produce, report: int, core: SortingCore, item: int, x: float) -> None:
        lies = core.items[0, item]
        grade = int(lies[ITEM.grade])
        kind = int(grade // 2 == FRUIT)
        self.confusion[grade, seen.grade[report]] += 1
        centre = np.array([x, lies[ITEM.across_m], lies[ITEM.up_m] + core.config.machine.sorter.belt_height_m])
        self.centre.append(seen.position[report] - centre)
        self.yaw[kind].append(float(wrapped(np.array(seen.yaw[report] - lies[ITEM.yaw_rad]))))
        lean = lies[ITEM.tilt_rad] * np.array([np.cos(lies[ITEM.azimuth_rad]), np.sin(lies[ITEM.azimuth_rad])])
        reported = seen.tilt[report] * np.array([np.cos(seen.azimuth[report]), np.sin(seen.azimuth[report])])
        self.lean[kind].append(reported - lean)
        true_axes = lies[ITEM.length_m] * np.array([1.0, lies[ITEM.width], lies[ITEM.thickness]])
        self.axes.append(seen.axes_m[report] / true_axes - 1.0)

    def fit(self) -> dict[str, Any]:
        """The statistical camera, with what it was fitted to."""
        centre, axes = np.array(self.centre), np.array(self.axes)
        shares = (self.confusion + 0.0) / np.maximum(self.confusion.sum(axis=1, keepdims=True), 1)
        lean = [np.concatenate(part) for part in self.lean]
        yaw_deg = [np.degrees(np.abs(part)) for part in self.yaw]
        return {
            "frames": self.frames,
            "items": self.items,
            "recall": round(1.0 - int(self.missed.sum()) / self.items, 4),
            "false_per_item": round(self.false / self.items, 4),
            "position_bias_m": np.round(centre.mean(axis=0), 5).tolist(),
            "position_sigma_m": np.round(centre.std(axis=0), 5).tolist(),
            "yaw_sigma_rad": [round(float(np.std(part)), 4) for part in self.yaw],
            "tilt_sigma_rad": [round(float(np.sqrt(np.mean(part**2))), 4) for part in lean],
            "length_sigma": round(float(axes[:, 0].std()), 4),
            "grade_confusion": np.round(shares, 4).tolist(),
            "measured": {
                "confusion_counts": self.confusion.tolist(),
                "missed_by_grade": self.missed.tolist(),
                "false": self.false,
                "mean_horizontal_error_mm": round(float(1e3 * np.linalg.norm(centre[:, :2], axis=1).mean()), 3),
                "p95_horizontal_error_mm": round(
                    float(1e3 * np.quantile(np.linalg.norm(centre[:, :2], axis=1), 0.95)), 3
                ),
                "yaw_median_p95_deg": [np.round(np.quantile(part, [0.5, 0.95]), 2).tolist() for part in yaw_deg],
                "tilt_median_p95_deg": [
                    np.round(np.degrees(np.quantile(np.linalg.norm(np.array(part), axis=1), [0.5, 0.95])), 2).tolist()
                    for part in self.lean
                ],
                "axes_bias": np.round(axes.mean(axis=0), 4).tolist(),
                "axes_sigma": np.round(axes.std(axis=0), 4).tolist(),
            },
        }


def measure(frames: int = 960) -> dict[str, Any]:
    """Render and count ``frames`` images, the scenarios in turn."""
    tally = Tally()
    for stream, name in enumerate(list(SCENARIOS) * (frames // FRAMES_A_STREAM + 1)):
        if tally.frames >= frames:
            break
        core = SortingCore(SortingConfig(scenario=SCENARIOS[name]), None)
        core.reset_rows(np.array([0]), [np.random.default_rng(FIRST_SEED + stream)])
        view = SorterView(core)
        for number in range(min(FRAMES_A_STREAM, frames - tally.frames)):
            taken_s, seen = view.take(number)
            tally.add(seen, core, taken_s)
        view.close()
    return tally.fit()
