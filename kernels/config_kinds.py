"""What a field of a configuration may hold: each kind checks a value and brings it to its declared type.

``kind_of`` makes a kind of an annotation and a declaration. Kinds are made once a class, at its first instance.
"""

from __future__ import annotations

import re
import reprlib
import types
import typing
from collections.abc import Mapping
from dataclasses import MISSING, Field, fields, is_dataclass, replace
from functools import cache
from math import inf, isinf
from typing import Any, NamedTuple

import numpy as np

DECLARED = "declared"
"""Key of a field's ``Declaration`` in its metadata."""
_BUILTIN = (int, float, bool, str)
_NAMES_SHOWN = 12

_shorten = reprlib.Repr()
_shorten.maxstring = _shorten.maxother = 60
_shorten.maxlevel = 3


class ConfigError(ValueError):
    """A value that a configuration cannot take, told in one line: where, what, what is allowed, what to do.

    Attributes:
        path: the field, dotted where it is nested; empty if the configuration as a whole is wrong.
        problem: the rest of the line.
        owner: class of the configuration, empty if ``path`` begins at the outermost one.
    """

    def __init__(self, path: str, problem: str, owner: str = "") -> None:
        """Compose the line; runs of white space, line ends with them, become one space."""
        self.path, self.problem, self.owner = path, " ".join(("." + problem).split())[1:], owner
        super().__init__(path, problem, owner)

    def __str__(self) -> str:
        """The line."""
        return ".".join(filter(None, (self.owner, self.path))) + self.problem

    def inside(self, part: str, owner: str = "") -> ConfigError:
        """The same error seen from one level above, where its place is called ``part``."""
        joint = "." if self.path and part and not self.path.startswith("[") else ""
        return ConfigError(part + joint + self.path, self.problem, owner)


class Declaration(NamedTuple):
    """What a field's declaration says beside its type and default."""

    low: float = -inf
    high: float = inf
    unit: str = ""
    doc: str = ""
    choices: tuple[str, ...] = ()


def show(value: object) -> str:
    """A value on one short line, whatever it is."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, int) and abs(value) >= 10**30:
        return f"an integer of {value.bit_length()} bits"
    try:
        return " ".join(_shorten.repr(value).split())
    except Exception:  # a repr that fails must not hide the error that shows it
        return f"a {type(value).__name__}"


def first_line(error: BaseException) -> str:
    """What an exception says, on one line."""
    return " ".join(str(error).split()) or type(error).__name__


class Kind:
    """A set of allowed values. ``says`` completes the sentence "give ..."."""

    says: str

    def check(self, value: Any) -> Any:
        """The value in its declared type.

        Raises:
            ConfigError: the value is not allowed.
        """
        raise NotImplementedError

    def build(self, value: Any, current: Any) -> Any:
        """``value`` with the mappings in it made configurations, on top of ``current`` where that is one."""
        return value

    def plain(self, value: Any) -> Any:
        """The value in JSON's types."""
        return value

    def refuse(self, value: object, hint: str = "") -> ConfigError:
        """The error for a value."""
        return ConfigError("", f" = {show(value)}: give {self.says}{hint}")


class Number(Kind):
    """A whole number or a float in a closed range; infinite only where the range's end is."""

    def __init__(self, type_: type[int] | type[float], declared: Declaration) -> None:
        """Compile the range."""
        self.type, self.low, self.high, self.unit = type_, declared.low, declared.high, declared.unit
        self.says = "a number" if type_ is float else "a whole number"
        if self.low > -inf or self.high < inf:
            self.says += f" in [{self.low:.12g}, {self.high:.12g}]"
        if self.unit:
            self.says += f" {self.unit}"

    def check(self, value: Any) -> Any:
        """A Python ``int`` or ``float`` in the range."""
        if type(value) is not self.type:
            value = self._converted(value)
        if self.low <= value <= self.high:
            return value
        raise self.refuse(value)

    def _converted(self, value: Any) -> Any:
        if isinstance(value, (bool, np.bool_)):
            raise self.refuse(value, ", not a truth value")
        if isinstance(value, str):
            if self.type is float and value in ("inf", "-inf") and isinf(self.high if value == "inf" else self.low):
                return float(value)
            raise self.refuse(value, ", not a text" + _spelling(value))
        whole = isinstance(value, (int, np.integer)) and not isinstance(value, np.timedelta64)
        if self.type is int:
            if whole:
                return int(value)
            raise self.refuse(value, ", without a decimal point" if isinstance(value, (float, np.floating)) else "")
        if whole:
            if self.low <= value <= self.high and abs(int(value)) < 2**1023 and int(number := float(value)) == value:
                return number
            raise self.refuse(value)
        if isinstance(value, (float, np.floating)):
            return float(value)
        raise self.refuse(value)

    def plain(self, value: Any) -> Any:
        """The number; JSON has no infinity, so that is a text."""
        return str(value) if isinstance(value, float) and isinf(value) else value


