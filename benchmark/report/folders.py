"""Results folders, one or several: what is whole in them, and which of them tells of which task."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ...envs import task
from ...envs.task import TaskSpec
from ..record import Record
from ..store import BOUNDS, EPISODES, MANIFEST, ResultsError, read, read_manifest


class Source(NamedTuple):
    """A folder, and what it tells of.

    Attributes:
        manifest: who made its results, with what; empty where that is not known.
        tasks: those that it tells of, in the order of its episodes.
        episodes: finished ones of these.
        bounds: of these.
    """

    manifest: Mapping[str, Any]
    tasks: tuple[TaskSpec, ...]
    episodes: tuple[Record, ...]
    bounds: tuple[Record, ...]


def sources(folders: Sequence[Path]) -> tuple[Source, ...]:
    """What folders hold. A task that several of them hold is the last one's: states of the code are never mixed in it.

    Raises:
        ResultsError: there are no results in one of them; the message says what to do.
    """
    found: list[Source] = []
    for folder in folders:
        own = _source(folder)
        found = [_without(earlier, own.tasks) for earlier in found] + [own]
    return tuple(each for each in found if each.tasks)


def task_of(record: Record) -> TaskSpec | None:
    """The task that a record is of; None where it is not installed here."""
    try:
        return task(record["env_id"])
    except ValueError:
        return None


def _source(folder: Path) -> Source:
    try:
        found = read(folder / EPISODES)
        bounds = read(folder / BOUNDS) if (folder / BOUNDS).exists() else []
    except OSError:
        raise ResultsError(
            f"no results in {folder}: name a folder with {EPISODES} in it, or make one with fieldgym benchmark"
        ) from None
    episodes = [record for record in found if "error" not in record and task_of(record) is not None]
    if not episodes:
        raise ResultsError(f"{folder / EPISODES} holds no finished episode: go on with fieldgym benchmark --resume")
    specs = {spec.id: spec for record in episodes if (spec := task_of(record)) is not None}
    return Source(_manifest(folder), tuple(specs.values()), tuple(episodes), tuple(bounds))


def _without(source: Source, tasks: Sequence[TaskSpec]) -> Source:
    """What is left of a folder when tasks are told of by another one."""
    left = tuple(spec for spec in source.tasks if spec not in tasks)
    return Source(
        source.manifest,
        left,
        tuple(record for record in source.episodes if task_of(record) in left),
        tuple(record for record in source.bounds if task_of(record) in left),
    )


def _manifest(folder: Path) -> Mapping[str, Any]:
    try:
        return read_manifest(folder)
    except FileNotFoundError:
        return {}
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        warnings.warn(f"{folder / MANIFEST} is left out: {reason}", stacklevel=2)
        return {}
