"""The charts of a tier: net rate against cycle time, net rate against time, and how often which net rate is reached."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .markup import EMPTY, Markup, number, tag
from .reader import Tier
from .styles import Style
from .svg import Axis, Box, Size, axis, both, chart, frame, marker, place_labels, points, series, text_width

Styles = Mapping[str, Style]

BEYOND = "beyond the bound"
LEFT, RIGHT, TOP, BOTTOM = 46.0, 14.0, 34.0, 48.0


def _across(size: Size, low: float, high: float) -> Axis:
    """The axis under a chart, ending at its values."""
    return axis(low, high, LEFT, size.width - RIGHT, size.ticks(6, 4), tight=True)


def _up(size: Size, low: float, high: float, tight: bool = False) -> Axis:
    """The axis on a chart's left."""
    return axis(low, high, size.height - BOTTOM, TOP, 5, tight)


def pareto(tier: Tier, styles: Styles) -> Markup:
    """Net rate against cycle time with the intervals of both; empty when nothing was finished."""
    spots = {}
    for row in tier.rows:
        rate, cycle = row.scores.get("net_rate"), row.scores.get("cycle_time_s")
        if rate is not None and cycle is not None and np.isfinite([rate.value, cycle.value]).all():
            ends = [
                value if np.isfinite(value) else estimate.value
                for estimate in (cycle, rate)
                for value in (estimate.low, estimate.high)
            ]
            spots[row.policy] = (cycle.value, 100.0 * rate.value, ends[0], ends[1], 100.0 * ends[2], 100.0 * ends[3])
    if not spots:
        return EMPTY
    return both(lambda size: _pareto(tier, styles, spots, size))


Spot = tuple[float, float, float, float, float, float]


def _pareto(tier: Tier, styles: Styles, spots: Mapping[str, Spot], size: Size) -> Markup:
    shown = _without_outlier(spots)
    values = np.array(list(shown.values()))
    xs, ys = [*values[:, 2], *values[:, 3]], [*values[:, 4], *values[:, 5]]
    taken: list[Box] = []
    anchors: list[tuple[float, float, str]] = []
    frontier = None if tier.bound_words is None else tier.bound_words.frontier
    if frontier is not None and len(frontier):
        ys.append(100.0 * float(frontier[-1, 0]))
        xs.append(float(frontier[-1, 1]))
    x_pad, y_pad = (0.06 * max(max(v) - min(v), 1e-3 * abs(max(v)) + 1e-9) for v in (xs, ys))
    x = _across(size, max(min(xs) - x_pad, 0.0), max(xs) + x_pad)
    y = _up(size, max(min(ys) - y_pad, 0.0), min(max(ys) + y_pad, 101.0), tight=True)
    parts: list[Markup] = [frame(x, y, "cycle time, s  (shorter is better)", "net rate, %  (higher is better)")]
    clip = f"clip-{_slug(tier)}-{size.name}"
    if frontier is not None and len(frontier):
        box = _room_beyond(frontier, x, y)
        parts.append(_frontier(frontier, x, y, clip, box))
        taken += [] if box is None else [box]
    for policy, (cycle, rate, left, right, low, high) in shown.items():
        px, py = x(cycle), y(rate)
        style = styles[policy]
        tip = (
            f"{policy}\nnet rate {rate:.2f} %, {low:.2f} to {high:.2f}"
            f"\ncycle time {cycle:.2f} s, {left:.2f} to {right:.2f}"
        )
        cross = [
            tag("line", x1=x(left), x2=x(right), y1=py, y2=py),
            tag("line", x1=px, x2=px, y1=y(low), y2=y(high)),
        ]
        parts.append(
            series(policy, tip, tag("g", cross, _class="whisker", style=f"stroke:{style.css}"), marker(style, px, py))
        )
        taken += [
            Box(px - 8, py - 8, 16, 16),
            Box(x(left), py - 2, x(right) - x(left), 4),
            Box(px - 2, y(high), 4, y(low) - y(high)),
        ]
        anchors.append((px, py, policy))
    room = Box(LEFT + 2, TOP - 4, size.width - LEFT - RIGHT, size.height - TOP - BOTTOM)
    for (px, py, policy), (lx, ly, text, far) in zip(anchors, place_labels(anchors, taken, room), strict=True):
        line = None
        if far:
            width = 0.56 * 12.0 * len(text)
            near_x = min(max(px, lx), lx + width)
            line = tag("line", _class="leader", x1=px, y1=py, x2=near_x, y2=ly - 11.0 if ly > py else ly + 3.0)
        label = tag("text", text, _class="label", x=lx, y=ly)
        parts.insert(1, tag("g", line, _class="series under", data_policy=policy)) if line else None
        parts.append(tag("g", label, _class="series", data_policy=policy))
    for policy in spots.keys() - shown.keys():
        cycle, rate, *_ = spots[policy]
        note = f"{policy} lies outside: {rate:.1f} %, {cycle:.2f} s"
        parts.append(
            tag("text", note, _class="note", x=size.width - RIGHT, y=size.height - BOTTOM - 8.0, text_anchor="end")
        )
    inside = tag("rect", x=x.start, y=y.end, width=x.end - x.start, height=y.start - y.end)
    return chart(
        size,
        f"Net rate against cycle time, {tier.condition}",
        tag("clipPath", inside, id=clip),
        parts,
    )


