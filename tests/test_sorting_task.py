"""The sorting rules on instances that can be checked by hand."""

from dataclasses import replace
from itertools import permutations

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.agents import make_policy
from fieldgym.agents.policies.sorting import RecedingHorizon
from fieldgym.envs.core import NominalExecutor
from fieldgym.envs.sorting import reach
from fieldgym.envs.sorting.columns import CANDIDATE, TOTAL, candidate_table
from fieldgym.envs.sorting.config import (
    SCENARIOS,
    BeltConfig,
    GripConfig,
    PerceptionModel,
    SortingConfig,
)
from fieldgym.envs.sorting.core import SortingCore
from fieldgym.envs.sorting.field import Items, ProduceField, Reports
from fieldgym.envs.sorting.machine import PyBulletSorter
from fieldgym.envs.sorting.motions import PickMotion, follow_share
from fieldgym.envs.sorting.reports import wrapped
from fieldgym.envs.sorting.state import NOTHING, PICK, WAIT
from fieldgym.mechanisms import ThreePRRS
from fieldgym.motion import QUINTIC
from fieldgym.motion.orientation import tilted
from fieldgym.simulation.sorter_limits import first_violation
from fieldgym.testing import check_policies

ID = "fieldgym/ProduceSorting-v0"
GRIP = GripConfig()
SPEED = BeltConfig().speed_m_s


def toy(items: list[dict], luck: float = 0.5, slip: float = 0.5, **changes) -> SortingCore:
    """Items reported exactly as they are, each passing x = 0 at ``passing_s``; level tubers in line unless told."""
    core = SortingCore(replace(SortingConfig(), **changes), PerceptionModel.perfect(), 1)
    usual = {"yaw_rad": 0.0, "tilt_rad": 0.0, "azimuth_rad": 0.0, "length_m": 0.060, "width": 0.7, "thickness": 0.5}
    told = [{"across_m": 0.0, "grade": 0, **usual, **item} for item in items]
    lies = {name: np.array([item[name] for item in told]) for name in ("passing_s", "across_m", "grade", *usual)}
    true = {
        "grade": np.array([item.get("true_grade", item["grade"]) for item in told]),
        "slip_across_m": np.array([item.get("beside_m", 0.0) for item in told]),
        **{name: np.full(len(told), value) for name, value in (("grip_luck", luck), ("way_luck", slip))},
        "slip_along_m": np.zeros(len(told)),
    }
    seen = {"seen_s": np.zeros(len(told)), "item": np.arange(len(told))}
    field = ProduceField(
        replace(Items.empty(len(told)), **lies | true), replace(Reports.empty(len(told)), **lies | seen)
    )
    load(core, field)
    return core


def load(core: SortingCore, *fields: ProduceField) -> None:
    """Complete fields and put them into the first worlds."""
    whole = [core.complete(field, np.random.default_rng(row)) for row, field in enumerate(fields)]
    core.load(np.arange(len(whole)), core.stack(whole))


def decide(core: SortingCore, action: int):
    plan = core.plan(np.array([action]))
    return plan, core.apply(plan, NominalExecutor(core).execute(plan))


def scores(core: SortingCore) -> dict[str, float]:
    return dict(zip(core.score_names, core.scores()[0].tolist(), strict=True))


