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
from fieldgym.envs.weeding.features import CROP_GAP_SCALE_M, C, candidate_table
from fieldgym.envs.weeding.outcomes import FAR_M, class_of, outcomes_of
from fieldgym.envs.weeding.process import dose
from fieldgym.envs.weeding.together import (
    BESIDES,
    OWNS,
    PLAYED,
    TIPS_M,
    Chosen,
    Shares,
    add_up,
    measured_played,
    measured_sums,
    set_right,
    sums_of,
)
from fieldgym.kernels.seeds import OUTCOMES, TUNED

HOE = "fieldgym/HoeWeeding-v0"


def added(tool: Any, batch: Any, tables: Any, shares: Shares | None = None) -> tuple[Shares, Shares]:
    """Believed and happened kills of a batch's shots, by class."""
    shares = shares or Shares.plain()
    believed, happened = (Shares(*(np.zeros_like(values) for values in shares)) for _ in range(2))
    work, response = tool.process.work, tool.process.response
    add_up(work, response, np.ones((2, 3)), tables, shares, batch.plants, batch.tracks, believed, happened)
    return believed, happened


def some_shares(seed: int) -> Shares:
    """Shares all of which differ."""
    rng = np.random.default_rng(seed)
    return Shares(*(rng.uniform(0.5, 1.5, values.shape) for values in Shares.plain()))


def test_sums_are_told_apart_by_their_parts_by_whether_a_report_near_promises_more_and_beside_crop_plants():
    """Two weeds, each with its report 12 mm beside the other, of which the first is believed in more."""
    tool, batch = drawn(HOE, 1)
    plants, tracks, response, work = batch.plants, batch.tracks, tool.process.response, tool.process.work
    plants.exists[0, 2:] = False
    plants.weed[0, 1] = plants.weed[0, 0] + [0.012, 0.0]
    tracks.count[0] = 2
    tracks.report[0, :2] = tracks.aim[0, :2] = plants.weed[0, :2]
    tracks.species[0, :2], tracks.stage[0, :2], tracks.crop_gap_m[0, :2] = 0, 1, (0.034, 0.2)
    tracks.confidence[0, :2] = 0.9, 0.5
    config, _ = tool_of(HOE)
    tables = outcomes_of(config, tool.perception, tool.process)
    # Of the first 0.8 are believed in, of the second 0.6; a shot beside takes half of that.
    own, beside = np.zeros_like(tables.own), np.full_like(tables.beside, 0.5)
    tables = tables._replace(own=own, beside=beside)
    own[1, 2, 2, 5, 1], own[1, 6, 2, 3, 1] = 0.8, 0.6
    shares = some_shares(2)
    believed, happened = added(tool, batch, tables, shares)

    def arrives(mode: int, k: int) -> Any:
        """Doses of a shot at a report on the two weeds."""
        gaps = plants.weed[0, :2, 0] - plants.weed[0, k, 0]
        return np.array([dose(work, mode, float(gap), 0.0, int(plants.stage[0, i])) for i, gap in enumerate(gaps)])

    def kills(doses: Any) -> float:
        return float((response.chance(doses, plants.species[0, :2], plants.stage[0, :2]) * (doses > 0.0)).sum())

    for mode in range(3):
        for k, (best, own_, beside_) in enumerate(((1, 0.8, 0.3), (0, 0.6, 0.4))):
            place = 1, best, class_of(OWNS, own_), class_of(BESIDES, beside_), mode
            assert believed.whole[place] == pytest.approx(own_ + beside_)
            assert happened.whole[place] == pytest.approx(kills(arrives(mode, k)))
            tip = 1, (5, 3)[k], (3, 5)[k], mode
            assert believed.tips[tip] == pytest.approx(shares.whole[place] * (own_ + beside_))
            assert happened.tips[tip] == happened.whole[place]
    assert believed.whole.sum() == pytest.approx(3 * 2.1)
    assert happened.tips.sum() == pytest.approx(happened.whole.sum()) and (happened.tips > 0.0).sum() == 6
    assert not believed.played.any() and not happened.played.any()


