"""From a plain function to machine code that is kept from one process to the next."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import numba

from .binding import OPTIONS
from .keeping import keep

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile ``function`` at its first call; IEEE arithmetic as written, division by zero gives infinity or NaN.

    The first call on a machine takes seconds; its code is kept in the user's cache folder (``NUMBA_CACHE_DIR`` names
    another one) and serves as long as nothing has changed that it is made of.
    """
    dispatcher: Any = numba.njit(**OPTIONS)(function)
    if dispatcher is not function:  # as it is where NUMBA_DISABLE_JIT is set
        keep(dispatcher)
    return dispatcher
