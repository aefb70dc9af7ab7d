"""From what files say to tables: rows of texts and numbers, checked against the declaration of a field."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.config_kinds import show
from .assembly import meant
from .field import Column, Field, FieldError, FieldT, Origin, Table

KIND = "kind"
UNITS = ("m", "cm", "mm", "px")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
_FLAGS = {"0": False, "1": True, "false": False, "true": True}
_MOST = 2**53
"""Whole numbers up to here are exact in every format."""
_NAME_SHOWN = 40


class Row(NamedTuple):
    """A row of a file.

    Attributes:
        kind: of its table.
        values: what it says by column: text, numbers or truth values; None or an empty text where nothing is said.
        line: where it stands.
    """

    kind: str
    values: Mapping[str, Any]
    line: int


@dataclass(frozen=True)
class Content:
    """What a file says.

    Attributes:
        rows: in the file's order.
        kinds: those that the file has even if they have no rows.
        header: the columns that a table has and where they are named; None where every row names its own.
        hints: by column, what may be the reason when a value is refused.
    """

    rows: Sequence[Row]
    kinds: Sequence[str] = ()
    header: tuple[Sequence[str], int] | None = None
    hints: Mapping[str, str] = field(default_factory=dict)


Scaling = Callable[[NDArray[np.float64]], NDArray[np.float64]]


def scaling(unit: str, scale: float | None) -> Scaling:
    """What makes metres of a file's lengths.

    Args:
        unit: of the file's lengths.
        scale: metres a pixel, for ``"px"``.

    Raises:
        FieldError: the unit is unknown, or a scale is missing, out of place or no positive number.
    """
    if unit not in UNITS:
        raise FieldError(f"unit = {show(unit)} is unknown: choose one of {', '.join(map(repr, UNITS))}")
    if unit != "px":
        if scale is not None:
            raise FieldError(f"scale = {show(scale)} is metres a pixel: it goes with unit = 'px', not with {unit!r}")
        parts = {"m": 1.0, "cm": 100.0, "mm": 1000.0}[unit]
        return lambda values: values / parts  # 12.5 mm is then the float nearest to 0.0125
    if isinstance(scale, bool) or not isinstance(scale, int | float) or not 0.0 < scale < 1.0:
        raise FieldError(
            f"scale = {show(scale)}: with unit = 'px' give the metres a pixel, more than 0 and less than 1"
        )
    return lambda values: values * scale


def told(name: str, known: Sequence[str]) -> str:
    """What to choose instead of a name from a file."""
    return meant(name[:_NAME_SHOWN], known)


def columns_of(field_type: type[Field]) -> tuple[str, ...]:
    """All columns of a field's tables, places first, then in the order of their declaration."""
    names = [name for table in field_type.kinds().values() for name in table.columns()]
    return tuple(dict.fromkeys([*(name for name in field_type.places if name in names), *names]))


def same_task(task: Any, field_type: type[Field], where: str) -> None:
    """Refuse the file of another task.

    Raises:
        FieldError: ``task`` is another's word.
    """
    if task != field_type.task:
        raise FieldError(f"{where}: is a field of {show(task)}: this task takes one of {field_type.task!r}")


def known_kind(kind: Any, field_type: type[Field], where: str) -> str:
    """``kind`` when the field has such a table.

    Raises:
        FieldError: it has not.
    """
    if not isinstance(kind, str) or kind not in field_type.kinds():
        advice = told(str(kind), tuple(field_type.kinds()))
        raise FieldError(f"{where}: kind {show(kind)} is unknown: {advice}")
    return kind


def built(field_type: type[FieldT], content: Content, metres: Scaling, file: str) -> FieldT:
    """The field of a file's rows.

    Args:
        field_type: what is to be made.
        content: the file's.
        metres: see ``scaling``.
        file: its name, for messages.

    Raises:
        FieldError: a row does not fit the declaration, or is there twice.
    """
    by_kind: dict[str, list[Row]] = {kind: [] for kind in field_type.kinds()}
    for row in content.rows:
        by_kind[known_kind(row.kind, field_type, f"{file}:{row.line}")].append(row)
    for kind in content.kinds:
        known_kind(kind, field_type, file)
    hints = dict(content.hints)
    tables: dict[str, Table | None] = {}
    for kind, rows in by_kind.items():
        if not rows and kind in field_type.optional() and kind not in content.kinds:
            tables[kind] = None
            continue
        table_type = field_type.kinds()[kind]
        if rows and content.header is not None:
            _complete_header(kind, table_type, content.header, file)
        table = tables[kind] = _table(kind, table_type, rows, metres, file)
        fault = table.fault()
        if fault is not None:
            index, name, problem = fault
            column = table_type.columns()[name]
            advice = hints.get(name) or other_unit(column, getattr(table, name)[index], column.low, column.high)
            raise FieldError(f"{file}:{rows[index].line}: {kind}: {problem}{advice}")
        if kind not in field_type.optional():
            _single(field_type, table, rows, file)
    made = field_type(**tables)
    lines = {kind: [row.line for row in rows] for kind, rows in by_kind.items()}
    object.__setattr__(made, "origin", Origin(file, lines, hints))
    return made