def shots(**changes: Any) -> Chosen:
    """Three shots, each of classes of its own."""
    three = Chosen(
        kind=np.array([0, 5, 3]),
        mode=np.array([2, 0, 1]),
        own=np.array([0.8, 1.2, 0.03]),
        whole=np.array([0.8, 2.1, 2.03]),
        most=np.array([0.0, 2.2, 2.0]),
        confidence=np.array([0.36, 0.1, 0.9]),
        crop_gap_m=np.array([0.034, 0.2, 0.001]),
        touched=np.zeros(3, bool),
    )
    return three._replace(**changes)


def test_a_sum_is_set_right_by_its_own_class_and_by_what_play_brought():
    shares = some_shares(1)
    classed = np.array([shares.whole[0, 1, 3, 0, 2], shares.whole[5, 0, 7, 5, 0], shares.whole[3, 1, 0, 9, 1]])
    beside = np.array([shares.tips[0, 2, 3, 2], shares.tips[5, 0, 5, 0], shares.tips[3, 5, 0, 1]])
    told = classed * beside * shots().whole
    played = shares.played[[0, 5, 3], 0, np.searchsorted(PLAYED, told), [2, 0, 1]]
    np.testing.assert_allclose(set_right(shares, shots()), played * told, rtol=1e-15)
    again = shares.played[0, 1, 3, 2], shares.played[5, 1, 6, 0], shares.played[3, 1, 6, 1]
    np.testing.assert_array_equal(set_right(shares, shots(touched=np.ones(3, bool))), again * shots().whole)


def test_own_shots_within_reach_of_tables_are_remembered():
    memory, places = Memory.blank(3), np.array([[1.0, 0.0], [2.0, 0.1], [0.0, 0.0]])
    assert not memory.touched(places).any()
    shot = places + np.array([[0.0, FAR_M - 1e-6], [FAR_M + 1e-6, 0.0], [0.0, 0.0]])
    whole = np.zeros(3, int)
    memory.add(np.zeros(3), shot, whole, np.ones(3), whole, np.array([True, True, False]))
    assert memory.touched(places).tolist() == [True, False, False]
    # The oldest of more shots than are remembered are forgotten.
    for _ in range(MEMORY):
        memory.add(np.zeros(3), places + 1.0, whole, np.ones(3), whole, np.ones(3, bool))
    assert not memory.touched(places).any()


