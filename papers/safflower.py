"""Chapter of the safflower picking paper: its equations, its accuracy table, its workspace and its picking table."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
from scipy.optimize import minimize

from ..mechanisms import FiveBar, PlanarWorkspace
from ..mechanisms.batching import Array
from ..mechanisms.workspace import best_triangle, planar_workspace
from . import safflower_figures as draw
from .findings import Chapter, Figure, Finding, number, statement, undeterminable
from .safflower_formulas import equations

PAPER = (
    "Guo H., Luo D., Gao G., Wu T., Diao H.: Design and experiment of a safflower picking robot based on a parallel "
    "manipulator. Engenharia Agricola 42(1), e20210129 (2022), doi 10.1590/1809-4430-Eng.Agric.v42n1e20210129/2022."
)

DRIVE_ERROR = np.array([0.001, 0.002, 0.003, 0.004, 0.005])
"""First row of Table 1, printed in degrees."""
TABLE_1_MM = {
    "dT1": np.array([0.1750, 0.3500, 0.5250, 0.7000, 0.8750]),
    "dT2": np.array([0.1502, 0.2702, 0.3856, 0.5051, 0.6232]),
    "dT": np.array([0.2174, 0.3928, 0.5718, 0.7598, 0.9387]),
}
COLLECTED_G = np.array([2.583, 3.087, 2.620, 1.983, 2.139])
TOTAL_G = np.array([2.973, 3.607, 2.940, 2.233, 2.399])
NET_RATE_PERCENT = np.array([86.88, 85.58, 89.12, 88.80, 89.16])
"""Table 2."""
TRIANGLE_SIDE_M = 0.35


def chapter() -> Chapter:
    """The safflower paper's numbers and statements."""
    bar = FiveBar.safflower()
    # A box close about the region, so that the area's standard error is 0.1 %.
    region = planar_workspace(bar.reachable, (0.14, -0.52), (0.44, -0.20), samples=600_000)
    findings = [
        *equations(),
        *_singularities(bar),
        *_table_1(bar),
        *_workspace(bar, region),
        *_link_lengths(bar),
        *_table_2(),
    ]
    triangle, _ = best_triangle(_grid(bar, 0.003), region.area_m2, TRIANGLE_SIDE_M)
    figures = [
        Figure(
            "drive-angle-error",
            "Fig. 5 drawn again: Table 1 as printed, and the five-bar's error with the first row read in radians and, "
            "at the bottom, in the printed degrees.",
            partial(draw.drive_angle_error, DRIVE_ERROR, TABLE_1_MM, slopes(bar, fitted_pose(bar))),
        ),
        Figure(
            "workspace",
            "Fig. 6 drawn again: reachable region of the five-bar, the best-placed equilateral triangle of side "
            "0.35 m, and the posed mechanism.",
            partial(draw.workspace, bar, region, triangle, fitted_pose(bar)),
        ),
        Figure(
            "singularities",
            "Singularity loci of the identified five-bar with elbows outwards, and the condition number of its "
            "velocity map; the limits of the machine keep to the outlined region.",
            partial(draw.singularities, bar, region),
        ),
        Figure(
            "net-rate",
            "Table 2: net rate of the five groups of three pots, their mean and the rate of all filaments together.",
            partial(draw.net_rate, COLLECTED_G, TOTAL_G),
        ),
    ]
    return Chapter("safflower", "Safflower picker, planar five-bar", PAPER, findings, figures)


def slopes(bar: FiveBar, pose: Array) -> dict[str, float]:
    """Tool error in metres per radian of drive error: motor 1, motor 2, both."""
    first, second, both = _slopes(bar, pose)
    return {"dT1": float(first), "dT2": float(second), "dT": float(both)}


def _slopes(bar: FiveBar, poses: Array) -> Array:
    """(3, ...) of the above."""
    columns = [bar.pose_rates(poses, np.broadcast_to(error, poses.shape)) for error in ((1, 0), (0, 1), (1, 1))]
    return np.linalg.norm(np.stack(columns), axis=-1)