def test_one_pick_takes_the_time_that_its_legs_take():
    core = toy([{"passing_s": 0.5, "across_m": 0.05}])
    sorter, machine = core.config.machine.sorter, core.config.machine
    plan, result = decide(core, 0)
    phases = dict(zip(core.phase_names, result.phases_s[0], strict=True))
    z = 0.5 * 0.5 * 0.060 + sorter.tool_m - sorter.origin_above_belt_m
    down = float(QUINTIC.duration(machine.travel_level_m - z, sorter.velocity_m_s, sorter.acceleration_m_s2))
    assert phases["wait"] == pytest.approx(0.0, abs=1e-12)
    assert phases["descend"] == phases["lift"] == pytest.approx(down)
    assert phases["grip"] == GRIP.grip_s and phases["release"] == GRIP.release_s
    # The item was 30 mm upstream and 50 mm aside of the platform, and moves on while the tool comes.
    approach = phases["approach"]
    own = np.hypot(SPEED * (approach - 0.5) - 0.5 * SPEED * approach, 0.05)
    limits = sorter.velocity_m_s - SPEED, sorter.acceleration_m_s2
    assert approach == pytest.approx(float(QUINTIC.duration(own, *limits)), rel=2e-3)
    assert plan.meet[0] == pytest.approx([SPEED * (approach - 0.5), 0.05])
    lifted_x = plan.meet[0, 0] + SPEED * (2.0 * down + GRIP.grip_s)
    x, y = core.config.belt.bins_m[0]
    way = np.hypot(x - lifted_x - 0.5 * SPEED * phases["carry"], y - 0.05)
    assert phases["carry"] == pytest.approx(float(QUINTIC.duration(way, *limits)), rel=2e-3)
    assert core.state.place[0].tolist() == [x, y]


def test_an_item_upstream_is_waited_for_at_the_edge_of_the_reach():
    core = toy([{"passing_s": 6.0}])
    plan, result = decide(core, 0)
    assert result.phases_s[0, 0] > 1.0
    edge = reach.reach_m(reach.radii(ThreePRRS.sorter(), 0.095), 0.0, 0.0)
    assert plan.meet[0, 0] == pytest.approx(-edge)
    assert result.phases_s[0, :2].sum() == pytest.approx(6.0 - edge / SPEED)


def test_the_right_bin_pays_the_grade_and_the_wrong_one_costs():
    core = toy([{"passing_s": 0.5, "grade": 2}, {"passing_s": 2.0, "grade": 0, "true_grade": 1}])
    _, first = decide(core, 0)
    assert dict(zip(core.reward_names, first.rewards[0].tolist(), strict=True))["placed"] == 0.8
    _, second = decide(core, 0)
    assert second.rewards[0].tolist() == [0.0, core.config.weights.misplaced, 0.0, 0.0]
    found = scores(core)
    assert found["net_rate"] == 0.5 and found["misplaced"] == 1 and found["missed"] == 0
    assert found["value_rate"] == pytest.approx(0.8 / (0.8 + 0.5))
    assert found["cycle_time_s"] == pytest.approx(first.phases_s.sum())
    assert found["pick_cycle_s"] == pytest.approx(found["duration_s"] / 2.0)


def test_an_empty_grip_leaves_the_platform_turned_over_the_belt_and_the_item_on_it():
    core = toy([{"passing_s": 0.5, "yaw_rad": 0.6, "tilt_rad": 0.2, "azimuth_rad": 1.0}], luck=0.9999)
    plan, result = decide(core, 0)
    assert result.rewards[0].tolist() == [0.0, 0.0, 0.0, core.config.weights.wasted]
    assert result.phases_s[0, 5:].tolist() == [core.config.machine.stop_s, 0.0]
    assert core.state.item_free[0, 0] and core.observe()["action_mask"][0].tolist() == [0] * 12 + [1]
    assert np.array_equal(core.state.turn, plan.turn)
    end = PickMotion(core.config, plan).sample(np.array([result.phases_s[0].sum()]), False)
    assert core.state.place[0] == pytest.approx(end.position[0, :2], abs=1e-12)


def test_a_slip_on_the_way_is_a_dropped_item():
    # The fingers close 6 mm beside the item: quality exp(-(6/8)^2 / 2) = 0.755, so that it slips 8.6 % of the times.
    core = toy([{"passing_s": 0.5, "beside_m": 0.006}], slip=0.08)
    _, result = decide(core, 0)
    assert result.rewards[0].tolist() == [0.0, 0.0, core.config.weights.dropped, 0.0]
    core = toy([{"passing_s": 0.5, "beside_m": 0.006}], slip=0.09)
    assert decide(core, 0)[1].rewards[0, 0] == 1.0


