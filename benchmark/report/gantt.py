"""What the machine did each second: where the time of a target goes, and one episode a policy as a Gantt chart."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from .episodes import Timeline
from .markup import EMPTY, Markup, number, tag
from .reader import Tier
from .styles import phase_kinds
from .svg import Axis, Size, axis, both, chart, series

Array = NDArray[np.float64]

FULL = (Size("wide", 1120.0, 0.0), Size("narrow", 350.0, 0.0))
"""Charts that take the whole width; their height follows from the number of policies."""
ROW = 40.0
NARROWEST = 2.0
"""Pixels below which stretches are not drawn one by one: where half of the time goes into shorter ones."""
COLUMN = 6.0
"""Pixels of a column that stands for the stretches in it."""
CLOSE_UP_DECISIONS = 160
"""Decisions of the close-up, beyond which a page would grow heavy."""
CLOSE_UP_WIDTH = 9000.0


def phases_of(tier: Tier) -> tuple[str, ...]:
    """Names of the phases that any policy spends time in."""
    names = dict.fromkeys(name for row in tier.rows for name in row.scores if name.startswith("phase_"))
    each = [name for name in names if name.endswith("_s_each")]
    return tuple(name.removeprefix("phase_").removesuffix("_s_each") for name in each)


def legend(phases: Sequence[str]) -> Markup:
    """Colour and name of every phase."""
    kinds = phase_kinds(phases)
    items = [
        tag("span", tag("i", style=f"background:var(--p-{kinds[name]})"), name.replace("_", " "), _class="key")
        for name in phases
    ]
    return tag("p", items, _class="keys")


def seconds_each(tier: Tier) -> Markup:
    """Mean seconds of a finished target in each phase, a bar a policy; empty when nobody finished one."""
    phases = phases_of(tier)
    bars = {}
    for row in tier.rows:
        values = [
            row.scores[f"phase_{name}_s_each"].value if f"phase_{name}_s_each" in row.scores else 0.0 for name in phases
        ]
        if np.isfinite(values).all() and sum(values) > 0.0:
            bars[row.policy] = values
    if not bars:
        return EMPTY
    return both(lambda size: _seconds_each(tier, phases, bars, size), FULL)


def _seconds_each(tier: Tier, phases: Sequence[str], bars: Mapping[str, Sequence[float]], size: Size) -> Markup:
    kinds = phase_kinds(phases)
    size = Size(size.name, size.width, ROW * len(bars) + 44.0)
    longest = max(sum(values) for values in bars.values())
    x = axis(0.0, longest, 0.0, size.width - 52.0, size.ticks(8, 4), tight=True)
    drawn = [_time_axis(x, size, "s a finished target")]
    for i, (policy, values) in enumerate(bars.items()):
        at, top, parts = 0.0, i * ROW, []
        for name, value in zip(phases, values, strict=True):
            if value > 0.0:
                wide = max(x(at + value) - x(at) - 1.0, 0.5)
                parts.append(
                    tag("rect", x=x(at), y=top + 18.0, width=wide, height=14.0, style=f"fill:var(--p-{kinds[name]})")
                )
                if wide > 34.0:
                    text, ink = f"{value:.{_digits(sum(values))}f}", f"fill:var(--t-{kinds[name]})"
                    parts.append(tag("text", text, _class="inbar", x=x(at) + 5.0, y=top + 29.0, style=ink))
                at += value
        tip = "\n".join(
            [policy, *(f"{name.replace('_', ' ')} {value:.2f} s" for name, value in zip(phases, values, strict=True))]
        )
        total = tag("text", f"{at:.{_digits(at)}f} s", _class="label", x=x(at) + 5.0, y=top + 29.5)
        drawn.append(series(policy, tip, tag("text", policy, _class="label", x=0.0, y=top + 12.0), parts, total))
    return chart(size, f"Seconds a finished target, {tier.condition}", drawn)


def _digits(total: float) -> int:
    return 1 if total >= 5.0 else 2


def _time_axis(x: Axis, size: Size, title: str) -> Markup:
    """Ticks under the bars, over the whole height."""
    bottom = size.height - 34.0
    parts = [tag("line", _class="grid", x1=x(value), x2=x(value), y1=0.0, y2=bottom) for value in x.ticks[1:]]
    parts += [_tick(x, value, x.label(value), bottom + 15.0) for value in x.ticks]
    parts.append(tag("text", title, _class="title", x=x.end, y=bottom + 30.0, text_anchor="end"))
    return tag("g", parts, _class="frame")


def _tick(x: Axis, value: float, text: str, y: float) -> Markup:
    return tag("text", text, _class="tick", x=x(value), y=y, text_anchor="middle" if value else "start")


def episode(tier: Tier) -> Markup:
    """One whole episode a policy on one scale; a narrow column holds the shares of its seconds. Empty without any."""
    if not tier.timelines:
        return EMPTY
    return both(lambda size: _episode(tier, size), FULL)


def _episode(tier: Tier, size: Size) -> Markup:
    timelines = list(tier.timelines.values())
    size = Size(size.name, size.width, ROW * len(timelines) + 44.0)
    longest = max(timeline.duration_s for timeline in timelines)
    unit, scale = ("min", 60.0) if longest > 300.0 else ("s", 1.0)
    x = axis(0.0, longest / scale, 0.0, size.width - 2.0, size.ticks(10, 5), tight=True)
    drawn = [_time_axis(x, size, f"time, {unit}")]
    pixels_s = (x.end - x.start) / longest
    for i, timeline in enumerate(timelines):
        top, words = i * ROW, _end_words(timeline)
        label = tag("text", timeline.policy, _class="label", x=0.0, y=top + 12.0)
        said = tag("text", words, _class="note", x=x.end, y=top + 12.0, text_anchor="end") if size.width > 400 else None
        bars = _bars(timeline, pixels_s, top + 18.0, 16.0)
        total = timeline.seconds.sum(axis=0)
        spent = [f"{name.replace('_', ' ')} {value:.0f} s" for name, value in zip(timeline.phases, total, strict=True)]
        tip = "\n".join([timeline.policy, words, *spent])
        drawn.append(series(timeline.policy, tip, label, said, bars))
    return chart(size, f"One episode a policy, {tier.condition}", drawn)


def _bars(timeline: Timeline, pixels_s: float, top: float, height: float) -> list[Markup]:
    """Every stretch of a phase; where they are too narrow to be seen, columns that hold the shares of their seconds."""
    stretches = np.sort(timeline.seconds.ravel()) * pixels_s
    usual = stretches[np.searchsorted(np.cumsum(stretches), 0.5 * stretches.sum())]
    if usual >= NARROWEST:
        return stretches_of(timeline, pixels_s, top, height, timeline.duration_s)
    kinds, shares = phase_kinds(timeline.phases), binned(timeline, COLUMN / pixels_s)
    stacked = np.cumsum(shares, axis=1)
    paths = [_columns(stacked[:, j] - shares[:, j], stacked[:, j], top, height) for j in range(len(kinds))]
    return [_filled(path, kinds[name]) for name, path in zip(timeline.phases, paths, strict=True) if path]


def _filled(path: str, kind: str) -> Markup:
    return tag("path", d=path, style=f"fill:var(--p-{kind})")


def stretches_of(timeline: Timeline, pixels_s: float, top: float, height: float, until_s: float) -> list[Markup]:
    """A path a phase, a rectangle every time that the machine is in it, up to a time."""
    kinds, paths = phase_kinds(timeline.phases), []
    starts = timeline.edges_s[:-1].reshape(timeline.seconds.shape)
    for j, name in enumerate(timeline.phases):
        parts = []
        for start, seconds in zip(starts[:, j], timeline.seconds[:, j], strict=True):
            if seconds > 1e-9 and start < until_s:
                # Ends rounded, not widths: a gap of a tenth of a pixel would show.
                x, end = (number(value * pixels_s, 1) for value in (start, min(start + seconds, until_s)))
                parts.append(f"M{x} {number(top, 1)}H{end}v{number(height, 1)}H{x}z")
        if parts:
            paths.append(_filled("".join(parts), kinds[name]))
    return paths


def _end_words(timeline: Timeline) -> str:
    damaged = f", {timeline.damaged[-1]:.0f} damaged" if timeline.damaged[-1] else ""
    return (
        f"{timeline.done[-1]:.0f} done{damaged}, {100.0 * timeline.net_rate[-1]:.1f} % in {timeline.duration_s:.0f} s"
    )


def _columns(low: Array, high: Array, top: float, height: float) -> str:
    """Path of columns from share ``low`` to ``high``; equal neighbours become one."""
    parts, i, n = [], 0, len(low)
    while i < n:
        j = i + 1
        while j < n and abs(low[j] - low[i]) < 0.02 and abs(high[j] - high[i]) < 0.02:
            j += 1
        if high[i] - low[i] > 0.02:
            x, width = number(i * COLUMN, 1), number((j - i) * COLUMN, 1)
            y, tall = number(top + height * (1.0 - high[i]), 1), number(height * (high[i] - low[i]), 1)
            parts.append(f"M{x} {y}h{width}v{tall}H{x}z")
        i = j
    return "".join(parts)


def binned(timeline: Timeline, width_s: float) -> Array:
    """Share of each phase in bins of time (bins, phases); a bin that is only partly covered sums to less than 1.

    Args:
        timeline: an episode.
        width_s: seconds of a bin.
    """
    edges = timeline.edges_s
    bins = int(np.ceil(edges[-1] / width_s - 1e-9))
    at = np.arange(bins + 1) * width_s
    shares = np.zeros((bins, len(timeline.phases)))
    for j in range(len(timeline.phases)):
        own = np.zeros_like(timeline.seconds)
        own[:, j] = timeline.seconds[:, j]
        shares[:, j] = np.diff(np.interp(at, edges, np.append(0.0, np.cumsum(own.ravel())))) / width_s
    return shares


def close_up(tier: Tier) -> Markup:
    """The beginning of the episode decision by decision, to be scrolled sideways; empty without any."""
    if not tier.timelines:
        return EMPTY
    first = tier.timelines.get(tier.reference) or next(iter(tier.timelines.values()))
    usual_s = float(np.median(first.seconds.sum(axis=1)[:CLOSE_UP_DECISIONS]))
    pixels_s = float(np.clip(110.0 / max(usual_s, 0.02), 4.0, 160.0))
    shown_s = min(
        max(timeline.duration_s for timeline in tier.timelines.values()),
        max(float(timeline.ends_s[:CLOSE_UP_DECISIONS][-1]) for timeline in tier.timelines.values()),
        CLOSE_UP_WIDTH / pixels_s,
    )
    rows = [_close_up_row(timeline, pixels_s, shown_s) for timeline in tier.timelines.values()]
    return tag(
        "div",
        tag("div", rows, _ruler(pixels_s, shown_s), _class="reel", style=f"width:{number(pixels_s * shown_s)}px"),
        _class="scroll",
        tabindex="0",
        role="region",
        aria_label="Decision by decision; scroll sideways",
    )


def _close_up_row(timeline: Timeline, pixels_s: float, shown_s: float) -> Markup:
    n = int(np.searchsorted(timeline.ends_s, shown_s)) + 1
    paths = stretches_of(timeline, pixels_s, 0.0, 20.0, shown_s)
    marks = _ends(timeline, n, pixels_s, shown_s)
    decisions = {
        "phases": list(timeline.phases),
        "began": round(timeline.began_s, 3),
        "scale": round(pixels_s, 4),
        "seconds": [[round(float(value), 2) for value in row] for row in timeline.seconds[:n]],
        "rate": [round(100.0 * float(value), 2) for value in timeline.net_rate[:n]],
        "words": list(timeline.words[:n]),
    }
    width = pixels_s * min(shown_s, timeline.duration_s)
    drawn = tag(
        "svg",
        paths,
        marks,
        _class="strip",
        width=number(pixels_s * shown_s),
        height="30",
        viewBox=f"0 0 {number(pixels_s * shown_s)} 30",
        data_width=number(width),
        data_decisions=json.dumps(decisions, separators=(",", ":")),
    )
    name = tag("span", timeline.policy, _class="pinned")
    return tag("div", name, drawn, _class="series row", data_policy=timeline.policy)


def _ends(timeline: Timeline, n: int, pixels_s: float, shown_s: float) -> Markup:
    """A tick under each decision that finished a target, a cross under one that damaged one."""
    gained, hurt = (np.diff(count, prepend=0.0) > 0.0 for count in (timeline.done, timeline.damaged))
    shown = timeline.ends_s <= shown_s
    shown[n:] = False
    marks = {
        "finished": (gained & ~hurt & shown, "M{} 23l3 6h-6z"),
        "harmed": (hurt & shown, "M{} 27m-3-3l6 6m0-6l-6 6"),
    }
    paths = {
        name: "".join(mark.format(number(end * pixels_s, 1)) for end in timeline.ends_s[which])
        for name, (which, mark) in marks.items()
    }
    return tag("g", [tag("path", _class=name, d=path) for name, path in paths.items() if path])


def _ruler(pixels_s: float, shown_s: float) -> Markup:
    x = axis(0.0, shown_s, 0.0, pixels_s * shown_s, max(int(pixels_s * shown_s / 90.0), 2), tight=True)
    parts = []
    for value in x.ticks:
        parts.append(tag("line", _class="tickmark", x1=x(value), x2=x(value), y1=0.0, y2=5.0))
        parts.append(_tick(x, value, f"{x.label(value)} s", 18.0))
    size = f"0 0 {number(x.end)} 24"
    return tag("svg", parts, _class="strip", width=number(x.end), height="24", viewBox=size)
