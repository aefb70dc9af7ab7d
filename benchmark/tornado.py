"""The tornado chart of a sensitivity study: a parameter a line, how far its ends move net rate and cycle time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from .assumptions.declared import Assumption, Dossier
from .report.markup import Markup, number, tag
from .report.svg import Axis, axis
from .sensitivity import Effect, Study
from .statistics import Difference

_WIDTH, _LABELS, _GAP, _MARGIN = 980.0, 380.0, 26.0, 14.0
_LINE, _TOP, _BOTTOM = 24.0, 58.0, 44.0
_COLOURS = {"low": "#2f6fb0", "high": "#d9822b"}
_INK, _QUIET, _GRID = "#1d2733", "#66717d", "#d9dee4"
_LONELY, _ROOM = 3.0, 1.4
_FONT = "font-family:Inter,Helvetica,Arial,sans-serif"


class Panel(NamedTuple):
    """One figure of the chart.

    Attributes:
        name: the score.
        title: with its unit.
        scale: factor from the score's unit to the shown one.
    """

    name: str
    title: str
    scale: float


PANELS = (Panel("net_rate", "net rate, points", 100.0), Panel("cycle_time_s", "cycle time, s", 1.0))


def ordered(dossier: Dossier, effects: Sequence[Effect]) -> list[Assumption]:
    """Assumptions by how far they move the net rate, those that move it alike by how far the cycle time."""
    reach: dict[str, tuple[float, ...]] = {}
    for effect in effects:
        own = tuple(abs(_finite(effect.differences[panel.name].value)) for panel in PANELS)
        reach[effect.name] = max(reach.get(effect.name, (0.0, 0.0)), (round(own[0], 4), own[1]))
    return sorted(dossier.assumptions, key=lambda item: tuple(-value for value in reach[item.name]))


def tornado(dossier: Dossier, study: Study) -> str:
    """The chart as a file of its own."""
    items = ordered(dossier, study.effects)
    height = _TOP + _LINE * len(items) + _BOTTOM
    width = (_WIDTH - _LABELS - _GAP - 2.0 * _MARGIN) / 2.0
    starts = [_LABELS + _MARGIN, _LABELS + _MARGIN + width + _GAP]
    effects = {(effect.name, effect.end): effect for effect in study.effects}
    axes = [_axis(panel, study.effects, start, start + width) for panel, start in zip(PANELS, starts, strict=True)]
    parts = [tag("rect", width=_WIDTH, height=height, fill="#ffffff")]
    for panel, x in zip(PANELS, axes, strict=True):
        parts += _frame(panel, x, height)
    for i, item in enumerate(items):
        y = _TOP + _LINE * (i + 0.5)
        ends = " ... ".join(end.text for end in item.ends.values())
        parts.append(_text(item.name, _LABELS, y - 1.0, size=12.0, anchor="end"))
        parts.append(_text(f"now {item.now}: {ends}", _LABELS, y + 9.0, size=8.5, anchor="end", colour=_QUIET))
        for panel, x in zip(PANELS, axes, strict=True):
            parts += [_bar(panel, x, effects[item.name, end], y) for end in item.ends]
    parts += _legend()
    name = dossier.env_id.rpartition("/")[2]
    drawing = tag(
        "svg",
        tag("title", f"Sensitivity of {name}, one assumption at a time"),
        parts,
        xmlns="http://www.w3.org/2000/svg",
        viewBox=f"0 0 {number(_WIDTH)} {number(height)}",
        role="img",
        style=_FONT,
    )
    return f"{drawing}\n"


def _finite(value: float) -> float:
    return value if math.isfinite(value) else 0.0


def _axis(panel: Panel, effects: Sequence[Effect], start: float, end: float) -> Axis:
    shown = np.array([_ends(effect.differences[panel.name]) for effect in effects]) * panel.scale
    reach: dict[str, float] = {}
    for effect, (value, _, _) in zip(effects, shown, strict=True):
        reach[effect.name] = max(reach.get(effect.name, 0.0), abs(value))
    far = sorted(reach.values(), reverse=True)
    # One parameter that would press all others together reaches beyond the axis and is told in figures.
    most = _ROOM * far[1] if len(far) > 2 and far[0] > _LONELY * far[1] > 0.0 else np.inf
    shown = np.clip(shown, -most, most)
    return axis(min(shown.min(), 0.0), max(shown.max(), 0.0), start, end, 5)


def _ends(item: Difference) -> tuple[float, float, float]:
    """Value and ends of the interval; what there is none of is the value."""
    value = _finite(item.value)
    low, high = (end if math.isfinite(end) else value for end in (item.low, item.high))
    return value, low, high


def _frame(panel: Panel, x: Axis, height: float) -> list[Markup]:
    bottom = height - _BOTTOM + 6.0
    parts = [_text(panel.title, 0.5 * (x.start + x.end), _TOP - 18.0, size=12.0, anchor="middle")]
    for value in x.ticks:
        at, ink = x(value), _INK if abs(value) < 1e-12 else _GRID
        parts.append(tag("line", x1=at, x2=at, y1=_TOP - 8.0, y2=bottom, stroke=ink))
        parts.append(_text(x.label(value), at, bottom + 15.0, size=10.0, anchor="middle", colour=_QUIET))
    return parts


def _bar(panel: Panel, x: Axis, effect: Effect, y: float) -> Markup:
    """A bar from no difference to the mean one, and its interval; the lower end's above, the upper end's below."""
    told = panel.scale * effect.differences[panel.name].value
    value, low, high = (
        min(max(x(panel.scale * part), x.start), x.end) for part in _ends(effect.differences[panel.name])
    )
    top, zero, colour = y - 9.0 if effect.end == "low" else y, x(0.0), _COLOURS[effect.end]
    middle = top + 4.5
    drawn = [
        tag("rect", x=min(value, zero), y=top, width=abs(value - zero), height=9.0, fill=colour),
        tag("line", x1=low, x2=high, y1=middle, y2=middle, stroke=_INK, stroke_width=1.2),
    ]
    if not x.low <= told <= x.high:
        at, anchor = (x.end - 3.0, "end") if told > 0.0 else (x.start + 3.0, "start")
        drawn.append(_text(f"{told:+.1f}", at, middle + 3.5, size=9.5, anchor=anchor, colour="#ffffff"))
    return tag("g", drawn)


def _legend() -> list[Markup]:
    parts: list[Markup] = []
    words: Mapping[str, str] = {"low": "first value", "high": "last value"}
    for i, (end, text) in enumerate(words.items()):
        x = _MARGIN + 96.0 * i
        parts.append(tag("rect", x=x, y=18.0, width=12.0, height=9.0, fill=_COLOURS[end]))
        parts.append(_text(text, x + 17.0, 26.0, size=11.0))
    return parts


def _text(words: str, x: float, y: float, size: float, anchor: str = "start", colour: str = _INK) -> Markup:
    return tag("text", words, x=x, y=y, font_size=size, text_anchor=anchor, fill=colour)
