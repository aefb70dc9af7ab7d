"""Draw the motion laws and the ways over a gate into ``docs/motion-laws.svg`` and ``docs/motion-gates.svg``.

Run: ``python docs/drawings/motion.py [FOLDER]``.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from fieldgym.kernels.files import replaced
from fieldgym.motion import MODIFIED_TRAPEZOID, QUINTIC, SEPTIC, Gate, SCurve, minimum_time, rounded

FOLDER = Path(__file__).resolve().parents[1]
VELOCITY, ACCELERATION, STROKE_M = 4.5, 60.0, 0.6
CORNERS = [[0.0, 0.0], [0.0, 0.15], [0.6, 0.15], [0.6, 0.0]]


def laws(canvas: Figure) -> None:
    """Position, velocity, acceleration and jerk of every law over one stroke under the same limits."""
    panels = canvas.subplots(2, 2).ravel()
    curves: dict[str, tuple[float, Callable]] = {}
    for law in (QUINTIC, SEPTIC, MODIFIED_TRAPEZOID):
        duration = float(law.duration(STROKE_M, VELOCITY, ACCELERATION))
        curves[law.name] = duration, lambda t, law=law, duration=duration: law.sample(t, STROKE_M, duration)
    for jerk, name in ((np.inf, "trapezoid (no jerk limit)"), (3000.0, "S-curve, 3000 m/s$^3$")):
        profile = SCurve.under_limits(STROKE_M, VELOCITY, ACCELERATION, jerk)
        curves[name] = float(profile.duration_s), profile.sample
    for name, (duration, sample) in curves.items():
        time = np.linspace(0.0, duration, 1201)
        for axes, values in zip(panels, sample(time), strict=True):
            axes.plot(time, values, lw=1.3, label=f"{name}, {duration:.3f} s")
    labels = ("position (m)", "velocity (m/s)", "acceleration (m/s$^2$)", "jerk (m/s$^3$)")
    for axes, label in zip(panels, labels, strict=True):
        axes.set(xlabel="time (s)", ylabel=label)
    handles, names = panels[0].get_legend_handles_labels()
    canvas.legend(handles, names, loc="outside lower center", ncols=2, fontsize=8)


def gates(canvas: Figure) -> None:
    """Paths over the gate, and the speed along them."""
    above, below = canvas.subplots(2, 1)
    motions = {
        "stop-quintic": Gate("stop-quintic", VELOCITY, ACCELERATION).motion(CORNERS[0], CORNERS[3], 0.15),
        "stop-fastest": Gate("stop-fastest", VELOCITY, ACCELERATION).motion(CORNERS[0], CORNERS[3], 0.15),
        "blended, straight_m = 0.05": Gate("blended", VELOCITY, ACCELERATION, 0.05).motion(
            CORNERS[0], CORNERS[3], 0.15
        ),
        "time-optimal, straight_m = 0.05": Gate("time-optimal", VELOCITY, ACCELERATION, 0.05).motion(
            CORNERS[0], CORNERS[3], 0.15
        ),
        "smooth corners, jerk 20000 m/s$^3$": minimum_time(
            rounded(CORNERS, 0.1, "smooth"), VELOCITY, ACCELERATION, 20_000.0
        ),
    }
    for name, motion in motions.items():
        time = np.linspace(0.0, motion.duration_s, 1201)
        state = motion.sample(time)
        above.plot(*(1e3 * state.position.T), lw=1.3)
        below.plot(time, np.linalg.norm(state.velocity, axis=-1), lw=1.3, label=f"{name}, {motion.duration_s:.3f} s")
    above.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    below.set(xlabel="time (s)", ylabel="speed (m/s)")
    canvas.legend(loc="outside lower center", ncols=2, fontsize=8)


def main(folder: Path = FOLDER) -> None:
    """Draw both."""
    style: dict[Any, Any] = {"svg.hashsalt": "fieldgym", "font.size": 9, "axes.grid": True, "grid.alpha": 0.3}
    for draw, name, size in ((laws, "motion-laws", (8.0, 6.2)), (gates, "motion-gates", (7.2, 6.0))):
        with rc_context(style):
            canvas = Figure(figsize=size, layout="constrained")
            FigureCanvasAgg(canvas)
            draw(canvas)
            with replaced(folder / f"{name}.svg") as partial:
                canvas.savefig(partial, format="svg", metadata={"Date": None})


if __name__ == "__main__":
    main(*(Path(argument) for argument in sys.argv[1:2]))
