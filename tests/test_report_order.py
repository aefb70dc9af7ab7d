"""Where the order of work matters the leaderboard has a table beside the headlines."""

from pathlib import Path

import numpy as np
from test_report import POTS, record, write

from fieldgym.benchmark.report import leaderboard, reader
from fieldgym.benchmark.suites import Condition

POLICIES = ("fixed-order", "bag-horizon", "nearest")


def test_the_leaderboard_shows_where_the_order_matters_by_return(tmp_path: Path):
    bag = Condition("fieldgym/SafflowerPicking-v0", "bag", "analytic", "model")
    records = [record(bag, policy, seed) for policy in POLICIES for seed in range(3)]
    found = reader.load(write(tmp_path / "bag", [*records, *(record(POTS, "fixed-order", seed) for seed in range(3))]))
    lines = leaderboard.render(found, "x").splitlines()
    told = lines[lines.index("## Where the order matters") :]
    assert told[2] == "Safflower picking, bag · analytic backend · model perception, 3 seeds:"
    [first] = [line for line in told if line.startswith("| 1 |")]
    means = [np.mean([each["return"] for each in records if each["policy"] == policy]) for policy in POLICIES]
    assert POLICIES[int(np.argmax(means))] in first and f"{max(means):.3f}" in first
    # What its order and its comparisons are worth is told under it, as under every table.
    assert [line for line in told if line.startswith("- By mean return")] == [
        f"- By mean return on these fields, best rule: fixed-order; best planner: {POLICIES[1]}."
    ]
    pots = reader.load(write(tmp_path / "pots", [record(POTS, "fixed-order", seed) for seed in range(3)]))
    assert "## Where the order matters" not in leaderboard.render(pots, "x").splitlines()
