"""Draw the 3UPS-RPU platform with its named points into ``docs/mechanisms/three-ups-rpu.svg``.

Run: ``python docs/drawings/three_ups_rpu.py [TARGET]``.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from matplotlib import rc_context
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray

from fieldgym.kernels.files import replaced
from fieldgym.mechanisms import ThreeUPSRPU

TARGET = Path(__file__).resolve().parents[1] / "mechanisms" / "three-ups-rpu.svg"
COLOURS = ("#c44e52", "#4c72b0", "#dd8452", "#55a868")
MARKERS = {"U": "s", "S": "o", "R": "D"}
BASE_JOINTS, PLATFORM_JOINTS = ("U", "U", "U", "R"), ("S", "S", "S", "U")

Array = NDArray[np.float64]


def view(points: Array, turn_deg: float = -68.0, tilt_deg: float = 22.0) -> tuple[Array, Array]:
    """Parallel projection of points (..., 3) to picture coordinates, millimetres."""
    turn, tilt = np.deg2rad([turn_deg, tilt_deg])
    right = np.array([-np.sin(turn), np.cos(turn), 0.0])
    up = np.array([-np.cos(turn) * np.sin(tilt), -np.sin(turn) * np.sin(tilt), np.cos(tilt)])
    return 1e3 * (points @ right), 1e3 * (points @ up)


def write(axes: Axes, point: Array, text: str, style: str = "normal") -> None:
    """A name centred on a point."""
    x, y = view(point)
    axes.text(float(x), float(y), text, ha="center", va="center", style=style)


def plate(axes: Axes, centre: Array, rotation: Array, joints: Array, name: str) -> None:
    """The circle of a ring of joints and its frame."""
    angles = np.linspace(0.0, 2.0 * np.pi, 121)
    radius = np.linalg.norm(joints[0])
    circle = centre + radius * np.stack([np.cos(angles), np.sin(angles), 0.0 * angles], axis=-1) @ rotation.T
    axes.fill(*view(circle), color="0.85", alpha=0.55, lw=0)
    axes.plot(*view(circle), color="0.45", lw=1.0)
    letters = ("X", "Y", "Z") if name == "O" else ("x", "y", "z")
    length = 0.16 if name == "O" else 0.11
    for axis, letter in zip(rotation.T, letters, strict=True):
        end = centre + length * axis
        (x0, x1), (y0, y1) = view(np.stack([centre, end]))
        axes.annotate("", (x1, y1), (x0, y0), arrowprops={"arrowstyle": "-|>", "color": "0.15", "lw": 1.1})
        write(axes, centre + (length + 0.03) * axis, letter, style="italic")
    x, y = view(centre)
    axes.text(float(x) - 14.0, float(y) - 22.0, name, ha="right", style="italic")


def posed(axes: Axes, machine: ThreeUPSRPU, pose: list[float], title: str) -> None:
    """One layout at a pose, with the kind of every joint."""
    chains = machine.chains(pose)
    plate(axes, np.zeros(3), np.eye(3), machine.attachments.base, "O")
    plate(axes, chains.centre, chains.rotation, machine.attachments.platform, "o")
    for leg, colour in enumerate(COLOURS):
        ends = np.stack([chains.base[leg], chains.platform[leg]])
        middle = ends[0] + 0.55 * (ends[1] - ends[0])
        axes.plot(*view(np.stack([ends[0], middle])), color=colour, lw=6.0, solid_capstyle="butt", alpha=0.55)
        axes.plot(*view(ends), color=colour, lw=2.2)
        x, y = view(ends[0] + 0.42 * (ends[1] - ends[0]))
        axes.text(float(x) + 16.0, float(y), f"$l_{leg + 1}$", color=colour)
        for point, kind, letter in ((ends[0], BASE_JOINTS[leg], "A"), (ends[1], PLATFORM_JOINTS[leg], "B")):
            x, y = (float(v) for v in view(point))
            away = np.array([x, y]) - np.array(view(chains.centre if letter == "B" else np.zeros(3)))
            away *= 42.0 / np.linalg.norm(away)
            axes.plot(x, y, MARKERS[kind], color="white", mec=colour, mew=1.8, ms=8.0, zorder=5)
            axes.text(x + away[0], y + away[1], f"${letter}_{leg + 1}$", ha="center", va="center", zorder=6)
    # The revolute axis of the RPU leg, and the direction of its constraint couple.
    pivot, wrist = chains.base[3], chains.platform[3]
    along = np.array([0.0, 0.11, 0.0])
    pin = np.stack([pivot - along, pivot + along])
    axes.plot(*view(pin), color=COLOURS[3], lw=1.0, ls="-.")
    write(axes, pin[0] - 0.3 * along, "$n_5$")
    couple = machine.jacobian(pose)[5, 3:]
    stick = np.stack([wrist, wrist + 0.17 * couple])
    axes.plot(*view(stick), color=COLOURS[3], lw=1.0, ls="-.")
    write(axes, wrist + 0.20 * couple, "$n_6$")
    axes.set_aspect("equal")
    axes.set_axis_off()
    axes.set_title(title)


def draw() -> Figure:
    """Both layouts at the same tilted pose."""
    figure = Figure(figsize=(11.0, 6.0), layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    pose = [0.04, 0.62, np.deg2rad(8.0), np.deg2rad(-10.0)]
    posed(left, ThreeUPSRPU.published(), pose, "published()")
    posed(right, ThreeUPSRPU.weeder(), pose, "weeder()")
    names = {"U": "universal", "S": "spherical", "R": "revolute about Y"}
    handles = [left.plot([], [], MARKERS[k], color="white", mec="0.3", mew=1.8, ms=8.0)[0] for k in names]
    figure.legend(handles, [f"{k}: {name}" for k, name in names.items()], loc="outside lower center", ncols=3)
    return figure


def main() -> None:
    """Write the drawing; the same input gives the same file."""
    target = Path(sys.argv[1]) if len(sys.argv) > 1 else TARGET
    with rc_context({"svg.hashsalt": "fieldgym", "font.size": 10}), replaced(target) as partial:
        draw().savefig(partial, format=target.suffix[1:], metadata={"Date": None} if target.suffix == ".svg" else None)


if __name__ == "__main__":
    main()
