"""Figures of the safflower chapter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..mechanisms import FiveBar, PlanarWorkspace
from ..mechanisms.batching import Array

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure as Canvas

_COLOURS = {"dT1": "tab:blue", "dT2": "tab:orange", "dT": "tab:green"}


def drive_angle_error(delta: Array, table_mm: dict[str, Array], slopes: dict[str, float], canvas: Canvas) -> None:
    """Table 1 against the computed errors in both units."""
    axes = canvas.subplots()
    fine = np.linspace(0.0, delta[-1], 50)
    for name, printed in table_mm.items():
        axes.plot(delta, printed, "o", color=_COLOURS[name], label=f"{name}, printed")
        axes.plot(fine, 1e3 * slopes[name] * fine, "-", color=_COLOURS[name], label=f"{name}, five-bar, radians")
        axes.plot(fine, 1e3 * slopes[name] * np.deg2rad(fine), ":", color=_COLOURS[name], label=f"{name}, degrees")
    axes.set(xlabel="drive angle error (printed as degrees)", ylabel="tool error (mm)", xlim=(0, None), ylim=(0, None))
    axes.legend(ncols=1, fontsize=8)


def workspace(bar: FiveBar, region: PlanarWorkspace, triangle: Array, pose: Array, canvas: Canvas) -> None:
    """Reachable points, triangle and mechanism."""
    canvas.set_size_inches(6.4, 5.2)
    axes = canvas.subplots()
    points = 1e3 * region.points[:6000]
    axes.plot(points[:, 0], points[:, 1], ".", ms=1.2, color="tab:blue", alpha=0.45, rasterized=True)
    closed = 1e3 * np.vstack([triangle, triangle[:1]])
    axes.plot(closed[:, 0], closed[:, 1], "r-", lw=1.5, label="equilateral triangle, side 350 mm")
    _mechanism(bar, pose, axes)
    axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    axes.legend(loc="upper center", fontsize=8)


def singularities(bar: FiveBar, region: PlanarWorkspace, canvas: Canvas) -> None:
    """Loci of the three singularities over the plane."""
    canvas.set_size_inches(7.2, 5.2)
    axes = canvas.subplots()
    x, y = np.meshgrid(np.linspace(-0.06, 0.64, 351), np.linspace(-0.60, 0.16, 381))
    poses = np.stack([x, y], axis=-1)
    margins = bar.margins(poses)
    number = bar.conditioning(poses).number
    shown = axes.contourf(
        1e3 * x, 1e3 * y, np.clip(number, 1.0, 10.0), levels=np.linspace(1, 10, 19), cmap="viridis_r", extend="max"
    )
    canvas.colorbar(shown, ax=axes, label="condition number, joints to tool")
    style = {"levels": [0.0], "linewidths": 1.8}
    for leg, colour in ((1, "tab:red"), (2, "tab:orange")):
        reach = np.minimum(margins[f"leg{leg}_reach"], margins[f"leg{leg}_fold"])
        axes.contour(1e3 * x, 1e3 * y, reach, colors=colour, **style)
        axes.plot([], [], color=colour, label=f"leg {leg} straight or folded (serial)")
    crossing = margins["forearms"] + bar.min_forearm_angle_rad
    # Where the forearms pass one line their signed angle changes sign.
    axes.contour(1e3 * x, 1e3 * y, np.ma.masked_invalid(crossing), colors="magenta", **style)
    axes.plot([], [], color="magenta", label="forearms in one line (parallel)")
    outline = 1e3 * np.vstack([region.boundary, region.boundary[:1]])
    axes.plot(outline[:, 0], outline[:, 1], "w-", lw=1.5)
    axes.plot([0.0, 1e3 * bar.base_m], [0.0, 0.0], "k^", ms=8)
    axes.set(xlabel="x (mm)", ylabel="y (mm)", aspect="equal")
    canvas.legend(loc="outside lower center", ncols=3, fontsize=8)


def net_rate(collected_g: Array, total_g: Array, canvas: Canvas) -> None:
    """Table 2 as bars."""
    canvas.set_size_inches(6.0, 3.6)
    axes = canvas.subplots()
    rates = 100.0 * collected_g / total_g
    axes.bar(np.arange(1, 6), rates, color="tab:orange", alpha=0.8)
    axes.axhline(rates.mean(), color="k", label=f"mean of the groups {rates.mean():.2f} %")
    pooled = 100.0 * collected_g.sum() / total_g.sum()
    axes.axhline(pooled, color="k", ls="--", label=f"all filaments together {pooled:.2f} %")
    axes.set(xlabel="group", ylabel="net rate (%)", ylim=(84, 90.5))
    axes.legend(loc="upper left", fontsize=8)


def _mechanism(bar: FiveBar, pose: Array, axes: Axes) -> None:
    chains = bar.chains(pose)
    names = {"A": np.zeros(2), "B": chains.b, "C": chains.c, "D": chains.d, "E": chains.e}
    names["F"] = np.array([bar.base_m, 0.0])
    line = 1e3 * np.stack(list(names.values()))
    axes.plot(line[:, 0], line[:, 1], "k-o", lw=2, ms=4)
    middle = 0.5 * (chains.c + chains.d)
    stem = 1e3 * np.stack([middle, pose])
    axes.plot(stem[:, 0], stem[:, 1], "k-", lw=2)
    for name, point in {**names, "T": pose}.items():
        axes.annotate(name, tuple(1e3 * point), xytext=(5, 4), textcoords="offset points")
