"""Machine code is kept from one process to the next, served while what it was made of is the same, and renewed else."""

import logging
import math
import os
import re
import subprocess
import sys
from collections.abc import Callable
from enum import IntEnum
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np
import pytest
from numba import typeof
from numba.core import config

from fieldgym.kernels import binding, compiled, copy, fill, keeping, stamps

pytestmark = pytest.mark.portable

JIT = pytest.mark.skipif(bool(config.DISABLE_JIT), reason="kernels run as Python")  # type: ignore[attr-defined]

RULES = '''
"""Rules of a toy: what a tool's arm reaches, and what that is worth."""
from __future__ import annotations
from typing import Any, NamedTuple
import numpy as np
import other
from fieldgym.kernels import bind, by_kind, compiled

RATE = 2.0
TABLE = np.array([1.0, 4.0])
PAIR = (3, ("a", 0.5))

class Columns(NamedTuple):
    time: int
    done: int

T = Columns(0, 1)

class Spot(NamedTuple):
    x: float
    y: float

class Grip(NamedTuple):
    shut: float
    wide: float

class Arm(NamedTuple):
    near: float
    far: float
    spot: Spot
    grip: Grip

@by_kind
def reach(arm: Any) -> float:
    raise NotImplementedError

stub = reach

@compiled
def half(x: float) -> float:
    return x / 2.0

@compiled
def reach(arm: Arm) -> float:
    return half(arm.near) + arm.grip.shut

bind(Arm, reach)

@compiled
def worth(x: float, least: float = 0.125) -> float:
    """What it is worth."""
    return max(x, least)

@compiled
def kernel(arm: Arm) -> float:
    """What the arm earns."""
    # It earns little.
    row = np.zeros(2)
    row[T.time] = RATE * worth(TABLE[1] + PAIR[0]) + 10.0
    spot = Spot(arm.spot.x, 7.0)
    return row[0] + 100.0 * stub(arm) + spot.y + other.SHARE

@compiled
def untouched(x: float) -> float:
    return x + 1.0

ARM = Arm(1.0, 2.0, Spot(5.0, 6.0), Grip(0.0, 1.0))
'''
WORTH = 2.0 * 7.0 + 10.0 + 100.0 * 0.5 + 7.0 + 0.25


@pytest.fixture
def load(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Any]:
    """Import a source as the module ``rules``, as a new process would; code is kept in a folder of the test's."""
    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path / "kept"))
    monkeypatch.setattr(binding, "BOUND", {})
    monkeypatch.setattr(binding, "STUBS", set())
    monkeypatch.setattr(keeping, "_TOLD", [])
    other = ModuleType("other")
    vars(other)["SHARE"] = 0.25
    monkeypatch.setitem(sys.modules, "other", other)

    def load(source: str = RULES, share: float = 0.25) -> Any:
        binding.BOUND.clear()
        vars(other)["SHARE"] = share
        file = tmp_path / "rules.py"
        file.write_text(source)
        rules = ModuleType("rules")
        monkeypatch.setitem(sys.modules, "rules", rules)
        exec(compile(source, file, "exec"), vars(rules))
        return rules

    return load


def changed(old: str, new: str) -> str:
    assert RULES.count(old) == 1, old
    return RULES.replace(old, new)


def stamp(rules: Any) -> str:
    return stamps.stamp(rules.kernel, [typeof(rules.ARM)])


SAME = {
    "a line above": ("RATE = 2.0", "# Moves all that follows.\n\nRATE = 2.0"),
    "a comment": ("# It earns little.", "# It earns a lot."),
    "its docstring": ("What the arm earns.", "What this arm earns."),
    "a callee's docstring": ("What it is worth.", "What that is worth."),
    "what it does not call": ("return x + 1.0", "return x + 2.0"),
}