def test_what_is_foreseen_is_what_the_fingers_get_where_the_plan_puts_them():
    for core, plan, row, _ in _plans(16, 6):
        seen, got = core.foreseen(plan), core.grip(plan, plan.grip, plan.axes)
        assert seen.held[row] == got.held[row] and seen.lost[row] == got.lost[row]


def test_what_leans_too_far_is_shown_but_refused_with_the_reason():
    far = np.deg2rad(30.0)
    core = toy(
        [
            {"passing_s": 1.0, "tilt_rad": far},
            {"passing_s": 1.5, "across_m": 0.105, "tilt_rad": 0.34, "azimuth_rad": 1.57, "yaw_rad": 1.2},
        ]
    )
    observation = core.observe()
    assert observation["action_mask"][0, :2].tolist() == [0, 0]
    assert candidate_table(observation)[0, :2, 0].tolist() == [1.0, 1.0]
    reasons = sorted(core.refusal(slot) for slot in (0, 1))
    assert "tilt limit of 20 deg" in reasons[0] and "cone" in reasons[1]
    assert core.refusal(5) == "no item in this slot"


def test_candidates_come_in_the_order_in_which_they_leave_and_go_when_they_have_left():
    core = toy([{"passing_s": 2.0}, {"passing_s": -1.0}, {"passing_s": 0.5, "across_m": 0.1}])
    along = candidate_table(core.observe())[0, :3, CANDIDATE.along]
    assert along[0] > along[1] > along[2]
    for _ in range(5):
        decide(core, 12)
    assert candidate_table(core.observe())[0, :, 0].sum() == 2.0
    for _ in range(12):
        decide(core, 12)
    observation = core.observe()
    assert not observation["candidates"].any() and observation["action_mask"].sum() == 1


def test_waiting_and_illegal_actions_cost_time_and_nothing_else():
    core = toy([{"passing_s": 3.0}])
    plan, result = decide(core, 12)
    assert plan.kind[0] == WAIT and result.phases_s.sum() == GRIP.wait_s
    plan, result = decide(core, 7)
    assert plan.kind[0] == NOTHING and result.phases_s.sum() == GRIP.illegal_s
    assert scores(core)["illegal"] == 1 and not core.state.place.any() and not result.rewards.any()


def test_the_time_limit_of_a_pick_is_its_slack():
    core = toy([{"passing_s": 0.0}])
    slack = 4.0 * candidate_table(core.observe())[0, 0, CANDIDATE.slack]
    assert slack == pytest.approx(3.2, abs=0.5)
    core.state.totals[0, TOTAL.time_s] += slack - 0.5
    assert core.observe()["action_mask"][0, 0] == 1
    core.state.totals[0, TOTAL.time_s] += 0.3
    assert core.observe()["action_mask"][0, 0] == 0 and "too late" in core.refusal(0)


def test_the_shipped_reach_is_what_the_mechanism_gives():
    table = reach.tabulate(ThreePRRS.sorter(), 0.095)
    assert np.allclose(table - reach.RESERVE_M, reach.radii(ThreePRRS.sorter(), 0.095), atol=2e-4)
    # Between the table's nodes, in directions that it was not made from.
    rng = np.random.default_rng(0)
    n = 4000
    tilt, yaw = np.deg2rad(20.0) * rng.random(n), np.deg2rad(60.0) * (2.0 * rng.random(n) - 1.0)
    lean, place = 2.0 * np.pi * rng.random(n), 2.0 * np.pi * rng.random(n)
    shipped = reach.radii(ThreePRRS.sorter(), 0.095)
    radius = np.array([reach.reach_m(shipped, *turn) for turn in zip(tilt, yaw, strict=True)])
    from fieldgym.motion.orientation import euler_angles

    poses = np.column_stack(
        [radius * np.cos(place), radius * np.sin(place), 0.095 * rng.random(n), euler_angles(tilted(tilt, lean, yaw))]
    )
    assert ThreePRRS.sorter().reachable(poses).all()


