"""The bound beside the results: computed once a condition and seed, and no result may beat it."""

from __future__ import annotations

import math
import statistics
import time
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from .record import Record, condition, field_of, plain_number
from .suites import Condition, Episode

CURVE_SHARES = (0.0, 0.2, 0.4, 0.5, 0.6, 0.7, 0.8, 0.85, 0.9, 0.95, 1.0)
"""Shares of the largest net rate at which the shortest cycle time is bounded too."""

TOLERANCE = 1e-9
"""Rounding, of one and relative: a bound is reached by the best policy, and sums differ in their last digits."""
SURE, FEWEST_FIELDS = 3.0, 10
"""Standard errors by which a mean has to beat what is bounded on average to be no chance, and fields that say so."""


def bound(episode: Episode) -> Record:
    """The bound of an episode's instance.

    Returns:
        ``bound``: ``net_rate``, ``episode_return``, ``cycle_time_s`` (at that net rate), ``method``, ``proven`` and
        ``gap`` (of the solver, None without one), as ``bounds.Bound`` has them, and ``curve``, pairs of a net
        rate and the seconds below which no cycle time with at least that net rate can fall, by rising net rate; where
        it is known also ``expected`` with ``net_rate``, ``episode_return``, ``method`` and ``estimated``, as
        ``bounds.Expectation`` has them, and ``found`` with ``net_rate`` and ``episode_return``, as ``bounds.Found`` has
        them; ``wall_s``.
    """
    from ..bounds import instance

    started = time.perf_counter()
    where = episode.condition
    file = None if episode.field is None else episode.field.path
    drawn = instance(where.env_id, episode.seed, backend=where.backend, field=file, **where.settings)
    found = drawn.bound()
    curve = []
    for share in CURVE_SHARES:
        # A hair below, so that rounding does not ask for more than there is.
        net_rate = share * found.net_rate * (1.0 - 1e-9)
        cycle_time_s = plain_number(drawn.cycle_time_at(net_rate))
        if cycle_time_s is not None:
            curve.append([net_rate, cycle_time_s])
    result = {
        "net_rate": plain_number(found.net_rate),
        "episode_return": plain_number(found.episode_return),
        "cycle_time_s": plain_number(found.cycle_time_s),
        "method": found.method,
        "proven": bool(found.proven),
        "gap": plain_number(found.gap),
        "curve": curve,
    }
    if found.expected is not None:
        result["expected"] = {
            "net_rate": plain_number(found.expected.net_rate),
            "episode_return": plain_number(found.expected.episode_return),
            "method": found.expected.method,
            "estimated": found.expected.estimated,
        }
    if found.found is not None:
        result["found"] = {
            "net_rate": plain_number(found.found.net_rate),
            "episode_return": plain_number(found.found.episode_return),
        }
    return {"bound": result, "wall_s": time.perf_counter() - started}


@dataclass(frozen=True)
class Limit:
    """What no policy can beat on one instance; None where nothing is known.

    Attributes:
        net_rate: largest net rate.
        episode_return: largest return.
        curve: (net rate, shortest cycle time in seconds), by rising net rate.
        expected_net_rate: what the instance adds to the mean of net rates that no policy can beat who does not know the
            luck; where that is not known, ``net_rate``.
        expected_return: the same of returns.
    """

    net_rate: float | None
    episode_return: float | None
    curve: tuple[tuple[float, float], ...]
    expected_net_rate: float | None
    expected_return: float | None

    def cycle_time_s(self, net_rate: float) -> float:
        """Seconds below which the cycle time cannot fall with this net rate; 0 where nothing is known."""
        return max((cycle_s for rate, cycle_s in self.curve if rate <= net_rate), default=0.0)


def limits(bounds: Iterable[Record]) -> dict[tuple[Condition, int | str], Limit]:
    """The bounds' records by condition and field; failed ones are left out."""
    found = {}
    for record in bounds:
        if "error" not in record:
            values = record["bound"]
            curve = tuple((float(rate), float(cycle_s)) for rate, cycle_s in values["curve"])
            hope = values.get("expected") or values
            found[condition(record), field_of(record)] = Limit(
                values["net_rate"], values["episode_return"], curve, hope["net_rate"], hope["episode_return"]
            )
    return found


def violations(records: Iterable[Record], bounds: Iterable[Record]) -> list[str]:
    """Every result that is better than possible, in words; must be empty, or rules or bound are wrong.

    Compared are net rate, return and, where a target was finished, the cycle time at the episode's own net rate; and a
    policy's mean net rate and return with what nobody gets more than on average.
    """
    known, told = limits(bounds), []
    over: dict[tuple[Condition, str, str], list[float]] = {}
    for record in records:
        limit = known.get((condition(record), field_of(record))) if "error" not in record else None
        if limit is None:
            continue
        for what, value, most in _compared(record, limit):
            if value > most + TOLERANCE * (1.0 + abs(most)):
                field = record.get("field", f"seed {record['seed']}")
                told.append(
                    f"{condition(record)}: {record['policy']}, {field}: {what} {value:.9g} beats its bound {most:.9g}"
                )
        for what, value, most in _hoped(record, limit):
            over.setdefault((condition(record), record["policy"], what), []).append(value - most)
    for (where, policy, what), values in over.items():
        mean, count = statistics.fmean(values), len(values)
        spread = statistics.stdev(values) / math.sqrt(count) if count >= FEWEST_FIELDS else math.inf
        if mean > SURE * spread + TOLERANCE:
            told.append(
                f"{where}: {policy}, {count} fields: {what} beats what nobody gets more than on average by {mean:.4g}, "
                f"standard error {spread:.2g}"
            )
    return told


def _hoped(record: Record, limit: Limit) -> Iterable[tuple[str, float, float]]:
    """Name, value and bound of what is bounded on average."""
    rate = record["scorecard"].get("net_rate")
    if limit.expected_net_rate is not None and rate is not None:
        yield "net rate", rate, limit.expected_net_rate
    if limit.expected_return is not None and record["return"] is not None:
        yield "return", record["return"], limit.expected_return


def _compared(record: Record, limit: Limit) -> Iterable[tuple[str, float, float]]:
    """Name, value and largest value of what is bounded; a cycle time counts as negative."""
    card: Mapping[str, Any] = record["scorecard"]
    if limit.net_rate is not None and card.get("net_rate") is not None:
        yield "net rate", card["net_rate"], limit.net_rate
    if limit.episode_return is not None and record["return"] is not None:
        yield "return", record["return"], limit.episode_return
    cycle_s, rate, done = card.get("cycle_time_s"), card.get("net_rate"), card.get("done", 1.0)
    if cycle_s is not None and rate is not None and done is not None and done > 0.0 and not math.isnan(cycle_s):
        yield "cycle time, negative,", -cycle_s, -limit.cycle_time_s(rate)
