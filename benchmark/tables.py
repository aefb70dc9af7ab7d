"""From episodes to tables: a row a policy and condition, on the terminal and as CSV, Markdown and JSON."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .episode import Record
from .statistics import FEWEST_PAIRS, Difference, Estimate, interquartile_mean, mean, paired_difference
from .store import condition, write_atomically
from .suites import Case, Condition

if TYPE_CHECKING:
    from rich.table import Table

COMPARED = ("net_rate", "cycle_time_s")
"""Scores whose paired difference to the reference policy is shown."""


@dataclass(frozen=True)
class Row:
    """One policy under one condition.

    Attributes:
        condition: what held.
        policy: its name.
        reference: the policy of the differences.
        episodes: how many finished.
        scores: mean of every scorecard entry, of ``return`` and of ``decision_ms``, with intervals.
        net_rate_iqm: interquartile mean of the net rate.
        differences: of ``COMPARED`` to the reference on the same seeds; empty for the reference and without it.
    """

    condition: Condition
    policy: str
    reference: str
    episodes: int
    scores: Mapping[str, Estimate]
    net_rate_iqm: Estimate
    differences: Mapping[str, Difference]


def summarise(records: Iterable[Record], cases: Sequence[Case]) -> list[Row]:
    """Rows for all ``records`` without an error, in the order of ``cases``; policies beyond them follow by name."""
    groups: dict[Condition, dict[str, dict[int, dict[str, float]]]] = {}
    for record in records:
        if "error" not in record:
            policies = groups.setdefault(condition(record), {})
            policies.setdefault(record["policy"], {})[record["seed"]] = _values(record)
    order = {case.condition: case for case in cases}
    references = {case.condition.env_id: case.reference for case in cases}
    rows = []
    for group in sorted(groups, key=lambda item: (_place(item, list(order)), str(item))):
        wanted = list(order[group].policies) if group in order else []
        reference = references.get(group.env_id, "")
        for policy in sorted(groups[group], key=lambda name: (_place(name, wanted), name)):
            rows.append(_row(group, policy, reference, groups[group]))
    return rows


def _place(item: Any, order: Sequence[Any]) -> int:
    return order.index(item) if item in order else len(order)


def _values(record: Record) -> dict[str, float]:
    """All numbers of an episode under one name each; None becomes NaN."""
    values = {name: np.nan if value is None else float(value) for name, value in record["scorecard"].items()}
    if values.get("done") == 0.0:
        values["cycle_time_s"] = np.nan  # without a finished target there is no cycle
    values["return"] = np.nan if record["return"] is None else float(record["return"])
    done = values.get("done", np.nan)
    for name in [name for name in values if name.startswith("phase_")]:
        values[name.removesuffix("_s") + "_s_each"] = values[name] / done if done > 0.0 else np.nan
    values["decision_ms"] = 1000.0 * record["decision_s"] / max(record["steps"], 1)
    values["wall_s"] = float(record["wall_s"])
    return values


def _row(group: Condition, policy: str, reference: str, policies: dict[str, dict[int, dict[str, float]]]) -> Row:
    own, other = policies[policy], policies.get(reference, {})
    names = list(dict.fromkeys(name for values in own.values() for name in values))
    shared = sorted(own.keys() & other.keys()) if policy != reference else []
    differences = {
        name: paired_difference(
            [own[seed].get(name, np.nan) for seed in shared], [other[seed].get(name, np.nan) for seed in shared]
        )
        for name in COMPARED
        if shared
    }
    columns = {name: [values.get(name, np.nan) for values in own.values()] for name in names}
    return Row(
        condition=group,
        policy=policy,
        reference=reference,
        episodes=len(own),
        scores={name: mean(column) for name, column in columns.items()},
        net_rate_iqm=interquartile_mean(columns.get("net_rate", [])),
        differences=differences,
    )


@dataclass(frozen=True)
class Column:
    """How a score is shown: ``scale`` times its value with ``digits`` decimals.

    Attributes:
        title: heading.
        name: the score.
        scale: factor from the score's unit to the shown one.
        digits: decimals.
        difference: show the paired difference to the reference instead of the score.
        wide: leave the column out on a narrow terminal.
    """

    title: str
    name: str
    scale: float
    digits: int
    difference: bool = False
    wide: bool = False

    def cell(self, row: Row) -> tuple[str, str]:
        """The value and its interval as text; the interval of a difference that may be none says so."""
        estimate = (row.differences if self.difference else row.scores).get(self.name)
        if estimate is None or not math.isfinite(estimate.value):
            return "-", ""
        value = self._text(estimate.value, "+" if self.difference else "")
        if not math.isfinite(estimate.low):
            return value, ""
        interval = f"{self._text(estimate.low)} .. {self._text(estimate.high)}"
        doubt = ""
        if isinstance(estimate, Difference) and not estimate.significant:
            doubt = " few" if estimate.n < FEWEST_PAIRS else " n.s."
        return value, interval + doubt

    def _text(self, value: float, sign: str = "") -> str:
        rounded = round(self.scale * value, self.digits) + 0.0  # adding zero turns -0.0 into 0.0
        return f"{rounded:{sign}.{self.digits}f}"


COLUMNS = (
    Column("net rate, %", "net_rate", 100.0, 2),
    Column("cycle time, s", "cycle_time_s", 1.0, 2),
    Column("difference, points", "net_rate", 100.0, 2, difference=True),
    Column("difference, s", "cycle_time_s", 1.0, 2, difference=True),
    Column("return", "return", 1.0, 3, wide=True),
    Column("ms a decision", "decision_ms", 1.0, 2, wide=True),
)
WIDE = 110
"""Characters from which a terminal shows all columns."""

LEGEND = (
    "Means over episodes with 95 % bootstrap intervals. Differences are to the policy in bold, paired by seed; "
    f"n.s.: the interval holds 0; few: under {FEWEST_PAIRS} pairs, too few to tell."
)


def conditions(rows: Iterable[Row]) -> dict[Condition, list[Row]]:
    """Rows by condition, in order."""
    groups: dict[Condition, list[Row]] = {}
    for row in rows:
        groups.setdefault(row.condition, []).append(row)
    return groups


def terminal_tables(rows: Iterable[Row], width: int) -> list[Table]:
    """A Rich table a condition, for ``width`` characters; each interval stands under its value."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    columns = [column for column in COLUMNS if width >= WIDE or not column.wide]
    tables = []
    for group, members in conditions(rows).items():
        table = Table(title=f"{group} ({_episodes(members)})", title_justify="left", box=box.SIMPLE_HEAD)
        table.add_column("policy", no_wrap=True)
        for column in columns:
            table.add_column(column.title, justify="right")
        for row in members:
            cells = [column.cell(row) for column in columns]
            texts = [Text.assemble(value, ("\n" + interval if interval else "", "dim")) for value, interval in cells]
            table.add_row(Text(row.policy, "bold" if row.policy == row.reference else ""), *texts)
        tables.append(table)
    return tables


