"""Checked configurations: what they take, what they refuse, and that the refusal says what to do."""

from __future__ import annotations

import copy
import json
import pickle
from dataclasses import FrozenInstanceError, dataclass, field, replace
from math import inf, nan
from types import MappingProxyType
from typing import Any, get_type_hints

import numpy as np
import pytest
from checked import TASK, Arm, Process, Task, Tray, holds, refusal
from hypothesis import given
from hypothesis import strategies as st

from fieldgym.envs.task import task, tasks
from fieldgym.kernels.config import (
    Config,
    from_mapping,
    num,
    override,
    to_mapping,
)
from fieldgym.kernels.config_fields import entries
from fieldgym.kernels.config_files import parse_yaml
from fieldgym.kernels.config_tables import documented, rows, schema

pytestmark = pytest.mark.portable


@pytest.mark.parametrize(
    ("values", "line"),
    [
        ({"locate_s": nan}, "locate_s = nan: give a number in [0, 600] s"),
        ({"locate_s": -inf}, "locate_s = -inf: give a number in [0, 600] s"),
        ({"locate_s": np.float32(inf)}, "locate_s = inf: give a number in [0, 600] s"),
        ({"locate_s": -0.1}, "locate_s = -0.1: give a number in [0, 600] s"),
        ({"locate_s": None}, "locate_s = None: give a number in [0, 600] s"),
        ({"locate_s": True}, "locate_s = True: give a number in [0, 600] s, not a truth value"),
        ({"locate_s": np.True_}, "locate_s = True: give a number in [0, 600] s, not a truth value"),
        ({"locate_s": "1e-3"}, "locate_s = '1e-3': give a number in [0, 600] s, not a text: write 1.0e-3"),
        ({"locate_s": "2.5e3"}, "locate_s = '2.5e3': give a number in [0, 600] s, not a text: write 2.5e+3"),
        ({"locate_s": "7.3"}, "locate_s = '7.3': give a number in [0, 600] s, not a text: write 7.3"),
        ({"locate_s": "inf"}, "locate_s = 'inf': give a number in [0, 600] s, not a text"),
        ({"locate_s": 10**400}, "locate_s = an integer of 1329 bits: give a number in [0, 600] s"),
        ({"locate_s": 10**9000}, "locate_s = an integer of 29898 bits: give a number in [0, 600] s"),
        ({"power_w": 0.0}, "power_w = 0.0: give a number in [0.001, 10000] W or None"),
        ({"corner_m": 2**53 + 1}, "corner_m = 9007199254740993: give a number in [1e-06, inf] m, as a float"),
        ({"corner_m": 10**400}, "corner_m = an integer of 1329 bits: give a number in [1e-06, inf] m, as a float"),
        ({"corner_m": "-inf"}, "corner_m = '-inf': give a number in [1e-06, inf] m, not a text"),
        ({"strokes": (1, 2)}, "strokes = (1, 2): give 3 values (each a whole number in [0, 50]), not 2"),
        ({"strokes": 1}, "strokes = 1: give 3 values (each a whole number in [0, 50])"),
        ({"strokes": "123"}, "strokes = '123': give 3 values (each a whole number in [0, 50])"),
        ({"strokes": (1, 2, 3.0)}, "strokes[2] = 3.0: give a whole number in [0, 50], without a decimal point"),
        ({"strokes": (1, 2, 51)}, "strokes[2] = 51: give a whole number in [0, 50]"),
        ({"strokes": (3, 2, 1)}, "strokes = (3, 2, 1): give them in ascending order"),
        ({"recall": ((0.5, 0.5), (0.1, 1.5))}, "recall[1][1] = 1.5: give a number in [0, 1]"),
        ({"mode": "quick"}, "mode = 'quick': give 'fast' or 'slow'"),
        ({"mode": "x\n\x1b[31m"}, r"mode = 'x\n\x1b[31m': give 'fast' or 'slow'"),
        ({"repeats": "inf"}, "repeats = 'inf': give a whole number in [0, inf], not a text"),
        ({"repeats": inf}, "repeats = inf: give a whole number in [0, inf], without a decimal point"),
        ({"spot_m": (0, 2)}, "spot_m[1] = 2: give a number in [-1, 1] m"),
        ({"spot_m": 0}, "spot_m = 0: give 2 values (each a number in [-1, 1] m) or None"),
        ({"law": "cubic"}, "law = 'cubic': give 'quintic' or 'septic'"),
    ],
)
def test_a_refusal_names_field_value_range_unit_and_what_to_do(values: dict[str, Any], line: str) -> None:
    assert refusal(Process, **values) == f"Process.{line}"
    assert refusal(replace, Process(), **values) == f"Process.{line}"
    assert refusal(override, TASK, {f"process.{name}": value for name, value in values.items()}) == f"process.{line}"
    assert refusal(from_mapping, Process, values) == line


