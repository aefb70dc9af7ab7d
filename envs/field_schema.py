"""What a field's declaration says, for people: the columns of its files as rows of a table."""

from __future__ import annotations

from typing import NamedTuple

from .field import Column, Field

DRAWN = ("uniform", "normal")


class ColumnLine(NamedTuple):
    """A column of a field's files.

    Attributes:
        kind: table that it belongs to.
        name: of the column.
        unit: empty for pure numbers.
        values: what may be given: a range, names, or 0 and 1.
        if_missing: what becomes of a value that is not given; empty where it must be given.
        doc: what it means.
    """

    kind: str
    name: str
    unit: str
    values: str
    if_missing: str
    doc: str


def column_lines(field_type: type[Field]) -> list[ColumnLine]:
    """All columns of a field's files, table by table."""
    return [
        ColumnLine(kind, name, column.unit, _values(column), _if_missing(column), column.doc)
        for kind, table in field_type.kinds().items()
        for name, column in table.columns().items()
    ]


def summary(kind: str, field_type: type[Field]) -> str:
    """What the rows of a kind are, in a sentence."""
    table = field_type.kinds()[kind]
    said = (table.__doc__ or "").strip()
    # What a dataclass without a docstring has for one is its signature.
    first = "" if said.startswith(f"{table.__name__}(") else said.splitlines()[0]
    return f"{first} May be left out.".strip() if kind in field_type.optional() else first


def markdown(field_type: type[Field]) -> str:
    """The columns as tables of a page, one a kind."""
    parts = []
    for kind in field_type.kinds():
        rows = [
            f"| `{line.name}` | {line.unit} | {line.values} | {line.if_missing or '**must be given**'} | {line.doc} |"
            for line in column_lines(field_type)
            if line.kind == kind
        ]
        head = ["| Column | Unit | Values | If missing | Meaning |", "|---|---|---|---|---|"]
        parts.append("\n".join([f"`{kind}`: {summary(kind, field_type)}", "", *head, *rows]))
    return "\n\n".join(parts) + "\n"


def _values(column: Column) -> str:
    if column.dtype is bool:
        return "0, 1"
    if column.labels:
        return ", ".join(column.labels)
    return f"{int(column.low)} to {int(column.high)}" if column.dtype is int else f"{column.low:g} to {column.high:g}"


def _if_missing(column: Column) -> str:
    fill = column.fill
    if fill is None:
        return ""
    if isinstance(fill, str):
        return f"drawn, {fill}" if fill in DRAWN else "the task's choice"
    if column.labels:
        return column.labels[int(fill)]
    return f"{fill:g}"
