"""Bounds in expectation: no schedule's means are above them on any field, and no policy's results on average."""

import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fieldgym import bounds
from fieldgym.agents import make_policy
from fieldgym.agents.evaluation import evaluate
from fieldgym.benchmark import limits
from fieldgym.bounds import plugs, safflower, weeding
from fieldgym.bounds.hopes import hoped_shots
from fieldgym.bounds.shots import Shots
from fieldgym.envs.safflower.config import SafflowerConfig
from fieldgym.envs.weeding.config import SCENARIOS
from fieldgym.envs.weeding.core import WeederOutcome, WeedingCore
from fieldgym.envs.weeding.outcomes import outcomes_of
from fieldgym.envs.weeding.perception import PerceptionModel
from fieldgym.envs.weeding.state import MODES
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.envs.weeding.tools.laser.env import laser_core

EXACT = 1e-9
TOUCHED = 0.02
"""Part of a bound by which it may miss what trying everything finds: times are rounded down to ticks."""


def toy(seed: int, tracks: int) -> WeedingCore:
    """A few weeds on a short strip, cameras that err, long waits."""
    config = WeedingConfig()
    scenario = replace(SCENARIOS["load-1.6"], strip_m=0.2, max_weeds=20, offered_load=2.0)
    config = replace(config, scenario=scenario, cart=replace(config.cart, moment_s=0.5))
    core = laser_core(config, PerceptionModel.measured("classical", "easy"), 1)
    for number in range(400):
        core.reset_rows(np.array([0]), [np.random.default_rng(1000 * seed + number)])
        if int(core.state.track_count[0]) == tracks and core.state.weeds[0]:
            return core
    raise AssertionError("no toy has so many tracks")


def account(shots: Shots, options: list[int]) -> float:
    """What options bring together on average, less their costs."""
    served = np.zeros(shots.weeds)
    for option in options:
        here = slice(shots.share_first[option], shots.share_first[option + 1])
        np.add.at(served, shots.share_weed[here], shots.share[here])
    brought = np.where(shots.whole, served >= 1.0 - EXACT, np.minimum(served, 1.0)) * shots.worth
    return float(brought.sum() - (shots.cost + shots.advance)[options].sum())


def best_on_average(core: WeedingCore, shots: Shots) -> float:
    """Largest mean return over all sequences of legal actions."""
    index = {pair: i for i, pair in enumerate(zip(shots.track.tolist(), shots.mode.tolist(), strict=True))}
    best = -np.inf

    def go_on(state: WeedingCore, options: list[int], spent_s: float) -> None:
        nonlocal best
        for action in np.flatnonzero(state.observe()["action_mask"][0]).tolist():
            slot, mode = divmod(action, MODES)
            chosen = options
            if slot < core.config.slots:
                pair = int(state.state.slot_track[0, slot]), mode
                if pair not in index:
                    continue
                chosen = [*options, index[pair]]
            child = copy.copy(state)
            child.state = type(state.state)(*(part.copy() for part in state.state))
            plan = child.plan(np.array([action]))
            result = child.apply(plan, WeederOutcome(plan.phases_s, plan.aim))
            then = spent_s + float(result.phases_s.sum())
            if result.terminated[0] or result.truncated[0]:
                best = max(best, account(shots, chosen) + core.config.weights.seconds * then)
            else:
                go_on(child, chosen, then)

    go_on(core, [], 0.0)
    return best


def test_trying_everything_finds_no_larger_mean_and_nearly_always_one_as_large():
    touched, toys = 0, [(seed, 2 + (seed % 5 == 1)) for seed in range(10)]
    for seed, tracks in toys:
        core = toy(seed, tracks)
        instance = weeding.instance_of(core)
        assert instance.hoped is not None
        bound, most = instance.bound().expected, best_on_average(core, instance.hoped)
        assert bound is not None and bound.estimated and most <= bound.episode_return + EXACT
        touched += bound.episode_return - most <= TOUCHED * max(1.0, abs(most))
    assert touched >= 9


def test_a_shot_s_mean_is_what_the_tables_say_and_a_track_is_served_once():
    core = toy(3, 3)
    tables = outcomes_of(core.config, PerceptionModel.measured("classical", "easy"), core.process)
    shots = hoped_shots(core, 0, tables)
    for track in range(3):
        own = np.flatnonzero(shots.track == track)
        # The dearest mode brings all that a track may bring; two shots at it bring no more than one.
        twice = account(shots, [int(own[-1]), int(own[-1])]) + float(shots.cost[own[-1]])
        assert twice <= account(shots, [int(own[-1])]) + EXACT
        assert shots.brought()[own].max() == pytest.approx(
            float(shots.worth[shots.whole][track] if track < shots.whole.sum() else 0.0)
        )
    beside = tables.own.max(axis=(1, 2, 3, 4)) * tables.beside.max(axis=(1, 2, 3))
    assert (shots.brought() <= tables.own.max() + beside.max() * 2.0 + EXACT).all()


