"""Policies that ship score what their cards say, to the digits that a card has."""

import json
from pathlib import Path
from typing import Any

import gymnasium as gym
import pytest

import fieldgym
from fieldgym.agents import make_policy, policy_names
from fieldgym.agents.evaluation import Scores, evaluate
from fieldgym.agents.learning import portable
from fieldgym.agents.policies.weights import LEARNED
from fieldgym.envs import env_ids

SHIPPED = sorted((Path(fieldgym.__file__).parent / "assets" / "policies").glob("*.npz"))
DIGITS = 5e-7
"""A card's means and their intervals have six digits."""


def card_of(path: Path) -> dict[str, Any]:
    return json.loads(path.with_suffix(".json").read_text("utf-8"))


def played(path: Path, first: int, last: int) -> Scores:
    """Of the policy of a file, from one seed to another, both included."""
    card = card_of(path)

    def learned(env: Any) -> Any:
        policy: Any = make_policy(LEARNED, env)
        assert policy.card == card
        return policy

    return evaluate(learned, card["env_id"], range(first, last + 1), scenario=card["scenario"])


def test_every_environment_ships_a_policy():
    assert {card_of(path)["env_id"] for path in SHIPPED} == set(env_ids())


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_card_says_how_its_policy_was_made(path):
    card = card_of(path)
    assert path.stat().st_size < 2_000_000 and path.name == f"{card['env_id'].split('/')[-1]}.{card['scenario']}.npz"
    assert portable.shipped(card["env_id"], card["scenario"]) == path and LEARNED in policy_names(card["env_id"])
    settings, last_steps = card["settings"], card["learning_curve"][-1]["steps"]
    interval = settings["evaluate_every"] * settings["num_envs"] * settings["n_steps"]
    assert card["seed"] >= 0 and card["decisions"] <= last_steps and settings["steps"] < last_steps + interval
    env: Any = gym.make(card["env_id"], backend="analytic", scenario=card["scenario"])
    assert card["task_numbers"] == portable.task_digest(env)


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_policy_returns_what_it_did_when_it_was_shipped(path):
    check = card_of(path)["check"]
    # A sum of some hundred rewards: processors that multiply matrices in another order round its last digits otherwise.
    assert played(path, *check["seeds"]).returns.mean() == pytest.approx(check["return"], rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_policy_scores_what_its_card_says(path):
    told = card_of(path)["scores"]
    scores = played(path, *told["seeds"])
    found = {"return": scores.returns.mean()}
    found |= {name: scores.scorecard[name].mean() for name in ("net_rate", "cycle_time_s")}
    assert found == {name: pytest.approx(told[name][0], abs=DIGITS) for name in found}
