"""What a bound says."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

METHODS = ("relaxation", "cp-sat")
REPORTS = ("drawn", "driven", "any")
"""What is known of a camera's reports and of the machine: see the package."""


@dataclass(frozen=True)
class Expectation:
    """What no policy can beat on average over instances: some may do better on one of them.

    Attributes:
        net_rate: what this instance adds to the mean of net rates.
        episode_return: the same for returns.
        method: what the luck was replaced by, in words.
        estimated: whether that rests on measured means, and is as sure as these are.
    """

    net_rate: float
    episode_return: float
    method: str
    estimated: bool


@dataclass(frozen=True)
class Found:
    """What schedules that know everything got from the task's own rules; the two figures may be of two schedules.

    Attributes:
        net_rate: largest net rate.
        episode_return: largest return.
    """

    net_rate: float
    episode_return: float


@dataclass(frozen=True)
class Bound:
    """What no policy can beat on one instance, its luck known; the three figures need not be reachable together.

    Attributes:
        net_rate: largest net rate.
        episode_return: largest sum of rewards.
        cycle_time_s: shortest cycle time of an episode that reaches ``net_rate``.
        method: what was relaxed, in words.
        proven: whether ``net_rate`` and ``episode_return`` are optima of the instance up to the solver's rounding, not
            only bounds.
        gap: relative gap between the best solution found and the bound, the larger of the two; NaN without a solver.
        wall_s: seconds that it took.
        expected: what nobody gets more than on average, who does not know the luck; None where that is not known.
        found: what can be had; None where no schedule was carried out.
    """

    net_rate: float
    episode_return: float
    cycle_time_s: float
    method: str
    proven: bool
    gap: float
    wall_s: float
    expected: Expectation | None = None
    found: Found | None = None


def state_of(core: Any) -> Any:
    """What holds the rules' state arrays: a part of the rules, or the rules themselves."""
    return getattr(core, "state", core)


def check_method(method: str) -> None:
    """Refuse an unknown method with a ValueError."""
    if method not in METHODS:
        raise ValueError(f"method = {method!r}: choose one of {', '.join(METHODS)}")


def check_start(reports: str, under_way: Any) -> None:
    """Refuse unknown reports, and an episode that is under way, with a ValueError."""
    if reports not in REPORTS:
        raise ValueError(f"reports = {reports!r}: choose one of {', '.join(REPORTS)}")
    if under_way:
        raise ValueError("the episode is under way: an instance is read right after a reset")


def relative_gap(bound: float, found: float) -> float:
    """How far a schedule that was found stays behind a bound; rounding is no gap."""
    gap = float(bound - found) / max(abs(bound), 1e-9)
    return gap if gap > 1e-9 else 0.0
