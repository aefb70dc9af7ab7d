"""What an assumption is, and which tasks have a list of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from ...envs.references import resolved
from ..trials import Eyes

SURE = {
    "A": "read in an abstract or an excerpt",
    "V": "vendor or trade press",
    "S": "second hand",
    "M": "from memory, unchecked",
    "D": "derived from the others",
    "-": "no source found",
}
"""How sure a source is, by its letter."""


@dataclass(frozen=True)
class End:
    """One end of a parameter's range.

    Attributes:
        text: the value, in words.
        numbers: of the configuration, by dotted name.
        eyes: changes the perception model.
    """

    text: str
    numbers: Mapping[str, Any] = field(default_factory=dict)
    eyes: Eyes | None = None


@dataclass(frozen=True)
class Assumption:
    """A parameter that could as well be another.

    Attributes:
        name: what charts call it, with its unit.
        now: its present value, in words.
        low: lower end; None where the present value is it.
        high: upper end; None likewise.
        source: who says so.
        sure: letters of ``SURE``.
        kept: why the value stays, or what corrects it.
    """

    name: str
    now: str
    low: End | None
    high: End | None
    source: str
    sure: str
    kept: str

    @property
    def ends(self) -> dict[str, End]:
        """The ends that there are, by name."""
        return {name: end for name, end in (("low", self.low), ("high", self.high)) if end is not None}


@dataclass(frozen=True)
class Yardstick:
    """A figure of practice beside one of ours.

    Attributes:
        what: is measured.
        score: the mean of ours, by name.
        scale: factor from the score's unit to the shown one.
        unit: shown.
        field: figures of practice, with their sources.
        reading: what to make of the difference.
    """

    what: str
    score: str
    scale: float
    unit: str
    field: str
    reading: str


@dataclass(frozen=True)
class Dossier:
    """All that is assumed of a task.

    Attributes:
        env_id: of the task.
        assumptions: its parameters.
        yardsticks: its figures beside the field's.
        untested: what is assumed and has no counterpart that could be varied, a sentence each.
    """

    env_id: str
    assumptions: tuple[Assumption, ...]
    yardsticks: tuple[Yardstick, ...]
    untested: tuple[str, ...] = ()


_WHERE = {
    "fieldgym/SafflowerPicking-v0": "safflower:PICKING",
    "fieldgym/TrayTransplanting-v0": "transplanting:TRAYS",
    "fieldgym/LaserWeeding-v0": "laser:LASER",
    "fieldgym/LaserWeedingSpeed-v0": "laser:LASER_SPEED",
    "fieldgym/HoeWeeding-v0": "hoe:HOE",
    "fieldgym/ProduceSorting-v0": "sorting:SORTING",
}


def dossier_ids() -> tuple[str, ...]:
    """Tasks whose assumptions are listed."""
    return tuple(_WHERE)


def dossier(env_id: str) -> Dossier:
    """The assumptions of a task.

    Raises:
        ValueError: none are listed for it.
    """
    if env_id not in _WHERE:
        raise ValueError(f"no assumptions are listed for {env_id!r}: choose one of {', '.join(_WHERE)}")
    return resolved(f"fieldgym.benchmark.assumptions.{_WHERE[env_id]}")