@lru_cache(maxsize=1)
def fitted_pose(bar: FiveBar) -> Array:
    """The pose whose linear errors come closest to Table 1 in radians, among those with dT1 = l1 delta as printed."""
    printed = np.stack(list(TABLE_1_MM.values())) * 1e-3

    def misfit(pose: Array) -> float:
        return 1e6 * float(np.mean((_slopes(bar, pose)[:, None] * DRIVE_ERROR - printed) ** 2))

    grid = _grid(bar)
    start = grid[np.argmin([misfit(pose) for pose in grid[::4]]) * 4]
    exact = {"type": "eq", "fun": lambda pose: 1e3 * (_slopes(bar, pose)[0] - bar.arm_m[0])}
    return minimize(misfit, start, method="SLSQP", constraints=[exact], options={"ftol": 1e-14, "maxiter": 200}).x


def _grid(bar: FiveBar, step_m: float = 0.004) -> Array:
    x, y = np.meshgrid(np.arange(0.05, 0.53, step_m), np.arange(-0.60, -0.15, step_m))
    points = np.stack([x.ravel(), y.ravel()], axis=-1)
    return points[bar.reachable(points)]


def _table_1(bar: FiveBar) -> list[Finding]:
    pose = fitted_pose(bar)
    rates = slopes(bar, pose)

    def compared(item: str, name: str, delta: float, printed_mm: float, why: str) -> Finding:
        """An error as printed, at a drive error in degrees and, for the correction, in radians."""
        in_degrees, in_radians = (1e3 * rates[name] * angle for angle in (np.deg2rad(delta), delta))
        return number(item, printed_mm, in_degrees, 5e-5, "mm", corrected=in_radians, why=why)

    findings = []
    for name, printed in TABLE_1_MM.items():
        line, offset = np.polyfit(DRIVE_ERROR, printed, 1)
        reason = {
            "dT1": "In radians the column is the arm's 175 mm times delta; in degrees a 175 mm arm moves 0.003 mm.",
            "dT2": f"Radians, not degrees. The printed column is {line:.1f} delta + {offset:.4f} mm: it does not "
            "vanish with delta, as every mechanism's error must, so no geometry gives it.",
            "dT": f"Radians, not degrees. The printed column is {line:.1f} delta + {offset:.4f} mm and carries dT2's "
            "offset.",
        }[name]
        findings += [
            compared(f"Table 1, {name} at {delta}", name, delta, value, reason)
            for delta, value in zip(DRIVE_ERROR, printed, strict=True)
        ]
    printed = np.stack(list(TABLE_1_MM.values()))
    own = 1e3 * np.array(list(rates.values()))[:, None] * DRIVE_ERROR
    free = (printed @ DRIVE_ERROR / (DRIVE_ERROR @ DRIVE_ERROR))[:, None] * DRIVE_ERROR
    rms = [float(np.sqrt(np.mean((fit - printed) ** 2))) for fit in (own, free)]
    grid = _grid(bar)
    one_motor = np.max(_slopes(bar, grid)[:2], axis=0)
    opposite = np.linalg.norm(bar.pose_rates(grid, np.broadcast_to([1.0, -1.0], grid.shape)), axis=-1)
    equal = _slopes(bar, grid)[2]
    larger = float(np.mean(equal > one_motor))
    offset = float(np.polyfit(DRIVE_ERROR, TABLE_1_MM["dT2"], 1)[1])
    step = np.array([1e-9, 0.0]), np.array([0.0, 1e-9])
    vanishing = max(float(np.linalg.norm(bar.pose_error(pose, error))) for error in step)
    return [
        *findings,
        statement(
            "Table 1 as a whole",
            "the table is the error of a five-bar",
            rms[1] < 5e-5,
            f"Three lines through zero, which every mechanism gives at such angles, leave at best {rms[1]:.4f} mm rms; "
            f"this five-bar at T = ({1e3 * pose[0]:.1f}, {1e3 * pose[1]:.1f}) mm leaves {rms[0]:.4f} mm. A drive error "
            f"of 1e-9 rad moves it by {1e3 * vanishing:.1e} mm, the table's dT2 goes to {offset:.4f} mm.",
        ),
        compared(
            "Abstract, smallest error (0.001)",
            "dT",
            0.001,
            0.2174,
            "An accuracy of 0.2-0.9 mm belongs to drive errors of 0.057-0.29 deg; for 0.001-0.005 deg the machine "
            "is about 57 times better than printed.",
        ),
        compared(
            "Abstract, largest error (0.005)",
            "dT",
            0.005,
            0.9387,
            "As above; the remaining difference is Table 1's offset.",
        ),
        statement(
            "Text at Table 1, both angles",
            "the error is largest when both driving angles err",
            larger > 1.0 - 1e-12,
            f"True at the fitted pose, where the three slopes are {1e3 * rates['dT1']:.1f}, {1e3 * rates['dT2']:.1f} "
            f"and {1e3 * rates['dT']:.1f} mm/rad. Over the workspace equal errors of both motors exceed the worse "
            f"single one at {100 * larger:.0f} % of the positions only; errors of the worse sign always do.",
            corrected=bool(np.all(np.maximum(equal, opposite) > one_motor)),
        ),
        statement(
            "Text at Table 1, growth",
            "the error grows with the drive error",
            all(np.all(np.diff(values) > 0.0) for values in (*own, *TABLE_1_MM.values())),
            "Every printed and every computed column increases.",
        ),
    ]


