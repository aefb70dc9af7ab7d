"""Benchmarks of what users bring: policies in files and modules, tasks, scenarios, numbers and fields of their own."""

import json
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from typer.testing import CliRunner

from fieldgym.agents import evaluation, make_policy
from fieldgym.benchmark import exports, runner, store, tables
from fieldgym.benchmark.fields import FieldsError, field_files
from fieldgym.benchmark.record import condition, identity, key, states
from fieldgym.benchmark.report import page, reader
from fieldgym.benchmark.suites import BOUND, Condition, Episode, Suite, changes_of, suite, usable_tasks
from fieldgym.benchmark.summary import is_learned
from fieldgym.envs import TaskSpec, env_ids, task
from fieldgym.envs.field_files import write_field
from fieldgym.envs.task import _POLICIES, _TASKS
from fieldgym.scripts import cli

ROOT = Path(__file__).resolve().parents[1]
ENV = "fieldgym/SafflowerPicking-v0"
MINE = "class Mine:\n    def act(self, observation):\n        return observation['action_mask'].argmax(axis=1)\n"
LAST = MINE.replace("argmax(axis=1)", "shape[1] - 1 - observation['action_mask'][:, ::-1].argmax(axis=1)")


def wanted(policies: list[str], episodes: int = 2) -> Suite:
    return suite("quick", [ENV]).narrowed(None, policies, episodes, "analytic").traced()


def run(chosen: Suite, folder: Path, resume: bool = False) -> tuple[runner.RunResult, list[tuple[str, Any]]]:
    """The report, and which episodes were run."""
    ran: list[tuple[str, Any]] = []
    report = runner.run_suite(
        chosen, folder, resume=resume, on_record=lambda record: ran.append((record["policy"], record["seed"]))
    )
    return report, ran


def drawn(folder: Path, seeds: range) -> Path:
    """A folder of field files."""
    folder.mkdir()
    env: Any = gym.make(ENV, backend="analytic", perception="model")
    for seed in seeds:
        env.reset(seed=seed)
        write_field(env.unwrapped.field, folder / f"plants-{seed}.csv")
    env.close()
    return folder


def command(*words: str, folder: Path | None = None) -> list[dict[str, Any]]:
    """Records that ``fieldgym benchmark`` leaves."""
    result = CliRunner().invoke(cli.app, ["benchmark", *words])
    assert result.exit_code == 0, f"{result.output} {result.exception!r}"
    return [json.loads(line) for line in (folder / "quick" / "episodes.jsonl").read_text().splitlines()]  # type: ignore


def test_a_changed_policy_file_runs_again_on_resume_and_nothing_else_does(tmp_path: Path):
    path = tmp_path / "mine.py"
    path.write_text(MINE)
    name, out = f"{path}:Mine", tmp_path / "out"
    first, ran = run(wanted(["fixed-order", name]), out)
    assert len(ran) == 4 and first.failures == []
    before = {record["policy"]: record.get("source", "") for record in first.records}
    assert before["fixed-order"] == "" and len(before[name]) == 16
    assert json.loads((out / store.MANIFEST).read_text())["sources"] == {name: before[name]}
    assert run(wanted(["fixed-order", name]), out, resume=True)[1] == []
    path.write_text(LAST)
    again, ran = run(wanted(["fixed-order", name], 1), out, resume=True)
    assert ran == [(name, 0)]
    assert again.outdated == 2
    records = store.read(out / store.EPISODES)
    assert sorted((record["policy"], record["seed"]) for record in records) == sorted(
        [("fixed-order", 0), ("fixed-order", 1), (name, 0)]
    )
    assert {record.get("source", "") for record in records if record["policy"] == name} != {before[name]}


def test_a_file_that_changes_while_the_benchmark_runs_is_told(tmp_path: Path):
    path = tmp_path / "mine.py"
    path.write_text(MINE)
    chosen = wanted([f"{path}:Mine"], 2)
    path.write_text(LAST)
    report, _ = run(chosen, tmp_path / "out")
    assert [record["error"].partition(": ")[2] for record in report.failures] == [
        f"policy '{path}:Mine' has changed since it was named: begin again"
    ] * 2


