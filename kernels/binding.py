"""One kernel for several kinds of numbers: what a function is depends on the type of its first argument."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba.extending import overload

Function = TypeVar("Function", bound=Callable[..., Any])
_BOUND: dict[tuple[str, Any], Any] = {}


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
