"""Code of other people: loaded under its own name, told apart by digest, called by one rule, errors in one line."""

from __future__ import annotations

import hashlib
import importlib
import inspect
import sys
import sysconfig
import traceback
from collections.abc import Callable
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, TypeVar

from ..kernels.files import opened, read_file

T = TypeVar("T")
MOST_BYTES = 2**31
"""Largest file of weights or code that is looked at."""
BLOCK_BYTES = 2**20
"""As much of it is in memory at a time."""
DIGITS = 16
"""Hexadecimal digits of a digest that are kept, as everywhere in the package."""


class ForeignError(ValueError):
    """Code cannot be found, made or run; the message is one line, with file and line number where there are some."""


def guarded(work: Callable[[], T], whose: str = "") -> T:
    """What ``work`` returns.

    Args:
        work: runs the code.
        whose: begins the message.

    Raises:
        ForeignError: it raised anything; the message says what and where.
    """
    try:
        return work()
    except ForeignError as error:
        raise ForeignError(whose + str(error)) from error
    except (Exception, SystemExit) as error:
        raise ForeignError(whose + told(error)) from error


def told(error: BaseException) -> str:
    """An exception in one line: file and line of a user's code where it came up, else of any; kind and message."""
    if isinstance(error, SyntaxError) and error.filename:
        return f"{error.filename}, line {error.lineno}: {type(error).__name__}: {error.msg}"
    frames = [frame for frame in traceback.extract_tb(error.__traceback__) if not _passed(frame.filename)]
    frames = [frame for frame in frames if not frame.filename.startswith(_INSTALLED)] or frames
    where = f"{frames[-1].filename}, line {frames[-1].lineno}: " if frames else ""
    return where + in_words(error)


def in_words(error: BaseException) -> str:
    """Kind and message of an exception, in one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def digest_of_files(*paths: Path) -> str:
    """Digest of what files hold, one after the other.

    Raises:
        OSError: one cannot be read.
    """
    sha = hashlib.sha256()
    for path in paths:
        with opened(path, MOST_BYTES) as stream:
            while block := stream.read(BLOCK_BYTES):
                sha.update(block)
    return sha.hexdigest()[:DIGITS]


def digest_of_module(name: str) -> str:
    """Digest of a module's code: its file, or all Python files beside and below it where it lies in a package.

    What it imports from elsewhere does not count.

    Raises:
        ForeignError: there is no such module, or the package around it fails.
    """
    try:
        spec = guarded(lambda: find_spec(name))
    except ForeignError as error:
        missing = isinstance(error.__cause__, ModuleNotFoundError)
        raise ForeignError(f"there is no module {name!r}" if missing else str(error)) from error
    if spec is None:
        raise ForeignError(f"there is no module {name!r}: install it, or start in the folder where it lies")
    if spec.origin is None or not Path(spec.origin).is_file():
        return ""
    path = Path(spec.origin)
    in_package = "." in name or spec.submodule_search_locations is not None
    return digest_of_files(*(sorted(path.parent.rglob("*.py")) if in_package else [path]))


def module_of_file(path: Path) -> ModuleType:
    """A Python file as a module, loaded once for each of its states, under a name that nothing else has.

    What lies beside it can be imported, unless something else has that name.

    Raises:
        ForeignError: it cannot be read, or its code fails.
    """
    try:
        code = read_file(path, MOST_BYTES)
    except OSError as error:
        raise ForeignError(f"cannot read {path} ({error.strerror}): name another file") from None
    name = f"fieldgym_file_{hashlib.sha256(str(path).encode() + code).hexdigest()[:DIGITS]}"
    if name in sys.modules:
        return sys.modules[name]
    module = ModuleType(name)
    module.__file__ = str(path)
    if str(path.parent) not in sys.path:
        sys.path.append(str(path.parent))
    # Compiled from what was read, not through importlib: a kept .pyc is told from its source by seconds alone.
    sys.modules[name] = module
    try:
        guarded(lambda: exec(compile(code, str(path), "exec"), vars(module)))
    except ForeignError:
        del sys.modules[name]
        raise
    return module


def named_in(module: ModuleType, target: str) -> Any:
    """What a dotted name means in a module, None where it means nothing."""
    there: Any = module
    for part in target.split("."):
        there = getattr(there, part, None)
    return there


def module_named(name: str) -> ModuleType:
    """A module by name.

    Raises:
        ForeignError: it cannot be imported.
    """
    return guarded(lambda: importlib.import_module(name))


def made(factory: Callable[..., Any], env: Any, seed: int) -> Any:
    """What a class or factory makes for an environment and a seed; one rule for all.

    ``factory.make(env, seed)`` where a class has that, else ``factory(env, seed)``. One that requires fewer parameters
    gets those of ``env`` and ``seed`` that it names.

    Raises:
        ForeignError: it requires something else.
    """
    if isinstance(factory, type) and callable(getattr(factory, "make", None)):
        return factory.make(env, seed)  # type: ignore[attr-defined]
    try:
        parameters = inspect.signature(factory).parameters.values()
    except (TypeError, ValueError):  # some that are written in C say nothing of themselves
        return factory(env, seed)
    variable = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)
    required = [each for each in parameters if each.default is each.empty and each.kind not in variable]
    if len(required) == 2 and all(each.kind is not each.KEYWORD_ONLY for each in required):
        return factory(env, seed)
    given = {"env": env, "seed": seed}
    odd = [each.name for each in required if each.name not in given]
    if odd:
        raise ForeignError(
            f"it requires {', '.join(odd)}: let it take (env, seed) or fewer of these, or give its class a classmethod "
            "make(env, seed)"
        )
    return factory(**{each.name: given[each.name] for each in parameters if each.name in given})


def _passed(filename: str) -> bool:
    """Whether a file is this package's own, or one that every import goes through."""
    path = Path(filename).resolve()  # an installation may link to the tree
    room = path.relative_to(_ROOT).parts[0] if path.is_relative_to(_ROOT) else ""
    ours = room.endswith(".py") or (_ROOT / room / "__init__.py").is_file() if room else False
    return ours or filename == importlib.__file__ or filename.startswith("<frozen")


_ROOT = Path(__file__).resolve().parents[1]
_INSTALLED = tuple(sysconfig.get_paths()[part] for part in ("stdlib", "platstdlib", "purelib", "platlib"))
"""Where Python and installed packages lie; an error in there came from whoever called it."""
