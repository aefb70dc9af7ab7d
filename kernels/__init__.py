"""The ground floor: scalar rules as machine code, and configurations that check what they are given.

A kernel treats one world after the other with the same scalar operations: loops over worlds cost next to nothing, for
one world as for thousands, and a batch equals its single worlds bit for bit. NumPy and Numba only; no task and no other
room is known here. Numba is imported with the first kernel, not with a configuration.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .binding import bind, by_kind
    from .compiling import compiled
    from .desks import desk, planned
    from .rows import copy, fill

__all__ = ["bind", "by_kind", "compiled", "copy", "desk", "fill", "planned"]

_MODULES = {
    "bind": "binding",
    "by_kind": "binding",
    "compiled": "compiling",
    "copy": "rows",
    "desk": "desks",
    "fill": "rows",
    "planned": "desks",
}


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
