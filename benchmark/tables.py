"""Rows as tables: on the terminal and as Markdown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from ..kernels.files import replace_file
from . import ranking, rates
from .exports import as_json, comma_separated
from .statistics import FEWEST_PAIRS, Difference, Estimate
from .suites import BOUND, Condition
from .summary import HELD, REFERENCE, RIVALS, Row, summarise
from .thinking import CHARGED

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["Row", "summarise", "write"]


@dataclass(frozen=True)
class Column:
    """How a score is shown: ``scale`` times its value with ``digits`` decimals.

    Attributes:
        title: heading.
        name: the score.
        scale: factor from the score's unit to the shown one.
        digits: decimals.
        kind: ``"mean"``, ``"iqm"`` (interquartile mean), ``"gap"`` (paired, to the bounds), one of ``DIFFERENCES``
            (paired, to the reference, the best rule, the best planner), or ``"wins"`` (share of the fields on which the
            return is larger; its ``name`` says than whose), or ``"front"`` (whether it is on the Pareto front).
    """

    title: str
    name: str
    scale: float
    digits: int
    kind: str = "mean"

    def cell(self, row: Row) -> tuple[str, str]:
        """The value and its interval as text; the interval of a difference that may be none says so."""
        if self.kind == "front":
            return ("yes" if row.front else "-"), ""
        parts: Mapping[str, Mapping[str, Estimate]] = {
            "mean": row.scores,
            "iqm": row.iqm,
            "gap": row.gaps,
            "wins": row.wins,
            "difference": row.differences,
            **row.over,
        }
        estimate = parts.get(self.kind, {}).get(self.name)
        if estimate is None or not math.isfinite(estimate.value):
            return "-", ""
        value = self.text(estimate.value, "+" if self.kind in DIFFERENCES else "")
        if not math.isfinite(estimate.low):
            return value, ""
        mark = doubt(estimate) if self.kind in DIFFERENCES else ""
        return value, f"{self.text(estimate.low)} .. {self.text(estimate.high)} {mark}".rstrip()

    def text(self, value: float, sign: str = "") -> str:
        """A value as it is shown, with a format's ``sign``."""
        rounded = round(self.scale * value, self.digits) + 0.0  # adding zero turns -0.0 into 0.0
        return f"{rounded:{sign}.{self.digits}f}"


DIFFERENCES = ("difference", *RIVALS)
"""Kinds of columns of paired differences between policies."""
MARKS = FEW, NONE, AMONG_MANY = "few", "n.s.", "Holm"
"""What marks a difference that may be none: too few pairs, an interval that holds 0, one that leaves it out as one
of so many may by chance."""


def doubt(item: Estimate) -> str:
    """What marks a difference that may be none; empty for any other."""
    if not isinstance(item, Difference) or item.stands:
        return ""
    if item.significant:
        return AMONG_MANY
    return FEW if item.n < FEWEST_PAIRS else NONE


COLUMNS = (
    Column("net rate, %", "net_rate", 100.0, 2),
    Column("cycle time, s", "cycle_time_s", 1.0, 2),
    Column("difference, points", "net_rate", 100.0, 2, "difference"),
    Column("difference, s", "cycle_time_s", 1.0, 2, "difference"),
    Column("return", "return", 1.0, 3),
    Column("gap to bound, points", "net_rate", 100.0, 2, "gap"),
    Column("to clairvoyant, points", "clairvoyant_net_rate", 100.0, 2, "gap"),
    Column("front", "front", 1.0, 0, "front"),
    Column("ms a decision", "decision_ms", 1.0, 2),
)

_SCORES = (
    ("net rate, %", "net_rate", 100.0, 2),
    ("cycle time, s", "cycle_time_s", 1.0, 2),
    ("per minute", "throughput_per_min", 1.0, 2),
    ("damaged", "damaged", 1.0, 2),
    ("return", "return", 1.0, 3),
)
_HELD = tuple(score for score in _SCORES if score[1] in HELD)


def field_columns(rows: Sequence[Row]) -> tuple[Column, ...]:
    """What a grower reads of rows under one condition, in the units of its task; none where nothing can be told."""
    where = rows[0].condition
    unit, kills = rates.unit_of(where), rates.rates_of(where).loss_percent != ""
    columns = (
        Column("net rate, %", "net_rate", 100.0, 2),
        Column(f"{unit}/h", rates.WORK, 1.0, 4 if unit == rates.HECTARES else 1),
        Column("demand met, %", rates.MET, 100.0, 1),
        Column(f"{unit}/h where met", rates.ACCEPTED, 1.0, 4),
        Column("kills/s", rates.EACH_S, 1.0, 2) if kills else Column("done/s", rates.EACH_S, 1.0, 3),
        Column("J a kill", rates.EACH_J, 1.0, 0) if kills else Column("J each", rates.EACH_J, 1.0, 1),
        Column("kWh/ha", rates.AREA_KWH, 1.0, 1),
        Column("crop loss, %", rates.LOSS, 1.0, 2),
    )
    told = tuple(column for column in columns if any(column.cell(row)[0] != "-" for row in rows))
    return told if any(column.name == rates.WORK for column in told) else ()