def _episodes(rows: Sequence[Row]) -> str:
    counts = sorted({row.episodes for row in rows})
    return f"{counts[0]} episodes" if len(counts) == 1 else f"{counts[0]} to {counts[-1]} episodes"


def markdown(rows: Iterable[Row]) -> str:
    """The same tables as Markdown."""
    parts = []
    for group, members in conditions(rows).items():
        lines = [
            f"## {group}",
            "",
            "| policy | episodes | " + " | ".join(column.title for column in COLUMNS) + " |",
            "|---" * (len(COLUMNS) + 2) + "|",
        ]
        for row in members:
            texts = [column.cell(row) for column in COLUMNS]
            cells = [f"{value} ({interval})" if interval else value for value, interval in texts]
            name = f"**{row.policy}**" if row.policy == row.reference else row.policy
            lines.append(f"| {name} | {row.episodes} | " + " | ".join(cells) + " |")
        parts.append("\n".join([*lines, "", LEGEND, "", *_phases(members), ""]))
    return "\n".join(parts)


def _phases(rows: Sequence[Row]) -> list[str]:
    """Markdown lines: where the seconds of a finished target go."""
    names = [name for name in rows[0].scores if name.startswith("phase_") and name.endswith("_s_each")]
    if not names:
        return []
    titles = [name.removeprefix("phase_").removesuffix("_s_each").replace("_", " ") for name in names]
    lines = ["| seconds a finished target | " + " | ".join(titles) + " |", "|---" * (len(names) + 1) + "|"]
    for row in rows:
        values = [row.scores[name].value if name in row.scores else math.nan for name in names]
        lines.append(f"| {row.policy} | " + " | ".join(f"{v:.2f}" if math.isfinite(v) else "-" for v in values) + " |")
    return lines


def comma_separated(rows: Iterable[Row]) -> str:
    """One line a condition, policy and score; paired differences are the scores called ``<score>_minus_reference``."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\n")
    writer.writerow(
        ["env_id", "scenario", "backend", "perception", "policy", "reference", "score", "value", "low", "high", "n"]
    )
    for row in rows:
        named = [*row.scores.items(), ("net_rate_iqm", row.net_rate_iqm)]
        named += [(f"{name}_minus_reference", difference) for name, difference in row.differences.items()]
        group = row.condition
        whose = (group.env_id, group.scenario, group.backend, group.perception, row.policy, row.reference)
        for name, estimate in named:
            writer.writerow([*whose, name, estimate.value, estimate.low, estimate.high, estimate.n])
    return buffer.getvalue()


def as_json(rows: Iterable[Row]) -> str:
    """Everything in the rows, NaN as null."""
    return json.dumps([_plain({**asdict(row), "differences": _flagged(row)}) for row in rows], indent=2) + "\n"


def _flagged(row: Row) -> dict[str, Any]:
    return {name: {**asdict(item), "significant": item.significant} for name, item in row.differences.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {name: _plain(item) for name, item in value.items()}
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value


def write(rows: Sequence[Row], folder: Path) -> list[Path]:
    """Write ``summary.csv``, ``summary.md`` and ``summary.json`` into ``folder`` and return their paths."""
    texts = {"summary.csv": comma_separated(rows), "summary.md": markdown(rows), "summary.json": as_json(rows)}
    for name, text in texts.items():
        write_atomically(folder / name, text)
    return [folder / name for name in texts]
