"""The mistakes of ``make mutants``: what they change, what they leave alone, and that a seed fixes the sample."""

import os
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("cosmic_ray")
ROOT = Path(__file__).resolve().parents[1]
SOURCE = '''
from __future__ import annotations
from functools import lru_cache
from typing import Protocol


class Arm(Protocol):
    reach: int = 3 + 4


@lru_cache(maxsize=16)
def reach(arm: Arm | None, *rest: int, by: int = 1) -> int | None:
    """Seconds - not metres."""
    assert arm is not None and by > 0
    if by < 2:
        raise ValueError(f"by = {by - 1}: give {2 + 3}")
    total: int | float = 0
    total += by
    rest[0].place = min(by, total)
    return max(a * b for a, b in zip(rest, rest, strict=True))
'''


@pytest.fixture
def found(monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.syspath_prepend(str(ROOT / "scripts"))
    yield import_module("mutants_found")
    for name in ("mutants", "mutants_found"):
        sys.modules.pop(name, None)


def test_mistakes_are_made_where_something_is_done(found, tmp_path):
    (tmp_path / "some.py").write_text(SOURCE, "utf-8")
    made = {(place[0], name) for seed in range(12) for place, name, _ in found.mutants(tmp_path, "", "some.py", seed)}
    lines = SOURCE.splitlines()
    told = {(lines[line - 1].strip(), name.split("_")[0]) for line, name in made}
    assert {line for line, _ in told} == {
        "def reach(arm: Arm | None, *rest: int, by: int = 1) -> int | None:",
        "if by < 2:",
        "total: int | float = 0",
        "total += by",
        "rest[0].place = min(by, total)",
        "return max(a * b for a, b in zip(rest, rest, strict=True))",
    }
    assert ("rest[0].place = min(by, total)", "OtherEnd") in told
    assert ("rest[0].place = min(by, total)", "LineLeftOut") in told
    assert ("total += by", "OtherSum") in told and ("total += by", "LineLeftOut") in told
    assert ("if by < 2:", "ReplaceComparisonOperator") in told and ("if by < 2:", "AddNot") in told


def test_own_operators_do_what_they_say(found):
    from cosmic_ray.mutating import mutate_code

    for kind in (found.LineLeftOut, found.OtherSum, found.OtherEnd):
        for example in kind.examples():
            assert mutate_code(example.pre_mutation_code, kind(), 0) == example.post_mutation_code
            assert mutate_code("a = b", kind(), 0) is None


def test_every_module_has_tests_that_are_there(found):
    for room, names in found.ROOMS.items():
        for name in names:
            assert (ROOT / room / f"{name}.py").is_file()
            files, _ = found.closest(f"{room}/{name}.py")
            assert files and all((ROOT / file.partition("::")[0]).is_file() for file in files)


def test_a_sample_is_the_beginning_of_a_larger_one(found, monkeypatch):
    monkeypatch.setattr(found, "ROOMS", {"bounds": ("base",), "agents/policies": ("layout",)})
    small, large = found.chosen(ROOT, 6, 0), found.chosen(ROOT, 14, 0)
    assert small == large[:6] and len({mutant.key for mutant in large}) == 14
    assert [mutant.room for mutant in small] == ["bounds", "agents/policies"] * 3
    assert found.chosen(ROOT, 6, 1) != small
    for mutant in large:
        whole = (ROOT / mutant.module).read_text("utf-8")
        assert mutant.code != whole and mutant.diff.startswith("-")
        compile(mutant.code, mutant.module, "exec")


@pytest.mark.skipif(not hasattr(os, "fork"), reason="mutants run in forks")
@pytest.mark.slow
@pytest.mark.long
def test_tests_let_a_tree_pass_or_not_or_never_end(found, tmp_path):
    mutants, tree = import_module("mutants"), tmp_path / "fieldgym"
    (tree / "tests").mkdir(parents=True)
    asked = mutants.Tests(("tests/test_one.py",), False)
    verdicts = {
        "assert True": mutants.SURVIVED,
        "assert False": mutants.KILLED,
        "import nothing_of_that_name": mutants.KILLED,
        "while True: pass": mutants.TIME,
    }
    for body, verdict in verdicts.items():
        (tree / "tests" / "test_one.py").write_text(f"def test_one():\n    {body}\n", "utf-8")
        outcome = mutants.run(tree, asked, 2.5 if verdict == mutants.TIME else 60.0)
        assert outcome.verdict == verdict, body
        assert (verdict == mutants.KILLED) == outcome.test.endswith("test_one.py::test_one")
    (tree / "tests" / "test_one.py").write_text("nothing = 1\n", "utf-8")
    with pytest.raises(RuntimeError, match="ended with 5"):
        mutants.run(tree, asked, 5.0)


def test_results_are_read_as_far_as_they_were_written(found, tmp_path, capsys):
    mutants, file = import_module("mutants"), tmp_path / "mutants.jsonl"
    assert mutants.read(file) == {}
    row = {"key": "a", "room": "bounds", "module": "m.py", "line": 3, "operator": "O", "seconds": 1.0, "diff": "-x\n+y"}
    mutants.kept(file, {**row, "verdict": mutants.SURVIVED})
    mutants.kept(file, {**row, "verdict": mutants.KILLED})
    mutants.kept(file, {**row, "key": "b", "verdict": mutants.SURVIVED})
    file.write_text(file.read_text("utf-8") + '{"key": "c", "ver', "utf-8")
    known = mutants.read(file)
    assert {key: found_["verdict"] for key, found_ in known.items()} == {"a": mutants.KILLED, "b": mutants.SURVIVED}
    mutants.report(list(known.values()), ["bounds", "envs"])
    told = capsys.readouterr().out
    assert "m.py:3 O\n-x\n+y" in told and "50.0 % of 2 noticed (killed 1, survived 1)" in told and "envs" not in told
