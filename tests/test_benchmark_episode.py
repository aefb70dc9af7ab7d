"""One episode as a record: what it holds, that it repeats, and what becomes of an error."""

import json
import time

import numpy as np
import pytest

from fieldgym import agents
from fieldgym.agents import rollout
from fieldgym.agents.policies.base import StatelessPolicy
from fieldgym.benchmark import episode as episodes
from fieldgym.benchmark.record import TIMINGS, digest, identity, plain, untimed
from fieldgym.benchmark.suites import Condition, Episode
from fieldgym.kernels.seeds import POLICY_SEEDS

POTS = Condition("fieldgym/SafflowerPicking-v0", "pots", "analytic", "perfect")


def test_a_record_is_complete_plain_json_and_repeats():
    record = episodes.run_episode(Episode(POTS, "fixed-order", 3))
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert untimed(record) == untimed(episodes.run_episode(Episode(POTS, "fixed-order", 3)))
    assert (record["policy"], record["seed"], record["terminated"]) == ("fixed-order", 3, True)
    assert record["return"] == pytest.approx(sum(record["rewards"].values()))
    assert record["scorecard"]["done"] > 0
    assert 0.0 < record["decision_before_last_s"] <= record["decision_s"] < record["wall_s"]
    assert record["decision_s"] / record["steps"] < 0.001 * record["decision_p95_ms"] * 3.0
    assert record["last_s"] == pytest.approx(record["scorecard"]["cycle_time_s"] * record["scorecard"]["done"])
    assert record["curve"][-1] == pytest.approx(record["scorecard"]["net_rate"], abs=1e-4)
    assert "timeline" not in record


def test_clocks_do_not_count_in_the_digest_and_nothing_else_is_left_out():
    record = episodes.run_episode(Episode(POTS, "nearest", 4))
    later = {**record, **dict.fromkeys(TIMINGS, 9.0)}
    assert digest([record, {**record, "seed": 5}]) == digest([{**later, "seed": 5}, later])
    assert digest([record]) != digest([{**record, "last_s": record["last_s"] + 1e-12 * record["last_s"] * 1e4}])
    with pytest.raises(ValueError, match="not deterministic"):
        digest([{**record, "charged": True}])


def test_a_timeline_tells_every_second_of_the_episode():
    record = episodes.run_episode(Episode(POTS, "fixed-order", 3, timeline=True))
    timeline = record["timeline"]
    assert len(timeline["words"]) == len(timeline["seconds"]) == record["steps"]
    assert any("pick slot" in words for words in timeline["words"])
    told_s = timeline["began_s"] + sum(map(sum, timeline["seconds"]))
    assert told_s == pytest.approx(record["scorecard"]["duration_s"], abs=0.001 * record["steps"])
    assert set(timeline["phases"]) == {name[6:-2] for name in record["scorecard"] if name.startswith("phase_")}


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
    assert record["scorecard"] == plain(info["scorecard"])


def test_the_policy_does_not_draw_the_environment_s_numbers(monkeypatch: pytest.MonkeyPatch):
    seeds = []
    make = agents.make_policy
    monkeypatch.setattr(agents, "make_policy", lambda name, env, seed: seeds.append(seed) or make(name, env, seed=seed))
    episodes.run_episode(Episode(POTS, "random", 5))
    assert seeds == [POLICY_SEEDS + 5] * 2


class Slow(StatelessPolicy):
    """Takes a while for its first decision, as what has to be loaded or compiled does."""

    name = "slow"
    decisions = 0

    def act(self, observation):
        if Slow.decisions == 0:
            began = time.thread_time()
            while time.thread_time() < began + 0.2:
                pass
        Slow.decisions += 1
        return np.array([len(observation["action_mask"][0]) - 1])


def test_what_is_loaded_at_the_first_decision_is_no_thinking(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(agents, "make_policy", lambda name, env, seed: Slow())
    record = episodes.run_episode(Episode(POTS, "random", 5))
    assert Slow.decisions == record["steps"] + 1
    assert record["decision_s"] < 0.2 < record["wall_s"]


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
    assert {**record, "error": ""} == {**identity(episode), "error": ""}


def test_an_error_of_a_policy_is_one_line(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(agents, "make_policy", lambda name, env, seed: Stubborn())
    assert episodes.run_episode(Episode(POTS, "random", 0))["error"] == "ArithmeticError: two lines"


def test_an_endless_episode_is_ended(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(rollout, "MOST_DECISIONS", 3)
    assert "no end after 3 decisions" in episodes.run_episode(Episode(POTS, "fixed-order", 0))["error"]


def test_a_cancelled_episode_leaves_no_record():
    with pytest.raises(episodes.EpisodeCancelledError):
        episodes.run_episode(Episode(POTS, "fixed-order", 0), cancelled=lambda: True)


def test_numbers_that_json_does_not_know_become_null():
    assert plain({"a": np.float64(1.5), "b": np.nan, "c": np.inf}) == {"a": 1.5, "b": None, "c": None}
