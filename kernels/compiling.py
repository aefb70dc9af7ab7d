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

Function = TypeVar("Function", bound=Callable[..., Any])


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
    root = Path(__file__).parents[1]
    envs = root / "envs"
    rooms = {folder, envs, root / "motion", root / "kernels"}
    if envs not in folder.parents:
        rooms |= {path for path in envs.iterdir() if path.is_dir()}
    digest = hashlib.sha256()
    for room in sorted(rooms):
        for source in sorted(room.glob("*.py")):
            digest.update(source.read_bytes())
    return digest.hexdigest()
