"""Rows for programs: as CSV and as JSON."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict
from typing import Any

from .statistics import Difference
from .summary import Row

CSV_COLUMNS = (
    *("env_id", "scenario", "backend", "perception", "policy", "reference"),
    *("score", "value", "low", "high", "n", "charged", "changes", "fields"),
)


def comma_separated(rows: Iterable[Row]) -> str:
    """One line a condition, policy and score.

    Interquartile means are the scores called ``<score>_iqm``, paired differences ``<score>_minus_reference``, gaps to
    the bound ``<score>_gap``, a learned policy's differences to rules ``return_minus_<rule>``, those to the best rule
    and the best planner ``<score>_minus_best_rule`` and ``<score>_minus_best_planner``, shares of the fields with a
    larger return ``wins_over_reference`` and so on. ``charged`` is 1 where thinking was charged to the clocks.
    """
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(CSV_COLUMNS)
    for row in rows:
        named = [*row.scores.items(), *((f"{name}_iqm", item) for name, item in row.iqm.items())]
        named += [(f"{name}_minus_reference", item) for name, item in row.differences.items()]
        named += [(f"{name}_gap", item) for name, item in row.gaps.items()]
        named += [(f"return_minus_{name}", item) for name, item in row.over_rules.items()]
        named += [(f"{name}_minus_best_{kind}", item) for kind, of in row.over.items() for name, item in of.items()]
        named += [(f"wins_over_{name}", item) for name, item in row.wins.items()]
        group = row.condition
        whose = (group.env_id, group.scenario, group.backend, group.perception, row.policy, row.reference)
        for name, estimate in named:
            numbers = (estimate.value, estimate.low, estimate.high, estimate.n, int(row.charged))
            writer.writerow([*whose, name, *numbers, group.changes, group.fields])
    return buffer.getvalue()


def as_json(rows: Iterable[Row]) -> str:
    """Everything in the rows, NaN as null."""
    flagged = ("differences", "gaps", "over_rules")
    plain = [
        _plain(
            {
                **asdict(row),
                **{name: _flagged(getattr(row, name)) for name in flagged},
                "over": {kind: _flagged(of) for kind, of in row.over.items()},
            }
        )
        for row in rows
    ]
    return json.dumps(plain, indent=2) + "\n"


def _flagged(items: Mapping[str, Difference]) -> dict[str, Any]:
    return {
        name: {**asdict(item), "significant": item.significant, "stands": item.stands} for name, item in items.items()
    }


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