def test_refusals_of_the_other_kinds() -> None:
    assert refusal(replace, TASK, potted=1) == "Task.potted = 1: give true or false"
    assert refusal(replace, TASK, tray=72) == "Task.tray = 72: give a Tray"
    assert refusal(replace, TASK, tray=Tray).endswith("give a Tray")
    assert refusal(replace, TASK, other=Arm()).endswith("give a Tray or None")
    assert refusal(replace, TASK, arm=Process()).endswith("give a Arm")
    assert refusal(replace, TASK, spares=(Tray(1, "x"), None)) == "Task.spares[1] = None: give a Tray"
    assert refusal(Tray, 1, "two\nlines") == r"Tray.name = 'two\nlines': give a text of printable characters"
    assert refusal(Tray, 1, False).endswith("characters, not a truth value (in YAML put yes, no, on and off in quotes)")
    assert refusal(Tray, 1, b"x") == "Tray.name = b'x': give a text of printable characters"
    assert refusal(Task, 5, Tray(4, "a")) == "Task.tray.cells = 4: give 5 at least"
    assert refusal(Task, 13, Tray(40, "a")) == "Task: unlucky number"


def test_values_come_to_their_declared_types() -> None:
    made = Process(
        locate_s=np.float32(0.1),  # type: ignore[arg-type]
        strokes=np.array([1, 2, 3]),  # type: ignore[arg-type]
        recall=[[0, np.float64(1)], np.zeros(2)],  # type: ignore[arg-type]
        mode=np.str_("slow"),
        power_w=150,
        corner_m="inf",  # type: ignore[arg-type]
    )
    assert made == Process(float(np.float32(0.1)), (1, 2, 3), 150.0, inf, ((0.0, 1.0), (0.0, 0.0)), "slow")
    assert all(holds(getattr(made, name), hint) for name, hint in get_type_hints(Process).items())
    assert type(Process().recall[0][0]) is float, "defaults too"


def test_configurations_are_values() -> None:
    assert TASK == Task(4, Tray(72, "a"))
    assert hash(TASK) == hash(Task(4, Tray(72, "a")))
    assert copy.deepcopy(TASK) == TASK
    assert pickle.loads(pickle.dumps(TASK)) == TASK
    assert Process().total == 6
    with pytest.raises(FrozenInstanceError):
        TASK.slots = 5  # type: ignore[misc]


def test_overrides_reach_every_level_and_leave_the_rest() -> None:
    changed = override(
        TASK,
        {"process.power_w": 150, "slow": {"locate_s": 31.0}, "arm.hangs": False, "other": {"cells": 2, "name": "b"}},
    )
    slow = replace(TASK.slow, locate_s=31.0)
    expected = replace(TASK, process=Process(power_w=150.0), slow=slow, arm=Arm(hangs=False), other=Tray(2, "b"))
    assert changed == expected
    assert TASK == Task(4, Tray(72, "a"))
    assert override(TASK, {}) == override(TASK, {"process": {}}) == override(TASK, MappingProxyType({})) == TASK
    assert override(TASK, {"slow": MappingProxyType({"locate_s": 31.0})}).slow == slow
    assert override(TASK, {"tray": Tray(9, "z")}).tray == Tray(9, "z")
    assert override(changed, {"other.cells": 3}).other == Tray(3, "b")
    assert override(TASK, {"process": {"mode": "slow"}, "process.power_w": 1.0}).process == Process(
        power_w=1.0, mode="slow"
    )


def test_overrides_are_made_together_before_the_rules_are_checked() -> None:
    small = replace(TASK, tray=Tray(5, "a"))
    assert refusal(override, small, {"slots": 6}) == "tray.cells = 5: give 6 at least"
    changed = override(small, {"slots": 6, "tray.cells": 7})
    assert (changed.slots, changed.tray.cells) == (6, 7)
    assert override(Process(), {"strokes": [4, 5, 6]}).strokes == (4, 5, 6)