def _without_outlier(spots: Mapping[str, Spot]) -> dict[str, Spot]:
    """All policies; random choice left out where it alone would press the others into a corner."""
    rest = {name: spot for name, spot in spots.items() if name != "random"}
    if len(rest) < 2 or len(rest) == len(spots):
        return dict(spots)
    far = 0.0
    for i in (0, 1):
        values = [spot[i] for spot in rest.values()]
        spread = max(max(values) - min(values), 1e-9)
        away = max(spots["random"][i] - max(values), min(values) - spots["random"][i])
        far = max(far, away / spread)
    return rest if far > 1.2 else dict(spots)


def _room_beyond(frontier: np.ndarray, x: Axis, y: Axis) -> Box | None:
    """Where a word fits beyond the bound: above its largest net rate, else left of its longest cycle."""
    top, right = y(100.0 * float(frontier[-1, 0])), x(float(frontier[-1, 1]))
    word = Box(x.start + 8.0, y.end + 4.0, text_width(BEYOND), 16.0)
    if top - y.end > 22.0:
        return word
    fits = right - x.start > word.width + 16.0 and y(100.0 * float(frontier[-2, 0])) - top > 24.0
    return Box(word.x, top + 5.0, word.width, word.height) if fits else None


def _frontier(frontier: np.ndarray, x: Axis, y: Axis, clip: str, box: Box | None) -> Markup:
    """The line that no policy crosses, and what lies beyond it; ``box`` is where a word about it has room."""
    rates, cycles = 100.0 * frontier[:, 0], frontier[:, 1]
    # A staircase: from each net rate on the cycle is at least so long, up to the largest net rate.
    line_x = [value for cycle in cycles for value in [x(float(cycle))] * 2] + [x.end]
    line_y = [y.start, *(value for rate in rates[1:] for value in [y(float(rate))] * 2), *[y(float(rates[-1]))] * 2]
    beyond = points([*line_x, x.end, x.start, x.start], [*line_y, y.end, y.end, y.start]) + "Z"
    tip = f"bound\nno policy reaches more than {rates[-1]:.2f} %\nnor that rate with a cycle under {cycles[-1]:.2f} s"
    drawn = [
        tag("path", _class="beyond", d=beyond, clip_path=f"url(#{clip})"),
        tag("path", _class="bound", d=points(line_x, line_y), clip_path=f"url(#{clip})"),
        tag("text", BEYOND, _class="note", x=box.x, y=box.y + 12.0) if box is not None else None,
    ]
    return series("bound", tip, drawn)


