"""Rules as machine code: loops over worlds that cost next to nothing, for one world as for thousands.

A kernel treats one world after the other with the same scalar operations, so a batch equals its single worlds bit for
bit. Machine code is kept beside the sources in ``__pycache__`` (or in the user's cache folder where that is
read-only); the first call on a machine compiles for some seconds.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

import numba

from ..motion import laws

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile ``function`` at its first call; IEEE arithmetic as written, division by zero gives infinity or NaN."""
    dispatcher: Any = numba.njit(cache=True, error_model="numpy")(function)
    # Numba renews kept machine code when the function's own file has changed. What it calls stands in other files too.
    dispatcher._cache._cache_file._source_stamp = _stamp(Path(inspect.getfile(function)).parent)
    return dispatcher


@cache
def _stamp(folder: Path) -> str:
    """Digest of every source file that a kernel in ``folder`` may be made of: its task's, and those all tasks share."""
    digest = hashlib.sha256()
    for room in sorted({folder, Path(__file__).parent, Path(__file__).parent.parent / "motion"}):
        for source in sorted(room.glob("*.py")):
            digest.update(source.read_bytes())
    return digest.hexdigest()


shortest = compiled(laws.shortest)
"""``motion.laws.shortest`` of one stroke, for kernels."""
