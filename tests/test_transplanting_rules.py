"""The transplanting rules on trays that can be checked by hand."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fieldgym.envs.transplanting.columns import C, R, candidate_table
from fieldgym.envs.transplanting.columns import H as HARM
from fieldgym.envs.transplanting.columns import P as PHASE
from fieldgym.envs.transplanting.config import (
    DAMAGED,
    EMPTY,
    HEALTHY,
    POOR,
    MachineConfig,
    PerceptionModel,
    ProcessConfig,
    ScenarioConfig,
    TransplantingConfig,
    Tray,
)
from fieldgym.envs.transplanting.core import TransplantingCore, TransplantOutcome
from fieldgym.envs.transplanting.field import TrayField
from fieldgym.envs.transplanting.process import speed_chances
from fieldgym.envs.transplanting.rules import FINISH, INDEX_SOURCE, INDEX_TARGET, NOTHING
from fieldgym.motion import QUINTIC

PROCESS = ProcessConfig()
E, H, P, D = EMPTY, HEALTHY, POOR, DAMAGED
SMALL = Tray(2, 3, 0.045)
NORMAL = 1
THIRDS: Any = ((1 / 3, 1 / 3, 1 / 3),) * 3
SEEN_BY_LOT = PerceptionModel(THIRDS, THIRDS)
"""A camera whose report the lot alone decides: what is seen is what stands in the field."""


def trays(source, target, *, seen_source=None, seen_target=None, **changes) -> TransplantingCore:
    """Trays of 2 rows of 3 cells that hold what is given, reported as given (or as it is), with average luck.

    ``luck`` changes that of the first plug, ``changes`` the configuration.
    """
    luck = changes.pop("luck", {})
    scenario = ScenarioConfig(SMALL, SMALL, 1, 1, True, 0.0, 0.0, 0.0, 1000.0)
    core = TransplantingCore(TransplantingConfig(scenario=scenario, **changes), SEEN_BY_LOT, 1)
    field = TrayField.of_cells(source, target)
    assert field.target is not None
    lots = ((np.ravel(seen) + 0.5) / 3.0 for seen in (seen_source or source, seen_target or target))
    even = {name: np.full(6, 0.5) for name in ("extract", "lose", "damage")}
    for name, value in luck.items():
        even[name][0] = value
    field = TrayField(replace(field.source, lot=next(lots), **even), replace(field.target, lot=next(lots)))
    core.load(np.array([0]), core.stack([core.complete(field, np.random.default_rng(0))]))
    return core


def decide(core: TransplantingCore, action: int, error_m: tuple[float, float] = (0.0, 0.0)):
    plan = core.plan(np.array([action]))
    return plan, core.apply(plan, TransplantOutcome(plan.phases_s, np.array([error_m])))


def pair(source: int, target: int, speed: int = NORMAL) -> int:
    return (source * 3 + target) * 3 + speed


def scores(core: TransplantingCore) -> dict[str, float]:
    return dict(zip(core.score_names, core.scores()[0].tolist(), strict=True))


def leg_s(stroke_m: float, acceleration: float = 60.0) -> float:
    return float(QUINTIC.duration(stroke_m, 4.5, acceleration))


def test_a_pair_takes_the_time_of_its_legs_and_of_the_gripper():
    core = trays([[H] * 3] * 2, [[E] * 3] * 2)
    # Cells stand 45 mm apart about -160 and +160 mm; the tool starts 150 mm up in the middle.
    _, result = decide(core, pair(0, 2))
    phases = dict(zip(core.phase_names, result.phases_s[0], strict=True))
    assert phases["travel"] == pytest.approx(leg_s(0.205) + leg_s(0.150), abs=1e-12)
    assert phases["carry"] == pytest.approx(2 * leg_s(0.150, 35.0) + leg_s(0.410, 35.0), abs=1e-12)
    assert phases["handle"] == pytest.approx(PROCESS.grip_s + PROCESS.release_s)
    assert phases["index"] == phases["wait"] == 0.0
    assert scores(core)["travel_m"] == pytest.approx(0.205 + 0.150 + 0.300 + 0.410)
    _, result = decide(core, pair(2, 0, 2))
    assert result.phases_s[0, PHASE.travel] == pytest.approx(2 * leg_s(0.150) + leg_s(0.205 + 0.115), abs=1e-12)
    assert result.phases_s[0, PHASE.carry] == pytest.approx(2 * leg_s(0.150) + leg_s(0.230), abs=1e-12)


def test_a_planted_seedling_counts_once_and_cells_change_hands():
    core = trays([[H] * 3] * 2, [[H, E, H]] * 2)
    _, result = decide(core, pair(0, 1))
    seconds = core.config.weights.seconds * result.phases_s.sum()
    assert result.rewards[0] == pytest.approx([1.0, 0.0, seconds])
    assert core.state.source_cells[0, 0].tolist() == [E, H, H] and core.state.target_cells[0, 0].tolist() == [H, H, H]
    assert core.state.source_reports[0, 0].tolist() == [E, H, H] and core.state.target_reports[0, 0].tolist() == [
        H,
        H,
        H,
    ]
    got = scores(core)
    assert (got["done"], got["missed"], got["gaps"]) == (1, 1, 2)
    assert got["net_rate"] == pytest.approx(5 / 6) and got["filled"] == pytest.approx(0.5)
    assert got["cycle_time_s"] == got["duration_s"] == pytest.approx(result.phases_s.sum())
    assert got["throughput_per_min"] == pytest.approx(60.0 / result.phases_s.sum())


def test_a_poor_seedling_goes_to_the_chute_first():
    core = trays([[H] * 3] * 2, [[P, H, H]] * 2)
    plan, result = decide(core, pair(1, 0))
    assert plan.clears[0]
    to_target, to_chute, to_source = 0.115, 0.115, 0.160
    travel = leg_s(to_target) + leg_s(0.15) + leg_s(0.15) + leg_s(to_chute) + leg_s(to_source) + leg_s(0.15)
    assert result.phases_s[0, PHASE.travel] == pytest.approx(travel, abs=1e-12)
    assert result.phases_s[0, PHASE.handle] == pytest.approx(2 * (PROCESS.grip_s + PROCESS.release_s))
    assert core.state.target_cells[0, 0].tolist() == [H, H, H] and result.rewards[0, R.planted] == 1.0
    assert scores(core)["cleared"] == 1


@pytest.mark.parametrize(
    ("luck", "speed", "target", "score", "spoiled"),
    [
        ((0.97, 0.5, 0.5), NORMAL, E, "torn", 1.0),
        ((0.5, 0.004, 0.5), NORMAL, E, "lost", 1.0),
        ((0.5, 0.005, 0.5), NORMAL, H, "done", 0.0),
        ((0.5, 0.029, 0.5), 2, E, "lost", 1.0),
        ((0.5, 0.5, 0.010), NORMAL, D, "damaged", 1.0),
        ((0.5, 0.5, 0.011), NORMAL, H, "done", 0.0),
        ((0.5, 0.5, 0.090), 2, D, "damaged", 1.0),
        ((0.5, 0.5, 0.010), 0, H, "done", 0.0),
    ],
)
def test_luck_and_speed_decide_what_becomes_of_a_plug(luck, speed, target, score, spoiled):
    core = trays([[H] * 3] * 2, [[E] * 3] * 2, luck=dict(zip(("extract", "lose", "damage"), luck, strict=True)))
    plan, result = decide(core, pair(0, 0, speed))
    assert core.state.target_cells[0, 0, 0] == target and core.state.source_cells[0, 0, 0] == E
    assert scores(core)[score] == 1
    assert result.rewards[0, R.spoiled] == pytest.approx(spoiled * core.config.weights.spoiled)
    if score == "torn":
        assert not plan.grips[0] and result.phases_s[0, PHASE.carry] == 0.0 and core.state.place[0] == 0
        assert result.phases_s[0, PHASE.handle] == PROCESS.grip_s
    # The gripper's sensor tells a lost plug, nothing tells a damaged one.
    assert core.state.target_reports[0, 0, 0] == (E if target == E else H)


def test_chances_are_the_logistic_law_of_the_acceleration():
    for half in (0.0, 20.0, 105.0, 1e4):
        for width in (1e-3, 5.0, 13.0, 1e4):
            process = replace(PROCESS, loss_half_m_s2=half, loss_width_m_s2=width)
            process = replace(process, damage_half_m_s2=half + 7.0 if half < 1e4 else half, damage_width_m_s2=width)
            machine = replace(MachineConfig(), carry_acceleration_m_s2=(0.1, 20.0, 60.0))
            chances = speed_chances(machine, process)
            for speed, acceleration in enumerate(machine.carry_acceleration_m_s2):
                for harm, middle in ((HARM.lose, process.loss_half_m_s2), (HARM.damage, process.damage_half_m_s2)):
                    # exp(-x) / (1 + exp(-x)) is the same law, written so that it cannot overflow here.
                    fall = np.exp(-min(abs(middle - acceleration) / width, 700.0))
                    law = fall / (1.0 + fall) if middle > acceleration else 1.0 / (1.0 + fall)
                    assert chances[speed, harm] == pytest.approx(law, abs=1e-12)


def test_what_the_camera_missed_costs():
    core = trays([[E, P, H]] * 2, [[H, E, E]] * 2, seen_source=[[H] * 3] * 2, seen_target=[[E] * 3] * 2)
    plan, _ = decide(core, pair(0, 1))
    assert not plan.grips[0] and scores(core)["torn"] == 0 and core.state.source_reports[0, 0, 0] == E
    decide(core, pair(1, 1))
    assert core.state.target_cells[0, 0].tolist() == [H, P, E] and scores(core)["done"] == 0
    _, result = decide(core, pair(2, 0))
    # A plug into an occupied cell: both are spoilt.
    assert core.state.target_cells[0, 0].tolist() == [D, P, E]
    assert result.rewards[0, :2] == pytest.approx([-1.0, core.config.weights.spoiled])
    assert scores(core)["damaged"] == 2 and scores(core)["net_rate"] == pytest.approx(1 / 6)


def test_a_gripper_that_misses_its_place_loses_the_plug():
    for error in ((PROCESS.reach_m * 1.01, 0.0), (0.0, PROCESS.reach_m * 1.01)):
        core = trays([[H] * 3] * 2, [[E] * 3] * 2)
        decide(core, pair(0, 0), error)
        assert scores(core)["lost"] == 1 and core.state.target_cells[0, 0, 0] == E


def test_conveyors_take_their_time_and_the_episode_ends_with_the_last_target_row():
    core = trays([[H, E, P]] * 2, [[E] * 3] * 2)
    machine = core.config.machine
    decide(core, pair(0, 0))
    source, target = 3 * 9, 3 * 9 + 1
    plan, result = decide(core, source)
    law = QUINTIC.duration(0.045, machine.conveyor_velocity_m_s, machine.conveyor_acceleration_m_s2)
    assert plan.kind[0] == INDEX_SOURCE and core.state.source_row[0] == 1 and result.rewards[0, R.spoiled] == 0.0
    assert result.phases_s[0] == pytest.approx([leg_s(0.15), 0, 0, float(law) + machine.conveyor_settle_s, 0])
    plan, _ = decide(core, source)
    assert plan.kind[0] == NOTHING and core.state.source_row[0] == 1, "the supply has no row behind its last one"
    plan, result = decide(core, target)
    assert plan.kind[0] == INDEX_TARGET and result.phases_s[0, PHASE.travel] == 0.0, "the tool is up already"
    plan, result = decide(core, target)
    assert plan.kind[0] == FINISH and result.terminated[0]
    between = 0.540 - 0.045 + machine.tray_gap_m
    law = QUINTIC.duration(between, machine.conveyor_velocity_m_s, machine.conveyor_acceleration_m_s2)
    assert result.phases_s[0, PHASE.index] == pytest.approx(float(law) + machine.conveyor_settle_s)


def test_healthy_seedlings_that_leave_unused_are_wasted():
    core = trays([[H, E, H]] * 2, [[E] * 3] * 2)
    _, result = decide(core, 27)
    assert scores(core)["wasted"] == 2 and result.rewards[0, R.spoiled] == 2 * core.config.weights.spoiled


def test_masks_are_the_possible_pairs_and_illegal_actions_only_cost_time():
    core = trays([[H, E, P]] * 2, [[E, H, P]] * 2)
    mask = core.observe()["action_mask"][0]
    possible = {(0, 0), (0, 2), (2, 0), (2, 2)}
    for s in range(3):
        for t in range(3):
            assert mask[pair(s, t, 0) : pair(s, t, 0) + 3].tolist() == [int((s, t) in possible)] * 3
    assert mask[-2:].tolist() == [1, 1]
    before, place = core.scores()[0], core.state.place.copy()
    plan, result = decide(core, pair(1, 0))
    assert plan.kind[0] == NOTHING and result.phases_s[0].tolist() == [0, 0, 0, 0, PROCESS.illegal_s]
    after = dict(zip(core.score_names, core.scores()[0] - before, strict=True))
    assert after["illegal"] == 1 and after["transplants"] == 0 and after["healthy"] == 0
    assert np.array_equal(core.state.place, place)


def test_features_are_what_the_plan_then_takes():
    core = trays([[H, H, P]] * 2, [[E, P, E]] * 2)
    for s, t in ((1, 1), (0, 2), (2, 0)):
        table = candidate_table(core.observe())[0, 3 * s + t]
        _, result = decide(core, pair(s, t))
        assert table[C.present] == 1.0
        assert table[C.approach] == pytest.approx(result.phases_s[0, PHASE.travel], rel=1e-5)
        assert table[C.carry] == pytest.approx(result.phases_s[0, PHASE.carry], rel=1e-5)
        assert table[C.source] * 0.3 == pytest.approx(-0.16 + 0.045 * (s - 1), abs=1e-6)
        assert table[C.target] * 0.3 == pytest.approx(0.16 + 0.045 * (t - 1), abs=1e-6)
        assert table[C.source_poor] == (s == 2) and table[C.clear] == (t == 1)
