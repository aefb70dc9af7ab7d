"""A picture of a field for people: what stands where, kinds by colour, names by marker, the machine's window dashed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from math import ceil, sqrt
from os import PathLike
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..kernels.files import replaced
from .field import Field, Table

WIDTH_IN = 12.0
COLOURS = ("#2747b8", "#e8641f", "#057b69", "#9058b7", "#0a93e6", "#840f5b", "#6b5500")
MARKERS = "osD^vPX*"
CELLS = ("#e4e7ea", "#057b69", "#e8641f", "#2747b8", "#9058b7", "#0a93e6", "#840f5b", "#6b5500")
REPORTED = "report"
GRID = ("column", "row")
"""Axes of tables that count cells instead of measuring places."""
INK, QUIET, FAINT = "#1c2127", "#59626d", "#e4e7ea"
_TALLEST_IN, _LOWEST_IN = 6.0, 1.1
_LARGEST_CELL_IN = 0.45
_MOST_ROWS = 12

Window = Mapping[str, tuple[float, float]]


class _Group(NamedTuple):
    """Rows of a kind that look alike, how they are drawn, and whether the window holds for them."""

    name: str
    table: Table
    rows: NDArray[np.bool_]
    colour: str
    marker: str
    hollow: bool
    held: bool


def picture(field: Field, path: str | PathLike[str], title: str = "", window: Window | None = None) -> None:
    """Write a picture of a field.

    Long fields are cut into stretches below one another, seen from above; a field with heights is shown from the side
    too. What cameras report, kinds whose name begins with ``report``, is hollow.

    Args:
        field: complete or not.
        path: of the picture; its ending says the format.
        title: above it.
        window: by column, the range that is marked; rows of the main kind outside of it are ringed.

    Raises:
        ImportError: matplotlib is missing.
        OSError: the picture cannot be written.
        ValueError: the format is unknown.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    window = window or {}
    groups = _groups(field)
    with rc_context({"font.size": 9, "axes.edgecolor": QUIET, "xtick.color": QUIET, "ytick.color": QUIET}):
        figure = Figure(figsize=(WIDTH_IN, 6.0), layout="constrained", facecolor="white")
        FigureCanvasAgg(figure)
        views = _views(field, groups)
        if views:
            _draw_places(figure, field, groups, views, window)
        else:
            _draw_cells(figure, field, groups)
        handles = [_handle(group, bool(views)) for group in groups if group.rows.any()]
        if handles:
            figure.legend(handles=handles, loc="outside lower center", ncols=min(len(handles), 6), frameon=False)
        counts = ", ".join(f"{len(table)} {kind}" for kind, table in field.tables())
        figure.suptitle(f"{title or field.task}: {counts}", color=INK, fontsize=11)
        with replaced(Path(path)) as drawn:
            figure.savefig(drawn, dpi=110)


def _groups(field: Field) -> list[_Group]:
    groups = []
    for colour, (kind, table) in zip(_repeated(COLOURS), field.tables(), strict=False):
        if not any(name in table.columns() for name in (*field.places[1:], *GRID)):
            continue
        hollow, held = kind.startswith(REPORTED), kind == field.main
        named = next(((name, column) for name, column in table.columns().items() if column.labels), None)
        if named is None:
            groups.append(_Group(kind, table, np.ones(len(table), bool), colour, MARKERS[0], hollow, held))
            continue
        values = getattr(table, named[0])
        shades = _shades(colour, 1 if hollow else len(named[1].labels)) * len(named[1].labels)
        for value, (name, marker) in enumerate(zip(named[1].labels, _repeated(MARKERS), strict=False)):
            groups.append(_Group(f"{kind}: {name}", table, values == value, shades[value], marker, hollow, held))
    return groups


def _shades(colour: str, count: int) -> list[str]:
    """From a colour towards white, in ``count`` steps."""
    parts = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)])
    steps = np.linspace(0.0, 0.7, count)[:, None]
    return ["#" + bytes(shade).hex() for shade in np.rint(parts + steps * (255 - parts)).astype(int).tolist()]


def _repeated(items: Sequence[str]) -> list[str]:
    return list(items) * 8


def _views(field: Field, groups: Sequence[_Group]) -> list[tuple[str, str]]:
    """Pairs of columns that are seen against each other: from above, and from the side where there are heights."""
    along, *others = field.places if field.places else ("",)
    return [(along, name) for name in others if any({along, name} <= set(group.table.columns()) for group in groups)]


