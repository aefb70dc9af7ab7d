"""Fits the statistical camera of the picker to rendered stops.

Reports are paired with heads that are nearer than 25 mm (nearest pairs first, each head once) and counted: recall of
what no other hides by stage and occlusion, what is left of it under higher heads by the gap to the nearest, reports
without a head, confusion of stages, position error and its spread, error of the size.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...kernels.seeds import PICTURES
from ...perception.blooms import Blooms, detect
from ..pairing import nearest_pairs
from .config import GAPS_M, SCENARIOS
from .crowding import chain, gap_m, stretches
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
        # Of heads behind leaves or not, by stage and class of gap.
        self.present, self.reported = np.zeros((2, 2, 4, len(GAPS_M) + 1))
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
        gap = np.searchsorted(GAPS_M, _gaps_m(truth), side="right")
        behind, stages = core.head_occluded[0, heads].astype(np.int64), core.state.head_stage[0, heads]
        np.add.at(self.present, (behind, stages, gap), inside)
        for report, index in matched:
            head = heads[index]
            stage = core.state.head_stage[0, head]
            if inside[index]:
                self.reported[behind[index], stage, gap[index]] += 1
                self.confusion[stage, blooms.stage[report]] += 1
                self.errors.append(blooms.position[report] - truth[index])
                self.sizes.append(blooms.spread_m[report] / core.head_size_m[0, head] - 1.0)
        paired = {report for report, _ in matched}
        self.false += sum(1 for report in np.flatnonzero(here) if report not in paired)

    def fit(self) -> dict[str, Any]:
        """The statistical camera of this scenario."""
        free, seen = self.present[..., -1], self.reported[..., -1]
        overall = seen.sum(axis=0) / np.maximum(free.sum(axis=0), 1.0)
        # A class that a scenario does not show takes the rate of the same stage, whatever hangs over it.
        recall = np.where(free > 0, seen / np.maximum(free, 1.0), overall)
        rows = self.confusion.sum(axis=1, keepdims=True)
        confusion = np.where(rows > 0, self.confusion / np.maximum(rows, 1.0), np.eye(4))
        errors = np.array(self.errors)
        return {
            "stops": self.stops,
            "heads": int(self.present.sum()),
            "recall": np.round(recall, 4).tolist(),
            "below": np.round(self._below(recall), 4).tolist(),
            "false_per_stop": round(self.false / self.stops, 4),
            "precision": round(len(errors) / max(len(errors) + self.false, 1), 4),
            "position_bias_m": np.round(errors.mean(axis=0), 6).tolist(),
            "position_sigma_m": np.round(_NORMAL * np.abs(errors - errors.mean(axis=0)).mean(axis=0), 6).tolist(),
            "radial_error_m": round(float(np.linalg.norm(errors[:, :2], axis=1).mean()), 6),
            "stage_confusion": np.round(confusion, 4).tolist(),
            "size_sigma": round(float(np.std(self.sizes)), 4),
        }

    def _below(self, recall: np.ndarray) -> np.ndarray:
        """What is left (2, G) of a recall (2, 4) under a higher head; where no head is, what is left of all."""
        expected = np.sum(self.present * recall[..., None], axis=1)[:, :-1]
        reported = self.reported.sum(axis=1)[:, :-1]
        overall = np.where(expected.sum(axis=0) > 0, reported.sum(axis=0) / np.maximum(expected.sum(axis=0), 1e-9), 1.0)
        return np.minimum(np.where(expected > 0, reported / np.maximum(expected, 1e-9), overall), 1.0)


def _gaps_m(place: np.ndarray) -> np.ndarray:
    """How far heads (n, 3) are from the nearest higher one, seen from above, as rules tell it."""
    begin_m = float(place[:, 0].min())
    first = np.empty(stretches(float(np.ptp(place[:, 0]))), np.int64)
    after = np.empty(len(place), np.int64)
    chain(begin_m, place, np.ones(len(place), bool), first, after)
    return np.array([gap_m(begin_m, place, first, after, i) for i in range(len(place))])


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
