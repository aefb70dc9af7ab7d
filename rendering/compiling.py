"""Kernels of pictures as machine code."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile ``function`` at its first call: IEEE arithmetic as written, other threads running beside it."""
    dispatcher: Any = numba.njit(cache=True, error_model="numpy", nogil=True)(function)
    return dispatcher
