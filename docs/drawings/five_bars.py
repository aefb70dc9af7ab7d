"""Draw both five-bars with their named points into ``docs/mechanisms/``.

Run: ``python docs/drawings/five_bars.py [FOLDER]``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray
from sheet import DOCS, folder_given, save_flat

from fieldgym.mechanisms import FiveBar, TranslationalFiveBar

ARM, FOREARM, PLATE = "#c44e52", "#4c72b0", "0.35"

Array = NDArray[np.float64]


def bar(axes: Axes, ends: list[Array], colour: str, name: str, aside: tuple[float, float] = (0.0, 0.0)) -> None:
    """A link with its name beside its middle; lengths in millimetres."""
    line = 1e3 * np.stack(ends)
    axes.plot(line[:, 0], line[:, 1], color=colour, lw=4.0, solid_capstyle="round", alpha=0.8)
    middle = line.mean(axis=0) + aside
    axes.text(float(middle[0]), float(middle[1]), name, color=colour, ha="center", va="center")


def joint(axes: Axes, point: Array, name: str, aside: tuple[float, float], motor: bool = False) -> None:
    """A joint and its letter; motors are larger."""
    x, y = 1e3 * point
    axes.plot(x, y, "o", ms=13 if motor else 8, mfc="0.85" if motor else "white", mec="k", mew=1.5, zorder=5)
    axes.text(x + aside[0], y + aside[1], name, ha="center", va="center", zorder=6)


def angle(axes: Axes, centre: Array, radius_mm: float, end_rad: float, name: str) -> None:
    """The joint angle from +x to an arm, drawn the way in which it is counted."""
    x, y = 1e3 * centre
    turn = np.linspace(0.0, end_rad, 60)
    axes.plot([x, x + 1.25 * radius_mm], [y, y], color="0.5", lw=0.8)
    axes.plot(x + radius_mm * np.cos(turn), y + radius_mm * np.sin(turn), color="0.5", lw=0.9)
    middle = 0.45 * end_rad
    axes.text(
        x + 1.3 * radius_mm * np.cos(middle), y + 1.3 * radius_mm * np.sin(middle), name, ha="center", va="center"
    )


def dimension(axes: Axes, start: tuple[float, float], end: tuple[float, float], name: str) -> None:
    """A double arrow with a name over its middle, millimetres."""
    axes.annotate("", end, start, arrowprops={"arrowstyle": "<->", "color": "0.4", "lw": 0.9})
    axes.update_datalim([start, end])
    axes.text(
        0.5 * (start[0] + end[0]),
        0.5 * (start[1] + end[1]),
        name,
        ha="center",
        va="center",
        color="0.25",
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0},
    )


def frame(axes: Axes, length_mm: float) -> None:
    """The coordinate axes at the origin."""
    for end, name in (((length_mm, 0.0), "x"), ((0.0, length_mm), "y")):
        axes.annotate("", end, (0.0, 0.0), arrowprops={"arrowstyle": "-|>", "color": "0.15", "lw": 1.0})
        axes.update_datalim([(0.0, 1.3 * length_mm)])
        axes.text(end[0] + 14.0, end[1] + 10.0, name, style="italic")


def safflower(axes: Axes) -> None:
    """The picker's five-bar with its reachable region."""
    machine = FiveBar.safflower()
    tool = np.array([0.250, -0.430])
    chains = machine.chains(tool)
    outline = 1e3 * machine.workspace("polar", samples=60_000).boundary
    axes.fill(outline[:, 0], outline[:, 1], color="#55a868", alpha=0.25, lw=0)
    a, f = np.zeros(2), np.array([machine.base_m, 0.0])
    frame(axes, 70.0)
    bar(axes, [a, chains.b], ARM, "$l_1$", (-24.0, 8.0))
    bar(axes, [f, chains.e], ARM, "$l_6$", (26.0, 0.0))
    bar(axes, [chains.b, chains.c], FOREARM, "$l_2$", (-12.0, -22.0))
    bar(axes, [chains.e, chains.d], FOREARM, "$l_5$", (20.0, -22.0))
    bar(axes, [chains.c, chains.d], PLATE, "")
    bar(axes, [0.5 * (chains.c + chains.d), tool], PLATE, "")
    for point, name, aside, motor in (
        (a, "A", (-26.0, 14.0), True),
        (f, "F", (26.0, 14.0), True),
        (chains.b, "B", (-20.0, -6.0), False),
        (chains.c, "C", (-18.0, 14.0), False),
        (chains.d, "D", (18.0, 14.0), False),
        (chains.e, "E", (20.0, -6.0), False),
    ):
        joint(axes, point, name, aside, motor)
    axes.plot(*(1e3 * tool), "k+", ms=12, mew=2)
    axes.text(1e3 * tool[0] + 14.0, 1e3 * tool[1] - 10.0, "T")
    angle(axes, a, 46.0, float(chains.q[0]), "$q_1$")
    angle(axes, f, 46.0, float(chains.q[1]), "$q_4$")
    left, right, level = 1e3 * chains.c[0], 1e3 * chains.d[0], 1e3 * tool[1]
    dimension(axes, (0.0, 100.0), (1e3 * machine.base_m, 100.0), "$l_7$")
    dimension(axes, (left, level - 45.0), (right, level - 45.0), "$2\\,l_3$")
    dimension(axes, (right + 60.0, 1e3 * chains.d[1]), (right + 60.0, level), "$l_4$")
    axes.text(290.0, -300.0, "reachable", ha="center", color="#2f6b3c", fontsize=8)


