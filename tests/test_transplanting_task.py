"""The transplanting rules on trays that can be checked by hand."""

from dataclasses import replace
from itertools import permutations
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldgym.agents import make_policy, policy_names
from fieldgym.agents.policies.transplanting import best_order, mended, sequence_s
from fieldgym.envs.transplanting.config import (
    DAMAGED,
    EMPTY,
    HEALTHY,
    MOTIONS,
    POOR,
    SCENARIOS,
    SOURCE_TRAYS,
    TRAYS,
    MachineConfig,
    PerceptionModel,
    ProcessConfig,
    ScenarioConfig,
    TransplantingConfig,
    Tray,
)
from fieldgym.envs.transplanting.core import TransplantingCore, TransplantOutcome
from fieldgym.envs.transplanting.features import candidate_table
from fieldgym.envs.transplanting.field import draw_blocks, draw_field, random_numbers, reports
from fieldgym.envs.transplanting.motions import cell_places, gate_motion, motions
from fieldgym.envs.transplanting.process import damage_chances, loss_chances
from fieldgym.envs.transplanting.rules import FILLED, FINISH, GAPS, INDEX_SOURCE, INDEX_TARGET, NOTHING
from fieldgym.motion import QUINTIC

ID = "fieldgym/TrayTransplanting-v0"
PROCESS = ProcessConfig()
E, H, P, D = EMPTY, HEALTHY, POOR, DAMAGED
SMALL = Tray(2, 3, 0.045)
NORMAL = 1


def toy(source, target, *, seen_source=None, seen_target=None, **changes) -> TransplantingCore:
    """Trays of 2 rows of 3 cells that hold what is given, reported as given (or as it is), with average luck."""
    scenario = ScenarioConfig(SMALL, SMALL, 1, 1, True, 0.0, 0.0, 0.0, 1000.0)
    core = TransplantingCore(TransplantingConfig(scenario=scenario, **changes), PerceptionModel.perfect(), 1)
    core.reset_rows(np.array([0]), [np.random.default_rng(0)])
    core.state.luck[:] = 0.5
    core.state.source_cells[0, :-1], core.state.target_cells[0, :-1] = source, target
    core.state.source_reports[0, :-1] = source if seen_source is None else seen_source
    core.state.target_reports[0, :-1] = target if seen_target is None else seen_target
    healthy = np.count_nonzero(core.state.target_cells[0, :-1] == H)
    core.state.totals[0, [FILLED, GAPS]] = healthy, 6 - healthy
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
    core = toy([[H] * 3] * 2, [[E] * 3] * 2)
    # Cells stand 45 mm apart about -160 and +160 mm; the tool starts 150 mm up in the middle.
    _, result = decide(core, pair(0, 2))
    phases = dict(zip(core.phase_names, result.phases_s[0], strict=True))
    assert phases["travel"] == pytest.approx(leg_s(0.205) + leg_s(0.150), abs=1e-12)
    assert phases["carry"] == pytest.approx(2 * leg_s(0.150, 35.0) + leg_s(0.410, 35.0), abs=1e-12)
    assert phases["handle"] == pytest.approx(PROCESS.grip_s + PROCESS.release_s)
    assert phases["index"] == phases["wait"] == 0.0
    assert scores(core)["travel_m"] == pytest.approx(0.205 + 0.150 + 0.300 + 0.410)
    _, result = decide(core, pair(2, 0, 2))
    assert result.phases_s[0, 0] == pytest.approx(2 * leg_s(0.150) + leg_s(0.205 + 0.115), abs=1e-12)
    assert result.phases_s[0, 1] == pytest.approx(2 * leg_s(0.150) + leg_s(0.230), abs=1e-12)


