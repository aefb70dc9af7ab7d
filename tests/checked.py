"""Configurations of every kind of field, for tests of what they take and refuse."""

from __future__ import annotations

import pickle
from dataclasses import dataclass
from functools import cached_property
from math import inf, isnan
from typing import Any, Literal, get_args, get_origin

import pytest

from fieldgym.kernels.config import Config, ConfigError, choice, flag, nested, num, text


@dataclass(frozen=True)
class Arm:
    """A machine's geometry, no configuration: it checks itself."""

    lengths_m: tuple[float, float] = (0.175, 0.350)
    hangs: bool = True

    def __post_init__(self) -> None:
        if min(self.lengths_m) <= 0.0:
            raise ValueError(f"lengths_m = {self.lengths_m}:\ngive lengths > 0")


@dataclass(frozen=True)
class Process(Config):
    """Picking one head.

    More than the first paragraph.
    """

    locate_s: float = num(7.304, 0.0, 600.0, "s")
    """Locating one head [identified: 16 s per head]."""
    strokes: tuple[int, int, int] = num((1, 2, 3), 0, 50, "")
    """Shear strokes over the head [assumed]."""
    power_w: float | None = num(None, 1e-3, 1e4, "W")
    """Optical power [assumed], if [published range 5-200] is known."""
    corner_m: float = num(inf, 1e-6, inf, "m")
    """Largest corner radius."""
    recall: tuple[tuple[float, ...], ...] = num(((0, 1), (0.5,)), 0, 1, "")
    """By stage."""
    mode: str = choice("fast", ("fast", "slow"))
    """How."""
    law: Literal["quintic", "septic"] = choice("quintic", ("quintic", "septic"))
    """Motion law."""
    repeats: int = num(1, 0, inf, "")
    """Any number."""
    spot_m: tuple[float, float] | None = num(None, -1, 1, "m")
    """A place."""

    def check(self) -> None:
        """Strokes ascend."""
        if list(self.strokes) != sorted(self.strokes):
            self.refuse("strokes", "give them in ascending order")

    @cached_property
    def total(self) -> int:
        """All strokes."""
        return sum(self.strokes)


@dataclass(frozen=True)
class Tray(Config):
    """A tray [all assumed]."""

    cells: int = num(..., 1, 1000, "")
    """Cells."""
    name: str = text(...)
    """Name."""


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
    arm: Arm = nested(Arm)
    """Geometry."""
    spares: tuple[Tray, ...] = nested(())
    """Further trays."""
    other: Tray | None = nested(None)
    """Another tray."""
    potted: bool = flag(False)
    """Whether the plants stand in pots."""

    def check(self) -> None:
        """Rules between the parts."""
        if self.tray.cells < self.slots:
            self.refuse("tray.cells", f"give {self.slots} at least")
        if self.slots == 13:
            raise OverflowError("unlucky\nnumber")


TASK = Task(4, Tray(72, "a"))


def refusal(make: Any, *arguments: Any, **values: Any) -> str:
    """The line that a refusal prints."""
    with pytest.raises(ConfigError) as caught:
        make(*arguments, **values)
    line = str(caught.value)
    assert isinstance(caught.value, ValueError)
    assert line.isprintable(), line
    assert len(line) < 500
    assert str(pickle.loads(pickle.dumps(caught.value))) == line
    return line


def holds(value: Any, annotation: Any) -> bool:
    """Whether a value has exactly the annotated type, down to the last part, and is no NaN."""
    origin, arguments = get_origin(annotation), get_args(annotation)
    if origin is Literal:
        return type(value) is str and value in arguments
    if origin is tuple:
        kinds = arguments[:1] * len(value) if arguments[-1] is ... else arguments
        return type(value) is tuple and len(value) == len(kinds) and all(map(holds, value, kinds))
    if arguments:  # optional
        return any(value is None if part is type(None) else holds(value, part) for part in arguments)
    return type(value) is annotation and not (annotation is float and isnan(value))
