"""Checked configurations: dataclasses whose fields declare type, range and unit.

The docstring below a field says what it means and where its number comes from: [published...], [identified...] or
[assumed...]. Tables and schemas of the documentation read it there (``config_tables.documented``)::

    @dataclass(frozen=True)
    class ProcessConfig(Config):
        locate_s: float = num(7.304, 0.0, 600.0, "s")
        "Locating one head [identified: 16 s per head]."
        strokes: tuple[int, int, int] = num((1, 2, 3), 0, 50, "")
        "Shear strokes over the head [assumed]."

        def check(self) -> None:
            if self.strokes[0] > self.strokes[2]:
                self.refuse("strokes", "give them in ascending order")

Every instance is checked when it is made, by ``dataclasses.replace`` too: ``ProcessConfig(locate_s=nan)`` raises
``ConfigError``: ``ProcessConfig.locate_s = nan: give a number in [0, 600] s``. Whole numbers become floats where floats
are declared, NumPy's scalars Python's, lists and arrays tuples; nothing else is converted.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field
from typing import Any, NoReturn, TypeVar

from .config_fields import DECLARED, assemble, entries, plain
from .config_kinds import ConfigError, Declaration, one_line, show

__all__ = [
    "Config",
    "ConfigError",
    "choice",
    "flag",
    "from_mapping",
    "nested",
    "num",
    "override",
    "text",
    "to_mapping",
]

C = TypeVar("C", bound="Config")


def num(default: Any, low: float, high: float, unit: str) -> Any:
    """A field of one number or of a tuple of numbers, as its annotation says.

    Args:
        default: its value if none is given; ``...`` if one must be given.
        low: smallest number allowed.
        high: largest number allowed; infinity is a value only if it is an end of the range.
        unit: of all numbers, empty for none.
    """
    if not low <= high:
        raise TypeError(f"range [{low}, {high}]: give a lower and an upper end")
    return _declared(default, Declaration(low, high, unit))


def choice(default: Any, choices: tuple[str, ...]) -> Any:
    """A field of one of a few texts (or a tuple of them); ``default`` as in ``num``."""
    return _declared(default, Declaration(choices=tuple(choices)))


def flag(default: Any) -> Any:
    """A field that is true or false; ``default`` as in ``num``."""
    return _declared(default, Declaration())


def text(default: Any) -> Any:
    """A field of any printable text; ``default`` as in ``num``."""
    return _declared(default, Declaration())


def nested(default: Any) -> Any:
    """A field of another configuration, of a dataclass that checks itself, or of a tuple of them.

    Args:
        default: an instance; or a class or function that makes one; ``...`` if one must be given.
    """
    return _declared(default, Declaration(), isinstance(default, type) or callable(default))


def _declared(default: Any, declared: Declaration, made: bool = False) -> Any:
    metadata = {DECLARED: declared}
    if made:
        factory: Callable[[], Any] = default
        return field(default_factory=factory, metadata=metadata)
    return field(default=MISSING if default is ... else default, metadata=metadata)


@dataclass(frozen=True)
class Config:
    """Base of all configurations. Subclasses stand under ``@dataclass(frozen=True)`` and declare every field."""

    def __init_subclass__(cls, **options: Any) -> None:
        """Keep the place of the checks free."""
        super().__init_subclass__(**options)
        if "__post_init__" in vars(cls):
            raise TypeError(f"{cls.__name__}.__post_init__ would replace the checks: call it check")

    def __post_init__(self) -> None:
        """Check the fields, then the rules between them.

        Raises:
            ConfigError: a value is not allowed.
        """
        owner = type(self).__name__
        for name, entry in entries(type(self)).items():
            value = getattr(self, name)
            try:
                checked = entry.kind.check(value)
            except ConfigError as error:
                raise error.inside(name, owner) from None
            if checked is not value:
                object.__setattr__(self, name, checked)
        try:
            self.check()
        except ConfigError:
            raise
        except (ValueError, ArithmeticError) as error:
            raise ConfigError("", f": {one_line(str(error))}", owner) from error

    def check(self) -> None:
        """Rules between fields, for subclasses to fill; one that inherits rules calls ``super().check()`` first."""

    def refuse(self, name: str, advice: str) -> NoReturn:
        """Raise the error for a field, which may be a dotted name: ``Class.name = value: advice``."""
        value: Any = self
        for part in name.split("."):
            value = getattr(value, part)
        raise ConfigError(name, f" = {show(value)}: {advice}", type(self).__name__)


def override(config: C, changes: Mapping[str, Any]) -> C:
    """A copy with some fields changed.

    Args:
        config: what is changed; stays as it is.
        changes: new values by dotted name, ``{"process.power_w": 150.0}``; mappings change the fields that they name,
            instances replace what is there. All changes are made before the rules between fields are checked.

    Raises:
        ConfigError: an unknown name, or a value that is not allowed, by its full dotted name.
    """
    return from_mapping(type(config), changes, config)


def from_mapping(cls: type[C], mapping: Mapping[str, Any], base: C | None = None) -> C:
    """A configuration from the fields by name, nested ones as mappings or by dotted names.

    Args:
        cls: class of the configuration.
        mapping: as it comes from a file.
        base: gives the fields that ``mapping`` does not name; without it the defaults do.

    Raises:
        ConfigError: unknown or missing names, or values that are not allowed.
    """
    if not isinstance(mapping, Mapping):
        raise ConfigError("", f" = {show(mapping)}: give its fields by name", cls.__name__)
    try:
        return assemble(cls, mapping, base)
    except ConfigError as error:
        place = getattr(mapping, "place", None)  # a mapping from a file knows its lines
        if place is None or error.place:
            raise
        raise ConfigError(error.path, error.problem, error.owner, place(error.path)) from None


def to_mapping(config: Config) -> dict[str, Any]:
    """The fields by name in JSON's types, nested ones too; ``from_mapping`` takes it back. Infinity is ``"inf"``."""
    return plain(config)
