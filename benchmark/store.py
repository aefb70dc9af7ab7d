"""Where results live: one line of JSON an episode, safe against being stopped at any moment, beside a manifest.

Everything that reads results reads them with ``read`` and ``read_manifest``, which tell what is damaged.
"""

from __future__ import annotations

import hashlib
import json
import os
import platform
import time
import warnings
from collections.abc import Iterable, Mapping
from importlib import metadata
from pathlib import Path
from typing import Any

from .. import __version__
from ..kernels.files import appendable, flush, read_file, replace_file
from ..kernels.locks import FolderBusyError, FolderLock
from .record import Record, condition, field_of, identity, key, states, untimed
from .schema import parsed, parsed_manifest
from .suites import BOUND, Episode, Suite

EPISODES = "episodes.jsonl"
BOUNDS = "bounds.jsonl"
MANIFEST = "manifest.json"
FORMAT = 2
PACKAGES = ("gymnasium", "numba", "numpy", "opencv-python-headless", "pybullet", "pybullet-arm64", "scipy")
"""Installed packages that can move a result."""

MOST_BYTES = 2**31
"""Largest file of results that is read: more than a million episodes."""
MOST_TOLD = 5
"""Damaged lines of a file that are told one by one before the rest is only counted."""

MUST_AGREE = ("format", "suite", "fieldgym", "source", "packages")
"""Manifest entries that have to be equal before episodes may be added to a folder."""


class ResultsError(Exception):
    """The results folder cannot be used; the message says why and what to do."""


def manifest(suite: Suite) -> dict[str, Any]:
    """What identifies the code and the machine behind results of a suite."""
    return {
        "format": FORMAT,
        "suite": suite.name,
        "fieldgym": __version__,
        "source": source_digest(),
        "sources": {source.name: source.sha256 for case in suite.cases for source in case.sources},
        "packages": {name: _version(name) for name in PACKAGES},
        "python": platform.python_version(),
        "machine": f"{platform.system()} {platform.machine()}, {os.cpu_count()} cores{_processor()}",
        "started": time.strftime("%Y-%m-%dT%H:%M:%S%z"),
    }


