"""One episode as a record: what it holds, that it repeats, and what becomes of an error."""

import json

import numpy as np
import pytest

from fieldgym import agents
from fieldgym.agents.policy import StatelessPolicy
from fieldgym.benchmark import episode as episodes
from fieldgym.benchmark.suites import Condition, Episode

POTS = Condition("fieldgym/SafflowerPicking-v0", "pots", "analytic", "perfect")
TIMINGS = ("wall_s", "decision_s")


def untimed(record: episodes.Record) -> episodes.Record:
    return {name: value for name, value in record.items() if name not in TIMINGS}


def test_a_record_is_complete_plain_json_and_repeats():
    record = episodes.run_episode(Episode(POTS, "fixed-order", 3))
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert untimed(record) == untimed(episodes.run_episode(Episode(POTS, "fixed-order", 3)))
    assert (record["policy"], record["seed"], record["terminated"]) == ("fixed-order", 3, True)
    assert record["return"] == pytest.approx(sum(record["rewards"].values()))
    assert record["scorecard"]["done"] > 0
    assert 0.0 < record["decision_s"] < record["wall_s"]


def test_the_record_agrees_with_an_episode_played_by_hand():
    import gymnasium as gym

    env = gym.make(POTS.env_id, scenario="pots", backend="analytic", perception="perfect")
    policy = agents.make_policy("nearest", env)
    observation, info = env.reset(seed=7)
    policy.reset(np.ones(1, bool))
    total, steps, over = 0.0, 0, False
    while not over:
        observation, reward, terminated, truncated, info = env.step(agents.act_single(policy, observation))
        total, steps, over = total + float(reward), steps + 1, terminated or truncated
    record = episodes.run_episode(Episode(POTS, "nearest", 7))
    assert (record["return"], record["steps"]) == (pytest.approx(total), steps)
    assert record["scorecard"] == episodes.plain(info["scorecard"])


def test_the_policy_does_not_draw_the_environment_s_numbers(monkeypatch: pytest.MonkeyPatch):
    seeds = []
    make = agents.make_policy
    monkeypatch.setattr(agents, "make_policy", lambda name, env, seed: seeds.append(seed) or make(name, env, seed=seed))
    episodes.run_episode(Episode(POTS, "random", 5))
    assert seeds == [episodes.POLICY_SEEDS + 5]


class Stubborn(StatelessPolicy):
    """Cannot decide."""

    name = "stubborn"

    def act(self, observation):
        raise ArithmeticError("two\nlines")


@pytest.mark.parametrize(
    ("episode", "reason"),
    [
        (Episode(Condition("fieldgym/Nothing-v0", "pots", "analytic", "model"), "random", 0), "Nothing"),
        (Episode(Condition(POTS.env_id, "moon", "analytic", "model"), "random", 0), "moon"),
        (Episode(POTS, "furthest", 0), "furthest"),
    ],
)
def test_an_error_becomes_the_record(episode: Episode, reason: str):
    record = episodes.run_episode(episode)
    assert reason in record["error"]
    assert "return" not in record
    assert {**record, "error": ""} == {**episodes.identity(episode), "error": ""}


def test_an_error_of_a_policy_is_one_line(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(agents, "make_policy", lambda name, env, seed: Stubborn())
    assert episodes.run_episode(Episode(POTS, "random", 0))["error"] == "ArithmeticError: two lines"


def test_an_endless_episode_is_ended(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(episodes, "MAX_STEPS", 3)
    assert "no end after 3 decisions" in episodes.run_episode(Episode(POTS, "fixed-order", 0))["error"]


def test_a_cancelled_episode_leaves_no_record():
    with pytest.raises(episodes.EpisodeCancelledError):
        episodes.run_episode(Episode(POTS, "fixed-order", 0), cancelled=lambda: True)


def test_numbers_that_json_does_not_know_become_null():
    assert episodes.plain({"a": np.float64(1.5), "b": np.nan, "c": np.inf}) == {"a": 1.5, "b": None, "c": None}
