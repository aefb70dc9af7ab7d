"""The benchmark as Markdown, short enough to lie in the documentation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from operator import attrgetter

from .. import ranking
from ..rates import ACCEPTED, rates_of
from ..summary import Row
from ..tables import LEGEND, Column, doubt, escaped, field_columns
from . import sections
from .grids import MOVED
from .page import stamp
from .reader import Chapter, Move, Study

COLUMNS = (
    Column("net rate, %", "net_rate", 100.0, 2),
    Column("difference, points", "net_rate", 100.0, 2, "difference"),
    Column("cycle time, s", "cycle_time_s", 1.0, 2),
    Column("difference, s", "cycle_time_s", 1.0, 2, "difference"),
    Column("done a minute", "throughput_per_min", 1.0, 2),
    Column("damaged", "damaged", 1.0, 2),
    Column("return", "return", 1.0, 3),
    Column("difference", "return", 1.0, 3, "difference"),
    Column("less best rule", "return", 1.0, 3, "rule"),
    Column("less best planner", "return", 1.0, 3, "planner"),
    Column("larger on, %", "reference", 100.0, 1, "wins"),
    Column("front", "front", 1.0, 0, "front"),
    Column("below bound, points", "net_rate", 100.0, 2, "gap"),
    Column("below clairvoyant, points", "clairvoyant_net_rate", 100.0, 2, "gap"),
    Column("ms a decision", "decision_ms", 1.0, 2),
)

_RETURN = Column("return", "return", 1.0, 3)


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
        "Each task's headline tier, policies by mean return. "
        + LEGEND
        + " Larger on: the share of the fields on which "
        "the return is larger than that of the policy in bold, ties counted half.",
        "",
        *(line for item in study.chapters for line in _chapter(item)),
        *_ordered(study.chapters),
        *_demands(study.chapters),
        *_cameras(study.chapters),
        *_sights(study.chapters),
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
    rows = ranking.by_return(tier.rows)
    shown = [column for column in COLUMNS if any(column.cell(row)[0] != "-" for row in rows)]
    told = field_columns(rows)
    return [
        f"## {sections.name_of(item.task.id)}",
        "",
        f"`{item.task.id}`, {escaped(sections.words(tier.condition))}, {len(tier.seeds)} {tier.condition.instances}s.",
        "",
        *_numbered(rows, shown),
        *([] if tier.bound is None else [_line("", tier.bound, shown)]),
        "",
        *_told(tier.rows),
        *(["In the field:", "", *_named(rows, told), ""] if told else []),
        *_driven(item),
    ]


def _told(rows: Sequence[Row]) -> list[str]:
    """Lines on what a table's order and its comparisons are worth."""
    return [*(f"- {escaped(line)}" for line in ranking.told(rows)), ""]


def _numbered(rows: Sequence[Row], columns: Sequence[Column]) -> list[str]:
    """Lines of a table of policies with their places."""
    return [
        "| | policy | " + " | ".join(column.title for column in columns) + " |",
        "|--:|---" + "|--:" * len(columns) + "|",
        *(_line(str(i), row, columns) for i, row in enumerate(rows, start=1)),
    ]


def _named(rows: Sequence[Row], columns: Sequence[Column]) -> list[str]:
    """Lines of a table of policies."""
    return [
        "| policy | " + " | ".join(column.title for column in columns) + " |",
        "|---" + "|--:" * len(columns) + "|",
        *(f"| {_cells(row, columns)} |" for row in rows),
    ]


def _line(place: str, row: Row, columns: Sequence[Column]) -> str:
    return f"| {place} | {_cells(row, columns)} |"


def _cells(row: Row, columns: Sequence[Column]) -> str:
    texts = (column.cell(row) for column in columns)
    cells = [f"{value}<br>{interval}" if interval else value for value, interval in texts]
    name = escaped(row.policy)
    return " | ".join([f"**{name}**" if row.policy == row.reference else name, *cells])


def _driven(item: Chapter) -> list[str]:
    """PyBullet minus analytic, in one sentence: the largest difference of any policy."""
    if item.driven is None:
        return []
    points, seconds = (
        max(abs(move.differences[name].value) for move in item.driven.moves) for name in ("net_rate", "cycle_time_s")
    )
    return [
        f"From the analytic backend to PyBullet, {item.driven.pairs} shared seeds: no policy's mean moves by more than "
        f"{100.0 * points:.2f} points and {seconds:.3f} s.",
        "",
    ]


