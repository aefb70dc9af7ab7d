"""Analytic and PyBullet executors agree; what the row cameras see reaches the rules."""

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.agents import act_single, make_policy
from fieldgym.envs.transplanting.columns import P
from fieldgym.envs.transplanting.config import (
    EMPTY,
    HEALTHY,
    POOR,
    SCENARIOS,
    SOURCE_TRAYS,
    TARGET_TRAYS,
    TRAYS,
    MachineConfig,
    PerceptionModel,
    TransplantingConfig,
    Tray,
)
from fieldgym.envs.transplanting.core import TransplantingCore, TransplantOutcome
from fieldgym.envs.transplanting.errors import EMPTY_HANDED
from fieldgym.envs.transplanting.machine import moves

ID = "fieldgym/TrayTransplanting-v0"


def one_tray(scenario: str) -> TransplantingConfig:
    return TransplantingConfig(scenario=replace(SCENARIOS[scenario], target_trays=1))


def episode(seed: int, **settings) -> dict[str, float]:
    env: Any = gym.make(ID, disable_env_checker=True, **settings)
    observation, info = env.reset(seed=seed)
    policy = make_policy("shortest-cycle", env)
    over = False
    while not over:
        observation, _, terminated, truncated, info = env.step(act_single(policy, observation))
        over = terminated or truncated
    env.close()
    return info["scorecard"]


@pytest.mark.parametrize(
    ("scenario", "motion"), [("fill", "stop-quintic"), ("replug-high", "stop-quintic"), ("replug-high", "blended")]
)
def test_both_executors_agree_on_cycle_time_and_net_rate(scenario, motion):
    settings = {"config": one_tray(scenario), "motion": motion, "perception": "model"}
    analytic, driven = (episode(5, backend=backend, **settings) for backend in ("analytic", "pybullet"))
    assert driven["cycle_time_s"] == pytest.approx(analytic["cycle_time_s"], rel=0.003)
    assert driven["net_rate"] == analytic["net_rate"]
    assert driven["duration_s"] > analytic["duration_s"], "the machine never moves faster than its plan"


def test_moves_of_a_decision_add_up_to_its_plan():
    core = TransplantingCore(one_tray("replug-high"), PerceptionModel.perfect(), 1)
    core.reset_rows(np.array([0]), [np.random.default_rng(2)])
    machine = core.config.machine
    gates = [machine.gate(limit) for limit in (*machine.carry_acceleration_m_s2, machine.acceleration_m_s2)]
    rng = np.random.default_rng(0)
    for _ in range(40):
        mask = core.observe()["action_mask"][0]
        plan = core.plan(np.array([rng.choice(np.flatnonzero(mask))]))
        times = {P.travel: 0.0, P.carry: 0.0}
        for move in moves(core, plan):
            up = core.places.height_m[[move.start, move.end]]
            across = abs(core.places.x_m[move.end] - core.places.x_m[move.start])
            times[move.phase] += float(gates[move.limit].durations(0.15 - up[0], across, 0.15 - up[1]))
            assert move.limit == EMPTY_HANDED or move.loaded
        assert times[P.travel] == pytest.approx(plan.phases_s[0, P.travel], abs=1e-12)
        assert times[P.carry] == pytest.approx(plan.phases_s[0, P.carry], abs=1e-12)
        core.apply(plan, TransplantOutcome(plan.phases_s, np.zeros((1, 2))))


def test_the_cameras_reports_reach_the_rules_row_by_row():
    env: Any = gym.make(ID, config=one_tray("replug-high"), perception="camera", backend="analytic").unwrapped
    env.reset(seed=0)
    core = env.core
    right = cells = 0
    for _ in range(8):
        assert not core.state.look_due.any()
        state = core.state
        for report, cell, row in (
            (state.source_reports, state.source_cells, state.source_row),
            (state.target_reports, state.target_cells, state.target_row),
        ):
            right += int(np.sum(report[0, row[0]] == cell[0, row[0]]))
            cells += cell.shape[2]
        env.step(3 * core.config.scenario.pairs)
        env.step(3 * core.config.scenario.pairs + 1)
    assert right >= 0.9 * cells
    # A row that was looked at keeps what the machine learnt there when only the other conveyor moves.
    mask = env.action_masks()
    pairs = np.flatnonzero(mask[:-2])
    if len(pairs):
        env.step(int(pairs[0]))
        before = core.state.source_reports[0, core.state.source_row[0]].copy()
        env.step(3 * core.config.scenario.pairs + 1)
        assert np.array_equal(core.state.source_reports[0, core.state.source_row[0]], before)
    env.close()