MARKDOWN: tuple[tuple[str, tuple[Column, ...]], ...] = (
    (
        "Mean",
        (
            *(Column(*score) for score in _SCORES),
            Column("front", "front", 1.0, 0, "front"),
            Column("ms a decision", "decision_ms", 1.0, 2),
            Column("ms, 95th percentile", "decision_p95_ms", 1.0, 2),
        ),
    ),
    ("Difference to the policy in bold", tuple(Column(*score, "difference") for score in _SCORES)),
    *((f"Difference to the best {kind}", tuple(Column(*score, kind) for score in _HELD)) for kind in RIVALS),
    (
        "Larger return on, % of the fields",
        (
            Column("than the policy in bold", REFERENCE, 100.0, 1, "wins"),
            *(Column(f"than the best {kind}", kind, 100.0, 1, "wins") for kind in RIVALS),
        ),
    ),
    ("Interquartile mean", tuple(Column(*score, "iqm") for score in _SCORES)),
    (
        "Gap to the bound",
        (
            Column("net rate, points", "net_rate", 100.0, 2, "gap"),
            Column("return", "return", 1.0, 3, "gap"),
            Column("to clairvoyant: net rate, points", "clairvoyant_net_rate", 100.0, 2, "gap"),
            Column("to clairvoyant: return", "clairvoyant_return", 1.0, 3, "gap"),
            Column("cycle time at its own net rate, s", "cycle_time_s", 1.0, 2, "gap"),
        ),
    ),
)

LEGEND = (
    "Means over episodes with 95 % bootstrap intervals. Differences are to the policy in bold, paired by seed; "
    f"n.s.: the interval holds 0; few: under {FEWEST_PAIRS} pairs, too few to tell; Holm: the interval leaves out 0, "
    "but as one of so many that may be chance. Front: no other policy has both as high a net rate and as short a "
    "cycle, one of them better. "
    "Energy is the tool's and the positive mechanical work of the motors that move it, estimated; no losses, no "
    "driving. "
    f"The row {BOUND}: what no policy can beat on average, its figures need not be reachable together. Clairvoyant: "
    "what nobody can beat on any field who knows all of its luck."
)


def escaped(text: str) -> str:
    """Text as Markdown shows it, in a table too: names come from whoever wrote the policy or the scenario."""
    text = " ".join(text.split())
    text = text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    return "".join(f"\\{letter}" if letter in "\\`|*[]" else letter for letter in text)


def conditions(rows: Iterable[Row]) -> dict[Condition, list[Row]]:
    """Rows by condition, in order."""
    groups: dict[Condition, list[Row]] = {}
    for row in rows:
        groups.setdefault(row.condition, []).append(row)
    return groups


def terminal_tables(rows: Iterable[Row], width: int) -> list[Table]:
    """Two Rich tables a condition: scores, and what they come to in a grower's units.

    What does not fit ``width`` characters is left out from the right; ``summary.md`` has it.
    """
    from rich.text import Text

    rows = list(rows)
    bounded = any(row.gaps for row in rows)
    columns = [column for column in COLUMNS if bounded or column.kind != "gap"]
    tables = []
    for group, members in conditions(rows).items():
        scores = _fitting(_title(group, members), columns, members, width)
        policies = [row for row in members if row.policy != BOUND]
        scores.caption, scores.caption_justify = Text("\n".join(ranking.told(policies))), "left"
        tables.append(scores)
        told = field_columns(policies) if policies else ()
        if told:
            # The net rate stands in the table above.
            others = [column for column in told if column.name != "net_rate"]
            tables.append(_fitting("In the field", others, policies, width))
    return tables


def _fitting(title: str, columns: Sequence[Column], rows: Sequence[Row], width: int) -> Table:
    """A table with as many of the columns as ``width`` characters hold, one at least."""
    count = len(columns)
    while count > 1 and _wide(_terminal_table("", columns[:count], rows)) > width:
        count -= 1
    return _terminal_table(title, columns[:count], rows)


def _wide(table: Table) -> int:
    """Characters that a table takes where it may."""
    from rich.console import Console
    from rich.measure import Measurement

    console = Console(width=_NATURAL)
    return Measurement.get(console, console.options, table).maximum


def _terminal_table(title: str, columns: Sequence[Column], rows: Sequence[Row]) -> Table:
    """A Rich table; each interval stands under its value."""
    from rich import box
    from rich.table import Table
    from rich.text import Text

    table = Table(title=title, title_justify="left", box=box.SIMPLE_HEAD)
    table.add_column("policy", no_wrap=True)
    for column in columns:
        table.add_column(column.title, justify="right")
    for row in rows:
        cells = [column.cell(row) for column in columns]
        texts = [Text.assemble(value, ("\n" + interval if interval else "", "dim")) for value, interval in cells]
        table.add_row(Text(row.policy, "bold" if row.policy == row.reference else ""), *texts)
    return table


