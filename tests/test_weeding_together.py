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
from fieldgym.envs.weeding.together import BESIDES, OWNS, add_up, classes, set_right, sums_of
from fieldgym.kernels.seeds import TUNED

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
    tables = tables._replace(own=np.zeros_like(tables.own), beside=np.full_like(tables.beside, 0.5))
    tables.own[1, 6, 2, 5, 1], tables.own[1, 6, 2, 3, 1] = 0.8, 0.6
    believed, happened = added(tool, batch, tables)
    for mode in range(3):
        for k, (best, own, beside) in enumerate(((1, 0.8, 0.3), (0, 0.6, 0.4))):
            place = best, class_of(OWNS, own), class_of(BESIDES, beside), mode
            assert believed[place] == pytest.approx(own + beside)
            kills = 0.0
            for i in range(2):
                along = float(plants.weed[0, i, 0] - plants.weed[0, k, 0])
                arrives = dose(work, mode, along, 0.0, int(plants.stage[0, i]))
                kills += float(response.chance(arrives, plants.species[0, i], plants.stage[0, i])) * (arrives > 0.0)
            assert happened[place] == pytest.approx(kills)
    assert believed.sum() == pytest.approx(3 * 2.1)


def test_a_sum_is_set_right_by_its_own_class():
    shares = np.arange(np.prod(classes()), dtype=float).reshape(classes())
    own, whole, mode = np.array([0.8, 1.2, 0.03]), np.array([0.8, 2.1, 2.03]), np.array([2, 0, 1])
    found = set_right(shares, own, whole, np.array([0.0, 2.2, 2.0]), mode)
    classed = [(1, 3, 0, 2), (0, 7, 5, 0), (1, 0, 9, 1)]
    np.testing.assert_array_equal(found, [shares[place] * sum_ for place, sum_ in zip(classed, whole, strict=True)])


def test_sums_that_own_shots_have_changed_are_left_as_they_are():
    memory, places = Memory.blank(3), np.array([[1.0, 0.0], [2.0, 0.1], [0.0, 0.0]])
    assert memory.untouched(places).all()
    shot = places + np.array([[FAR_M - 1e-6, 0.0], [FAR_M + 1e-6, 0.0], [0.0, 0.0]])
    whole = np.zeros(3, int)
    memory.add(np.zeros(3), shot, whole, np.ones(3), whole, np.array([True, True, False]))
    assert memory.untouched(places).tolist() == [False, True, True]
    # The oldest of more shots than are remembered is forgotten.
    for _ in range(MEMORY):
        memory.add(np.zeros(3), places + 1.0, whole, np.ones(3), whole, np.ones(3, bool))
    assert memory.untouched(places).all()


def test_a_planner_tells_its_shots_set_right_and_decides_as_ever():
    env: Any = gym.make_vec(HOE, 6, scenario="load-1.25", vectorization_mode="vector_entry_point", perception="model")
    core = env.unwrapped.core
    plain = RecedingHorizon(core.config, sums=np.ones(classes()))
    shares = np.random.default_rng(3).uniform(0.5, 1.5, classes())
    told = RecedingHorizon(core.config, sums=shares)
    ours = RecedingHorizon.make(env, 0)
    assert np.array_equal(ours._sums, sums_of(core.config, core.perception, core.process)) and (ours._sums != 1.0).any()
    observation, changed = env.reset(seed=list(TUNED.take(6)))[0], 0
    for policy in (plain, told):
        policy.reset(np.ones(6, bool))
    for _ in range(120):
        actions = plain.act(observation)
        assert np.array_equal(told.act(observation), actions)
        fired = plain.believed > 0.0
        ratio = told.expected(observation, actions)[fired] / plain.expected(observation, actions)[fired]
        assert np.isclose(ratio[:, None], np.append(shares.ravel(), 1.0)).any(axis=1).all()
        changed += (ratio != 1.0).sum()
        observation = env.step(actions)[0]
    assert changed > 100


def test_sums_that_ship_bring_what_they_say():
    """On fresh strips, deep stirs at the best of several reports: where much lies beside, and where all is doubtful."""
    config, tool = tool_of(HOE)
    tables = outcomes_of(config, tool.perception, tool.process)
    shares = sums_of(config, tool.perception, tool.process)
    core = task(HOE).assembly.core(config, tool.perception, 1)
    parts = []
    for begin in range(0, 2000, 50):
        batch = core.draw([np.random.default_rng(seed) for seed in TUNED.take(50, 2000 + begin)])
        parts.append(added(tool, batch, tables))
    believed, happened = (np.array(part)[:, 1, ..., 2] for part in zip(*parts, strict=True))
    much = slice(class_of(OWNS, 0.8), None), slice(class_of(BESIDES, 1.0), None)
    doubtful = slice(None, class_of(OWNS, 0.7) + 1), slice(class_of(BESIDES, 0.01), class_of(BESIDES, 0.6) + 1)
    for (own, beside), widest in ((much, 0.01), (doubtful, 0.04)):
        for share, holds in ((shares[1, ..., 2], True), (np.ones_like(shares[1, ..., 2]), False)):
            error = (share * believed - happened)[:, own, beside].sum(axis=(1, 2))
            chance = 3.5 * error.std() * np.sqrt(len(error)) / believed[:, own, beside].sum()
            off = error.sum() / believed[:, own, beside].sum()
            assert chance < 3.5 * widest and (abs(off) < chance) == holds