DIFFERENT = {
    "a constant": ("+ 10.0", "+ 11.0"),
    "a name": ("row = np.zeros(2)", "row = np.ones(2)"),
    "a number": ("RATE = 2.0", "RATE = 3.0"),
    "a number's type": ("RATE = 2.0", "RATE = 2"),
    "an array": ("np.array([1.0, 4.0])", "np.array([1.0, 5.0])"),
    "a tuple": ('(3, ("a", 0.5))', '(3, ("a", 0.6))'),
    "columns": ("T = Columns(0, 1)", "T = Columns(1, 0)"),
    "a callee": ("max(x, least)", "min(x, least)"),
    "a callee's default": ("least: float = 0.125", "least: float = 0.25"),
    "a bound function": ("half(arm.near)", "half(arm.far)"),
    "a bound function's callee": ("x / 2.0", "x / 3.0"),
    "the order of an argument's fields": ("near: float\n    far: float", "far: float\n    near: float"),
    "the fields within an argument": ("shut: float\n    wide: float", "wide: float\n    shut: float"),
    "the fields of what it makes": ("x: float\n    y: float", "y: float\n    x: float"),
}


@JIT
@pytest.mark.parametrize("what", SAME)
def test_a_stamp_stays_with(what: str, load: Callable[..., Any]) -> None:
    assert stamp(load(changed(*SAME[what]))) == stamp(load())


@JIT
@pytest.mark.parametrize("what", DIFFERENT)
def test_a_stamp_changes_with(what: str, load: Callable[..., Any]) -> None:
    assert stamp(load(changed(*DIFFERENT[what]))) != stamp(load())


class Colour(IntEnum):
    RED = 1
    BLUE = 2


class Shade(IntEnum):
    RED = 1
    BLUE = 3


class Pair(NamedTuple):
    a: int
    b: int


def test_values_that_differ_are_told_apart() -> None:
    numbers = [0, 1, True, 0.0, -0.0, 1.0, np.inf, 1j, np.int64(1), np.int32(1), np.float32(1), np.bool_(True)]
    arrays = [
        np.array(1),
        np.zeros((2, 3)),
        np.zeros((3, 2)),
        np.zeros((2, 3), order="F"),
        np.zeros((2, 3), np.float32),
    ]
    others = ["1", b"1", None, (1, 2), [1, 2], frozenset({1, 2}), Pair(1, 2), Pair, tuple, int, np.float64, ValueError]
    others += [Colour.RED, Colour.BLUE, Shade.RED, Colour, Shade, KeyError, math.sin, math.cos, np.sum, np.max, np.sin]
    digests = set()
    values = [*numbers, *arrays, *others]
    for value in values:
        walk = stamps._Walk()
        walk.value(value, run)
        digests.add(walk.digest.hexdigest())
    assert len(digests) == len(values)


@JIT
def test_a_stamp_changes_with_what_is_taken_out_of_a_module(load: Callable[..., Any]) -> None:
    assert stamp(load(share=0.5)) != stamp(load())


@JIT
def test_a_stamp_changes_with_the_options(load: Callable[..., Any], monkeypatch: pytest.MonkeyPatch) -> None:
    before = stamp(load())
    monkeypatch.setattr(config, "BOUNDSCHECK", 1)
    assert stamp(load()) != before


@JIT
def test_a_stamp_does_not_see_what_is_bound_to_others(load: Callable[..., Any]) -> None:
    """Else a process that has imported one tool would renew the code of one that has imported two."""
    before = stamp(load())
    rules = load(RULES + "class Leg(NamedTuple):\n    near: float\n\nbind(Leg, reach)\n")
    assert len(binding.BOUND) == 2
    assert stamp(rules) == before


@JIT
def test_a_stamp_of_the_unknown_is_its_folder(load: Callable[..., Any], tmp_path: Path) -> None:
    source = changed("RATE = 2.0", "RATE = {1: 2.0}")

    def with_beside(text: str) -> str:
        (tmp_path / "beside.py").write_text(text)
        stamps._modules.cache_clear()
        return stamp(load(source))

    first = with_beside("A = 1")
    assert with_beside("A = 2") != first
    assert with_beside("A = 1") == first