def _singularities(bar: FiveBar) -> list[Finding]:
    arm, forearm = bar.arm_m[0], bar.forearm_m[0]
    to_tool = np.array([bar.half_platform_m, -bar.tool_drop_m])
    wrist = np.array([0.1, -np.sqrt((arm + forearm - 1e-10) ** 2 - 0.01)])
    straight = bar.chains(wrist + to_tool)
    folded_wrist = np.array([0.1, -np.sqrt((forearm - arm + 1e-10) ** 2 - 0.01)])
    folded = bar.chains(folded_wrist + to_tool)
    angles = [np.rad2deg(np.abs(np.angle(np.exp(1j * (c.q_passive[0] - c.q[0]))))) for c in (straight, folded)]
    # Forearms in one line: on the axis of symmetry the wrists are at the elbows' height.
    y = _flat_forearms(bar)
    chains = bar.chains(np.array([0.5 * bar.base_m, y]))
    legs = float(np.abs(np.sin(chains.q_passive - chains.q)).min())
    flat = float(np.abs(np.sin(chains.q_passive[1] - chains.q_passive[0])))
    return [
        statement(
            "Below eq. 30, straight and folded",
            "straightened is q2 - q1 = pi, the arms overlap at q2 - q1 = 0",
            bool(angles[0] > 90.0 and angles[1] < 90.0),
            f"At full reach q2 - q1 = {angles[0]:.3f} deg, folded back {angles[1]:.3f} deg: the other way round.",
            corrected=bool(angles[0] < 0.1 and angles[1] > 179.9),
        ),
        statement(
            "Eq. 30, singularities",
            "eq. 30 gives the boundary of all singular positions",
            not (flat < 1e-6 < legs),
            f"At T = ({500 * bar.base_m:.1f}, {1e3 * y:.1f}) mm the forearms lie in one line (|sin(q3 - q2)| = "
            f"{flat:.0e}) and the tool cannot be held, while both factors of eq. 30 are clear of zero (at least "
            f"{legs:.2f}): the parallel singularity sin(q3 - q2) = 0 is missing.",
        ),
    ]


def _flat_forearms(bar: FiveBar) -> float:
    """Height of the tool on the axis of symmetry at which both forearms are level."""
    reach = bar.forearm_m[0] + bar.half_platform_m - 0.5 * bar.base_m
    elbow_y = -np.sqrt(bar.arm_m[0] ** 2 - reach**2)
    return float(elbow_y - bar.tool_drop_m)


def _workspace(bar: FiveBar, region: PlanarWorkspace) -> list[Finding]:
    # A regular grid measures overlaps with far less noise than as many thrown points.
    points = _grid(bar, 0.003)
    sides = np.arange(0.30, 0.401, 0.01)
    overlaps = np.array([best_triangle(points, region.area_m2, side)[1] for side in sides])
    # The overlap is flat at its top: the vertex of a parabola through the best sides.
    near = np.abs(sides - sides[np.argmax(overlaps)]) < 0.035
    bend, slope, _ = np.polyfit(sides[near], overlaps[near], 2)
    best, printed = -slope / (2.0 * bend), float(overlaps[np.argmin(np.abs(sides - TRIANGLE_SIDE_M))])
    equal = float(2.0 * np.sqrt(region.area_m2 / np.sqrt(3.0)))
    return [
        number(
            "Fig. 6, side of the triangle",
            TRIANGLE_SIDE_M,
            best,
            0.01,
            "m",
            why=f"Side whose triangle overlaps the region best (intersection over union {overlaps.max():.3f}; the top "
            f"is flat, 0.35 m gives {printed:.3f}; equal area would be {equal:.3f} m). The link lengths were chosen "
            "with this figure in view, so this shows consistency, not an independent check; hence the 10 mm.",
        ),
        statement(
            "Fig. 6, shape",
            "the workspace is approximately an equilateral triangle of side 0.35 m",
            printed >= 0.80,
            f"Intersection over union {printed:.3f} with the best-placed triangle, apex down; area "
            f"{1e4 * region.area_m2:.0f} cm2 against the triangle's {1e4 * np.sqrt(3) / 4 * TRIANGLE_SIDE_M**2:.0f}.",
        ),
    ]


