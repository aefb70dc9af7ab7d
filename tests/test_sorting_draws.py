"""What streams of produce and their reports are drawn from: the laws that the configuration says, on fixed seeds."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from scipy import stats

from fieldgym.envs.sorting.columns import ITEM, REPORT
from fieldgym.envs.sorting.config import SCENARIOS, PerceptionModel, SortingConfig
from fieldgym.envs.sorting.core import SortingCore

CONFIG = SortingConfig(scenario=SCENARIOS["load-1.25"])
CAMERA = replace(PerceptionModel.measured(), recall=0.9)
WORLDS = 200
LEAST = 1e-3
"""Smallest chance that the numbers are of the law."""


@pytest.fixture(scope="module")
def drawn() -> Any:
    """Items (n, ITEM) and reports (n, REPORT) side by side, when the first of each stream comes, and the batch."""
    core = SortingCore(CONFIG, CAMERA, 1)
    batch = core.draw([np.random.default_rng(seed) for seed in range(WORLDS)])
    items = batch.items[:, :-1]
    there = np.isfinite(items[..., ITEM.passing_s])
    said = batch.reports[:, : items.shape[1]]
    return items[there], said[there], items[:, 0, ITEM.passing_s], batch


def fits(values: Any, law: str | Callable[..., Any], *numbers: float) -> None:
    """Kolmogorov and Smirnov's test of the values."""
    assert stats.kstest(values, law, args=numbers).pvalue > LEAST


def test_items_follow_the_laws_of_the_configuration(drawn: Any) -> None:
    items, _, first_s, _ = drawn
    produce, belt = CONFIG.produce, CONFIG.belt
    start_s = belt.start_x_m / belt.speed_m_s
    fits(first_s + start_s, "expon", 0.0, 1.0 / CONFIG.scenario.rate_hz)
    half, sigma = belt.item_half_width_m, belt.slip_sigma_m
    fits(items[:, ITEM.across_m], "uniform", -half, 2.0 * half)
    fits(items[:, ITEM.yaw_rad], "uniform", -0.5 * np.pi, np.pi)
    fits(items[:, ITEM.azimuth_rad], "uniform", 0.0, 2.0 * np.pi)
    for luck in (ITEM.grip_luck, ITEM.way_luck, ITEM.ripeness):
        fits(items[:, luck], "uniform")
    for slip in (ITEM.slip_along_m, ITEM.slip_across_m):
        fits(items[:, slip], "norm", 0.0, sigma)
    tilt, most = items[:, ITEM.tilt_rad], produce.tilt_max_rad
    over = np.exp(-0.5 * (most / produce.tilt_sigma_rad) ** 2)
    assert tilt.max() <= most and np.mean(tilt == most) == pytest.approx(over, abs=4.0 * np.sqrt(over / len(tilt)))
    free = tilt[tilt < most]
    fits(free, lambda t: (1.0 - np.exp(-0.5 * (t / produce.tilt_sigma_rad) ** 2)) / (1.0 - over))
    fruit = items[:, ITEM.grade] >= 2
    assert fruit.mean() == pytest.approx(produce.fruit_share, abs=4.0 * 0.5 / np.sqrt(len(items)))
    for kind, (low, high) in ((~fruit, produce.tuber_length_m), (fruit, produce.fruit_length_m)):
        levels = round((high - low) / produce.length_step_m) + 1
        level = (items[kind, ITEM.length_m] - low) * (levels - 1) / (high - low)
        counts = np.bincount(np.round(level).astype(int), minlength=levels)
        assert len(counts) == levels and stats.chisquare(counts).pvalue > LEAST


def test_numbers_of_an_item_are_of_no_other_and_of_no_neighbour(drawn: Any) -> None:
    items, said, _, _ = drawn
    columns = [ITEM.across_m, ITEM.yaw_rad, ITEM.azimuth_rad, ITEM.tilt_rad, ITEM.ripeness, ITEM.grip_luck]
    columns += [ITEM.way_luck, ITEM.slip_along_m, ITEM.slip_across_m]
    seen = np.isfinite(said[:, REPORT.passing_s])
    numbers = np.column_stack([items[:, columns], seen])
    # Beside each other, and one item after the other.
    numbers = np.column_stack([numbers[:-1], numbers[1:]])
    between = np.corrcoef(numbers.T) - np.eye(numbers.shape[1])
    assert np.abs(between).max() < 4.5 / np.sqrt(len(numbers))


def test_reports_follow_the_laws_of_the_camera(drawn: Any) -> None:
    items, said, _, batch = drawn
    seen = np.isfinite(said[:, REPORT.passing_s])
    assert seen.mean() == pytest.approx(
        CAMERA.recall, abs=4.0 * np.sqrt(CAMERA.recall * (1 - CAMERA.recall) / len(seen))
    )
    items, said = items[seen], said[seen]
    kind = (items[:, ITEM.grade] // 2).astype(int)
    along = (items[:, ITEM.passing_s] - said[:, REPORT.passing_s]) * CONFIG.belt.speed_m_s
    fits(along, "norm", CAMERA.bias_m[0], CAMERA.sigma_m[0])
    for axis, column in ((1, ITEM.across_m), (2, ITEM.up_m)):
        fits(said[:, column] - items[:, column], "norm", CAMERA.bias_m[axis], CAMERA.sigma_m[axis])
    turn = (said[:, REPORT.yaw_rad] - items[:, ITEM.yaw_rad]) / np.array(CAMERA.yaw_sigma_rad)[kind]
    fits(turn, "norm")
    for part in (np.cos, np.sin):
        lean = said[:, REPORT.tilt_rad] * part(said[:, REPORT.azimuth_rad])
        lean -= items[:, ITEM.tilt_rad] * part(items[:, ITEM.azimuth_rad])
        fits(lean / np.array(CAMERA.tilt_sigma_rad)[kind], "norm")
    fits(said[:, REPORT.length_m] / items[:, ITEM.length_m] - 1.0, "norm", 0.0, CAMERA.length_sigma)
    for grade, shares in enumerate(CAMERA.confusion):
        told = said[items[:, ITEM.grade] == grade, REPORT.grade]
        for other, share in enumerate(shares):
            assert np.mean(told == other) == pytest.approx(share, abs=4.0 * np.sqrt(0.25 / len(told)))
    ghosts = np.isfinite(batch.reports[:, batch.items.shape[1] - 1 :, REPORT.passing_s]).sum(axis=1)
    mean = CAMERA.false_per_item * CONFIG.scenario.rate_hz * CONFIG.scenario.stream_s
    assert ghosts.mean() == pytest.approx(mean, abs=4.0 * np.sqrt(mean / len(ghosts)))
