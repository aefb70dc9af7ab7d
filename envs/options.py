"""What may be asked of a reset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

from .assembly import meant
from .field import Field


def checked_options(options: Any, known: Sequence[str]) -> Mapping[str, Any]:
    """``options`` of a reset, none of them unknown.

    Raises:
        ValueError: they are no mapping, or an unknown one is among them.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise ValueError(f"options = {options!r}: give a dict, with any of {', '.join(map(repr, known))}")
    for name in options:
        if name not in known:
            raise ValueError(f"option {name!r} of reset is unknown: {meant(str(name), known)}")
    return options


def read_if_path(field: Any, field_type: type[Field]) -> Any:
    """``field``, read from a file where it is a path.

    Raises:
        FieldError: the file holds no field of this task.
    """
    if isinstance(field, str | PathLike):
        from .field_files import read_field

        return read_field(field, field_type)
    return field