def _complete_header(kind: str, table_type: type[Table], header: tuple[Sequence[str], int], file: str) -> None:
    names, line = header
    for name, column in table_type.columns().items():
        if column.required and name not in names:
            raise FieldError(f"{file}:{line}: column {name!r} is missing: a {kind} needs it, add it ({column.doc})")


def _table(kind: str, table_type: type[Table], rows: Sequence[Row], metres: Scaling, file: str) -> Table:
    columns = table_type.columns()
    for row in rows:
        for name, raw in row.values.items():
            if name not in columns and not _empty(raw):
                advice = told(name, tuple(columns))
                raise FieldError(f"{file}:{row.line}: {kind} has no column {show(name)}: {advice}")
    arrays: dict[str, NDArray[Any]] = {}
    for name, column in columns.items():
        values = np.full(len(rows), column.absent)
        for index, row in enumerate(rows):
            values[index] = _value(column, name, row.values.get(name), f"{file}:{row.line}: {kind}")
        arrays[name] = metres(values) if column.unit == "m" else values
    return table_type(**arrays)


def _value(column: Column, name: str, raw: Any, where: str) -> Any:
    """One value of a column, from a text, a number or a truth value."""
    if _empty(raw):
        if column.dtype is not bool:
            return column.absent
        if column.required:
            raise FieldError(f"{where}: {name} is missing: give 0 or 1")
        return bool(column.fill) if isinstance(column.fill, int | float) else False
    text = raw.strip() if isinstance(raw, str) else None
    if column.labels:
        if text not in column.labels:
            raise FieldError(f"{where}: {name} = {show(raw)} is unknown: {told(str(raw), column.labels)}")
        return column.labels.index(str(text))
    if column.dtype is bool:
        if isinstance(raw, bool) or (not isinstance(raw, float) and str(raw).strip().lower() in _FLAGS):
            return _FLAGS[str(raw).strip().lower()]
        raise FieldError(f"{where}: {name} = {show(raw)} is no truth value: give 0 or 1")
    return _number(column, name, raw if text is None else text, where)


def _number(column: Column, name: str, raw: Any, where: str) -> float | int:
    leave = "" if column.required else ", or leave it out"
    advice = f"give a number, {column.range}{leave}"
    if isinstance(raw, str) and not _NUMBER.fullmatch(raw):
        raise FieldError(f"{where}: {name} = {show(raw)} is no number: {advice}")
    if isinstance(raw, bool) or not isinstance(raw, str | int | float):
        raise FieldError(f"{where}: {name} = {show(raw)} is no number: {advice}")
    try:
        value = float(raw)
    except OverflowError:
        value = math.inf
    if not math.isfinite(value):
        raise FieldError(f"{where}: {name} = {show(raw)} is no finite number: {advice}")
    if column.dtype is float:
        return value
    if not value.is_integer() or abs(value) > _MOST:
        raise FieldError(f"{where}: {name} = {show(raw)} is no whole number: give one, {column.range}{leave}")
    return int(value)


def _empty(raw: Any) -> bool:
    return raw is None or (isinstance(raw, str) and not raw.strip())


def other_unit(column: Column, value: Any, low: float, high: float) -> str:
    """The units that a file may be in where a length is far out of a range."""
    if column.unit != "m" or low - 9.0 * (high - low) <= value <= high + 9.0 * (high - low):
        return ""
    fits = [unit for unit, parts in (("mm", 1000.0), ("cm", 100.0)) if low <= value / parts <= high]
    return f" (is the file in {' or '.join(fits)}? then read it with that unit)" if fits else ""


def _single(field_type: type[Field], table: Table, rows: Sequence[Row], file: str) -> None:
    """Refuse a second row at the same place."""
    places = [name for name in field_type.places if name in table.columns()]
    if not places or len(places) < len(field_type.places):
        return
    first: dict[tuple[float, ...], int] = {}
    for row, place in zip(rows, zip(*(getattr(table, name).tolist() for name in places), strict=True), strict=True):
        if place in first:
            said = ", ".join(f"{name} = {value + 0.0:.10g}" for name, value in zip(places, place, strict=True))
            raise FieldError(
                f"{file}:{row.line}: {row.kind}: {said} is there twice, first in line {first[place]}: remove one"
            )
        first[place] = row.line