def test_pictures_follow_the_plug():
    pytest.importorskip("cv2")
    env: Any = gym.make(ID, config=one_tray("fill"), perception="perfect", backend="analytic", render_mode="rgb_array")
    env.reset(seed=1)
    first = env.render()
    assert first.shape == (480, 640, 3) and first.dtype == np.uint8 and first.std() > 20.0
    pictures: list[np.ndarray] = []
    inner = env.unwrapped
    inner.record(pictures.append, 4.0)
    mask = env.get_wrapper_attr("action_masks")()
    _, _, _, _, info = env.step(int(np.flatnonzero(mask)[0]))
    elapsed = sum(info["phases_s"].values())
    assert abs(len(pictures) - 4.0 * elapsed) <= 1.0
    assert np.any(pictures[0] != pictures[-1])
    inner.record(None)
    env.close()


@pytest.mark.parametrize("before", [0, 2])
def test_a_recording_begins_where_its_first_decision_begins(before):
    """Nothing was drawn until the recording began; a picture taken before the decision says what has to be seen."""
    pytest.importorskip("cv2")
    first: list[np.ndarray] = []
    for drawn in (True, False):
        env: Any = gym.make(
            ID, config=one_tray("fill"), perception="perfect", backend="analytic", render_mode="rgb_array"
        )
        env.reset(seed=1)
        for _ in range(before):
            env.step(int(np.flatnonzero(env.get_wrapper_attr("action_masks")())[0]))
        if drawn:
            first.append(env.render())
        pictures: list[np.ndarray] = []
        env.unwrapped.record(pictures.append, 0.2)
        env.step(int(np.flatnonzero(env.get_wrapper_attr("action_masks")())[0]))
        first.append(pictures[0])
        env.close()
    assert np.array_equal(first[0], first[1]) and np.array_equal(first[1], first[2])


@pytest.mark.parametrize("source", SOURCE_TRAYS)
@pytest.mark.parametrize("target", TARGET_TRAYS)
def test_confusion_matrices_that_ship_are_measured_and_better_than_guessing(source, target):
    model = PerceptionModel.measured(TRAYS[source], TRAYS[target])
    for matrix in (model.source, model.target):
        shares = np.array(matrix)
        assert np.allclose(shares.sum(axis=1), 1.0)
        assert shares[EMPTY, EMPTY] > 0.95 and shares[HEALTHY, HEALTHY] > 0.95 and shares[POOR, POOR] > 0.6
    env: Any = gym.make(ID, backend="analytic", source_tray=source, target_tray=target)
    assert env.unwrapped.core.perception == model


def test_a_tray_that_was_not_measured_is_seen_as_the_one_with_the_nearest_pitch():
    close = Tray(10, 10, 0.0262)
    model = PerceptionModel.measured(close, close)
    assert model.source == PerceptionModel.measured(TRAYS[200]).source
    assert model.target == PerceptionModel.measured(target=TRAYS[72]).target


@pytest.mark.parametrize(("motion", "stroke_m"), [("stop-quintic", 0.0371), ("stop-fastest", 0.150)])
def test_the_stroke_at_which_the_published_rate_is_reached(motion, stroke_m):
    """100 a minute without gripping is 0.3 s a way: by hand, what two lifts of 150 mm leave for the traverse."""
    machine = MachineConfig(motion=motion)
    assert machine.round_trips_per_min(1.002 * stroke_m) < 100.0 < machine.round_trips_per_min(0.998 * stroke_m)
    assert machine.round_trips_per_min(stroke_m) == pytest.approx(100.0, rel=1e-3)
    assert machine.round_trips_per_min(0.010, 0.25) < 100.0, "gripping takes what was left"


def test_rounded_corners_reach_the_published_rate_over_the_whole_window():
    machine = MachineConfig(motion="blended", straight_m=0.0)
    assert machine.round_trips_per_min(0.6) > 100.0
