"""Figures of the 3-PRRS chapter: sections, solid views, volume surfaces."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ..mechanisms import ThreePRRS
from ..mechanisms.batching import Array
from ..mechanisms.spatial_workspace import Section, grid_section, spatial_extent
from ..mechanisms.studies import ParameterStudy

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Canvas

_PLANES = ((2, "x", "y"), (0, "y", "z"), (1, "x", "z"))
"""Normal axis of the sections and the names of the two axes that are left."""

_LEVELS = {2: 9, 0: 7, 1: 7}


def workspace(canvas: Canvas, machine: ThreePRRS, orientation: tuple[float, float, float]) -> None:
    """Sections perpendicular to Z, X and Y, and the solid (paper Figs 3 and 4)."""
    canvas.set_size_inches(8.4, 7.6)
    reachable = machine.reachable_at(orientation)
    lower, upper = spatial_extent(reachable, *machine.box(orientation))
    for place, (axis, across, up) in enumerate(_PLANES):
        axes = canvas.add_subplot(2, 2, place + 1)
        inset = 0.04 * (upper[axis] - lower[axis])
        levels = np.linspace(lower[axis] + inset, upper[axis] - inset, _LEVELS[axis])
        sections = [grid_section(reachable, lower, upper, axis, float(level), 160) for level in levels]
        _draw_sections(canvas, axes, sections, "xyz"[axis])
        axes.set(xlabel=f"{across} / mm", ylabel=f"{up} / mm", aspect="equal")
        axes.set_title(f"perpendicular to {'XYZ'[axis]}", fontsize=9)
    solid = canvas.add_subplot(2, 2, 4, projection="3d")
    _draw_solid(solid, machine, orientation, lower, upper)


def influence(canvas: Canvas, studies: Mapping[str, ParameterStudy], peaks: Mapping[str, tuple[float, float]]) -> None:
    """Volume surfaces over two dimensions at a time, with the computed maximum and the paper's peak (Fig. 5)."""
    canvas.set_size_inches(11.0, 8.2)
    for place, (title, study) in enumerate(studies.items()):
        peak = peaks[title]
        first, second = title.split(" over ")[1].split(",")[0].split(" and ")
        axes = canvas.add_subplot(2, 3, place + 1, projection="3d", computed_zorder=False)
        a, b = np.meshgrid(study.first, study.second, indexing="ij")
        axes.plot_surface(a, b, study.values, cmap="viridis", rcount=60, ccount=60, linewidth=0.1, edgecolor="w")
        top = float(np.nanmax(study.values))
        summit = np.argwhere(study.summit)
        x, y = study.first[summit[:, 0]], study.second[summit[:, 1]]
        axes.plot(x, y, np.full(len(summit), top), "o-", c="C3", ms=4, zorder=5)
        i, j = (int(np.argmin(np.abs(axis - at))) for axis, at in zip((study.first, study.second), peak, strict=True))
        claimed = float(np.nan_to_num(study.values[i, j]))
        axes.plot([peak[0]] * 2, [peak[1]] * 2, [0.0, claimed], ":", c="k", zorder=5)
        axes.plot([peak[0]], [peak[1]], [claimed], "x", c="k", ms=8, mew=2, zorder=6)
        axes.set(xlabel=f"{first} / mm", ylabel=f"{second} / mm")
        axes.set_title(title, fontsize=9)
        axes.view_init(28, -125)


def clearance(canvas: Canvas, whole: Section, torn: Section) -> None:
    """One level section under the two readings of the clearance."""
    canvas.set_size_inches(7.6, 3.9)
    titles = (f"segments, {1e6 * whole.area_m2:.0f} mm²", f"infinite lines, {1e6 * torn.area_m2:.0f} mm²")
    for place, (section, title) in enumerate(zip((whole, torn), titles, strict=True)):
        axes = canvas.add_subplot(1, 2, place + 1)
        for outline in section.outlines:
            axes.fill(*(1e3 * outline.T), fc="#9ecae1", ec="C0", lw=1.2)
        for hole in section.holes:
            axes.fill(*(1e3 * hole.T), fc="w", ec="C3", lw=1.2)
        axes.set(xlabel="x / mm", ylabel="y / mm", aspect="equal", xlim=(-55, 55), ylim=(-50, 50))
        axes.set_title(title, fontsize=9)


def _draw_sections(canvas: Canvas, axes: Any, sections: list[Section], name: str) -> None:
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    levels = [1e3 * section.level_m for section in sections]
    scale = Normalize(min(levels), max(levels))
    for section, level in zip(sections, levels, strict=True):
        for outline in (*section.outlines, *section.holes):
            closed = np.concatenate([outline, outline[:1]])
            axes.plot(*(1e3 * closed.T), c=colormaps["viridis"](scale(level)), lw=1.3)
    bar = canvas.colorbar(ScalarMappable(scale, "viridis"), ax=axes, shrink=0.8)
    bar.set_label(f"{name} / mm")


def _draw_solid(
    axes: Any, machine: ThreePRRS, orientation: tuple[float, float, float], lower: Array, upper: Array
) -> None:
    """Floor, side and roof over a mesh of rings that shrink from the shadow's outline to a point inside."""
    from matplotlib.colors import LightSource

    def covered(xy: Array) -> np.ndarray:
        return np.isfinite(machine.heights(xy, orientation)[0])

    # Nothing depends on the height here, so any level cuts the shadow.
    box = (np.array([*lower[:2], -1.0]), np.array([*upper[:2], 1.0]))
    shadow = grid_section(lambda points: covered(points[:, :2]), *box, 2, 0.0, 200)
    outline = max(shadow.outlines, key=len)
    outline = np.vstack([outline, outline[:1]])
    middle = outline[:-1].mean(axis=0)
    ring = middle + np.linspace(0.999, 0.0, 40)[:, None, None] * (outline - middle)
    low, high = machine.heights(ring, orientation)
    light = LightSource(225, 35)
    style = {
        "color": "#8ec1e6",
        "lightsource": light,
        "linewidth": 0,
        "antialiased": False,
        "rcount": 60,
        "ccount": 160,
    }
    side = np.linspace(0.0, 1.0, 12)[:, None]
    walls = np.broadcast_to(ring[0], (12, *ring[0].shape))
    pieces = ((ring, low), (walls, low[0] + side * (high[0] - low[0])), (ring, high))
    for place, z in pieces:
        axes.plot_surface(1e3 * place[..., 0], 1e3 * place[..., 1], 1e3 * z, **style)
    axes.set(xlabel="x / mm", ylabel="y / mm")
    axes.set_zlabel("z / mm")
    axes.set_box_aspect(upper - lower)
    axes.set_title("solid", fontsize=9)
    axes.view_init(20, -55)