def _title(group: Condition, rows: Sequence[Row]) -> str:
    charged = f"; {CHARGED}" if any(row.charged for row in rows) else ""
    return f"{group} ({_episodes([row for row in rows if row.policy != BOUND])}{charged})"


def _episodes(rows: Sequence[Row]) -> str:
    counts = sorted({row.episodes for row in rows})
    return f"{counts[0]} episodes" if len(counts) == 1 else f"{counts[0]} to {counts[-1]} episodes"


def markdown(rows: Iterable[Row]) -> str:
    """The same figures as Markdown, and those that a terminal has no room for."""
    rows = list(rows)
    parts = []
    for group, members in conditions(rows).items():
        lines = [f"## {escaped(_title(group, members))}", ""]
        for title, columns in (*MARKDOWN, ("In the field", field_columns(members))):
            shown = [row for row in members if any(column.cell(row)[0] != "-" for column in columns)]
            if shown:
                lines += [*_grid(title, columns, shown), ""]
        policies = [row for row in members if row.policy != BOUND]
        notes = [f"- {escaped(line)}" for line in ranking.told(policies)]
        parts.append("\n".join([*lines, *notes, "", LEGEND, "", *_phases(policies), ""]))
    return "\n".join(["\n".join(["## In short", "", *(f"- {escaped(line)}" for line in verdicts(rows)), ""]), *parts])


def _grid(title: str, columns: Sequence[Column], rows: Sequence[Row]) -> list[str]:
    """Lines of one Markdown table."""
    lines = [
        f"| {title} | episodes | " + " | ".join(column.title for column in columns) + " |",
        "|---" * (len(columns) + 2) + "|",
    ]
    for row in rows:
        texts = [column.cell(row) for column in columns]
        cells = [f"{value} ({interval})" if interval else value for value, interval in texts]
        name = escaped(row.policy)
        name = f"**{name}**" if row.policy == row.reference else name
        lines.append(f"| {name} | {row.episodes} | " + " | ".join(cells) + " |")
    return lines


def verdicts(rows: Iterable[Row]) -> list[str]:
    """A line a condition: the best policy beside the reference and the bound; and one where learning brought more."""
    lines = []
    for group, members in conditions(rows).items():
        policies = [row for row in members if row.policy != BOUND]
        there = [row for row in policies if _NET_RATE.cell(row)[0] != "-"]
        if not there:
            continue
        best = max(there, key=lambda row: row.scores["net_rate"].value)
        told = f"{group}: {best.policy} has the best net rate, {_NET_RATE.cell(best)[0]} %"
        gap = best.gaps.get("net_rate")
        if gap is not None and math.isfinite(gap.value):
            told += f", {_interval(_NET_RATE, gap)} points below the bound"
        paper = next((row for row in there if row.policy == row.reference), best)
        if paper is not best:
            told += f"; {paper.policy} {_NET_RATE.cell(paper)[0]} %"
        lines.append(told)
        for row in policies:
            if row.least_over_rules is not None and row.least_over_rules[2]:
                rule, by, _ = row.least_over_rules
                more = f"by {_interval(_RETURN, by)} at least, over {rule}"
                lines.append(f"{group}: {row.policy} returns more than every rule, {more}")
    return lines


_NATURAL = 1000
"""Characters in which every table has the width that it would like."""
_NET_RATE, _RETURN = Column("net rate", "net_rate", 100.0, 2), Column("return", "return", 1.0, 3)


def _interval(column: Column, estimate: Estimate) -> str:
    low, high = column.text(estimate.low), column.text(estimate.high)
    return column.text(estimate.value) + (f" [{low}, {high}]" if math.isfinite(estimate.low) else "")


def _phases(rows: Sequence[Row]) -> list[str]:
    """Markdown lines: where the seconds of a finished target go."""
    names = [name for name in rows[0].scores if name.startswith("phase_") and name.endswith("_s_each")]
    if not names:
        return []
    titles = [name.removeprefix("phase_").removesuffix("_s_each").replace("_", " ") for name in names]
    lines = ["| seconds a finished target | " + " | ".join(titles) + " |", "|---" * (len(names) + 1) + "|"]
    for row in rows:
        values = [row.scores[name].value if name in row.scores else math.nan for name in names]
        lines.append(
            f"| {escaped(row.policy)} | " + " | ".join(f"{v:.2f}" if math.isfinite(v) else "-" for v in values) + " |"
        )
    return lines


def write(rows: Sequence[Row], folder: Path, name: str = "summary") -> list[Path]:
    """Write ``summary.csv``, ``summary.md`` and ``summary.json`` into ``folder`` and return their paths."""
    texts = {"csv": comma_separated(rows), "md": markdown(rows), "json": as_json(rows)}
    paths = [folder / f"{name}.{suffix}" for suffix in texts]
    for path, text in zip(paths, texts.values(), strict=True):
        replace_file(path, text)
    return paths
