"""Draw the motion laws and the ways over a gate into ``docs/motion-laws.svg`` and ``docs/motion-gates.svg``.

Run: ``python docs/drawings/motion.py [FOLDER]``.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from sheet import DOCS, folder_given, save

from fieldgym.motion import (
    MODIFIED_TRAPEZOID,
    QUINTIC,
    SEPTIC,
    Gate,
    PathMotion,
    SCurve,
    StoppedPath,
    minimum_time,
    rounded,
)

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
    gates = {
        "stop-quintic": Gate("stop-quintic", VELOCITY, ACCELERATION),
        "stop-fastest": Gate("stop-fastest", VELOCITY, ACCELERATION),
        "blended, straight_m = 0.05": Gate("blended", VELOCITY, ACCELERATION, 0.05),
        "time-optimal, straight_m = 0.05": Gate("time-optimal", VELOCITY, ACCELERATION, 0.05),
    }
    motions: dict[str, StoppedPath | PathMotion] = {
        name: gate.motion(CORNERS[0], CORNERS[3], 0.15) for name, gate in gates.items()
    }
    smooth = minimum_time(rounded(CORNERS, 0.1, "smooth"), VELOCITY, ACCELERATION, 20_000.0)
    motions["smooth corners, jerk 20000 m/s$^3$"] = smooth
    for name, motion in motions.items():
        time = np.linspace(0.0, motion.duration_s, 1201)
        state = motion.sample(time)
        above.plot(*(1e3 * state.position.T), lw=1.3)
        below.plot(time, np.linalg.norm(state.velocity, axis=-1), lw=1.3, label=f"{name}, {motion.duration_s:.3f} s")
    above.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    below.set(xlabel="time (s)", ylabel="speed (m/s)")
    canvas.legend(loc="outside lower center", ncols=2, fontsize=8)


def main(folder: Path) -> None:
    """Draw both."""
    for draw, name, size in ((laws, "motion-laws", (8.0, 6.2)), (gates, "motion-gates", (7.2, 6.0))):
        save(draw, folder / f"{name}.svg", size, {"font.size": 9, "axes.grid": True, "grid.alpha": 0.3})


if __name__ == "__main__":
    main(folder_given(DOCS))
