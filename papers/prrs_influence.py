"""What l, D and d do to the volume: Fig. 5 of the 3-PRRS paper and its three optima."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from ..mechanisms import ThreePRRS
from ..mechanisms.studies import ParameterStudy, parameter_study
from .findings import Finding, statement

SEARCH_BOX_M = (np.array([-0.1, -0.1, 0.0]), np.array([0.1, 0.1, 0.25]))
"""Where the paper searched (section 2): -100..100, -100..100, 0..250 mm."""

OPTIMA = {"a": ("l", "D", 155.0, 195.0), "b": ("l", "d", 130.0, 95.0), "c": ("d", "D", 100.0, 200.0)}
"""Fig. 5's panels: the two dimensions and where the paper sees the largest volume, millimetres."""

_STEP_MM, _ABOUT_MM = 10.0, 15.0
_VARIANTS = {"a": (("d", 70.0), ("d", 95.0)), "b": (("D", 158.6), ("D", 195.0)), "c": (("l", 98.3), ("l", 130.0))}
"""What the third dimension may have been: identified, or named in the text on another panel."""


@lru_cache(maxsize=32)
def _study(panel: str, boxed: bool, name: str, value: float) -> ParameterStudy:
    """Volumes in litres over a panel's two dimensions, the third one fixed."""
    first, second, *_ = OPTIMA[panel]
    # Lattices through the fixed circle's diameter: D = d must be one of the points.
    start = 40.0 if name == "l" else 40.0 + (value - 40.0) % _STEP_MM
    ranges = {"l": np.arange(60.0, 241.0, _STEP_MM)}
    circles = np.arange(start, 261.0, _STEP_MM)

    def volume(a: float, b: float) -> float:
        lengths = {name: value, first: a, second: b}
        return 1e3 * _volume_of_difference(lengths["l"], round(lengths["D"] - lengths["d"], 6), boxed)

    return parameter_study(volume, ranges.get(first, circles), ranges.get(second, circles))


@lru_cache(maxsize=4096)
def _volume_of_difference(l_mm: float, difference_mm: float, boxed: bool) -> float:
    """``level_volume`` by l and D - d alone, on which it depends (``_difference_only`` checks that it does)."""
    return level_volume(l_mm, 300.0 + difference_mm, 300.0, boxed)


def level_volume(l_mm: float, base_mm: float, platform_mm: float, boxed: bool, cells: int = 90) -> float:
    """Volume in m3 at the level orientation under the printed constraints, inside the paper's search box or not.

    Raises:
        ValueError: links of that length cannot span the two circles.
    """
    machine = replace(
        ThreePRRS.published(), link_m=l_mm / 1e3, base_diameter_m=base_mm / 1e3, platform_diameter_m=platform_mm / 1e3
    )
    lower, upper = machine.box()
    search_low, search_high = SEARCH_BOX_M if boxed else (lower, upper)
    lower, upper = np.maximum(lower, search_low), np.minimum(upper, search_high)
    if np.any(upper <= lower):
        return 0.0
    # The level workspace is its own mirror image in y: half of it is enough.
    step = (upper[:2] - np.array([lower[0], 0.0])) / np.array([cells, cells // 2])
    x, y = lower[0] + step[0] * (np.arange(cells) + 0.5), step[1] * (np.arange(cells // 2) + 0.5)
    low, high = machine.heights(np.stack(np.meshgrid(x, y), axis=-1))
    height = np.minimum(high, search_high[2]) - np.maximum(low, search_low[2])
    return float(2.0 * np.nansum(np.maximum(height, 0.0)) * step[0] * step[1])


def optima() -> list[Finding]:
    """Whether the volume has one peak where the paper sees it, for each panel and each reading of what is fixed."""
    spread = _difference_only()
    findings = []
    for panel, (first, second, *peak) in OPTIMA.items():
        outcomes, found, equal = [], [], []
        for boxed in (False, True):
            for fixed in _VARIANTS[panel]:
                study = _study(panel, boxed, *fixed)
                name, value = fixed
                tops = [
                    {name: value, first: float(study.first[i]), second: float(study.second[j])}
                    for i, j in np.argwhere(study.summit)
                ]
                equal.append(all(abs(top["D"] - top["d"]) < 1e-9 for top in tops))
                near = len(tops) == study.peaks == 1 and all(
                    abs(tops[0][axis] - at) <= _ABOUT_MM for axis, at in ((first, peak[0]), (second, peak[1]))
                )
                outcomes.append(near and not study.best_on_rim)
                where = f"{first} {tops[0][first]:g}, {second} {tops[0][second]:g}" if len(tops) == 1 else "a ridge"
                rim = " (rim of the range)" if len(tops) == 1 and study.best_on_rim else ""
                found.append(f"{where}{rim} for {name} = {value:g}{' in the search box' if boxed else ''}")
        always = "always at D = d" if all(equal) else "not always at D = d"
        findings.append(
            statement(
                f"Fig. 5({panel})",
                f"one peak of the volume, at {first} about {peak[0]:g} and {second} about {peak[1]:g} mm",
                any(outcomes),
                f"Largest volume, mm: {'; '.join(found)}; {always}. At alpha = 0 the volume depends on D and d only "
                f"through D - d (to {spread:.0e} of it). 'About' is taken as {_ABOUT_MM:g} mm.",
            )
        )
    return findings


def influence() -> tuple[dict[str, ParameterStudy], dict[str, tuple[float, float]]]:
    """Studies in the search box under a title that says what is fixed, and the paper's peaks."""
    studies, peaks = {}, {}
    for panel, (first, second, *peak) in OPTIMA.items():
        name, value = _VARIANTS[panel][0]
        title = f"({panel}) volume / dm³ over {first} and {second}, {name} = {value:g} mm"
        studies[title], peaks[title] = _study(panel, True, name, value), (peak[0], peak[1])
    return studies, peaks


def _difference_only() -> float:
    """Largest relative difference of level volumes that share l and D - d."""
    worst = 0.0
    for l_mm, difference in ((98.3, 88.6), (155.0, 100.0), (130.0, 0.0)):
        volumes = [level_volume(l_mm, d + difference, d, False) for d in (50.0, 70.0, 95.0, 140.0)]
        worst = max(worst, float(np.ptp(volumes) / np.max(volumes)))
    return worst


def interference(machine: ThreePRRS) -> Finding:
    """Whether longer links come near each other."""
    changes, nearest = [], []
    for l_mm in (155.0, 200.0, 240.0):
        long = replace(machine, link_m=l_mm / 1e3)
        changes.append(abs(replace(long, link_clearance_m=0.0).volume() / long.volume() - 1.0))
        grid = np.stack(np.meshgrid(*(np.linspace(a, b, 41) for a, b in zip(*long.box(), strict=True))), axis=-1)
        poses = np.concatenate([grid.reshape(-1, 3), np.zeros((41**3, 3))], axis=-1)
        margins = long.margins(poses[long.reachable(poses)])
        distance = min(margins[name].min() for name in ("clearance12", "clearance23", "clearance31"))
        nearest.append(1e3 * (float(distance) + long.link_clearance_m))
    return statement(
        "Section 2 on Fig. 5(a), cause",
        "longer links interfere with each other, which makes the workspace smaller",
        max(changes) > 0.0,
        f"For l = 155, 200 and 240 mm the links stay {min(nearest):.1f} mm apart in the whole level workspace, so the "
        f"clearance takes away {100 * max(changes):.0f} % of the volume for any link thinner than that.",
    )
