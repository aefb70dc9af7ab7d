"""What an order of policies means, in words: its criterion, what another one says, and its comparisons."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from ..envs.task import task
from ..kernels.config import Config
from .statistics import ROUNDING, Difference
from .suites import BOUND, Condition
from .summary import RIVALS, Row, comparisons


def by_return(rows: Sequence[Row]) -> list[Row]:
    """The policies by mean return, the largest first; those without one last."""
    return sorted((row for row in rows if row.policy != BOUND), key=lambda row: _falling(row, "return"))


def _falling(row: Row, name: str) -> float:
    value = row.scores[name].value if name in row.scores else math.nan
    return -round(value / ROUNDING) * ROUNDING if math.isfinite(value) else math.inf


def weights(where: Condition) -> str:
    """What the return weighs, as ``1 killed - 5 crop ...``; empty where the task does not say."""
    try:
        settings = where.settings
        config = task(where.env_id).assembly.configured(settings.get("scenario"), overrides=settings.get("overrides"))
    except (KeyError, TypeError, ValueError):
        return ""
    found, scenario = getattr(config, "weights", None), getattr(config, "scenario", None)
    if not isinstance(found, Config):
        return ""
    values = {name: value for name, value in vars(found).items() if isinstance(value, float) and value != 0.0}
    # What a scenario may leave out of the count has a flag of this name.
    counted = [(name, value) for name, value in values.items() if getattr(scenario, f"{name}_count", True)]
    text = " ".join(f"{'-' if value < 0.0 else '+'} {abs(value):g} {name}" for name, value in counted)
    return text.removeprefix("+ ")


def told(rows: Sequence[Row]) -> list[str]:
    """Sentences on the table of one condition: how it is ordered, who its best are, what its comparisons are worth."""
    policies = [row for row in rows if row.policy != BOUND]
    if not policies:
        return []
    return [*_criterion(policies), *_rivals(policies), *_multiplicity(policies)]


def _criterion(rows: Sequence[Row]) -> list[str]:
    """By what policies are ordered, and where another criterion orders them otherwise."""
    weighed, best = weights(rows[0].condition), [row for row in by_return(rows) if row.front]
    lines = [f"Return = {weighed}." if weighed else "The return is the task's own sum of its rewards."]
    ranked = by_return(rows)
    if best:
        names = ", ".join(row.policy for row in best)
        lines.append(f"On the front of net rate and cycle time, whatever a second is worth: {names}.")
    other = sorted(ranked, key=lambda row: _falling(row, "net_rate"))
    if [row.policy for row in other] == [row.policy for row in ranked]:
        lines.append("By net rate the order is the same as by return.")
    else:
        shown = ", ".join(f"{row.policy} {100.0 * row.scores['net_rate'].value:.2f}" for row in other)
        lines.append(f"By net rate the order is another than by return: {shown} %.")
    return lines


def _rivals(rows: Sequence[Row]) -> list[str]:
    """Who the best of every kind are."""
    rivals = rows[0].rivals
    named = [f"best {kind}: {rivals[kind]}" for kind in RIVALS if kind in rivals]
    return [f"By mean return on these fields, {'; '.join(named)}."] if named else []


def _multiplicity(rows: Sequence[Row]) -> list[str]:
    """What the comparisons of one condition are worth."""
    return multiplicity(comparisons(rows).values())


def multiplicity(differences: Iterable[Difference]) -> list[str]:
    """How many of a table's differences leave out 0, one by one and all together; nothing where there are none."""
    found = list(differences)
    alone, together = (sum(getattr(item, name) for item in found) for name in ("significant", "stands"))
    if not found:
        return []
    return [
        f"Of {len(found)} comparisons {alone} leave out 0 in their intervals, {together} after Holm's correction"
        + (" for all; the others are marked Holm." if together < alone else " for all.")
    ]
