"""One environment on the page: what it is, what came out, its table and its charts."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping

from .. import ranking
from ..rates import rates_of
from ..suites import Condition
from ..summary import Row
from ..tables import MARKDOWN, doubt, field_columns
from ..thinking import CHARGED
from . import charts, gantt
from .grids import TABLE, chips, holds, minus, moves_table, over_rules, swatch, table
from .markup import EMPTY, Markup, join, tag
from .reader import Chapter, Comparison, Tier
from .styles import Style

FIGURES = {column.name: column for _, columns in TABLE for column in columns if column.kind == "mean"}
"""How a score is written in a sentence."""

DOUBTS = {
    "": "",
    "few": " (too few pairs to tell)",
    "n.s.": " (not significant)",
    "Holm": " (not significant among so many comparisons)",
}


def name_of(env_id: str) -> str:
    """An environment's name as words: ``fieldgym/LaserWeeding-v0`` is Laser weeding."""
    bare = env_id.rpartition("/")[2].rsplit("-v", 1)[0]
    return re.sub(r"(?<=[a-z])(?=[A-Z])", " ", bare).capitalize()


def anchor(env_id: str) -> str:
    """The section's address on the page."""
    return env_id.removeprefix("fieldgym/").lower()


def best(tier: Tier) -> Row:
    """The policy with the largest mean return."""
    there = [row for row in tier.rows if math.isfinite(row.scores["return"].value)]
    return max(there or tier.rows, key=lambda row: row.scores["return"].value)


def chapter(item: Chapter, styles: dict[str, Style], replays: Mapping[str, str]) -> Markup:
    """The section of an environment; ``replays`` are pages by policy."""
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
        _meaning(tier),
        _field(tier, styles),
        _more(tier, styles),
        tag(
            "div",
            figure(
                "Net rate against cycle time",
                "Means with 95 % intervals; up and to the left is better.",
                charts.pareto(tier, styles),
            ),
            figure(
                "Net rate over the episode",
                f"Mean of {_most(tier)} episodes; point at a policy for its 10 to 90 % range.",
                charts.cumulative(tier, styles),
            ),
            figure(
                "How often a net rate is reached",
                "Share of the episodes with at least this net rate; further right is better.",
                charts.profile(tier, styles),
            ),
            _driven(item, styles),
            _seen(item, styles),
            _class="pair",
        ),
        _seconds(tier),
        _episode(tier, replays),
        _others(item, styles),
        id=anchor(task.id),
    )


def words(condition: Condition) -> str:
    """A condition in a line, without the environment."""
    backend = "PyBullet" if condition.backend == "pybullet" else condition.backend
    return " · ".join(
        (condition.scenario, f"{backend} backend", f"{condition.perception} perception", *condition.specials())
    )


def _episodes(tier: Tier) -> str:
    first, last = tier.seeds[0], tier.seeds[-1]
    fewest = min(row.episodes for row in tier.rows)
    count = f"{len(tier.seeds)}" if fewest == len(tier.seeds) else f"{fewest} to {len(tier.seeds)}"
    what = tier.condition.instances
    return f"{count} paired episodes a policy, " + (
        f"{what}s {first} to {last}" if first != last else f"{what} {first}"
    )


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
            f"No policy can pass {most} % on average: "
            + ("it is reached. " if float(left) == 0.0 else f"at most {left} points are left. ")
        )
    else:
        said.append("No bound is known for this tier. ")
    said += [_learned(row) for row in tier.rows if row.over_rules]
    return tag("p", said, _class="verdict")


def _learned(row: Row) -> list[str]:
    """Whether a learned policy is better than every rule."""
    if row.least_over_rules is None:
        return []
    rule, by, better = row.least_over_rules
    interval = minus(f"{by.value:+.3f} ({by.low:.3f} to {by.high:.3f})")
    says = f" is {'' if better else 'not '}better than every rule in return"
    return [tag("b", row.policy), f"{says}, least over {rule}: {interval}. "]


def _meaning(tier: Tier) -> Markup:
    """What the table's order means, and its comparisons."""
    return tag("ul", [tag("li", line) for line in ranking.told(tier.rows)], _class="quiet after")


def _field(tier: Tier, styles: dict[str, Style]) -> Markup:
    """What the scores come to in a grower's units."""
    columns = field_columns(tier.rows)
    return join([tag("h4", "In the field"), table(tier, styles, [("", columns)])]) if columns else EMPTY


def _difference(row: Row, name: str) -> str:
    unit = {"net_rate": " points", "cycle_time_s": " s", "return": ""}[name]
    item = row.differences.get(name)
    if item is None or not math.isfinite(item.value):
        return f"unknown{unit}"
    return minus(FIGURES[name].text(item.value, "+")) + unit + DOUBTS[doubt(item)]