def run(folder: Path, script: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a script in a new process beside the modules of a folder."""
    file = folder / "script.py"
    file.write_text(script)
    return subprocess.run(
        [sys.executable, str(file)], env={**os.environ, **variables}, capture_output=True, text=True, check=True
    )


SCRIPT = """
import rules
arm = rules.Arm(near=1.0, far=2.0, spot=rules.Spot(5.0, 6.0), grip=rules.Grip(0.0, 1.0))
print(rules.kernel(arm), rules.untouched(1.0))
print(*(len(one.stats.cache_hits) for one in (rules.kernel, rules.untouched)))
"""


@JIT
def test_code_is_kept_and_never_stale(tmp_path: Path) -> None:
    (tmp_path / "other.py").write_text("SHARE = 0.25\n")

    def play(source: str) -> list[float]:
        (tmp_path / "rules.py").write_text(source)
        done = run(tmp_path, SCRIPT, NUMBA_CACHE_DIR=str(tmp_path / "kept"), PYTHONDONTWRITEBYTECODE="1")
        return [float(word) for word in done.stdout.split()]

    assert play(RULES) == [WORTH, 2.0, 0, 0]
    assert play("# A line above.\n" + RULES) == [WORTH, 2.0, 1, 1]
    # The values stand where they stood, under each other's names.
    swapped = changed("near: float\n    far: float", "far: float\n    near: float")
    assert play(swapped) == [WORTH, 2.0, 0, 1]
    assert play(swapped.replace("half(arm.near)", "half(arm.far)")) == [WORTH + 50.0, 2.0, 0, 1]
    assert not [path for path in tmp_path.rglob("*.nb?") if "kept" not in path.parts]


@JIT
def test_code_of_other_sources_between_index_and_code_is_not_served(load: Callable[..., Any], tmp_path: Path) -> None:
    """Numba writes the index first: another process may have written the code that it names."""

    def play(source: str) -> tuple[float, bytes, Path]:
        rules = load(source)
        value = rules.kernel(rules.ARM)
        (file,) = tmp_path.glob("kept/*/rules.kernel.*.nbc")
        return value, file.read_bytes(), file

    other, code, _ = play(changed("+ 10.0", "+ 11.0"))
    value, _, file = play(RULES)
    assert (other, value) == (WORTH + 1.0, WORTH)
    file.write_bytes(code)
    assert play(RULES)[0] == WORTH


@JIT
def test_code_of_earlier_sources_does_not_pile_up(load: Callable[..., Any], tmp_path: Path) -> None:
    for source in (RULES, changed("+ 10.0", "+ 11.0").replace("Arm(1.0, 2.0", "Arm(1, 2")):
        rules = load(source)
        rules.kernel(rules.ARM)
    assert len(list(tmp_path.glob("kept/*/rules.kernel.*.nbc"))) == 1


@JIT
def test_code_cut_short_is_made_again(load: Callable[..., Any], tmp_path: Path) -> None:
    for suffix in ("nbi", "nbc"):
        rules = load()
        assert rules.kernel(rules.ARM) == WORTH
        files = list(tmp_path.glob(f"kept/*/*.{suffix}"))
        assert files
        for file in files:
            file.write_bytes(file.read_bytes()[:-20])
    rules = load()
    assert rules.kernel(rules.ARM) == WORTH
    assert not rules.kernel.stats.cache_hits


@JIT
def test_code_is_kept_for_the_next(load: Callable[..., Any]) -> None:
    for hits in (0, 1):
        rules = load()
        assert rules.kernel(rules.ARM) == WORTH
        assert len(rules.kernel.stats.cache_hits) == hits


@JIT
def test_a_folder_that_goes_away_costs_one_warning(
    load: Callable[..., Any], tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    rules = load()
    (tmp_path / "kept").rename(tmp_path / "gone")
    (tmp_path / "kept").write_text("not a folder")
    with caplog.at_level(logging.WARNING):
        assert rules.kernel(rules.ARM) == WORTH
        assert rules.untouched(1.0) == 2.0
    assert len([record for record in caplog.records if "not kept" in record.message]) == 1


@JIT
def test_without_a_writable_folder_code_is_compiled_with_one_warning(tmp_path: Path) -> None:
    (tmp_path / "rules.py").write_text(RULES)
    (tmp_path / "other.py").write_text("SHARE = 0.25\n")
    nowhere = tmp_path / "file"
    nowhere.write_text("not a folder")
    places = dict.fromkeys(("NUMBA_CACHE_DIR", "XDG_CACHE_HOME", "LOCALAPPDATA", "HOME"), str(nowhere / "below"))
    done = run(tmp_path, SCRIPT, **places)
    assert [float(word) for word in done.stdout.split()] == [WORTH, 2.0, 0, 0]
    assert done.stderr.count("Machine code is not kept") == 1
    assert "NUMBA_CACHE_DIR" in done.stderr


def test_kernels_run_as_python(tmp_path: Path) -> None:
    (tmp_path / "rules.py").write_text(RULES)
    (tmp_path / "other.py").write_text("SHARE = 0.25\n")
    script = "import rules\nprint(type(rules.kernel).__name__, rules.kernel(rules.ARM))\n"
    done = run(tmp_path, script, NUMBA_DISABLE_JIT="1", NUMBA_CACHE_DIR=str(tmp_path / "kept"))
    assert done.stdout.split() == ["function", str(WORTH)]
    assert not (tmp_path / "kept").exists()


@JIT
@pytest.mark.usefixtures("load")
def test_a_function_of_the_prompt_is_compiled_and_not_kept(tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    names: dict[str, Any] = {}
    exec("def twice(x):\n    return 2.0 * x\n", names)
    with caplog.at_level(logging.WARNING):
        assert compiled(names["twice"])(4.0) == 8.0
    assert not caplog.records
    assert not (tmp_path / "kept").exists()


@pytest.mark.parametrize(
    ("platform", "variables", "folder"),
    [
        ("linux", {"XDG_CACHE_HOME": "/caches"}, "/caches"),
        ("linux", {"XDG_CACHE_HOME": "", "HOME": "/home/ann"}, "/home/ann/.cache"),
        ("darwin", {"XDG_CACHE_HOME": "/caches", "HOME": "/Users/ann"}, "/Users/ann/Library/Caches"),
        ("win32", {"LOCALAPPDATA": "/local"}, "/local"),
    ],
)
def test_the_users_folder(
    platform: str, variables: dict[str, str], folder: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    monkeypatch.setattr(sys, "platform", platform)
    assert keeping.user_folder() == Path(folder) / "fieldgym" / "machine-code"


def test_rows_are_filled_and_copied() -> None:
    row, source = np.arange(4.0), np.arange(9.0)
    copy(source, row[1:3])
    assert row.tolist() == [0.0, 0.0, 1.0, 3.0]
    fill(row[:2], -1.0)
    assert row.tolist() == [-1.0, -1.0, 1.0, 3.0]


def test_numba_comes_with_kernels_only(tmp_path: Path) -> None:
    script = "import sys, fieldgym.motion, fieldgym.kernels.config\nprint('numba' in sys.modules)\n"
    script += "from fieldgym.kernels import *\nprint('numba' in sys.modules, compiled.__name__, fill.__name__)\n"
    assert run(tmp_path, script).stdout.split() == ["False", "True", "compiled", "fill"]


def test_the_room_knows_no_other_room() -> None:
    for file in Path(keeping.__file__).parent.glob("*.py"):
        assert not re.findall(r"^\s*(?:from \.\.|from fieldgym|import fieldgym)", file.read_text(), re.MULTILINE), file