@pytest.mark.parametrize(
    ("changes", "line"),
    [
        ({"proces": 1}, "proces: no such field: did you mean process?"),
        ({"process.powr_w": 1}, "process.powr_w: no such field: did you mean power_w?"),
        ({"process": {"powr_w": 1}}, "process.powr_w: no such field: did you mean power_w?"),
        ({"power_w": 1}, "power_w: no such field: did you mean process.power_w or slow.power_w?"),
        ({"tray.qq": 1}, "tray.qq: no such field: choose from cells, name"),
        ({"": 1}, "'': no such field: choose from slots, tray, process, slow, arm, spares, other, potted"),
        (
            {"process.": 1},
            "process.'': no such field: choose from locate_s, strokes, power_w, corner_m, recall, mode, law, "
            "repeats, spot_m",
        ),
        ({"a b\n": 1}, r"'a b\n': no such field: choose from slots, tray, process, slow, arm, spares, other, potted"),
        ({1: 2}, "1: a name must be a text"),
        ({"process.mode": "slow", "process": {"mode": "fast"}}, "process: given twice: give it once"),
        ({"process": Process(), "process.mode": "slow"}, "process.mode: given twice: give it once"),
        ({"process.mode.x": 1}, "process.mode = {'x': 1}: give 'fast' or 'slow'"),
        ({"process.strokes": (3, 2, 1)}, "process.strokes = (3, 2, 1): give them in ascending order"),
        ({"slots": 60, "tray.cells": 5}, "tray.cells = 5: give 60 at least"),
        ({"slots": 13}, "Task: unlucky number"),
        ({"arm.lengths_m": (1, -1)}, "arm: lengths_m = (1.0, -1.0): give lengths > 0"),
        ({"arm.lengths_m": (1, nan)}, "arm.lengths_m[1] = nan: give a number"),
        ({"arm.hang": True}, "arm.hang: no such field: did you mean hangs?"),
        ({"other.cells": 3}, "other is incomplete: give name, a text of printable characters"),
        (
            {"spares": [{"cells": 3, "name": "x"}, {"cells": 0, "name": "x"}]},
            "spares[1].cells = 0: give a whole number in [1, 1000]",
        ),
        (
            {"a" * 999: 1},
            f"'{'a' * 27}...{'a' * 28}': no such field: choose from slots, tray, process, slow, arm, spares, "
            "other, potted",
        ),
        (3, "Task = 3: give its fields by name"),
    ],
)
def test_a_wrong_override_is_named_in_full(changes: Any, line: str) -> None:
    assert refusal(override, TASK, changes) == line


def test_a_mapping_needs_what_has_no_default() -> None:
    assert from_mapping(Task, {"slots": 4, "tray.cells": 72, "tray.name": "a"}) == TASK
    assert from_mapping(Task, {"slots": 4, "tray": {"cells": 72, "name": "a"}, "slow.locate_s": 1}).slow.locate_s == 1.0
    assert from_mapping(Task, {"slots": 5}, TASK) == replace(TASK, slots=5)
    line = refusal(from_mapping, Task, {"potted": True})
    assert line == "Task is incomplete: give slots, a whole number in [1, 64]; tray, a Tray"
    assert refusal(from_mapping, Task, {"slots": 4, "tray": {"cells": 3}}).startswith("tray is incomplete: give name")


TRAYS = st.builds(Tray, st.integers(64, 1000), st.sampled_from(["a", "é", "x y", "", "no", "1e-3"]))
PROCESSES = st.builds(
    Process,
    st.floats(0, 600),
    st.tuples(st.integers(0, 9), st.integers(10, 20), st.integers(20, 50)),
    st.none() | st.floats(1e-3, 1e4),
    st.floats(1e-6, exclude_min=False, allow_nan=False),
    st.lists(st.lists(st.floats(0, 1), max_size=3), max_size=3),
    st.sampled_from(["fast", "slow"]),
)
TASKS = st.builds(
    Task,
    st.integers(1, 12),
    TRAYS,
    PROCESSES,
    arm=st.builds(Arm, st.tuples(st.floats(0.1, 1), st.floats(0.1, 1))),
    spares=st.lists(TRAYS, max_size=3),
    other=st.none() | TRAYS,
    potted=st.booleans(),
)


@given(TASKS)
def test_round_trips(task: Task) -> None:
    mapping = to_mapping(task)
    written = json.dumps(mapping, allow_nan=False)
    assert from_mapping(Task, json.loads(written)) == task
    assert override(TASK, json.loads(written)) == task
    assert mapping["arm"] == {"lengths_m": list(task.arm.lengths_m), "hangs": True}
    assert [to_mapping(tray) for tray in task.spares] == mapping["spares"]
    yaml = pytest.importorskip("yaml")
    assert from_mapping(Task, parse_yaml(yaml.safe_dump(mapping))) == task
    assert pickle.loads(pickle.dumps(task)) == task


def test_rows_list_every_field() -> None:
    table = {line.name: line for line in rows(Task)}
    assert list(table)[:4] == ["slots", "tray.cells", "tray.name", "process.locate_s"]
    assert tuple(table["process.locate_s"])[1:] == (
        *("float", 7.304, 0.0, 600.0, "s"),
        *("Locating one head.", "identified: 16 s per head"),
    )
    assert table["slow.locate_s"].default == 30.0
    assert table["slots"].default is ...
    assert table["tray.cells"].source == "all assumed"
    assert table["process.power_w"].type == "float | None"
    assert table["process.power_w"].doc == "Optical power, if is known."
    assert table["process.power_w"].source == "assumed; published range 5-200"
    assert table["process.corner_m"].default == "inf"
    assert (table["process.corner_m"].low, table["process.corner_m"].high) == (1e-6, None)
    assert table["process.recall"].type == "tuple[tuple[float, ...], ...]"
    assert table["process.mode"].type == table["process.mode"].type == "'fast' | 'slow'"
    assert table["process.law"].type == "'quintic' | 'septic'"
    assert table["spares"].type == "tuple[Tray, ...]"
    assert table["arm.lengths_m"].type == "tuple[float, float]"
    assert {line.name: line.default for line in rows(TASK)}["tray.cells"] == 72


