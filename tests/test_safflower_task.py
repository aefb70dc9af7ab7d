"""The picking rules on instances that can be checked by hand."""

import math
from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldgym.agents import make_policy
from fieldgym.envs.safflower.batch import fixed_order, stop_centres
from fieldgym.envs.safflower.config import (
    OPEN_STAGES,
    SCENARIOS,
    PerceptionModel,
    ProcessConfig,
    SafflowerConfig,
)
from fieldgym.envs.safflower.core import SafflowerCore
from fieldgym.envs.safflower.drawing import Growth, draw_heads, reach_table
from fieldgym.envs.safflower.features import candidate_table
from fieldgym.envs.safflower.field import Heads, Reports, SafflowerField
from fieldgym.envs.safflower.process import Shears, collected_share, cut_share, dropped_share
from fieldgym.envs.safflower.timing import DRIVE, FINISH, NOTHING
from fieldgym.kernels.config import override
from fieldgym.motion import QUINTIC
from fieldgym.testing import check_policies

ID = "fieldgym/SafflowerPicking-v0"
PROCESS = ProcessConfig()
SHEARS = Shears.of(PROCESS)


def toy(
    places: list[tuple[float, float, float]],
    reports: list[tuple[tuple[float, float, float], int]] | None = None,
    camera: bool = False,
    stage: int = 1,
) -> SafflowerCore:
    """Two pots with heads of one stage, of 0.4 g where they are open, and average luck at world places.

    ``reports`` are places and the heads behind them, by default one of each head; a camera still has to make them.
    """
    config = override(SafflowerConfig(), {"scenario.plants": 2, "slots": 4})
    reports = [(place, head) for head, place in enumerate(places)] if reports is None else reports
    bare, zeros = Heads.empty(len(places)), np.zeros(len(places))
    mass_g = zeros + (0.4 if stage in OPEN_STAGES else 0.0)
    heads = replace(bare, **columns(places, stage), mass_g=mass_g, cut_luck=zeros, drop_luck=zeros)
    seen = columns([place for place, _ in reports], stage) | {"head": np.array([head for _, head in reports])}
    field = SafflowerField(heads, reports=replace(Reports.empty(len(reports)), **seen))
    core = SafflowerCore(config, None if camera else PerceptionModel.perfect(), 1)
    field = core.complete(field, np.random.default_rng(0))
    core.load(np.array([0]), core.stack([field]))
    return core


def columns(places: list[tuple[float, float, float]], stage: int) -> dict[str, Any]:
    """World places and stages as columns."""
    along_m, across_m, up_m = np.array(places).reshape(-1, 3).T
    return {"along_m": along_m, "across_m": across_m, "up_m": up_m, "stage": np.full(len(places), stage)}


def decide(core: SafflowerCore, action: int):
    plan = core.plan(np.array([action]))
    return plan, core.apply(plan, core.nominal(plan))


def test_one_pick_takes_the_time_that_its_legs_and_strokes_take():
    core = toy([(0.05, 0.08, 0.80)])
    picker = core.config.machine.picker
    plan, result = decide(core, 1)
    clear_z = 1.18 - 0.28
    down = QUINTIC.duration(clear_z - 0.80, picker.tool_velocity_m_s, picker.tool_acceleration_m_s2)
    across = QUINTIC.duration(0.08, picker.tool_velocity_m_s, picker.tool_acceleration_m_s2)
    cart = QUINTIC.duration(0.05 + 0.30, picker.cart_velocity_m_s, picker.cart_acceleration_m_s2)
    phases = dict(zip(core.phase_names, result.phases_s[0], strict=True))
    assert phases["travel"] == pytest.approx(down + max(across, cart), abs=1e-12)
    assert phases["settle"] == core.config.machine.settle_s
    assert phases["shear"] == pytest.approx(2 * 0.04785 / 0.030)
    assert phases["suck"] == 2.0
    assert phases["recognise"] == PROCESS.locate_s
    assert plan.target[0] == pytest.approx([0.05, 0.29 + 0.08, 0.80 - 1.18])


