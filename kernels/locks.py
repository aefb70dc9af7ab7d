"""One run a folder: two that write the same files would lose each other's results."""

from __future__ import annotations

import errno
import getpass
import json
import os
import socket
import time
from pathlib import Path
from types import TracebackType
from typing import Any

from .files import alive, read_file

try:
    import fcntl
except ImportError:  # where there is none, a folder is guarded by the number of the process alone
    fcntl = None  # type: ignore[assignment]

LOCK = ".lock"
_MOST_BYTES = 10_000
_BUSY = (errno.EWOULDBLOCK, errno.EACCES, errno.EAGAIN)


class FolderBusyError(Exception):
    """Another run writes into the folder; the message is one line and says who and what to do."""


class FolderLock:
    """Holds a folder for this run until ``release``; the system lets go of it when the process dies, however.

    The file ``.lock`` says who: process, host, user and since when. What a dead process of this host left is taken
    over. On a disk that several hosts share, a lock of another host holds until its run ends or the file is deleted,
    since nobody here can tell whether that process lives.
    """

    def __init__(self, folder: Path):
        """Take the folder, which exists.

        Raises:
            FolderBusyError: another run holds it.
            OSError: the folder cannot be written.
        """
        self.path = folder / LOCK
        self._handle: int | None = None
        while self._handle is None:
            self._handle = self._taken(folder)

    def _taken(self, folder: Path) -> int | None:
        """The lock's file, open and held; None when its last owner has just removed it."""
        handle = os.open(self.path, os.O_RDWR | os.O_CREAT | getattr(os, "O_NOFOLLOW", 0), 0o644)
        try:
            held = _held(handle)
            owner = _owner(self.path)
            if held is False:
                raise FolderBusyError(_told(folder, owner, self.path, sure=True))
            elsewhere = owner.get("host", socket.gethostname()) != socket.gethostname()
            # Without locks of the system, a living process is the owner.
            if elsewhere or (held is None and (type(owner.get("process")) is int and alive(owner["process"]))):
                raise FolderBusyError(_told(folder, owner, self.path, sure=not elsewhere))
            if not _same(handle, self.path):
                os.close(handle)
                return None
            data = json.dumps(_self()).encode() + b"\n"
            os.ftruncate(handle, 0)
            os.write(handle, data)
        except BaseException:
            os.close(handle)
            raise
        return handle

    def release(self) -> None:
        """Let go of the folder; further calls do nothing."""
        if self._handle is not None:
            # Removed while it is held: who opened it meanwhile finds that it is no longer the folder's.
            self.path.unlink(missing_ok=True)
            os.close(self._handle)
            self._handle = None

    def __enter__(self) -> FolderLock:
        """Held since it was made."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Let go."""
        self.release()


def _held(handle: int) -> bool | None:
    """Whether the system gives the lock to this run; None where the disk knows no locks."""
    if fcntl is None:
        return None
    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        return False if error.errno in _BUSY else None
    return True


def _same(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), os.stat(path))
    except FileNotFoundError:
        return False


def _owner(path: Path) -> dict[str, Any]:
    """Who wrote the file; empty when nobody did yet or it is damaged."""
    try:
        found = json.loads(read_file(path, _MOST_BYTES))
    except (OSError, ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _self() -> dict[str, Any]:
    try:
        user = getpass.getuser()
    except (OSError, KeyError, ImportError):  # no name for the number of the user
        user = str(getattr(os, "getuid", lambda: "unknown")())
    since = time.strftime("%Y-%m-%dT%H:%M:%S%z")
    return {"process": os.getpid(), "host": socket.gethostname(), "user": user, "since": since}


def _told(folder: Path, owner: dict[str, Any], path: Path, sure: bool) -> str:
    words = {
        name: " ".join(str(owner.get(name, "unknown")).split())[:80] for name in ("process", "host", "user", "since")
    }
    who = f"process {words['process']} of {words['user']} on {words['host']}, since {words['since']}"
    advice = "wait for it, or choose another folder with --out"
    if not sure:
        advice += f"; if that run is dead, delete {path}"
    return f"another run writes into {folder} ({who}): {advice}"
