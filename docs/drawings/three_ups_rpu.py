"""Draw the 3UPS-RPU platform with its named points into ``docs/mechanisms/three-ups-rpu.svg``.

Run: ``python docs/drawings/three_ups_rpu.py [FOLDER]``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from sheet import COLOURS, DOCS, Array, Sketch, folder_given, save

from fieldgym.mechanisms import ThreeUPSRPU

MARKERS = {"U": "s", "S": "o", "R": "D"}
BASE_JOINTS, PLATFORM_JOINTS = ("U", "U", "U", "R"), ("S", "S", "S", "U")


def plate(sketch: Sketch, centre: Array, rotation: Array, joints: Array, name: str) -> None:
    """The circle of a ring of joints and its frame."""
    sketch.circle(centre, float(np.linalg.norm(joints[0])), rotation, fill="0.85", color="0.45", lw=1.0)
    letters, length = ("XYZ", 0.16) if name == "O" else ("xyz", 0.11)
    for axis, letter in zip(rotation.T, letters, strict=True):
        sketch.arrow(centre, centre + length * axis, letter, reach=1.0 + 0.03 / length)
    sketch.name(centre, name, (-24.0, -13.0), style="italic")


def posed(axes: Axes, machine: ThreeUPSRPU, pose: list[float], title: str) -> None:
    """One layout at a pose, with the kind of every joint."""
    chains, sketch = machine.chains(pose), Sketch(axes, -68.0, 22.0)
    plate(sketch, np.zeros(3), np.eye(3), machine.attachments.base, "O")
    plate(sketch, chains.centre, chains.rotation, machine.attachments.platform, "o")
    for leg, colour in enumerate(COLOURS):
        ends = np.stack([chains.base[leg], chains.platform[leg]])
        middle = ends[0] + 0.55 * (ends[1] - ends[0])
        sketch.line(ends[0], middle, color=colour, lw=6.0, solid_capstyle="butt", alpha=0.55)
        sketch.line(*ends, color=colour, lw=2.2)
        sketch.name(ends[0] + 0.42 * (ends[1] - ends[0]), f"$l_{leg + 1}$", (24.0, 5.0), color=colour)
        for point, kind, letter in ((ends[0], BASE_JOINTS[leg], "A"), (ends[1], PLATFORM_JOINTS[leg], "B")):
            at = np.array(sketch.at(point))
            away = at - np.array(sketch.at(chains.centre if letter == "B" else np.zeros(3)))
            away *= 42.0 / np.linalg.norm(away)
            axes.plot(*at, MARKERS[kind], color="white", mec=colour, mew=1.8, ms=8.0, zorder=5)
            sketch.name(point, f"${letter}_{leg + 1}$", (float(away[0]), float(away[1])))
    # The revolute axis of the RPU leg, and the direction of its constraint couple.
    pivot, wrist = chains.base[3], chains.platform[3]
    along = np.array([0.0, 0.11, 0.0])
    sketch.line(pivot - along, pivot + along, color=COLOURS[3], lw=1.0, ls="-.")
    sketch.name(pivot - 1.3 * along, "$n_5$")
    couple = machine.jacobian(pose)[5, 3:]
    sketch.line(wrist, wrist + 0.17 * couple, color=COLOURS[3], lw=1.0, ls="-.")
    sketch.name(wrist + 0.20 * couple, "$n_6$")
    axes.set_title(title)


def draw(figure: Figure) -> None:
    """Both layouts at the same tilted pose."""
    left, right = figure.subplots(1, 2)
    pose = [0.04, 0.62, np.deg2rad(8.0), np.deg2rad(-10.0)]
    posed(left, ThreeUPSRPU.published(), pose, "published()")
    posed(right, ThreeUPSRPU.weeder(), pose, "weeder()")
    names = {"U": "universal", "S": "spherical", "R": "revolute about Y"}
    handles = [left.plot([], [], MARKERS[k], color="white", mec="0.3", mew=1.8, ms=8.0)[0] for k in names]
    figure.legend(handles, [f"{k}: {name}" for k, name in names.items()], loc="outside lower center", ncols=3)


def main(folder: Path) -> None:
    """Write the drawing."""
    save(draw, folder / "three-ups-rpu.svg", (11.0, 6.0), {"font.size": 10})


if __name__ == "__main__":
    main(folder_given(DOCS / "mechanisms"))
