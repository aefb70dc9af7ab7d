"""What sums of beliefs bring: recomputed shot by shot, told by the planner, and true of fresh strips."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from test_weeding_outcomes import drawn, tool_of

import fieldgym  # noqa: F401
from fieldgym.agents.policies.weeding_belief import MEMORY, Memory
from fieldgym.agents.policies.weeding_horizon import RecedingHorizon
from fieldgym.envs.task import task
from fieldgym.envs.weeding.outcomes import FAR_M, class_of, outcomes_of
from fieldgym.envs.weeding.process import dose
from fieldgym.envs.weeding.together import (
    BESIDES,
    OWNS,
    add_up,
    classes,
    measured_sums,
    set_right,
    sums_of,
)
from fieldgym.kernels.seeds import OUTCOMES, TUNED

HOE = "fieldgym/HoeWeeding-v0"


def added(tool: Any, batch: Any, tables: Any) -> tuple[Any, Any]:
    """Believed and happened kills of a batch's shots, by class."""
    believed, happened = np.zeros(classes()), np.zeros(classes())
    process = tool.process
    add_up(process.work, process.response, np.ones((2, 3)), tables, batch.plants, batch.tracks, believed, happened)
    return believed, happened


def test_sums_are_told_apart_by_their_parts_and_by_whether_a_report_near_promises_more():
    """Two weeds, each with its report 12 mm beside the other, of which the first is believed in more."""
    tool, batch = drawn(HOE, 1)
    plants, tracks, response, work = batch.plants, batch.tracks, tool.process.response, tool.process.work
    plants.exists[0, 2:] = False
    plants.weed[0, 1] = plants.weed[0, 0] + [0.012, 0.0]
    tracks.count[0] = 2
    tracks.report[0, :2] = tracks.aim[0, :2] = plants.weed[0, :2]
    tracks.species[0, :2], tracks.stage[0, :2], tracks.crop_gap_m[0, :2] = 0, 1, 0.2
    tracks.confidence[0, :2] = 0.9, 0.5
    config, _ = tool_of(HOE)
    tables = outcomes_of(config, tool.perception, tool.process)
    # Of the first 0.8 are believed in, of the second 0.6; a shot beside takes half of that.
    own, beside = np.zeros_like(tables.own), np.full_like(tables.beside, 0.5)
    tables = tables._replace(own=own, beside=beside)
    own[1, 6, 2, 5, 1], own[1, 6, 2, 3, 1] = 0.8, 0.6
    believed, happened = added(tool, batch, tables)

    def arrives(mode: int, k: int) -> Any:
        """Doses of a shot at a report on the two weeds."""
        gaps = plants.weed[0, :2, 0] - plants.weed[0, k, 0]
        return np.array([dose(work, mode, float(gap), 0.0, int(plants.stage[0, i])) for i, gap in enumerate(gaps)])

    def kills(doses: Any) -> float:
        return float((response.chance(doses, plants.species[0, :2], plants.stage[0, :2]) * (doses > 0.0)).sum())

    for mode in range(3):
        for k, (best, own_, beside_) in enumerate(((1, 0.8, 0.3), (0, 0.6, 0.4))):
            place = 1, best, class_of(OWNS, own_), class_of(BESIDES, beside_), mode
            assert believed[place] == pytest.approx(own_ + beside_)
            assert happened[place] == pytest.approx(kills(arrives(mode, k)))
    assert believed.sum() == pytest.approx(3 * 2.1)


def test_a_sum_is_set_right_by_its_own_class():
    shares = np.arange(np.prod(classes()), dtype=float).reshape(classes())
    own, whole, mode = np.array([0.8, 1.2, 0.03]), np.array([0.8, 2.1, 2.03]), np.array([2, 0, 1])
    found = set_right(shares, np.array([0, 5, 3]), own, whole, np.array([0.0, 2.2, 2.0]), mode)
    classed = shares[0, 1, 3, 0, 2], shares[5, 0, 7, 5, 0], shares[3, 1, 0, 9, 1]
    np.testing.assert_array_equal(found, classed * whole)


