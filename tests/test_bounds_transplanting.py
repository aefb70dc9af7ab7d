"""Tray transplanting: no policy beats its bound; on toys it is what trying everything finds."""

import copy
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fieldgym import bounds
from fieldgym.agents import make_policy
from fieldgym.agents.evaluation import evaluate
from fieldgym.bounds import transplanting
from fieldgym.envs.transplanting.columns import W
from fieldgym.envs.transplanting.config import (
    SCENARIOS,
    TRAYS,
    MachineConfig,
    PerceptionModel,
    TransplantingConfig,
    Tray,
)
from fieldgym.envs.transplanting.core import TransplantingCore, TransplantOutcome
from fieldgym.envs.transplanting.timing import places, times

ID = "fieldgym/TrayTransplanting-v0"
SEEDS = range(4)
EXACT = 1e-9


def toy(seed: int, columns: int, *, replug: bool = False, time_limit_s: float = 30.0) -> TransplantingCore:
    """A few rows of one or two cells, cameras that err."""
    scenario = replace(
        SCENARIOS["replug" if replug else "fill"],
        source=Tray(3 if columns == 1 else 2, columns, 0.10),
        target=Tray(2 if columns == 1 else 1, columns, 0.10),
        source_trays=1,
        target_trays=1,
        vacancy=0.4 if replug else 0.2,
        poor=0.2,
        time_limit_s=time_limit_s,
    )
    source = ((0.9, 0.1, 0.0), (0.1, 0.8, 0.1), (0.0, 0.2, 0.8))
    target = ((0.8, 0.0, 0.2), (0.0, 0.9, 0.1), (0.2, 0.1, 0.7))
    process = replace(TransplantingConfig().process, extraction=0.8)
    config = TransplantingConfig(scenario=scenario, process=process)
    core = TransplantingCore(config, PerceptionModel(source, target), 1)
    core.reset_rows(np.array([0]), [np.random.default_rng(seed)])
    return core


def best_by_trying(core: TransplantingCore) -> tuple[float, float, list[tuple[float, float]]]:
    """Largest return and net rate over all sequences of legal actions, and every (net rate, cycle time) on the way."""
    best_return, best_rate, cycles = -np.inf, -np.inf, []

    def go_on(state: TransplantingCore, total: float) -> None:
        nonlocal best_return, best_rate
        for action in np.flatnonzero(state.observe()["action_mask"][0]):
            child = copy.deepcopy(state)
            plan = child.plan(np.array([action]))
            result = child.apply(plan, TransplantOutcome(plan.phases_s, np.zeros((1, 2))))
            value = total + float(result.rewards.sum())
            scores = dict(zip(child.score_names, child.scores()[0], strict=True))
            if scores["done"]:
                cycles.append((scores["net_rate"], scores["cycle_time_s"]))
            best_rate = max(best_rate, scores["net_rate"])
            if result.terminated[0] or result.truncated[0]:
                best_return = max(best_return, value)
            else:
                go_on(child, value)

    go_on(core, 0.0)
    return best_return, best_rate, cycles


@pytest.mark.parametrize("replug", [False, True])
@pytest.mark.parametrize("columns", [1, 2])
@pytest.mark.parametrize("seed", range(4))
def test_trying_everything_finds_nothing_better(seed, columns, replug):
    core = toy(seed, columns, replug=replug, time_limit_s=30.0 if columns == 1 else 3.0)
    instance = transplanting.instance_of(core)
    bound = instance.bound()
    most, rate, cycles = best_by_trying(core)
    assert most <= bound.episode_return + EXACT and rate <= bound.net_rate + EXACT
    for reached, cycle_s in cycles:
        assert cycle_s >= instance.cycle_time_at(reached - EXACT) - EXACT
    if bound.proven:
        assert bound.episode_return == pytest.approx(most, abs=EXACT)
        assert bound.net_rate == pytest.approx(rate, abs=EXACT)
    if columns == 1 and (instance.cell <= transplanting.OPEN).all():
        # One cell a row and nothing to clear: every share is exact.
        assert bound.episode_return == pytest.approx(most, abs=1e-6)


def test_some_toys_are_proven():
    assert any(transplanting.instance_of(toy(seed, 1)).bound().proven for seed in range(8))


