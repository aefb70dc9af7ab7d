"""Thinking that counts: clocks go forward, nothing else moves."""

import pytest

from fieldgym.benchmark.episode import run_episode
from fieldgym.benchmark.suites import Condition, Episode
from fieldgym.benchmark.thinking import charged
from fieldgym.envs.columns import documented
from fieldgym.envs.safflower import state as safflower
from fieldgym.envs.sorting import columns as sorting
from fieldgym.envs.transplanting import columns as transplanting
from fieldgym.envs.weeding import state as weeding

POTS = Condition("fieldgym/SafflowerPicking-v0", "pots", "analytic", "model")


def test_thinking_goes_to_duration_cycle_and_rates_and_nowhere_else():
    record = run_episode(Episode(POTS, "fixed-order", 3))
    record = {**record, "decision_s": 30.0, "decision_before_last_s": 24.0}
    slow = charged(record)
    card, before = slow["scorecard"], record["scorecard"]
    assert card["duration_s"] == pytest.approx(before["duration_s"] + 30.0)
    assert card["cycle_time_s"] * card["done"] == pytest.approx(record["last_s"] + 24.0)
    assert card["throughput_per_min"] * card["duration_s"] == pytest.approx(60.0 * card["done"])
    assert card["grams_per_min"] * card["duration_s"] == pytest.approx(60.0 * card["collected_g"])
    assert card["phase_think_s"] == 30.0
    changed = {"duration_s", "cycle_time_s", "throughput_per_min", "grams_per_min", "phase_think_s"}
    assert {name for name in card if card[name] != before.get(name)} == changed
    assert slow["return"] == record["return"]
    assert slow["charged"] and "charged" not in record
    assert charged(slow) == slow


def test_an_episode_without_a_finished_target_has_no_cycle_to_charge():
    record = run_episode(Episode(POTS, "fixed-order", 3))
    idle = {**record, "last_s": 0.0, "scorecard": {**record["scorecard"], "cycle_time_s": 0.0, "done": 0.0}}
    assert charged(idle)["scorecard"]["cycle_time_s"] == 0.0


def test_failures_stay_as_they_are():
    record = {"policy": "fixed-order", "error": "broken"}
    assert charged(record) == record


SCORES = {
    "picker": (safflower.Scores,),
    "transplanter": (transplanting.Scores,),
    "sorter": (sorting.Scores,),
    "weeders": (weeding.Common, weeding.Own),
}


@pytest.mark.parametrize("columns", SCORES.values(), ids=SCORES)
def test_every_rate_and_every_time_a_target_is_charged(columns):
    told = {name: says for part in columns for name, says in documented(part).items()}
    rates = {name for name, says in told.items() if says.unit.endswith(("/s", "/min", "/h"))}
    cycles = {name for name, says in told.items() if says.unit == "s" and " / " in says.doc}
    assert "throughput_per_min" in rates and "cycle_time_s" in cycles
    assert ("ha_per_h" in rates) == (columns == SCORES["weeders"])
    # As long in thought as at work: of every rate a half is left, every time a target is twice as long.
    card = {name: 2.0 for name in told} | {"duration_s": 60.0}
    record = {"scorecard": card, "decision_s": 60.0, "decision_before_last_s": 40.0, "last_s": 40.0}
    found = {name: charged(record)["scorecard"][name] / value for name, value in card.items()}
    assert {name for name, ratio in found.items() if ratio == 0.5} == rates
    assert {name for name, ratio in found.items() if ratio == 2.0} == {*cycles, "duration_s"}
    assert all(ratio == 1.0 for name, ratio in found.items() if name not in {*rates, *cycles, "duration_s"})
