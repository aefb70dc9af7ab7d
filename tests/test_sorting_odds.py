"""What the sorter's planners believe of a pick, against what picks bring, with the camera as it is and far worse."""

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.agents.registry import make_policy
from fieldgym.envs.sorting.columns import NUMBER, TRUTH
from fieldgym.envs.sorting.config import SCENARIOS, PerceptionModel, SortingConfig
from fieldgym.envs.sorting.core import SortingCore
from fieldgym.envs.sorting.errors import held_at
from fieldgym.envs.sorting.odds import Odds, misses

MEASURED, SHIPPED = PerceptionModel.measured(), SortingConfig()
ROUGH = PerceptionModel(
    recall=0.8,
    false_per_item=0.3,
    bias_m=(0.003, -0.004, 0.006),
    sigma_m=(0.004, 0.002, 0.005),
    yaw_sigma_rad=(0.3, 0.5),
    tilt_sigma_rad=(0.1, 0.1),
    length_sigma=0.007,
    confusion=((0.8, 0.2, 0.0, 0.0), (0.1, 0.9, 0.0, 0.0), (0.0, 0.0, 0.7, 0.3), (0.0, 0.0, 0.1, 0.9)),
)
SLIPPERY = SortingConfig(
    belt=replace(SHIPPED.belt, slip_sigma_m=0.005),
    grip=replace(SHIPPED.grip, best=0.9, slip=0.6, capture_m=0.006),
    produce=replace(SHIPPED.produce, ripe_from=0.8, fruit_share=0.4),
)
CASES = {
    "as shipped": (SHIPPED, MEASURED, 0.02),
    "nothing is mistaken": (SHIPPED, PerceptionModel.perfect(), 0.02),
    "produce rolls and slips": (SLIPPERY, MEASURED, 0.02),
    # Errors as large as what they are measured by are not small any more.
    "a bad camera": (SHIPPED, ROUGH, 0.03),
}


@pytest.mark.parametrize("case", CASES)
def test_as_many_items_are_placed_as_is_believed(case):
    """Every report's pick, by reported grade: the belief is off by no more than chance and closed forms explain."""
    config, perception, near = CASES[case]
    worlds = 60
    core = SortingCore(config, perception, worlds)
    core.reset_rows(np.arange(worlds), [np.random.default_rng(seed) for seed in range(worlds)])
    state = core.state
    w, report = np.nonzero(np.isfinite(state.leave_s[:, :-1]) & np.isfinite(state.number[:, :-1, NUMBER.last_m]))
    grade, item = state.report_grade[w, report], state.item_truth[w, state.report_item[w, report]]
    there = state.item_free[w, state.report_item[w, report]]
    held = state.report_held[w, report] & ~state.report_lost[w, report] & there
    placed = held & (item[:, TRUTH.grade] == grade)
    believed = Odds(config, perception).placed(state.feature[w, report].astype(float))
    for of in range(4):
        error = (placed.astype(float) - believed)[grade == of]
        assert len(error) > 200 and abs(error.mean()) < near + 2.5 * error.std() / np.sqrt(len(error)), of


def test_worn_drives_carry_the_tool_as_far_off_as_is_believed():
    config, worlds = SortingConfig(scenario=SCENARIOS["field"]), 300
    core = SortingCore(config, MEASURED, worlds)
    core.reset_rows(np.arange(worlds), [np.random.default_rng(seed) for seed in range(worlds)])
    plan = core.plan(np.zeros(worlds, np.int64))
    # Level grips in the middle, as different machines carry them out.
    plan.grip[:], plan.turn[:] = (0.0, 0.0, 0.010), (1.0, 0.0, 0.0, 0.0)
    place, axes = held_at(plan, core.tool_error(plan))
    off = place - plan.grip - config.machine.sorter.tool_m * (axes[:, 3:] - np.array([0.0, 0.0, 1.0]))
    believed, exact = misses(config, PerceptionModel.perfect(), 0), misses(SHIPPED, PerceptionModel.perfect(), 0)
    spread = np.sqrt(believed.variance_m2 - exact.variance_m2)
    assert off.std(axis=0)[:2] == pytest.approx(spread[:2], rel=0.15) and (spread[:2] > 3e-4).all()
    assert off.mean(axis=0) == pytest.approx(believed.mean_m, abs=2e-4)


@pytest.mark.parametrize("scenario", ["load-1.25", "orders"])
def test_planners_believe_in_the_camera_that_they_have(scenario):
    for perception, model in (("perfect", PerceptionModel.perfect()), ("model", MEASURED)):
        env: Any = gym.make("fieldgym/ProduceSorting-v0", scenario=scenario, perception=perception)
        planner: Any = make_policy("receding-horizon", env)
        observation = {name: values[None] for name, values in env.reset(seed=0)[0].items()}
        chance = Odds(env.unwrapped.core.config, model).placed(
            observation["candidates"].reshape(1, 12, -1).astype(float)
        )
        believed = planner.expected(observation, np.array([0]))
        # By number, what no line waits for brings nothing.
        assert believed[0] == pytest.approx(chance[0, 0]) or (scenario == "orders" and believed[0] == 0.0)
        assert chance[0, 0] > 0.5
