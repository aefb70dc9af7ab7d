"""What policies are held against beside the reference, and what the tables say of their order and comparisons."""

from dataclasses import replace

import pytest
from test_benchmark_tables import POTS, record

from fieldgym.benchmark import ranking, tables
from fieldgym.benchmark.record import Record
from fieldgym.benchmark.statistics import Difference, compared
from fieldgym.benchmark.suites import Case, Condition
from fieldgym.benchmark.summary import HELD, comparisons

BELT = Condition("fieldgym/ProduceSorting-v0", "load-1.25", "analytic", "model")
BELT_CASES = (Case(BELT, ("fifo", "edf", "receding-horizon", "receding-horizon-value", "learned"), "fifo", ()),)


def versus(seeds: int = 40) -> list[Record]:
    """Two rules, two planners and a learned policy of sorting; the reference is a rule that is not the best one."""
    means = {"fifo": 1.0, "edf": 2.0, "receding-horizon": 4.0, "receding-horizon-value": 3.0, "learned": 3.5}
    rates = {"fifo": 0.5, "edf": 0.8, "receding-horizon": 0.7, "receding-horizon-value": 0.7, "learned": 0.9}
    cycles = {"fifo": 9.0, "edf": 9.5, "receding-horizon": 8.0, "receding-horizon-value": 8.0, "learned": 12.0}
    return [
        {**record(name, seed, rates[name], cycles[name], BELT), "return": mean + 0.3 * (seed * (1, 2, 3, 4, 6)[i] % 5)}
        for i, (name, mean) in enumerate(means.items())
        for seed in range(seeds)
    ]


def test_policies_are_held_against_the_best_rule_and_the_best_planner():
    found = {row.policy: row for row in tables.summarise(versus(), BELT_CASES)}
    assert {tuple(row.rivals.items()) for row in found.values()} == {(("rule", "edf"), ("planner", "receding-horizon"))}
    returns = {name: row.scores["return"].value for name, row in found.items()}
    learned = found["learned"]
    assert set(learned.over) == {"rule", "planner"} and set(learned.over["rule"]) == set(HELD)
    assert learned.over["rule"]["return"].value == pytest.approx(returns["learned"] - returns["edf"])
    assert learned.over["planner"]["cycle_time_s"].value == pytest.approx(4.0)
    assert set(found["edf"].over) == {"planner"} and set(found["receding-horizon"].over) == {"rule"}
    assert set(found["fifo"].wins) == {"rule", "planner"} and set(found["edf"].wins) == {"reference", "planner"}
    # Its mean is larger by 1.0, its luck smaller by up to 0.9: edf is ahead everywhere, learned of the planner on some.
    assert found["edf"].wins["reference"].value == 1.0
    lucks = [3.5 + 0.3 * (seed * 6 % 5) - 4.0 - 0.3 * (seed * 3 % 5) for seed in range(5)]
    assert learned.wins["planner"].value == pytest.approx(sum(luck > 0.0 for luck in lucks) / 5)
    guests = tables.summarise([*versus(), *[{**item, "policy": "a.py:B", "return": 9.0} for item in versus()[:40]]], ())
    assert guests[0].rivals == {"rule": "edf", "planner": "receding-horizon"}


def test_the_front_is_of_both_measures_and_another_order_is_told():
    rows = tables.summarise(versus(), BELT_CASES)
    assert {row.policy for row in rows if row.front} == {"receding-horizon", "receding-horizon-value", "edf", "learned"}
    told = ranking.told(rows)
    assert told[0] == "Return = 1 placed - 0.5 misplaced - 0.5 dropped - 0.05 wasted."
    assert told[1].endswith("is worth: receding-horizon, learned, receding-horizon-value, edf.")
    assert told[2].startswith(
        "By net rate the order is another than by return: learned 90.00, edf 80.00, receding-horizon"
    )
    assert told[3] == "By mean return on these fields, best rule: edf; best planner: receding-horizon."
    alike = [item for item in versus() if item["policy"] in ("fifo", "receding-horizon")]
    assert "By net rate the order is the same as by return." in ranking.told(tables.summarise(alike, BELT_CASES))
    text = tables.markdown(rows)
    assert all(f"- {line}" in text for line in told)


def test_weights_are_those_that_count():
    plain = Condition("fieldgym/LaserWeeding-v0", "load-1.25", "analytic", "model")
    assert "leaves" not in ranking.weights(plain) and ranking.weights(plain).startswith("1 killed - 5 crop - 0.05 ")
    assert ranking.weights(replace(plain, scenario="field")).endswith("- 1 leaves")
    assert ranking.weights(replace(plain, changes='{"weights.crop": 0.0}')).startswith("1 killed - 0.05 seconds")
    assert ranking.weights(POTS) == ""


def test_comparisons_of_a_condition_are_counted_once_and_held_together():
    rows = tables.summarise(versus(), BELT_CASES)
    pairs = comparisons(rows)
    # Four others with the reference; the best rule, edf, with three more, the best planner with two that are left.
    assert len(pairs) == 3 * (4 + 3 + 2)
    stands = {pair: item.stands for pair, item in compared(pairs).items()}
    assert 0 < sum(stands.values()) <= sum(item.significant for item in pairs.values())
    for row in rows:
        for other, of in ((row.reference, row.differences), *((row.rivals[kind], of) for kind, of in row.over.items())):
            assert all(item.stands == stands[frozenset({row.policy, other}), name] for name, item in of.items())
    weak = tables.Column("x", "return", 1.0, 1, "difference")
    row = replace(rows[1], differences={"return": Difference(1.0, 0.1, 2.0, 40, 0.03, 0.6)})
    assert weak.cell(row) == ("+1.0", "0.1 .. 2.0 Holm")
    note = ranking.told([replace(item, differences=row.differences, over={}) for item in rows[1:]])[-1]
    assert note == (
        "Of 4 comparisons 4 leave out 0 in their intervals, 0 after Holm's correction for all; "
        "the others are marked Holm."
    )