def _plans(worlds: int = 16, decisions: int = 14):
    core = SortingCore(SortingConfig(scenario=SCENARIOS["load-1.6"]), PerceptionModel.measured(), worlds)
    executor, rng = NominalExecutor(core), np.random.default_rng(3)
    core.reset_rows(np.arange(worlds), [np.random.default_rng(100 + i) for i in range(worlds)])
    for _ in range(decisions):
        mask = core.observe()["action_mask"]
        plan = core.plan(np.where(mask > 0, rng.random(mask.shape), -1.0).argmax(axis=1))
        outcome = executor.execute(plan)
        for row in np.flatnonzero(plan.kind == PICK):
            yield core, plan, int(row), bool(outcome.grip.held[row])
        core.apply(plan, outcome)


def test_planned_motions_keep_every_limit_on_the_whole_way():
    sorter = SortingConfig().machine.sorter
    count = 0
    for core, plan, row, held in _plans():
        motion = PickMotion(core.config, plan, row)
        step = 0.004
        way = motion.sample(np.arange(0.0, motion.duration_s(held) + step, step), held)
        assert first_violation(sorter.mechanism, way.poses()[::6]) is None
        velocity = np.diff(way.position, axis=0) / step
        acceleration = np.diff(velocity, axis=0) / step
        assert np.linalg.norm(velocity, axis=1).max() <= 1.002 * sorter.velocity_m_s
        # The ramp to the belt's speed adds at most 1.875 v / T to the motion's own acceleration.
        ramp = 1.875 * core.config.belt.speed_m_s / core.config.machine.shortest_move_s
        assert np.linalg.norm(acceleration, axis=1).max() <= 1.01 * sorter.acceleration_m_s2 + ramp
        turned = np.abs(np.sum(way.turn[1:] * way.turn[:-1], axis=1))
        assert (2.0 * np.arccos(np.minimum(turned, 1.0))).max() / step <= 1.01 * sorter.turn_rad_s
        count += 1
    assert count > 100


def test_the_tool_follows_the_belt_from_the_approach_s_end_to_the_lift():
    for core, plan, row, held in _plans(4, 6):
        motion = PickMotion(core.config, plan, row)
        time = np.linspace(motion.approach_s, motion.lifted_s, 50)
        way = motion.sample(time, held)
        assert way.position[:, 0] == pytest.approx(plan.meet[row, 0] + SPEED * (time - motion.approach_s), abs=1e-12)
        closing = motion.sample(np.array([motion.closing_s]), held)
        assert closing.position[0] == pytest.approx(plan.grip[row], abs=1e-12)
        assert closing.turn[0] == pytest.approx(plan.turn[row], abs=1e-9)
        end = motion.sample(np.array([motion.duration_s(True)]), True)
        assert end.position[0, :2] == pytest.approx(plan.bin[row], abs=1e-12)


def test_the_ramp_is_the_integral_of_the_law():
    tau = np.linspace(0.0, 1.0, 2001)
    slope = np.diff(follow_share(tau)) / np.diff(tau)
    assert slope == pytest.approx(QUINTIC.shape(0.5 * (tau[1:] + tau[:-1]))[0], abs=1e-6)
    assert follow_share(np.array([1.0]))[0] == pytest.approx(0.5)


def test_half_a_turn_of_yaw_is_none():
    assert wrapped(np.array([0.3, 0.3 + np.pi, -np.pi / 2, np.pi / 2])) == pytest.approx(
        [0.3, 0.3, np.pi / 2, np.pi / 2]
    )


