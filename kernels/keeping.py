"""Where machine code is kept, and when it is served again: Numba's own cache, with three differences.

It lies in the user's cache folder and not beside the sources, so that removing the package leaves nothing in its place;
code is renewed by its ``stamp`` and not by its file; a machine on which nothing can be kept compiles all the same.
"""

from __future__ import annotations

import contextlib
import logging
import os
import pickle
import sys
import tempfile
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

from numba.core import caching, config

from .stamps import stamp

_UNREADABLE = (AttributeError, EOFError, ImportError, IndexError, ValueError, pickle.UnpicklingError)
"""What kept code raises that was cut short, or made for a type that this process does not have."""
_TOLD: list[str] = []


def keep(dispatcher: Any) -> None:
    """Let a compiled function keep its machine code, where it stands in a file and a folder can be written."""
    if not os.path.exists(dispatcher.py_func.__code__.co_filename):
        return  # made at the prompt: another process has no such function
    try:
        dispatcher._cache = _Cache(dispatcher)
    except RuntimeError:
        _tell("no folder for it can be written")


def user_folder() -> Path | None:
    """Where this user's programs keep what they can make again; ``None`` where the user has no home."""
    try:
        if sys.platform == "win32":
            caches = Path(os.environ.get("LOCALAPPDATA") or Path.home() / "AppData" / "Local")
        elif sys.platform == "darwin":
            caches = Path.home() / "Library" / "Caches"
        else:
            caches = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    except RuntimeError:
        return None
    return caches / "fieldgym" / "machine-code"


def _tell(why: str) -> None:
    """Say once a process that code is not kept."""
    if not _TOLD:
        _TOLD.append(why)
        logging.getLogger("fieldgym").warning(
            "Machine code is not kept (%s), so every process compiles for some seconds: "
            "let NUMBA_CACHE_DIR name a folder that can be written.",
            why,
        )


@cache
def _writable(folder: str) -> bool:
    try:
        os.makedirs(folder, exist_ok=True)
        tempfile.TemporaryFile(dir=folder).close()
    except OSError:
        return False
    return True


class _Place(caching._CacheLocator):
    """A folder for each folder of sources: two copies of the package do not renew each other's code."""

    def __init__(self, file: str, root: str):
        self._py_file = file  # Numba's warnings name it
        self._path = os.path.join(root, self.get_suitable_cache_subpath(file))

    @classmethod
    def from_function(cls, py_func: Any, py_file: str) -> _Place | None:
        """The first place that can be written; ``None`` makes Numba raise a RuntimeError."""
        roots = (config.CACHE_DIR, user_folder())  # type: ignore[attr-defined]
        places = (cls(py_file, str(root)) for root in roots if root)
        return next((place for place in places if _writable(place._path)), None)

    def get_cache_path(self) -> Any:
        """The folder."""
        return self._path

    def get_source_stamp(self) -> Any:
        """None yet: what the function calls may not be defined when it is."""

    def get_disambiguator(self) -> Any:
        """Numba's default is the line number, which a line above would move."""
        return ""


class _Code(caching.CompileResultCacheImpl):
    _locator_classes = [_Place]  # noqa: RUF012

    def get_filename_base(self, fullname: str, abiflags: str) -> str:
        """Name of the files that hold a function's code."""
        return f"{fullname.replace('<', '').replace('>', '')}.{sys.implementation.cache_tag}{abiflags}"


class _File(caching.IndexDataCacheFile):
    """Code of one function for all types of arguments.

    Numba's index holds the stamp of the function alone, and is begun anew when that changes. Each code holds its own as
    well, with its arguments and what is bound to them: Numba writes the index and the code one after the other, and a
    process with other sources may come between.
    """

    def __init__(self, path: str, name: str, dispatcher: Any):
        super().__init__(path, name, None)
        self._dispatcher = dispatcher

    def save(self, key: Any, data: Any) -> None:
        super().save(key, (key, self._whole(key), self._dump(data)))

    def load(self, key: Any) -> Any:
        whole = self._whole(key)
        try:
            kept = super().load(key)
            return pickle.loads(kept[2]) if kept is not None and kept[:2] == (key, whole) else None
        except _UNREADABLE:
            return None

    def _whole(self, key: Any) -> str:
        return stamp(self._dispatcher, getattr(key[0], "args", key[0]))

    def _load_index(self) -> dict[Any, str]:
        if self._source_stamp is None:
            self._source_stamp = stamp(self._dispatcher)
        try:
            return super()._load_index()
        except _UNREADABLE:
            return {}


class _Cache(caching.FunctionCache):
    _impl_class = _Code

    def __init__(self, dispatcher: Any):
        super().__init__(dispatcher.py_func)
        self._cache_file = _File(self.cache_path, self._impl.filename_base, dispatcher)

    @contextlib.contextmanager
    def _guard_against_spurious_io_errors(self) -> Iterator[None]:
        """A full disk, a folder that is gone: what was compiled runs all the same."""
        try:
            yield
        except OSError as error:
            _tell(str(error))
