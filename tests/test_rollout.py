"""The one loop in which policies decide, with an environment that is nothing but a count."""

import itertools
from typing import Any

import numpy as np
import pytest

from fieldgym.agents import rollout

ENDS = np.array([2, 4, 3])


class Counting:
    """Worlds that end after as many decisions as ``ENDS`` says; the reward is the number of the decision."""

    num_envs = len(ENDS)

    def reset(self, seed: Any, options: Any = None) -> tuple[dict[str, Any], dict[str, Any]]:
        self.asked, self.steps = (seed, options), 0
        return self.observation(), {}

    def observation(self) -> dict[str, Any]:
        return {"action_mask": np.ones((len(ENDS), 2), np.int8), "step": np.full(len(ENDS), self.steps)}

    def step(self, actions: np.ndarray) -> tuple[Any, ...]:
        self.steps += 1
        ended = self.steps % ENDS == 0  # a world that is over goes on and ends again
        return self.observation(), np.full(len(ENDS), float(self.steps)), ended, np.zeros_like(ended), {"n": self.steps}


class Single(Counting):
    """The first world alone."""

    def observation(self) -> dict[str, Any]:
        return {name: values[0] for name, values in super().observation().items()}

    def step(self, actions: Any) -> tuple[Any, ...]:
        observation, reward, ended, cut, info = super().step(actions)
        return observation, reward[0], ended[0], cut[0], info


class Remembering:
    """Remembers where it began anew and what it saw."""

    name = "remembering"

    def __init__(self) -> None:
        self.resets: list[list[bool]] = []
        self.saw: list[int] = []

    def reset(self, rows: np.ndarray) -> None:
        self.resets.append(rows.tolist())

    def act(self, observation: Any) -> np.ndarray:
        self.saw.append(int(observation["step"][0]))
        return np.arange(len(observation["step"]))


def test_a_batch_counts_each_world_until_its_end_and_no_further():
    env, policy = Counting(), Remembering()
    observation, _ = env.reset(seed=[1, 2, 3])
    played = list(rollout.batch_decisions(env, policy, observation))
    assert len(played) == ENDS.max()
    assert np.sum([step.under_way for step in played], axis=0).tolist() == ENDS.tolist()
    assert [np.flatnonzero(step.ending).tolist() for step in played] == [[], [0], [2], [1]]
    assert [int(step.observation["step"][0]) for step in played] == policy.saw == [0, 1, 2, 3]
    assert [step.info["n"] for step in played] == [1, 2, 3, 4]
    assert policy.resets == [[True] * 3]


def test_one_world_is_played_to_its_end_on_the_clock_that_is_asked_for():
    env, policy, ticks = Single(), Remembering(), itertools.count(step=3)
    observation, _ = env.reset(seed=1)
    played = list(rollout.decisions(env, policy, observation, lambda: float(next(ticks))))
    assert [(step.reward, step.thought_s, step.last) for step in played] == [(1.0, 3.0, False), (2.0, 3.0, True)]
    assert [int(step.observation["step"]) for step in played] == policy.saw == [0, 1]
    assert policy.resets == [[True]]


@pytest.mark.parametrize("play", [rollout.decisions, rollout.batch_decisions])
def test_what_never_ends_is_ended(play: Any, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(rollout, "MOST_DECISIONS", 1)
    env = Single() if play is rollout.decisions else Counting()
    observation, _ = env.reset(seed=1)
    with pytest.raises(RuntimeError, match="no end after 1 decisions"):
        list(play(env, Remembering(), observation))


def test_an_episode_begins_with_a_field_where_there_is_one():
    env = Counting()
    rollout.begin(env, 5)
    assert env.asked == (5, None)
    rollout.begin(env, 6, "a.csv")
    assert env.asked == (6, {"field": "a.csv"})
