"""Cameras by what they are shown and what looks at it, beside perfect perception, in the leaderboard."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from fieldgym.benchmark.record import Record
from fieldgym.benchmark.report import leaderboard, reader
from fieldgym.benchmark.store import EPISODES
from fieldgym.benchmark.suites import Condition, changes_of

MODEL = Condition("fieldgym/LaserWeeding-v0", "load-1.25", "analytic", "model")
PERFECT, SEEN = replace(MODEL, perception="perfect"), replace(MODEL, perception="camera")
EASY = replace(SEEN, changes=changes_of({"pictures": "easy"}))
RATES = {MODEL: 0.5, PERFECT: 0.9, SEEN: 0.6, EASY: 0.8}


def record(where: Condition, seed: int) -> Record:
    rate = RATES[where] + 0.01 * np.random.default_rng([seed, len(where.perception)]).random()
    found = {name: value for name, value in vars(where).items() if value} | {"policy": "fifo", "seed": seed}
    card = {"net_rate": rate, "cycle_time_s": 1.0, "duration_s": 100.0, "done": 50.0}
    return {
        **found,
        **({"changes": where.numbers} if where.changes else {}),
        "return": 60.0 * rate,
        "rewards": {},
        "steps": 6,
        "terminated": True,
        "scorecard": card,
        "wall_s": 0.1,
        "decision_s": 0.01,
    }


def test_cameras_stand_beside_perfect_perception_by_what_they_are_shown(tmp_path: Path):
    records = {where: [record(where, seed) for seed in range(6)] for where in RATES}
    text = "".join(json.dumps(each) + "\n" for some in records.values() for each in some)
    (tmp_path / EPISODES).write_text(text, "utf-8")
    study = reader.load(tmp_path)
    [item] = study.chapters
    assert item.seen is not None and (item.seen.first, item.seen.second) == (MODEL, SEEN)
    assert [(each.first, each.second, each.pairs) for each in item.sights] == [(PERFECT, SEEN, 6), (PERFECT, EASY, 6)]
    lines = leaderboard.render(study, "x").splitlines()
    table = lines[lines.index("## Pictures and eyes") :]
    assert [line for line in table if line.startswith("| pictures | policy | seeds |")]
    for kind, where in (("field", SEEN), ("easy", EASY)):
        [line] = [line for line in table if line.startswith(f"| {kind} | fifo | 6 |")]
        rates = np.array([[each["scorecard"]["net_rate"] for each in records[of]] for of in (PERFECT, where)])
        cells = [cell.strip() for cell in line.split("|")]
        assert float(cells[4]) == pytest.approx(100.0 * rates[1].mean(), abs=0.006)
        assert float(cells[5].split("<br>")[0]) == pytest.approx(100.0 * (rates[1] - rates[0]).mean(), abs=0.006)
