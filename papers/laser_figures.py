"""Figures of the laser chapter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from ..mechanisms import ThreeUPSRPU
from ..mechanisms.three_ups_rpu import SINGULAR_VALUE
from .laser_model import Array, Curves

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

LEG_COLOURS = ("#c44e52", "#4c72b0", "#dd8452", "#55a868")
UNITS = (("length", "mm"), ("velocity", "mm/s"), ("acceleration", "mm/s²"))


def legs(canvas: Canvas, time: Array, exact: Curves, printed: Curves, panels: str, flat: Curves | None = None) -> None:
    """Three panels of Figure 5: solid lines for the exact orientation, dashed for the printed, dotted for Y_o = 0."""
    canvas.set_size_inches(10.0, 3.6)
    dots = flat or printed
    for axes, panel, (name, unit), solid, dashed, dotted in zip(
        _row(canvas), panels, UNITS, exact, printed, dots, strict=True
    ):
        for leg, colour in enumerate(LEG_COLOURS):
            # Leg 3 lies on leg 1 in case 1: thin over thick shows both.
            width = 3.2 if leg == 0 and np.allclose(solid[:, 0], solid[:, 2]) else 1.4
            axes.plot(time, solid[:, leg], color=colour, lw=width, label=f"leg {leg + 1}")
            axes.plot(time, dashed[:, leg], color=colour, lw=1.0, ls=(0, (4, 3)), alpha=0.9)
            if flat is not None:
                axes.plot(time, dotted[:, leg], color=colour, lw=1.0, ls=":", alpha=0.9)
        axes.set(title=f"({panel}) {name}", xlabel="t (s)", ylabel=f"{name} ({unit})", xlim=(0.0, time[-1]))
        if name == "acceleration":
            axes.axhline(0.0, color="0.4", lw=0.8)
    handles, labels = canvas.axes[0].get_legend_handles_labels()
    names = ["Ry Rx (exact)", "Rx Ry (printed)", "Rx Ry, Y_o = 0"][: 2 if flat is None else 3]
    for style, _ in zip(("-", "--", ":"), names, strict=False):
        handles += canvas.axes[0].plot([], [], style, color="0.3", lw=1.2)
    canvas.legend(handles, [*labels, *names], loc="outside lower center", ncols=7)


def differences(canvas: Canvas, time: Array, exact: Curves, printed: Curves) -> None:
    """What the printed orientation changes in case 2."""
    canvas.set_size_inches(10.0, 3.4)
    for axes, (name, unit), right, wrong in zip(_row(canvas), UNITS, exact, printed, strict=True):
        for leg, colour in enumerate(LEG_COLOURS):
            axes.plot(time, (wrong - right)[:, leg], color=colour, lw=1.6, label=f"leg {leg + 1}")
        axes.axhline(0.0, color="0.4", lw=0.8)
        axes.set(title=name, xlabel="t (s)", ylabel=f"printed - exact ({unit})", xlim=(0.0, time[-1]))
    canvas.legend(*canvas.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=4)


def singular_values(
    canvas: Canvas, time: Array, smallest: list[list[Array]], machines: tuple[ThreeUPSRPU, ThreeUPSRPU]
) -> None:
    """Smallest singular value along the cases and over a section of the weeding box."""
    canvas.set_size_inches(11.0, 3.6)
    left, middle, right = _row(canvas)
    names = ("published", "weeder()")
    for name, colour, (one, two) in zip(names, (LEG_COLOURS[0], LEG_COLOURS[3]), smallest, strict=True):
        left.semilogy(time, np.maximum(one, SINGULAR_VALUE), color=colour, label=f"{name}, case 1")
        left.semilogy(time, np.maximum(two, SINGULAR_VALUE), color=colour, ls="--", label=f"{name}, case 2")
    left.set(title="along the paper's motions", xlabel="t (s)", ylabel="smallest singular value", xlim=(0.0, time[-1]))
    left.text(0.4, 2.0 * SINGULAR_VALUE, "singular to rounding", color=LEG_COLOURS[0], fontsize=8)
    left.legend(loc="center right")
    x, beta = np.meshgrid(np.linspace(-0.1, 0.1, 81), np.deg2rad(np.linspace(-14.0, 14.0, 81)))
    poses = np.stack([x, np.full_like(x, 0.6), np.zeros_like(x), beta], axis=-1)
    style: dict[str, Any] = {"origin": "lower", "aspect": "auto", "vmin": 0.0, "vmax": 0.7, "interpolation": "bilinear"}
    filled = []
    for axes, name, machine in zip((middle, right), names, machines, strict=True):
        state = machine.singularity(poses)
        filled.append(axes.imshow(state.smallest, extent=(-100.0, 100.0, -14.0, 14.0), **style))
        axes.grid(visible=False)
        if state.determinant.min() < 0.0 < state.determinant.max():
            axes.contour(1e3 * x, np.rad2deg(beta), state.determinant, levels=[0.0], colors="#ff5a4f", linewidths=1.6)
            axes.text(8.0, 2.0, "det G = 0", color="#ff5a4f", fontweight="bold")
        axes.set(title=f"{name}, z = 600 mm, alpha = 0", xlabel="x (mm)", ylabel="beta (deg)")
    canvas.colorbar(filled[-1], ax=right, label="smallest singular value")


def null_twist(canvas: Canvas, machines: tuple[ThreeUPSRPU, ThreeUPSRPU]) -> None:
    """Leg lines of both layouts at home, seen from the side and from above."""
    canvas.set_size_inches(10.5, 6.2)
    panels = canvas.subplot_mosaic([["s0", "s1", "a0"], ["s0", "s1", "a1"]], width_ratios=(1.0, 1.0, 1.15))
    note = {"fontsize": 8, "bbox": {"facecolor": "white", "edgecolor": "none", "alpha": 0.9}, "va": "top"}
    for column, (machine, name) in enumerate(zip(machines, ("published", "weeder()"), strict=True)):
        chains = machine.chains(machine.home_pose)
        twist = machine.null_twist(machine.home_pose)
        side, above = panels[f"s{column}"], panels[f"a{column}"]
        for axes, i, j in ((side, 0, 2), (above, 0, 1)):
            for points in (chains.base, chains.platform):
                order = [*np.argsort(np.arctan2(points[:, 1], points[:, 0]))]
                order.append(order[0])
                axes.plot(1e3 * points[order, i], 1e3 * points[order, j], color="0.35", lw=1.2)
            for leg, colour in enumerate(LEG_COLOURS):
                base, platform = chains.base[leg], chains.platform[leg]
                # Leg 3 hides leg 1 in the side view: thin over thick shows both.
                width = 4.5 if leg == 0 and j == 2 else 2.2
                axes.plot(*_pair(base, base + 4.3 * (platform - base), i, j), color=colour, lw=0.9, ls=":")
                axes.plot(*_pair(base, platform, i, j), color=colour, lw=width, label=f"leg {leg + 1}")
            axes.set_aspect("equal")
            axes.set(xlabel="x (mm)", ylabel=f"{'xyz'[j]} (mm)")
        side.set(title=f"{name}: side view", xlim=(-650.0, 650.0), ylim=(-80.0, 2900.0))
        above.set(title=f"{name}: from above", xlim=(-450.0, 450.0), ylim=(-430.0, 430.0))
        smallest = float(machine.singularity(machine.home_pose).smallest)
        if np.isfinite(twist).all():
            # The axis of a turn about Y: where v + omega x d vanishes.
            pole = 1e3 * (chains.centre + np.cross(twist[3:], twist[:3]))
            side.plot(pole[0], pole[2], "o", color="k", ms=6)
            side.text(-620.0, 2850.0, f"null twist: a turn about the\nY-parallel at z = {pole[2]:.0f} mm", **note)
            swing, radius = np.linspace(-0.25, 0.25, 40), pole[2] - 1e3 * chains.centre[2]
            side.plot(pole[0] + radius * np.sin(swing), pole[2] - radius * np.cos(swing), color="k", lw=1.2)
        else:
            side.text(-620.0, 2850.0, f"no null twist: smallest\nsingular value {smallest:.2f}", **note)
    canvas.legend(*panels["a0"].get_legend_handles_labels(), loc="outside lower center", ncols=4)


def forces(canvas: Canvas, time: Array, forces: list[Array]) -> None:
    """Leg forces of both layouts in case 2."""
    canvas.set_size_inches(9.0, 3.6)
    left, right = canvas.subplots(1, 2)
    for axes, name, values in zip((left, right), ("published", "weeder()"), forces, strict=True):
        for leg, colour in enumerate(LEG_COLOURS):
            axes.plot(time, values[:, leg], color=colour, lw=1.6, label=f"leg {leg + 1}")
        axes.axhline(0.0, color="0.4", lw=0.8)
        axes.set(title=name, xlabel="t (s)", ylabel="leg force (N), pushing positive", xlim=(0.0, time[-1]))
    left.set_ylim(-1000.0, 1000.0)
    right.legend(ncols=2)


def _row(canvas: Canvas) -> list[Axes]:
    return list(canvas.subplots(1, 3))


def _pair(start: Array, end: Array, i: int, j: int) -> Array:
    """Two points (3,) as two rows of what is plotted: i across and j up, millimetres."""
    return 1e3 * np.stack([start, end], axis=-1)[[i, j]]
