"""Results that were damaged or that somebody else wrote: each line is read or named, and none is believed unseen."""

import json
import os
import random
import warnings
from pathlib import Path
from typing import Any

import pytest
from made_up import Playing, bound, record, small_suite, write

from fieldgym.benchmark import runner, schema, store, tables
from fieldgym.benchmark.limits import violations
from fieldgym.benchmark.report import leaderboard, page, reader

pytestmark = pytest.mark.portable

GOOD = record("fixed-order", 3)
LIMIT = bound(3)


def without(values: dict[str, Any], name: str) -> dict[str, Any]:
    return {key: value for key, value in values.items() if key != name}


@pytest.mark.parametrize(
    ("line", "told"),
    [
        (without(GOOD, "scorecard"), "it has no scorecard"),
        ({**GOOD, "seed": "3"}, 'seed is "3", not a whole number from 0 on'),
        ({**GOOD, "seed": True}, "seed is true, not a whole number from 0 on"),
        ({**GOOD, "seed": -1}, "seed is -1, not"),
        ({**GOOD, "policy": ["a"]}, 'policy is ["a"], not text'),
        ({**GOOD, "policy": ""}, 'policy is "", not text'),
        ({**GOOD, "return": "0,87"}, 'return is "0,87", not a number'),
        ({**GOOD, "steps": 2.5}, "steps is 2.5, not"),
        ({**GOOD, "scorecard": {**GOOD["scorecard"], "net_rate": "0,87"}}, "scorecard is "),
        ({**GOOD, "scorecard": without(GOOD["scorecard"], "net_rate")}, "its scorecard has no net_rate"),
        ({**GOOD, "scorecard": without(GOOD["scorecard"], "duration_s")}, "its scorecard has no duration_s"),
        ({**GOOD, "scorecard": []}, "scorecard is [], not an object of numbers"),
        ({**GOOD, "return": float("nan")}, "NaN is no number"),
        ({**GOOD, "wall_s": float("inf")}, "Infinity is no number"),
        ({**GOOD, "env_id": "os.path: x"}, 'env_id is "os.path: x", not an id'),
        ({**GOOD, "changes": "x"}, 'changes is "x", not an object'),
        ({**GOOD, "field": "a.csv"}, "it has a field without its folder"),
        ({**GOOD, "fields": "fields"}, "it has a folder of fields without a field"),
        ({**GOOD, "scenario": "\ud800"}, "it is no UTF-8"),
        ({**GOOD, "curve": [None]}, "curve is [null], not a list of numbers"),
        (LIMIT, "it is a bound among episodes"),
        ([], "it is no object"),
        (b'{"seed": 1e999}', "1e999 is too large"),
        (b'{"seed": ' + b"9" * 5000 + b"}", "is too large"),
        (b"[" * 100_000, "it is nested too deeply"),
        (b'{"policy": "\xff"}', "it is no UTF-8"),
        (b"", "it is no JSON"),
    ],
)
def test_a_damaged_line_is_left_out_and_named(tmp_path: Path, line: Any, told: str):
    data = line if isinstance(line, bytes) else json.dumps(line).encode()
    (tmp_path / store.EPISODES).write_bytes(json.dumps(record("nearest", 3)).encode() + b"\n" + data + b"\n")
    with pytest.warns(UserWarning) as warned:
        assert [each["policy"] for each in store.read(tmp_path / store.EPISODES)] == ["nearest"]
    (message,) = (str(each.message) for each in warned)
    assert f"{store.EPISODES}, line 2 is left out: " in message and told in message and "\n" not in message


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ({**LIMIT, "bound": None}, "bound is null, not an object"),
        ({**LIMIT, "bound": without(LIMIT["bound"], "curve")}, "it has no curve"),
        ({**LIMIT, "bound": {**LIMIT["bound"], "curve": [[1.0]]}}, "curve is [[1.0]], not a list of pairs"),
        ({**LIMIT, "bound": {**LIMIT["bound"], "method": 3}}, "method is 3, not text"),
        (GOOD, "it is an episode among bounds"),
    ],
)
def test_a_damaged_bound_is_left_out_and_named(tmp_path: Path, line: Any, told: str):
    (tmp_path / store.BOUNDS).write_text(json.dumps(line) + "\n", "utf-8")
    with pytest.warns(UserWarning) as warned:
        assert store.read(tmp_path / store.BOUNDS) == []
    assert told in str(warned[0].message)


