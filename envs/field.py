"""A field is a value: one instance of a task with all of its luck, the same for every policy and backend.

A task declares its field as frozen tables of columns; from that declaration come the files (``field_files``), the
documentation and the checks. Arrays are read-only: a field can be shared, compared and hashed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from dataclasses import field as dataclass_field
from functools import cache
from typing import Any, ClassVar, NamedTuple, TypeVar, get_args, get_type_hints
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Whole = NDArray[np.int64]
Flags = NDArray[np.bool_]

TableT = TypeVar("TableT", bound="Table")
FieldT = TypeVar("FieldT", bound="Field")

ABSENT = -1
"""Stands for a whole number or a label that was not given; a number that was not given is NaN."""


class FieldError(ValueError):
    """A field that cannot be used; the message is one line and says where the fault is and what to do.

    Args:
        problem: what is wrong, and what to do.
        kind: table of the row that is wrong, empty where no single row is.
        row: its number in the table, from 0.
        column: the column that is wrong, empty where no single one is.
    """

    def __init__(self, problem: str, kind: str = "", row: int = 0, column: str = ""):
        """Say it, with the row's number from 1."""
        super().__init__(f"{kind} {row + 1}: {problem}" if kind else problem)
        self.problem, self.kind, self.row, self.column = problem, kind, row, column


class Origin(NamedTuple):
    """The file that a field was read from, for messages.

    Attributes:
        file: its name.
        lines: by kind, the line of every row.
        hints: by column, what may be the reason when a value is refused.
    """

    file: str
    lines: Mapping[str, Sequence[int]]
    hints: Mapping[str, str]

    def located(self, error: FieldError) -> FieldError:
        """The error with file and line."""
        lines, hint = self.lines.get(error.kind, ()), self.hints.get(error.column, "")
        if not error.row < len(lines):
            return FieldError(f"{self.file}: {error}")
        return FieldError(f"{self.file}:{lines[error.row]}: {error.kind}: {error.problem}{hint}")


@dataclass(frozen=True)
class Column:
    """What a column holds.

    Attributes:
        dtype: of its array: ``float64``, ``int64`` or ``bool``.
        low: smallest value.
        high: largest value.
        unit: ``"m"`` is scaled where a file says so; empty for pure numbers.
        doc: what it means, in a sentence.
        labels: names of the values 0, 1, ... where they have names; files hold the names.
        fill: what a value that is not given becomes: a number, ``"uniform"`` or ``"normal"`` for one that is drawn,
            ``"task"`` where the task knows, None where it must be given.
    """

    dtype: type
    low: float
    high: float
    unit: str
    doc: str
    labels: tuple[str, ...] = ()
    fill: float | str | None = None

    @property
    def required(self) -> bool:
        """Whether a file must give it."""
        return self.fill is None

    @property
    def absent(self) -> Any:
        """What stands in the array where no value was given."""
        return np.nan if self.dtype is float else False if self.dtype is bool else ABSENT

    @property
    def suffix(self) -> str:
        """The unit as it follows a number."""
        return f" {self.unit}" if self.unit else ""

    @property
    def range(self) -> str:
        """What may be given, in words."""
        if self.labels:
            return ", ".join(self.labels)
        return f"{self.low:g} to {self.high:g}{self.suffix}"

    def missing(self, values: NDArray[Any]) -> Flags:
        """Where ``values`` were not given."""
        if self.dtype is float:
            return np.isnan(values)
        return np.zeros(len(values), bool) if self.dtype is bool else values == ABSENT


def number(unit: str, low: float, high: float, doc: str, fill: float | str | None = None) -> Any:
    """A column of float64."""
    return dataclass_field(metadata={"column": Column(float, low, high, unit, doc, fill=fill)})


def whole(low: float, high: float, doc: str, fill: float | str | None = None) -> Any:
    """A column of int64."""
    return dataclass_field(metadata={"column": Column(int, low, high, "", doc, fill=fill)})


def label(labels: tuple[str, ...], doc: str, fill: float | str | None = None) -> Any:
    """A column of int64 that files write by name."""
    column = Column(int, 0, len(labels) - 1, "", doc, labels, fill)
    return dataclass_field(metadata={"column": column})


