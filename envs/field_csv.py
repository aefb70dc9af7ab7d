"""Fields as CSV: a comment that names the task, a header, then a row a thing; see ``docs/fields.md``."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from typing import Any

import numpy as np

from ..kernels.config_kinds import show
from .field import Column, Field, FieldError
from .field_rows import KIND, Content, Row, columns_of, same_task, told

_SAID = re.compile(r"#\s*fieldgym field of (\w+); kinds: *([\w, ]*)", re.ASCII)
_SEPARATORS = {";": "semicolons", "\t": "tabulators"}


def csv_content(text: str, field_type: type[Field], file: str) -> Content:
    """What a CSV text says.

    Raises:
        FieldError: its header does not fit, or a row has other cells than the header.
    """
    lines = list(io.StringIO(text, newline=""))
    comments, kinds = 0, []
    while comments < len(lines) and (lines[comments].startswith("#") or not lines[comments].strip()):
        said = _SAID.match(lines[comments])
        if said:
            same_task(said[1], field_type, f"{file}:{comments + 1}")
            kinds = [kind.strip() for kind in said[2].split(",") if kind.strip()]
        comments += 1
    reader = csv.reader(lines[comments:], strict=True)
    header: Sequence[str] | None = None
    header_line, rows = 0, []
    try:
        for cells in reader:
            line = comments + reader.line_num
            if header is None:
                header, header_line = _header(cells, field_type, f"{file}:{line}"), line
            elif any(cell.strip() for cell in cells):
                rows.append(_row(header, cells, line, field_type, file))
    except csv.Error as error:
        raise FieldError(f"{file}:{comments + reader.line_num}: is no CSV ({error}): mend the line") from None
    if header is None:
        raise FieldError(f"{file}: is empty: give a header, {','.join((KIND, *columns_of(field_type)))}, and rows")
    return Content(rows, kinds, (header, header_line))


def _header(cells: Sequence[str], field_type: type[Field], where: str) -> list[str]:
    names = [cell.strip() for cell in cells]
    known = (KIND, *columns_of(field_type))
    for separator, word in _SEPARATORS.items():
        if len(names) == 1 and separator in names[0]:
            raise FieldError(f"{where}: columns are parted by {word}: save the file with commas and decimal points")
    for place, name in enumerate(names):
        if not name:
            raise FieldError(f"{where}: column {place + 1} has no name: give it one, or remove the column")
        if name not in known:
            raise FieldError(f"{where}: column {show(name)} is unknown: {told(name, known)}")
        if name in names[:place]:
            raise FieldError(f"{where}: column {name!r} is there twice: remove one")
    return names


def _row(header: Sequence[str], cells: Sequence[str], line: int, field_type: type[Field], file: str) -> Row:
    if len(cells) != len(header):
        raise FieldError(f"{file}:{line}: has {len(cells)} cells, the header {len(header)}: give one a column")
    values = dict(zip(header, cells, strict=True))
    kind = values.pop(KIND, field_type.main).strip()
    if kind.startswith("#"):
        raise FieldError(f"{file}:{line}: a comment between the rows: move it before the header")
    return Row(kind, values, line)


def csv_text(field: Field) -> str:
    """The CSV text of a field; what is read from it is equal, bit for bit."""
    kinds = dict(field.tables())
    columns = columns_of(type(field))
    out = io.StringIO(newline="")
    out.write(f"# fieldgym field of {field.task}; kinds: {', '.join(kinds)}\n")
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow((KIND, *columns))
    for kind, table in kinds.items():
        texts = {name: _texts(column, getattr(table, name)) for name, column in table.columns().items()}
        nothing = [""] * len(table)
        writer.writerows(zip([kind] * len(table), *(texts.get(name, nothing) for name in columns), strict=True))
    return out.getvalue()


def _texts(column: Column, values: Any) -> list[str]:
    """Cells of a column; floats in the shortest form that gives the same number back."""
    missing = column.missing(values)
    if column.labels:
        return ["" if gone else column.labels[value] for value, gone in zip(values, missing, strict=True)]
    if column.dtype is bool:
        values = values.astype(np.int64)
    return ["" if gone else repr(value) for value, gone in zip(values.tolist(), missing, strict=True)]