def test_the_schema_says_what_the_declarations_say() -> None:
    made = schema(Task)
    json.dumps(made, allow_nan=False)
    assert made["title"] == "Task"
    assert made["required"] == ["slots", "tray"]
    assert not made["additionalProperties"]
    process = made["properties"]["process"]["properties"]
    assert process["locate_s"] == {
        "type": "number",
        "minimum": 0.0,
        "maximum": 600.0,
        "description": "Locating one head [identified: 16 s per head].",
        "unit": "s",
        "default": 7.304,
    }
    assert made["properties"]["slow"]["properties"]["locate_s"]["default"] == 30.0
    assert process["mode"]["enum"] == ["fast", "slow"]
    assert process["corner_m"]["default"] == "inf"
    assert schema(Process)["description"] == "Picking one head."


def test_docstrings_are_read_where_there_is_source() -> None:
    assert documented(Undecorated) == documented(Process) | {"more": "More."}
    made: dict[str, Any] = {"Process": Process, "__name__": "prompt"}
    exec('class Told(Process):\n    other: int\n    """Not to be read."""\n', made)
    assert documented(made["Told"]) == documented(Process)


@pytest.mark.parametrize("env_id", [spec.id for spec in tasks()])
def test_every_number_of_a_task_says_what_it_means(env_id: str) -> None:
    open_classes: list[type] = [task(env_id).assembly.config]
    for cls in open_classes:
        inner = {entry.nested for entry in entries(cls).values() if entry.nested is not None}
        open_classes += [kind for kind in inner if issubclass(kind, Config) and kind not in open_classes]
        assert set(entries(cls)) <= set(documented(cls)), cls


def test_the_schema_takes_what_the_configuration_takes() -> None:
    validator = pytest.importorskip("jsonschema").Draft202012Validator
    validator.check_schema(schema(Task))
    check = validator(schema(Task)).is_valid
    good = to_mapping(replace(TASK, other=Tray(1, "b"), spares=(Tray(2, "c"),)))
    assert check(good)
    assert check(to_mapping(TASK))
    assert check({"slots": 4, "tray": {"cells": 5, "name": "x"}})
    for name, value in (
        ("slots", 65),
        ("slots", 4.5),
        ("potted", 1),
        ("tray", {"cells": 5}),
        ("process", {"strokes": [1, 2]}),
        ("process", {"strokes": [1, 2, 3, 4]}),
        ("process", {"corner_m": "-inf"}),
        ("process", {"mode": "quick"}),
        ("process", {"recall": [[2.0]]}),
        ("other", 3),
        ("unknown", 3),
    ):
        assert not check(good | {name: value}), name
        refusal(from_mapping, Task, good | {name: value})
    assert validator(schema(TASK)).is_valid({})
    named = replace(TASK, other=Tray(1, "b"))
    assert validator(schema(named)).is_valid({"other": None})
    assert from_mapping(Task, {"other": None}, named) == TASK


@dataclass(frozen=True)
class Bare(Config):
    """A field without declaration."""

    slots: int = 3


@dataclass(frozen=True)
class Loose(Config):
    """A type that is not supported."""

    slots: dict[str, int] = field(default_factory=dict)


@dataclass(frozen=True)
class Listed(Config):
    """A declared field of a type that is not supported."""

    slots: list[int] = num(..., 0, 1, "")


class Undecorated(Process):
    """The decorator is missing."""

    more: int = num(3, 0, 9, "")
    """More."""


def test_mistakes_in_declarations_are_told_to_the_developer() -> None:
    with pytest.raises(TypeError, match=r"Bare\.slots: declare it"):
        Bare()
    with pytest.raises(TypeError, match=r"Loose\.slots: declare it"):
        Loose()
    with pytest.raises(TypeError, match=r"Listed.slots: a configuration cannot hold list\[int\]"):
        Listed([1])
    with pytest.raises(TypeError, match=r"Undecorated.more: put @dataclass\(frozen=True\)"):
        Undecorated()
    with pytest.raises(TypeError, match="lower and an upper end"):
        num(1, 2, 1, "")
    with pytest.raises(TypeError, match="call it check"):

        class Replaced(Config):
            def __post_init__(self) -> None: ...