def test_a_record_that_comes_twice_counts_once_and_is_named(tmp_path: Path):
    folder = write(tmp_path / "r", [GOOD, {**GOOD, "wall_s": 9.0}, {**GOOD, "return": 99.0}, {**GOOD, "seed": 4}])
    with pytest.warns(UserWarning) as warned:
        records = store.read(folder / store.EPISODES)
    assert records == [GOOD, {**GOOD, "seed": 4}]
    assert [str(each.message).partition(", ")[2] for each in warned] == [
        "line 2 is left out: it repeats line 1",
        "line 3 is left out: it repeats line 1 with another result",
    ]


def test_a_whole_last_line_counts_without_its_line_break(tmp_path: Path):
    (tmp_path / store.EPISODES).write_text(json.dumps(GOOD), "utf-8")
    assert store.read(tmp_path / store.EPISODES) == [GOOD]


@pytest.mark.parametrize(
    "text", ["[]", "{", '{"suite": []}', '{"packages": []}', '{"packages": {"numpy": 1}}', "", "NaN"]
)
def test_a_damaged_manifest_stops_a_resume_in_one_line_and_is_left_out_of_the_page(tmp_path: Path, text: str):
    folder = write(tmp_path / "r", [record(name, seed) for name in ("fixed-order", "nearest") for seed in (1, 2)])
    (folder / store.MANIFEST).write_text(text, "utf-8")
    with pytest.raises(store.ResultsError, match=r"^cannot resume: .*manifest.json is damaged \(.*--out") as told:
        runner.run_suite(small_suite(), folder, resume=True, run=Playing())
    assert "\n" not in str(told.value)
    with pytest.warns(UserWarning, match=r"manifest\.json is left out"):
        study = reader.load(folder)
    assert study.sources[0].manifest == {} and len(study.chapters) == 1


ODD: tuple[Any, ...] = (
    None,
    "x",
    "0,87",
    "",
    [],
    {},
    [[]],
    {"a": 1},
    -1,
    0,
    2.5,
    1e99,
    -1e99,
    1e300,
    True,
    10**99,
    "a|`\n<b>",
)


def mutated(value: Any, rng: random.Random) -> Any:
    """The value with one of its parts, at any depth, gone or something else."""
    if isinstance(value, dict) and value and rng.random() < 0.9:
        name = rng.choice(list(value))
        if rng.random() < 0.15:
            return without(value, name)
        return {**value, name: mutated(value[name], rng)}
    if isinstance(value, list) and value and rng.random() < 0.7:
        place = rng.randrange(len(value))
        return [*value[:place], mutated(value[place], rng), *value[place + 1 :]]
    return rng.choice(ODD)


def survivors(folder: Path) -> None:
    """Whatever reads results gets through."""
    study = reader.load(folder)
    page.render(study, "fieldgym report")
    leaderboard.render(study, "fieldgym report")
    records, bounds = store.load(folder), store.read(folder / store.BOUNDS)
    rows = tables.summarise(records, [], bounds)
    tables.write(rows, folder)
    violations(records, bounds)


def test_of_results_with_a_part_changed_at_random_each_line_is_read_or_named(tmp_path: Path):
    rng = random.Random(0)
    episodes = [json.dumps(mutated(record(rng.choice(("fixed-order", "nearest")), seed), rng)) for seed in range(400)]
    bounds = [json.dumps(mutated(bound(seed), rng)) for seed in range(100)]
    for name, lines in ((store.EPISODES, episodes), (store.BOUNDS, bounds)):
        (tmp_path / name).write_text("".join(line + "\n" for line in lines), "utf-8")
    read = 0
    for line in episodes:
        try:
            schema.parsed(line.encode(), bounds=False)
            read += 1
        except ValueError as error:
            assert "\n" not in str(error) and len(str(error)) < 200
    assert 50 < read < 350
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        survivors(tmp_path)


def test_a_file_of_results_that_is_none_is_told(tmp_path: Path):
    os.mkfifo(tmp_path / store.EPISODES)
    with pytest.raises(store.ResultsError, match="no results in"):
        reader.load(tmp_path)
    with pytest.raises(OSError, match="it is a pipe, no file"):
        store.read(tmp_path / store.EPISODES)
