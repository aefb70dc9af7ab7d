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
from fieldgym.envs.weeding.together import BESIDES, OWNS, REMAINS, Shares, add_up, set_right, sums_of
from fieldgym.kernels.seeds import TUNED

HOE = "fieldgym/HoeWeeding-v0"


def added(tool: Any, batch: Any, tables: Any) -> tuple[Shares, Shares]:
    """Believed and happened kills of a batch's shots, by class."""
    believed, happened = Shares.filled(0.0), Shares.filled(0.0)
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
    # Of the first 0.8 are believed in, of the second 0.6; a shot beside takes half of that, and leaves 0.3 and 0.04.
    own, beside = np.zeros_like(tables.own), np.full_like(tables.beside, 0.5)
    after, left = np.full_like(tables.after, 0.3), np.full_like(tables.left, 0.04)
    tables = tables._replace(own=own, beside=beside, after=after, left=left)
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
            assert believed.first[place] == pytest.approx(own_ + beside_)
            assert happened.first[place] == pytest.approx(kills(arrives(mode, k)))
        for before in range(3):
            # The second one after the first, 12 mm away, not the other way round.
            place = 1, 2, class_of(REMAINS, 0.22), before, mode
            assert believed.second[place] == pytest.approx(0.6 * 0.3 + 0.04)
            both = kills(arrives(before, 0) + arrives(mode, 1)) - kills(arrives(before, 0))
            assert happened.second[place] == pytest.approx(both)
    assert believed.first.sum() == pytest.approx(3 * 2.1) and believed.second.sum() == pytest.approx(9 * 0.22)


def test_a_sum_is_set_right_by_its_own_class():
    first, second = (np.arange(part.size, dtype=float).reshape(part.shape) for part in Shares.filled(0.0))
    own, whole, mode = np.array([0.8, 1.2, 0.03, 0.9]), np.array([0.8, 2.1, 2.03, 0.3]), np.array([2, 0, 1, 1])
    before_m, before = np.array([np.inf, FAR_M, 0.06, 0.021]), np.array([0, 1, 1, 2])
    kind = np.array([0, 5, 3, 2])
    found = set_right(Shares(first, second), kind, own, whole, np.array([0.0, 2.2, 2.0, 0.5]), mode, before_m, before)
    shares = first[0, 1, 3, 0, 2], first[5, 0, 7, 5, 0], first[3, 1, 0, 9, 1], second[2, 4, 3, 2, 1]
    np.testing.assert_array_equal(found, shares * whole)


def test_the_nearest_own_shot_is_remembered_with_its_mode():
    memory, places = Memory.blank(2), np.array([[1.0, 0.0], [0.0, 0.0]])
    assert np.isinf(memory.nearest(places)[0]).all()
    whole = np.zeros(2, int)
    for gap_m, mode, fired in ((0.04, 1, True), (0.03, 2, True), (0.05, 0, True), (0.0, 1, False)):
        shot = places + np.array([0.0, gap_m])
        memory.add(np.zeros(2), shot, whole, np.ones(2), np.full(2, mode), np.array([fired, False]))
    apart_m, mode = memory.nearest(places)
    assert apart_m.tolist() == pytest.approx([0.03, np.inf]) and mode[0] == 2
    # The oldest of more shots than are remembered are forgotten.
    for _ in range(MEMORY):
        memory.add(np.zeros(2), places + 1.0, whole, np.ones(2), whole, np.ones(2, bool))
    assert memory.nearest(places)[0].tolist() == pytest.approx([np.sqrt(2.0)] * 2)


def test_a_planner_tells_its_shots_set_right_and_decides_as_ever():
    env: Any = gym.make_vec(HOE, 6, scenario="load-1.25", vectorization_mode="vector_entry_point", perception="model")
    core = env.unwrapped.core
    plain = RecedingHorizon(core.config, sums=Shares.filled(1.0))
    shares = Shares(*(np.random.default_rng(3).uniform(0.5, 1.5, part.shape) for part in Shares.filled(1.0)))
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
        kinds = [np.isclose(ratio[:, None], part.ravel()).any(axis=1) for part in shares]
        assert (kinds[0] | kinds[1]).all()
        found = [count + kind.sum() for count, kind in zip(found, kinds, strict=True)]
        observation = env.step(actions)[0]
    assert min(found) > 10


def test_sums_that_ship_bring_what_they_say():
    """On fresh strips: the best of several reports, where much lies beside or all is doubtful, and second ones."""
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
    second = every, slice(0, 4), slice(class_of(REMAINS, 0.3), None), 2, 2
    for which, where, widest in ((0, much, 0.01), (0, doubtful, 0.04), (1, second, 0.02)):
        believed, happened = (np.array([part[side][which][where] for part in parts]) for side in range(2))
        whole = believed.sum()
        for share, holds in ((shares[which][where], True), (1.0, False)):
            error = (share * believed - happened).sum(axis=(1, 2, 3))
            chance = 3.5 * error.std() * np.sqrt(len(error)) / whole
            assert chance < 3.5 * widest and (abs(error.sum() / whole) < chance) == holds
