"""What machine code was made of, as a digest: kept code is served only while all of it is the same.

Numba looks at the file of the kernel alone. A stamp looks at the kernel itself: its bytecode and constants, the values
of the globals that it reads (they are frozen into the code), the fields of the NamedTuples that it is handed or makes,
and, the same way, all that it calls. A comment, a docstring or a moved line change nothing.
"""

from __future__ import annotations

import builtins
import dis
import hashlib
import inspect
import itertools
import uuid
from collections.abc import Iterable
from enum import Enum
from functools import cache
from pathlib import Path
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np
from numba.core import config, types
from numba.core.dispatcher import Dispatcher

from . import binding

_LIBRARIES = {"builtins", "math", "cmath", "operator", "numpy", "numba"}
"""Numba brings its own code for what stands in these, so that a name says all."""
_PARTS = ("types", "dtype", "type", "item_type", "key_type", "value_type")
"""Attributes of Numba's types that hold types."""


def stamp(function: Any, arguments: Iterable[Any] = ()) -> str:
    """Digest of what the machine code of a function is made of.

    Args:
        function: the compiled function.
        arguments: Numba's types of its arguments; they say which NamedTuples it is handed, and so which of the
            functions that are bound to these it contains (``bind``).
    """
    walk = _Walk()
    walk.value(function, stamp)
    for argument in arguments:
        walk.type(argument)
    walk.bound()
    return walk.digest.hexdigest()


class _Walk:
    """One way through a kernel and all that it calls; what is met again is written as its number."""

    def __init__(self) -> None:
        self.digest = hashlib.sha256()
        # What Numba looks at itself, in its index and its key: its version, Python's, the processor.
        self.write(np.__version__, binding.OPTIONS, config.BOUNDSCHECK)  # type: ignore[attr-defined]
        self.met: dict[Any, int] = {}
        self.stubs: dict[str, None] = {}
        self.kinds: dict[type, None] = {}

    def write(self, *words: Any) -> None:
        """Add plain words."""
        for word in words:
            self.digest.update(repr(word).encode() + b"\0")

    def new(self, thing: Any) -> bool:
        """Whether a function or class is met for the first time; writes its number either way."""
        first = thing not in self.met
        self.write(self.met.setdefault(thing, len(self.met)))
        return first

    def function(self, function: FunctionType) -> None:
        """Write a function: its code, its defaults, and what its free names stand for."""
        if not self.new(function):
            return
        self.write(function.__module__, function.__qualname__)
        self.value(function.__defaults__, function)
        self.value(tuple(sorted((function.__kwdefaults__ or {}).items())), function)
        for cell in function.__closure__ or ():
            self.value(cell.cell_contents, function)
        for code in _with_inner(function.__code__):
            self.write(code.co_code, getattr(code, "co_exceptiontable", b""), code.co_names, code.co_varnames)
            self.write(code.co_freevars, code.co_cellvars, code.co_flags)
            for constant in _constants(code):
                self.value(constant, function)
            for name in _globals(code):
                self.named(name, code, function)

    def named(self, name: str, code: CodeType, function: FunctionType) -> None:
        """Write what a global name stands for; of a module, whatever the code may take out of it."""
        if name not in function.__globals__:
            self.write(name, "built in" if hasattr(builtins, name) else "missing")
            return
        found, modules = [(name, function.__globals__[name])], set()
        while found:
            word, value = found.pop()
            self.write(word)
            if not isinstance(value, ModuleType) or _library(value.__name__):
                self.value(value, function)
            elif value not in modules:
                modules.add(value)
                found += [(part, vars(value)[part]) for part in code.co_names if part in vars(value)]

    def value(self, value: Any, owner: FunctionType) -> None:
        """Write a value that is frozen into the code of ``owner``."""
        self.write(type(value).__qualname__)
        if value is None or isinstance(value, bool | int | float | complex | str | bytes | np.dtype | types.Type):
            self.write(value)
        elif isinstance(value, np.ndarray | np.generic) and not value.dtype.hasobject:
            self.write(value.dtype, value.shape, getattr(value, "strides", ()), value.tobytes())
        elif isinstance(value, tuple | list | frozenset):
            if isinstance(value, tuple):
                self.kind(type(value))
            self.write(len(value))
            for item in sorted(value, key=repr) if isinstance(value, frozenset) else value:
                self.value(item, owner)
        elif isinstance(value, Dispatcher):
            self.write(sorted((name, repr(option)) for name, option in value.targetoptions.items()))
            self.function(value.py_func)
        elif isinstance(value, FunctionType) and value in binding.STUBS:
            self.write(value.__name__)
            self.stubs[value.__name__] = None
        elif isinstance(value, Enum):
            self.write(value.name)
            self.value(value.value, owner)
        elif isinstance(value, type) and issubclass(value, Enum):
            self.value(tuple(value), owner)
        elif isinstance(value, type) and issubclass(value, tuple):
            self.kind(value)
        elif isinstance(value, ModuleType):
            self.write(value.__name__)
        elif isinstance(value, BuiltinFunctionType | np.ufunc) or (
            callable(value) and hasattr(value, "__name__") and _library(value.__module__)
        ):
            self.write(getattr(value, "__module__", "numpy"), value.__name__)
        elif isinstance(value, type) and issubclass(value, BaseException):
            self.write(value.__module__, value.__qualname__)
        else:
            # A plain function among them: kernels can call it only where an overload, which is not seen here, says how.
            if isinstance(value, FunctionType):
                self.function(value)
            self.write(_folder(value if isinstance(value, FunctionType) else owner))

    def kind(self, kind: type) -> None:
        """Write a NamedTuple class: code finds a field by its place."""
        if self.new(kind):
            self.write(kind.__module__, kind.__qualname__, getattr(kind, "_fields", None))
            self.kinds[kind] = None

    def type(self, argument: Any) -> None:
        """Write the NamedTuples and functions within Numba's type of an argument."""
        if isinstance(argument, types.BaseTuple):
            self.kind(getattr(argument, "instance_class", tuple))
        elif isinstance(argument, types.Dispatcher):
            self.value(argument.dispatcher, stamp)
        elif isinstance(argument, types.StructRef):
            for field, inner in argument.field_dict.items():
                self.write(field)
                self.type(inner)
        for name in _PARTS:
            part = getattr(argument, name, ())
            for inner in dict.fromkeys(part if isinstance(part, tuple) else (part,)):
                if isinstance(inner, types.Type):
                    self.type(inner)

    def bound(self) -> None:
        """Write the functions that the stubs met stand for with the kinds met, and what these bring in turn."""
        done: set[tuple[str, Any]] = set()
        while pairs := [
            pair for pair in itertools.product(self.stubs, self.kinds) if pair in binding.BOUND and pair not in done
        ]:
            done.update(pairs)
            for pair in pairs:
                self.write(pair[0])
                self.function(getattr(binding.BOUND[pair], "py_func", binding.BOUND[pair]))


