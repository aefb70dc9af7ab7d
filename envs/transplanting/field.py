"""Trays as a value: what every cell holds, each plug's luck, what a camera will report; drawn, stacked, completed.

Each world hands over one block of uniform and one of normal numbers from its own generator; everything else is array
arithmetic over the worlds, so a world's trays do not depend on how many worlds are drawn beside it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtri

from ..arrays import allocated, shaped
from ..columns import names
from ..core import Array
from ..dice import draw_blocks
from ..drives import DriveLuck
from ..field import Field, FieldError, Origin, Table, Toy, Whole, label, number, whole
from .columns import Lucks
from .config import (
    EMPTY,
    HEALTHY,
    POOR,
    REPORTS,
    OrderBook,
    PerceptionModel,
    ScenarioConfig,
    TransplantingConfig,
    Tray,
)

Cells = NDArray[np.int8]
Shape = tuple[int, int]
CellsT = TypeVar("CellsT", bound="TargetCells")
_LUCKS = names(Lucks)
GRADES = ("first", "second")
_CONTENTS = np.array([HEALTHY, POOR], np.int8)
"""What seedlings of the grades are, in a cell."""
_MOST_ROWS, _MOST_COLUMNS = 10_000, 50
"""Of the trays of a configuration."""


@dataclass(frozen=True, eq=False)
class TargetCells(Table):
    """Cells of the trays to serve."""

    row: Whole = whole(0, _MOST_ROWS - 1, "row of its tray, counted on from tray to tray; the first to come is 0")
    column: Whole = whole(0, _MOST_COLUMNS - 1, "place in its row, 0 the leftmost")
    state: Whole = label(REPORTS, "what the cell holds")
    lot: Array = number("", 0.0, 1.0, "decides what a statistical camera reports of it, and its looks", fill="uniform")


@dataclass(frozen=True, eq=False)
class SourceCells(TargetCells):
    """Cells of the supply, each with its plug's luck."""

    extract: Array = number("", 0.0, 1.0, "the plug leaves its cell whole below the chance of it", fill="uniform")
    lose: Array = number("", 0.0, 1.0, "the plug is lost on the way below the speed's chance of it", fill="uniform")
    damage: Array = number("", 0.0, 1.0, "the plug arrives damaged below the speed's chance of it", fill="uniform")


@dataclass(frozen=True, eq=False)
class Orders(Table):
    """The target trays as they are ordered, in the order of their places on the carousel."""

    grade: Whole = label(GRADES, "what its cells are to hold: healthy seedlings are the first grade, poor the second")
    due_s: Array = number("s", 0.0, 1e6, "when its lorry leaves; what is planted later does not count")


@dataclass(frozen=True, eq=False)
class TrayField(Field):
    """The trays of an episode, tray behind tray; a cell that is not given is empty.

    Attributes:
        source: the supply.
        target: the trays to serve; None where all of them come empty.
        drives: luck of the machine's drives; None where none errs.
        orders: what is ordered, a row a target tray; None where nothing is.
    """

    task: ClassVar[str] = "trays"
    main: ClassVar[str] = "source"
    places: ClassVar[tuple[str, ...]] = ()

    source: SourceCells
    target: TargetCells | None = None
    drives: DriveLuck | None = None
    orders: Orders | None = None

    @classmethod
    def of_cells(cls, source: Sequence[Sequence[int]], target: Sequence[Sequence[int]]) -> TrayField:
        """Trays of which only the cells' contents are given, by row: ``EMPTY``, ``HEALTHY`` or ``POOR``."""
        return cls(_listed(SourceCells, source), _listed(TargetCells, target))

    @classmethod
    def from_text(cls, text: str, where: str) -> TrayField:
        """Trays from a plain map of their cells, see ``grid``."""
        from .grid import read_grid

        told = read_grid(text, where)
        made = cls.of_cells(told.source, told.target)
        width = {"source": len(told.source[0]), "target": len(told.target[0]) if told.target else 0}
        lines = {side: np.repeat(told.lines[side], cells).tolist() for side, cells in width.items()}
        object.__setattr__(made, "origin", Origin(where, lines, {}))
        return made

    @classmethod
    def toy(cls) -> tuple[Toy, ...]:
        """Trays small enough to check by hand."""
        return _toys()


