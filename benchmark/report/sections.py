"""One environment on the page: what it is, what came out, its table and its charts."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence

from ..statistics import FEWEST_PAIRS, Difference, Estimate
from ..suites import BOUND, Condition
from ..summary import Row
from ..tables import MARKDOWN, Column
from ..thinking import CHARGED
from . import charts, gantt
from .markup import EMPTY, Markup, tag
from .reader import Chapter, Tier, Transfer
from .styles import Style
from .svg import marker

_RATE, _CYCLE, _RETURN = ("net_rate", 100.0, 2), ("cycle_time_s", 1.0, 2), ("return", 1.0, 3)

TABLE = (
    (
        "net rate, %",
        (Column("mean", *_RATE), Column("vs paper", *_RATE, "difference"), Column("below bound", *_RATE, "gap")),
    ),
    ("cycle time, s", (Column("mean", *_CYCLE), Column("vs paper", *_CYCLE, "difference"))),
    ("return", (Column("mean", *_RETURN), Column("vs paper", *_RETURN, "difference"))),
    ("done", (Column("a minute", "throughput_per_min", 1.0, 2),)),
    ("damaged", (Column("an episode", "damaged", 1.0, 2),)),
    ("decision", (Column("ms", "decision_ms", 1.0, 2),)),
)
"""Columns of the table of an environment, in groups."""

MINUS, NONE = "\u2212", "\u2013"
"""A true minus sign, and what stands where there is no value."""

BOUND_STYLE = Style("bound", "circle")

FIGURES = {
    "net_rate": Column("net rate, %", "net_rate", 100.0, 2),
    "cycle_time_s": Column("cycle time, s", "cycle_time_s", 1.0, 2),
    "return": Column("return", "return", 1.0, 3),
}


def name_of(env_id: str) -> str:
    """An environment's name as words: ``fieldgym/LaserWeeding-v0`` is Laser weeding."""
    bare = env_id.removeprefix("fieldgym/").rsplit("-v", 1)[0]
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", bare).capitalize()


def anchor(env_id: str) -> str:
    """The section's address on the page."""
    return env_id.removeprefix("fieldgym/").lower()


def best(tier: Tier) -> Row:
    """The policy with the largest mean return."""
    there = [row for row in tier.rows if math.isfinite(row.scores["return"].value)]
    return max(there or tier.rows, key=lambda row: row.scores["return"].value)


def chapter(item: Chapter, styles: dict[str, Style]) -> Markup:
    """The section of an environment."""
    tier, task = item.headline, item.task
    return tag(
        "section",
        tag("h2", name_of(task.id)),
        tag(
            "p",
            f"{task.machine[0].upper()}{task.machine[1:]}. Decides {task.decision}. ",
            tag("span", f"After {task.paper}.", _class="quiet"),
            _class="about",
        ),
        tag(
            "p",
            tag("code", task.id),
            " · " + " · ".join([words(tier.condition), _episodes(tier), *_charged(tier)]),
            _class="quiet",
        ),
        _verdict(tier),
        chips(tier, styles),
        table(tier, styles),
        _more(tier, styles),
        tag(
            "div",
            _figure(
                "Net rate against cycle time",
                "Means with 95 % intervals; up and to the left is better.",
                charts.pareto(tier, styles),
            ),
            _figure(
                "Net rate over the episode",
                f"Mean of {_most(tier)} episodes; point at a policy for its 10 to 90 % range.",
                charts.cumulative(tier, styles),
            ),
            _figure(
                "How often a net rate is reached",
                "Share of the episodes with at least this net rate; further right is better.",
                charts.profile(tier, styles),
            ),
            _transfer(item, styles),
            _class="pair",
        ),
        _seconds(tier),
        _episode(tier),
        _others(item, styles),
        id=anchor(task.id),
    )


def words(condition: Condition) -> str:
    """A condition in a line, without the environment."""
    backend = "PyBullet" if condition.backend == "pybullet" else condition.backend
    return f"{condition.scenario} · {backend} backend · {condition.perception} perception"


def _episodes(tier: Tier) -> str:
    first, last = min(tier.seeds), max(tier.seeds)
    fewest = min(row.episodes for row in tier.rows)
    count = f"{len(tier.seeds)}" if fewest == len(tier.seeds) else f"{fewest} to {len(tier.seeds)}"
    return f"{count} paired episodes a policy, " + (f"seeds {first} to {last}" if last > first else f"seed {first}")


def _charged(tier: Tier) -> list[str]:
    return [CHARGED] if any(row.charged for row in tier.rows) else []


def _most(tier: Tier) -> int:
    return max(curve.episodes for curve in tier.curves.values()) if tier.curves else 0


