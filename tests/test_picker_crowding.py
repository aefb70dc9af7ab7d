"""Heads under higher ones are reported less often, by how far across the nearest is."""

from dataclasses import replace

import numpy as np
import pytest

from fieldgym.envs.safflower.batch import Heads
from fieldgym.envs.safflower.calibration import Tally
from fieldgym.envs.safflower.config import GAPS_M, SCENARIOS, PerceptionModel, SafflowerConfig
from fieldgym.envs.safflower.crowding import chain, gap_m, stretches
from fieldgym.envs.safflower.field import SPREAD_M
from fieldgym.envs.safflower.sighting import Sight, draw_tracks


def test_the_gap_is_that_to_the_nearest_higher_head():
    rng, length_m = np.random.default_rng(0), 0.5
    # Some stand before the row and behind it.
    place = rng.uniform((-0.1, -0.05, 0.8), (length_m + 0.1, 0.05, 0.9), (120, 3))
    exists = rng.random(120) < 0.8
    first, after = np.empty(stretches(length_m), np.int64), np.empty(120, np.int64)
    chain(0.0, place, exists, first, after)
    near = 0
    for i in np.flatnonzero(exists).tolist():
        higher = exists & (place[:, 2] > place[i, 2])
        gap = np.hypot(*(place[higher, :2] - place[i, :2]).T).min(initial=np.inf)
        found = gap_m(0.0, place, first, after, i)
        assert found == pytest.approx(gap) if gap < GAPS_M[-1] else found >= GAPS_M[-1]
        near += gap < GAPS_M[-1]
    assert near > 50


def test_what_is_left_of_the_recall_goes_by_leaf_and_gap():
    """Pairs of heads of the same row: all of the higher ones are seen, of the lower ones those whose share says so."""
    gaps = np.array([0.5 * GAPS_M[0], *(edge - 1e-6 for edge in GAPS_M[1:]), GAPS_M[-1]])
    below = ((0.0, 1.0, 0.0, 1.0, 0.0), (1.0, 0.0, 1.0, 0.0, 1.0))
    config = SafflowerConfig(scenario=SCENARIOS["row"])
    sight = Sight.of(config, replace(PerceptionModel.perfect(), below=below))
    for hidden in (0, 1):
        n = 2 * len(gaps)
        place = np.zeros((1, n, 3))
        place[0, :, 0], place[0, :, 2] = 0.05 + 0.15 * (np.arange(n) // 2), 0.9
        place[0, 1::2, 1], place[0, 1::2, 2] = gaps, 0.88
        full, none, stage = np.ones((1, n), bool), np.zeros((1, n)), np.ones((1, n), np.int64)
        heads = Heads(place, full, stage, none, none + SPREAD_M, full & bool(hidden), none, none, stage)
        uniform, normal = (np.full((1, many), 0.5) for many in sight.random_numbers(n))
        told = draw_tracks(sight, heads, uniform, normal)
        seen = np.isin(np.arange(n), told.head[0, : told.first[0, -1]])
        assert seen[::2].all()
        assert seen[1::2].tolist() == [*(share == 1.0 for share in below[hidden]), True]


def test_a_fit_takes_what_hides_from_what_is_seen_without():
    tally = Tally()
    tally.errors, tally.sizes, tally.stops = [np.zeros(3)], [0.0], 1
    # Fresh heads: of 100 that nothing hides 80 are seen, of 50 right under others 10: a quarter of 80 %.
    tally.present[0, 1, -1], tally.reported[0, 1, -1] = 100, 80
    tally.present[0, 1, 0], tally.reported[0, 1, 0] = 50, 10
    fit = tally.fit()
    assert fit["recall"] == [[0.0, 0.8, 0.0, 0.0]] * 2
    # Behind leaves there were none: they take the others' share, and classes without a head lose nothing.
    assert fit["below"] == [[0.25, 1.0, 1.0, 1.0, 1.0]] * 2


@pytest.mark.parametrize("name", ["row-sparse", "row", "row-dense", "bag"])
def test_the_shipped_fits_see_less_of_what_stands_right_under_another(name):
    below = np.array(PerceptionModel.measured(name).below)
    assert (below[:, 0] < 0.7).all() and (below[:, -1] > 0.85).all() and (below[1, 0] < below[0, 0])
    assert PerceptionModel.measured("pots").below == PerceptionModel.perfect().below
