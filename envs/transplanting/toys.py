"""Trays small enough to check by hand, with what the best policy reaches on them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from ..field import Toy
from .config import EMPTY, HEALTHY, POOR
from .field import TrayField

_PITCH_M = 0.08


def toys() -> tuple[Toy, ...]:
    """The toys. Gates have the quintic law with stops; where nothing else is said every plug's luck is middling."""
    return (
        Toy(
            name="one-plug",
            field=_lucky([[HEALTHY]], [[EMPTY]]),
            overrides=_trays((1, 1), (1, 1)),
            net_rate=1.0,
            episode_return=-0.0960238931535,
            why="Plant the plug at full speed, whose chances of harm stay below its luck of 0.5, then send the tray "
            "away: from above the chute 0.16 m across and 0.15 m down, up, 0.32 m across and down, and up once more.",
        ),
        Toy(
            name="poor-in-the-way",
            field=_lucky([[POOR, HEALTHY]], [[POOR]]),
            overrides=_trays((1, 2), (1, 1)),
            net_rate=1.0,
            episode_return=-0.2381209963174,
            why="The poor seedling in the target cell goes to the chute first, then the healthy plug is planted at "
            "full speed; the poor plug gains nothing wherever it goes.",
        ),
        Toy(
            name="handle-with-care",
            field=_lucky([[HEALTHY], [HEALTHY]], [[EMPTY]], extract=((0.99,), (0.5,)), lose=((0.5,), (0.01,))),
            overrides=_trays((2, 1), (1, 1)),
            net_rate=1.0,
            episode_return=-0.4617432734702,
            why="The first row's plug would be torn: it leaves unused, which costs as much as tearing it but no time. "
            "The second row's would be lost at full speed (chance 0.03), not at normal speed (0.005).",
        ),
    )


def _trays(source: tuple[int, int], target: tuple[int, int]) -> dict[str, Any]:
    """One tray a side with these rows and columns."""
    trays = {
        f"scenario.{side}.{name}": value
        for side, (rows, columns) in (("source", source), ("target", target))
        for name, value in (("rows", rows), ("columns", columns), ("pitch_m", _PITCH_M))
    }
    return {**trays, "scenario.source_trays": 1, "scenario.target_trays": 1, "scenario.replug": True}


def _lucky(source: Sequence[Sequence[int]], target: Sequence[Sequence[int]], **luck: Sequence[Sequence[float]]) -> Any:
    """Trays that hold these, every number of chance 0.5 but those that are given by cell."""
    field = TrayField.of_cells(source, target)
    assert field.target is not None
    even = {name: np.full(len(field.source), 0.5) for name in ("lot", "extract", "lose", "damage")}
    given = {name: np.ravel(values) for name, values in luck.items()}
    return replace(
        field,
        source=replace(field.source, **{**even, **given}),
        target=replace(field.target, lot=np.full(len(field.target), 0.5)),
    )
