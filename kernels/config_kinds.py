"""What a field of a configuration may hold: each kind checks a value and brings it to its declared type.

``kind_of`` makes a kind of an annotation and a declaration. Kinds are made once a class, at its first instance.
"""

from __future__ import annotations

import re
import reprlib
import types
import typing
from collections.abc import Iterator, Sequence
from dataclasses import is_dataclass
from math import inf, isinf
from typing import Any, NamedTuple

import numpy as np

_SHOWN = 120
"""Longest value that an error repeats, in characters."""
_NAME_SHOWN = 500
"""Likewise of a file's name."""
_shorten = reprlib.Repr()
_shorten.maxstring = _shorten.maxother = 60
_shorten.maxlevel = 3


class ConfigError(ValueError):
    """A value that a configuration cannot take, told in one line: where, what, what is allowed, what to do.

    Attributes:
        path: the field, dotted where it is nested; empty if the configuration as a whole is wrong.
        problem: the rest of the line.
        owner: class of the configuration; empty if the path says enough.
        place: file and line that the value comes from, or empty.
    """

    def __init__(self, path: str, problem: str, owner: str = "", place: str = "") -> None:
        """Compose the line; runs of white space, line ends with them, become one space."""
        self.path, self.problem, self.owner, self.place = path, one_line("." + problem)[1:], owner, place
        super().__init__(path, problem, owner, place)

    def __str__(self) -> str:
        """The line."""
        name = ".".join(filter(None, (self.owner, self.path)))
        return (f"{self.place}: " if self.place else "") + (name + self.problem if name else self.problem.lstrip(": "))

    def inside(self, part: str, owner: str = "") -> ConfigError:
        """The same error seen from one level above, where its place is called ``part``."""
        joint = "." if self.path and part and not self.path.startswith("[") else ""
        return ConfigError(part + joint + self.path, self.problem, owner, self.place)


class Declaration(NamedTuple):
    """What a field's declaration says beside its type and default."""

    low: float = -inf
    high: float = inf
    unit: str = ""
    choices: tuple[str, ...] = ()


def one_line(text: str) -> str:
    """A text with single spaces for its white space, line ends with them, and ``?`` for other control characters."""
    return "".join(letter if letter.isprintable() else "?" for letter in " ".join(text.split()))


def show(value: object) -> str:
    """A value on one short line, whatever it is."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, int) and abs(value) >= 10**30:
        return f"an integer of {value.bit_length()} bits"
    try:
        shown = one_line(_shorten.repr(value))
    except Exception:  # a repr that fails must not hide the error that shows it
        shown = f"a {type(value).__name__}"
    return shown if len(shown) <= _SHOWN else shown[: _SHOWN - 3] + "..."


def label(name: str) -> str:
    """A name as an error repeats it: as it is if it could be a field's."""
    return name if len(name) <= _SHOWN and all(map(str.isidentifier, name.split("."))) else show(name)


def file_name(path: object) -> str:
    """The name of a file as messages have it: one line, and of an endless name its ends."""
    name = one_line(str(path))
    return name if len(name) <= _NAME_SHOWN else f"{name[: _NAME_SHOWN // 2]}...{name[-_NAME_SHOWN // 2 :]}"


class Kind:
    """A set of allowed values. ``says`` completes the sentence "give ..."."""

    says: str

    def check(self, value: Any) -> Any:
        """The value in its declared type.

        Raises:
            ConfigError: the value is not allowed.
        """
        raise NotImplementedError

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
            raise self.refuse(value, ", as a float" if self.low <= value <= self.high else "")
        if isinstance(value, (float, np.floating)):
            return float(value)
        raise self.refuse(value)


def _spelling(text: str) -> str:
    """How to write a number that came as a text, most often because YAML takes 1e-3 for one."""
    parts = re.fullmatch(r"\s*([-+]?\d{1,20})(\.\d{0,20})?(?:[eE]([-+]?)(\d{1,3}))?\s*", text, re.ASCII)
    if not parts:
        return ""
    whole, fraction, sign, power = parts.groups()
    if power is None:
        return f": write {whole}{fraction or ''}"
    return f": write {whole}{fraction or '.0'}e{sign or '+'}{power}"


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
            raise self.refuse(value, ", not a truth value (in YAML put yes, no, on and off in quotes)")
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


class Row(Kind):
    """A tuple: of as many values as there are kinds, or of any number of one kind."""

    def __init__(self, kinds: tuple[Kind, ...], variable: bool) -> None:
        """Wrap the kinds of the values; ``variable``: the only one is that of all."""
        self.kinds, self.variable = kinds, variable
        alike = len({kind.says for kind in kinds}) == 1
        values = "values" if variable else f"{len(kinds)} value{'s' * (len(kinds) != 1)}"
        each = f"each {kinds[0].says}" if alike else ", ".join(kind.says for kind in kinds)
        self.says = f"{values} ({each})" if kinds else "an empty list"

    def check(self, value: Any) -> tuple[Any, ...]:
        """A tuple, also of a list or an array."""
        if isinstance(value, np.ndarray):
            value = value.tolist()
        if not isinstance(value, (tuple, list)):
            raise self.refuse(value)
        if not self.variable and len(value) != len(self.kinds):
            raise self.refuse(value, f", not {len(value)}")
        done = []
        for kind, part in self.pairs(value):
            try:
                done.append(kind.check(part))
            except ConfigError as error:
                raise error.inside(f"[{len(done)}]") from None
        return tuple(done)

    def pairs(self, value: Sequence[Any]) -> Iterator[tuple[Kind, Any]]:
        """Each value with its kind; the lengths must fit."""
        return zip(self.kinds * len(value) if self.variable else self.kinds, value, strict=True)


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
    elif isinstance(type_, type) and is_dataclass(type_) and type_.__hash__ is not None:
        return Nested(type_)
    raise TypeError(f"a configuration cannot hold {type_}: use numbers, texts, tuples, frozen dataclasses, or None")
