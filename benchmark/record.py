"""What an episode leaves behind, as plain JSON values."""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from typing import Any

from .suites import Condition, Episode

Record = dict[str, Any]
"""An episode's conditions (``env_id``, ``scenario``, ``backend``, ``perception``, ``policy``, ``seed``), then one of:

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


def identity(episode: Episode) -> Record:
    """The fields of a record that tell one episode from all others."""
    condition = episode.condition
    return {
        "env_id": condition.env_id,
        "scenario": condition.scenario,
        "backend": condition.backend,
        "perception": condition.perception,
        "policy": episode.policy,
        "seed": episode.seed,
    }


def key(record: Record) -> tuple[Any, ...]:
    """What a record and an episode have in common when they are the same."""
    return tuple(record[name] for name in ("env_id", "scenario", "backend", "perception", "policy", "seed"))


def condition(record: Record) -> Condition:
    """The condition under which a record was made."""
    return Condition(record["env_id"], record["scenario"], record["backend"], record["perception"])


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
