"""What a machine did second by second, small enough to lie in an episode's record.

``benchmark.episode`` feeds a recorder with every step's info; the record then has

- ``curve``: the net rate at ``CURVE_POINTS`` equal steps of the episode's time, for the mean over all seeds, and
- ``timeline``, of one seed a policy: the seconds of every decision in each phase, for the Gantt chart.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CURVE_POINTS = 33
"""Points of a cumulative curve, from the start of an episode to its end."""


class TimelineRecorder:
    """Collects the infos of one episode's steps."""

    def __init__(self) -> None:
        """Begin at the reset, before any step."""
        self._phases: tuple[str, ...] = ()
        self._seconds: list[list[float]] = []
        self._counts: list[tuple[float, float, float]] = []

    def add(self, info: Mapping[str, Any]) -> None:
        """Take the info of a step: its ``phases_s`` and the scorecard after it."""
        self._phases = tuple(info["phases_s"])
        self._seconds.append([float(value) for value in info["phases_s"].values()])
        scores = info["scorecard"]
        self._counts.append((float(scores["net_rate"]), float(scores["done"]), float(scores["damaged"])))

    def curve(self) -> list[float]:
        """Net rate at equal steps of time, ``CURVE_POINTS`` of them; empty without a step.

        Between two decisions the net rate is what it was after the earlier one.
        """
        if not self._seconds:
            return []
        ends = np.cumsum(np.sum(self._seconds, axis=1))
        at = np.linspace(0.0, ends[-1], CURVE_POINTS)
        rates = np.array([0.0, *(counts[0] for counts in self._counts)])
        after = np.searchsorted(ends, at * (1.0 + 1e-12), side="right")
        return [round(float(rate), 4) for rate in rates[after]]

    def timeline(self) -> dict[str, Any]:
        """Phase names, then a row a decision: its seconds in each phase, and net rate, done and damaged after it."""
        return {
            "phases": list(self._phases),
            "seconds": [[round(value, 3) for value in row] for row in self._seconds],
            "net_rate": [round(counts[0], 4) for counts in self._counts],
            "done": [int(counts[1]) for counts in self._counts],
            "damaged": [int(counts[2]) for counts in self._counts],
        }


@dataclass(frozen=True)
class Timeline:
    """One episode as it went.

    Attributes:
        policy: who decided.
        seed: of the environment.
        phases: names, in the order in which a decision passes through them.
        seconds: (n, phases) of every decision.
        net_rate: (n,) after it.
        done: (n,) targets done after it.
        damaged: (n,) targets damaged after it.
    """

    policy: str
    seed: int
    phases: tuple[str, ...]
    seconds: Array
    net_rate: Array
    done: Array
    damaged: Array

    @property
    def duration_s(self) -> float:
        """Seconds of the episode."""
        return float(self.seconds.sum())


def parse(policy: str, seed: int, value: Any) -> Timeline | None:
    """A timeline out of a record; None when it is missing or of another make."""
    if not isinstance(value, Mapping):
        return None
    try:
        phases = tuple(str(name) for name in value["phases"])
        seconds = np.array(value["seconds"], dtype=np.float64).reshape(-1, len(phases))
        columns = [_column(value.get(name), len(seconds)) for name in ("net_rate", "done", "damaged")]
    except (KeyError, TypeError, ValueError):
        return None
    return Timeline(policy, seed, phases, seconds, *columns) if len(seconds) and seconds.sum() > 0.0 else None


def _column(values: Sequence[float] | None, n: int) -> Array:
    return np.zeros(n) if values is None else np.array(values, dtype=np.float64).reshape(n)