def test_plugs_are_tried_until_cells_are_full_and_never_for_less_than_they_cost():
    attempts = plugs.Attempts(
        row=np.array([0, 0, 1]),
        good=np.array([0.9, 0.5]),
        fills=np.array([[0.9] * 3, [0.5] * 3]),
        plug_s=np.array([[2.0, 4.0, 1.0], [1.0, 1.0, 1.0]]),
    )
    one, free, cheap = np.zeros(1), np.zeros(2), 0.1 * attempts.plug_s
    # Two cells want 2 / 0.9 plugs; the third is tried with what is left.
    assert plugs.most_by_shares(attempts, 0.0 * cheap, free, one, 1.0) == pytest.approx(2.0)
    assert plugs.most_by_shares(attempts, 0.0 * cheap, np.zeros(9), one, 1.0) == pytest.approx(2.7)
    assert plugs.most_by_shares(attempts, 9.0 + cheap, free, one, 1.0) == 0.0
    # 0.9 - 0.2, 0.9 - 0.4 in the first row; 0.9 - 0.1 behind it, for a move.
    assert plugs.most_by_shares(attempts, cheap, np.zeros(3), np.array([0.0, 5.0]), 1.0) == pytest.approx(1.2)
    assert plugs.most_by_shares(attempts, cheap, np.zeros(3), np.array([0.0, 0.5]), 1.0) == pytest.approx(1.5)
    saved = plugs.most_by_shares(attempts, cheap, np.zeros(3), np.array([0.0, 0.5]), 1.0, left=0.2)
    assert saved == pytest.approx(1.9)


def test_a_head_s_mean_is_that_of_many_heads():
    config = SafflowerConfig()
    error, mass = np.array([[0.004, 0.0, 0.002]]), np.ones(1)
    odds = np.exp(config.process.luck_logit * np.random.default_rng(0).standard_normal((20_000, 2)))
    many = safflower._gains(config, np.repeat(error, 20_000, axis=0), np.ones(20_000), odds)
    assert safflower._gains(config, error, mass, None)[0] == pytest.approx(many.mean(axis=0), abs=4e-3)


@pytest.mark.parametrize(
    ("name", "scenario", "policy"),
    [
        ("SafflowerPicking", "row", "route"),
        ("TrayTransplanting", "fill", "fixed-order-speed"),
        ("TrayTransplanting", "orders", "learned"),
        ("ProduceSorting", "load-1.6", "fifo"),
        ("ProduceSorting", "orders", "receding-horizon-value"),
    ],
)
def test_no_policy_gets_more_on_average(name, scenario, policy):
    env_id, seeds = f"fieldgym/{name}-v0", range(4)
    found = [bounds.instance(env_id, seed, scenario=scenario).bound() for seed in seeds]
    scores = evaluate(lambda env: make_policy(policy, env), env_id, seeds, scenario=scenario)
    hopes: list[Any] = [bound.expected for bound in found]
    assert scores.returns.mean() < np.mean([hope.episode_return for hope in hopes])
    assert scores.scorecard["net_rate"].mean() < np.mean([hope.net_rate for hope in hopes])
    # The luck is worth something on average.
    assert np.mean([hope.episode_return for hope in hopes]) < np.mean([bound.episode_return for bound in found])
    assert not any(hope.estimated for hope in hopes)


def test_a_mean_that_beats_its_bound_is_told():
    def episode(seed: int, rate: float) -> dict[str, Any]:
        where = {"env_id": "fieldgym/LaserWeeding-v0", "scenario": "x", "backend": "analytic", "perception": "model"}
        return {**where, "policy": "edf", "seed": seed, "return": 0.0, "scorecard": {"net_rate": rate}}

    hope = {"net_rate": 0.5, "episode_return": 1.0}
    bound = {"net_rate": 1.0, "episode_return": 1.0, "curve": [], "expected": hope}
    known = [{**episode(seed, 0.0), "policy": "bound", "bound": bound} for seed in range(12)]
    lucky = [episode(seed, 0.9 if seed == 3 else 0.49) for seed in range(12)]
    assert limits.violations(lucky, known) == []
    (told,) = limits.violations([episode(seed, 0.55 + 0.01 * (seed % 3)) for seed in range(12)], known)
    assert "edf, 12 fields: net rate" in told
    assert limits.violations([episode(seed, 0.55) for seed in range(5)], known) == []