def transplanter(axes: Axes) -> None:
    """The transplanter's five-bar with its parallelogram chains and its window."""
    machine = TranslationalFiveBar.transplanter()
    tool = np.array([0.120, -0.600])
    pose = machine._pose(tool)
    (left, bottom), (right, top) = 1e3 * np.array(machine.window_m)
    axes.fill([left, right, right, left], [bottom, bottom, top, top], color="#55a868", alpha=0.25, lw=0)
    frame(axes, 80.0)
    for leg, (sign, aside) in enumerate(((1.0, (34.0, -18.0)), (-1.0, (-18.0, -30.0)))):
        motor = np.array([sign * machine.motor_offset_m, 0.0])
        # The parallel bars that keep the gripper upright run beside the links; how far aside does not matter.
        shift = np.array([0.0, 0.032])
        for ends in ([motor, pose.elbow[leg]], [pose.elbow[leg], pose.wrist[leg]]):
            line = 1e3 * (np.stack(ends) + shift)
            axes.plot(line[:, 0], line[:, 1], color="0.6", lw=1.2)
        bar(axes, [motor, pose.elbow[leg]], ARM, "$l_1$", (0.0, -26.0))
        bar(axes, [pose.elbow[leg], pose.wrist[leg]], FOREARM, "$l_2$", aside)
        joint(axes, motor, "", (0.0, 0.0), True)
        joint(axes, pose.elbow[leg], "", (0.0, 0.0))
        angle(axes, motor, 60.0, float(pose.arm[leg]), f"$\\theta_{leg + 1}$")
    joint(axes, tool, "", (0.0, 0.0))
    axes.text(1e3 * tool[0] + 26.0, 1e3 * tool[1] + 6.0, "r = (x, y)")
    for sign in (1.0, -1.0):
        dimension(axes, (0.0, 115.0), (sign * 1e3 * machine.motor_offset_m, 115.0), "e")
    dimension(axes, (left, bottom - 35.0), (right, bottom - 35.0), "600")
    dimension(axes, (right + 35.0, bottom), (right + 35.0, top), "150")


def main(folder: Path) -> None:
    """Draw both."""
    save_flat(safflower, folder / "five-bar.svg", (6.6, 6.0))
    save_flat(transplanter, folder / "translational-five-bar.svg", (7.2, 6.4))


if __name__ == "__main__":
    main(folder_given(DOCS / "mechanisms"))
