"""Files that hold the old or the new content, never a part of it, and files that are looked at before they are read."""

from __future__ import annotations

import os
import stat
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from glob import escape
from pathlib import Path
from typing import BinaryIO


def replace_file(path: Path, data: bytes | str) -> None:
    """Write a file; when this returns it is on the disk, and whatever happens before, the old one stays whole.

    Args:
        path: in a folder that exists.
        data: text goes out as UTF-8, line breaks as they are.

    Raises:
        OSError: it cannot be written.
    """
    with replaced(path) as temporary:
        temporary.write_bytes(data.encode("utf-8") if isinstance(data, str) else data)


@contextmanager
def replaced(path: Path) -> Iterator[Path]:
    """A name in ``path``'s folder and with its ending, for whatever writes files by name.

    What lies there at the end of the block takes the place of ``path``, and is on the disk. After an error ``path`` is
    what it was. What a process that was killed here left behind is removed.

    Raises:
        OSError: it cannot be written.
    """
    temporary = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    for left in path.parent.glob(f".{escape(path.stem)}.*.part{escape(path.suffix)}"):
        number = left.name[len(path.stem) + 2 : len(left.name) - len(path.suffix) - len(".part")]
        if number.isdecimal() and not alive(int(number)):
            left.unlink(missing_ok=True)
    try:
        yield temporary
        # A rename may reach the disk before what it names: after a power cut the file would be empty.
        flush(temporary)
        os.replace(temporary, path)
        flush(path.parent)
    finally:
        temporary.unlink(missing_ok=True)


def alive(process: int) -> bool:
    """Whether a process of this number, another than this one, may live on this machine."""
    if process < 1 or os.name != "posix":
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except (OSError, OverflowError):
        return True
    return process != os.getpid()


def flush(path: Path) -> None:
    """Put a file's content, or the names in a folder, on the disk.

    Raises:
        OSError: the disk is full or broken.
    """
    folder = path.is_dir()
    try:
        handle = os.open(path, os.O_RDONLY if folder else os.O_RDWR)
    except OSError:
        if folder:  # not every system opens folders, and not every folder may be read
            return
        raise
    try:
        os.fsync(handle)
    except OSError:
        if not folder:  # not every file system has folders that can be flushed
            raise
    finally:
        os.close(handle)


def read_file(path: Path, most_bytes: int) -> bytes:
    """The content of a file that is one: no device, pipe or folder, which could last for ever, is opened.

    Args:
        path: the file, or a link to it.
        most_bytes: of its size; a larger one is not read.

    Raises:
        OSError: it is no file, too large, or cannot be read; ``strerror`` says which.
    """
    with opened(path, most_bytes) as stream:
        data = stream.read(most_bytes + 1)
    if len(data) > most_bytes:
        raise OSError(0, f"it grows beyond {most_bytes} bytes", str(path))
    return data


@contextmanager
def opened(path: Path, most_bytes: int) -> Iterator[BinaryIO]:
    """What ``read_file`` reads, for whoever reads it bit by bit.

    Raises:
        OSError: it is no file, too large, or cannot be read; ``strerror`` says which.
    """
    _checked(os.stat(path), path, most_bytes)
    # It may have become a pipe since, and opening one of these waits for who writes into it.
    handle = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0))
    with os.fdopen(handle, "rb") as stream:
        _checked(os.fstat(handle), path, most_bytes)
        yield stream


def appendable(path: Path) -> None:
    """See to it that ``path`` is a file or nothing yet: a pipe would wait for a reader, a device would keep nothing.

    Raises:
        OSError: it is something else; ``strerror`` says what.
    """
    try:
        found = os.stat(path)
    except FileNotFoundError:
        return
    _checked(found, path, found.st_size)


def unpacked_bytes(data: BinaryIO) -> int:
    """What an archive's members take when they are unpacked; 0 of what is no zip archive."""
    try:
        with zipfile.ZipFile(data) as archive:
            return sum(item.file_size for item in archive.infolist())
    except zipfile.BadZipFile:
        return 0
    finally:
        data.seek(0)


def _checked(found: os.stat_result, path: Path, most_bytes: int) -> None:
    if not stat.S_ISREG(found.st_mode):
        raise OSError(0, f"it is {_kind(found.st_mode)}, no file", str(path))
    if found.st_size > most_bytes:
        raise OSError(0, f"it has {found.st_size} bytes, at most {most_bytes} are read", str(path))


def _kind(mode: int) -> str:
    kinds = {
        stat.S_IFDIR: "a folder",
        stat.S_IFIFO: "a pipe",
        stat.S_IFCHR: "a device",
        stat.S_IFBLK: "a device",
        stat.S_IFSOCK: "a socket",
    }
    return kinds.get(stat.S_IFMT(mode), "something else")