def flag(doc: str, fill: float | None = None) -> Any:
    """A column of bool; files write 0 and 1."""
    return dataclass_field(metadata={"column": Column(bool, 0, 1, "", doc, fill=fill)})


def repeated(values: NDArray[Any]) -> Flags:
    """Rows (n, k) that were there before."""
    again = np.ones(len(values), bool)
    again[np.unique(values, axis=0, return_index=True)[1]] = False
    return again


@dataclass(frozen=True, eq=False)
class Table:
    """Rows of one kind: arrays of one length, one a column. Subclasses declare their columns."""

    def __post_init__(self) -> None:
        """Keep read-only copies of one length."""
        length: int | None = None
        for name, column in self.columns().items():
            values = np.array(getattr(self, name), dtype=column.dtype, order="C")
            if values.ndim != 1:
                raise FieldError(f"{type(self).__name__}.{name} has shape {values.shape}: give one value a row")
            if length is not None and len(values) != length:
                raise FieldError(f"{type(self).__name__}.{name} has {len(values)} rows, the first column {length}")
            length = len(values)
            if column.dtype is float:
                values[np.isnan(values)] = np.nan  # one bit pattern, as a file gives it back
            values.flags.writeable = False
            object.__setattr__(self, name, values)

    @classmethod
    @cache
    def columns(cls) -> Mapping[str, Column]:
        """The columns by name, in the order in which files have them."""
        return {item.name: item.metadata["column"] for item in fields(cls)}

    @classmethod
    def empty(cls: type[TableT], rows: int = 0) -> TableT:
        """A table in which nothing is given."""
        return cls(**{name: np.full(rows, column.absent) for name, column in cls.columns().items()})

    def __len__(self) -> int:
        """Number of rows."""
        return len(getattr(self, next(iter(self.columns()))))

    def arrays(self) -> dict[str, NDArray[Any]]:
        """The columns' arrays by name."""
        return {name: getattr(self, name) for name in self.columns()}

    def fault(self) -> tuple[int, str, str] | None:
        """A row with a value out of its column's range, the column, and what is wrong; None where all are right."""
        for name, column in self.columns().items():
            values = getattr(self, name)
            missing = column.missing(values)
            if column.required and missing.any():
                return int(np.argmax(missing)), name, f"{name} is missing: give it"
            wrong = ~missing & ~((values >= column.low) & (values <= column.high) & np.isfinite(values))
            if wrong.any():
                row = int(np.argmax(wrong))
                return row, name, f"{name} = {values[row]:.10g}{column.suffix}: give {column.range}"
        return None

    def filled(self: TableT, generator: np.random.Generator) -> TableT:
        """The table with what was not given filled in; what is drawn is drawn column by column, in order."""
        changes = {}
        for name, column in self.columns().items():
            values = getattr(self, name)
            missing = column.missing(values)
            if not missing.any() or column.fill in (None, "task"):
                continue
            drawn: Any = column.fill
            if column.fill == "uniform":
                drawn = generator.random(len(values))
            elif column.fill == "normal":
                drawn = generator.standard_normal(len(values))
            changes[name] = np.where(missing, drawn, values)
        return replace(self, **changes) if changes else self

    def given(self: TableT, **others: Any) -> TableT:
        """The table with other values, one or one a row, where none were given, by column."""
        mine = {name: getattr(self, name) for name in others}
        missing = {name: self.columns()[name].missing(values) for name, values in mine.items()}
        return replace(self, **{name: np.where(missing[name], other, mine[name]) for name, other in others.items()})

    def refuse(self, kind: str, wrong: Flags, column: str, advice: str) -> None:
        """Raise the error for the first row that is wrong (n,), where one is; ``kind`` is what the field calls it.

        Raises:
            FieldError: a row is wrong.
        """
        if wrong.any():
            row = int(np.argmax(wrong))
            value, suffix = getattr(self, column)[row], self.columns()[column].suffix
            raise FieldError(f"{column} = {value:.10g}{suffix}: {advice}", kind, row, column)

    def keep_within(self, kind: str, column: str, low: float, high: float, what: str) -> None:
        """``refuse`` the rows beyond a column's limits, which are those of ``what``."""
        values = getattr(self, column)
        advice = f"outside the {what}, give {low:g} to {high:g}{self.columns()[column].suffix}"
        self.refuse(kind, (values < low) | (values > high), column, advice)

    def keep_to(self, kind: str, most: int, advice: str) -> None:
        """Refuse more rows than there is room for.

        Raises:
            FieldError: there are more.
        """
        if len(self) > most:
            raise FieldError(f"the scenario has room for {most} {kind}: {advice}, or leave some out", kind, most)


