"""What an episode leaves behind, as plain JSON values."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from typing import Any

from .suites import SCENARIO, Condition, Episode, changes_of

Record = dict[str, Any]
"""An episode's conditions: ``env_id``, ``scenario``, ``backend``, ``perception``, ``policy``, ``seed``; and, if any,
``changes`` (numbers by dotted name, a scenario from a file among them), ``fields`` (a folder) with ``field`` (a file in
it) and ``field_digest``, ``source`` (digest of a policy that is not the package's own) and ``task_source`` (of such a
task). Then one of:

- an episode's result: ``return``, ``rewards`` (sum of each term), ``steps``, ``terminated``, ``scorecard`` (the
  task's, phases among it as ``phase_<name>_s``), ``last_s`` (simulated seconds at which the last target was finished,
  0 without one), ``wall_s``, and the policy's thinking, seconds of the core that decides: ``decision_s`` (sum),
  ``decision_p95_ms`` (95th percentile a decision), ``decision_before_last_s`` (sum up to the last finished target);
  ``curve``, and of a case's first seed ``timeline``, as ``report.timeline`` describes them, the latter with
  ``began_s``, the seconds that had passed before the first decision, and ``words``, a line a decision: kind, target
  and effect;
- a bound's (policy ``"bound"``): ``bound`` and ``wall_s``, see ``limits.bound``;
- ``error``: why there is no result.
"""

TIMINGS = ("wall_s", "decision_s", "decision_p95_ms", "decision_before_last_s")
"""What is measured with a clock: the only parts of a record that differ between two runs."""


_SPECIAL = ("changes", "fields", "field", "field_digest", "source", "task_source")


def identity(episode: Episode) -> Record:
    """The fields of a record that tell one episode from all others."""
    where, file = episode.condition, episode.field
    special = {
        "changes": where.numbers,
        "fields": where.fields,
        "field": file.name if file else "",
        "field_digest": file.digest if file else "",
        "source": episode.source.sha256 if episode.source else "",
        "task_source": episode.task_code,
    }
    return {
        "env_id": where.env_id,
        "scenario": where.scenario,
        "backend": where.backend,
        "perception": where.perception,
        "policy": episode.policy,
        "seed": episode.seed,
        **{name: value for name, value in special.items() if value},
    }


def key(record: Record) -> tuple[Any, ...]:
    """What a record and an episode have in common when they are the same."""
    told = (record[name] for name in ("env_id", "scenario", "backend", "perception", "policy", "seed"))
    return (*told, changes_of(record.get("changes", {})), *(record.get(name, "") for name in _SPECIAL[1:]))


def condition(record: Record) -> Condition:
    """The condition under which a record was made."""
    return Condition(
        record["env_id"],
        record["scenario"],
        record["backend"],
        record["perception"],
        changes_of(record.get("changes", {})),
        record.get("fields", ""),
    )


def field_of(record: Record) -> int | str:
    """What a record's field is told by: the name of its file, else its seed."""
    return record.get("field", record["seed"])


def states(record: Record) -> dict[tuple[str, ...], str]:
    """The state of everything outside the package that a record depends on, by what it is called.

    Two records that name the same thing in different states must not stand in one table.
    """
    env_id, scenario = record["env_id"], record["scenario"]
    return {
        ("policy", env_id, record["policy"]): record.get("source", ""),
        ("task", env_id): record.get("task_source", ""),
        ("scenario", env_id, scenario): json.dumps(record.get("changes", {}).get(SCENARIO), sort_keys=True),
        ("field", env_id, record.get("fields", ""), record.get("field", "")): record.get("field_digest", ""),
    }


def failed(episode: Episode, reason: str) -> Record:
    """The record of an episode that has no result."""
    return {**identity(episode), "error": " ".join(reason.split())}


def untimed(record: Record) -> Record:
    """A record without what a clock measured: equal for two runs of the same episode."""
    return {name: value for name, value in record.items() if name not in TIMINGS}


def digest(records: Iterable[Record]) -> str:
    """Of what was simulated, in any order, clocks left out: two runs of a suite have the same.

    Raises:
        ValueError: thinking was charged to a record, which then repeats on no other run.
    """
    lines = []
    for record in records:
        if record.get("charged"):
            raise ValueError("records with charged thinking are not deterministic: take the digest before charging")
        lines.append(json.dumps(untimed(record), sort_keys=True))
    return hashlib.sha256("\n".join(sorted(lines)).encode()).hexdigest()[:16]


def plain(values: Mapping[str, Any]) -> dict[str, float | None]:
    """Named values as JSON numbers; what is not finite (the cycle time of an episode without a cycle) is None."""
    return {name: plain_number(value) for name, value in values.items()}


def plain_number(value: Any) -> float | None:
    """A JSON number; None for what is not finite."""
    return float(value) if math.isfinite(value) else None
