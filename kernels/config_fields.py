"""The fields of a configuration's class, and instances from and to plain mappings.

Dataclasses that are no ``Config`` (a machine's geometry, say) are taken too: their fields are checked for type and
for NaN, ranges are their own business.
"""

from __future__ import annotations

import typing
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from functools import cache
from math import isinf
from typing import Any, NamedTuple

from .config_kinds import ConfigError, Declaration, Kind, Nested, Optional, Row, kind_of, label, one_line, show

DECLARED = "declared"
"""Key of a field's ``Declaration`` in its metadata."""
_NAMES_SHOWN = 12


class Entry(NamedTuple):
    """One field: its name, annotation, what it may hold, and what was declared."""

    name: str
    type: Any
    kind: Kind
    declared: Declaration
    field: Field[Any]

    @property
    def required(self) -> bool:
        """Whether it has no default."""
        return self.field.default is MISSING and self.field.default_factory is MISSING

    @property
    def default(self) -> Any:
        """Its default, ``...`` if it has none."""
        if self.field.default_factory is not MISSING:
            return self.field.default_factory()
        return ... if self.field.default is MISSING else self.field.default

    @property
    def nested(self) -> type | None:
        """The dataclass that it holds, if it holds one."""
        kind = self.kind.kind if isinstance(self.kind, Optional) else self.kind
        return kind.type if isinstance(kind, Nested) else None


@cache
def entries(cls: type) -> dict[str, Entry]:
    """Fields of a dataclass by name, in order.

    Raises:
        TypeError: a field of a configuration is not declared, or its type is not supported.
    """
    bare = [name for name, value in vars(cls).items() if isinstance(value, Field)]
    if bare:
        raise TypeError(f"{cls.__name__}.{bare[0]}: put @dataclass(frozen=True) over the class")
    hints = typing.get_type_hints(cls)
    found = {}
    for item in fields(cls):
        declared = item.metadata.get(DECLARED)
        if declared is None and hasattr(cls, "refuse"):
            raise TypeError(f"{cls.__name__}.{item.name}: declare it by num, choice, flag, text or nested")
        declared = declared or Declaration()
        try:
            kind = kind_of(hints[item.name], declared)
        except TypeError as error:
            raise TypeError(f"{cls.__name__}.{item.name}: {error}") from None
        found[item.name] = Entry(item.name, hints[item.name], kind, declared, item)
    return found


def dotted(cls: type) -> list[str]:
    """Dotted names of all fields, those of nested dataclasses in the place of the field that holds them."""
    names = []
    for entry in entries(cls).values():
        inner = entry.nested
        names += [entry.name] if inner is None else [f"{entry.name}.{name}" for name in dotted(inner)]
    return names


def assemble(cls: type, mapping: Mapping[Any, Any], current: Any) -> Any:
    """An instance with the fields of ``mapping``; the others are those of ``current``, or the defaults if it is None.

    Raises:
        ConfigError: unknown or missing names, or values that are not allowed; its path begins below ``cls``.
    """
    cls = cls if current is None else type(current)
    table = entries(cls)
    changes = {}
    for name, value in _tree(mapping).items():
        if name not in table:
            raise ConfigError(label(name), f": {_unknown(name, cls)}")
        entry = table[name]
        before = getattr(current, name) if current is not None else None if entry.required else entry.default
        try:
            changes[name] = entry.kind.check(_built(entry.kind, value, before))
        except ConfigError as error:
            raise error.inside(name) from None
    missing = [entry for entry in table.values() if entry.required and entry.name not in changes]
    if current is None and missing:
        wanted = "; ".join(f"{entry.name}, {entry.kind.says}" for entry in missing)
        raise ConfigError("", f" is incomplete: give {wanted}", cls.__name__)
    try:
        return cls(**changes) if current is None else replace(current, **changes)
    except ConfigError as error:
        raise error if not error.path else error.inside("") from None
    except (ValueError, ArithmeticError) as error:
        raise ConfigError("", f": {one_line(str(error))}", cls.__name__) from error


def _built(kind: Kind, value: Any, current: Any) -> Any:
    """``value`` with the mappings in it made instances, on top of ``current`` where that is one."""
    if isinstance(kind, Optional):
        return _built(kind.kind, value, current)
    if isinstance(kind, Nested) and isinstance(value, Mapping):
        return assemble(kind.type, value, current)
    if isinstance(kind, Row) and isinstance(value, (tuple, list)) and (kind.variable or len(value) == len(kind.kinds)):
        done = []
        for inner, part in kind.pairs(value):
            try:
                done.append(_built(inner, part, None))
            except ConfigError as error:
                raise error.inside(f"[{len(done)}]") from None
        return done
    return value


def _tree(mapping: Mapping[Any, Any]) -> dict[str, Any]:
    """Dotted names become mappings of their first parts."""
    tree: dict[str, Any] = {}
    for key, value in mapping.items():
        if not isinstance(key, str):
            raise ConfigError(show(key), ": a name must be a text")
        head, dot, rest = key.partition(".")
        if dot:
            value = {rest: value}
        if head in tree:
            first = tree[head]
            if not isinstance(first, Mapping) or not isinstance(value, Mapping) or first.keys() & value.keys():
                raise ConfigError(label(key), ": given twice: give it once")
            value = {**first, **value}
        tree[head] = value
    return tree


def _unknown(name: str, cls: type) -> str:
    from difflib import get_close_matches

    names = list(entries(cls))
    deeper = [path for path in dotted(cls) if path.endswith("." + name)]
    near = deeper or get_close_matches(name[:100], names, 1) or get_close_matches(name[:100], dotted(cls), 1, 0.8)
    if near:
        return f"no such field: did you mean {' or '.join(near[:3])}?"
    more = f" and {len(names) - _NAMES_SHOWN} more" if len(names) > _NAMES_SHOWN else ""
    return f"no such field: choose from {', '.join(names[:_NAMES_SHOWN])}{more}"


def plain(value: Any) -> Any:
    """A checked value in JSON's types: dataclasses by field name, tuples as lists, infinity as the text ``"inf"``."""
    if is_dataclass(value):
        return {name: plain(getattr(value, name)) for name in entries(type(value))}
    if isinstance(value, tuple):
        return [plain(part) for part in value]
    return str(value) if isinstance(value, float) and isinf(value) else value
