"""Weeds that do not all count the same: what is paid and scored, what a planner makes of it, and the bound."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.agents import make_policy
from fieldgym.agents.evaluation import evaluate
from fieldgym.envs.task import task
from fieldgym.envs.weeding.config import EVEN, SCENARIOS
from fieldgym.envs.weeding.state import PAD
from fieldgym.kernels.config import ConfigError
from fieldgym.kernels.seeds import TUNED

ID = "fieldgym/LaserWeeding-v0"


def test_reward_and_net_rate_are_what_the_dead_weeds_count():
    env: Any = gym.make(ID, scenario="worth", backend="analytic", perception="model")
    observation, info = env.reset(seed=4)
    core = env.unwrapped.core
    weeds = slice(PAD, PAD + int(core.state.weeds[0]))
    worth = np.array(core.config.scenario.worth)[core.plant_species[0, weeds], core.state.plant_kind[0, weeds]]
    assert set(worth.tolist()) == {0.3, 1.0, 3.0}
    policy, paid, over = make_policy("fifo", env), 0.0, False
    while not over:
        action = policy.act({name: values[None] for name, values in observation.items()})
        observation, _, end, cut, info = env.step(int(action[0]))
        paid, over = paid + info["rewards"]["killed"], end or cut
    dead = core.state.plant_dose[0, weeds] >= core.state.plant_tolerance[0, weeds]
    card = info["scorecard"]
    assert card["done"] == dead.sum() > 20
    assert paid == pytest.approx(worth[dead].sum())
    assert card["net_rate"] == pytest.approx(worth[dead].sum() / worth.sum())


def test_a_planner_that_knows_what_weeds_count_gets_more_than_one_that_does_not():
    """The planner of even weeds plays the same fields: it takes the quick seedlings first."""
    seeds, settings = TUNED.take(12, 70), dict[str, Any](scenario="worth", perception="model")
    from fieldgym.agents.policies.weeding_horizon import RecedingHorizon

    config = task(ID).assembly.configured("load-1.25")
    knows = evaluate(lambda env: make_policy("receding-horizon", env), ID, seeds, **settings).scorecard["net_rate"]
    blind = evaluate(lambda env: RecedingHorizon(config), ID, seeds, **settings).scorecard["net_rate"]
    assert 100.0 * (knows - blind).mean() > 3.0


@pytest.mark.parametrize("scenario", ["worth", "battery"])
def test_the_planner_does_not_beat_the_bound(scenario):
    from fieldgym.bounds.weeding import instance_of

    env: Any = gym.make(ID, scenario=scenario, backend="analytic", perception="model")
    observation, info = env.reset(seed=TUNED.take(1, 90)[0])
    bound = instance_of(env.unwrapped.core).bound()
    policy, total, over = make_policy("receding-horizon", env), 0.0, False
    while not over:
        action = policy.act({name: values[None] for name, values in observation.items()})
        observation, reward, end, cut, info = env.step(int(action[0]))
        total, over = total + float(reward), end or cut
    assert 0.5 * bound.net_rate < info["scorecard"]["net_rate"] <= bound.net_rate < 1.0
    assert total <= bound.episode_return


def test_a_demanded_share_is_one_of_even_weeds():
    scenario = SCENARIOS["load-1.25"]
    assert scenario.worth == EVEN
    with pytest.raises(ConfigError, match=r"worth = .*: a share of the weeds is demanded by number"):
        type(scenario)(40.0, 1.25, demanded=0.6, worth=((0.3, 1.0, 3.0), (1.0, 1.0, 1.0)))
