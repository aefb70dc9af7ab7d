"""Bounds beside results: computed once, believed, and noticed when they are beaten."""

import json
from dataclasses import replace

import pytest

from fieldgym import bounds
from fieldgym.benchmark import limits, schema, store
from fieldgym.benchmark.episode import run_episode
from fieldgym.benchmark.record import Record, identity, untimed
from fieldgym.benchmark.runner import run_suite
from fieldgym.benchmark.suites import BOUND, Condition, Episode, suite

POTS = Condition("fieldgym/SafflowerPicking-v0", "pots", "analytic", "model")


def result(net_rate: float, episode_return: float, cycle_time_s: float | None, done: float = 3.0) -> Record:
    card = {"net_rate": net_rate, "cycle_time_s": cycle_time_s, "done": done}
    return {**identity(Episode(POTS, "swift", 3)), "return": episode_return, "scorecard": card}


@pytest.fixture
def bound() -> Record:
    values = {"net_rate": 0.9, "episode_return": 7.0, "curve": [[0.0, 10.0], [0.5, 12.0], [0.9, 20.0]]}
    return {**identity(Episode(POTS, BOUND, 3)), "bound": values}


def test_a_bound_is_a_record_that_repeats_and_says_how_it_was_found():
    episode = Episode(POTS, BOUND, 3)
    record = run_episode(episode)
    assert "error" not in record
    assert json.loads(json.dumps(record, allow_nan=False)) == record
    assert untimed(record) == untimed(run_episode(episode))
    found = bounds.instance(POTS.env_id, 3, scenario="pots", perception="model").bound()
    told = record["bound"]
    assert (told["net_rate"], told["episode_return"]) == (found.net_rate, found.episode_return)
    assert (told["cycle_time_s"], told["proven"], told["method"]) == (found.cycle_time_s, found.proven, found.method)
    assert found.found is not None and told["found"]["net_rate"] == found.found.net_rate <= found.net_rate + 1e-9
    assert told["found"]["episode_return"] == found.found.episode_return <= found.episode_return + 1e-9
    with pytest.raises(ValueError, match="episode_return"):
        cut = {**record, "bound": {**told, "found": {"net_rate": 0.5}}}
        schema.parsed(json.dumps(cut).encode(), bounds=True)
    rates, cycles = zip(*told["curve"], strict=True)
    assert list(rates) == sorted(rates) and list(cycles) == sorted(cycles)
    assert 0.99 * told["cycle_time_s"] <= cycles[-1] <= told["cycle_time_s"]


def test_a_result_at_its_bound_is_none_that_beats_it(bound: Record):
    assert (
        limits.violations([result(0.9, 7.0, 20.0), result(0.7, -1.0, 12.0), result(0.0, 0.0, None, 0.0)], [bound]) == []
    )
    rounded = result(0.9 + 1e-10, 7.0 * (1.0 + 1e-10), 20.0 - 1e-9)
    assert limits.violations([rounded], [bound]) == []


@pytest.mark.parametrize(
    ("record", "what"),
    [
        (result(0.9001, 7.0, 20.0), "net rate 0.9001 beats its bound 0.9"),
        (result(0.9, 7.001, 20.0), "return 7.001 beats its bound 7"),
        (result(0.9, 7.0, 19.9), "cycle time, negative, -19.9 beats its bound -20"),
        (result(0.6, 7.0, 11.9), "cycle time, negative, -11.9 beats its bound -12"),
    ],
)
def test_what_beats_its_bound_is_told(bound: Record, record: Record, what: str):
    told = limits.violations([record], [bound])
    assert len(told) == 1
    assert what in told[0] and "swift, seed 3" in told[0]


def test_nothing_is_asked_where_no_bound_is_known(bound: Record):
    other = {**result(2.0, 99.0, 0.0), "seed": 4}
    assert limits.violations([other, {**identity(Episode(POTS, "swift", 3)), "error": "broken"}], [bound]) == []
    assert limits.violations([result(2.0, 99.0, 0.0)], [{**identity(Episode(POTS, BOUND, 3)), "error": "broken"}]) == []


@pytest.mark.slow
@pytest.mark.parametrize(
    "env_id", [pytest.param(own, marks=[pytest.mark.long] * ("Weeding" in own)) for own in bounds.bounded_ids()]
)
def test_no_result_of_the_full_suite_s_first_seeds_beats_its_bound(env_id: str, tmp_path):
    whole = suite("full").narrowed(env_id=env_id, episodes=1, backend="analytic")
    # Cameras may report anything, and a demand counts otherwise: they have no bound.
    tiny = replace(whole, cases=tuple(case for case in whole.cases if case.bounds))
    report = run_suite(tiny, tmp_path)
    assert report.failures == [] and report.violations == []
    assert len(report.bounds) == len(tiny.cases)
    assert len(report.records) == sum(len(case.policies) for case in tiny.cases)
    loaded = store.load(tmp_path)
    assert all(record["bound"]["net_rate"] >= record["scorecard"]["net_rate"] - 1e-9 for record in loaded)
    # The same check does tell when something is wrong.
    cheating = [{**record, "return": record["return"] + 1e6} for record in report.records]
    assert len(limits.violations(cheating, report.bounds)) == len(cheating)
