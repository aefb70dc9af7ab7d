"""Chapter of the 3-PRRS paper: workspaces at two orientations, and what its dimensions do to them."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from ..mechanisms import ThreePRRS
from ..mechanisms.batching import Array
from ..mechanisms.geometry import line_distance
from ..mechanisms.regions import enclosed_voids, label_regions
from ..mechanisms.spatial_workspace import Section, grid_section, spatial_extent
from . import prrs_figures, prrs_influence
from .findings import Chapter, Figure, Finding, identified, number, statement, undeterminable
from .prrs_formulas import equations

PAPER = (
    "Du Q., Guo Z., Niu G.: Kinematics analysis and workspace of a new 3-PRRS agriculture parallel mechanism. "
    "Journal of Shandong University of Technology (Natural Science Edition), 2015 (5), 43-48"
)
LEVEL, TILTED = (0.0, 0.0, 0.0), (float(np.deg2rad(15.0)), 0.0, 0.0)
PUBLISHED_LIMITS_MM = {
    LEVEL: ((-38.0, 49.0), (-42.0, 42.0), (0.0, 164.0)),
    TILTED: ((-38.0, 49.0), (-25.0, 51.0), (3.0, 166.0)),
}
ALTERNATIVE = ThreePRRS(0.1013, 0.195, 0.095, (0.090, 0.250), np.deg2rad(58.7))
"""D = 195 and d = 95 mm, which the paper's text on Fig. 5 names, with l and delta fitted to the same twelve numbers."""


def chapter() -> Chapter:
    """Equations, the twelve limits, the statements on shape, symmetry and holes, and the three optima of Fig. 5."""
    machine = ThreePRRS.published()
    findings = [
        *equations(machine),
        *_limits(machine),
        *_strokes(machine),
        *_shape(machine),
        *_symmetry(machine),
        _holes(machine),
        *_shrinking(machine),
        *prrs_influence.optima(),
        prrs_influence.interference(machine),
    ]
    figures = [
        Figure("workspace-0", _CAPTION.format(3, 0), lambda canvas: prrs_figures.workspace(canvas, machine, LEVEL)),
        Figure("workspace-15", _CAPTION.format(4, 15), lambda canvas: prrs_figures.workspace(canvas, machine, TILTED)),
        Figure(
            "influence",
            "Fig. 5: volume at the level orientation over two dimensions at a time, inside the paper's search box; the "
            "computed maximum (dot) and the paper's (cross). Above with the printed constraints alone, where it lies "
            "at D = d; below with the platform held clear of the three columns too, a cause that the text names.",
            lambda canvas: prrs_figures.influence(canvas, *prrs_influence.influence()),
        ),
        Figure(
            "clearance",
            "Level section at z = 80 mm: whole with the distance of the links as segments; with the common normal of "
            "their infinite lines, as printed, hardly anything is left even for links 1 mm thick.",
            lambda canvas: prrs_figures.clearance(canvas, *_clearance_sections(machine)),
        ),
    ]
    return Chapter("prrs", "Six-degree-of-freedom 3-PRRS", PAPER, findings, figures)


_CAPTION = "Fig. {}: sections perpendicular to Z, X and Y and the solid workspace at alpha = {} deg, beta = gamma = 0."


@lru_cache(maxsize=8)
def extent_mm(machine: ThreePRRS, orientation: tuple[float, float, float]) -> Array:
    """Reachable limits, (3, 2), millimetres: rows X, Y, Z; columns lower, upper."""
    return 1e3 * np.stack(spatial_extent(machine.reachable_at(orientation), *machine.box(orientation)), axis=-1)


def limits_rms_mm(machine: ThreePRRS) -> float:
    """Root mean square deviation from the twelve published limits."""
    errors = [extent_mm(machine, key) - np.array(limits) for key, limits in PUBLISHED_LIMITS_MM.items()]
    return float(np.sqrt(np.mean(np.square(errors))))


