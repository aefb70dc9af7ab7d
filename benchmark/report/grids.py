"""The page's tables: policies in lines, scores in columns, every figure as ``tables.Column`` writes it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ..suites import BOUND
from ..summary import Row
from ..tables import MARKS, Column, doubt
from .markup import Markup, tag
from .reader import Move, Tier
from .styles import Style
from .svg import marker

_RATE, _CYCLE, _RETURN = ("net_rate", 100.0, 2), ("cycle_time_s", 1.0, 2), ("return", 1.0, 3)

TABLE = (
    (
        "net rate, %",
        (
            Column("mean", *_RATE),
            Column("vs paper", *_RATE, "difference"),
            Column("below bound", *_RATE, "gap"),
            Column("below clairvoyant", "clairvoyant_net_rate", 100.0, 2, "gap"),
        ),
    ),
    ("cycle time, s", (Column("mean", *_CYCLE), Column("vs paper", *_CYCLE, "difference"))),
    (
        "return",
        (
            Column("mean", *_RETURN),
            Column("vs paper", *_RETURN, "difference"),
            Column("vs rule", *_RETURN, "rule"),
            Column("vs planner", *_RETURN, "planner"),
        ),
    ),
    ("front", (Column("Pareto", "front", 1.0, 0, "front"),)),
    ("done", (Column("a minute", "throughput_per_min", 1.0, 2),)),
    ("damaged", (Column("an episode", "damaged", 1.0, 2),)),
    ("decision", (Column("ms", "decision_ms", 1.0, 2),)),
)
"""Columns of the table of an environment, in groups."""

MINUS, NONE = "\u2212", "\u2013"
"""A true minus sign, and what stands where there is no value."""

BOUND_STYLE = Style("bound", "circle")


def chips(tier: Tier, styles: dict[str, Style]) -> Markup:
    """The policies with their markers; each lights up its marks in every chart of the section."""
    items = [
        tag(
            "button",
            swatch(styles[policy]),
            policy,
            tag("small", "paper's order") if policy == tier.reference else None,
            type="button",
            _class="chip",
            data_policy=policy,
            aria_pressed="false",
        )
        for policy in tier.policies
    ]
    return tag("div", items, _class="chips", role="group", aria_label="Policies: choose one to light it up")


def swatch(style: Style) -> Markup:
    """A policy's marker as a small picture."""
    return tag("svg", marker(style, 8.0, 8.0, 5.0), _class="swatch", viewBox="0 0 16 16", aria_hidden="true")


Groups = Sequence[tuple[str, Sequence[Column]]]


def table(tier: Tier, styles: dict[str, Style], groups: Groups = TABLE) -> Markup:
    """Policies in lines, scores in columns, intervals under values; columns that nobody has are left out."""
    shown = [(title, [column for column in columns if _has(tier, column)]) for title, columns in groups]
    shown = [(title, columns) for title, columns in shown if columns]
    rows = [row for row in tier.all_rows if any(holds(column, row) for _, columns in shown for column in columns)]
    lines = [_line(tier, row, shown, styles) for row in rows]
    above = [tag("th", broken(title), scope="colgroup", colspan=len(columns)) for title, columns in shown]
    below = [
        tag("th", column.title, scope="col", _class="first" if column is columns[0] else None)
        for _, columns in shown
        for column in columns
    ]
    first = tag("th", "policy", scope="col", rowspan=2)
    head = [tag("tr", first, above), tag("tr", below, _class="sub")] if len(groups) > 1 else tag("tr", first, below)
    return boxed(head, lines, f"Scores, {tier.condition}")


def boxed(head: object, lines: Sequence[Markup], label: str | None = None, kind: str = "") -> Markup:
    """A table that is scrolled sideways where it is too wide, by keyboard too where a ``label`` says what it is."""
    reached = {} if label is None else {"tabindex": "0", "role": "region", "aria_label": label}
    grid = tag("table", tag("thead", head), tag("tbody", lines))
    return tag("div", grid, _class=f"scroll tablebox {kind}".rstrip(), **reached)


def _has(tier: Tier, column: Column) -> bool:
    return any(holds(column, row) for row in tier.all_rows)


def holds(column: Column, row: Row) -> bool:
    """Whether a row has a value in a column."""
    return column.cell(row)[0] != "-"


