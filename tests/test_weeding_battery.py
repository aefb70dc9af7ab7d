"""Where energy is scarce: what is spent, what is shown of it, and a planner that makes it last."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.agents import make_policy
from fieldgym.agents.evaluation import evaluate
from fieldgym.agents.policies.weeding_outlook import THRIFTS, Thrift, outlook
from fieldgym.envs.task import task
from fieldgym.envs.weeding.features import ENERGY
from fieldgym.envs.weeding.outcomes import outcomes_of
from fieldgym.kernels.seeds import TUNED

ID = "fieldgym/LaserWeeding-v0"


def battery(energy_j: float = 4000.0) -> Any:
    return gym.make(
        ID, scenario="battery", backend="analytic", perception="model", overrides={"scenario.energy_j": energy_j}
    )


def test_no_more_is_spent_than_there_is_and_what_is_left_is_shown():
    env = battery(600.0)
    observation, info = env.reset(seed=1)
    rng, spent, masked = np.random.default_rng(0), 0.0, set()
    energy_j = env.unwrapped.core.tables.energy_j
    over = False
    while not over:
        assert observation["machine"][ENERGY] == pytest.approx((600.0 - spent) / 600.0, abs=1e-6)
        modes = observation["action_mask"][:-1].reshape(-1, 3).any(axis=0)
        affordable = spent + energy_j <= 600.0
        assert not (modes & ~affordable).any()
        masked.add(tuple(affordable.tolist()))
        legal = np.flatnonzero(observation["action_mask"])
        observation, _, end, cut, info = env.step(int(rng.choice(legal[:-1] if len(legal) > 1 else legal)))
        spent -= info["rewards"]["energy"] / 0.0005
        over = end or cut
    assert 570.0 < spent <= 600.0 + 1e-6
    assert {(True, True, True), (False, False, False)} <= masked


def test_what_cannot_be_paid_is_an_illegal_action():
    env = battery(100.0)
    env.reset(seed=1)
    over, before = False, 0.0
    while not over:
        high = np.flatnonzero(env.unwrapped.action_masks()[:-1].reshape(-1, 3)[:, 1])
        action = 3 * int(high[0]) + 2 if len(high) else env.action_space.n - 1
        _, _, end, cut, info = env.step(action)
        if len(high):
            assert info["rewards"]["energy"] == 0.0 and info["scorecard"]["illegal"] == before + 1.0
            break
        over = end or cut
    else:
        pytest.fail("nothing came into reach")


def test_only_where_energy_is_scarce_it_is_shown():
    plenty: Any = gym.make(ID, scenario="load-1.25", backend="analytic", perception="model")
    names = plenty.unwrapped.core.machine_features
    assert battery().unwrapped.core.machine_features == (*names, "energy")
    assert list(battery().unwrapped.core.meanings()["machine"]) == [*names, "energy"]
    assert np.isinf(plenty.unwrapped.core.tables.budget_j)


def test_a_joule_costs_what_makes_energy_last():
    config = task(ID).assembly.configured("battery")
    tool = outlook(config)
    thrift = Thrift.of(outcomes_of(config, tool.perception, tool.process), tool.energy_j)
    assert (np.diff(thrift.use_j_per_m) <= 0.0).all() and (np.diff(THRIFTS) > 0.0).all()
    most = thrift.use_j_per_m[0]
    for share, price in ((1.01, 0.0), (0.5, None), (0.1, None), (0.0, None)):
        found = float(thrift.price_of(np.array([share * most * 4.0]), np.array([4.0]))[0])
        place = int(np.searchsorted(THRIFTS, found))
        if price is not None:
            assert found == price
        else:
            # The lowest that is high enough.
            assert thrift.use_j_per_m[place] <= share * most < thrift.use_j_per_m[place - 1]


def test_a_planner_that_saves_energy_kills_more_than_one_that_takes_what_comes():
    def rate(name):
        seeds, settings = TUNED.take(8, 50), dict[str, Any](scenario="battery", perception="model")
        return 100.0 * evaluate(lambda env: make_policy(name, env), ID, seeds, **settings).scorecard["net_rate"]

    assert (rate("receding-horizon") - rate("fifo")).mean() > 10.0


def test_a_network_that_knows_of_no_energy_decides_without_looking_at_it():
    env: Any = battery()
    plenty: Any = gym.make(ID, scenario="load-1.25", backend="analytic", perception="model")
    (scarce, _), (free, _) = env.reset(seed=2), plenty.reset(seed=2)
    known: Any = make_policy("learned", plenty)
    policy = known.fitted(env)
    for _ in range(5):
        action = policy.act({name: values[None] for name, values in scarce.items()})
        assert action == known.act({name: values[None] for name, values in free.items()})
        scarce, free = env.step(int(action[0]))[0], plenty.step(int(action[0]))[0]


def test_the_network_that_ships_for_it_asks_what_is_left():
    env: Any = battery()
    policy: Any = make_policy("learned", env)
    shown = {name: values[None] for name, values in env.reset(seed=2)[0].items()}
    assert shown["machine"][0, -1] == 1.0
    spent = {**shown, "machine": shown["machine"] * np.array([1, 1, 1, 1, 1, 1, 1, 0.3], np.float32)}
    assert (policy.logits(spent) != policy.logits(shown)).any()