def _limits(machine: ThreePRRS) -> list[Finding]:
    rms, other = limits_rms_mm(machine), limits_rms_mm(ALTERNATIVE)
    errors = np.stack([extent_mm(machine, key) - np.array(limits) for key, limits in PUBLISHED_LIMITS_MM.items()])
    exact = int(np.count_nonzero(np.abs(errors) <= 0.5))
    cones = [float(np.rad2deg(m.cone_rad)) for m in (machine, ALTERNATIVE)]
    return [
        identified(
            "Section 2, the twelve limits of both workspaces",
            "X, Y and Z from and to, at 0 and at 15 deg",
            f"{rms:.2f} mm rms, {np.abs(errors).max():.2f} mm at most",
            f"The paper prints no dimensions: l, D, d = {_mm(machine)} mm and delta = {cones[0]:.1f} deg were fitted "
            f"to these twelve numbers; {exact} of the twelve to half a millimetre, the print's rounding. The fit is a "
            f"flat ridge: {_mm(ALTERNATIVE)} mm with {cones[1]:.1f} deg has {other:.2f} mm.",
        ),
        undeterminable(
            "Section 2 (3), limit delta of the spherical joints",
            "lost in the source's text",
            "As the row above: D = 195 and d = 95 mm, which the text on Fig. 5 names, fit the twelve limits as well "
            "with another delta.",
            alternatives=cones,
            tolerance=0.5,
            unit="deg",
        ),
    ]


def _strokes(machine: ThreePRRS) -> list[Finding]:
    low, high = PUBLISHED_LIMITS_MM[LEVEL][2]
    widths = _widths_with_printed_x(machine)
    tilted_low, tilted_high = PUBLISHED_LIMITS_MM[TILTED][2]
    tilted = [float(np.ptp(extent_mm(m, TILTED)[2])) for m in (machine, ALTERNATIVE)]
    return [
        number(
            "alpha = 0 deg, width of Z",
            high - low,
            max(widths),
            1.0,
            "mm",
            why="Tolerance: two ends rounded to 1 mm. Level, the printed X fixes D - d and l sin(delta); the widest Z "
            f"of {len(widths)} machines with that X and l up to {1e3 * _LONGEST_M:.0f} mm is shown. The sliders follow "
            "the height one to one over 90..250 mm.",
        ),
        number(
            "alpha = 15 deg, width of Z",
            tilted_high - tilted_low,
            tilted[0],
            1.0,
            "mm",
            why=f"As above for the identified dimensions; the other set has {tilted[1]:.1f} mm.",
        ),
    ]


_LONGEST_M = 0.2


def _widths_with_printed_x(machine: ThreePRRS) -> list[float]:
    """Widths of Z in mm of level workspaces with the printed X limits, for links from the shortest possible on.

    Level, the spherical joints hold P inside three circles of radius l sin(delta) about points (D - d)/2 from the
    axis. They cut the X axis at (D - d)/2 - l sin(delta) and meet on it on the other side: two equations.
    """
    (low, high), *_ = PUBLISHED_LIMITS_MM[LEVEL]
    left, right = -1e-3 * low, 1e-3 * high
    apart = (right**2 - left**2) / (left - 0.5 * right)
    radius = left + 0.5 * apart
    widths = []
    for link in np.linspace(1.01 * radius, _LONGEST_M, 20):
        family = replace(
            machine,
            link_m=float(link),
            base_diameter_m=machine.platform_diameter_m + apart,
            cone_rad=float(np.arcsin(radius / link)),
        )
        *_, bottom, top = columns(family, LEVEL, 151)
        widths.append(float(1e3 * (np.nanmax(top) - np.nanmin(bottom))))
    return widths


def _shape(machine: ThreePRRS) -> list[Finding]:
    findings = []
    for orientation in (LEVEL, TILTED):
        x, y, low, high = columns(machine, orientation)
        bottom, top = float(np.nanmin(low)), float(np.nanmax(high))
        levels = np.linspace(bottom, top, 81)
        areas = np.array([np.count_nonzero((low <= z) & (high >= z)) for z in levels], dtype=float)
        areas *= (x[1] - x[0]) * (y[1] - y[0])
        full = areas >= 0.99 * areas.max()
        prism = np.flatnonzero(full)
        whole = bool(full[prism[0] : prism[-1] + 1].all())
        tapers = bool((np.diff(areas[: prism[0] + 1]) >= 0.0).all() and areas[0] <= 0.02 * areas.max())
        filled = _mean(areas[: prism[0] + 1]) / areas.max()
        height = (prism[-1] - prism[0]) / (len(levels) - 1)
        share = height * _mean(areas[full]) / _mean(areas)
        middles = 0.5 * (bottom + levels[prism[0]]), 0.5 * (levels[prism[0]] + levels[prism[-1]])
        lower_corners, upper_corners = (corners(_outline(machine, orientation, float(level))) for level in middles)
        # A pyramid fills a third of its prism: below two thirds the lower part is nearer to a pyramid.
        holds = whole and tapers and share > 0.5 and filled < 2.0 / 3.0 and lower_corners == upper_corners == 3
        findings.append(
            statement(
                f"Section 2 (1), shape at {np.rad2deg(orientation[0]):.0f} deg",
                "roughly a triangular pyramid below, a triangular prism above",
                holds,
                f"Sections of constant area (1 %) over {100 * height:.0f} % of the height and {100 * share:.0f} % of "
                f"the volume, {upper_corners} corners; below they grow steadily from nothing, {lower_corners} corners, "
                f"filling {100 * filled:.0f} % of the prism's continuation (a pyramid 33 %: its sides bulge). The "
                f"prism's sides are arcs; an uneven cap closes the top {1e3 * (top - levels[prism[-1]]):.0f} mm.",
            )
        )
    return findings


