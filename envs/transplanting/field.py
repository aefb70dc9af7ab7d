"""Draws trays: which cells are empty or hold a poor seedling, what happens to each plug, what a camera reports.

Each world hands over one block of uniform and one of normal numbers from its own generator; everything else is array
arithmetic over the worlds, so a world's trays do not depend on how many worlds are drawn beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from ..core import Array
from .config import EMPTY, HEALTHY, POOR, PerceptionModel, ScenarioConfig, Tray

Cells = NDArray[np.int8]

LUCKS = ("extract", "lose", "damage")
"""Uniform numbers that decide what happens to a plug, in the order of ``Field.luck``'s last axis."""


class Field(NamedTuple):
    """Trays of R worlds, tray behind tray.

    Attributes:
        source: (R, source rows, columns), ``EMPTY``, ``HEALTHY`` or ``POOR``.
        target: (R, target rows, columns), likewise.
        luck: (R, source rows, columns, 3), uniform numbers of each plug, see ``LUCKS``.
        source_lot: (R, source rows, columns), uniform numbers that decide what a statistical camera reports.
        target_lot: (R, target rows, columns), likewise.
    """

    source: Cells
    target: Cells
    luck: Array
    source_lot: Array
    target_lot: Array


def random_numbers(scenario: ScenarioConfig) -> tuple[int, int]:
    """Lengths of a world's blocks: uniform and normal numbers."""
    uniform = normal = 0
    for tray, trays in ((scenario.source, scenario.source_trays), (scenario.target, scenario.target_trays)):
        uniform += trays * tray.cells
        normal += 2 * trays * (tray.cells + (tray.rows + 2) * (tray.columns + 2))
    return uniform + len(LUCKS) * scenario.source_trays * scenario.source.cells, normal


def draw_blocks(generators: Sequence[np.random.Generator], lengths: tuple[int, int]) -> tuple[Array, Array]:
    """Blocks (R, n) of uniform and of normal numbers; each world draws its own row."""
    uniform, normal = np.empty((len(generators), lengths[0])), np.empty((len(generators), lengths[1]))
    for row, generator in enumerate(generators):
        generator.random(out=uniform[row])
        generator.standard_normal(out=normal[row])
    return uniform, normal


def draw_field(scenario: ScenarioConfig, uniform: Array, normal: Array) -> Field:
    """Sow the trays of R worlds from their random blocks (R, .)."""
    worlds = len(uniform)
    sown, lots, used_u, used_z = [], [], 0, 0
    for tray, trays in ((scenario.source, scenario.source_trays), (scenario.target, scenario.target_trays)):
        numbers = 2 * trays * (tray.cells + (tray.rows + 2) * (tray.columns + 2))
        sown.append(_sow(scenario, tray, trays, normal[:, used_z : used_z + numbers]))
        count = trays * tray.cells
        lots.append(uniform[:, used_u : used_u + count].reshape(worlds, trays * tray.rows, tray.columns))
        used_z, used_u = used_z + numbers, used_u + count
    if not scenario.replug:
        sown[1][...] = EMPTY
    luck = uniform[:, used_u:].reshape(*sown[0].shape, len(LUCKS))
    return Field(sown[0], sown[1], luck, lots[0], lots[1])


def reports(confusion: Sequence[Sequence[float]], cells: Cells, lot: Array) -> Cells:
    """What a camera with this confusion matrix reports of cells that hold ``EMPTY``, ``HEALTHY`` or ``POOR``."""
    limits = np.cumsum(np.asarray(confusion), axis=1)
    return (lot >= limits[cells, 0]).astype(np.int8) + (lot >= limits[cells, 1])


def model_reports(model: PerceptionModel, field: Field) -> tuple[Cells, Cells]:
    """Reports of every source and every target cell."""
    return reports(model.source, field.source, field.source_lot), reports(model.target, field.target, field.target_lot)


def _sow(scenario: ScenarioConfig, tray: Tray, trays: int, normal: Array) -> Cells:
    """Cells (R, trays * rows, columns): vacancies first, then poor ones among the planted."""
    worlds, count = len(normal), trays * tray.cells
    lonely = normal[:, : 2 * count].reshape(worlds, 2, trays, tray.rows, tray.columns)
    wide = normal[:, 2 * count :].reshape(worlds, 2, trays, tray.rows + 2, tray.columns + 2)
    # Nine independent numbers round a cell, a third of their sum: again standard normal, shared with the neighbours.
    columns = wide[..., :-2] + wide[..., 1:-1] + wide[..., 2:]
    shared = (columns[..., :-2, :] + columns[..., 1:-1, :] + columns[..., 2:, :]) / 3.0
    mixed = np.sqrt(1.0 - scenario.clumped) * lonely + np.sqrt(scenario.clumped) * shared
    empty = mixed[:, 0] < ndtri(scenario.vacancy)
    poor = mixed[:, 1] < ndtri(scenario.poor)
    cells = np.where(empty, EMPTY, np.where(poor, POOR, HEALTHY)).astype(np.int8)
    return cells.reshape(worlds, trays * tray.rows, tray.columns)