def test_in_haste_the_bound_falls_and_holds():
    core = toy(1, 1, time_limit_s=0.3)
    hasty, slow = (transplanting.instance_of(c).bound() for c in (core, toy(1, 1)))
    most, rate, _ = best_by_trying(core)
    assert hasty.net_rate < slow.net_rate
    assert most <= hasty.episode_return + EXACT and rate <= hasty.net_rate + EXACT


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_no_policy_beats_the_bound(scenario, no_policy_beats):
    found = no_policy_beats(ID, SEEDS, scenario)
    loose = [bounds.instance(ID, seed, scenario=scenario, backend="pybullet").bound() for seed in SEEDS]
    for any_reports, drawn in zip(loose, found, strict=True):
        assert any_reports.net_rate >= drawn.net_rate - EXACT
        assert any_reports.episode_return >= drawn.episode_return - EXACT
        assert not any_reports.proven
        # The work of drives that err may be done anywhere: their bound is one of any reports too, and proves no gap.
        assert drawn.gap < 0.06 if scenario != "field" else not drawn.proven and np.isnan(drawn.gap)


@pytest.mark.slow
def test_the_simulated_machine_does_not_beat_the_bound():
    seed = 3
    bound = bounds.instance(ID, seed, backend="pybullet", perception="model").bound()
    for name in ("fixed-order", "assignment"):

        def make(env: Any, name: str = name) -> Any:
            return make_policy(name, env, 1)

        scores = evaluate(make, ID, [seed], backend="pybullet", perception="model")
        assert scores.returns[0] <= bound.episode_return and scores.scorecard["net_rate"][0] <= bound.net_rate


def test_a_bound_that_a_machine_beats_is_noticed():
    """The check above can fail: a machine that grips and releases in no time, and every plug, beats an honest bound."""
    config = TransplantingConfig()
    cheating = replace(config, process=replace(config.process, grip_s=0.0, release_s=0.0, extraction=1.0))
    returns = evaluate(lambda env: make_policy("assignment", env), ID, SEEDS, config=cheating).returns
    honest = [bounds.instance(ID, seed, config=config).bound().episode_return for seed in SEEDS]
    assert max(returns - np.array(honest)) > 0.0


@pytest.mark.parametrize(("source", "motion"), [(72, "blended"), (128, "stop-quintic"), (288, "stop-fastest")])
def test_shares_never_exceed_the_times_that_they_split(source, motion):
    machine = MachineConfig(motion=motion)
    config = TransplantingConfig(scenario=replace(SCENARIOS["fill"], source=TRAYS[source]), machine=machine)
    table, rng = times(config), np.random.default_rng(source)
    where = places(machine, TRAYS[source], TRAYS[72])
    n, m = TRAYS[source].columns, TRAYS[72].columns
    speed, cell = rng.integers(-1, 3, (4, n)), rng.integers(0, 3, (4, m))
    shares = transplanting.shares(where, table, speed, cell)
    carry = table.carry[..., W.s].reshape(3, n, m)
    approach = table.approach[..., W.s].reshape(2, -1, n, m)
    once = config.process.grip_s + config.process.release_s
    for _ in range(40):
        # A chain of random transplants from over the chute.
        place, total, share = where.park, 0.0, shares.once_s
        for _ in range(rng.integers(1, 6)):
            i, j, s, clear = rng.integers(n), rng.integers(m), rng.integers(3), rng.integers(2)
            total += approach[clear, place, i, j] + clear * once + carry[s, i, j]
            share += shares.plug_s[s, i] + shares.cell_s[j] + clear * shares.clear_s[j]
            place = n + j
        assert total >= share - EXACT


def test_an_instance_is_read_right_after_a_reset():
    core = toy(0, 2)
    core.apply((plan := core.plan(np.array([12]))), TransplantOutcome(plan.phases_s, np.zeros((1, 2))))
    with pytest.raises(ValueError, match="under way"):
        transplanting.instance_of(core)
    with pytest.raises(ValueError, match="drawn, driven, any"):
        transplanting.instance_of(toy(0, 2), "guessed")
    with pytest.raises(ValueError, match="relaxation, cp-sat"):
        transplanting.instance_of(toy(0, 2)).bound("guess")