def _ordered(chapters: Sequence[Chapter]) -> list[str]:
    """Tiers beside the headlines in which the order of work matters: policies by mean return, and the bound."""
    lines: list[str] = []
    for item in chapters:
        for tier in (tier for tier in item.others if tier.condition.scenario in item.task.ordering):
            rows = ranking.by_return(tier.rows)
            shown = [column for column in COLUMNS if any(column.cell(row)[0] != "-" for row in rows)]
            where = f"{sections.name_of(item.task.id)}, {escaped(sections.words(tier.condition))}, "
            where += f"{len(tier.seeds)} {tier.condition.instances}s:"
            bound = [] if tier.bound is None else [_line("", tier.bound, shown)]
            lines += [where, "", *_numbered(rows, shown), *bound, "", *_told(rows)]
    return ["## Where the order matters", "", *lines] if lines else []


def _demands(chapters: Sequence[Chapter]) -> list[str]:
    """Tiers that demand a net rate: policies by the work an hour that meets it."""
    lines: list[str] = []
    for item in chapters:
        for tier in item.others:
            demanded = rates_of(tier.condition).demanded
            if demanded > 0.0:
                rows = sorted(tier.rows, key=lambda row: -row.scores[ACCEPTED].value)
                where = f"{sections.name_of(item.task.id)}, {escaped(sections.words(tier.condition))}, demanded "
                where += f"{100.0 * demanded:g} %, {len(tier.seeds)} {tier.condition.instances}s:"
                lines += [where, "", *_named(rows, (*field_columns(rows), _RETURN)), "", *_told(rows)]
    if not lines:
        return []
    said = (
        "As fast as you like down to a demanded net rate: kills beyond it are worth nothing, every second costs. A "
        "field on which the demand is missed counts as no work at all."
    )
    return ["## Down to a demand", "", said, "", *lines]


def _cameras(chapters: Sequence[Chapter]) -> list[str]:
    """Camera beside model perception, a line a task and policy."""
    seen = [(item, item.seen, move) for item in chapters if item.seen is not None for move in item.seen.moves]
    if not seen:
        return []
    heads = [
        text for column in MOVED for text in (f"{_of(column)} through the camera", f"minus model, {_unit(column)}")
    ]
    lines = [
        "## Through the cameras",
        "",
        "The same fields, machine and luck, seen by rendered and segmented pictures instead of the model that was "
        "fitted to such pictures; differences are paired.",
        "",
        "| task | policy | seeds | " + " | ".join(heads) + " |",
        "|---|---" + "|--:" * (len(heads) + 1) + "|",
    ]
    for item, compared, move in seen:
        cells = [text for column in MOVED for text in _moved(column, move)]
        names = sections.name_of(item.task.id), escaped(move.policy), str(compared.pairs)
        lines.append("| " + " | ".join((*names, *cells)) + " |")
    told = ranking.multiplicity(each for *_, move in seen for each in move.differences.values())
    return [*lines, "", *told, ""]


def _sights(chapters: Sequence[Chapter]) -> list[str]:
    """What cameras see and what looks at it, beside perfect perception: a table a task with several of them."""
    lines: list[str] = []
    for item in (item for item in chapters if len(item.sights) > 1):
        names = sorted({name for each in item.sights for name in each.second.numbers})
        heads = [text for column in MOVED for text in (_of(column), f"minus perfect, {_unit(column)}")]
        lines += [
            f"{sections.name_of(item.task.id)}, {escaped(sections.words(item.sights[0].first))}:",
            "",
            f"| {' | '.join(map(escaped, names))} | policy | {item.sights[0].first.instances}s | {' | '.join(heads)} |",
            "|---" * (len(names) + 1) + "|--:" * (len(heads) + 1) + "|",
        ]
        for each in item.sights:
            config = item.task.assembly.configured(each.second.scenario, overrides=each.second.numbers)
            told = [escaped(str(attrgetter(name)(config))) for name in names]
            for move in each.moves:
                cells = [text for column in MOVED for text in _moved(column, move)]
                lines.append("| " + " | ".join((*told, escaped(move.policy), str(each.pairs), *cells)) + " |")
        moved = [value for each in item.sights for move in each.moves for value in move.differences.values()]
        lines += ["", *ranking.multiplicity(moved), ""]
    if not lines:
        return []
    said = "The same fields, seen through rendered pictures by kinds of pictures and eyes, and as they are; paired."
    return ["## Pictures and eyes", "", said, "", *lines]


def _moved(column: Column, move: Move) -> tuple[str, str]:
    """The second condition's mean and the difference to the first with its interval."""
    item, mean = move.differences[column.name], move.means[column.name][1]
    if not math.isfinite(item.value):
        return "-", "-"
    low_high = f"<br>{column.text(item.low)} .. {column.text(item.high)}" if math.isfinite(item.low) else ""
    mark = f" {doubt(item)}" if doubt(item) else ""
    return column.text(mean), column.text(item.value, "+") + low_high + mark


def _of(column: Column) -> str:
    """A comparison's score with its unit, as a mean."""
    return column.title.replace("points", "%")


def _unit(column: Column) -> str:
    """The unit of a comparison's difference."""
    return column.title.partition(", ")[2] or column.title
