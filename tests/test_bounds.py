"""No policy beats a bound; on toys it is what brute force finds."""

from dataclasses import replace
from itertools import pairwise, permutations, product
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym import bounds
from fieldgym.agents import make_policy
from fieldgym.agents.evaluation import evaluate
from fieldgym.bounds import base, safflower, stops
from fieldgym.envs.safflower.config import SCENARIOS, PerceptionModel, SafflowerConfig
from fieldgym.envs.safflower.core import SafflowerCore

ID = "fieldgym/SafflowerPicking-v0"
SEEDS = range(4)
EXACT = 1e-9


def toy(seed: int, heads: int = 3, time_limit_s: float = 900.0) -> SafflowerCore:
    """Two small pots with at most three heads in all, a camera that errs, and a time limit."""
    scenario = replace(
        SCENARIOS["pots"], plants=2, max_heads=2, mean_heads=1.5, time_limit_s=time_limit_s, camera_fit="pots"
    )
    perception = replace(PerceptionModel.perfect(), sigma_m=(0.005, 0.005, 0.005), false_per_stop=0.3)
    for number in range(100):
        core = SafflowerCore(SafflowerConfig(scenario=scenario, slots=4), perception, 1)
        core.reset_rows(np.array([0]), [np.random.default_rng(1000 * seed + number)])
        if int(core.state.first[0, -1]) == heads:
            return core
    raise AssertionError("no toy has so many reports")


@pytest.mark.parametrize("seed", range(4))
def test_without_haste_the_bound_is_what_trying_everything_finds(seed, best_by_trying):
    core = toy(seed)
    bound = safflower.instance_of(core).bound()
    most, rate, cycle_s = best_by_trying(core)
    assert bound.proven and bound.gap == 0.0
    assert bound.episode_return == pytest.approx(most, abs=EXACT)
    assert bound.net_rate == pytest.approx(rate, abs=EXACT)
    assert cycle_s - 0.6 < bound.cycle_time_s <= cycle_s + EXACT


@pytest.mark.parametrize("time_limit_s", [12.0, 25.0, 40.0])
def test_in_haste_the_solver_finds_what_trying_everything_finds(time_limit_s, best_by_trying):
    pytest.importorskip("ortools")
    core = toy(7, time_limit_s=time_limit_s)
    instance = safflower.instance_of(core)
    relaxed, solved = instance.bound(), instance.bound("cp-sat", 20.0)
    most, rate, cycle_s = best_by_trying(core)
    assert solved.proven
    assert most - EXACT <= solved.episode_return <= relaxed.episode_return + EXACT
    assert rate - EXACT <= solved.net_rate <= relaxed.net_rate + EXACT
    assert solved.net_rate == pytest.approx(rate, abs=1e-4)
    assert solved.episode_return == pytest.approx(most, abs=1e-3)
    assert solved.cycle_time_s <= cycle_s + EXACT


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_no_policy_beats_the_bound(scenario, no_policy_beats):
    found = no_policy_beats(ID, SEEDS, scenario)
    loose = [bounds.instance(ID, seed, scenario=scenario, backend="pybullet").bound() for seed in SEEDS]
    for any_reports, drawn in zip(loose, found, strict=True):
        assert any_reports.net_rate >= drawn.net_rate - EXACT
        assert any_reports.episode_return >= drawn.episode_return - EXACT
        assert not any_reports.proven and 0.0 < drawn.net_rate <= 1.0


def test_a_bound_that_a_machine_beats_is_noticed():
    """The check above can fail: a machine that needs no time to find heads does beat the bound of one that does."""
    config = SafflowerConfig(scenario=SCENARIOS["row-dense"])
    cheating = replace(config, process=replace(config.process, locate_s=0.0))
    rates = evaluate(lambda env: make_policy("nearest", env), ID, SEEDS, config=cheating).scorecard["net_rate"]
    honest = [bounds.instance(ID, seed, config=config).bound().net_rate for seed in SEEDS]
    assert max(rates - np.array(honest)) > 0.0


def some_stop(n: int, seed: int) -> stops.Stop:
    rng = np.random.default_rng(seed)
    places = rng.random((n + 1, 2))
    approach = np.linalg.norm(places[:, None] - places[None, 1:], axis=-1)
    return stops.Stop(
        gain=rng.random((n, 2)),
        other=np.zeros((n, 2)),
        process_s=0.5 + rng.random((n, 2)),
        approach_s=approach,
        leave_s=rng.random(n + 1),
    )


@pytest.mark.parametrize("price", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("n", [0, 1, 4])
def test_a_stop_s_best_route_is_what_trying_every_route_finds(n, price):
    stop = some_stop(n, n)
    best_stay, best_through = 0.0, -price * stop.leave_s[0]
    for count in range(1, n + 1):
        for order in permutations(range(n), count):
            for ways in product(range(2), repeat=count):
                time_s = stop.approach_s[0, order[0]] + sum(stop.approach_s[a + 1, b] for a, b in pairwise(order))
                time_s += sum(stop.process_s[j, e] for j, e in zip(order, ways, strict=True))
                value = sum(stop.gain[j, e] for j, e in zip(order, ways, strict=True)) - price * time_s
                best_stay = max(best_stay, value)
                best_through = max(best_through, value - price * stop.leave_s[order[-1] + 1])
    assert stop.best(stop.gain, price) == pytest.approx((best_through, best_stay))
    through, stay = replace(stop, routed=False).best(stop.gain, price)
    assert through >= best_through - EXACT and stay >= best_stay - EXACT


def test_bounds_are_for_fresh_instances_of_known_tasks():
    env: Any = gym.make_vec(ID, 1, vectorization_mode="vector_entry_point")
    env.reset(seed=0)
    env.step(np.array([0]))
    with pytest.raises(ValueError, match="under way"):
        safflower.instance_of(env.unwrapped.core)
    with pytest.raises(ValueError, match="relaxation, cp-sat"):
        bounds.instance(ID, 0).bound("guess")
    with pytest.raises(ValueError, match="unknown"):
        bounds.instance("fieldgym/Nothing-v0", 0)
    assert base.METHODS == bounds.METHODS and ID in bounds.bounded_ids()
