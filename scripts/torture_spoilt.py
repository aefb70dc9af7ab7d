"""Ways to spoil a file, for ``torture.py``."""

from __future__ import annotations

import io
import os
import re
import socket
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np

from fieldgym.scripts.torture_values import any_of

Spoil = Callable[[np.random.Generator, bytes, Path], None]
"""Makes of a file's content something at a path."""
HUGE = 2**40
LARGE = 2**29
NUMBERS = (b"1e999", b"NaN", b"-1", b"9" * 400, b"Infinity", b"null", b'"x"', b"[]", b"1e-320", b"0", b"true", b"2.5")


def _link(target: str) -> Spoil:
    return lambda rng, data, path: os.symlink(target, path)


def _written(change: Callable[[np.random.Generator, bytes], bytes]) -> Spoil:
    def spoil(rng: np.random.Generator, data: bytes, path: Path) -> None:
        path.write_bytes(change(rng, data))

    return spoil


def _sized(size: int) -> Spoil:
    def spoil(rng: np.random.Generator, data: bytes, path: Path) -> None:
        path.write_bytes(data)
        os.truncate(path, size)  # beyond the content nothing is on the disk

    return spoil


def _socket(rng: np.random.Generator, data: bytes, path: Path) -> None:
    here, server = os.getcwd(), socket.socket(socket.AF_UNIX)
    os.chdir(path.parent)  # a socket's path is short
    try:
        server.bind(path.name)
    finally:
        os.chdir(here)
        server.close()


def _loop(rng: np.random.Generator, data: bytes, path: Path) -> None:
    os.symlink(path.name, path)


def _linked(rng: np.random.Generator, data: bytes, path: Path) -> None:
    other = path.with_name("elsewhere")
    other.write_bytes(data)
    os.symlink(other.name, path)


def _bits(rng: np.random.Generator, data: bytes) -> bytes:
    changed = bytearray(data)
    for _ in range(int(rng.integers(1, 21))):
        changed[int(rng.integers(len(changed)))] ^= 1 << int(rng.integers(8))
    return bytes(changed)


def _block(rng: np.random.Generator, data: bytes) -> bytes:
    at, length = int(rng.integers(len(data))), int(rng.integers(1, 200))
    return data[:at] + rng.bytes(length) + data[at + length :]


def _inserted(what: bytes) -> Callable[[np.random.Generator, bytes], bytes]:
    def change(rng: np.random.Generator, data: bytes) -> bytes:
        at = int(rng.integers(len(data) + 1))
        return data[:at] + what + data[at:]

    return change


def _other_number(rng: np.random.Generator, data: bytes) -> bytes:
    found = list(re.finditer(rb"-?\d+(?:\.\d+)?(?:e-?\d+)?", data))
    for place in sorted(rng.integers(len(found), size=int(rng.integers(1, 4))).tolist(), reverse=True):
        begin, end = found[place].span()
        data = data[:begin] + any_of(rng, NUMBERS) + data[end:]
    return data


def _lines(rng: np.random.Generator, data: bytes) -> bytes:
    lines = data.split(b"\n")
    one, other = int(rng.integers(len(lines))), int(rng.integers(len(lines)))
    lines[one : one + int(rng.integers(3))] = [lines[other]] * int(rng.integers(3))
    return b"\n".join(lines)


def _bomb(rng: np.random.Generator, data: bytes) -> bytes:
    """The archive's first member, unpacked a thousandfold; of a text, one endless number."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            names = archive.namelist()
    except zipfile.BadZipFile:
        return data[: int(rng.integers(len(data) + 1))] + b"9" * 20_000_000
    made = io.BytesIO()
    with (
        zipfile.ZipFile(made, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive,
        archive.open(names[0], "w", force_zip64=True) as member,
    ):
        for _ in range(3 * 2**10):
            member.write(bytes(2**20))
    return made.getvalue()


def _nested(rng: np.random.Generator, data: bytes) -> bytes:
    at = data.find(b"\n") + 1 if rng.random() < 0.3 else 0
    return data[:at] + any_of(rng, (b"[", b'{"a":', b"- ", b"{a: ", b"a:\n ", b"(")) * 100_000


FORMS: dict[str, Spoil] = {
    "a device": _link("/dev/zero"),
    "nothing's device": _link("/dev/null"),
    "a pipe": lambda rng, data, path: os.mkfifo(path),
    "a folder": lambda rng, data, path: path.mkdir(),
    "a socket": _socket,
    "a link to itself": _loop,
    "a link to nothing": _link("/nowhere/at/all"),
    "a link to the file": _linked,
    "a terabyte of nothing": _sized(HUGE),
    "half a gigabyte of nothing": _sized(LARGE),
    "empty": _written(lambda rng, data: b""),
    "cut off": _written(lambda rng, data: data[: int(rng.integers(len(data)))]),
    "bits": _written(_bits),
    "a block": _written(_block),
    "noise": _written(lambda rng, data: rng.bytes(int(rng.integers(1, 10_000)))),
    "deep": _written(_nested),
    "UTF-16": _written(lambda rng, data: data.decode("latin-1").encode("utf-16")),
    "Latin-1": _written(_inserted(b"\xfc")),
    "zeros": _written(_inserted(bytes(8))),
    "another number": _written(_other_number),
    "lines": _written(_lines),
    "twice": _written(lambda rng, data: data + data),
    "carriage returns": _written(lambda rng, data: data.replace(b"\n", b"\r")),
    "a bomb": _written(_bomb),
    "odd name": _written(lambda rng, data: data),
}