def test_a_planted_seedling_counts_once_and_cells_change_hands():
    core = toy([[H] * 3] * 2, [[H, E, H]] * 2)
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
    core = toy([[H] * 3] * 2, [[P, H, H]] * 2)
    plan, result = decide(core, pair(1, 0))
    assert plan.clears[0]
    to_target, to_chute, to_source = 0.115, 0.115, 0.160
    travel = leg_s(to_target) + leg_s(0.15) + leg_s(0.15) + leg_s(to_chute) + leg_s(to_source) + leg_s(0.15)
    assert result.phases_s[0, 0] == pytest.approx(travel, abs=1e-12)
    assert result.phases_s[0, 2] == pytest.approx(2 * (PROCESS.grip_s + PROCESS.release_s))
    assert core.state.target_cells[0, 0].tolist() == [H, H, H] and result.rewards[0, 0] == 1.0
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
    core = toy([[H] * 3] * 2, [[E] * 3] * 2)
    core.state.luck[0, 0, 0] = luck
    plan, result = decide(core, pair(0, 0, speed))
    assert core.state.target_cells[0, 0, 0] == target and core.state.source_cells[0, 0, 0] == E
    assert scores(core)[score] == 1
    assert result.rewards[0, 1] == pytest.approx(spoiled * core.config.weights.spoiled)
    if score == "torn":
        assert not plan.grips[0] and result.phases_s[0, 1] == 0.0 and core.state.place[0] == 0
        assert result.phases_s[0, 2] == PROCESS.grip_s
    # The gripper's sensor tells a lost plug, nothing tells a damaged one.
    assert core.state.target_reports[0, 0, 0] == (E if target == E else H)


def test_chances_are_logistic_and_grow_with_the_acceleration():
    machine = MachineConfig()
    half = replace(machine, carry_acceleration_m_s2=(10.0, 30.0, 50.0))
    for chances in (loss_chances, damage_chances):
        assert np.all(np.diff(chances(machine, PROCESS)) > 0.0)
    at_half = replace(PROCESS, damage_half_m_s2=30.0, loss_half_m_s2=50.0)
    assert damage_chances(half, at_half)[1] == 0.5 and loss_chances(half, at_half)[2] == 0.5


def test_what_the_camera_missed_costs():
    core = toy([[E, P, H]] * 2, [[H, E, E]] * 2, seen_source=[[H] * 3] * 2, seen_target=[[E] * 3] * 2)
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
        core = toy([[H] * 3] * 2, [[E] * 3] * 2)
        decide(core, pair(0, 0), error)
        assert scores(core)["lost"] == 1 and core.state.target_cells[0, 0, 0] == E


def test_conveyors_take_their_time_and_the_episode_ends_with_the_last_target_row():
    core = toy([[H, E, P]] * 2, [[E] * 3] * 2)
    machine = core.config.machine
    decide(core, pair(0, 0))
    source, target = 3 * 9, 3 * 9 + 1
    plan, result = decide(core, source)
    law = QUINTIC.duration(0.045, machine.conveyor_velocity_m_s, machine.conveyor_acceleration_m_s2)
    assert plan.kind[0] == INDEX_SOURCE and core.state.source_row[0] == 1 and result.rewards[0, 1] == 0.0
    assert result.phases_s[0] == pytest.approx([leg_s(0.15), 0, 0, float(law) + machine.conveyor_settle_s, 0])
    plan, _ = decide(core, source)
    assert plan.kind[0] == NOTHING and core.state.source_row[0] == 1, "the supply has no row behind its last one"
    plan, result = decide(core, target)
    assert plan.kind[0] == INDEX_TARGET and result.phases_s[0, 0] == 0.0, "the tool is up already"
    plan, result = decide(core, target)
    assert plan.kind[0] == FINISH and result.terminated[0]
    between = 0.540 - 0.045 + machine.tray_gap_m
    law = QUINTIC.duration(between, machine.conveyor_velocity_m_s, machine.conveyor_acceleration_m_s2)
    assert result.phases_s[0, 3] == pytest.approx(float(law) + machine.conveyor_settle_s)


def test_healthy_seedlings_that_leave_unused_are_wasted():
    core = toy([[H, E, H]] * 2, [[E] * 3] * 2)
    _, result = decide(core, 27)
    assert scores(core)["wasted"] == 2 and result.rewards[0, 1] == 2 * core.config.weights.spoiled


def test_masks_are_the_possible_pairs_and_illegal_actions_only_cost_time():
    core = toy([[H, E, P]] * 2, [[E, H, P]] * 2)
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
    core = toy([[H, H, P]] * 2, [[E, P, E]] * 2)
    for s, t in ((1, 1), (0, 2), (2, 0)):
        table = candidate_table(core.observe())[0, 3 * s + t]
        _, result = decide(core, pair(s, t))
        assert table[0] == 1.0
        assert table[4] == pytest.approx(result.phases_s[0, 0], rel=1e-5)
        assert table[3] == pytest.approx(result.phases_s[0, 1], rel=1e-5)
        assert table[1] * 0.3 == pytest.approx(-0.16 + 0.045 * (s - 1), abs=1e-6)
        assert table[2] * 0.3 == pytest.approx(0.16 + 0.045 * (t - 1), abs=1e-6)
        assert table[5] == (s == 2) and table[6] == (t == 1)


