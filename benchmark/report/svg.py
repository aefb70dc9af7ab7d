"""Axes, markers and tooltips of the page's charts, as SVG that takes its colours from the page."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass

from .markup import Markup, join, number, tag
from .styles import Style


@dataclass(frozen=True)
class Size:
    """How large a chart is drawn; texts keep their size, so a phone gets a chart of its own.

    Attributes:
        name: CSS class that shows the chart where it fits.
        width: of the drawing, in pixels.
        height: of the drawing, in pixels.
    """

    name: str
    width: float
    height: float

    def ticks(self, wide: int, narrow: int) -> int:
        """How many ticks an axis across the chart has room for."""
        return wide if self.width > 400.0 else narrow


HALF = (Size("wide", 560.0, 380.0), Size("narrow", 350.0, 320.0))
"""Charts that stand two in a row."""


@dataclass(frozen=True)
class Axis:
    """A linear scale with round ticks.

    Attributes:
        low: value at the start.
        high: value at the end.
        start: coordinate of ``low``, in pixels.
        end: coordinate of ``high``, in pixels.
        ticks: values that are labelled.
        digits: decimals of the labels.
    """

    low: float
    high: float
    start: float
    end: float
    ticks: tuple[float, ...]
    digits: int

    def __call__(self, value: float) -> float:
        """Coordinate of ``value``."""
        return self.start + (value - self.low) / (self.high - self.low) * (self.end - self.start)

    def label(self, value: float) -> str:
        """A tick's text."""
        return f"{value + 0.0:.{self.digits}f}"


def axis(low: float, high: float, start: float, end: float, count: int = 5, tight: bool = False) -> Axis:
    """An axis over ``low`` ... ``high`` with about ``count`` round ticks.

    Args:
        low: smallest value that must be seen.
        high: largest.
        start: coordinate where the axis begins.
        end: coordinate where it ends.
        count: ticks wanted.
        tight: end the axis at the values and not at the next tick.
    """
    if not high > low:
        pad = abs(low) * 0.01 or 0.5
        low, high = low - pad, high + pad
    step = _round_step((high - low) / count)
    first, last = math.floor(low / step + 1e-9), math.ceil(high / step - 1e-9)
    if tight:
        inside = range(math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9) + 1)
    else:
        inside, low, high = range(first, last + 1), first * step, last * step
    digits = max(0, -math.floor(math.log10(step) + 1e-9))
    return Axis(low, high, start, end, tuple(i * step for i in inside), digits)


def _round_step(rough: float) -> float:
    power = 10.0 ** math.floor(math.log10(rough))
    return next(factor * power for factor in (1.0, 2.0, 5.0, 10.0) if factor * power >= rough * 0.8)


def frame(x: Axis, y: Axis, x_title: str, y_title: str) -> Markup:
    """Grid, tick labels and axis titles; the upper title stands over the axis, so that nothing is read sideways."""
    left, right, bottom, top = x.start, x.end, y.start, y.end
    parts = []
    for value in y.ticks:
        at = y(value)
        parts.append(tag("line", _class="grid", x1=left, x2=right, y1=at, y2=at))
        parts.append(tag("text", y.label(value), _class="tick", x=left - 8.0, y=at + 4.0, text_anchor="end"))
    for value in x.ticks:
        at = x(value)
        parts.append(tag("line", _class="tickmark", x1=at, x2=at, y1=bottom, y2=bottom + 5.0))
        parts.append(tag("text", x.label(value), _class="tick", x=at, y=bottom + 19.0, text_anchor="middle"))
    parts.append(tag("line", _class="axis", x1=left, x2=right, y1=bottom, y2=bottom))
    parts.append(tag("text", y_title, _class="title", x=0.0, y=top - 14.0))
    parts.append(tag("text", x_title, _class="title", x=right, y=bottom + 38.0, text_anchor="end"))
    return tag("g", parts, _class="frame")


def both(draw: Callable[[Size], Markup], sizes: tuple[Size, ...] = HALF) -> Markup:
    """A chart for a wide page and one for a phone."""
    return join(draw(size) for size in sizes)


def chart(size: Size, label: str, *children: object) -> Markup:
    """The whole drawing; ``label`` is what a screen reader says."""
    return tag(
        "svg",
        *children,
        _class=f"chart {size.name}",
        viewBox=f"0 0 {number(size.width)} {number(size.height)}",
        role="img",
        aria_label=label,
        preserveAspectRatio="xMinYMin meet",
    )


