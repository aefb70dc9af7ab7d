"""What a machine did second by second, small enough to lie in an episode's record.

``benchmark.episode`` feeds a recorder with every step's info; the record then has

- ``curve``: the net rate at ``CURVE_POINTS`` equal steps of the episode's time, for the mean over all seeds, and
- ``timeline``, of one seed a policy: the seconds of every decision in each phase, for the Gantt chart.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

CURVE_POINTS = 33
"""Points of a cumulative curve, from the start of an episode to its end."""


class TimelineRecorder:
    """Collects the infos of one episode's steps."""

    def __init__(self) -> None:
        """Begin at the reset, before any step."""
        self._phases: tuple[str, ...] = ()
        self._seconds: list[list[float]] = []
        self._ends_s: list[float] = []
        self._counts: list[tuple[float, float, float]] = []

    def add(self, info: Mapping[str, Any]) -> None:
        """Take the info of a step: its ``phases_s`` and the scorecard after it."""
        self._phases = tuple(info["phases_s"])
        self._seconds.append([float(value) for value in info["phases_s"].values()])
        scores = info["scorecard"]
        self._ends_s.append(float(scores["duration_s"]))
        self._counts.append((float(scores["net_rate"]), float(scores["done"]), float(scores["damaged"])))

    def curve(self) -> list[float]:
        """Net rate at ``CURVE_POINTS`` equal steps from 0 to the episode's ``duration_s``; empty without a step.

        Between two decisions the net rate is what it was after the earlier one.
        """
        if not self._ends_s:
            return []
        ends_s = np.array(self._ends_s)
        at_s = np.linspace(0.0, ends_s[-1], CURVE_POINTS)
        rates = np.array([0.0, *(counts[0] for counts in self._counts)])
        after = np.searchsorted(ends_s, at_s * (1.0 + 1e-12), side="right")
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
