"""Scenario files: what is read, what is refused, and that the refusal names file and line."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import Any

import pytest
from checked import Tray
from hypothesis import given
from hypothesis import strategies as st

from fieldgym.kernels.config import Config, ConfigError, flag, from_mapping, nested, num, override, text
from fieldgym.kernels.config_files import MAX_BYTES, MAX_DEPTH, load_yaml, parse_yaml


@dataclass(frozen=True)
class Process(Config):
    """Picking one head."""

    locate_s: float = num(7.304, 0.0, 600.0, "s")
    """Locating one head."""
    strokes: tuple[int, int, int] = num((1, 2, 3), 0, 50, "")
    """Shear strokes over the head."""
    corner_m: float = num(inf, 1e-6, inf, "m")
    """Largest corner radius."""
    mode: str = text("fast")
    """How."""


@dataclass(frozen=True)
class Task(Config):
    """Everything."""

    slots: int = num(..., 1, 64, "")
    """Candidates."""
    tray: Tray = nested(...)
    """The tray."""
    process: Process = nested(Process)
    """Picking."""
    slow: Process = nested(Process(locate_s=30.0))
    """Slow picking."""
    spares: tuple[Tray, ...] = nested(())
    """Further trays."""
    other: Tray | None = nested(None)
    """Another tray."""
    potted: bool = flag(False)
    """Whether the plants stand in pots."""


TASK = Task(4, Tray(72, "a"))


def refusal(make: Any, *arguments: Any) -> str:
    """The line that a refusal prints."""
    with pytest.raises(ConfigError) as caught:
        make(*arguments)
    line = str(caught.value)
    assert line.isprintable(), line
    assert len(line) < 500
    return line


@pytest.mark.parametrize(
    ("written", "line"),
    [
        (
            "slots: 4\nprocess:\n  locate_s: 1e-3",
            "3: process.locate_s = '1e-3': give a number in [0, 600] s, not a text: write 1.0e-3",
        ),
        ("slots: 4\n\nprocess.locate_s: .nan", "3: process.locate_s = nan: give a number in [0, 600] s"),
        (
            "process:\n  strokes:\n    - 1\n    - 2",
            "2: process.strokes = [1, 2]: give 3 values (each a whole number in [0, 50]), not 2",
        ),
        ("slots: 4\nproces: {}", "2: proces: no such field: did you mean process?"),
        (
            "process:\n  mode: no",
            "2: 'no': YAML reads it as a truth value: write true or false, or put a text in quotes",
        ),
        ("on: 1", "1: 'on': YAML reads it as a truth value: write true or false, or put a text in quotes"),
        (
            "slots: 1:30",
            "1: '1:30': YAML reads it otherwise than it looks: write a decimal number, or put a text in quotes",
        ),
        (
            "slots: 010",
            "1: '010': YAML reads it otherwise than it looks: write a decimal number, or put a text in quotes",
        ),
        (
            "slots: 1_0",
            "1: '1_0': YAML reads it otherwise than it looks: write a decimal number, or put a text in quotes",
        ),
        (
            "slots: 1:30.5",
            "1: '1:30.5': YAML reads it otherwise than it looks: write a decimal number, or put a text in quotes",
        ),
        ("tray.name: 2024-01-01", "1: '2024-01-01': put a text in quotes"),
        ("<<: {slots: 1}", "1: '<<': put a text in quotes"),
        ("a: 1\nb: {c: 1,\n  c: 2}", "3: c is given twice, first in line 2: give it once"),
        ("'a': 1\na: 2", "2: a is given twice, first in line 1: give it once"),
        ("1: 2", "1: 1 as a name: names are texts, put it in quotes"),
        ("? [a]\n: 2", "1: [] as a name: names are texts, put it in quotes"),
        ("? {a: 1}\n: 2", "1: {} as a name: names are texts, put it in quotes"),
        (
            "slots: !!python/object/apply:os.system ['true']",
            "1: tag 'tag:yaml.org,2002:python/object/apply:os.system': leave tags out",
        ),
        ("slots: !!int '3'", "1: tag 'tag:yaml.org,2002:int': leave tags out"),
        ("a: &x [1]\nb: *x", "1: anchor or alias x: write the value out"),
        ("a: *x", "1: anchor or alias x: write the value out"),
        ("slots: 1\n---\nslots: 2", "2: a second document begins: give one"),
        ("- 1", "1: holds [1]: give a mapping, name: value"),
        ("\n3", "1: holds 3: give a mapping, name: value"),
        ("a: b: c", "1: no YAML: mapping values are not allowed"),
        ("a: [1\nb: 2", "2: no YAML: "),
        ("a: 'x", "1: no YAML: found unexpected end of stream"),
        ("a: @x", "1: no YAML: found character that cannot start any token"),
        ("slots: " + "9" * 900, "1: slots = an integer of 2990 bits: give a whole number in [1, 64]"),
        ("slots: " + "9" * 9000, "1: '9999999"),
    ],
)
@pytest.mark.parametrize("loader", ["CSafeLoader", "SafeLoader"])
def test_what_is_wrong_in_a_file_is_named_with_its_line(
    written: str, line: str, loader: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    yaml = pytest.importorskip("yaml")
    if not hasattr(yaml, loader):
        pytest.skip("PyYAML without libyaml")
    monkeypatch.setattr(yaml, "CSafeLoader", getattr(yaml, loader), raising=False)
    file = tmp_path / "field.yaml"
    file.write_text(written, "utf-8")
    told = refusal(lambda: from_mapping(Task, load_yaml(file), TASK))
    assert told == refusal(lambda: override(TASK, load_yaml(file)))
    if loader == "SafeLoader" and "no YAML" in line:  # the wording is the parser's
        assert told.startswith(f"{file}:") and ": no YAML: " in told
    else:
        assert told.startswith(f"{file}:{line}")


@pytest.mark.parametrize("opening", ["[", "{a: ", "- ", "? "])
@pytest.mark.parametrize("loader", ["CSafeLoader", "SafeLoader"])
def test_depth_is_limited(opening: str, loader: str, monkeypatch: pytest.MonkeyPatch) -> None:
    yaml = pytest.importorskip("yaml")
    monkeypatch.setattr(yaml, "CSafeLoader", getattr(yaml, loader, yaml.SafeLoader), raising=False)
    refusal(parse_yaml, opening * 100_000)
    deep = "a: " + "[" * (MAX_DEPTH - 1) + "]" * (MAX_DEPTH - 1)
    assert parse_yaml(deep)
    assert refusal(parse_yaml, deep.replace("[]", "[[]]")).startswith(f"text:1: more than {MAX_DEPTH} levels")


def test_a_billion_laughs_are_not_heard() -> None:
    pytest.importorskip("yaml")
    bomb = "a: &a [x, x, x, x, x, x, x, x, x]\n" + "".join(
        f"{new}: &{new} [{', '.join(['*' + old] * 9)}]\n" for old, new in zip("abcdefgh", "bcdefghi", strict=True)
    )
    assert refusal(parse_yaml, bomb) == "text:1: anchor or alias a: write the value out"


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    pytest.importorskip("yaml")
    file = tmp_path / "field.yaml"
    assert refusal(load_yaml, file) == f"{file}: cannot be read: No such file or directory"
    assert refusal(load_yaml, tmp_path) == f"{tmp_path}: cannot be read: it is a folder, no file"
    assert "cannot be read" in refusal(load_yaml, "a\0b")
    file.write_bytes(b"a: 1\nb: \xff")
    assert refusal(load_yaml, file) == f"{file}:2: is not UTF-8: save it as UTF-8"
    file.write_bytes(b"a: \0")
    assert refusal(load_yaml, file).startswith(f"{file}: no YAML: ")
    file.write_bytes(b"#" * (MAX_BYTES + 1))
    assert refusal(load_yaml, file) == (
        f"{file}: cannot be read: it has {MAX_BYTES + 1} bytes, at most {MAX_BYTES} are read"
    )
    file.write_bytes(b"#" * MAX_BYTES)
    assert load_yaml(file) == {}


def test_a_file_is_read(tmp_path: Path) -> None:
    pytest.importorskip("yaml")
    file = tmp_path / "field.yaml"
    file.write_text(
        "\ufeff# a task\nslots: 4\ntray: {cells: 72, name: 'no'}\nprocess.locate_s: 1.0e-3\npotted: TRUE\nother: ~\n"
        "slow:\n  corner_m: .inf\n  strokes: [-0, +1, 2]\nspares:\n- cells: 1\n  name: b\n",
        "utf-8",
    )
    made = from_mapping(Task, load_yaml(file))
    slow = Process(locate_s=30.0, strokes=(0, 1, 2))
    assert made == Task(4, Tray(72, "no"), Process(0.001), slow, spares=(Tray(1, "b"),), potted=True)


@given(st.text(alphabet="abz:,[]{}-?&*!|>'\"%@`#\n 0123456789.enoty~_\t<=", max_size=40))
def test_any_text_is_read_or_refused_in_one_line(written: str) -> None:
    yaml = pytest.importorskip("yaml")
    try:
        read = parse_yaml(written)
    except ConfigError as error:
        assert str(error).isprintable()
        assert str(error).startswith("text:")
        return
    plain = yaml.load(written, Loader=getattr(yaml, "CSafeLoader", yaml.SafeLoader))
    assert read == (plain or {}), "what is read, every reader reads so"


def test_without_pyyaml_the_error_says_how_to_install_it(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "yaml", None)
    with pytest.raises(ImportError, match="pip install pyyaml"):
        parse_yaml("a: 1")