def _line(tier: Tier, row: Row, groups: Groups, styles: dict[str, Style]) -> Markup:
    cells = [
        cell(column, row, leads=row.policy == _leader(tier.rows, column), first=column is columns[0])
        for _, columns in groups
        for column in columns
    ]
    name = tag(
        "th",
        swatch(styles.get(row.policy, BOUND_STYLE)),
        row.policy,
        tag("small", "paper's order") if row.policy == tier.reference else None,
        scope="row",
        _class="named",
    )
    role = "limit" if row.policy == BOUND else None
    return tag("tr", name, cells, _class=role, data_policy=row.policy)


def broken(title: str) -> Markup:
    """A heading with its unit set back."""
    what, _, unit = title.partition(", ")
    return tag("span", what, tag("i", f" {unit}") if unit else None)


def _leader(rows: Sequence[Row], column: Column) -> str:
    """The policy whose value is best, where better is plain."""
    if column.kind != "mean" or column.name not in ("net_rate", "return"):
        return ""
    there = [row for row in rows if holds(column, row)]
    return max(there, key=lambda row: row.scores[column.name].value).policy if there else ""


def cell(column: Column, row: Row, leads: bool = False, first: bool = False) -> Markup:
    """A score in a table: its value, the interval under it, and before it what says that a difference may be none."""
    value, interval = column.cell(row)
    if value == "-":
        return tag("td", tag("span", NONE, _class="none"), _class="first" if first else None)
    mark = next((word for word in MARKS if interval.endswith(f" {word}")), "")
    shown = interval.removesuffix(f" {mark}").replace(" .. ", " to ")
    return _td(value, shown, mark, leads=leads, first=first)


def _td(
    value: str, interval: str, mark: str, leads: bool = False, first: bool = False, tip: str | None = None
) -> Markup:
    classes = " ".join(word for word, holds in (("first", first), ("doubtful", bool(mark))) if holds)
    return tag(
        "td",
        tag("em", f"{mark} ") if mark else None,
        tag("b" if leads else "span", minus(value)),
        tag("small", minus(interval)) if interval else None,
        _class=classes or None,
        data_tip=tip,
    )


def minus(text: str) -> str:
    """Numbers with a true minus sign."""
    return text.replace("-", MINUS)


def over_rules(rows: Sequence[Row]) -> Markup:
    """A learned policy's differences in return to every rule."""
    lines = []
    for row in rows:
        for rule, item in row.over_rules.items():
            span = f"{item.low:+.3f} to {item.high:+.3f}" if math.isfinite(item.low) else ""
            cells = [_td(f"{item.value:+.3f}", span, doubt(item))]
            lines.append(tag("tr", tag("th", f"{row.policy} {MINUS} {rule}", scope="row"), cells))
    heads = [tag("th", text, scope="col") for text in ("pair", "difference in return")]
    return boxed(tag("tr", heads), lines, kind="compact")


MOVED = (
    Column("net rate, points", *_RATE),
    Column("cycle time, s", "cycle_time_s", 1.0, 3),
    Column("return", *_RETURN),
)
"""What is compared between two conditions."""


def moved(move: Move, before: str, after: str) -> list[Markup]:
    """Cells of a policy's differences between two conditions, called ``before`` and ``after``."""
    cells = []
    for column in MOVED:
        item = move.differences[column.name]
        if not math.isfinite(item.value):
            cells.append(tag("td", NONE))
            continue
        interval = f"{column.text(item.low)} to {column.text(item.high)}" if math.isfinite(item.low) else ""
        was, is_now = map(column.text, move.means[column.name])
        tip = f"{move.policy}\n{before} {was}\n{after} {is_now}"
        cells.append(_td(column.text(item.value, "+"), interval, doubt(item), tip=tip))
    return cells


def moves_table(moves: Sequence[tuple[object, str | None, Move]], first: str, before: str, after: str) -> Markup:
    """Differences between two conditions, a line each: its heading, the policy that it lights up, the move."""
    lines = [
        tag("tr", tag("th", heading, scope="row"), moved(move, before, after), data_policy=policy)
        for heading, policy, move in moves
    ]
    heads = [tag("th", broken(text), scope="col") for text in (first, *(column.title for column in MOVED))]
    return boxed(tag("tr", heads), lines, kind="compact")
