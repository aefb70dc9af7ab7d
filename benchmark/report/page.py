"""The benchmark as one self-contained HTML page."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ...agents import policy_names, reference_policy
from ...envs import env_ids
from ...envs.task import task
from ..ranking import multiplicity
from ..statistics import CONFIDENCE, FEWEST_PAIRS, RESAMPLES
from . import grids, overall, sections
from .markup import EMPTY, Markup, join, tag
from .reader import Chapter, Study
from .styles import Style, policy_styles

HERE = Path(__file__).parent


def render(study: Study, command: str, replays: Mapping[str, Mapping[str, str]] | None = None) -> str:
    """The page.

    Args:
        study: what to show.
        command: how this page was made; printed at its foot.
        replays: by environment and policy, pages to link to from its Gantt chart.
    """
    styles = styles_of(study)
    body = join(
        [
            _header(study),
            tag(
                "main",
                _glance(study, styles),
                _cameras(study),
                [sections.chapter(item, styles, (replays or {}).get(item.task.id, {})) for item in study.chapters],
            ),
            _footer(study, command),
        ]
    )
    script = Markup((HERE / "page.js").read_text(encoding="utf-8"))
    head = join(
        [
            tag("meta", charset="utf-8"),
            tag("meta", name="viewport", content="width=device-width, initial-scale=1"),
            tag("meta", name="color-scheme", content="light dark"),
            tag("title", "fieldgym benchmark"),
            tag("style", Markup((HERE / "page.css").read_text(encoding="utf-8"))),
        ]
    )
    return f"<!DOCTYPE html>\n{tag('html', tag('head', head), tag('body', body, tag('script', script)), lang='en')}\n"


def styles_of(study: Study) -> dict[str, Style]:
    """A style a policy, the same whatever part of the benchmark a folder holds."""
    groups = [
        list(task(env_id).lineup(scenario, policy_names(env_id)))
        for env_id in env_ids()
        for scenario in task(env_id).lineups or ("",)
    ]
    # Guests come after the package's own, which look the same with and without them.
    groups += [list(tier.policies) for item in study.chapters for tier in (item.headline, *item.others)]
    return policy_styles(groups, [reference_policy(env_id) for env_id in env_ids()])


def _header(study: Study) -> Markup:
    episodes = sum(
        row.episodes for item in study.chapters for tier in (item.headline, *item.others) for row in tier.rows
    )
    policies = len({name for item in study.chapters for name in item.headline.policies})
    versions = dict.fromkeys(str(source.manifest.get("fieldgym", "")) for source in study.sources)
    links = [
        tag("a", sections.name_of(item.task.id), href=f"#{sections.anchor(item.task.id)}") for item in study.chapters
    ]
    return tag(
        "header",
        tag("p", f"fieldgym {', '.join(versions)} benchmark", _class="eyebrow"),
        tag("h1", "Which target next?"),
        tag(
            "p",
            "How good is a way of choosing the next target, and how far is it from the best possible? "
            f"{policies} policies on {_count(len(study.chapters), 'task')} of agricultural parallel robots, "
            f"{episodes:,} episodes. Equal seeds are equal fields with equal luck, so every comparison is paired.",
            _class="lead",
        ),
        tag("nav", links, aria_label="Environments"),
    )


def _count(n: int, what: str) -> str:
    return f"{n} {what}{'' if n == 1 else 's'}"


def _glance(study: Study, styles: Mapping[str, Style]) -> Markup:
    """A line an environment."""
    lines = [_glance_line(item, styles) for item in study.chapters]
    shown = grids.TABLE[:2]
    above = [tag("th", grids.broken(title), scope="colgroup", colspan=len(columns)) for title, columns in shown]
    below = [tag("th", column.title, scope="col") for _, columns in shown for column in columns]
    first = [tag("th", text, scope="col", rowspan=2) for text in ("task", "largest return")]
    return tag(
        "section",
        tag("h2", "At a glance"),
        tag(
            "p",
            "The policy with the largest mean return on each task's headline tier, beside the paper's own order and "
            "the bound that no policy can pass.",
            _class="about",
        ),
        grids.boxed([tag("tr", first, above), tag("tr", below, _class="sub")], lines, "Summary", "glance"),
        overall.together(study),
        id="glance",
    )


def _glance_line(item: Chapter, styles: Mapping[str, Style]) -> Markup:
    tier = item.headline
    row = sections.best(tier)
    cells = [grids.cell(column, row) for _, columns in grids.TABLE[:2] for column in columns]
    name = tag("a", sections.name_of(item.task.id), href=f"#{sections.anchor(item.task.id)}")
    where = tag("small", f"{tier.condition.scenario}, {_count(len(tier.seeds), tier.condition.instances)}")
    phone = tag("small", row.policy, _class="phone")
    policy = tag("td", grids.swatch(styles[row.policy]), row.policy, _class="words")
    return tag("tr", tag("th", name, where, phone, scope="row"), policy, cells)


def _cameras(study: Study) -> Markup:
    """Camera beside model perception, a line a task and policy."""
    lines = []
    for item in study.chapters:
        for move in () if item.seen is None else item.seen.moves:
            name = tag("a", sections.name_of(item.task.id), href=f"#{sections.anchor(item.task.id)}")
            lines.append(([name, tag("small", move.policy)], None, move))
    if not lines:
        return EMPTY
    return tag(
        "section",
        tag("h2", "Through the cameras"),
        tag(
            "p",
            "The same fields, machine and luck, seen by rendered and segmented pictures instead of the model that was "
            "fitted to such pictures: camera minus model.",
            _class="about",
        ),
        grids.moves_table(lines, "task", "model", "camera"),
        tag("p", multiplicity(each for *_, move in lines for each in move.differences.values()), _class="quiet after"),
        id="cameras",
    )


def _footer(study: Study, command: str) -> Markup:
    notes = (
        ("Net rate", "The share of what was there that was done right, as each task's page defines it."),
        ("Cycle time", "Seconds from the end of one finished target to the end of the next, means of the episodes."),
        (
            "Intervals",
            f"{100.0 * CONFIDENCE:.0f} % bootstrap intervals over episodes, {RESAMPLES} resamples, bias-corrected and "
            "accelerated.",
        ),
        (
            "Differences",
            "Paired by seed. n.s.: the interval holds 0, so there may be no difference. few: under "
            f"{FEWEST_PAIRS} pairs, too few to tell. Holm: the interval leaves out 0, but as one of so many "
            "comparisons of its table that may be chance (Holm 1979, 5 % together). Rule and "
            "planner: the best by mean return.",
        ),
        (
            "Front",
            "No other policy has both as high a net rate and as short a cycle, one of them better, by the means.",
        ),
        (
            "Bound",
            "What no policy can pass on the same fields with the same luck, were everything known beforehand. Its "
            "figures need not be reachable together.",
        ),
        (
            "Energy",
            "Of the tool (light, work against the soil) and the positive mechanical work of the motors that move it, "
            "the latter estimated from the machine's dynamics. No losses, no fans, no driving over the field.",
        ),
        (
            "Interquartile mean",
            "Mean of the middle half of the episodes, so that a few lucky or hopeless ones count little.",
        ),
        (
            "A decision's ms",
            "Wall time that the policy thinks; it is not part of the cycle time unless a table says so.",
        ),
    )
    return tag(
        "footer",
        tag("h2", "How to read this"),
        tag("dl", [[tag("dt", word), tag("dd", meaning)] for word, meaning in notes], _class="notes"),
        tag("h2", "Where it comes from"),
        tag("dl", [[tag("dt", word), tag("dd", text)] for word, text in stamp(study, command)], _class="stamp"),
    )


def stamp(study: Study, command: str) -> list[tuple[str, str]]:
    """Version, seeds, machine, date and commands, each with its name; what is unknown is left out.

    Where folders differ, each says which tasks it is of.
    """
    tiers = [tier for item in study.chapters for tier in (item.headline, *item.others)]
    drawn = [(tier.seeds[0], tier.seeds[-1]) for tier in tiers if not tier.condition.fields]
    said = [
        ("Version", _by_source(study, _version)),
        ("Seeds", f"{min(low for low, _ in drawn)} to {max(high for _, high in drawn)}" if drawn else ""),
        ("Machine", _by_source(study, lambda made: str(made.get("machine", "")))),
        ("Run", _by_source(study, lambda made: str(made.get("started", "")).replace("T", " "))),
        ("Python", _by_source(study, lambda made: str(made.get("python", "")))),
        ("Packages", _by_source(study, _packages)),
        ("Suite", _by_source(study, lambda made: str(made.get("suite", "")))),
        ("Results by", _by_source(study, lambda made: str(made.get("command", "")))),
        ("Page by", command),
    ]
    return [(word, text) for word, text in said if text]


def _version(made: Mapping[str, Any]) -> str:
    return f"fieldgym {made.get('fieldgym', 'unknown')}, source {made.get('source', 'unknown')}"


def _packages(made: Mapping[str, Any]) -> str:
    packages: Any = made.get("packages") or {}
    return ", ".join(f"{name} {version}" for name, version in packages.items() if version)


def _by_source(study: Study, word: Callable[[Mapping[str, Any]], str]) -> str:
    """What the folders say, once where they say the same."""
    said: dict[str, list[str]] = {}
    for source in study.sources:
        said.setdefault(word(source.manifest), []).extend(sections.name_of(spec.id) for spec in source.tasks)
    if len(said) == 1:
        return next(iter(said))
    return "; ".join(f"{text or 'unknown'} ({', '.join(names)})" for text, names in said.items())