@pytest.mark.parametrize("source", SOURCE_TRAYS)
@pytest.mark.parametrize("target", (50, 72))
def test_presented_rows_of_every_tray_lie_in_the_published_window(source, target):
    places = cell_places(MachineConfig(), TRAYS[source], TRAYS[target])
    assert np.abs(places).max() <= 0.3
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
    there, back = core.motions.carry_s[2, 0], core.motions.approach_s[0, 1, 0]
    assert there == pytest.approx(back, abs=1e-12)
    assert first["carry"] == second["carry"] == there
    assert 60.0 / (there + back) == pytest.approx(published, rel=0.01)
    assert 60.0 / (there + back) == pytest.approx(machine.round_trips_per_min(0.6), rel=1e-9)
    # After an index the tool hangs above the target cell: no rise is left.
    assert second["travel"] == core.motions.approach_s[0, 3, 0] < back


@pytest.mark.parametrize(
    "motion", [pytest.param(name, marks=[pytest.mark.slow] * (name == "time-optimal")) for name in MOTIONS]
)
def test_tables_hold_the_gates_themselves(motion):
    machine = MachineConfig(motion=motion)
    source, target = Tray(2, 2, 0.07), Tray(2, 2, 0.09)
    table, places = motions(machine, source, target), cell_places(machine, source, target)
    for speed, limit in enumerate(machine.carry_acceleration_m_s2[1:], start=1):
        gate = machine.gate(limit)
        for number in (0, 3):
            start, end = places[number // 2], places[2 + number % 2]
            exact = gate.motion((start, 0.0), (end, 0.0), machine.lift_m)
            assert table.carry_s[speed, number] == pytest.approx(exact.duration_s, rel=2e-3)
            length = gate.path((start, 0.0), (end, 0.0), machine.lift_m).length_m
            assert table.carry_m[speed, number] == pytest.approx(length, rel=2e-3)


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


def test_same_place_is_no_gate():
    table = motions(MachineConfig(), SMALL, SMALL)
    assert table.approach_s[0, 1].reshape(3, 3)[1].tolist() == [0.0] * 3
    assert np.all(table.approach_s[0, 1].reshape(3, 3)[[0, 2]] > 0.0)


@settings(deadline=None, max_examples=30)
@given(vacancy=st.floats(0.0, 1.0), poor=st.floats(0.0, 1.0), clumped=st.floats(0.0, 1.0), seed=st.integers(0, 2**31))
def test_trays_hold_the_vacancies_that_they_should(vacancy, poor, clumped, seed):
    scenario = replace(SCENARIOS["replug"], vacancy=vacancy, poor=poor, clumped=clumped)
    generators = [np.random.default_rng([seed, world]) for world in range(40)]
    field = draw_field(scenario, *draw_blocks(generators, random_numbers(scenario)))
    cells = np.concatenate([field.source.ravel(), field.target.ravel()])
    # Clumps of nine cells leave at least a ninth of the cells' information.
    spread = 5.0 * np.sqrt(0.25 * 9.0 / len(cells)) + 1e-9
    assert np.mean(cells == EMPTY) == pytest.approx(vacancy, abs=spread)
    assert np.mean(cells == POOR) == pytest.approx((1.0 - vacancy) * poor, abs=spread)


def test_clumped_vacancies_have_vacant_neighbours():
    together = []
    for clumped in (0.0, 0.6):
        scenario = replace(SCENARIOS["replug-high"], clumped=clumped)
        generators = [np.random.default_rng(world) for world in range(200)]
        empty = draw_field(scenario, *draw_blocks(generators, random_numbers(scenario))).source == EMPTY
        together.append(np.mean(empty[:, :, 1:] & empty[:, :, :-1]))
    assert together[0] == pytest.approx(0.04, abs=0.005)
    assert together[1] > 1.5 * together[0]


def test_reports_follow_the_confusion_matrix():
    confusion = ((0.9, 0.06, 0.04), (0.1, 0.7, 0.2), (0.0, 0.5, 0.5))
    rng = np.random.default_rng(3)
    cells = rng.integers(0, 3, 60_000).astype(np.int8)
    seen = reports(confusion, cells, rng.random(cells.shape))
    for state in range(3):
        shares = np.bincount(seen[cells == state], minlength=3) / np.count_nonzero(cells == state)
        assert shares == pytest.approx(np.array(confusion[state]), abs=0.015)


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_trays_and_luck_do_not_depend_on_the_camera_and_steps_draw_nothing(scenario):
    drawn = []
    for perception in ("perfect", "model"):
        env: Any = gym.make(ID, backend="analytic", scenario=scenario, perception=perception).unwrapped
        _, info = env.reset(seed=3)
        core = env.core
        drawn.append((core.state.source_cells.copy(), core.state.target_cells.copy(), core.state.luck.copy()))
        state = env.np_random.bit_generator.state
        env.step(int(np.flatnonzero(info["action_mask"])[0]))
        assert env.np_random.bit_generator.state == state
    assert all(np.array_equal(a, b) for a, b in zip(*drawn, strict=True))


@pytest.mark.parametrize("name", policy_names(ID))
@pytest.mark.parametrize("scenario", SCENARIOS)
def test_policies_finish_without_an_illegal_action(name, scenario):
    env = gym.make_vec(ID, num_envs=2, scenario=scenario, autoreset_mode="Disabled")
    policy = make_policy(name, env, seed=1)
    observation, info = env.reset(seed=0)
    over = np.zeros(2, bool)
    for _ in range(600):
        observation, _, terminated, truncated, info = env.step(policy.act(observation))
        over |= terminated | truncated
        if over.all():
            break
    assert over.all()
    assert (info["scorecard"]["illegal"] == 0).all()
    if name != "random":
        assert (info["scorecard"]["net_rate"] > 0.9).all()


def cycle_tables(rng: np.random.Generator, sources: int, gaps: int) -> tuple[np.ndarray, np.ndarray]:
    return rng.random((sources, gaps)), rng.random((gaps, sources, gaps))


def test_best_order_is_the_best_of_all_orders():
    rng = np.random.default_rng(4)
    for _ in range(10):
        first, following = cycle_tables(rng, 5, 5)
        pairs = list(zip(rng.permutation(5).tolist(), range(5), strict=True))
        found = best_order(first, following, pairs)
        assert sorted(found) == sorted(pairs)
        best = min(sequence_s(first, following, list(order)) for order in permutations(pairs))
        assert sequence_s(first, following, found) == pytest.approx(best)


def test_mended_sequences_are_no_longer_and_use_each_cell_once():
    rng = np.random.default_rng(5)
    for _ in range(10):
        first, following = cycle_tables(rng, 6, 4)
        begin = [(i, i) for i in range(4)]
        found = mended(first, following, begin)
        assert sequence_s(first, following, found) < sequence_s(first, following, begin)
        for side, size in ((0, 6), (1, 4)):
            used = [pair[side] for pair in found]
            assert len(set(used)) == 4 and max(used) < size


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: gym.make(ID, scenario="orchard"), "scenario"),
        (lambda: gym.make(ID, motion="jump"), "motion"),
        (lambda: gym.make(ID, source_tray=73), "source_tray"),
        (lambda: gym.make(ID, target_tray=128), "target_tray"),
        (lambda: gym.make(ID, backend="gazebo"), "backend"),
        (lambda: gym.make(ID, perception="lidar"), "perception"),
        (lambda: gym.make_vec(ID, num_envs=0), "num_envs"),
        (lambda: gym.make_vec(ID, num_envs=2, backend="pybullet"), "batched"),
        (lambda: gym.make_vec(ID, num_envs=2, perception="camera"), "batched"),
        (lambda: Tray(10, 20, 0.03), "columns"),
        (lambda: replace(SCENARIOS["fill"], vacancy=1.2), "vacancy"),
        (lambda: replace(SCENARIOS["fill"], target_trays=0), "target_trays"),
        (lambda: replace(PROCESS, extraction=float("nan")), "extraction"),
        (lambda: replace(PROCESS, plug_kg=0.4), "plug_kg"),
        (lambda: MachineConfig(lift_m=0.2), "lift_m"),
        (lambda: MachineConfig(straight_m=0.16), "straight_m"),
        (lambda: MachineConfig(carry_acceleration_m_s2=(10.0, 20.0, 70.0)), "carry_acceleration_m_s2"),
        (lambda: TransplantingConfig(machine=MachineConfig(tray_centre_m=0.25)), "tray_centre_m"),
        (lambda: PerceptionModel(((1.0, 0.0, 0.0),) * 2, ((1.0, 0.0, 0.0),) * 3), "source"),
    ],
)
def test_bad_settings_are_named(make, word):
    with pytest.raises(ValueError, match=word) as caught:
        make()
    assert "\n" not in str(caught.value)