def _mean(values: Array) -> float:
    """Mean of equally spaced values by the trapezoidal rule."""
    return float(np.mean(0.5 * (values[1:] + values[:-1])))


def _symmetry(machine: ThreePRRS) -> list[Finding]:
    level = {name: mismatch(machine, LEVEL, *motion) for name, motion in _MOTIONS.items()}
    tilted = {name: mismatch(machine, TILTED, *motion) for name, motion in _MOTIONS.items()}
    listed = ", ".join(f"{name} {100 * value:.1f} %" for name, value in tilted.items())
    return [
        statement(
            "Section 2 (2), symmetry at 0 deg",
            "symmetric about the Z axis",
            level["half turn"] < 0.01,
            f"A half turn about Z leaves {100 * level['half turn']:.1f} % of the volume uncovered (the printed X from "
            f"-38 to 49 mm shows it). Correction: three-fold, a third of a turn ({100 * level['third of a turn']:.2f} "
            f"%), with mirror planes through the legs ({100 * level['mirror y']:.2f} %).",
            corrected=level["third of a turn"] < 0.01 and level["mirror y"] < 0.01,
        ),
        statement(
            "Section 2 (3), symmetry at 15 deg",
            "no longer symmetric",
            min(tilted.values()) > 0.02,
            f"Volume left uncovered: {listed}.",
        ),
    ]


THINNEST_LINK_M = 0.001
"""D' at which the clearance as printed is tried: thinner than any link, so in the statement's favour."""


def _holes(machine: ThreePRRS) -> Finding:
    """Pieces, cavities and hollow sections under the printed clearance and under that of the segments."""
    whole = {"lines": True, "segments": True}
    texts, largest = [], 0.0
    for orientation in (LEVEL, TILTED):
        degrees = f"{np.rad2deg(orientation[0]):.0f} deg"
        axes = [np.linspace(low, high, 60) for low, high in extent_mm(machine, orientation) / 1e3]
        position = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
        good = machine.reachable_at(orientation)(position.reshape(-1, 3)).reshape(position.shape[:-1])
        normals = line_clearance(machine, orientation, position[good])
        largest = max(largest, float(normals.max()))
        left = good.copy()
        left[good] = normals >= THINNEST_LINK_M
        for name, lattice in (("lines", left), ("segments", good)):
            pieces = np.bincount(label_regions(lattice).reshape(-1))[1:]
            # Single lattice points at the rim's tips are no pieces.
            count = int(np.count_nonzero(pieces > 0.001 * np.count_nonzero(good)))
            hollow = sum(enclosed_voids(level).size > 0 for level in np.moveaxis(lattice, -1, 0))
            voids = enclosed_voids(lattice).size
            whole[name] &= count == 1 and hollow == 0 and voids == 0
            if name == "lines":
                lost = 1.0 - np.count_nonzero(left) / np.count_nonzero(good)
                texts.append(f"{100 * lost:.0f} % lost and {count} pieces at {degrees}")
    outcome = "in one piece, no section hollow" if whole["segments"] else "not whole either"
    return statement(
        "Section 2 (1) and abstract, interior",
        "no holes",
        whole["lines"],
        f"Clearance as printed (common normal of the links' infinite lines >= D') with D' as small as "
        f"{1e3 * THINNEST_LINK_M:.0f} mm: {' and '.join(texts)}; the normal never exceeds {1e3 * largest:.1f} mm, so "
        "real links would leave nothing: the lines nearly meet, but beyond the links' ends. Correction: distance of "
        f"the links as segments, D' = {1e3 * machine.link_clearance_m:.0f} mm: {outcome}.",
        corrected=whole["segments"],
    )