def _verdict(tier: Tier) -> Markup:
    """The result in a few sentences."""
    winner, reference = best(tier), tier.row(tier.reference)
    rate, cycle = (FIGURES[name].cell(winner)[0] for name in ("net_rate", "cycle_time_s"))
    said: list[object] = [tag("b", winner.policy), f" has the largest return: {rate} % net rate at {cycle} s a target"]
    if reference is None:
        said.append(". ")
    elif winner is reference:
        said.append(", and it is the paper's own order. ")
    else:
        points, seconds, earned = (_difference(winner, name) for name in ("net_rate", "cycle_time_s", "return"))
        said.append(f", {points} and {seconds} against the paper's own order, {tier.reference}; return {earned}. ")
    gap = winner.gaps.get("net_rate")
    if tier.bound is not None and gap is not None and math.isfinite(gap.value):
        most, left = FIGURES["net_rate"].cell(tier.bound)[0], f"{100.0 * abs(gap.value):.2f}"
        said.append(
            f"No policy can pass {most} %: "
            + ("it is reached. " if float(left) == 0.0 else f"at most {left} points are left. ")
        )
    else:
        said.append("No bound is known for this tier. ")
    said += [_learned(row) for row in tier.rows if row.over_rules]
    return tag("p", said, _class="verdict")


def _learned(row: Row) -> Markup:
    """Whether a learned policy is better than every rule."""
    told = {rule: item for rule, item in row.over_rules.items() if math.isfinite(item.low)}
    if not told:
        return EMPTY
    hardest = min(told, key=lambda rule: told[rule].low)
    item = told[hardest]
    better = all(other.significant and other.low > 0.0 for other in told.values())
    says = "is better than every rule in return" if better else "is not better than every rule in return"
    return Markup(
        tag("b", row.policy)
        + f" {says}, least over {hardest}: {minus(f'{item.value:+.3f} ({item.low:.3f} to {item.high:.3f})')}. "
    )


def _difference(row: Row, name: str) -> str:
    scale, digits, unit = {
        "net_rate": (100.0, 2, "points"),
        "cycle_time_s": (1.0, 2, "s"),
        "return": (1.0, 3, ""),
    }[name]
    item = row.differences.get(name)
    if item is None or not math.isfinite(item.value):
        return f"unknown {unit}".rstrip()
    return f"{minus(f'{round(scale * item.value, digits) + 0.0:+.{digits}f}')} {unit}".rstrip() + doubt(item)


def doubt(item: Estimate) -> str:
    """What must be said beside a difference that may be none."""
    if not isinstance(item, Difference) or item.significant:
        return ""
    return " (too few pairs to tell)" if item.n < FEWEST_PAIRS else " (not significant)"


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
    rows = [row for row in tier.all_rows if any(_told(column, row) for _, columns in shown for column in columns)]
    lines = [_line(tier, row, shown, styles) for row in rows]
    above = [tag("th", broken(title), scope="colgroup", colspan=len(columns)) for title, columns in shown]
    below = [
        tag("th", column.title, scope="col", _class="first" if column is columns[0] else None)
        for _, columns in shown
        for column in columns
    ]
    first = tag("th", "policy", scope="col", rowspan=2)
    head = [tag("tr", first, above), tag("tr", below, _class="sub")] if len(groups) > 1 else tag("tr", first, below)
    return tag(
        "div",
        tag("table", tag("thead", head), tag("tbody", lines)),
        _class="scroll tablebox",
        tabindex="0",
        role="region",
        aria_label=f"Scores, {tier.condition}",
    )


def _has(tier: Tier, column: Column) -> bool:
    return any(_told(column, row) for row in tier.all_rows)


def _told(column: Column, row: Row) -> bool:
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
    there = [row for row in rows if _told(column, row)]
    return max(there, key=lambda row: row.scores[column.name].value).policy if there else ""


def cell(column: Column, row: Row, leads: bool = False, first: bool = False) -> Markup:
    """A score in a table: its value, the interval under it, and before it what says that a difference may be none."""
    value, interval = column.cell(row)
    if value == "-":
        return tag("td", tag("span", NONE, _class="none"), _class="first" if first else None)
    mark = next((word for word in (" n.s.", " few") if interval.endswith(word)), "")
    return _td(value, interval.removesuffix(mark).replace(" .. ", " to "), mark.strip(), leads=leads, first=first)


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


def _more(tier: Tier, styles: dict[str, Style]) -> Markup:
    """What the table has no room for."""
    titles = {
        "Difference to the policy in bold": "Paired differences to the paper's own order",
        "Interquartile mean": "Interquartile means",
        "Gap to the bound": "Gaps to the bound",
    }
    parts = []
    for title, columns in MARKDOWN:
        if title in titles and any(_told(column, row) for column in columns for row in tier.rows):
            parts += [tag("h4", titles[title]), table(tier, styles, [(title, columns)])]
    told = tier.bound_words
    if told is not None:
        how = "; ".join(told.methods) or "not told"
        proven = f"{100.0 * told.proven:.0f} % of them are proven optima"
        parts.append(tag("p", f"Bounds: {how}. {proven}; {told.wall_s:.2g} s each.", _class="quiet after"))
    learned = [row for row in tier.rows if row.over_rules]
    if learned:
        parts += [tag("h4", "Learned policies against every rule, return"), _over_rules(learned)]
    return (
        tag("details", tag("summary", "All scores: interquartile means, differences, gaps"), parts) if parts else EMPTY
    )


