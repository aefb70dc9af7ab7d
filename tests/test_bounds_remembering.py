"""Paths that remember, sets of shots that kill, and the hoe's bounds: against trying everything."""

from dataclasses import replace
from itertools import product
from typing import Any

import numpy as np
import pytest
from test_bounds_expected import best_on_average
from test_bounds_weeding import best_by_trying

from fieldgym.bounds import killing, recall, remembering, weeding
from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.perception import PerceptionModel
from fieldgym.envs.weeding.tools.hoe.config import HoeWeedingConfig
from fieldgym.envs.weeding.tools.hoe.env import hoe_core

EXACT = 1e-9
TOYS, TOUCHED = 60, 0.05
"""Toys, and how far above the best that can be had a bound may lie and still touch it: times are cut to ticks."""


@pytest.mark.slow
def test_nothing_on_toys_is_better_than_the_hoe_s_bounds_and_nearly_always_something_is_as_good():
    """Two tracks, waits of 0.2 s; with the luck known and on average."""
    config = HoeWeedingConfig()
    scenario = replace(SCENARIOS["load-1.6"], strip_m=0.15, max_weeds=20, offered_load=3.0, cluster_sigma_m=0.03)
    config = replace(config, scenario=scenario, cart=replace(config.cart, moment_s=0.2, start_m=0.2))
    core, number, toys, touched = hoe_core(config, PerceptionModel.measured("classical", "easy"), 1), 0, 0, 0
    while toys < TOYS:
        core.reset_rows(np.array([0]), [np.random.default_rng(5000 + number)])
        number += 1
        if int(core.state.track_count[0]) != 2 or core.state.weeds[0] < 2:
            continue
        toys += 1
        instance = weeding.instance_of(core)
        bound, (most, rate, _) = instance.bound(), best_by_trying(core)
        assert instance.hoped is not None and bound.expected is not None and bound.found is not None
        mean, found = best_on_average(core, instance.hoped), bound.found
        assert most <= bound.episode_return + EXACT and mean <= bound.expected.episode_return + EXACT
        assert found.net_rate <= rate == bound.net_rate and found.episode_return <= most + EXACT
        touched += (bound.episode_return - most < TOUCHED) + (bound.expected.episode_return - mean < TOUCHED)
    assert touched >= 0.9 * 2 * TOYS


def some_ways(seed: int) -> tuple[recall.Ways, np.ndarray, np.ndarray, np.ndarray]:
    """Four targets with two options each; the second of a target also does something to what the next one has.

    Some of that does not serve it, so that it is paid again.
    """
    rng, n = np.random.default_rng(seed), 4
    lasts = np.sort(rng.integers(13, 18, n))
    pairs = [(i, k) for i in range(n) for k in range(n) if k != i]
    share_thing = [[4 + o // 2, 4 + (o // 2 + 1) % n][: 1 + o % 2] for o in range(2 * n)]
    halves: Any = 0.5 + rng.integers(2, 5, 2 * n)
    quarters: Any = 0.25 + rng.integers(0, 3, len(pairs) + n)
    ways = recall.Ways(
        option_first=2 * np.arange(n + 1),
        enters=rng.integers(2, 10, 2 * n),
        lasts=lasts,
        stand_s=halves,
        pair_first=3 * np.arange(n + 1),
        pair_to=np.array([k for _, k in pairs]),
        pair_s=quarters[n:],
        far=np.full(n, n),
        start_s=quarters[:n],
        share_first=np.concatenate([[0], np.cumsum([len(things) for things in share_thing])]),
        share_thing=np.array([thing for things in share_thing for thing in things]),
        full=rng.random(3 * n) < 0.5,
        tick_s=1.0,
    )
    return ways, rng.random(3 * n), 0.3 * rng.random(2 * n), -0.05 * np.arange(18.0)


def walked(ways: Any, price: Any, cost: Any, end: Any, remembered: dict[int, set[int]]) -> float:
    """The most that any order brings, where each target remembers some things."""

    def go_on(target: int, tick: int, known: frozenset[int]) -> float:
        most = float(end[tick])
        for o in range(len(cost)):
            k = o // 2
            if k == target or k in known:
                continue
            way_s = ways.start_s[k] if target < 0 else ways.pair_s[3 * target + k - (k > target)]
            then = max(tick + int(way_s + ways.stand_s[o]), int(ways.enters[o]))
            if then > ways.lasts[k]:
                continue
            here = slice(ways.share_first[o], ways.share_first[o + 1])
            things = ways.share_thing[here].tolist()
            paid = sum(p for thing, p in zip(things, price[here].tolist(), strict=True) if thing not in known)
            now = (known | {target} | set(ways.share_thing[here][ways.full[here]].tolist())) & remembered[k]
            most = max(most, paid - float(cost[o]) + go_on(k, then, frozenset(now)))
        return most

    return go_on(-1, 0, frozenset())


@pytest.mark.parametrize("seed", range(4))
def test_the_longest_path_is_the_best_order_by_what_is_remembered(seed):
    ways, price, cost, end = some_ways(seed)
    values = []
    for most in (0, 2, recall.MOST):
        count, thing = np.full(4, most), np.full((4, recall.MOST), -1)
        remembered: dict[int, set[int]] = {}
        for k in range(4):
            others = [other for other in (4, 0, 5, 1, 6, 2, 7, 3) if other != k][:most]
            thing[k, :most], remembered[k] = others, set(others)
        lists = recall.listed(ways, count, thing)
        weight, alone = np.empty(len(lists.after)), recall.plain(ways, price, cost)
        recall.weighed(ways, lists, price, cost, weight)
        best, later = np.empty(lists.base[-1]), np.empty(5)
        value = recall.longest(ways, lists, weight, alone, end, best, later)
        assert value == pytest.approx(walked(ways, price, cost, end, remembered), abs=1e-12)
        options, subsets = recall.followed(ways, lists, weight, alone, end, best, later, value)
        target, prices = np.arange(8) // 2, np.arange(12)
        paid = remembering.paid(ways, lists, options, subsets, target, prices, 12)
        left = value - (float(paid @ price) - float(cost[options].sum()))
        assert np.abs(end - left).min() == pytest.approx(0.0, abs=1e-12)
        values.append(value)
    assert values[0] >= values[1] >= values[2]


def test_whatever_kills_a_weed_has_one_of_its_sets():
    rng, several = np.random.default_rng(2), 0
    for _ in range(60):
        track = np.repeat(np.arange(rng.integers(1, 5)), 3)
        share = np.minimum(rng.random(len(track)) * rng.choice([0.05, 0.6, 1.4], len(track)), 1.0)
        ways = killing.killing(track, share)
        choices = [[None, *np.flatnonzero(track == k).tolist()] for k in range(track[-1] + 1)]
        for chosen in product(*choices):
            some = {c for c in chosen if c is not None}
            if share[list(some)].sum() >= 1.0:
                assert ways is not None
                alone, sets = ways
                assert alone[list(some)].any() or any(set(one) <= some for one in sets)
        several += ways is not None and any(len(one) > 1 for one in ways[1])
        sets, total = killing.shared(track, share)
        assert total == pytest.approx([min(float(share[list(one)].sum()), 1.0) for one in sets])
        assert len(set(sets)) == len(sets) == 4 ** min(int(track[-1]) + 1, killing.TOGETHER) - 1
    assert several > 10
