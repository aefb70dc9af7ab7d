"""Fields in files: CSV and GeoJSON, which hold any field to the last bit, and what a task reads besides."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

from ..kernels.config_kinds import file_name
from ..kernels.files import replace_file
from .field import Field, FieldError, FieldT
from .field_csv import csv_content, csv_text
from .field_geojson import geojson_content, geojson_text
from .field_rows import built, scaling

MAX_BYTES = 64 * 2**20
_CSV, _GEOJSON = (".csv",), (".geojson", ".json")
_CONTENT = {**dict.fromkeys(_CSV, csv_content), **dict.fromkeys(_GEOJSON, geojson_content)}
_TEXT = {**dict.fromkeys(_CSV, csv_text), **dict.fromkeys(_GEOJSON, geojson_text)}


def read_field(
    path: str | PathLike[str], field_type: type[FieldT], unit: str = "m", scale: float | None = None
) -> FieldT:
    """The field in a file; what the file does not say is absent until a core completes it.

    Args:
        path: ``.csv``, ``.geojson``, or a form of the task's own (``Field.from_text``).
        field_type: what is to be read.
        unit: of the lengths in the file: ``"m"``, ``"cm"``, ``"mm"`` or ``"px"``.
        scale: metres a pixel, for ``"px"``.

    Raises:
        FieldError: the file cannot be read or holds no such field; one line with file, line and what to do.
    """
    metres, file = scaling(unit, scale), file_name(path)
    text = read_text(path)
    suffix = Path(path).suffix.lower()
    if suffix in _CONTENT:
        return built(field_type, _CONTENT[suffix](text, field_type, file), metres, file)
    return field_type.from_text(text, file)


def read_text(path: str | PathLike[str]) -> str:
    """The text of a file in UTF-8.

    Raises:
        FieldError: it cannot be read, is too large, empty or no UTF-8.
    """
    file = file_name(path)
    try:
        if not Path(path).is_file():
            raise FieldError(f"{file}: there is no such file")
        with open(path, "rb") as stream:
            data = stream.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        if isinstance(error, FieldError):
            raise
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise FieldError(f"{file}: cannot be read ({reason})") from None
    if len(data) > MAX_BYTES:
        raise FieldError(f"{file}: is larger than {MAX_BYTES // 2**20} MB: no field is, give another file")
    if not data:
        raise FieldError(f"{file}: is empty: give a field")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise FieldError(f"{file}:{line}: is not UTF-8: save it as UTF-8") from None


def write_field(field: Field, path: str | PathLike[str]) -> None:
    """Write a field so that reading it gives an equal one, bit for bit; an old file is replaced at once or not at all.

    Args:
        field: the field; its values must be in range, or it could not be read again.
        path: ``.csv`` or ``.geojson``.

    Raises:
        FieldError: a value is out of range, or the file cannot be written.
    """
    target, file = Path(path), file_name(path)
    if target.suffix.lower() not in _TEXT:
        raise FieldError(f"{file}: fields are written as .csv or .geojson: give one of these endings")
    field.check()
    text = _TEXT[target.suffix.lower()](field)
    try:
        replace_file(target, text)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise FieldError(f"{file}: cannot be written ({reason})") from None
