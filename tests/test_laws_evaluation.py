"""What an evaluation counts, by hand: each episode up to its end; a policy's chance is its own, not the field's."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.agents import make_policy
from fieldgym.agents.evaluation import evaluate, mean
from fieldgym.agents.sources import policy_source
from fieldgym.benchmark import episode
from fieldgym.envs import env_ids

PICKER = "fieldgym/SafflowerPicking-v0"


def toy_settings() -> dict[str, Any]:
    return {"scenario": "pots", "overrides": {"scenario.plants": 2, "scenario.max_heads": 2}}


def by_hand(seed: int) -> tuple[float, int, dict[str, float]]:
    """Return, decisions and scorecard of one episode, added up up to its end."""
    env: Any = gym.make(PICKER, backend="analytic", perception="model", **toy_settings())
    policy = make_policy("nearest", env)
    observation, _ = env.reset(seed=seed)
    total, steps, over, info = 0.0, 0, False, {}
    while not over:
        action = int(policy.act({name: values[None] for name, values in observation.items()})[0])
        observation, reward, terminated, truncated, info = env.step(action)
        total, steps, over = total + float(reward), steps + 1, terminated or truncated
    env.close()
    return total, steps, dict(info["scorecard"])


def test_worlds_that_are_over_earn_nothing_more():
    """Episodes of different length in a batch: each is what it is alone."""
    seeds = [3, 4, 5, 6, 7, 8]
    scores = evaluate(lambda env: make_policy("nearest", env), PICKER, seeds, perception="model", **toy_settings())
    alone = [by_hand(seed) for seed in seeds]
    assert scores.seeds.tolist() == seeds
    assert scores.returns == pytest.approx([total for total, _, _ in alone], rel=1e-12)
    assert scores.decisions.tolist() == [steps for _, steps, _ in alone]
    assert len(set(scores.decisions.tolist())) > 1
    for name, values in scores.scorecard.items():
        assert values == pytest.approx([card[name] for _, _, card in alone], rel=1e-12), name


def test_a_mean_is_of_what_is_finite():
    assert mean(np.array([1.0, np.nan, 3.0, np.inf])) == 2.0
    assert np.isnan(mean(np.array([np.nan]))) and np.isnan(mean(np.zeros(0)))


@pytest.mark.parametrize("env_id", env_ids())
def test_a_policy_s_chance_is_not_the_field_s(env_id):
    """With equal seeds, chance would draw the numbers that the field is made of: the benchmark keeps them apart."""
    made: list[int] = []

    class Source:
        """Stands in for a policy's; remembers the seed that it is made with."""

        def make(self, env: Any, seed: int) -> Any:
            made.append(seed)
            return make_policy("random", env, seed)

    seeds = [0, 1, 100_000, 100_199]
    for seed in seeds:
        asked = episode.Episode(None, "random", seed, source=Source())  # type: ignore[arg-type]
        episode._policy(asked, gym.make(env_id, backend="analytic"))
    assert all(policy != seed for policy, seed in zip(made, seeds, strict=True)) and len(set(made)) == len(seeds)
    assert not set(made) & set(range(200_000))
    assert policy_source(env_id, "random", False) is not None


class Earning:
    """Worlds that end after as many decisions as their seeds say, and go on earning: 1 a decision."""

    score_names = ("net_rate",)

    def __init__(self, worlds: int):
        self.num_envs, self.steps, self.core, self.ends = worlds, 0, self, np.zeros(worlds)
        self.unwrapped = self

    def reset(self, seed: Any, options: Any) -> tuple[dict[str, Any], dict[str, Any]]:
        self.ends = np.array(seed)
        return {"action_mask": np.ones((self.num_envs, 1), np.int8)}, {}

    def step(self, actions: Any) -> tuple[Any, ...]:
        self.steps += 1
        ended, rate = self.steps == self.ends, np.full(self.num_envs, 0.1 * self.steps)
        seen = {"action_mask": np.ones((self.num_envs, 1), np.int8)}
        return seen, np.ones(self.num_envs), ended, np.zeros_like(ended), {"scorecard": {"net_rate": rate}}

    def close(self) -> None:
        """Nothing to close."""


def test_what_worlds_earn_behind_their_end_is_not_counted(monkeypatch):
    monkeypatch.setattr(gym, "make_vec", lambda env_id, worlds, **settings: Earning(worlds))
    scores = evaluate(
        lambda env: make_policy("random", gym.make(PICKER, backend="analytic"), 1),
        PICKER,
        [2, 5, 3],
        perception="model",
    )
    assert scores.returns.tolist() == [2.0, 5.0, 3.0] and scores.decisions.tolist() == [2, 5, 3]
    assert scores.scorecard["net_rate"] == pytest.approx([0.2, 0.5, 0.3])
