"""The transplanter's times: places, gates, tables, and the published rates."""

from itertools import pairwise
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.envs.transplanting import timing
from fieldgym.envs.transplanting.columns import W
from fieldgym.envs.transplanting.config import (
    MOTIONS,
    SOURCE_TRAYS,
    TRAYS,
    MachineConfig,
    ProcessConfig,
    ScenarioConfig,
    TransplantingConfig,
    Tray,
)
from fieldgym.envs.transplanting.timing import CLEARING, STRAIGHT, above, cell_places, gate_motion, handling_s, places
from fieldgym.envs.transplanting.timing import times as times_of

ID = "fieldgym/TrayTransplanting-v0"
SMALL = Tray(2, 3, 0.045)


def times(machine: MachineConfig, source: Tray, target: Tray):
    scenario = ScenarioConfig(source, target, 1, 1, True, 0.0, 0.0, 0.0, 1000.0)
    return times_of(TransplantingConfig(scenario=scenario, machine=machine))


@pytest.mark.parametrize("source", SOURCE_TRAYS)
@pytest.mark.parametrize("target", (50, 72))
def test_presented_rows_of_every_tray_lie_in_the_published_window(source, target):
    where = cell_places(MachineConfig(), TRAYS[source], TRAYS[target])
    assert np.abs(where).max() <= 0.3
    assert TRAYS[source].cells == source and TRAYS[target].cells == target
    env: Any = gym.make(ID, backend="analytic", perception="perfect", source_tray=source, target_tray=target)
    assert env.action_space.n == 3 * TRAYS[source].columns * TRAYS[target].columns + 2


@pytest.mark.parametrize(
    ("motion", "radius_m", "published"),
    [
        ("stop-quintic", np.inf, 61.2),
        ("stop-septic", np.inf, 53.0),
        ("stop-fastest", np.inf, 73.5),
        ("blended", 0.100, 95.4),
        ("blended", 0.150, 105.4),
    ],
)
def test_out_and_back_rates_over_the_full_gate(motion, radius_m, published):
    """No vacancies, no gripping, 600 x 150 mm: the environment itself, one cell on each side."""
    machine = MachineConfig(motion=motion, corner_radius_m=radius_m, straight_m=0.0, tray_centre_m=0.30)
    one = Tray(30, 1, 0.018)
    scenario = ScenarioConfig(one, one, 1, 1, False, 0.0, 0.0, 0.0, 1000.0)
    process = ProcessConfig(grip_s=0.0, release_s=0.0, extraction=1.0)
    env: Any = gym.make(
        ID,
        backend="analytic",
        perception="perfect",
        config=TransplantingConfig(scenario=scenario, machine=machine, process=process),
    )
    env.reset(seed=1)
    first = env.step(2)[-1]["phases_s"]
    env.step(3)
    env.step(4)
    second = env.step(2)[-1]["phases_s"]
    core = env.unwrapped.core
    table = core.times
    there, back = table.carry[2, 0, W.s], table.approach[STRAIGHT, 1, 0, W.s]
    assert there == pytest.approx(back, abs=1e-12)
    assert first["carry"] == second["carry"] == there
    assert 60.0 / (there + back) == pytest.approx(published, rel=0.01)
    assert 60.0 / (there + back) == pytest.approx(machine.round_trips_per_min(0.6), rel=1e-9)
    # After an index the tool hangs above the target cell: no rise is left.
    assert second["travel"] == table.approach[STRAIGHT, 3, 0, W.s] < back


