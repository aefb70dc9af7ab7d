"""One kernel for several kinds of numbers: what a function is depends on the type of its first argument."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

from numba.extending import overload

Function = TypeVar("Function", bound=Callable[..., Any])

OPTIONS: Any = {"error_model": "numpy", "forceinline": True, "nogil": True}
"""Numba's options for every kernel: IEEE arithmetic as written, division by zero gives infinity or NaN. What a kernel
calls becomes a part of it, so that no call hands arrays over one by one; threads run kernels side by side."""
BOUND: dict[tuple[str, Any], Any] = {}
"""Compiled functions by the name of their stub and the type of their first argument."""
STUBS: set[Callable[..., Any]] = set()
"""What ``by_kind`` has made."""


def by_kind(stub: Function) -> Function:
    """Make of ``stub`` a function that is what the type of its first argument was bound to (see ``bind``).

    So kernels are written once for several kinds of numbers, each with functions of its own.
    """
    name = stub.__name__

    def call(numbers: Any, *rest: Any) -> Any:
        return BOUND[name, type(numbers)](numbers, *rest)

    @overload(call, strict=False, jit_options=OPTIONS)
    def _choose(numbers: Any, *rest: Any) -> Any:
        bound = BOUND.get((name, getattr(numbers, "instance_class", None)))
        return None if bound is None else bound.py_func

    call.__name__, call.__doc__ = name, stub.__doc__
    STUBS.add(call)
    return call  # type: ignore[return-value]


def bind(kind: type, *functions: Callable[..., Any]) -> None:
    """Let compiled ``functions`` stand for those of their names (see ``by_kind``) where a first argument is a ``kind``.

    Args:
        kind: a NamedTuple type.
        functions: compiled functions.
    """
    for function in functions:
        BOUND[function.__name__, kind] = function