@dataclass(frozen=True, eq=False)
class Field:
    """Base of the tasks' fields: a frozen dataclass whose attributes are tables, or None where there is none.

    Attributes:
        task: word that files carry.
        main: the table that the rows of a file without a column ``kind`` belong to.
        places: names of the columns that are coordinates, along first; GeoJSON makes points of them. Two rows of a kind
            that every field has must not have the same.
        origin: the file that this one was read from, no part of its value.
    """

    task: ClassVar[str]
    main: ClassVar[str]
    places: ClassVar[tuple[str, ...]] = ("along_m", "across_m")
    origin: ClassVar[Origin | None] = None

    @classmethod
    def from_text(cls: type[FieldT], text: str, where: str) -> FieldT:
        """A field in a form of the task's own: what a file holds that is neither CSV nor GeoJSON.

        Args:
            text: the file's.
            where: its name, for messages.

        Raises:
            FieldError: the text is no such field; a task without a form of its own has none.
        """
        raise FieldError(f"{where}: give a .csv or a .geojson file: {cls.task} has no other form")

    @classmethod
    @cache
    def kinds(cls) -> Mapping[str, type[Table]]:
        """The tables' types by name: what a file's column ``kind`` may say."""
        kinds = {}
        for name, hint in get_type_hints(cls).items():
            for option in (hint, *get_args(hint)):
                if isinstance(option, type) and issubclass(option, Table):
                    kinds[name] = option
        return kinds

    @classmethod
    @cache
    def optional(cls) -> frozenset[str]:
        """Kinds that a field may lack."""
        hints = get_type_hints(cls)
        return frozenset(name for name in cls.kinds() if type(None) in get_args(hints[name]))

    def tables(self) -> Iterator[tuple[str, Table]]:
        """The tables that there are, by kind."""
        for name in self.kinds():
            table = getattr(self, name)
            if table is not None:
                yield name, table

    def check(self) -> None:
        """Hold every value to its column's range.

        Raises:
            FieldError: one is out of it.
        """
        for kind, table in self.tables():
            fault = table.fault()
            if fault is not None:
                row, column, problem = fault
                raise FieldError(problem, kind, row, column)

    def filled(self: FieldT, generator: np.random.Generator) -> FieldT:
        """The field with every column's own way of filling applied; see ``Column.fill``."""
        return replace(self, **{kind: table.filled(generator) for kind, table in self.tables()})

    def digest(self) -> str:
        """Sixteen hexadecimal digits that tell this field from any other."""
        sha = hashlib.sha256(self.task.encode())
        for kind, table in self.tables():
            for name, values in table.arrays().items():
                sha.update(f"{kind}.{name}:{len(values)};".encode() + values.tobytes())
        return sha.hexdigest()[:16]

    def __eq__(self, other: object) -> bool:
        """Whether every value is the same, bit for bit."""
        return type(other) is type(self) and other.digest() == self.digest()  # type: ignore[attr-defined]

    def __hash__(self) -> int:
        """Equal fields have equal hashes."""
        return hash(self.digest())


@dataclass(frozen=True, eq=False)
class Camera(Table):
    """Whose reports a field holds, in one row; another camera makes its own of the same field."""

    code: Whole = whole(0, 2**32 - 1, "check sum of the statistics that the reports were drawn from")

    @classmethod
    def of(cls, perception: object) -> Camera:
        """The camera with these statistics, a frozen configuration."""
        return cls(np.array([crc32(repr(perception).encode())]))


class Toy(NamedTuple):
    """An instance small enough to check by hand.

    Attributes:
        name: short.
        field: the instance.
        overrides: of the configuration it is meant for, dotted names.
        net_rate: the best that any policy can reach.
        episode_return: the largest sum of rewards.
        why: how one sees that.
    """

    name: str
    field: Field
    overrides: dict[str, Any]
    net_rate: float
    episode_return: float
    why: str
