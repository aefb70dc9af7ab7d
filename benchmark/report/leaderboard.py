"""The benchmark as Markdown, short enough to lie in the documentation."""

from __future__ import annotations

from collections.abc import Sequence

from ..summary import Row
from ..tables import LEGEND, Column, escaped
from . import sections
from .page import stamp
from .reader import Chapter, Study

COLUMNS = (
    Column("net rate, %", "net_rate", 100.0, 2),
    Column("difference, points", "net_rate", 100.0, 2, "difference"),
    Column("cycle time, s", "cycle_time_s", 1.0, 2),
    Column("difference, s", "cycle_time_s", 1.0, 2, "difference"),
    Column("done a minute", "throughput_per_min", 1.0, 2),
    Column("damaged", "damaged", 1.0, 2),
    Column("return", "return", 1.0, 3),
    Column("difference", "return", 1.0, 3, "difference"),
    Column("below bound, points", "net_rate", 100.0, 2, "gap"),
    Column("ms a decision", "decision_ms", 1.0, 2),
)


def render(study: Study, command: str) -> str:
    """The leaderboard.

    Args:
        study: what to show.
        command: how it was made.
    """
    said = [f"- {word}: {_code(text)}" for word, text in stamp(study, command)]
    parts = [
        "# Leaderboard",
        "",
        "Each task's headline tier, policies by mean return. " + LEGEND,
        "",
        *(line for item in study.chapters for line in _chapter(item)),
        "## Where it comes from",
        "",
        *said,
    ]
    return "\n".join(parts) + "\n"


def _code(text: str) -> str:
    text = " ".join(text.split())
    if text.startswith("fieldgym ") and " --" in text:
        return f"`` {text} ``" if "`" in text else f"`{text}`"
    return escaped(text)


def _chapter(item: Chapter) -> list[str]:
    tier = item.headline
    rows = sorted(tier.rows, key=lambda row: -_place(row))
    shown = [column for column in COLUMNS if any(column.cell(row)[0] != "-" for row in rows)]
    return [
        f"## {sections.name_of(item.task.id)}",
        "",
        f"`{item.task.id}`, {escaped(sections.words(tier.condition))}, {len(tier.seeds)} {tier.condition.instances}s.",
        "",
        "| | policy | " + " | ".join(column.title for column in shown) + " |",
        "|--:|---" + "|--:" * len(shown) + "|",
        *(_line(str(i), row, shown) for i, row in enumerate(rows, start=1)),
        *([] if tier.bound is None else [_line("", tier.bound, shown)]),
        "",
        *_transfer(item),
    ]


def _place(row: Row) -> float:
    value = row.scores["return"].value
    return value if value == value else float("-inf")


def _line(place: str, row: Row, columns: Sequence[Column]) -> str:
    texts = (column.cell(row) for column in columns)
    cells = [f"{value}<br>{interval}" if interval else value for value, interval in texts]
    name = escaped(row.policy)
    name = f"**{name}**" if row.policy == row.reference else name
    return f"| {place} | {name} | " + " | ".join(cells) + " |"


def _transfer(item: Chapter) -> list[str]:
    """PyBullet minus analytic, in one sentence: the largest difference of any policy."""
    if not item.transfer:
        return []
    points, seconds = (
        max(abs(move.differences[name].value) for move in item.transfer) for name in ("net_rate", "cycle_time_s")
    )
    pairs = max(move.differences["net_rate"].n for move in item.transfer)
    return [
        f"From the analytic backend to PyBullet, {pairs} shared seeds: no policy's mean moves by more than "
        f"{100.0 * points:.2f} points and {seconds:.3f} s.",
        "",
    ]
