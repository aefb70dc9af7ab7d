"""What l, D and d do to the volume: Fig. 5 of the 3-PRRS paper and its three optima."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from typing import Literal

import numpy as np
from scipy import ndimage

from ..mechanisms import ThreePRRS
from ..mechanisms.batching import Array
from ..mechanisms.prrs_legs import RADIAL
from ..mechanisms.studies import ParameterStudy, parameter_study
from .findings import Finding, statement, undeterminable

SEARCH_BOX_M = (np.array([-0.1, -0.1, 0.0]), np.array([0.1, 0.1, 0.25]))
"""Where the paper searched (section 2): -100..100, -100..100, 0..250 mm."""

OPTIMA = {"a": ("l", "D", 155.0, 195.0), "b": ("l", "d", 130.0, 95.0), "c": ("d", "D", 100.0, 200.0)}
"""Fig. 5's panels: the two dimensions and where the paper sees the largest volume, millimetres."""

Contact = Literal["none", "clear", "among"]
"""How the platform and the columns of the sliders, which the text names as a cause, touch: not at all; the platform, a
disc of diameter d, keeps clear of the three columns; and its centre stays among them too."""

_STEP_MM, _ABOUT_MM = 10.0, 15.0
_THIRD = {"a": (("d", 70.0), ("d", 95.0)), "b": (("D", 158.6), ("D", 195.0)), "c": (("l", 98.3), ("l", 130.0))}
"""What the third dimension may have been: identified, or named in the text on another panel."""
_CONES_RAD = tuple(float(np.deg2rad(angle)) for angle in (53.0, 55.9, 58.7))
"""Limits of the spherical joints over which the fit to the twelve limits is flat; the paper's value is lost."""
_CLEARANCES_MM = (0.0, 5.0, 10.0)
"""From the platform's rim to the middle of a column; the columns' thickness is not printed."""


