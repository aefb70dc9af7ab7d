"""As fast as you like down to a demanded share of the weeds."""

import math
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.agents import make_policy
from fieldgym.agents.rollout import begin, decisions
from fieldgym.benchmark import rates, tables
from fieldgym.benchmark.episode import run_episode
from fieldgym.benchmark.suites import Case, Condition, Episode
from fieldgym.envs.weeding.rules import counted_kills

SPEED = "fieldgym/LaserWeedingSpeed-v0"


def played(seed: int, **settings: Any) -> tuple[dict[str, float], dict[str, float], Any]:
    """Sums of the reward's terms and the scorecard of an episode."""
    env: Any = gym.make(SPEED, backend="analytic", perception="perfect", **settings)
    observation, _ = begin(env, seed)
    terms: dict[str, float] = {}
    info: dict[str, Any] = {}
    for decision in decisions(env, make_policy("hold-backlog-0.65", env, seed=0), observation):
        info = decision.info
        for name, value in info["rewards"].items():
            terms[name] = terms.get(name, 0.0) + float(value)
    return terms, dict(info["scorecard"]), env.unwrapped.core


def test_kills_beyond_the_demand_are_worth_nothing():
    terms, card, core = played(3, scenario="demand-0.90")
    plain, plain_card, _ = played(3, scenario="load-1.25")
    enough = math.ceil(0.9 * card["weeds"])
    assert card["done"] > enough  # or the test would tell nothing
    assert terms["killed"] == enough and plain["killed"] == plain_card["done"] == card["done"]
    assert {name: terms[name] for name in ("crop", "time", "energy")} == {
        name: plain[name] for name in ("crop", "time", "energy")
    }
    tables_ = core.tables
    assert counted_kills(tables_, 100.0, 91.0, 3.0) == 2.0  # the 89th and 90th count, the 91st does not
    assert counted_kills(tables_, 100.0, 95.0, 2.0) == 0.0
    assert counted_kills(tables_, 100.0, 50.0, 2.0) == 2.0
    assert counted_kills(tables_, 101.0, 91.0, 1.0) == 1.0  # 90.9 are met by the 91st


def test_only_a_chosen_speed_knows_demands():
    with pytest.raises(ValueError, match=r"scenario = 'demand-0.90' is unknown"):
        gym.make("fieldgym/LaserWeeding-v0", backend="analytic", scenario="demand-0.90")


def test_a_field_that_misses_the_demand_counts_as_no_work():
    where = Condition(SPEED, "demand-0.90", "analytic", "perfect")
    records = [
        run_episode(Episode(where, policy, seed)) for policy in ("hold-backlog-0.65", "constant-1.5") for seed in (3, 4)
    ]
    for record in records:
        derived, card = rates.derived(record), record["scorecard"]
        met = card["net_rate"] >= 0.9
        assert met == (record["policy"] == "hold-backlog-0.65")
        assert (derived[rates.MET], derived[rates.ACCEPTED]) == ((1.0, card["ha_per_h"]) if met else (0.0, 0.0))
    case = Case(where, ("hold-backlog-0.65", "constant-1.5"), "hold-backlog-0.65", (3, 4))
    slow, fast = tables.summarise(records, [case])
    shown = {column.title: column.cell(fast)[0] for column in tables.field_columns([slow, fast])}
    assert shown["demand met, %"] == "0.0" and shown["ha/h where met"] == "0.0000"
    assert np.isclose(slow.scores[rates.ACCEPTED].value, slow.scores["ha_per_h"].value)
