"""Any value at all: a field takes it as its declared type or refuses it in one line."""

from __future__ import annotations

import json
from dataclasses import fields, replace
from decimal import Decimal
from fractions import Fraction
from math import inf, nan
from typing import Any, get_type_hints

import numpy as np
import pytest
from checked import TASK, Arm, Process, Tray, holds, refusal
from hypothesis import given
from hypothesis import strategies as st

from fieldgym.kernels.config import Config, ConfigError, from_mapping, to_mapping

pytestmark = pytest.mark.portable

# What may come from files, arrays, command lines and mistakes.
POOL = [
    *(nan, inf, -inf, None, True, False, "", "x", "7.3", "1e-3", "no", "inf", b"1", 0, 1, -1, 2, 16, 16.0, 0.5, -0.0),
    *(1e-320, 1.8e308, 1e300, 10**400, -(10**9000), 2**53 + 1, 1j, Decimal(1), Fraction(1, 2), ..., object, object()),
    *(
        (),
        [],
        {},
        set(),
        [1],
        (1, 2, 3),
        [1, 2, 3],
        [1, 2.0, 3],
        ["1", 2, 3],
        (1, 2),
        range(3),
        iter([1]),
        [[1], [0.5]],
    ),
    *([[[]]], [None], [nan], {"cells": 1}, {"cells": 1, "name": "x"}, {1: 2}, {"a.b": 1}, [{"cells": 1, "name": "x"}]),
    *(np.int64(3), np.uint64(2**64 - 1), np.int8(-1), np.float64(0.5), np.float32(0.1), np.float16(1), np.bool_(True)),
    *(np.longdouble(1), np.str_("fast"), np.timedelta64(3), np.datetime64("2024-01-01"), np.complex128(1)),
    *(np.array(1.0), np.arange(3), np.ones(3), np.ones((2, 2)), np.array([True] * 3), np.array(["a"] * 3)),
    *(np.array([nan] * 3), np.array([1, None, 2], object), np.zeros((0, 3)), np.ma.masked_all(3)),
    *(
        Arm(),
        Process(),
        Tray(1, "x"),
        Tray,
        Process,
        "fast",
        "slow",
        "septic",
        "\ud800",
        "a" * 10**5,
        [0] * 10**4,
        [["x" * 50] * 6] * 6,
    ),
]


class Hostile:
    """Its repr fails, and so does everything else."""

    def __repr__(self) -> str:
        raise RuntimeError("no\nrepr")

    __str__ = __eq__ = __hash__ = __float__ = __int__ = __index__ = __len__ = __iter__ = __repr__  # type: ignore


Hostile_list = type("list", (Hostile,), {})
"""What shortens a repr goes by the class's name, and so asks for its length."""


class Loud:
    """Its repr has many lines."""

    def __repr__(self) -> str:
        return "\n\x1b[31m" * 300


def try_value(config: Config, name: str, value: Any) -> None:
    """A value is taken as its declared type, or refused in one line that names its field."""
    cls = type(config)
    annotation = get_type_hints(cls)[name]
    full = f"{cls.__name__}.{name}"
    for way in ("make", "mapping"):
        try:
            made = replace(config, **{name: value}) if way == "make" else from_mapping(cls, {name: value}, config)
        except ConfigError as error:
            line = str(error)
            assert line.isprintable()
            assert len(line) < 500
            assert line.startswith(full if way == "make" else name) or line.startswith("Task.tray.cells"), line
            continue
        assert holds(getattr(made, name), annotation), (name, value)
        hash(made)
        again = from_mapping(cls, json.loads(json.dumps(to_mapping(made), allow_nan=False)))
        assert again == made
        assert all(holds(getattr(again, item.name), get_type_hints(cls)[item.name]) for item in fields(cls))


@pytest.mark.parametrize("config", [Process(), TASK, Tray(72, "a")], ids=lambda config: type(config).__name__)
def test_every_value_is_taken_as_declared_or_refused_in_one_line(config: Config) -> None:
    for item in fields(config):
        for value in [*POOL, Hostile(), [Hostile()], Hostile_list(), Loud(), [Loud()] * 3]:
            try_value(config, item.name, value)


ANYTHING = st.recursive(
    st.one_of(
        st.none(),
        st.booleans(),
        st.integers(),
        st.floats(),
        st.text(),
        st.binary(max_size=3),
        st.integers(0, len(POOL) - 1).map(lambda place: POOL[place]),
    ),
    lambda inner: st.one_of(
        st.lists(inner, max_size=4), st.tuples(inner, inner, inner), st.dictionaries(st.text(max_size=3), inner)
    ),
    max_leaves=12,
)


@given(st.sampled_from([Process(), TASK, Tray(72, "a")]), st.data(), ANYTHING)
def test_anything_is_taken_as_declared_or_refused_in_one_line(config: Config, data: Any, value: Any) -> None:
    try_value(config, data.draw(st.sampled_from([item.name for item in fields(config)])), value)


NUMBERS = st.one_of(
    st.integers(-3, 70),
    st.integers(),
    st.floats(),
    st.floats(-1.0, 601.0),
    st.sampled_from([0, 600, 64, 1, np.nextafter(0.0, -1.0), np.nextafter(600.0, 601.0), 601, 65, 0.0, 600.0]),
    st.integers(-(2**31), 2**31).map(np.int64),
    st.floats(width=32).map(np.float32),
    st.booleans(),
)


@given(NUMBERS)
def test_a_number_is_taken_exactly_if_it_lies_in_the_range(value: Any) -> None:
    truth, whole = type(value) is bool, type(value) in (int, np.int64)
    for make, taken, low, high in (
        (lambda: Process(locate_s=value).locate_s, not truth, 0, 600),
        (lambda: replace(TASK, slots=value, tray=Tray(100, "a")).slots, whole and value != 13, 1, 64),
    ):
        if taken and low <= value <= high:
            assert make() == value
        else:
            refusal(make)