def test_a_centred_pick_brings_what_strokes_and_suction_say_and_mass_is_conserved():
    core = toy([(0.0, 0.0, 0.80), (0.1, 0.05, 0.78)])
    cut = 1.0 - (1.0 - PROCESS.stroke_cut) ** 2
    kept = 1.0 - PROCESS.suction_loss * np.exp(-2.0)
    _, result = decide(core, 1)
    assert result.rewards[0, 0] == pytest.approx(0.4 * cut * kept)
    scores = dict(zip(core.score_names, core.scores()[0], strict=True))
    assert scores["net_rate"] == pytest.approx(cut * kept / 2)
    assert scores["collected_g"] + scores["dropped_g"] + core.state.head_mass_g.sum() == pytest.approx(0.8)
    assert scores["done"] == 1 and scores["missed"] == 1 and scores["cycle_time_s"] == scores["duration_s"]


def test_slots_close_up_in_order_and_driving_on_ends_the_last_stop():
    core = toy([(-0.1, 0.0, 0.80), (0.0, 0.02, 0.80), (0.1, 0.0, 0.80)])
    assert core.state.slot_report[0, :3].tolist() == [0, 1, 2]
    decide(core, 3 * 1 + 0)
    assert core.state.slot_report[0, :3].tolist() == [0, 2, core.config.scenario.max_tracks]
    plan, result = decide(core, 3 * 4)
    assert plan.kind[0] == DRIVE and not result.terminated[0] and not core.state.look_due[0]
    plan, result = decide(core, 3 * 4)
    assert plan.kind[0] == FINISH and result.terminated[0]


def test_an_illegal_action_costs_time_and_nothing_else():
    core = toy([(0.0, 0.0, 0.80)])
    decide(core, 1)
    before, pose = core.scores()[0], core.state.pose.copy()
    plan, result = decide(core, 3 * 2 + 1)
    assert plan.kind[0] == NOTHING
    assert result.phases_s.sum() == PROCESS.illegal_s
    after = dict(zip(core.score_names, core.scores()[0] - before, strict=True))
    assert after["illegal"] == 1 and after["collected_g"] == 0 and after["done"] == 0
    assert np.array_equal(core.state.pose, pose)


def test_a_report_of_nothing_and_a_second_visit_yield_nothing():
    head = (0.0, 0.0, 0.80)
    core = toy([head], [(head, 0), (head, 0), ((0.1, 0.05, 0.80), -1)])
    first = decide(core, 1)[1].rewards[0, 0]
    second = decide(core, 1)[1].rewards[0, 0]
    ghost = decide(core, 1)[1].rewards[0, 0]
    assert first > second > 0.0 and ghost == 0.0
    scores = dict(zip(core.score_names, core.scores()[0], strict=True))
    assert scores["done"] == 1 and scores["wasted"] == 2


def test_a_bud_is_damaged_once_and_brings_nothing():
    bud = (0.0, 0.0, 0.80)
    core = toy([bud], [(bud, 0), (bud, 0)], stage=0)
    assert [decide(core, 1)[1].rewards[0, 0] for _ in range(2)] == [0.0, 0.0]
    scores = dict(zip(core.score_names, core.scores()[0], strict=True))
    assert scores["damaged"] == 1 and scores["wasted"] == 2 and scores["missed"] == scores["net_rate"] == 0


def test_a_head_beyond_the_arm_is_shown_but_masked():
    core = toy([(0.0, 0.25, 0.80), (0.0, 0.0, 0.80)])
    observation = core.observe()
    reachable = candidate_table(observation)[0, :, -1]
    assert reachable[:2].tolist() == [1.0, 0.0]
    assert observation["action_mask"][0, :6].tolist() == [1, 1, 1, 0, 0, 0]