@pytest.mark.parametrize(
    "motion", [pytest.param(name, marks=[pytest.mark.slow] * (name == "time-optimal")) for name in MOTIONS]
)
def test_tables_hold_the_gates_themselves(motion):
    machine = MachineConfig(motion=motion)
    source, target = Tray(2, 2, 0.07), Tray(2, 2, 0.09)
    table, where = times(machine, source, target), cell_places(machine, source, target)
    for speed, limit in enumerate(machine.carry_acceleration_m_s2[1:], start=1):
        gate = machine.gate(limit)
        for number in (0, 3):
            start, end = where[number // 2], where[2 + number % 2]
            exact = gate.motion((start, 0.0), (end, 0.0), machine.lift_m)
            assert table.carry[speed, number, W.s] == pytest.approx(exact.duration_s, rel=2e-3)
            length = gate.path((start, 0.0), (end, 0.0), machine.lift_m).length_m
            assert table.carry[speed, number, W.m] == pytest.approx(length, rel=2e-3)


@pytest.mark.parametrize("motion", ["blended", "time-optimal"])
def test_a_way_with_one_corner_is_rounded_both_ways_and_faster_than_a_stop_there(motion):
    gate = MachineConfig(motion=motion).gate()
    low, high = np.array([0.0, 0.0]), np.array([0.3, 0.15])
    down, up = gate_motion(gate, high, low, 0.15), gate_motion(gate, low, high, 0.15)
    assert down.duration_s == pytest.approx(up.duration_s, rel=1e-3)
    assert down.duration_s < 0.85 * MachineConfig(motion="stop-fastest").gate().durations(0.0, 0.3, 0.15)
    for motion_, ends in ((down, (high, low)), (up, (low, high))):
        state = motion_.sample(np.linspace(0.0, motion_.duration_s, 400))
        assert state.position[[0, -1]] == pytest.approx(np.array(ends), abs=1e-9)
        assert np.linalg.norm(state.velocity, axis=1).max() <= 4.5 * (1.0 + 1e-6)
        assert np.linalg.norm(state.acceleration, axis=1).max() <= 60.0 * (1.0 + 1e-3)
        assert np.all(np.diff(state.position[:, 1]) * (ends[1][1] - ends[0][1]) >= -1e-12)


def test_only_ways_with_two_corners_are_read_off_splines(monkeypatch):
    """Whoever begins above the cells has one corner to round, however far it is."""
    monkeypatch.setattr(timing, "_splines", lambda *args: (lambda across: np.full(across.shape, 5.0),) * 2)
    monkeypatch.setattr(timing, "_hook", lambda *args: (3.0, 3.0))
    machine = MachineConfig(motion="time-optimal")
    where = places(machine, SMALL, SMALL)
    to = timing._ways.__wrapped__(machine, SMALL, SMALL)[0][STRAIGHT, :, ::3, W.s]
    beside, high = where.x_m[:, None] != where.x_m[:3], where.height_m > 0.0
    assert (to[high][beside[high]] == 3.0).all() and (to[~high][beside[~high]] == 5.0).all()
    assert not np.isin(to[~beside], (3.0, 5.0)).any() and (~beside).sum() == 6


def test_same_place_is_no_gate():
    straight = times(MachineConfig(), SMALL, SMALL).approach[STRAIGHT, 1, :, W.s].reshape(3, 3)
    assert straight[1].tolist() == [0.0] * 3
    assert np.all(straight[[0, 2]] > 0.0)


@pytest.mark.parametrize("motion", ["stop-quintic", "blended"])
def test_a_way_that_clears_is_the_three_gates_that_it_is_made_of(motion):
    machine = MachineConfig(motion=motion)
    table, where, gate = times(machine, SMALL, SMALL), places(machine, SMALL, SMALL), machine.gate()
    for place in range(len(where.x_m)):
        for pair in range(9):
            stops = place, 3 + pair % 3, where.park, pair // 3
            legs = []
            for start, end in pairwise(stops):
                ends = [np.array([where.x_m[i], where.height_m[i]]) for i in (start, end)]
                legs.append(gate_motion(gate, ends[0], ends[1], machine.lift_m).duration_s if start != end else 0.0)
            assert table.approach[CLEARING, place, pair, W.s] == pytest.approx(sum(legs), rel=1e-6)


def test_the_place_above_is_reached_by_the_lift_and_stays():
    table, where = times(MachineConfig(), SMALL, SMALL), places(MachineConfig(), SMALL, SMALL)
    for place in range(len(where.x_m)):
        up = above(table, place)
        assert where.x_m[up] == where.x_m[place] and where.height_m[up] == MachineConfig().lift_m
        assert table.rise[place, W.m] == where.height_m[up] - where.height_m[place]


def test_the_gripper_works_as_often_as_it_grips_and_releases():
    table, process = times(MachineConfig(), SMALL, SMALL), ProcessConfig()
    for clears in (False, True):
        for grips in (False, True):
            seconds = (1 + clears) * process.grip_s + (clears + grips) * process.release_s
            assert handling_s(table, clears, grips) == pytest.approx(seconds)
