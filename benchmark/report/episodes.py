"""What single episodes tell over time: curves averaged over seeds, and one episode a policy in full."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..record import Record, field_of

Array = NDArray[np.float64]

GRID = 97
"""Points of a mean curve."""


@dataclass(frozen=True)
class Curve:
    """Mean net rate against time.

    Attributes:
        time_s: (n,).
        rate: (n,) mean over the episodes; one that has ended keeps its last value.
        low: (n,) tenth percentile.
        high: (n,) ninetieth percentile.
        end_s: mean duration of the episodes.
        episodes: how many.
    """

    time_s: Array
    rate: Array
    low: Array
    high: Array
    end_s: float
    episodes: int

    def seconds_to(self, rate: float) -> float | None:
        """When the mean reaches ``rate``; None when it does not."""
        reached = np.flatnonzero(self.rate >= rate)
        return float(self.time_s[reached[0]]) if len(reached) else None


@dataclass(frozen=True)
class Timeline:
    """One episode as it went.

    Attributes:
        policy: who decided.
        field: name of its file, else its seed.
        began_s: seconds that had passed before the first decision.
        phases: names, in the order in which a decision passes through them.
        seconds: (n, phases) of every decision.
        net_rate: (n,) after it.
        done: (n,) targets done after it.
        damaged: (n,) targets damaged after it.
        words: (n,) what each decision was; empty when unknown.
    """

    policy: str
    field: int | str
    began_s: float
    phases: tuple[str, ...]
    seconds: Array
    net_rate: Array
    done: Array
    damaged: Array
    words: tuple[str, ...]

    @property
    def edges_s(self) -> Array:
        """(n x phases + 1,) when each stretch of a phase began, and the end of the last one."""
        return self.began_s + np.concatenate([[0.0], np.cumsum(self.seconds.ravel())])

    @property
    def ends_s(self) -> Array:
        """(n,) when each decision was over."""
        return self.began_s + np.cumsum(self.seconds.sum(axis=1))

    @property
    def duration_s(self) -> float:
        """When the last decision was over."""
        return float(self.ends_s[-1])


def mean_curve(records: Sequence[Record]) -> Curve | None:
    """Mean over the episodes that have a curve, on one grid of time; None without any."""
    told = [
        (float(record["scorecard"]["duration_s"]), np.array(record["curve"], dtype=np.float64))
        for record in records
        if record.get("curve")
    ]
    if not told:
        return None
    durations = [duration for duration, _ in told]
    time_s = np.linspace(0.0, max(durations), GRID)
    rates = np.stack([np.interp(time_s, np.linspace(0.0, end, len(curve)), curve) for end, curve in told])
    low, high = np.percentile(rates, (10.0, 90.0), axis=0)
    return Curve(time_s, rates.mean(axis=0), low, high, float(np.mean(durations)), len(told))


def chosen_timelines(by_policy: Mapping[str, Sequence[Record]]) -> dict[str, Timeline]:
    """Of every policy the timeline of the field that most policies have one of."""
    found: dict[str, dict[int | str, Timeline]] = {}
    for policy, records in by_policy.items():
        read = (parse_timeline(policy, field_of(record), record.get("timeline")) for record in records)
        found[policy] = {timeline.field: timeline for timeline in read if timeline is not None}
    fields = sorted({field for own in found.values() for field in own})
    if not fields:
        return {}
    best = max(fields, key=lambda field: sum(field in own for own in found.values()))  # of equal ones the first
    return {policy: own[best] for policy, own in found.items() if best in own}


def parse_timeline(policy: str, field: int | str, value: Any) -> Timeline | None:
    """A timeline out of a record; None when it is missing, empty or of another make."""
    if not isinstance(value, Mapping):
        return None
    try:
        phases = tuple(str(name) for name in value["phases"])
        seconds = np.array(value["seconds"], dtype=np.float64).reshape(-1, len(phases))
        net_rate, done, damaged = (_column(value.get(name), len(seconds)) for name in ("net_rate", "done", "damaged"))
        words = tuple(str(word) for word in value.get("words") or ())
        began_s = float(value.get("began_s", 0.0))
    except (KeyError, TypeError, ValueError):
        return None
    if not len(seconds) or seconds.sum() <= 0.0:
        return None
    words = words if len(words) == len(seconds) else ()
    return Timeline(policy, field, began_s, phases, seconds, net_rate, done, damaged, words)


def _column(values: Sequence[float] | None, n: int) -> Array:
    return np.zeros(n) if values is None else np.array(values, dtype=np.float64).reshape(n)
