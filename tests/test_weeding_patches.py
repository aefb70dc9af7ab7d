"""Weeds in patches of metres and a crop with gaps: where they stand, and that as many grow."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.envs.weeding.drawing import Strip, fine, patch_density, patched
from fieldgym.envs.weeding.state import FAR_M, PAD

ID = "fieldgym/LaserWeeding-v0"


def drawn(scenario: str) -> Any:
    env: Any = gym.make_vec(ID, 200, vectorization_mode="vector_entry_point", scenario=scenario, perception="model")
    env.reset(seed=5)
    return env.unwrapped.core


def test_patches_move_weeds_and_grow_none():
    plain, patchy = drawn("load-1.25"), drawn("patchy")
    counts = []
    for core in (plain, patchy):
        along = core.state.plant[:, PAD : core.weeds_end - PAD, 0]
        there = along < FAR_M
        assert np.array_equal(there.sum(axis=1), core.state.weeds)
        counts.append(np.array([np.histogram(row[ok], 8, (0.0, 8.0))[0] for row, ok in zip(along, there, strict=True)]))
    assert counts[1].mean() == pytest.approx(counts[0].mean(), rel=0.03)
    spread = [float(count.var(axis=1).mean() / count.mean()) for count in counts]
    assert spread[1] > 1.3 * spread[0]


def test_a_quarter_of_the_crop_leaves_gaps():
    plain, patchy = drawn("load-1.25"), drawn("patchy")
    whole, left = (core.state.plant[:, core.weeds_end :, 0] for core in (plain, patchy))
    assert (whole < FAR_M).all()
    share = (left < FAR_M).mean()
    assert share == pytest.approx(0.75, abs=0.02)
    for row, all_of_it in zip(left, whole, strict=True):
        kept = row[row < FAR_M]
        assert (np.diff(kept) > 0.0).all() and np.isin(kept, all_of_it).all()


def test_patches_lie_where_the_density_says():
    core = drawn("patchy")
    strip = Strip.of(core.config.scenario)
    places = np.array([patched(strip, 0.3, share) for share in (np.arange(20_000) + 0.5) / 20_000])
    assert (np.diff(places) > 0.0).all() and 0.0 <= places[0] and places[-1] <= 1.0
    found, edges = np.histogram(places, 32, (0.0, 1.0))
    wanted = np.array([patch_density(strip, 0.3, share) for share in 0.5 * (edges[1:] + edges[:-1])])
    assert np.allclose(found / found.mean(), wanted / wanted.mean(), atol=0.1)
    assert patched(Strip.of(drawn("load-1.25").config.scenario), 0.3, 0.123) == 0.123
    fines = np.array([fine(x) for x in np.random.default_rng(0).random(20_000)])
    assert np.allclose(np.histogram(fines, 10, (0.0, 1.0))[0] / 2_000, 1.0, atol=0.1)