def _more(tier: Tier, styles: dict[str, Style]) -> Markup:
    """What the table has no room for."""
    titles = {
        "Difference to the policy in bold": "Paired differences to the paper's own order",
        "Difference to the best rule": "Paired differences to the best rule",
        "Difference to the best planner": "Paired differences to the best planner",
        "Larger return on, % of the fields": "Probability of improvement: share of the fields with a larger return, %",
        "Interquartile mean": "Interquartile means",
        "Gap to the bound": "Gaps to the bound",
    }
    parts = []
    for title, columns in MARKDOWN:
        if title in titles and any(holds(column, row) for column in columns for row in tier.rows):
            parts += [tag("h4", titles[title]), table(tier, styles, [(title, columns)])]
    told = tier.bound_words
    if told is not None:
        how = "; ".join(told.methods) or "not told"
        proven = f"{100.0 * told.proven:.0f} % of them are proven optima"
        parts.append(tag("p", f"Bounds: {how}. {proven}; {told.wall_s:.2g} s each.", _class="quiet after"))
    learned = [row for row in tier.rows if row.over_rules]
    if learned:
        parts += [tag("h4", "Learned policies against every rule, return"), over_rules(learned)]
    return (
        tag("details", tag("summary", "All scores: interquartile means, differences, gaps"), parts) if parts else EMPTY
    )


def figure(title: str, caption: str, *content: Markup) -> Markup:
    """A figure with its caption; empty where any part of it is."""
    return tag("figure", tag("figcaption", tag("b", title), tag("span", caption)), content) if all(content) else EMPTY


def _driven(item: Chapter, styles: dict[str, Style]) -> Markup:
    """What changes when physics carries the plans out."""
    if item.driven is None:
        return EMPTY
    first, second = item.driven.first, item.driven.second
    eyes = (
        f"both with {first.perception} perception"
        if first.perception == second.perception
        else f"{first.perception} perception against {second.perception}"
    )
    return figure(
        "From the analytic backend to PyBullet",
        f"PyBullet minus analytic on {item.driven.pairs} shared seeds, {eyes}.",
        _moves(item.driven, styles, "analytic", "PyBullet"),
    )


def _seen(item: Chapter, styles: dict[str, Style]) -> Markup:
    """What changes when rendered cameras see instead of their model."""
    if item.seen is None:
        return EMPTY
    return figure(
        "Through the cameras",
        f"Rendered and segmented pictures minus the model of them on {item.seen.pairs} shared seeds, "
        f"{item.seen.first.backend} backend.",
        _moves(item.seen, styles, "model", "camera"),
    )


def _moves(item: Comparison, styles: dict[str, Style], before: str, after: str) -> Markup:
    named = [([swatch(styles[move.policy]), move.policy], move.policy, move) for move in item.moves]
    told = ranking.multiplicity(each for move in item.moves for each in move.differences.values())
    return join([moves_table(named, "policy", before, after), tag("p", told, _class="quiet after")])


def _seconds(tier: Tier) -> Markup:
    return figure(
        "Where the seconds of a finished target go",
        "All seconds of an episode, shared among its finished targets; mean over the episodes.",
        gantt.legend(gantt.phases_of(tier)),
        gantt.seconds_each(tier),
    )


def _episode(tier: Tier, replays: Mapping[str, str]) -> Markup:
    if not tier.timelines:
        return EMPTY
    field = next(iter(tier.timelines.values())).field
    return figure(
        "One episode, second by second",
        f"The same for every policy, {tier.condition.instances} {field}: what the machine did, start to end.",
        gantt.legend(gantt.phases_of(tier)),
        gantt.episode(tier),
        _replays(replays),
        tag(
            "p",
            tag("b", "Decision by decision"),
            " The same episode from its start, to be scrolled sideways. A triangle ends a finished target, a cross one "
            "that was damaged; point at a decision to read it.",
            _class="subcaption",
        ),
        gantt.close_up(tier),
    )


def _replays(replays: Mapping[str, str]) -> Markup:
    if not replays:
        return EMPTY
    links = [[" " if i else "", tag("a", policy, href=page)] for i, (policy, page) in enumerate(replays.items())]
    return tag(
        "p", tag("b", "Watch it"), " The first minute of this episode in three dimensions: ", links, _class="subcaption"
    )


def _others(item: Chapter, styles: dict[str, Style]) -> Markup:
    if not item.others:
        return EMPTY
    parts = []
    for tier in item.others:
        parts += [tag("h4", words(tier.condition)), tag("p", _episodes(tier), _class="quiet"), table(tier, styles)]
        parts.append(_meaning(tier))
        parts += [_field(tier, styles)] if rates_of(tier.condition).demanded > 0.0 else []
    count = len(item.others)
    return tag("details", tag("summary", f"{count} more tier{'s' if count > 1 else ''}"), parts)
