"""Scalar rules as machine code: loops over worlds that cost next to nothing, for one world as for thousands.

A kernel treats one world after the other with the same scalar operations, so a batch equals its single worlds bit for
bit. NumPy and Numba only; no task and no other room is known here.
"""

from .binding import bind, by_kind
from .compiling import compiled
from .rows import copy, fill

__all__ = ["bind", "by_kind", "compiled", "copy", "fill"]