def test_own_shots_within_reach_of_tables_are_remembered():
    memory, places = Memory.blank(3), np.array([[1.0, 0.0], [2.0, 0.1], [0.0, 0.0]])
    assert memory.untouched(places).all()
    shot = places + np.array([[0.0, FAR_M - 1e-6], [FAR_M + 1e-6, 0.0], [0.0, 0.0]])
    whole = np.zeros(3, int)
    memory.add(np.zeros(3), shot, whole, np.ones(3), whole, np.array([True, True, False]))
    assert memory.untouched(places).tolist() == [False, True, True]
    # The oldest of more shots than are remembered are forgotten.
    for _ in range(MEMORY):
        memory.add(np.zeros(3), places + 1.0, whole, np.ones(3), whole, np.ones(3, bool))
    assert memory.untouched(places).all()


def test_a_planner_tells_its_shots_set_right_and_decides_as_ever():
    env: Any = gym.make_vec(HOE, 6, scenario="load-1.25", vectorization_mode="vector_entry_point", perception="model")
    core = env.unwrapped.core
    plain = RecedingHorizon(core.config, sums=np.ones(classes()))
    shares = np.random.default_rng(3).uniform(0.5, 1.5, classes())
    told = RecedingHorizon(core.config, sums=shares)
    assert RecedingHorizon.make(env, 0)._sums is sums_of(core.config, core.perception, core.process)
    observation, found = env.reset(seed=list(TUNED.take(6)))[0], [0, 0]
    for policy in (plain, told):
        policy.reset(np.ones(6, bool))
    for _ in range(120):
        actions = plain.act(observation)
        assert np.array_equal(told.act(observation), actions)
        fired = plain.believed > 0.0
        ratio = told.expected(observation, actions)[fired] / plain.expected(observation, actions)[fired]
        kinds = np.isclose(ratio[:, None], shares.ravel()).any(axis=1), ratio == 1.0
        assert (kinds[0] | kinds[1]).all()
        found = [count + kind.sum() for count, kind in zip(found, kinds, strict=True)]
        observation = env.step(actions)[0]
    assert min(found) > 10


def test_rare_sums_lean_on_those_of_all_kinds():
    config, tool = tool_of(HOE)
    tables = outcomes_of(config, tool.perception, tool.process)
    core = task(HOE).assembly.core(config, tool.perception, 1)
    batch = core.draw([np.random.default_rng(seed) for seed in OUTCOMES.take(50)])
    measured = measured_sums(config, tool.perception, tool.process, tables, 50)
    believed, happened = added(tool, batch, tables)
    every = (happened.sum(axis=0) + 50.0) / (believed.sum(axis=0) + 50.0)
    np.testing.assert_allclose(measured * (believed + 50.0), happened + 50.0 * every)


def test_sums_that_ship_bring_what_they_say():
    """On fresh strips: the best of several reports, where much lies beside and where all is doubtful."""
    config, tool = tool_of(HOE)
    tables = outcomes_of(config, tool.perception, tool.process)
    shares = sums_of(config, tool.perception, tool.process)
    core = task(HOE).assembly.core(config, tool.perception, 1)
    parts = []
    for begin in range(0, 2000, 50):
        batch = core.draw([np.random.default_rng(seed) for seed in TUNED.take(50, 2000 + begin)])
        parts.append(added(tool, batch, tables))
    every = slice(None)
    much = every, 1, slice(class_of(OWNS, 0.8), None), slice(class_of(BESIDES, 1.0), None), 2
    doubtful = every, 1, slice(class_of(OWNS, 0.7) + 1), slice(class_of(BESIDES, 0.01), class_of(BESIDES, 0.6) + 1), 2
    for where, widest in ((much, 0.01), (doubtful, 0.04)):
        believed, happened = (np.array([part[side][where] for part in parts]) for side in range(2))
        whole = believed.sum()
        for share, holds in ((shares[where], True), (1.0, False)):
            error = (share * believed - happened).sum(axis=(1, 2, 3))
            chance = 3.5 * error.std() * np.sqrt(len(error)) / whole
            assert chance < 3.5 * widest and (abs(error.sum() / whole) < chance) == holds