def test_a_policy_of_one_s_own_stands_in_table_differences_and_page(tmp_path: Path):
    path = tmp_path / "mine.py"
    path.write_text(MINE)
    name = f"{path}:Mine"
    chosen = wanted(["fixed-order", name], 2)
    report, _ = run(chosen, tmp_path / "out")
    rows = {row.policy: row for row in tables.summarise(report.records, chosen.cases)}
    assert list(rows) == ["fixed-order", name]
    assert rows[name].differences["return"].n == 2
    assert f"{name},fixed-order,return," in exports.comma_separated(list(rows.values()))
    html = page.render(reader.load(tmp_path / "out"), "fieldgym report")
    assert name in html


def test_a_registered_stranger_s_code_is_told_apart_too(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.syspath_prepend(str(tmp_path))
    (tmp_path / "registered_stranger.py").write_text(MINE)
    monkeypatch.setitem(_POLICIES, ENV, {"stranger": "registered_stranger:Mine"})
    (case,) = wanted(["fixed-order", "stranger"], 1).cases
    assert [(source.name, len(source.sha256)) for source in case.sources] == [("stranger", 16)]
    assert case.task_code == ""
    record = identity(Episode(case.condition, "stranger", 0, task_code="a"))
    assert states(record) != states(identity(Episode(case.condition, "stranger", 0, task_code="b")))


def test_learned_policies_are_known_by_name_or_file():
    names = ("learned", "learned-2", "runs/best.npz", "model.zip", "nearest", "./mine.py:Mine", "npz")
    assert [name for name in names if is_learned(name)] == ["learned", "learned-2", "runs/best.npz", "model.zip"]


def test_an_episode_of_a_file_travels_and_its_record_leads_back_to_it(tmp_path: Path):
    (tmp_path / "mine.py").write_text(MINE)
    chosen = wanted([f"{tmp_path}/mine.py:Mine"], 1).under(
        "my.yaml", {"process.locate_s": 3.0, "scenario": {"plants": 3}}
    )
    episode = chosen.episodes()[0]
    assert pickle.loads(pickle.dumps(episode)) == episode
    record = json.loads(json.dumps(identity(episode)))
    assert key(record) == key(identity(episode))
    assert condition(record) == episode.condition
    other = Episode(episode.condition, episode.policy, episode.seed)
    assert key(identity(other)) != key(record)


def test_titles_say_what_is_special():
    plain = Condition("farm:farm/Berries-v0", "wall", "analytic", "perfect")
    assert str(plain) == "farm/Berries-v0, wall, analytic, perfect perception"
    changed = Condition(
        ENV, "a.yaml", "analytic", "model", changes_of({"b.c": 1, "a": [2], "scenario": {"d": 4}}), "mine"
    )
    assert str(changed) == "SafflowerPicking-v0, a.yaml, analytic, model perception, a = [2], b.c = 1, fields of mine"
    assert changed.settings == {"perception": "model", "overrides": {"a": [2], "b.c": 1, "scenario": {"d": 4}}}
    inside = Condition(ENV, "a.yaml", "analytic", "model", changes_of({"scenario": {"d": {"e": 4}}, "scenario.d.e": 5}))
    assert inside.settings["overrides"] == {"scenario": {"d": {"e": 5}}}
    assert plain.settings == {"scenario": "wall", "perception": "perfect"}


def test_numbers_and_a_scenario_s_file_decide_the_episode_and_stand_in_the_records(tmp_path: Path):
    scenario = tmp_path / "few.yaml"
    scenario.write_text("base: pots\nplants: 3\n")
    words = ["--env", ENV, "--policies", "fixed-order", "--episodes", "1", "--backend", "analytic", "--jobs", "1"]
    words += ["--out", str(tmp_path), "--scenario", str(scenario), "--set", "process.locate_s=2"]
    (record,) = command(*words, folder=tmp_path)
    assert record["scenario"] == str(scenario)
    assert record["changes"]["process.locate_s"] == 2 and record["changes"]["scenario"]["plants"] == 3
    env: Any = gym.make(
        ENV, backend="analytic", perception="model", scenario=str(scenario), overrides={"process.locate_s": 2}
    )
    scores = evaluation.evaluate(
        lambda made: make_policy("fixed-order", made), ENV, [0], scenario=str(scenario), perception="model",
        overrides={"process.locate_s": 2},
    )  # fmt: skip
    env.close()
    assert record["return"] == scores.returns[0]
    assert [r["seed"] for r in command(*words, "--resume", folder=tmp_path)] == [0]
    scenario.write_text("base: pots\nplants: 4\n")
    (changed,) = command(*words, "--resume", folder=tmp_path)
    assert changed["changes"]["scenario"]["plants"] == 4 and changed["return"] != record["return"]
    # Other numbers are another table, beside this one.
    assert len(command(*words[:-1], "process.locate_s=3", "--resume", folder=tmp_path)) == 2


def test_field_files_stand_where_seeds_stand_and_give_what_their_seeds_gave(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    folder = drawn(tmp_path / "fields", range(3, 5))
    words = ["--env", ENV, "--policies", "fixed-order,nearest", "--backend", "analytic", "--jobs", "1"]
    fields = [*words, "--out", str(tmp_path / "a"), "--fields", str(folder)]
    records = command(*fields, folder=tmp_path / "a")
    assert [(r["policy"], r["field"]) for r in records] == [
        (policy, f"plants-{seed}.csv") for seed in (3, 4) for policy in ("fixed-order", "nearest")
    ]
    assert len({record["field_digest"] for record in records}) == 2
    scores = evaluation.evaluate(lambda env: make_policy("nearest", env), ENV, [3, 4], perception="model")
    assert [r["return"] for r in records if r["policy"] == "nearest"] == scores.returns.tolist()
    paths = [folder / f"plants-{seed}.csv" for seed in (3, 4)]
    played = evaluation.evaluate(lambda env: make_policy("nearest", env), ENV, [7, 7], fields=paths, perception="model")
    assert played.returns.tolist() == scores.returns.tolist()
    monkeypatch.setattr(evaluation, "task", lambda env_id: SimpleNamespace(vector_entry_point=None))
    played = evaluation.evaluate(lambda env: make_policy("nearest", env), ENV, [7, 7], fields=paths, perception="model")
    assert played.returns.tolist() == scores.returns.tolist()
    names = [f"plants-{seed}.csv" for seed in (3, 4)]
    study = reader.load(tmp_path / "a" / "quick")
    assert study.chapters[0].headline.seeds == tuple(names)
    html = page.render(study, "")
    assert "2 paired episodes a policy, fields plants-3.csv to plants-4.csv" in html and str(folder) in html
    # A file that has changed runs again, the other does not.
    env: Any = gym.make(ENV, backend="analytic", perception="model")
    env.reset(seed=9)
    write_field(env.unwrapped.field, folder / names[0])
    again = command(*fields, "--resume", folder=tmp_path / "a")
    assert again[:2] == records[2:] and [r["field"] for r in again[2:]] == [names[0]] * 2
    assert again[2]["field_digest"] != records[0]["field_digest"]
    env.close()


def test_a_bound_knows_the_field_of_a_file(tmp_path: Path):
    folder = drawn(tmp_path / "fields", range(3, 4))
    files = field_files(ENV, folder, {"scenario": "pots", "perception": "model"})
    models = suite("full", [ENV]).narrowed(None, ["nearest"], 1, "analytic", "model")
    models = replace(models, cases=models.cases[:1])
    chosen = models.on_fields("fields", files).traced()
    assert [episode.policy for episode in chosen.episodes()] == ["nearest", BOUND]
    report, _ = run(chosen, tmp_path / "out")
    seeded, _ = run(suite("full", [ENV]).narrowed(None, ["nearest"], 1, "analytic"), tmp_path / "seeded")
    assert report.failures == [] and report.violations == []
    assert report.bounds[0]["bound"]["net_rate"] != seeded.bounds[0]["bound"]["net_rate"]
    (row, bound) = tables.summarise(report.records, chosen.cases, report.bounds)
    assert bound.policy == BOUND and row.gaps["net_rate"].n == 1
    # On one field luck may be better than its mean, but not better than all of it.
    assert row.gaps["clairvoyant_net_rate"].value >= 0.0 and row.gaps["cycle_time_s"].value >= 0.0


@pytest.mark.parametrize(
    ("write", "message"),
    [
        (lambda folder: None, "holds no fields: put files in it"),
        (lambda folder: (folder / "a.csv").write_text("across_m\n1\n"), r"a\.csv"),
        (lambda folder: (folder / "a.csv").write_text(""), r"a\.csv"),
        (lambda folder: folder.rmdir(), "cannot read the folder of fields .*No such file"),
    ],
)
def test_a_folder_that_cannot_be_used_gets_one_line(tmp_path: Path, write: Callable[[Path], Any], message: str):
    folder = tmp_path / "fields"
    folder.mkdir()
    write(folder)
    with pytest.raises(FieldsError, match=message) as raised:
        field_files(ENV, folder, {"perception": "model"})
    assert "\n" not in str(raised.value)


def test_without_a_batched_environment_worlds_are_played_one_by_one(monkeypatch: pytest.MonkeyPatch):
    def scores() -> evaluation.Scores:
        return evaluation.evaluate(lambda env: make_policy("nearest", env), ENV, [3, 4], scenario="row")

    batched = scores()
    monkeypatch.setattr(evaluation, "task", lambda env_id: SimpleNamespace(vector_entry_point=None))
    monkeypatch.setattr(gym, "make_vec", lambda *args, **kwargs: pytest.fail("there is none"))
    single = scores()
    assert (batched.returns == single.returns).all() and (batched.decisions == single.decisions).all()
    assert all((batched.scorecard[name] == single.scorecard[name]).all() for name in batched.scorecard)


def test_a_task_that_cannot_be_loaded_stops_nothing(monkeypatch: pytest.MonkeyPatch):
    broken = TaskSpec(
        id="farm/Broken-v0", entry_point="no_such_module_at_all:Env", vector_entry_point="no_such_module_at_all:Envs",
        machine="", decision="", actions="", policies={}, reference="random",
    )  # fmt: skip
    monkeypatch.setitem(_TASKS, broken.id, broken)
    with pytest.warns(UserWarning, match=r"task 'farm/Broken-v0' was left out: ModuleNotFoundError: .*no_such_module"):
        assert broken not in usable_tasks()
    with pytest.warns(UserWarning, match="left out"):
        assert {case.condition.env_id for case in suite("quick").cases} == set(env_ids()) - {broken.id}
    result = CliRunner().invoke(cli.app, ["list", "--json"])
    assert result.exit_code == 0
    assert [entry["id"] for entry in json.loads(result.stdout)] == [name for name in env_ids() if name != broken.id]
    assert result.stderr.count("\n") == 1 and "farm/Broken-v0" in result.stderr


def test_the_first_task_alone_has_the_long_part_of_the_quick_suite():
    counts = [len(case.seeds) for case in suite("quick").cases]
    assert counts[0] > max(counts[1:])
    assert len(suite("quick", [ENV]).cases[0].seeds) == counts[0]


@pytest.mark.slow
def test_a_stranger_s_task_and_policies_in_spawned_workers(tmp_path: Path):
    for name in ("mine.py", "wall_policies.py"):
        (tmp_path / name).write_text(MINE)
    (tmp_path / "wall.py").write_text(
        (ROOT / "examples/strawberry/strawberry.py").read_text().replace("strawberry:", "wall:")
    )
    words = [
        "--env",
        "wall:StrawberryPicking",
        "--policies",
        "nearest,./mine.py:Mine,wall_policies:Mine",
        "--episodes",
        "3",
    ]
    # The command does not find the working directory by itself, as Python does with -m or -c.
    start = "import sys; sys.path.remove(''); from fieldgym.scripts.cli import main; main()"
    paths = os.pathsep.join(path for path in sys.path if path)
    result = subprocess.run(
        [sys.executable, "-c", start, "benchmark", *words, "--jobs", "2", "--out", "out"],
        capture_output=True, text=True, check=False, cwd=tmp_path, env={**os.environ, "PYTHONPATH": paths},
    )  # fmt: skip
    assert result.returncode == 0, result.stderr
    records = store.read(tmp_path / "out" / "quick" / store.EPISODES)
    assert len(records) == 9 and not any("error" in record for record in records)
    mine = [[r["return"] for r in records if r["policy"] == name] for name in ("./mine.py:Mine", "wall_policies:Mine")]
    assert np.sort(mine[0]).tolist() == np.sort(mine[1]).tolist()
    assert {r["env_id"] for r in records} == {"wall:farm/StrawberryPicking-v0"}
    assert {len(r["task_source"]) for r in records} == {16}
    assert "farm/StrawberryPicking-v0, wall, analytic" in result.stdout and "./mine.py:Mine" in result.stdout


def test_the_registry_names_no_task_twice():
    assert len({spec.id for spec in usable_tasks()}) == len(env_ids())
    assert task(ENV) == usable_tasks()[0]
