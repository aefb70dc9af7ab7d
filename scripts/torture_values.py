"""Values that come from files, arrays, command lines and mistakes, for ``torture.py``."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np


class Hostile:
    """Its repr fails, and so does everything else."""

    def __repr__(self) -> str:
        """Fail."""
        raise RuntimeError("no\nrepr")

    __str__ = __eq__ = __hash__ = __float__ = __int__ = __index__ = __len__ = __iter__ = __repr__  # type: ignore


class Loud:
    """Its repr has many lines."""

    def __repr__(self) -> str:
        """Say too much."""
        return "\n\x1b[31m" * 300


def nest(depth: int) -> Any:
    """A list in a list in a list."""
    inner: Any = 1
    for _ in range(depth):
        inner = [inner]
    return inner


NUMBERS: tuple[Any, ...] = (
    *(-1, 0, 1, 2, 7, 10**9, 2**31, 2**63, -(2**63) - 1, 2**64, 10**30, 10**400, -(10**9000)),
    *(0.0, -0.0, 0.5, 1.0, 1.5, -2.5, nan, inf, -inf, 1e-320, 1e300, 1.8e308),
    *(True, False, Decimal(1), Fraction(1, 2), 1j),
    *(np.int8(-1), np.uint8(3), np.int64(2), np.uint64(2**64 - 1), np.float32(0.1), np.float64(2.0), np.bool_(True)),
    *(np.float16(1), np.longdouble(1), np.complex128(1), np.timedelta64(3), np.datetime64("2024-01-01")),
)
ARRAYS: tuple[Any, ...] = (
    *(np.array(0), np.array([0]), np.array([[0]]), np.array([0, 1]), np.zeros((3, 3)), np.zeros((0, 3)), np.arange(50)),
    *(np.array([nan] * 3), np.array([1, None, 2], object), np.array(["a"] * 3), np.array([True] * 3)),
    *(np.ma.masked_all(3), np.ones((2, 3, 4), np.int64), np.array({}, object), np.array([2**64 - 1], np.uint64)),
)
TEXTS: tuple[Any, ...] = (
    *("", "x", "0", "7.3", "1e-3", "no", "inf", "\ud800", "two\nlines", "a" * 10**5, "\x00", "../..", "self.yaml"),
    *(b"1", bytearray(b"0"), np.str_("0"), Path("nowhere.yaml"), "/dev/zero.yaml", "analytic", "row", "fill", "field"),
)
OTHERS: tuple[Any, ...] = (
    *(None, ..., object, object(), len, slice(None), Hostile(), Loud(), [Hostile()], {"a": Hostile()}, [Loud()] * 3),
    *((), [], {}, set(), frozenset({1}), [1], (0, 1), [[1], [0.5]], [1, [2]], [None], [nan], range(3), iter([1])),
    *({"a.b": 1}, {1: 2}, {"": 1}, {"x": {"y": {"z": 1}}}, nest(40), nest(5000), [0] * 10**4, {"slots": nan}),
)
ANYTHING: tuple[Any, ...] = NUMBERS + ARRAYS + TEXTS + OTHERS


def any_of(rng: np.random.Generator, values: tuple[Any, ...] = ANYTHING) -> Any:
    """One of them; NumPy's choice would make an array of them first."""
    return values[int(rng.integers(len(values)))]


def called(value: Any) -> str:
    """A value for a fault's line, whatever it is."""
    try:
        return " ".join(repr(value).split())[:80]
    except Exception:
        return f"a {type(value).__name__}"