def points(xs: Iterable[float], ys: Iterable[float]) -> str:
    """Path through points."""
    return "M" + "L".join(f"{number(x, 1)} {number(y, 1)}" for x, y in zip(xs, ys, strict=True))


def marker(style: Style, x: float, y: float, radius: float = 5.5) -> Markup:
    """The policy's marker."""
    fill = f"fill:{style.css}"
    if style.shape == "circle":
        return tag("circle", _class="mark", cx=x, cy=y, r=radius, style=fill)
    return tag("path", _class="mark", d=_polygon(style.shape, x, y, radius), style=fill)


def _polygon(shape: str, x: float, y: float, r: float) -> str:
    corners = _CORNERS[shape]
    return points((x + r * dx for dx, _ in corners), (y + r * dy for _, dy in corners)) + "Z"


def _star() -> list[tuple[float, float]]:
    turns = [(1.5 if i % 2 == 0 else 0.68, math.pi * (i / 5.0 - 0.5)) for i in range(10)]
    return [(radius * math.cos(turn), radius * math.sin(turn)) for radius, turn in turns]


def _cross() -> list[tuple[float, float]]:
    corners = [(-0.42, -1.2), (0.42, -1.2), (0.42, -0.42)]
    for _ in range(3):
        corners += [(-y, x) for x, y in corners[-3:]]
    return corners


_CORNERS: dict[str, Sequence[tuple[float, float]]] = {
    "square": [(-0.9, -0.9), (0.9, -0.9), (0.9, 0.9), (-0.9, 0.9)],
    "diamond": [(0.0, -1.3), (1.3, 0.0), (0.0, 1.3), (-1.3, 0.0)],
    "up": [(0.0, -1.25), (1.15, 0.85), (-1.15, 0.85)],
    "down": [(0.0, 1.25), (1.15, -0.85), (-1.15, -0.85)],
    "right": [(1.25, 0.0), (-0.85, 1.15), (-0.85, -1.15)],
    "star": _star(),
    "cross": _cross(),
}
"""Corners of a marker of radius 1."""


def series(policy: str, tip: str, *children: object) -> Markup:
    """What belongs to a policy: it lights up with the policy's other marks, and tells ``tip`` when pointed at."""
    return tag("g", join(children), _class="series", data_policy=policy, data_tip=tip)


@dataclass(frozen=True)
class Box:
    """A rectangle that a label takes."""

    x: float
    y: float
    width: float
    height: float

    def overlap(self, other: Box) -> float:
        """Area in common, in square pixels."""
        across = min(self.x + self.width, other.x + other.width) - max(self.x, other.x)
        down = min(self.y + self.height, other.y + other.height) - max(self.y, other.y)
        return max(across, 0.0) * max(down, 0.0)

    def outside(self, other: Box) -> float:
        """Area that lies outside of ``other``."""
        return self.width * self.height - self.overlap(other)


def text_width(text: str, size: float = 12.0) -> float:
    """About how wide a text is, in pixels."""
    return 0.62 * size * len(text)


def place_labels(
    anchors: Sequence[tuple[float, float, str]], taken: Sequence[Box], room: Box
) -> list[tuple[float, float, str, bool]]:
    """Where labels of points go so that they cover little.

    Args:
        anchors: (x, y, text) of the points.
        taken: what must not be covered.
        room: where labels may be.

    Returns:
        A label: x of its start, y of its base line, text, and whether a line must join it to its point.
    """
    blocked, placed = list(taken), []
    for x, y, text in anchors:
        width, height = text_width(text), 14.0
        choices = []
        for distance in (10.0, 18.0, 30.0, 44.0, 60.0, 78.0):
            for angle in range(0, 360, 15):
                dx, dy = math.cos(math.radians(angle)), math.sin(math.radians(angle))
                middle_x = x + dx * (distance + 0.5 * width * abs(dx)) + (0.5 * width * 0.0)
                middle_y = y + dy * (distance + 0.5 * height * abs(dy))
                box = Box(middle_x - 0.5 * width, middle_y - 0.5 * height, width, height)
                cost = 6.0 * sum(box.overlap(other) for other in blocked) + 40.0 * box.outside(room)
                cost += 9.0 * distance + 12.0 * abs(dy) - 8.0 * dx
                choices.append((cost, box, distance))
        _, box, distance = min(choices, key=lambda item: item[0])
        blocked.append(box)
        placed.append((box.x, box.y + 11.0, text, distance > 18.0))
    return placed
