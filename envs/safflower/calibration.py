"""Fits the statistical camera of the picker to rendered stops.

Reports are paired with heads that are nearer than 25 mm (nearest pairs first, each head once) and counted: recall by
stage and occlusion, reports without a head, confusion of stages, position error and its spread, error of the size.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...kernels.seeds import PICTURES
from ...perception.blooms import Blooms, detect
from ..pairing import nearest_pairs
from .config import SCENARIOS
from .env import SafflowerPickingEnv
from .view import MATCH_RADIUS_M

FIRST_SEED = PICTURES.first
_NORMAL = float(np.sqrt(0.5 * np.pi))
"""A normal law's standard deviation over its mean distance from the middle. The few reports that are far off would make
all of them too far off: no pick gets less than nothing from a head, however far off."""
PUBLISHED = {
    "source": "10.1038/s41598-025-95620-8",
    "mean_error_mm": [2.42, 2.86, 3.18],
    "detection": 0.91,
}


class Tally:
    """Counts of one scenario."""

    def __init__(self) -> None:
        """Start empty."""
        self.stops, self.false = 0, 0
        self.present, self.reported = np.zeros((2, 4)), np.zeros((2, 4))
        self.confusion = np.zeros((4, 4))
        self.errors: list[np.ndarray] = []
        self.sizes: list[float] = []

    def add(self, blooms: Blooms, core: Any, stop: int) -> None:
        """Count one stop."""
        scenario = core.config.scenario
        half = 0.5 * scenario.window_m
        centre = core.tables.stop_pose[stop, 0]
        here = np.abs(blooms.position[:, 0] - centre) <= half
        heads = np.flatnonzero(core.head_exists[0])
        truth = core.state.head_position[0, heads] + core.frame
        inside = np.abs(truth[:, 0] - centre) <= half
        apart = np.linalg.norm(blooms.position[:, None] - truth[None], axis=-1)
        matched = nearest_pairs(apart, MATCH_RADIUS_M)
        self.stops += 1
        for head, present in zip(heads, inside, strict=True):
            self.present[int(core.head_occluded[0, head]), core.state.head_stage[0, head]] += present
        for report, index in matched:
            head = heads[index]
            stage = core.state.head_stage[0, head]
            if inside[index]:
                self.reported[int(core.head_occluded[0, head]), stage] += 1
                self.confusion[stage, blooms.stage[report]] += 1
                self.errors.append(blooms.position[report] - truth[index])
                self.sizes.append(blooms.spread_m[report] / core.head_size_m[0, head] - 1.0)
        paired = {report for report, _ in matched}
        self.false += sum(1 for report in np.flatnonzero(here) if report not in paired)

    def fit(self) -> dict[str, Any]:
        """The statistical camera of this scenario."""
        overall = self.reported.sum(axis=0) / np.maximum(self.present.sum(axis=0), 1.0)
        # A class that a scenario does not show takes the rate of the same stage, whatever hangs over it.
        recall = np.where(self.present > 0, self.reported / np.maximum(self.present, 1.0), overall)
        rows = self.confusion.sum(axis=1, keepdims=True)
        confusion = np.where(rows > 0, self.confusion / np.maximum(rows, 1.0), np.eye(4))
        errors = np.array(self.errors)
        return {
            "stops": self.stops,
            "heads": int(self.present.sum()),
            "recall": np.round(recall, 4).tolist(),
            "false_per_stop": round(self.false / self.stops, 4),
            "precision": round(len(errors) / max(len(errors) + self.false, 1), 4),
            "position_bias_m": np.round(errors.mean(axis=0), 6).tolist(),
            "position_sigma_m": np.round(_NORMAL * np.abs(errors - errors.mean(axis=0)).mean(axis=0), 6).tolist(),
            "radial_error_m": round(float(np.linalg.norm(errors[:, :2], axis=1).mean()), 6),
            "stage_confusion": np.round(confusion, 4).tolist(),
            "size_sigma": round(float(np.std(self.sizes)), 4),
        }


def measure(scenario: str, stops: int) -> dict[str, Any]:
    """Look at ``stops`` stops of a scenario, at least, and fit the statistical camera to them."""
    return count(scenario, stops).fit()


def count(scenario: str, stops: int) -> Tally:
    """Look at whole rows of a scenario with ``stops`` stops, at least."""
    env: Any = SafflowerPickingEnv(scenario, backend="analytic", perception="camera")
    core, tally, episodes = env.core, Tally(), -(-stops // SCENARIOS[scenario].stops)
    for episode in range(episodes):
        env.reset(seed=FIRST_SEED + episode)
        for stop in range(SCENARIOS[scenario].stops):
            core.state.pose[0, 0] = core.tables.look_pose[stop, 0]
            look = env.view.look()
            tally.add(detect(look), core, stop)
    env.close()
    return tally