@pytest.mark.parametrize("scenario", ["load-0.7", "clumped-1.25"])
def test_policies_see_the_stream_out_and_place_some_of_it(scenario):
    for scores in check_policies(ID, scenario, range(4)).values():
        card = scores.scorecard
        assert (card["duration_s"] < SCENARIOS[scenario].time_limit_s).all() and (card["net_rate"] > 0.2).all()
        assert card["done"] + card["misplaced"] + card["damaged"] + card["missed"] == pytest.approx(card["total"])


def test_planning_ahead_beats_the_queue_under_overload():
    rates = {}
    for name in ("fifo", "receding-horizon"):
        env = gym.make_vec(ID, num_envs=40, scenario="load-1.6", perception="perfect", autoreset_mode="Disabled")
        policy = make_policy(name, env)
        observation, _ = env.reset(seed=0)
        over, rate = np.zeros(40, bool), np.zeros(40)
        while not over.all():
            observation, _, terminated, _, info = env.step(policy.act(observation))
            rate = np.where(over, rate, info["scorecard"]["net_rate"])
            over |= terminated
        rates[name] = rate
    gain = rates["receding-horizon"] - rates["fifo"]
    assert gain.mean() > 3.0 * gain.std() / np.sqrt(40)


@pytest.mark.parametrize("seed", range(4))
def test_the_search_places_as_many_as_the_best_order(seed):
    """Four items that leave within a few seconds of each other: every order is tried."""
    rng = np.random.default_rng(seed)
    items = [
        {"passing_s": -2.4 + 0.8 * i, "across_m": rng.uniform(-0.1, 0.1), "grade": int(rng.integers(4))}
        for i in range(4)
    ]

    def placed(choose) -> float:
        core = toy(items, luck=0.0)
        for step in range(4):
            action = choose(core, step)
            if action is None:
                break
            decide(core, action)
        return scores(core)["done"]

    def order(sequence):
        def choose(core, step):
            report = core.state.report_item[0, core.state.slot_report[0, :4]].tolist()
            wanted = [slot for slot, item in enumerate(report) if item == sequence[step]]
            return wanted[0] if wanted else 12

        return choose

    best = max(placed(order(sequence)) for sequence in permutations(range(4)))
    ahead = placed(lambda core, step: int(RecedingHorizon(core.config, 4, 64).act(core.observe())[0]))
    assert ahead == best
    with pytest.raises(ValueError, match="depth"):
        RecedingHorizon(SortingConfig(), 0)


@pytest.mark.slow
def test_pybullet_agrees_with_the_plan():
    """Cycle time within 2 %, net rate within 1.5 points, on the same streams with the same decisions' rule."""
    cards: dict[type, list] = {NominalExecutor: [], PyBulletSorter: []}
    scenario = replace(SCENARIOS["load-1.25"], stream_s=30.0)
    for executor in cards:
        env = gym.make(
            ID,
            backend="analytic" if executor is NominalExecutor else "pybullet",
            perception="perfect",
            config=SortingConfig(scenario=scenario),
        )
        policy = make_policy("edf", env)
        for seed in range(6):
            observation, info = env.reset(seed=seed)
            end = False
            while not end:
                action = policy.act({name: values[None] for name, values in observation.items()})[0]
                observation, _, end, _, info = env.step(int(action))
            cards[executor].append(info["scorecard"])
        env.close()

    def mean(executor, key):
        return float(np.mean([card[key] for card in cards[executor]]))

    assert mean(PyBulletSorter, "net_rate") == pytest.approx(mean(NominalExecutor, "net_rate"), abs=0.015)
    assert mean(PyBulletSorter, "cycle_time_s") == pytest.approx(mean(NominalExecutor, "cycle_time_s"), rel=0.02)


def test_descriptions_say_what_happened():
    core = toy([{"passing_s": 0.5, "grade": 2}, {"passing_s": 0.8}])
    assert core.describe(*decide(core, 0)).startswith("ripe from slot 0: placed")
    assert core.describe(*decide(core, 12)).startswith("wait")
    assert core.describe(*decide(core, 9)).startswith("illegal")
