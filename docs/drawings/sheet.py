"""Drawing sheets: the same SVG for the same drawing, flat ones, and a projection of what stands in space."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fieldgym.kernels.files import replaced

DOCS = Path(__file__).resolve().parents[1]
COLOURS = ("#c44e52", "#4c72b0", "#dd8452", "#55a868")

Array = NDArray[np.float64]


def save(draw: Callable[[Figure], None], target: Path, size_inches: tuple[float, float], style: dict[Any, Any]) -> None:
    """Let ``draw`` fill a sheet and write it to ``target``; ``style`` has Matplotlib's names."""
    with rc_context({"svg.hashsalt": "fieldgym", **style}):
        canvas = Figure(figsize=size_inches, layout="constrained")
        FigureCanvasAgg(canvas)
        draw(canvas)
        with replaced(target) as partial:
            canvas.savefig(partial, format="svg", metadata={"Date": None})


def save_flat(draw: Callable[[Axes], None], target: Path, size_inches: tuple[float, float]) -> None:
    """``save`` a drawing on equal axes without a frame."""

    def fill(canvas: Figure) -> None:
        axes = canvas.subplots()
        axes.set_aspect("equal")
        axes.axis("off")
        draw(axes)
        axes.autoscale_view()

    save(fill, target, size_inches, {"font.size": 11, "mathtext.fontset": "dejavusans"})


def folder_given(usual: Path) -> Path:
    """The folder that the command line names, else the usual one."""
    return Path(sys.argv[1]) if len(sys.argv) > 1 else usual


class Sketch:
    """Parallel projection of points (..., 3) in metres onto axes in millimetres."""

    def __init__(self, axes: Axes, turn_deg: float, tilt_deg: float) -> None:
        """Look from an azimuth and a height."""
        turn, tilt = np.deg2rad([turn_deg, tilt_deg])
        self.axes = axes
        self.right = np.array([-np.sin(turn), np.cos(turn), 0.0])
        self.up = np.array([-np.cos(turn) * np.sin(tilt), -np.sin(turn) * np.sin(tilt), np.cos(tilt)])
        axes.set_aspect("equal")
        axes.set_axis_off()

    def at(self, points: Array) -> tuple[Array, Array]:
        """Picture coordinates of points."""
        return 1e3 * (points @ self.right), 1e3 * (points @ self.up)

    def line(self, *points: Array, **style: object) -> None:
        """A line through points."""
        self.axes.plot(*self.at(np.stack(points)), **style)  # type: ignore[arg-type]

    def name(self, point: Array, text: str, shift: tuple[float, float] = (0.0, 0.0), **style: object) -> None:
        """A text beside a point, shifted in millimetres of the picture."""
        x, y = self.at(point)
        place = (float(x) + shift[0], float(y) + shift[1])
        self.axes.text(*place, text, ha="center", va="center", zorder=9, **style)  # type: ignore[arg-type]

    def arrow(self, start: Array, end: Array, text: str, colour: str = "0.15", reach: float = 1.15) -> None:
        """An arrow with its name beyond the tip."""
        (x0, x1), (y0, y1) = self.at(np.stack([start, end]))
        self.axes.annotate("", (x1, y1), (x0, y0), arrowprops={"arrowstyle": "-|>", "color": colour, "lw": 1.1})
        # An annotation does not widen the picture; a point that is not drawn does.
        tip_x, tip_y = self.at(start + reach * (end - start))
        self.axes.plot(tip_x, tip_y, ls="")
        self.name(start + reach * (end - start), text, style="italic", color=colour)

    def arc(self, centre: Array, start: Array, end: Array, text: str, colour: str, reach: float = 1.3) -> None:
        """The smaller arc between two arms of equal length about a centre."""
        share = np.linspace(0.0, 1.0, 30)[:, None]
        between = (1.0 - share) * start + share * end
        between *= np.linalg.norm(start) / np.linalg.norm(between, axis=-1, keepdims=True)
        self.axes.plot(*self.at(centre + between), color=colour, lw=1.1)
        self.name(centre + reach * between[15], text, color=colour)

    def circle(self, centre: Array, radius: float, rotation: Array, fill: str | None = None, **style: object) -> None:
        """A circle in a plane given by a rotation, over a disc of a colour where one is given."""
        angles = np.linspace(0.0, 2.0 * np.pi, 121)
        points = radius * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=-1)
        ring = self.at(centre + points @ rotation.T)
        if fill is not None:
            self.axes.fill(*ring, color=fill, alpha=0.55, lw=0)
        self.axes.plot(*ring, **style)  # type: ignore[arg-type]
