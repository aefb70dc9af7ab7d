"""What stands nearest to a place on a strip, and orders and places in tables: against looking at everything."""

from itertools import product
from math import hypot, inf

import numpy as np
import pytest

from fieldgym.envs.safflower.drawing import Reach, half_width_m
from fieldgym.envs.weeding import gaps
from fieldgym.kernels.discs import covered_share
from fieldgym.kernels.orders import count_below, count_upto, rank


def plants(seed: int, n: int) -> np.ndarray:
    """Places, sorted along; some stand side by side."""
    rng = np.random.default_rng(seed)
    along = np.sort(np.round(rng.uniform(0.0, 1.0, n), 1 if seed % 2 else 6))
    return np.column_stack([along, rng.uniform(-0.2, 0.2, n)])


@pytest.mark.parametrize(("seed", "n"), [(0, 1), (1, 9), (2, 14), (3, 14)])
def test_neighbours_are_those_of_looking_at_all(seed, n):
    some, rng = plants(seed, n), np.random.default_rng(seed)
    places = np.column_stack([rng.uniform(-0.2, 1.2, 40), rng.uniform(-0.2, 0.2, 40)])
    places[:5, 0] = some[rng.integers(n, size=5), 0]
    for along, across in places.tolist():
        before = sum(row[0] < along for row in some)
        for guess in (0, before, n):
            assert gaps.passed(some, along, guess) == before
        off = np.abs(some[:, 0] - along)
        index = gaps.nearest_along(some, along, before)
        assert off[index] == off.min()
        left = [i for i in range(n) if some[i, 0] < along and off[i] == off.min()]
        assert not left or some[index, 0] < along
        for beside in range(min(3, (n + 1) // 2)):
            assert gaps.crop_index(some, along, before, beside) == min(max(index, beside), n - 1 - beside)
        nearest = min(hypot(row[0] - along, row[1] - across) for row in some)
        assert gaps.gap_to_crop(some, along, across, before) == pytest.approx(nearest, abs=1e-12)
    assert gaps.crop_gaps(some, places[places[:, 0].argsort()]) == pytest.approx(
        [min(hypot(*(row - place)) for row in some) for place in places[places[:, 0].argsort()]]
    )
    sorted_places = places[places[:, 0].argsort()][None]
    index = gaps.nearest_weeds(some[None], sorted_places)[0]
    assert np.abs(some[index, 0] - sorted_places[0, :, 0]) == pytest.approx(
        [np.abs(some[:, 0] - along).min() for along in sorted_places[0, :, 0]]
    )


@pytest.mark.parametrize(("seed", "n"), [(0, 1), (1, 9), (2, 14), (3, 14)])
def test_the_gap_to_the_next_weed(seed, n):
    some, none = plants(seed, n), np.zeros(n)
    leaves = np.random.default_rng(seed).choice([0.0, 0.01, 0.2], n)
    for i, count, looked_at, most, reach in product(
        range(n), (n, max(n - 3, 1)), (1, 3, 20), (inf, 0.05), (none, leaves)
    ):
        if i >= count:
            continue
        known = [j for j in range(max(i - looked_at, 0), min(i + looked_at + 1, count)) if j != i]
        nearest = min((hypot(*(some[j] - some[i])) - reach[i] - reach[j] for j in known), default=inf)
        found = gaps.gap_to_weed(some, reach, count, i, looked_at, most)
        assert found == pytest.approx(nearest) or min(found, nearest) >= most
    assert gaps.weed_gaps(some, none, n) == pytest.approx(
        [min((hypot(*(some[j] - some[i])) for j in range(n) if j != i), default=inf) for i in range(n)]
    )


def test_the_arm_s_reach_is_read_between_the_levels_of_its_table():
    levels, widths = np.array([-0.3, -0.2, -0.15, -0.1]), np.array([0.05, 0.2, -1.0, 0.3])
    table = Reach(levels, widths)
    for level in (-0.4, -0.3, -0.27, -0.2, -0.19, -0.15, -0.11, -0.1, -0.05):
        by_hand = float(np.interp(level, levels, widths, left=-7.0, right=9.0))
        assert half_width_m(table, level, -7.0, 9.0) == pytest.approx(by_hand, abs=1e-15)


def test_discs_cover_what_counting_points_says():
    grid = np.linspace(-1.0, 1.0, 1001)
    x, y = np.meshgrid(grid, grid)
    for cover, disc, distance in product((0.2, 0.5, 0.9), (0.3, 0.5), (0.0, 0.15, 0.2, 0.45, 0.7, 1.0, 1.4)):
        inside = x * x + y * y <= disc * disc
        both = inside & ((x - distance) ** 2 + y * y <= cover * cover)
        share = covered_share(cover, disc, distance)
        assert share == pytest.approx(np.count_nonzero(both) / np.count_nonzero(inside), abs=4e-3)
        assert (share == 0.0) == (distance >= cover + disc) and (share == 1.0) == (distance <= cover - disc + 1e-9)


@pytest.mark.parametrize("n", [0, 1, 15, 16, 17, 33, 100])
def test_ranks_are_stable_and_counts_are_those_of_all(n):
    rng = np.random.default_rng(n)
    keys = rng.integers(0, 12, n).astype(float)
    order, spare = np.full(n + 2, -1), np.full(n + 2, -1)
    rank(keys, order, spare)
    assert order[:n].tolist() == np.argsort(keys, kind="stable").tolist() and (order[n:] == -1).all()
    ascending = np.sort(keys)
    for value in (-1.0, 0.0, 3.0, 3.5, 11.0, 12.0):
        assert count_below(ascending, value) == sum(key < value for key in keys)
        assert count_upto(ascending, value) == sum(key <= value for key in keys)