def _draw_places(
    figure: Any, field: Field, groups: Sequence[_Group], views: Sequence[tuple[str, str]], window: Window
) -> None:
    units = {name: column.unit for table in field.kinds().values() for name, column in table.columns().items()}
    spans = [(_span(groups, x, window, 0.02), _span(groups, y, window, 0.1)) for x, y in views]
    stretches, heights = [], []
    for (x, y), ((left, right), (low, high)) in zip(views, spans, strict=True):
        ratio = (right - left) / (high - low) if units[x] == units[y] else WIDTH_IN / 3.0
        rows = min(max(1, round(sqrt(0.5 * ratio / len(views)))), _MOST_ROWS) if units[x] == units[y] else 1
        stretches.append(rows)
        heights += [min(max(WIDTH_IN * rows / ratio, _LOWEST_IN), _TALLEST_IN / len(views))] * rows
    figure.set_size_inches(WIDTH_IN, sum(heights) + 0.45 * len(heights) + 0.9)
    axes = figure.subplots(len(heights), 1, squeeze=False, gridspec_kw={"height_ratios": heights})[:, 0]
    first = 0
    for (x, y), ((left, right), limits), rows in zip(views, spans, stretches, strict=True):
        edges = np.linspace(left, right, rows + 1)
        for row, ax in enumerate(axes[first : first + rows]):
            margin = 0.01 * (edges[1] - edges[0])
            ax.set_xlim(edges[row] - margin, edges[row + 1] + margin)
            ax.set_ylim(*limits)
            if units[x] == units[y]:
                ax.set_aspect("equal", adjustable="box")
            _mark(ax, groups, x, y, window)
            ax.set_ylabel(_axis(y, units[y]))
        axes[first + rows - 1].set_xlabel(_axis(x, units[x]))
        first += rows


def _mark(ax: Any, groups: Sequence[_Group], x: str, y: str, window: Window) -> None:
    ax.grid(color=FAINT, linewidth=0.6)
    ax.set_axisbelow(True)
    for name, line in ((x, ax.axvline), (y, ax.axhline)):
        for bound in window.get(name, ()):
            line(bound, color=QUIET, linewidth=1.0, linestyle=(0, (4, 3)))
    for group in groups:
        if not {x, y} <= set(group.table.columns()):
            continue
        across, up = getattr(group.table, x)[group.rows], getattr(group.table, y)[group.rows]
        ax.scatter(across, up, **_look(group))
        outside = np.zeros(len(across), bool)
        for name, values in ((x, across), (y, up)):
            low, high = window.get(name, (-np.inf, np.inf))
            outside |= (values < low) | (values > high)
        if group.held:
            ax.scatter(across[outside], up[outside], s=140, facecolors="none", edgecolors="#c0182a", linewidths=1.5)


def _draw_cells(figure: Any, field: Field, groups: Sequence[_Group]) -> None:
    """Tables of cells, side by side, the first row at the top."""
    tables = [(kind, table) for kind, table in field.tables() if set(GRID) <= set(table.columns())]
    if not tables:
        return
    rows = [int(table.row.max(initial=0)) + 1 for _, table in tables]  # type: ignore[attr-defined]
    columns = [int(table.column.max(initial=0)) + 1 for _, table in tables]  # type: ignore[attr-defined]
    cell_in = min(_LARGEST_CELL_IN, 1.3 * _TALLEST_IN / max(rows), WIDTH_IN / (sum(columns) + 4 * len(columns)))
    figure.set_size_inches(WIDTH_IN, max(3.0, cell_in * max(rows) + 1.6))
    axes = figure.subplots(1, len(tables), squeeze=False, width_ratios=columns)[0]
    for ax, (kind, table), height, width in zip(axes, tables, rows, columns, strict=True):
        ax.set_title(kind, color=INK)
        ax.set_xlim(-0.5, width - 0.5)
        ax.set_ylim(height - 0.5, -0.5)
        ax.set_aspect("equal")
        ax.set_xlabel("column")
        ax.set_ylabel("row")
        step = max(1, ceil(max(rows) / 20))
        ax.set_xticks(range(0, width, step))
        ax.set_yticks(range(0, height, step))
        size = (72.0 * cell_in * 0.62) ** 2
        for group in groups:
            if group.table is table:
                look = {"s": size, "marker": group.marker, "facecolors": _cell_colour(group), "edgecolors": QUIET}
                ax.scatter(table.column[group.rows], table.row[group.rows], linewidths=0.5, **look)  # type: ignore[attr-defined]


def _cell_colour(group: _Group) -> str:
    return CELLS[MARKERS.index(group.marker)]


def _look(group: _Group) -> dict[str, Any]:
    if group.hollow:
        return {"s": 60, "marker": group.marker, "facecolors": "none", "edgecolors": group.colour, "linewidths": 1.0}
    return {"s": 30, "marker": group.marker, "facecolors": group.colour, "edgecolors": INK, "linewidths": 0.5}


def _handle(group: _Group, measured: bool) -> Any:
    from matplotlib.lines import Line2D

    hollow, colour = group.hollow and measured, group.colour if measured else _cell_colour(group)
    return Line2D(
        [],
        [],
        linestyle="",
        marker=group.marker,
        markeredgecolor=colour if hollow else INK,
        markeredgewidth=0.5,
        markerfacecolor="none" if hollow else colour,
        label=f"{group.name} ({int(group.rows.sum())})",
    )


def _span(groups: Sequence[_Group], name: str, window: Window, margin: float) -> tuple[float, float]:
    """The range of a column over what is there and the window, and a margin, a share of it."""
    parts = [getattr(group.table, name)[group.rows] for group in groups if name in group.table.columns()]
    values = np.concatenate([*parts, np.asarray(window.get(name, ()), float)])
    values = values[np.isfinite(values)]
    if not len(values):
        return 0.0, 1.0
    low, high = float(values.min()), float(values.max())
    room = margin * (high - low) or 0.05
    return low - room, high + room


def _axis(name: str, unit: str) -> str:
    words = name.removesuffix("_" + unit.replace("/", "_")) if unit else name
    return f"{words.replace('_', ' ')}, {unit}" if unit else words