def _over_rules(rows: Sequence[Row]) -> Markup:
    lines = []
    for row in rows:
        for rule, item in row.over_rules.items():
            span = f"{item.low:+.3f} to {item.high:+.3f}" if math.isfinite(item.low) else ""
            cells = [_td(f"{item.value:+.3f}", span, _SHORT.get(doubt(item), ""))]
            lines.append(tag("tr", tag("th", f"{row.policy} {MINUS} {rule}", scope="row"), cells))
    heads = [tag("th", text, scope="col") for text in ("pair", "difference in return")]
    return tag(
        "div", tag("table", tag("thead", tag("tr", heads)), tag("tbody", lines)), _class="scroll tablebox compact"
    )


def _figure(title: str, caption: str, drawing: Markup) -> Markup:
    if not drawing:
        return EMPTY
    return tag("figure", tag("figcaption", tag("b", title), tag("span", caption)), drawing)


def _transfer(item: Chapter, styles: dict[str, Style]) -> Markup:
    """What changes when physics carries the plans out."""
    if not item.transfer:
        return EMPTY
    first, second = item.compared
    eyes = (
        f"both with {first.perception} perception"
        if first.perception == second.perception
        else f"{first.perception} perception against {second.perception}"
    )
    pairs = max(move.differences["net_rate"].n for move in item.transfer)
    lines = [
        tag(
            "tr",
            tag("th", swatch(styles[move.policy]), move.policy, scope="row"),
            _moved(move),
            data_policy=move.policy,
        )
        for move in item.transfer
    ]
    heads = [tag("th", broken(text), scope="col") for text in ("policy", "net rate, points", "cycle time, s", "return")]
    return tag(
        "figure",
        tag(
            "figcaption",
            tag("b", "From the analytic backend to PyBullet"),
            tag("span", f"PyBullet minus analytic on {pairs} shared seeds, {eyes}."),
        ),
        tag("div", tag("table", tag("thead", tag("tr", heads)), tag("tbody", lines)), _class="scroll tablebox compact"),
    )


def _moved(move: Transfer) -> list[Markup]:
    cells = []
    for name, scale, digits in (("net_rate", 100.0, 2), ("cycle_time_s", 1.0, 3), ("return", 1.0, 3)):
        item = move.differences[name]
        if not math.isfinite(item.value):
            cells.append(tag("td", NONE))
            continue
        low, high = (f"{round(scale * end, digits) + 0.0:.{digits}f}" for end in (item.low, item.high))
        before, after = (f"{scale * value:.{digits}f}" for value in move.means[name])
        value = f"{round(scale * item.value, digits) + 0.0:+.{digits}f}"
        interval = f"{low} to {high}" if math.isfinite(item.low) else ""
        tip = f"{move.policy}\nanalytic {before}\nPyBullet {after}"
        cells.append(_td(value, interval, _SHORT.get(doubt(item), ""), tip=tip))
    return cells


_SHORT = {" (too few pairs to tell)": "few", " (not significant)": "n.s."}


def _seconds(tier: Tier) -> Markup:
    drawing = gantt.seconds_each(tier)
    if not drawing:
        return EMPTY
    return tag(
        "figure",
        tag(
            "figcaption",
            tag("b", "Where the seconds of a finished target go"),
            tag("span", "All seconds of an episode, shared among its finished targets; mean over the episodes."),
        ),
        gantt.legend(gantt.phases_of(tier)),
        drawing,
    )


def _episode(tier: Tier) -> Markup:
    overview = gantt.episode(tier)
    if not overview:
        return EMPTY
    seed = next(iter(tier.timelines.values())).seed
    return tag(
        "figure",
        tag(
            "figcaption",
            tag("b", "One episode, second by second"),
            tag("span", f"The same field for every policy, seed {seed}: what the machine did from start to end."),
        ),
        gantt.legend(gantt.phases_of(tier)),
        overview,
        tag(
            "p",
            tag("b", "Decision by decision"),
            " The same episode from its start, to be scrolled sideways. A triangle ends a finished target, a cross one "
            "that was damaged; point at a decision to read it.",
            _class="subcaption",
        ),
        gantt.close_up(tier),
    )


def _others(item: Chapter, styles: dict[str, Style]) -> Markup:
    if not item.others:
        return EMPTY
    parts = []
    for tier in item.others:
        parts += [tag("h4", words(tier.condition)), tag("p", _episodes(tier), _class="quiet"), table(tier, styles)]
    count = len(item.others)
    return tag("details", tag("summary", f"{count} more tier{'s' if count > 1 else ''}"), parts)