def _link_lengths(bar: FiveBar) -> list[Finding]:
    """What the paper's two results leave open about its dimensions."""
    poses, l3, l7 = _grid(bar, 0.02), bar.half_platform_m, bar.base_m
    bases, apart = [], 0.0
    for half in (0.0, 0.02, 0.04, 0.06, 0.08):
        other = replace(bar, half_platform_m=half, base_m=l7 - 2.0 * l3 + 2.0 * half)
        # The same motion, seen from motors that stand elsewhere.
        angles = other.inverse(poses + np.array([half - l3, 0.0]))
        apart = max(apart, float(np.max(np.abs(angles - bar.inverse(poses)))))
        bases.append(1e3 * other.base_m)
    printed = np.stack(list(TABLE_1_MM.values())) * 1e-3
    enough, fitting, tried = 0.1e-3 * TABLE_1_MM["dT2"][0], [], 0
    for forearm in (0.31, 0.33, 0.35, 0.37, 0.39):
        for span in (0.46, 0.48, 0.50, 0.52, 0.54):
            tried += 1
            other = FiveBar.from_lengths(0.175, forearm, 0.04, 0.06, forearm, 0.175, span + 0.08)
            x, y = np.meshgrid(np.arange(0.0, span + 0.08, 0.006), np.arange(-0.65, -0.10, 0.006))
            thrown = np.stack([x.ravel(), y.ravel()], axis=-1)
            points = thrown[other.reachable(thrown)]
            if len(points) == 0:
                continue
            errors = _slopes(other, points).T[:, :, None] * DRIVE_ERROR - printed
            if np.sqrt(np.mean(errors**2, axis=(1, 2)).min()) > enough:
                continue
            if best_triangle(points, len(points) * 0.006**2, TRIANGLE_SIDE_M)[1] >= 0.80:
                fitting.append((1e3 * forearm, 1e3 * span))
    lengths, spans = zip(*fitting, strict=True)
    return [
        undeterminable(
            "Fig. 3, distance l7 of the motors",
            "not printed",
            f"Only l7 - 2 l3 acts on the motion: with l3 from 0 to 80 mm and l7 moved along, the drive angles agree to "
            f"{apart:.0e} rad.",
            alternatives=bases,
            tolerance=1.0,
            unit="mm",
        ),
        undeterminable(
            "Fig. 3, forearm length l2 = l5",
            "not printed",
            f"{len(fitting)} of {tried} geometries tried with l1 = 175 mm come, at some pose, within "
            f"{1e3 * enough:.3f} mm rms of Table 1 (a tenth of its smallest dT2) and overlap the triangle of Fig. 6 by "
            f"at least 0.80; their l7 - 2 l3 runs from {min(spans):.0f} to {max(spans):.0f} mm.",
            alternatives=lengths,
            tolerance=5.0,
            unit="mm",
        ),
    ]


def _table_2() -> list[Finding]:
    rates = 100.0 * COLLECTED_G / TOTAL_G
    findings = [
        number(f"Table 2, net rate of group {group + 1}", printed, rate, 0.005, "%", why="m1 over the total mass.")
        for group, (printed, rate) in enumerate(zip(NET_RATE_PERCENT, rates, strict=True))
    ]
    pooled = float(100.0 * COLLECTED_G.sum() / TOTAL_G.sum())
    spread = float(np.std(rates, ddof=1))
    return [
        *findings,
        number(
            "Abstract, average net rate",
            87.91,
            pooled,
            0.005,
            "%",
            corrected=float(rates.mean()),
            why="Eq. 35 over the entire experiment, as its text defines it, gives the pooled rate. The printed average "
            f"is the mean of the five group rates; their standard deviation is {spread:.2f} points.",
        ),
    ]