class TrayBatch(NamedTuple):
    """Trays of R worlds, tray behind tray."""

    source: Annotated[Cells, shaped("source_rows", "source_columns")]
    """``EMPTY``, ``HEALTHY`` or ``POOR``."""
    target: Annotated[Cells, shaped("target_rows", "target_columns")]
    """Likewise."""
    luck: Annotated[Array, shaped("source_rows", "source_columns", Lucks)]
    """Uniform numbers of each plug, see ``Lucks``."""
    source_lot: Annotated[Array, shaped("source_rows", "source_columns")]
    """Uniform numbers that decide what a statistical camera reports."""
    target_lot: Annotated[Array, shaped("target_rows", "target_columns")]
    """Likewise."""
    drives: Annotated[Array, shaped("joints")]
    """Luck of the machine's drives, see ``drives.DriveLuck``; empty where none errs."""
    grade: Annotated[Cells, shaped("orders")]
    """What each ordered tray's cells are to hold; empty without orders."""
    due_s: Annotated[Array, shaped("orders")]
    """When its lorry leaves."""


def shapes(scenario: ScenarioConfig) -> tuple[Shape, Shape]:
    """Rows and columns of all source and of all target trays."""
    source, target = scenario.source, scenario.target
    return (scenario.source_trays * source.rows, source.columns), (scenario.target_trays * target.rows, target.columns)


def draw(config: TransplantingConfig, generator: np.random.Generator) -> TrayField:
    """The trays of a scenario."""
    return unstacked(draw_batch(config.scenario, [generator]))[0]


def draw_batch(scenario: ScenarioConfig, generators: Sequence[np.random.Generator]) -> TrayBatch:
    """Trays of as many worlds as there are generators."""
    sides = (scenario.source, scenario.source_trays), (scenario.target, scenario.target_trays)
    blocks = [2 * trays * (tray.cells + (tray.rows + 2) * (tray.columns + 2)) for tray, trays in sides]
    lots = [trays * tray.cells for tray, trays in sides]
    worlds = len(generators)
    most = sum(lots) + len(_LUCKS) * lots[0]
    orders = scenario.target_trays if scenario.orders.on else 0
    uniform, normal = draw_blocks(generators, (most + 2 * orders, sum(blocks)))
    (source, target), cells = shapes(scenario), np.cumsum(lots)
    poor = np.array(scenario.orders.supply)[: scenario.source_trays, None, None] if orders else scenario.poor
    source_cells = _sow(scenario, poor, *sides[0], normal[:, : blocks[0]])
    target_cells = np.full((worlds, *target), EMPTY, np.int8)
    if scenario.replug:
        target_cells = _sow(scenario, scenario.poor, *sides[1], normal[:, blocks[0] :])
    return TrayBatch(
        source_cells,
        target_cells,
        uniform[:, cells[1] : most].reshape(worlds, *source, len(_LUCKS)),
        uniform[:, : cells[0]].reshape(worlds, *source),
        uniform[:, cells[0] : cells[1]].reshape(worlds, *target),
        np.zeros((worlds, 0)),
        *_order(scenario.orders, *np.split(uniform[:, most:], 2, axis=1)),
    )


def _order(book: OrderBook, by_grade: Array, by_due: Array) -> tuple[Cells, Array]:
    """Grades and times (R, trays) of ordered trays from uniform numbers: as many of each, in any order."""
    trays = by_grade.shape[1]
    first = np.argsort(np.argsort(by_grade, axis=1), axis=1) < trays - round(book.second * trays)
    place = 1.0 + np.argsort(np.argsort(by_due, axis=1), axis=1).astype(np.float64)
    return np.where(first, *_CONTENTS).astype(np.int8), book.first_s + book.every_s * place


def stacked(fields: Sequence[TrayField], source: Shape, target: Shape) -> TrayBatch:
    """The batch of fields that have every cell of their trays, which are of these shapes."""
    sizes = dict(zip(("source_rows", "source_columns", "target_rows", "target_columns"), source + target, strict=True))
    ordered = [0 if field.orders is None else len(field.orders) for field in fields]
    batch = allocated(TrayBatch, len(fields), joints=0, orders=max(ordered, default=0), **sizes)
    for world, field in enumerate(fields):
        assert field.target is not None
        here, there = (field.source.row, field.source.column), (field.target.row, field.target.column)
        batch.source[world][here], batch.target[world][there] = field.source.state, field.target.state
        batch.source_lot[world][here], batch.target_lot[world][there] = field.source.lot, field.target.lot
        for luck, name in enumerate(_LUCKS):
            batch.luck[world][(*here, luck)] = getattr(field.source, name)
        if field.orders is not None:
            batch.grade[world], batch.due_s[world] = _CONTENTS[field.orders.grade], field.orders.due_s
    return batch


