"""Policies that ship score what their cards say, to the digits that a card has."""

import json
from pathlib import Path
from typing import Any

import pytest

import fieldgym
from fieldgym.agents import make_policy, policy_names
from fieldgym.agents.evaluation import Scores, evaluate
from fieldgym.agents.learning import portable
from fieldgym.agents.policies.weights import LEARNED
from fieldgym.benchmark.suites import suite
from fieldgym.envs import env_ids, task

SHIPPED = sorted((Path(fieldgym.__file__).parent / "assets" / "policies").glob("*.npz"))
SCORES = {
    "HoeWeeding-v0.load-1.25": (67.07395807800523, 0.5826908693567006, 1.5055518194629638),
    "LaserWeeding-v0.battery": (55.02588621570891, 0.48516595680630653, 1.3585939464423995),
    "LaserWeeding-v0.load-1.25": (76.31673076839317, 0.6712503985048806, 1.0137026503916176),
    "LaserWeeding-v0.worth": (74.3537779994327, 0.637021228733625, 1.0956854371266964),
    "LaserWeedingSpeed-v0.load-1.25": (81.8850316825777, 0.7307114971401376, 1.0702163302988708),
    "ProduceSorting-v0.load-1.25": (30.785250000000005, 0.6515931892850741, 2.080443259422796),
    "ProduceSorting-v0.orders": (22.766350000000003, 0.6707709966527529, 2.53086935615819),
    "SafflowerPicking-v0.bag": (3.78419731120473, 0.4998460852308365, 21.972447277049934),
    "SafflowerPicking-v0.pots": (8.070930070274063, 0.9623062201279646, 18.647608478249982),
    "SafflowerPicking-v0.row": (7.88738343595943, 0.46227677030828684, 16.287555478812553),
    "TrayTransplanting-v0.fill": (99.811355261131, 0.9806944444444443, 1.4050348515716238),
    "TrayTransplanting-v0.orders": (79.1600158443087, 0.7240000000000001, 1.6896874477821786),
}
"""Mean return, net rate and cycle time in seconds, on the seeds of the card's scores."""
SINCE: dict[str, float] = {}
"""By how much a policy's return differs from what its card says, where it has moved since the card was written."""
DIGITS = 1e-6
"""Means in a card have six digits."""


def card_of(path: Path) -> dict[str, Any]:
    return json.loads(path.with_suffix(".json").read_text("utf-8"))


def played(path: Path, first: int, last: int) -> Scores:
    """Of the policy of a file, from one seed to another, both included."""
    card = card_of(path)

    def learned(env: Any) -> Any:
        policy: Any = make_policy(LEARNED, env)
        assert policy.card == card
        return policy

    settings = {"scenario": card["scenario"], "overrides": card.get("changes", {})}
    return evaluate(learned, card["env_id"], range(first, last + 1), **settings)


def test_every_environment_ships_a_policy():
    assert {card_of(path)["env_id"] for path in SHIPPED} == set(env_ids())


def test_the_leaderboard_s_suite_plays_every_policy_that_ships_for_one_of_its_scenarios():
    played_in = {
        (case.condition.env_id, case.condition.scenario)
        for case in suite("full").cases
        if LEARNED in case.policies and case.condition.backend == "analytic"
    }
    shown = {(spec.id, scenario) for spec in map(task, env_ids()) for scenario in (spec.headline, *spec.ordering)}
    assert {(card_of(path)["env_id"], card_of(path)["scenario"]) for path in SHIPPED} & shown == played_in


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_card_says_how_its_policy_was_made(path):
    card = card_of(path)
    assert path.stat().st_size < 2_000_000 and path.name == f"{card['env_id'].split('/')[-1]}.{card['scenario']}.npz"
    assert portable.shipped(card["env_id"], card["scenario"]) == path and LEARNED in policy_names(card["env_id"])
    settings, last_steps = card["settings"], card["learning_curve"][-1]["steps"]
    interval = settings["evaluate_every"] * settings["num_envs"] * settings["n_steps"]
    assert card["seed"] >= 0 and card["decisions"] <= last_steps and settings["steps"] < last_steps + interval


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: path.stem)
def test_a_shipped_policy_scores_what_it_did_when_it_was_shipped(path):
    card = card_of(path)
    scores = played(path, *card["scores"]["seeds"])
    found = (scores.returns.mean(), *(scores.scorecard[name].mean() for name in ("net_rate", "cycle_time_s")))
    # The decisions are the same whichever way a processor multiplies matrices; sums may be rounded otherwise.
    assert found == pytest.approx(SCORES[path.stem], rel=1e-9)
    assert found[0] == pytest.approx(card["scores"]["return"][0] + SINCE.get(path.stem, 0.0), abs=DIGITS)
    if path.stem not in SINCE:
        first, last = card["check"]["seeds"]
        assert first == card["scores"]["seeds"][0]
        assert scores.returns[: last + 1 - first].mean() == pytest.approx(card["check"]["return"], rel=1e-9)