def _spelling(text: str) -> str:
    """How a number is written that YAML has read as a text."""
    parts = re.fullmatch(r"\s*([-+]?\d{1,20})(\.\d{0,20})?(?:[eE]([-+]?)(\d{1,3}))?\s*", text)
    if not parts:
        return ""
    whole, fraction, sign, power = parts.groups()
    return (
        f": write {whole}{fraction or ''}"
        if power is None
        else f": write {whole}{fraction or '.0'}e{sign or '+'}{power}"
    )


class Text(Kind):
    """A printable text, or one of a few."""

    says = "a text of printable characters"

    def __init__(self, choices: tuple[str, ...]) -> None:
        """Remember the choices; none allow every text."""
        self.choices = choices
        if choices:
            self.says = " or ".join(filter(None, (", ".join(map(repr, choices[:-1])), repr(choices[-1]))))

    def check(self, value: Any) -> str:
        """A Python ``str``."""
        if isinstance(value, (bool, np.bool_)):
            raise self.refuse(value, ", a text (YAML reads yes, no, on, off as truth values: put it in quotes)")
        if not isinstance(value, str) or not value.isprintable() or (self.choices and value not in self.choices):
            raise self.refuse(value)
        return str.__str__(value)


class Flag(Kind):
    """A truth value."""

    says = "true or false"

    def check(self, value: Any) -> bool:
        """A Python ``bool``."""
        if not isinstance(value, (bool, np.bool_)):
            raise self.refuse(value)
        return bool(value)


class Optional(Kind):
    """Another kind, or None."""

    def __init__(self, kind: Kind) -> None:
        """Wrap a kind."""
        self.kind = kind
        self.says = f"{kind.says} or None"

    def check(self, value: Any) -> Any:
        """None, or what the kind makes of the value."""
        if value is None:
            return None
        try:
            return self.kind.check(value)
        except ConfigError as error:
            if error.path:
                raise
            raise ConfigError("", error.problem.replace(self.kind.says, self.says, 1)) from None

    def build(self, value: Any, current: Any) -> Any:
        """As the kind does."""
        return self.kind.build(value, current)

    def plain(self, value: Any) -> Any:
        """As the kind does."""
        return None if value is None else self.kind.plain(value)


class Row(Kind):
    """A tuple: of as many values as there are kinds, or of any number of one kind."""

    def __init__(self, kinds: tuple[Kind, ...], variable: bool) -> None:
        """Wrap the kinds of the values; ``variable``: the only one is that of all."""
        self.kinds, self.variable = kinds, variable
        self.alike = len({kind.says for kind in kinds}) == 1
        values = "values" if variable else f"{len(kinds)} value{'s' * (len(kinds) != 1)}"
        each = f"each {kinds[0].says}" if self.alike else ", ".join(kind.says for kind in kinds)
        self.says = f"{values} ({each})" if kinds else "an empty list"

    def check(self, value: Any) -> tuple[Any, ...]:
        """A tuple, also of a list or an array."""
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if not isinstance(value, (tuple, list)):
            raise self.refuse(value)
        if not self.variable and len(value) != len(self.kinds):
            raise self.refuse(value, f", not {len(value)}")
        kinds = self.kinds * len(value) if self.variable else self.kinds
        done = []
        for kind, part in zip(kinds, value, strict=True):
            try:
                done.append(kind.check(part))
            except ConfigError as error:
                raise error.inside(f"[{len(done)}]") from None
        return tuple(done)

    def build(self, value: Any, current: Any) -> Any:
        """Each value by itself."""
        if not isinstance(value, (tuple, list)) or not (self.variable or len(value) == len(self.kinds)):
            return value
        kinds = self.kinds * len(value) if self.variable else self.kinds
        done = []
        for kind, part in zip(kinds, value, strict=True):
            try:
                done.append(kind.build(part, None))
            except ConfigError as error:
                raise error.inside(f"[{len(done)}]") from None
        return done

    def plain(self, value: Any) -> list[Any]:
        """A list."""
        kinds = self.kinds * len(value) if self.variable else self.kinds
        return [kind.plain(part) for kind, part in zip(kinds, value, strict=True)]


class Nested(Kind):
    """An instance of a class: a configuration, or a dataclass that checks itself."""

    def __init__(self, type_: type) -> None:
        """Wrap the class."""
        self.type = type_
        self.says = f"a {type_.__name__}"

    def check(self, value: Any) -> Any:
        """The instance itself."""
        if not isinstance(value, self.type):
            raise self.refuse(value)
        return value

    def build(self, value: Any, current: Any) -> Any:
        """An instance from a mapping of its fields."""
        return assemble(self.type, value, current) if isinstance(value, Mapping) and is_dataclass(self.type) else value

    def plain(self, value: Any) -> Any:
        """Its fields by name."""
        return plain(value) if is_dataclass(value) else str(value)