def _processor() -> str:
    """Name of the processor where the system tells it."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8", "replace").splitlines()
    except OSError:
        return ""
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return f", {names[0]}" if names else ""


def source_digest() -> str:
    """Digest of the package's modules and assets: results of two states of the code must not be mixed.

    What policies and tasks from elsewhere are made of stands in their records, see ``record.states``.
    """
    root = Path(__file__).resolve().parents[1]
    digest = hashlib.sha256()
    rooms = ("kernels", "mechanisms", "motion", "rendering", "simulation", "perception", "envs", "bounds", "agents")
    files = [path for room in (*rooms, "assets") for path in (root / room).rglob("*") if path.is_file()]
    own = [root / "benchmark" / f"{name}.py" for name in ("episode", "limits", "record", "report/timeline")]
    for path in sorted([*files, *own]):
        if "__pycache__" not in path.parts:
            digest.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()[:16]


def _version(package: str) -> str | None:
    try:
        return metadata.version(package)
    except metadata.PackageNotFoundError:
        return None


class Results:
    """The results of one suite in one folder.

    Attributes:
        folder: holds ``episodes.jsonl``, ``bounds.jsonl``, ``manifest.json`` and the summaries.
        records: the episodes that are finished; failed ones of an earlier run are left out, so that they run again.
        bounds: the bounds that are finished.
        outdated: how many were left out because a file that they came from has changed.
    """

    def __init__(self, folder: Path, manifest_now: dict[str, Any], resume: bool, wanted: Iterable[Episode] = ()):
        """Open a folder to add episodes and bounds to it.

        Without ``resume``, what lies there is kept as ``episodes.previous.jsonl`` and ``bounds.previous.jsonl``. With
        it, results of a policy, scenario or field that ``wanted`` has in another state are left out, and damaged lines
        too; a file that held some is kept as ``episodes.damaged.jsonl``. The folder is held until ``close``.

        Raises:
            ResultsError: the folder cannot be written, another run writes into it, or its results come from another
                version, suite or state of the code.
        """
        self.folder = folder
        self.records: list[Record] = []
        self.bounds: list[Record] = []
        self.outdated = 0
        now: dict[tuple[str, ...], str] = {}
        for episode in wanted:
            now |= states(identity(episode))
        self._files: dict[str, int] = {}
        self._lock: FolderLock | None = None
        try:
            folder.mkdir(parents=True, exist_ok=True)
            self._lock = FolderLock(folder)
            self._open(manifest_now, resume, now)
        except FolderBusyError as error:
            raise ResultsError(str(error)) from None
        except OSError as error:
            self.close()
            reason = error.strerror or str(error)
            raise ResultsError(
                f"cannot write results to {folder} ({reason}): choose another folder with --out"
            ) from error
        except BaseException:
            self.close()
            raise

    def _open(self, manifest_now: dict[str, Any], resume: bool, now: Mapping[tuple[str, ...], str]) -> None:
        folder = self.folder
        there = [name for name in (EPISODES, BOUNDS) if _filled(folder / name)]
        if there and resume:
            self._check_manifest(manifest_now)
        for name in there:
            path = folder / name
            if resume:
                kept = self._list(name)
                found, damaged = _read(path)
                if damaged:
                    replace_file(path.with_suffix(".damaged.jsonl"), read_file(path, MOST_BYTES))
                there_before = [record for record in found if "error" not in record]
                kept += [record for record in there_before if _as_now(record, now)]
                self.outdated += len(there_before) - len(kept)
                replace_file(path, "".join(json.dumps(record) + "\n" for record in kept))
            else:
                os.replace(path, path.with_suffix(".previous.jsonl"))
        if there and not resume:
            for summary in folder.glob("summary.*"):
                summary.unlink()
        replace_file(folder / MANIFEST, json.dumps(manifest_now, indent=2) + "\n")
        for name in (EPISODES, BOUNDS):
            appendable(folder / name)
            self._files[name] = os.open(folder / name, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o644)
        flush(folder)

    def _list(self, name: str) -> list[Record]:
        return self.bounds if name == BOUNDS else self.records

    def _check_manifest(self, now: dict[str, Any]) -> None:
        path = self.folder / MANIFEST
        fresh = f"start over without --resume, or write elsewhere with --out (the old ones lie in {self.folder})"
        try:
            before = read_manifest(self.folder)
        except FileNotFoundError:
            raise ResultsError(f"cannot resume: {path} is missing; {fresh}") from None
        except OSError as error:
            raise ResultsError(f"cannot resume: {path} cannot be read ({error.strerror}); {fresh}") from None
        except ValueError as error:
            raise ResultsError(f"cannot resume: {path} is damaged ({error}); {fresh}") from None
        for name in MUST_AGREE:
            if before.get(name) != now[name]:
                old, new = _differing(before.get(name), now[name])
                what = "state of the source" if name == "source" else name
                raise ResultsError(f"cannot resume: these results have {what} {old}, now it is {new}; {fresh}")

    def finished(self, episodes: Iterable[Episode]) -> set[Episode]:
        """Those of ``episodes``, bounds among them, that have a result here."""
        done = {key(record) for record in (*self.records, *self.bounds) if "error" not in record}
        return {episode for episode in episodes if key(identity(episode)) in done}

    def append(self, record: Record) -> None:
        """Add one record; when this returns, it is on the disk."""
        name = BOUNDS if record["policy"] == BOUND else EPISODES
        line = (json.dumps(record, allow_nan=False) + "\n").encode()
        try:
            while line:
                # A disk that runs full takes a part without an error.
                line = line[os.write(self._files[name], line) :]
            os.fsync(self._files[name])
        except OSError as error:
            raise ResultsError(
                f"cannot write {self.folder / name} ({error.strerror}): finished episodes stay"
            ) from error
        self._list(name).append(record)

    def close(self) -> None:
        """Close the files and let go of the folder; further calls do nothing."""
        while self._files:
            os.close(self._files.popitem()[1])
        if self._lock is not None:
            self._lock.release()


def _as_now(record: Record, now: Mapping[tuple[str, ...], str]) -> bool:
    """Whether nothing that a record depends on is wanted in another state."""
    return all(now.get(name, state) == state for name, state in states(record).items())


def _filled(path: Path) -> bool:
    return path.exists() and path.stat().st_size > 0


def _differing(before: Any, now: Any) -> tuple[str, str]:
    """Two values as text, of two dictionaries only what differs."""
    if isinstance(before, dict) and isinstance(now, dict):
        names = [name for name in now if before.get(name) != now[name]]
        old, new = (", ".join(f"{name} {side.get(name)}" for name in names) for side in (before, now))
        return old, new
    return str(before), str(now)


def read(path: Path) -> list[Record]:
    """The records of a file of JSON lines, each episode once; what is damaged is left out and told in a warning a line.

    Raises:
        OSError: there is no such file, or it cannot be read.
    """
    return _read(path)[0]


def _read(path: Path) -> tuple[list[Record], bool]:
    """The same, and whether a line was damaged otherwise than by a kill, which tears the last one."""
    *lines, last = read_file(path, MOST_BYTES).split(b"\n")
    records, faults, torn = [], [], False
    first: dict[tuple[Any, ...], tuple[int, Record]] = {}
    for number, line in enumerate([*lines, last], start=1):
        if number > len(lines) and not line:
            break
        try:
            record = parsed(line, path.name.startswith(Path(BOUNDS).stem))
        except ValueError as error:
            torn = number > len(lines)
            faults.append(f"{path}, line {number} is left out: {'it is torn' if torn else error}")
            continue
        if "error" not in record:
            before, same = first.setdefault(key(record), (number, record))
            if same is not record:
                other = "" if untimed(same) == untimed(record) else " with another result"
                faults.append(f"{path}, line {number} is left out: it repeats line {before}{other}")
                continue
        records.append(record)
    for fault in faults[:MOST_TOLD]:
        warnings.warn(fault, stacklevel=3)
    if len(faults) > MOST_TOLD:
        warnings.warn(f"{path}: {len(faults) - MOST_TOLD} more lines are left out", stacklevel=3)
    return records, len(faults) > torn


def read_manifest(folder: Path) -> dict[str, Any]:
    """What identifies the code and the machine behind the results in a folder.

    Raises:
        OSError: it cannot be read.
        ValueError: it is damaged; the message says how.
    """
    return parsed_manifest(read_file(folder / MANIFEST, MOST_BYTES))


def load(folder: Path) -> list[Record]:
    """The finished episodes in a folder, each with its instance's ``bound`` where there is one.

    Raises:
        OSError: the folder holds no episodes.
    """
    records = [record for record in read(folder / EPISODES) if "error" not in record]
    bounds = read(folder / BOUNDS) if (folder / BOUNDS).exists() else []
    found = {(condition(record), field_of(record)): record["bound"] for record in bounds if "error" not in record}
    return [{**record, "bound": found.get((condition(record), field_of(record)))} for record in records]