def test_a_camera_looks_at_every_stop_and_reports_in_place_of_the_field():
    core = toy([(0.0, 0.0, 0.80)], camera=True)
    assert core.state.look_due[0] and not core.observe()["action_mask"][0, :-1].any()
    core.receive(0, np.array([[0.01, 0.0, 0.80]]), np.array([2]), np.array([0.05]), np.array([0]))
    assert not core.state.look_due[0] and core.observe()["action_mask"][0, :4].tolist() == [1, 1, 1, 0]
    decide(core, 1)
    decide(core, 3 * 4)
    assert core.state.look_due[0] and core.state.stop[0] == 1 and core.state.remaining[0] == 0


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_the_field_does_not_depend_on_the_camera(scenario):
    fields = []
    for perception in ("perfect", "model"):
        env: Any = gym.make(ID, backend="analytic", scenario=scenario, perception=perception)
        env.reset(seed=3)
        core = env.unwrapped.core
        fields.append((core.state.head_position.copy(), core.state.head_mass_g.copy(), core.state.head_odds.copy()))
    assert all(np.array_equal(a, b) for a, b in zip(*fields, strict=True))


def test_steps_draw_no_chance_and_luck_belongs_to_the_head():
    gains = []
    for order in ((0, 0), (1, 0)):
        env: Any = gym.make(ID, backend="analytic", perception="perfect").unwrapped
        env.reset(seed=11)
        while (env.core.state.remaining < 2).any():
            env.step(3 * env.core.config.slots)
        state = env.np_random.bit_generator.state
        grams = {}
        for slot in order:
            head = int(env.core.state.track_head[0, env.core.state.slot_report[0, slot]])
            grams[head] = env.step(3 * slot + 1)[-1]["rewards"]["collected"]
        assert env.np_random.bit_generator.state == state
        gains.append(grams)
    assert gains[0] == gains[1]


def test_pots_are_the_published_ones_and_every_head_can_be_reached():
    config = SafflowerConfig()
    rng = np.random.default_rng(1)
    heads, plants = draw_heads(Growth.of(config), rng.random((300, 2000)), rng.standard_normal((300, 2000)))
    per_pot = heads.exists.reshape(300, 15, 4).sum(axis=2)
    assert per_pot.min() == 1 and per_pot.max() == 4
    assert per_pot.mean() == pytest.approx(2.5, abs=0.05)
    assert plants.height_m.min() >= 0.43 and plants.height_m.max() <= 0.86
    assert plants.crown_m.min() >= 0.14 and plants.crown_m.max() <= 0.38
    assert heads.mass_g.sum(axis=1).mean() == pytest.approx(14.152, rel=0.02)
    position = heads.position[heads.exists]
    plane = np.column_stack([position[:, 1] + 0.29, position[:, 2] - config.scenario.motor_height_m])
    assert config.machine.picker.five_bar.reachable(plane).all()


def test_rows_have_the_published_heads_and_every_stage():
    config = SafflowerConfig(scenario=SCENARIOS["row"])
    rng = np.random.default_rng(2)
    heads, _ = draw_heads(Growth.of(config), rng.random((200, 4000)), rng.standard_normal((200, 4000)))
    assert heads.exists.reshape(200, 12, 36).sum(axis=2).mean() == pytest.approx(15.71, abs=0.3)
    shares = np.bincount(heads.stage[heads.exists], minlength=4) / heads.exists.sum()
    assert (shares > 0.1).all()
    assert heads.occluded[heads.exists].mean() == pytest.approx(0.175, abs=0.01)


