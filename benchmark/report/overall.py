"""All tasks at once: how much of the best possible is reached how often, and who returns more on how many fields."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...agents.policies.weights import LEARNED
from ..statistics import CONFIDENCE, Estimate, mean_of_means, profile
from ..summary import REFERENCE, RIVALS
from .grids import boxed
from .markup import EMPTY, Markup, tag
from .reader import Study, Tier
from .sections import figure
from .styles import Style
from .svg import Size, axis, both, chart, frame, points, series

LEVELS = np.linspace(0.0, 1.0, 101)
"""Shares of the bound's net rate."""
PAPER = "paper's order"
STYLES = {
    PAPER: Style("ink", "circle"),
    "best rule": Style("blue", "square"),
    "best planner": Style("green", "diamond"),
    LEARNED: Style("orange", "star"),
}
"""Roles that policies play on every task, and their looks."""
LEFT, RIGHT, TOP, BOTTOM = 46.0, 14.0, 34.0, 48.0


def roles(tier: Tier) -> dict[str, str]:
    """Who plays each role on a tier; a role that nobody plays is missing."""
    rivals = tier.rows[0].rivals
    named = {PAPER: tier.reference, **{f"best {kind}": rivals.get(kind, "") for kind in RIVALS}, LEARNED: LEARNED}
    return {role: policy for role, policy in named.items() if tier.row(policy) is not None}


def together(study: Study) -> Markup:
    """The figures; empty where only one task was run."""
    tiers = [item.headline for item in study.chapters]
    if len(tiers) < 2:
        return EMPTY
    return tag("div", _profile(tiers), _wins(tiers), _class="pair")


def _reached(tiers: Sequence[Tier]) -> dict[str, list[np.ndarray]]:
    """Net rates as shares of their fields' bounds, an array a task, by role."""
    found: dict[str, list[np.ndarray]] = {}
    for tier in tiers:
        for role, policy in roles(tier).items():
            own = tier.values[policy]["net_rate"]
            shares = [own[field] / tier.most[field] for field in sorted(own) if tier.most.get(field, 0.0) > 0.0]
            if shares:
                found.setdefault(role, []).append(np.array(shares))
    return found


def _profile(tiers: Sequence[Tier]) -> Markup:
    reached = _reached(tiers)
    if not reached:
        return EMPTY
    profiles = {role: profile(groups, LEVELS) for role, groups in reached.items()}
    counts = {role: len(groups) for role, groups in reached.items()}
    low = min(float(LEVELS[int((found[0] >= 1.0 - 1e-12).sum()) - 1]) for found in profiles.values())
    return figure(
        "Performance profile over all tasks",
        "Share of the episodes that reach a share of what the bound leaves on their field; every task counts the same, "
        f"{100.0 * CONFIDENCE:.0f} % bands. Further right is better.",
        _legend(profiles),
        both(lambda size: _chart(profiles, counts, low, size)),
    )


def _legend(there: Mapping[str, object]) -> Markup:
    keys = [tag("span", tag("i", style=f"background:{STYLES[role].css}"), role, _class="key") for role in there]
    return tag("div", keys, _class="keys")


def _chart(profiles: Mapping[str, np.ndarray], counts: Mapping[str, int], low: float, size: Size) -> Markup:
    x = axis(100.0 * low, 100.0, LEFT, size.width - RIGHT, size.ticks(6, 4), tight=True)
    y = axis(0.0, 100.0, size.height - BOTTOM, TOP, 5)
    shown = LEVELS >= low
    at = [x(100.0 * float(level)) for level in LEVELS[shown]]
    drawn = []
    for role, found in profiles.items():
        share, below, above = ([y(100.0 * float(value)) for value in row[shown]] for row in found)
        css = STYLES[role].css
        half = 100.0 * float(LEVELS[np.flatnonzero(found[0] >= 0.5)[-1]])
        tip = f"{role}\nhalf of the episodes of {counts[role]} tasks reach {half:.0f} % of their bound"
        band = tag("path", d=points([*at, *at[::-1]], [*above, *below[::-1]]) + "Z", style=f"fill:{css};opacity:0.14")
        line = tag("path", _class="curve", d=points(at, share), style=f"stroke:{css}")
        drawn.append(series(role, tip, band, tag("path", _class="hit", d=points(at, share)), line))
    titles = "net rate, % of the bound", "episodes that reach it, %"
    return chart(size, "Performance profile over all tasks", frame(x, y, *titles), drawn)


def _wins(tiers: Sequence[Tier]) -> Markup:
    """Probability of improvement, mean over the tasks."""
    others = {PAPER: REFERENCE, **{f"best {kind}": kind for kind in RIVALS}}
    lines = []
    for role in STYLES:
        cells = [_share(tiers, role, other) for other in others]
        if any(cell is not None for cell in cells):
            swatch = tag("i", style=f"background:{STYLES[role].css}")
            name = tag("th", tag("span", swatch, role, _class="key"), scope="row")
            lines.append(tag("tr", name, [_cell(cell) for cell in cells]))
    heads = [tag("th", text, scope="col") for text in ("", *(f"over {other}" for other in others))]
    return figure(
        "Probability of improvement",
        "Share of the fields, %, on which the return is larger, ties counted half; paired, every task counts the same. "
        "The best are the best of their task by mean return on these fields.",
        boxed(tag("tr", heads), lines, "Probability of improvement", "compact"),
    )


def _share(tiers: Sequence[Tier], role: str, other: str) -> tuple[Estimate, int] | None:
    """How often one role returns more than another, and on how many tasks two policies play them."""
    groups = []
    for tier in tiers:
        who = roles(tier)
        if role in who and other in who and who[role] != who[other]:
            own, theirs = (tier.values[who[name]]["return"] for name in (role, other))
            shared = sorted(own.keys() & theirs.keys())
            groups.append([0.5 + 0.5 * float(np.sign(own[field] - theirs[field])) for field in shared])
    return (mean_of_means(groups), len(groups)) if groups else None


def _cell(found: tuple[Estimate, int] | None) -> Markup:
    if found is None:
        return tag("td", tag("span", "\u2013", _class="none"))
    item, tasks = found
    interval = f"{100.0 * item.low:.1f} to {100.0 * item.high:.1f}, {tasks} task{'' if tasks == 1 else 's'}"
    return tag("td", tag("span", f"{100.0 * item.value:.1f}"), tag("small", interval))