def _library(module: str | None) -> bool:
    return module is not None and module.partition(".")[0] in _LIBRARIES


@cache
def _with_inner(code: CodeType) -> tuple[CodeType, ...]:
    """A function's code and that of the functions within it."""
    inner = [part for constant in code.co_consts if isinstance(constant, CodeType) for part in _with_inner(constant)]
    return code, *inner


def _constants(code: CodeType) -> tuple[Any, ...]:
    """A code's constants but for its docstring, which is the first one of a function that has one."""
    documented = isinstance(code.co_consts[0] if code.co_consts else None, str) and not code.co_name.startswith("<")
    return tuple(value for value in code.co_consts[1 if documented else 0 :] if not isinstance(value, CodeType))


@cache
def _globals(code: CodeType) -> tuple[str, ...]:
    """Names that a code looks up outside of it."""
    names = [line.argval for line in dis.get_instructions(code) if line.opname == "LOAD_GLOBAL"]
    return tuple(dict.fromkeys(names))


def _folder(thing: Any) -> str:
    """Digest of the modules beside a thing's own, for what a walk cannot look into."""
    try:
        return _modules(Path(inspect.getfile(thing)).parent)
    except (TypeError, OSError):
        return uuid.uuid4().hex  # made at the prompt: nothing to compare it with another time


@cache
def _modules(folder: Path) -> str:
    digest = hashlib.sha256()
    for source in sorted(folder.glob("*.py")):
        digest.update(source.read_bytes())
    return digest.hexdigest()