def test_fixed_order_sweeps_stop_by_stop_lane_by_lane_to_and_fro():
    config = SafflowerConfig()
    along = np.array([0.44, 0.0, 0.01, 0.06, 0.07, 0.45])
    across = np.array([0.0, 0.05, -0.05, -0.05, 0.05, 0.1])
    position = np.stack([along, across, np.full(6, 0.8)], axis=-1)[None]
    seen = np.array([[True] * 5 + [False]])
    order, first = fixed_order(config, position, seen)
    # Lanes are counted from the window's left edge at -0.225 m: lane 4 holds 0.0 and 0.01, lane 5 holds 0.06 and 0.07.
    assert order[0].tolist() == [2, 1, 4, 3, 0, 5]
    assert first[0, :3].tolist() == [0, 4, 5] and first[0, -1] == 5


def test_reach_table_agrees_with_the_mechanism():
    bar = SafflowerConfig().machine.picker.five_bar
    levels, widths = reach_table(bar)
    for level in (-0.28, -0.35, -0.45):
        width = np.interp(level, levels, widths)
        assert bar.reachable([0.29 + width - 1e-3, level]) and not bar.reachable([0.29 + width + 2e-3, level])


@settings(deadline=None)  # the first example may compile
@given(
    strokes=st.integers(1, 4),
    error=st.tuples(*[st.floats(-0.02, 0.02)] * 3),
    luck=st.floats(-3.0, 3.0),
)
def test_more_strokes_cut_more_and_more_error_cuts_less(strokes, error, luck):
    (along, across, up), odds = error, math.exp(luck)
    share = cut_share(SHEARS, strokes, along, across, up, odds)
    assert 0.0 <= share <= 1.0
    assert cut_share(SHEARS, strokes + 1, along, across, up, odds) >= share
    assert cut_share(SHEARS, strokes, 1.1 * along, 1.1 * across, 1.1 * up, odds) <= share
    long, short = (collected_share(dropped_share(PROCESS, s), odds) for s in (2.0, 1.0))
    assert long >= short


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_policies_finish_without_an_illegal_action(scenario):
    check_policies(ID, scenario, range(4))


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: gym.make(ID, scenario="orchard"), "scenario"),
        (lambda: gym.make(ID, backend="gazebo"), "backend"),
        (lambda: gym.make(ID, perception="lidar"), "perception"),
        (lambda: gym.make(ID, slots=0), "slots"),
        (lambda: gym.make_vec(ID, num_envs=0), "num_envs"),
        (lambda: gym.make_vec(ID, num_envs=2, backend="pybullet"), "batched"),
    ],
)
def test_bad_settings_are_named(make, word):
    with pytest.raises(ValueError, match=word) as caught:
        make()
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("action", [float("nan"), 49, -1, 1.5, [1, 2], None])
def test_bad_actions_are_named(action):
    env: Any = gym.make(ID, backend="analytic").unwrapped
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"0\.\.48"):
        env.step(action)
    batch = gym.make_vec(ID, num_envs=2)
    batch.reset(seed=0)
    with pytest.raises(ValueError, match=r"0\.\.48"):
        batch.step(np.full(2, np.nan) if action is None or isinstance(action, list) else np.full(2, action))


def test_unknown_policy_lists_the_choices():
    env: Any = gym.make(ID, backend="analytic")
    with pytest.raises(ValueError, match="did you mean 'nearest'"):
        make_policy("nearst", env)


def test_stop_windows_cover_the_row():
    for scenario in SCENARIOS.values():
        centres = stop_centres(scenario)
        assert len(centres) == scenario.stops
        last_plant = scenario.pitch_m * (scenario.plants / scenario.rows - (1 if scenario.potted else 0.5))
        assert abs(centres[-1] - last_plant) <= scenario.window_m


def test_perfect_perception_reports_every_head_with_filaments():
    assert PerceptionModel.perfect().recall[0] == (0.0, 1.0, 1.0, 1.0)
    env: Any = gym.make(ID, backend="analytic", perception="perfect", scenario="row").unwrapped
    env.reset(seed=5)
    core = env.core
    reported = set(core.state.track_head[0, : core.state.first[0, -1]].tolist())
    assert reported == set(np.flatnonzero(core.state.head_stage[0, :-1] > 0).tolist())