def test_a_planner_tells_its_shots_set_right_and_decides_as_ever():
    env: Any = gym.make_vec(HOE, 6, scenario="load-1.25", vectorization_mode="vector_entry_point", perception="model")
    core = env.unwrapped.core
    plain, shares = RecedingHorizon(core.config, sums=Shares.plain()), some_shares(3)
    told = RecedingHorizon(core.config, sums=shares)
    assert RecedingHorizon.make(env, 0)._sums is sums_of(core.config, core.perception, core.process)
    observation, found = env.reset(seed=list(TUNED.take(6)))[0], [0, 0]
    for policy in (plain, told):
        policy.reset(np.ones(6, bool))
    for _ in range(120):
        actions = plain.act(observation)
        assert np.array_equal(told.act(observation), actions)
        fired, shot = plain.believed > 0.0, told.last
        assert shot is not None and np.array_equal(plain.believed[fired], shot.whole[fired])
        at = candidate_table(observation)[np.flatnonzero(fired), actions[fired] // 3]
        np.testing.assert_allclose(shot.crop_gap_m[fired], at[:, C.crop_gap] * CROP_GAP_SCALE_M, rtol=1e-6)
        np.testing.assert_allclose(shot.confidence[fired], at[:, C.confidence], rtol=1e-6)
        expected = set_right(shares, shot)[fired]
        assert np.array_equal(told.expected(observation, actions)[fired], expected)
        assert not told.expected(observation, actions)[actions == plain.wait].any()
        found = [count + (fired & (shot.touched == was)).sum() for count, was in zip(found, (False, True), strict=True)]
        observation = env.step(actions)[0]
    assert min(found) > 10


def test_rare_sums_lean_on_those_of_all_kinds_and_beside_crop_plants_on_what_is_believed():
    config, tool = tool_of(HOE)
    tables = outcomes_of(config, tool.perception, tool.process)
    core = task(HOE).assembly.core(config, tool.perception, 1)
    batch = core.draw([np.random.default_rng(seed) for seed in OUTCOMES.take(50)])
    measured = measured_sums(config, tool.perception, tool.process, tables, 50)
    believed, happened = added(tool, batch, tables)
    every = (happened.whole.sum(axis=0) + 50.0) / (believed.whole.sum(axis=0) + 50.0)
    np.testing.assert_allclose(measured.whole * (believed.whole + 50.0), happened.whole + 50.0 * every)
    believed, happened = added(tool, batch, tables, measured)
    near = slice(None), slice(None), slice(len(TIPS_M))
    np.testing.assert_allclose(measured.tips[near] * (believed.tips[near] + 50.0), happened.tips[near] + 50.0)
    assert np.ptp(measured.tips[near]) > 0.05 and (measured.tips[:, :, -1] == 1.0).all()
    assert (measured.played == 1.0).all()


def test_what_play_brought_is_counted_by_kind_mode_sum_and_whether_an_own_shot_fell_near():
    shares, killed, trust = some_shares(5), np.array([1.0, 0.0, 3.0]), 20.0
    touched = np.array([True, True, False])
    shot = shots(kind=np.array([2, 0, 2]), mode=np.ones(3, int), touched=touched)
    played = measured_played(shares, shot._replace(whole=np.array([0.8, 0.9, 2.03])), killed)
    # After own shots nothing else is set right; both of the first fall into one class of their sums.
    every = (1.0 + trust) / (1.7 + trust)
    assert played[2, 1, 3, 1] == pytest.approx((1.0 + trust * every) / (0.8 + trust))
    assert played[0, 1, 3, 1] == pytest.approx((0.0 + trust * every) / (0.9 + trust))
    assert played[5, 1, 3, 1] == pytest.approx(every)
    told = shares.whole[2, 1, 0, 9, 1] * shares.tips[2, 5, 0, 1] * 2.03
    every = (3.0 + trust) / (told + trust)
    place = 2, 0, np.searchsorted(PLAYED, told), 1
    assert played[place] == pytest.approx((3.0 + trust * every) / (told + trust))
    assert (played[:, :, :, [0, 2]] == 1.0).all() and (played != 1.0).sum() == 12


def test_sums_that_ship_bring_what_they_say():
    """On fresh strips: the best of several reports, where much lies beside, where all is doubtful, and leaves' tips."""
    config, tool = tool_of(HOE)
    tables = outcomes_of(config, tool.perception, tool.process)
    shares = sums_of(config, tool.perception, tool.process)
    core = task(HOE).assembly.core(config, tool.perception, 1)
    parts = []
    for begin in range(0, 4000, 50):
        batch = core.draw([np.random.default_rng(seed) for seed in TUNED.take(50, 2000 + begin)])
        parts.append(added(tool, batch, tables, shares))
    every = slice(None)
    much = every, 1, slice(class_of(OWNS, 0.8), None), slice(class_of(BESIDES, 1.0), None), 2
    doubtful = (
        every,
        1,
        slice(class_of(OWNS, 0.7) + 1),
        slice(class_of(BESIDES, 0.01), class_of(BESIDES, 0.6) + 1),
        2,
    )
    # Two-leaf broadleaves that the cameras are not sure of, 15 to 22 mm from a crop plant.
    tips = 1, slice(1, 3), slice(1, 2), slice(2, 3)
    for name, where, widest in (("whole", much, 0.01), ("whole", doubtful, 0.04), ("tips", tips, 0.06)):
        believed, happened = (np.array([getattr(part[side], name)[where] for part in parts]) for side in range(2))
        whole = believed.sum()
        for share, holds in ((getattr(shares, name)[where], True), (1.0, False)):
            error = (share * believed - happened).sum(axis=(1, 2, 3))
            chance = 3.5 * error.std() * np.sqrt(len(error)) / whole
            assert chance < 3.5 * widest and (abs(error.sum() / whole) < chance) == holds
