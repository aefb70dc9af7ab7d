"""A blank drawing sheet: equal axes without a frame, saved as the same SVG for the same drawing."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fieldgym.kernels.files import replaced


def drawn(draw: Callable[[Axes], None], target: Path, size_inches: tuple[float, float]) -> None:
    """Let ``draw`` fill the sheet and write it to ``target``."""
    with rc_context({"svg.hashsalt": "fieldgym", "font.size": 11, "mathtext.fontset": "dejavusans"}):
        canvas = Figure(figsize=size_inches, layout="constrained")
        FigureCanvasAgg(canvas)
        axes = canvas.subplots()
        axes.set_aspect("equal")
        axes.axis("off")
        draw(axes)
        axes.autoscale_view()
        with replaced(target) as partial:
            canvas.savefig(partial, format="svg", metadata={"Date": None})