def unstacked(batch: TrayBatch) -> list[TrayField]:
    """The fields of a batch, their cells row by row."""
    fields = []
    for source, target, luck, source_lot, target_lot, _, grade, due_s in zip(*batch, strict=True):
        lucks = dict(zip(_LUCKS, luck.reshape(-1, len(_LUCKS)).T, strict=True))
        plugs = SourceCells(*_places(source.shape), source.ravel(), source_lot.ravel(), **lucks)
        cells = TargetCells(*_places(target.shape), target.ravel(), target_lot.ravel())
        orders = Orders(grade != HEALTHY, due_s) if len(due_s) else None
        fields.append(TrayField(plugs, cells, orders=orders))
    return fields


def with_every_cell(field: TrayField, source: Shape, target: Shape) -> TrayField:
    """The field with every cell of trays of these shapes, row by row; those that were not given are empty.

    Raises:
        FieldError: a cell lies outside the trays, or is given twice.
    """
    served = TargetCells.empty() if field.target is None else field.target
    cells = _every_cell("source", field.source, source), _every_cell("target", served, target)
    return TrayField(*cells, field.drives, field.orders)


def reports(confusion: Sequence[Sequence[float]], cells: Cells, lot: Array) -> Cells:
    """What a camera with this confusion matrix reports of cells that hold ``EMPTY``, ``HEALTHY`` or ``POOR``."""
    limits = np.cumsum(np.asarray(confusion), axis=1)
    return (lot >= limits[cells, 0]).astype(np.int8) + (lot >= limits[cells, 1])


def model_reports(model: PerceptionModel, batch: TrayBatch) -> tuple[Cells, Cells]:
    """Reports of every source and every target cell."""
    return reports(model.source, batch.source, batch.source_lot), reports(model.target, batch.target, batch.target_lot)


def _listed(kind: type[CellsT], cells: Sequence[Sequence[int]]) -> CellsT:
    places = [(row, column, state) for row, line in enumerate(cells) for column, state in enumerate(line)]
    given = zip(("row", "column", "state"), np.array(places, np.int64).reshape(-1, 3).T, strict=True)
    return replace(kind.empty(len(places)), **dict(given))


def _every_cell(side: str, table: CellsT, shape: Shape) -> CellsT:
    rows, columns = shape
    outside = (table.row >= rows) | (table.column >= columns)
    if outside.any():
        i = int(np.argmax(outside))
        known = f"rows 0 to {rows - 1} and columns 0 to {columns - 1}"
        raise FieldError(
            f"row {table.row[i]}, column {table.column[i]} lies outside the {side} trays: give {known}", side, i
        )
    cell = table.row * columns + table.column
    if len(cell) == rows * columns and (np.diff(cell) > 0).all():
        return table
    known, first = np.unique(cell, return_index=True)
    if len(known) < len(cell):
        i = int(np.setdiff1d(np.arange(len(cell)), first)[0])
        raise FieldError(f"row {table.row[i]}, column {table.column[i]} is given twice: remove one", side, i)
    # Where no cell is given there is an empty one.
    completed = {name: np.full(rows * columns, kind.absent) for name, kind in table.columns().items()}
    completed["state"][:] = EMPTY
    for name, values in table.arrays().items():
        completed[name][cell] = values
    completed["row"], completed["column"] = _places(shape)
    return replace(table, **completed)


def _places(shape: tuple[int, ...]) -> tuple[Whole, Whole]:
    """Row and column of every cell, row by row."""
    row, column = np.indices(shape).reshape(2, -1)
    return row, column


def _sow(scenario: ScenarioConfig, poor_share: Any, tray: Tray, trays: int, normal: Array) -> Cells:
    """Cells (R, trays * rows, columns): vacancies first, then poor ones among the planted, a share or one a tray."""
    worlds, count = len(normal), trays * tray.cells
    lonely = normal[:, : 2 * count].reshape(worlds, 2, trays, tray.rows, tray.columns)
    wide = normal[:, 2 * count :].reshape(worlds, 2, trays, tray.rows + 2, tray.columns + 2)
    # Nine independent numbers round a cell, a third of their sum: again standard normal, shared with the neighbours.
    columns = wide[..., :-2] + wide[..., 1:-1] + wide[..., 2:]
    shared = (columns[..., :-2, :] + columns[..., 1:-1, :] + columns[..., 2:, :]) / 3.0
    mixed = np.sqrt(1.0 - scenario.clumped) * lonely + np.sqrt(scenario.clumped) * shared
    empty = mixed[:, 0] < ndtri(scenario.vacancy)
    poor = mixed[:, 1] < ndtri(poor_share)
    cells = np.where(empty, EMPTY, np.where(poor, POOR, HEALTHY)).astype(np.int8)
    return cells.reshape(worlds, trays * tray.rows, tray.columns)


_PITCH_M = 0.08


def _toys() -> tuple[Toy, ...]:
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