def cumulative(tier: Tier, styles: Styles) -> Markup:
    """Net rate against time, mean over the seeds; empty without curves."""
    return both(lambda size: _cumulative(tier, styles, size)) if tier.curves else EMPTY


def _cumulative(tier: Tier, styles: Styles, size: Size) -> Markup:
    longest = max(float(curve.time_s[-1]) for curve in tier.curves.values())
    unit, scale = ("min", 60.0) if longest > 300.0 else ("s", 1.0)
    top = max(100.0 * float(curve.high.max()) for curve in tier.curves.values())
    x = _across(size, 0.0, longest / scale)
    y = _up(size, 0.0, min(top * 1.02, 100.0))
    drawn = []
    for policy in _reference_last(tier, tier.curves):
        curve = tier.curves[policy]
        at = [x(float(value) / scale) for value in curve.time_s]
        rate, low, high = (
            [y(100.0 * float(value)) for value in values] for values in (curve.rate, curve.low, curve.high)
        )
        end, half = float(curve.rate[-1]), curve.seconds_to(0.5 * float(curve.rate[-1]))
        tip = f"{policy}\n{100.0 * end:.1f} % at the end, after {curve.end_s:.0f} s on average"
        tip += "" if half is None else f"\nhalf of it after {half:.0f} s"
        css = styles[policy].css
        band = tag("path", _class="band", d=points([*at, *at[::-1]], [*high, *low[::-1]]) + "Z", style=f"fill:{css}")
        line = tag("path", _class="curve", d=points(at, rate), style=f"stroke:{css}")
        drawn.append(series(policy, tip, band, tag("path", _class="hit", d=points(at, rate)), line))
    return chart(
        size,
        f"Net rate against time, {tier.condition}",
        frame(x, y, f"time, {unit}", "net rate so far, %"),
        drawn,
    )


def profile(tier: Tier, styles: Styles) -> Markup:
    """Share of the episodes that reach a net rate, over all net rates; empty below three episodes."""
    values = {name: np.array(list(own["net_rate"].values())) for name, own in tier.values.items()}
    values = {name: np.sort(own[np.isfinite(own)]) for name, own in values.items()}
    values = {name: own for name, own in values.items() if len(own) > 2}
    return both(lambda size: _profile(tier, styles, values, size)) if values else EMPTY


def _profile(tier: Tier, styles: Styles, values: Mapping[str, np.ndarray], size: Size) -> Markup:
    low = min(float(own[0]) for own in values.values())
    high = max(float(own[-1]) for own in values.values())
    pad = max(0.04 * (high - low), 0.002)
    x = _across(size, max(100.0 * (low - pad), 0.0), min(100.0 * (high + pad), 100.0))
    y = _up(size, 0.0, 100.0)
    drawn = []
    for policy in _reference_last(tier, values):
        own, n = values[policy], len(values[policy])
        tip = f"{policy}\nhalf of its {n} episodes reach {100.0 * float(np.median(own)):.1f} %"
        steps = (
            f"H{number(x(100.0 * float(value)), 1)}V{number(y(100.0 * (n - i) / n), 1)}"
            for i, value in enumerate(own, 1)
        )
        path, css = f"M{number(x.start, 1)} {number(y.end, 1)}" + "".join(steps), styles[policy].css
        line = tag("path", _class="curve", d=path, style=f"stroke:{css}")
        drawn.append(series(policy, tip, tag("path", _class="hit", d=path), line))
    return chart(
        size,
        f"Share of episodes that reach a net rate, {tier.condition}",
        frame(x, y, "net rate, %", "episodes that reach it, %"),
        drawn,
    )


def _reference_last(tier: Tier, there: Mapping[str, object]) -> list[str]:
    """The policies that are ``there``, the reference last, so that it lies on top."""
    names = [name for name in tier.policies if name in there]
    return sorted(names, key=lambda name: (name == tier.reference, name != "random"))


def _slug(tier: Tier) -> str:
    return "-".join("".join(c if c.isalnum() else " " for c in str(tier.condition)).lower().split())