def kind_of(type_: Any, declared: Declaration) -> Kind:
    """The kind behind an annotation.

    Raises:
        TypeError: a configuration cannot hold values of this type.
    """
    origin, arguments = typing.get_origin(type_), typing.get_args(type_)
    if origin in (typing.Union, types.UnionType):
        others = [part for part in arguments if part is not types.NoneType]
        if len(others) == 1 and len(arguments) == 2:
            return Optional(kind_of(others[0], declared))
    elif origin is tuple:
        if len(arguments) == 2 and arguments[1] is Ellipsis:
            return Row((kind_of(arguments[0], declared),), variable=True)
        return Row(tuple(kind_of(part, declared) for part in arguments if part != ()), variable=False)
    elif origin is typing.Literal and all(isinstance(part, str) for part in arguments):
        return Text(arguments)
    elif type_ is bool:
        return Flag()
    elif type_ is str:
        return Text(declared.choices)
    elif type_ is int or type_ is float:
        return Number(type_, declared)
    elif isinstance(type_, type) and type_.__module__ != "builtins" and type_.__hash__ is not None:
        return Nested(type_)
    raise TypeError(f"a configuration cannot hold {type_}: use numbers, texts, tuples, frozen dataclasses, or None")


class Entry(NamedTuple):
    """One field of a configuration: its name, what it may hold, what was declared, its default or ``MISSING``."""

    name: str
    kind: Kind
    declared: Declaration
    default: Any
    type: Any


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
        if not item.init:
            continue
        declared = item.metadata.get(DECLARED)
        if declared is None:
            if hasattr(cls, "refuse"):
                raise TypeError(f"{cls.__name__}.{item.name}: declare it by num, choice, flag, text or nested")
            declared = Declaration()
        try:
            kind = kind_of(hints[item.name], declared)
        except TypeError as error:
            raise TypeError(f"{cls.__name__}.{item.name}: {error}") from None
        default = item.default if item.default_factory is MISSING else item.default_factory()
        found[item.name] = Entry(item.name, kind, declared, default, hints[item.name])
    return found


def plain(config: Any) -> dict[str, Any]:
    """The fields of a dataclass by name, in JSON's types."""
    return {entry.name: entry.kind.plain(getattr(config, entry.name)) for entry in entries(type(config)).values()}


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
            raise ConfigError(name if name.isidentifier() else show(name), f": {_unknown(name, cls)}")
        kind, default = table[name].kind, table[name].default
        before = getattr(current, name) if current is not None else None if default is MISSING else default
        try:
            changes[name] = kind.check(kind.build(value, before))
        except ConfigError as error:
            raise error.inside(name) from None
    missing = [name for name, entry in table.items() if entry.default is MISSING and name not in changes]
    if current is None and missing:
        wanted = "; ".join(f"{name}: {table[name].kind.says}" for name in missing)
        raise ConfigError("", f" is incomplete: give {wanted}", cls.__name__)
    try:
        return cls(**changes) if current is None else replace(current, **changes)
    except ConfigError as error:
        raise error.inside("") from None
    except (ValueError, ArithmeticError) as error:
        raise ConfigError("", f": {first_line(error)}", cls.__name__) from error


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
                raise ConfigError(key if key.isprintable() else show(key), ": given twice: give it once")
            value = {**first, **value}
        tree[head] = value
    return tree


def _unknown(name: str, cls: type) -> str:
    from difflib import get_close_matches

    deeper = [path for path in dotted(cls) if path.endswith("." + name)]
    near = deeper or get_close_matches(name[:100], list(entries(cls)), 1)
    if near:
        return f"no such field: did you mean {' or '.join(near[:3])}?"
    names = list(entries(cls))
    more = f" and {len(names) - _NAMES_SHOWN} more" if len(names) > _NAMES_SHOWN else ""
    return f"no such field: choose from {', '.join(names[:_NAMES_SHOWN])}{more}"


def dotted(cls: type) -> list[str]:
    """Dotted names of all fields, those of nested dataclasses in the place of the field that holds them."""
    names = []
    for entry in entries(cls).values():
        inner = nested_type(entry.kind)
        names += [entry.name] if inner is None else [f"{entry.name}.{name}" for name in dotted(inner)]
    return names


def nested_type(kind: Kind) -> type | None:
    """The dataclass that a field holds, if it holds one."""
    kind = kind.kind if isinstance(kind, Optional) else kind
    return kind.type if isinstance(kind, Nested) and is_dataclass(kind.type) else None