def _shrinking(machine: ThreePRRS) -> list[Finding]:
    free = replace(machine, cone_rad=np.pi)
    volumes = {key: (m.volume(LEVEL), m.volume(TILTED)) for key, m in (("limited", machine), ("free", free))}
    ratios = {key: tilted / level for key, (level, tilted) in volumes.items()}
    litres = tuple(1e3 * volume for volume in volumes["limited"])
    return [
        statement(
            "Section 2 (3), effect of the angles",
            "a changed Euler angle makes the workspace smaller",
            ratios["limited"] < 1.0,
            f"{litres[1]:.4f} l at 15 deg against {litres[0]:.4f} l level, {100 * (1 - ratios['limited']):.0f} % less.",
        ),
        statement(
            "Section 2 (3), its cause",
            "the spherical joints' limit makes it smaller",
            ratios["limited"] < 0.99 * ratios["free"],
            f"Without that limit the tilted workspace has {100 * ratios['free']:.0f} % of the level one, with it "
            f"{100 * ratios['limited']:.0f} %.",
        ),
    ]


def columns(machine: ThreePRRS, orientation: tuple[float, float, float], cells: int = 301) -> tuple[Array, ...]:
    """Lattice x (n,), y (n,) over the search area and the heights (n, n) that are reachable above it."""
    axis = np.linspace(-0.075, 0.075, cells)
    low, high = machine.heights(np.stack(np.meshgrid(axis, axis), axis=-1), orientation)
    return axis, axis, low, high


def mismatch(
    machine: ThreePRRS, orientation: tuple[float, float, float], turn_rad: float, mirrored: bool, cells: int = 201
) -> float:
    """Share of the workspace's volume that a motion about Z moves out of the workspace."""
    axis = np.linspace(-0.075, 0.075, cells)
    points = np.stack(np.meshgrid(axis, axis), axis=-1)
    low, high = machine.heights(points, orientation)
    moved = points * np.array([1.0, -1.0 if mirrored else 1.0])
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    there_low, there_high = machine.heights(moved @ np.array([[c, s], [-s, c]]), orientation)
    common = np.minimum(high, there_high) - np.maximum(low, there_low)
    return float(1.0 - np.nansum(np.maximum(common, 0.0)) / np.nansum(high - low))


_MOTIONS = {
    "half turn": (np.pi, False),
    "third of a turn": (2.0 * np.pi / 3.0, False),
    "mirror y": (0.0, True),
    "mirror x": (np.pi, True),
}


def corners(outline: Array, sharp_rad: float = np.deg2rad(30.0)) -> int:
    """Corners of a closed outline (m, 2): places where it turns by more than ``sharp_rad`` within 3 % of its length."""
    closed = np.concatenate([outline, outline[:1]])
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=-1))])
    even = np.linspace(0.0, arc[-1], 201)[:-1]
    points = np.stack([np.interp(even, arc, closed[:, k]) for k in (0, 1)], axis=-1)
    before, after = points - np.roll(points, 3, axis=0), np.roll(points, -3, axis=0) - points
    turn = np.arctan2(before[:, 0] * after[:, 1] - before[:, 1] * after[:, 0], np.sum(before * after, axis=-1))
    sharp = turn > sharp_rad
    return int(np.count_nonzero(sharp & ~np.roll(sharp, 1)))


def line_clearance(machine: ThreePRRS, orientation: tuple[float, float, float], position: Array) -> Array:
    """Smallest common normal (n,) in metres of the links' infinite lines at positions (n, 3): the printed clearance."""
    chains = machine.chains(np.concatenate([position, np.broadcast_to(orientation, position.shape)], axis=-1))
    g, a = np.moveaxis(chains.g, -2, 0), np.moveaxis(chains.a, -2, 0)
    return np.min([line_distance(g[i], a[i], g[j], a[j]) for i, j in ((0, 1), (1, 2), (2, 0))], axis=0)


def _clearance_sections(machine: ThreePRRS) -> tuple[Section, Section]:
    """The level section at z = 80 mm with segments as links, and with the printed clearance at ``THINNEST_LINK_M``."""
    whole = machine.reachable_at(LEVEL)

    def torn(position: Array) -> np.ndarray:
        good = whole(position)
        good[good] = line_clearance(machine, LEVEL, position[good]) >= THINNEST_LINK_M
        return good

    first, second = (grid_section(reading, *_SECTION_BOX_M, 2, 0.08, 200) for reading in (whole, torn))
    return first, second


_SECTION_BOX_M = np.array([-0.075, -0.075, 0.0]), np.array([0.075, 0.075, 0.25])


def _outline(machine: ThreePRRS, orientation: tuple[float, float, float], level_m: float) -> Array:
    section = grid_section(machine.reachable_at(orientation), *_SECTION_BOX_M, 2, float(level_m), 100)
    return max(section.outlines, key=len)


def _mm(machine: ThreePRRS) -> str:
    lengths = (machine.link_m, machine.base_diameter_m, machine.platform_diameter_m)
    return ", ".join(f"{1e3 * length:.1f}" for length in lengths)
