"""What a configuration's declarations say, for others: JSON schema, and rows for tables of the documentation."""

from __future__ import annotations

import ast
import inspect
import re
from dataclasses import is_dataclass
from functools import cache
from itertools import pairwise
from math import inf
from textwrap import dedent
from typing import Any, NamedTuple

from .config import Config
from .config_fields import Entry, entries, plain
from .config_kinds import Flag, Kind, Nested, Number, Optional, Row, Text

_SOURCE = re.compile(r"\s*\[((?:all )?(?:published|identified|assumed|derived)\b[^\]]*)\]")


class Line(NamedTuple):
    """One field, as a row of a table.

    Attributes:
        name: dotted.
        type: as annotated; of a choice, the choices.
        default: in JSON's types, ``...`` if a value must be given.
        low: smallest number allowed, None where there are no numbers or no limit.
        high: largest number allowed, likewise.
        unit: of its numbers.
        doc: what it means, without the source.
        source: where the number comes from: ``published...``, ``identified...``, ``assumed...``, or empty.
    """

    name: str
    type: str
    default: Any
    low: float | None
    high: float | None
    unit: str
    doc: str
    source: str


@cache
def documented(cls: type) -> dict[str, str]:
    """What the docstrings below the fields of a class say, by name, each on one line; none where it has no source."""
    said = {}
    for base in reversed(cls.__mro__):
        try:
            body = ast.parse(dedent(inspect.getsource(base))).body[0].body  # type: ignore[attr-defined]
        except (OSError, TypeError):  # built in, or made at the prompt
            continue
        for field, doc in pairwise(body):
            if isinstance(field, ast.AnnAssign) and isinstance(doc, ast.Expr) and isinstance(doc.value, ast.Constant):
                said[ast.unparse(field.target)] = " ".join(str(doc.value.value).split())
    return said


def rows(config: Config | type[Config]) -> list[Line]:
    """All fields, those of nested configurations in the place of the field that holds them.

    Args:
        config: a class, for its defaults, or an instance, for its values in their place.
    """
    return _rows(config)


def _rows(config: Any, prefix: str = "") -> list[Line]:
    cls = config if isinstance(config, type) else type(config)
    found = []
    for entry in entries(cls).values():
        value = entry.default if config is cls else getattr(config, entry.name)
        name = prefix + entry.name
        if entry.nested is not None:
            found += _rows(value if is_dataclass(value) else entry.nested, name + ".")
            continue
        doc = documented(cls).get(entry.name, "")
        sources = _SOURCE.findall(doc) or _SOURCE.findall(cls.__doc__ or "")
        leaf = _leaf(entry.kind)
        low, high = (leaf.low, leaf.high) if isinstance(leaf, Number) else (-inf, inf)
        found.append(
            Line(
                name,
                _type(entry, leaf),
                plain(value),
                None if low == -inf else low,
                None if high == inf else high,
                entry.declared.unit,
                _SOURCE.sub("", doc),
                "; ".join(sources),
            )
        )
    return found


def _leaf(kind: Kind) -> Kind:
    while isinstance(kind, (Optional, Row)):
        kind = kind.kind if isinstance(kind, Optional) else kind.kinds[0] if kind.kinds else Kind()
    return kind


def _type(entry: Entry, leaf: Kind) -> str:
    name = entry.type.__name__ if isinstance(entry.type, type) and leaf is entry.kind else str(entry.type)
    if isinstance(leaf, Text) and leaf.choices:
        choices = " | ".join(map(repr, leaf.choices))
        if leaf is entry.kind:
            return choices
        name = re.sub(r"\bstr\b|typing\.Literal\[.*?\]", choices.replace("\\", r"\\"), name)
    return re.sub(r"\b(?:\w+\.)+(?=\w)", "", name)


def schema(config: Config | type[Config]) -> dict[str, Any]:
    """JSON schema (2020-12) of the mappings that ``from_mapping`` takes, dotted names apart; units as ``unit``.

    Rules between fields are beyond a schema, and JSON's integers include 16.0.

    Args:
        config: a class, for its defaults, or an instance, for its values in their place.
    """
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **_object(config)}


def _object(config: Any) -> dict[str, Any]:
    cls = config if isinstance(config, type) else type(config)
    properties, required = {}, []
    for entry in entries(cls).values():
        value = entry.default if config is cls else getattr(config, entry.name)
        if value is ...:
            required.append(entry.name)
        inner = is_dataclass(value)
        described: dict[str, Any] = _object(value) if inner else _schema(entry.kind)
        if isinstance(entry.kind, Optional) and inner:
            described = {"anyOf": [described, {"type": "null"}]}
        if doc := documented(cls).get(entry.name):
            described["description"] = doc
        if entry.declared.unit:
            described["unit"] = entry.declared.unit
        if value is not ... and not inner:
            described["default"] = plain(value)
        properties[entry.name] = described
    found: dict[str, Any] = {"title": cls.__name__, "type": "object"}
    if cls.__doc__ and not cls.__doc__.startswith(cls.__name__ + "("):  # which dataclass writes where there is none
        found["description"] = " ".join(cls.__doc__.split("\n\n")[0].split())
    found |= {"properties": properties, "additionalProperties": False}
    return found | ({"required": required} if required else {})


def _schema(kind: Kind) -> dict[str, Any]:
    if isinstance(kind, Optional):
        return {"anyOf": [_schema(kind.kind), {"type": "null"}]}
    if isinstance(kind, Nested):
        return _object(kind.type)
    if isinstance(kind, Flag):
        return {"type": "boolean"}
    if isinstance(kind, Text):
        return {"enum": list(kind.choices)} if kind.choices else {"type": "string"}
    if isinstance(kind, Number):
        found: dict[str, Any] = {"type": "integer" if kind.type is int else "number"}
        found |= {} if kind.low == -inf else {"minimum": kind.low}
        found |= {} if kind.high == inf else {"maximum": kind.high}
        endless = [str(end) for end in (kind.low, kind.high) if abs(end) == inf and kind.type is float]
        return {"anyOf": [found, {"enum": endless}]} if endless else found
    if not isinstance(kind, Row):
        raise TypeError(f"{type(kind).__name__} has no schema")
    if kind.variable:
        return {"type": "array", "items": _schema(kind.kinds[0])}
    sized = {"type": "array", "minItems": len(kind.kinds), "maxItems": len(kind.kinds)}
    return sized | {"prefixItems": [_schema(inner) for inner in kind.kinds]}