@lru_cache(maxsize=4096)
def _level_heights(
    l_mm: float, difference_mm: float, cone_rad: float, boxed: bool, cells: int
) -> tuple[Array, Array, Array, float]:
    """Columns x, y (n,) of the half plane y > 0 in mm, the height of each that is reachable, and a column's area.

    Level, every link is as the others a vector from a circle of diameter D - d to P, so that the two circles act by
    their difference alone. Links never touch each other here (``interference``).
    """
    span = 1e3 * SEARCH_BOX_M[1][0] if boxed else l_mm + 0.5 * abs(difference_mm)
    edges = np.linspace(-span, span, cells + 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    x, y = (axis.ravel() for axis in np.meshgrid(middles, middles[middles > 0.0]))
    square = [(x - 0.5 * difference_mm * c) ** 2 + (y - 0.5 * difference_mm * s) ** 2 for c, s in RADIAL[:2].T]
    far, near = np.maximum.reduce(square), np.minimum.reduce(square)
    low_mm, high_mm = (1e3 * limit for limit in ThreePRRS.published().slider_range_m)
    low = low_mm - np.sqrt(np.maximum(l_mm**2 - far, 0.0))
    high = high_mm - np.sqrt(np.maximum(l_mm**2 - near, 0.0))
    if boxed:
        low, high = np.maximum(low, 1e3 * SEARCH_BOX_M[0][2]), np.minimum(high, 1e3 * SEARCH_BOX_M[1][2])
    reached = far <= (l_mm * np.sin(min(cone_rad, 0.5 * np.pi))) ** 2
    return x, y, np.where(reached, np.maximum(high - low, 0.0), 0.0), float(edges[1] - edges[0]) ** 2


def level_volume(
    l_mm: float,
    base_mm: float,
    platform_mm: float,
    boxed: bool,
    contact: Contact = "none",
    clearance_mm: float = 0.0,
    cone_rad: float = _CONES_RAD[1],
    cells: int = 80,
) -> float:
    """Volume in m3 at the level orientation.

    Args:
        l_mm: link.
        base_mm: D.
        platform_mm: d.
        boxed: inside the paper's search box only.
        contact: between platform and columns; with contact the part that hangs together with the axis counts.
        clearance_mm: kept from the platform's rim to the middle of a column.
        cone_rad: limit of the spherical joints.
        cells: columns across the searched square.
    """
    # The rounding joins differences that are the same but for their last digits.
    x, y, height, area = _level_heights(l_mm, round(base_mm - platform_mm, 6), cone_rad, boxed, cells)
    if contact != "none":
        away = [(x - 0.5 * base_mm * c) ** 2 + (y - 0.5 * base_mm * s) ** 2 for c, s in RADIAL[:2].T]
        free = (np.minimum.reduce(away) >= (0.5 * platform_mm + clearance_mm) ** 2) & (height > 0.0)
        if contact == "among":
            # The sides of the columns' triangle lie D / 4 from the axis, opposite to a column each.
            free &= np.minimum.reduce([0.25 * base_mm + x * c + y * s for c, s in RADIAL[:2].T]) >= 0.0
        # The region is its own mirror image in y: what hangs together does so in this half.
        labels = np.empty(free.shape, np.int32)
        ndimage.label(free.reshape(-1, cells), output=labels.reshape(-1, cells))
        home = labels[np.argmin(x**2 + y**2)]
        height = np.where((labels == home) & (home > 0), height, 0.0)
    return float(2e-9 * area * np.sum(height))


@lru_cache(maxsize=256)
def _study(
    panel: str,
    boxed: bool,
    name: str,
    value: float,
    contact: Contact = "none",
    clearance_mm: float = 0.0,
    cone_rad: float = _CONES_RAD[1],
) -> ParameterStudy:
    """Volumes in litres over a panel's two dimensions, the third one fixed."""
    first, second, *_ = OPTIMA[panel]
    # Lattices through the fixed circle's diameter: D = d must be one of the points.
    start = 40.0 if name == "l" else 40.0 + (value - 40.0) % _STEP_MM
    ranges = {"l": np.arange(60.0, 241.0, _STEP_MM)}
    circles = np.arange(start, 261.0, _STEP_MM)

    def volume(a: float, b: float) -> float:
        at = {name: value, first: a, second: b}
        return 1e3 * level_volume(at["l"], at["D"], at["d"], boxed, contact, clearance_mm, cone_rad)

    return parameter_study(volume, ranges.get(first, circles), ranges.get(second, circles))


def optima() -> list[Finding]:
    """Where the volume is largest, for each panel: without contact, and with it for what the paper does not print."""
    spread = _difference_only()
    findings = []
    for panel, (first, second, *peak) in OPTIMA.items():
        equal = []
        for fixed in _THIRD[panel]:
            for boxed in (False, True):
                study = _study(panel, boxed, *fixed)
                tops = [
                    {fixed[0]: fixed[1], first: float(study.first[i]), second: float(study.second[j])}
                    for i, j in np.argwhere(study.summit)
                ]
                equal.append(all(abs(top["D"] - top["d"]) < 1e-9 for top in tops))
        inside, rims, shares = _with_contact(panel)
        low, high = np.min(inside, axis=0), np.max(inside, axis=0)
        nearest = inside[int(np.argmin(np.abs(np.array(inside) - peak).max(axis=1)))]
        always = "always at D = d" if all(equal) else "not always at D = d"
        findings.append(
            undeterminable(
                f"Fig. 5({panel})",
                f"one peak of the volume, at {first} about {peak[0]:g} and {second} about {peak[1]:g} mm",
                f"With the printed constraints alone the largest volume is {always}, as it depends on D and d only "
                f"through D - d (to {spread:.0e} of it). The text also names contact of the platform with the columns, "
                "of which nothing is printed. With it (a disc of diameter d, clear of the columns by 0, 5 or 10 mm, "
                "its centre among them or not, delta 53, 55.9 or 58.7 deg, "
                f"{' or '.join(f'{name} = {value:g}' for name, value in _THIRD[panel])} mm, in the search box) the "
                f"largest volume lies inside the range tried in {len(inside)} of {len(inside) + rims} cases, at "
                f"{first} {low[0]:g} to {high[0]:g} and {second} {low[1]:g} to {high[1]:g} mm, nearest to the printed "
                f"place at {nearest[0]:g} and {nearest[1]:g}; the printed place has {100 * min(shares):.0f} to "
                f"{100 * max(shares):.0f} % of it. Shown is {second}.",
                alternatives=[place[1] for place in inside],
                tolerance=_ABOUT_MM,
                unit="mm",
            )
        )
    return findings


@lru_cache(maxsize=8)
def _with_contact(panel: str) -> tuple[list[tuple[float, float]], int, list[float]]:
    """Optima off the rim over all that is not printed, the number on it, and the printed place's shares of volume."""
    first, second, *peak = OPTIMA[panel]
    inside, rims, shares = [], 0, []
    kinds: tuple[Contact, ...] = ("clear", "among")
    for name, value in _THIRD[panel]:
        at = {name: value, first: peak[0], second: peak[1]}
        for contact in kinds:
            for clearance_mm in _CLEARANCES_MM:
                for cone_rad in _CONES_RAD:
                    study = _study(panel, True, name, value, contact, clearance_mm, cone_rad)
                    if study.best_on_rim:
                        rims += 1
                    else:
                        inside.append(study.best)
                    there = level_volume(at["l"], at["D"], at["d"], True, contact, clearance_mm, cone_rad)
                    shares.append(1e3 * there / float(np.max(study.values)))
    return inside, rims, shares


def influence() -> tuple[dict[str, ParameterStudy], dict[str, tuple[float, float]]]:
    """Studies in the search box under a title that says what is fixed, and the paper's peaks.

    First those with the printed constraints alone, then those of a platform that stays clear among the columns.
    """
    studies, peaks = {}, {}
    kinds: tuple[Contact, ...] = ("none", "among")
    for contact in kinds:
        for panel, (first, second, *peak) in OPTIMA.items():
            name, value = _THIRD[panel][0 if contact == "none" else 1]
            title = f"({panel}) volume / dm³ over {first} and {second}, {name} = {value:g} mm"
            title += "" if contact == "none" else ", contact"
            studies[title], peaks[title] = _study(panel, True, name, value, contact), (peak[0], peak[1])
    return studies, peaks


def _difference_only() -> float:
    """Largest relative difference of level volumes of the mechanism itself that share l and D - d."""
    worst = 0.0
    for l_mm, difference in ((98.3, 88.6), (155.0, 100.0), (130.0, 0.0)):
        volumes = [
            replace(
                ThreePRRS.published(),
                link_m=1e-3 * l_mm,
                base_diameter_m=1e-3 * (d + difference),
                platform_diameter_m=1e-3 * d,
            ).volume(cells=60)
            for d in (50.0, 70.0, 95.0, 140.0)
        ]
        worst = max(worst, float(np.ptp(volumes) / np.max(volumes)))
    return worst


def interference(machine: ThreePRRS) -> Finding:
    """Whether longer links bring members of the mechanism nearer to each other: links, or platform and columns."""
    lengths = (155.0, 200.0, 240.0)
    nearest = []
    for l_mm in lengths:
        long = replace(machine, link_m=l_mm / 1e3)
        grid = np.stack(np.meshgrid(*(np.linspace(a, b, 41) for a, b in zip(*long.box(), strict=True))), axis=-1)
        poses = np.concatenate([grid.reshape(-1, 3), np.zeros((41**3, 3))], axis=-1)
        margins = long.margins(poses[long.reachable(poses)])
        distance = min(margins[name].min() for name in ("clearance12", "clearance23", "clearance31"))
        nearest.append(1e3 * (float(distance) + long.link_clearance_m))
    losses = {
        pair: [1.0 - level_volume(l_mm, *pair, True, "clear") / level_volume(l_mm, *pair, True) for l_mm in lengths]
        for pair in ((158.6, 70.0), (195.0, 95.0))
    }
    listed = " and ".join(
        f"{', '.join(f'{100 * loss:.0f}' for loss in shares)} % for D, d = {base:g}, {platform:g}"
        for (base, platform), shares in losses.items()
    )
    return statement(
        "Section 2 on Fig. 5(a), cause",
        "too long links make the members of the mechanism interfere, which makes the workspace smaller",
        all(bool(np.all(np.diff(shares) > 0.0)) for shares in losses.values()),
        f"For l = 155, 200 and 240 mm a platform that keeps clear of the columns loses {listed} of the volume in the "
        f"search box. The links themselves stay {min(nearest):.1f} mm apart in the whole level workspace.",
    )
