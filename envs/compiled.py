"""Rules as machine code: loops over worlds that cost next to nothing, for one world as for thousands.

A kernel treats one world after the other with the same scalar operations, so a batch equals its single worlds bit for
bit. Machine code is kept beside the sources in ``__pycache__`` (or in the user's cache folder where that is
read-only); the first call on a machine compiles for some seconds.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from functools import cache, partial
from pathlib import Path
from typing import Any, TypeVar

import numba
from numba.extending import overload
from numpy.typing import NDArray

from ..motion import laws

Function = TypeVar("Function", bound=Callable[..., Any])
_BOUND: dict[tuple[str, Any], Any] = {}


def compiled(function: Function) -> Function:
    """Compile ``function`` at its first call; IEEE arithmetic as written, division by zero gives infinity or NaN."""
    dispatcher: Any = numba.njit(cache=True, error_model="numpy")(function)
    if dispatcher is function:  # NUMBA_DISABLE_JIT is set
        return function
    # Numba renews kept machine code when the function's own file has changed. What it calls stands in other files too.
    kept = dispatcher._cache._cache_file
    kept._source_stamp = _stamp(Path(inspect.getfile(function)).parent)
    kept._load_index = partial(_readable, kept._load_index)
    return dispatcher


def _readable(load_index: Callable[[], dict[Any, str]]) -> dict[Any, str]:
    """What is kept of a kernel; nothing where some of it was compiled for a type that this process cannot import."""
    try:
        return load_index()
    except (ImportError, AttributeError):
        return {}


@cache
def _stamp(folder: Path) -> str:
    """Digest of every source file that a kernel in ``folder`` may be made of: its task's, and those all tasks share.

    Kernels outside the tasks may be made of any of them.
    """
    envs = Path(__file__).parent
    rooms = {folder, envs, envs.parent / "motion"}
    if envs not in folder.parents:
        rooms |= {path for path in envs.iterdir() if path.is_dir()}
    digest = hashlib.sha256()
    for room in sorted(rooms):
        for source in sorted(room.glob("*.py")):
            digest.update(source.read_bytes())
    return digest.hexdigest()


def by_kind(stub: Function) -> Function:
    """Make of ``stub`` a function that is what the type of its first argument was bound to (see ``bind``).

    So kernels are written once for several kinds of numbers, each with functions of its own.
    """
    name = stub.__name__

    def call(numbers: Any, *rest: Any) -> Any:
        return _BOUND[name, type(numbers)](numbers, *rest)

    @overload(call, strict=False, jit_options={"error_model": "numpy"})
    def _choose(numbers: Any, *rest: Any) -> Any:
        bound = _BOUND.get((name, getattr(numbers, "instance_class", None)))
        return None if bound is None else bound.py_func

    call.__name__, call.__doc__ = name, stub.__doc__
    return call  # type: ignore[return-value]


def bind(kind: type, *functions: Callable[..., Any]) -> None:
    """Let compiled ``functions`` stand for those of their names (see ``by_kind``) where a first argument is a ``kind``.

    Args:
        kind: a NamedTuple type; the functions belong into the folder of the kernels that use them, or into one below.
        functions: compiled functions.
    """
    for function in functions:
        _BOUND[function.__name__, kind] = function


shortest = compiled(laws.shortest)
"""``motion.laws.shortest`` of one stroke, for kernels."""


@compiled
def fill(row: NDArray[Any], value: float) -> None:
    """Write ``value`` all along a row; Numba's own slices take seconds to compile."""
    for i in range(len(row)):
        row[i] = value


@compiled
def copy(source: NDArray[Any], target: NDArray[Any]) -> None:
    """Write the first elements of ``source`` all along ``target``; see ``fill``."""
    for i in range(len(target)):
        target[i] = source[i]
