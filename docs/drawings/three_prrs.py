"""Draw the 3-PRRS platform with its named points into ``docs/mechanisms/three-prrs.svg``.

Run: ``python docs/drawings/three_prrs.py [FOLDER]``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from sheet import DOCS, Array, Sketch, folder_given, save

from fieldgym.mechanisms import ThreePRRS
from fieldgym.mechanisms.prrs_legs import RADIAL, TANGENTIAL
from fieldgym.mechanisms.rotations import rotation_from_euler

COLOURS = ("#c44e52", "#4c72b0", "#55a868")
UP = np.array([0.0, 0.0, 1.0])


def whole(axes: Axes, machine: ThreePRRS, pose: Array) -> None:
    """The machine at a pose."""
    sketch = Sketch(axes, -47.0, 26.0)
    chains, rotation = machine.chains(pose), rotation_from_euler(pose[3:])
    radius = 0.5 * machine.base_diameter_m
    sketch.circle(np.zeros(3), radius, np.eye(3), color="0.55", lw=1.0, ls="--")
    platform = chains.a @ np.stack([sketch.right, sketch.up], axis=-1) * 1e3
    axes.fill(*platform.T, color="0.85", alpha=0.8, lw=0)
    sketch.circle(pose[:3], machine.platform_radius_m, rotation, color="0.45", lw=1.0)
    for axis, letter in zip(np.eye(3), "XYZ", strict=True):
        sketch.arrow(np.zeros(3), 0.045 * axis, letter)
    for axis, letter in zip(rotation.T, "xyz", strict=True):
        sketch.arrow(pose[:3], pose[:3] + 0.028 * axis, letter, reach=1.2)
    sketch.name(np.zeros(3), "O", (-6.0, -5.0), style="italic")
    sketch.name(pose[:3], "P", (-5.0, -6.0), style="italic")
    for leg, colour in enumerate(COLOURS):
        outwards = RADIAL[:, leg]
        m, g, a = radius * outwards, chains.g[leg], chains.a[leg]
        sketch.line(m, g + 0.045 * UP, color="0.75", lw=5.0, solid_capstyle="round")
        sketch.line(m, g, color=colour, lw=1.0, ls=":")
        sketch.line(g - 0.018 * outwards, g + 0.030 * outwards, color=colour, lw=1.0, ls="-.")
        sketch.line(g - 0.022 * chains.u[leg], g + 0.022 * chains.u[leg], color=colour, lw=1.0, ls="-.")
        sketch.line(g, a, color=colour, lw=3.0, solid_capstyle="round")
        for point, marker in ((m, "x"), (g, "s"), (a, "o")):
            x, y = sketch.at(point)
            axes.plot(x, y, marker, color=colour if marker == "x" else "white", mec=colour, mew=1.8, ms=7.0, zorder=8)
        sketch.name(m, f"$M_{leg + 1}$", (0.0, -8.0))
        sketch.name(g, f"$G_{leg + 1}$", (-10.0 if leg else 9.0, 7.0))
        sketch.name(a, f"$a_{leg + 1}$", ((0.0, -9.0), (9.0, 3.0), (-8.0, 3.0))[leg])
        sketch.name(0.5 * (m + g), f"$L_{leg + 1}$", (8.0, 0.0), color=colour)
        sketch.name(0.5 * (a + g), "$l$", (6.0, 3.0), color=colour)
    axes.set_title("published()")


def leg(axes: Axes, machine: ThreePRRS, pose: Array) -> None:
    """Leg 1 alone: its driven angle, its free swing, and the cone of its spherical joint."""
    sketch = Sketch(axes, -30.0, 18.0)
    chains, normal = machine.chains(pose), rotation_from_euler(pose[3:])[:, 2]
    g, a, u = chains.g[0], chains.a[0], chains.u[0]
    outwards, sideways = RADIAL[:, 0], TANGENTIAL[:, 0]
    colour, upwards = COLOURS[0], np.cross(RADIAL[:, 0], u)
    sketch.line(g - 0.075 * UP, g + 0.03 * UP, color="0.8", lw=7.0, solid_capstyle="round")
    sketch.arrow(g, g + 0.05 * outwards, "R1, driven", "0.15", 1.32)
    sketch.line(g, g + 0.045 * sideways, color="0.6", lw=1.0, ls="--")
    sketch.arrow(g, g + 0.05 * u, "$u_1$ (R2)", colour, 1.22)
    sketch.arc(g, 0.034 * sideways, 0.034 * u, r"$\theta_1$", colour, 1.3)
    sketch.line(g, g - 0.07 * upwards, color="0.6", lw=1.0, ls="--")
    link = (a - g) / machine.link_m
    sketch.arc(g, -0.05 * upwards, 0.05 * link, r"$\psi_1$", colour, 1.18)
    sketch.line(g, a, color=colour, lw=3.5, solid_capstyle="round")
    sketch.name(g + 0.30 * (a - g), "$l$", (-4.0, 0.0), color=colour)
    edge = np.stack([a, pose[:3]])
    sketch.line(*edge, color="0.45", lw=1.5)
    sketch.arrow(a, a + 0.05 * normal, "$z$")
    sketch.arc(a, 0.03 * normal, -0.03 * link, r"$\leq\delta$", "0.15", 1.5)
    for point, marker, text, shift in ((g, "s", "$G_1$", (-9.0, 5.0)), (a, "o", "$a_1$", (6.0, -6.0))):
        x, y = sketch.at(point)
        axes.plot(x, y, marker, color="white", mec=colour, mew=1.8, ms=8.0, zorder=8)
        sketch.name(point, text, shift)
    sketch.name(pose[:3], "$P$", (-4.0, -3.0))
    axes.set_title("leg 1")


def draw(figure: Figure) -> None:
    """The whole machine and one leg at the same pose."""
    left, right = figure.subplots(1, 2)
    pose = np.array([0.008, -0.006, 0.075, np.deg2rad(12.0), np.deg2rad(-8.0), np.deg2rad(10.0)])
    whole(left, ThreePRRS.published(), pose)
    shifted = np.array([-0.016, 0.026, 0.075, np.deg2rad(5.0), np.deg2rad(-12.0), 0.0])
    leg(right, ThreePRRS.published(), shifted)
    names = {"x": "foot of the slider", "s": "R1 and R2 on the slider", "o": "spherical joint"}
    handles = [
        left.plot([], [], marker, color="0.3" if marker == "x" else "white", mec="0.3", mew=1.8, ms=7.0, ls="")[0]
        for marker in names
    ]
    figure.legend(handles, list(names.values()), loc="outside lower center", ncols=3)


def main(folder: Path) -> None:
    """Write the drawing."""
    save(draw, folder / "three-prrs.svg", (10.5, 6.0), {"font.size": 10})


if __name__ == "__main__":
    main(folder_given(DOCS / "mechanisms"))
