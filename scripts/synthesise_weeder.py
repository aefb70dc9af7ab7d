"""Find the attachment azimuths of ``ThreeUPSRPU.weeder()``.

The published layout is singular wherever the platform is level, so the weeding machine needs another one of the same
topology and radii. Of the layouts mirrored about the XZ plane the RPU leg takes azimuth 180 deg on both rings; leg 2
must lie in the mirror plane too, at 0 deg on both rings (at 180 deg it would share a joint with the RPU leg); legs 1
and 3 are each other's image. Two numbers remain: the azimuths of the base joint and of the platform joint of leg 3.

A grid over both, then a climb in single degrees from the best points of the grid, maximises the smallest singular
value of G (angles scaled by r_b) over the box |x| <= 0.10 m, z 0.5..0.7 m, alpha and beta +-14 deg, corners included,
under: longest over shortest length of each leg < 2 (a single-stage actuator), universal joints within 50 deg, legs
0.15 m apart, one sign of det G. The smallest singular value and not the condition number, because it is what bounds
the machine: leg forces <= load / value, error of the tool <= error of the legs / value (moments and angles by r_b).

Why -+59 (base) and -+124 deg (platform): it is the best layout in whole degrees, which a workshop can drill (trying
all 31329 of them finds the same one), and quarter degrees gain less than one part in a thousand. The second family,
base near -+152 with platform near -+82, comes within half a percent, but with its universal joints nearer to their
limit and its legs a third nearer to each other.

Run: ``python scripts/synthesise_weeder.py`` (half a minute; the same output every time).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fieldgym.mechanisms import ThreeUPSRPU
from fieldgym.mechanisms.three_ups_rpu import WEEDING_BOX
from fieldgym.mechanisms.three_ups_rpu_geometry import leg_distances

MAX_STROKE_RATIO = 2.0
MAX_TILT_DEG = 50.0
MIN_DISTANCE_M = 0.15
COARSE = (5, 3, 3, 5)
FINE = (9, 5, 5, 9)


@dataclass(frozen=True)
class Layout:
    """One layout judged over the box.

    Attributes:
        base_deg: azimuth of base joint 3 (joint 1 is its mirror image).
        platform_deg: azimuth of platform joint 3.
        smallest: smallest singular value of G.
        stroke_ratio: largest ratio of longest to shortest length among the legs.
        tilt_deg: largest tilt of a universal joint.
        distance_m: smallest distance between two legs.
        one_sided: whether det G keeps its sign.
    """

    base_deg: float
    platform_deg: float
    smallest: float
    stroke_ratio: float
    tilt_deg: float
    distance_m: float
    one_sided: bool

    @property
    def allowed(self) -> bool:
        """Whether all constraints hold."""
        return (
            self.one_sided
            and self.stroke_ratio < MAX_STROKE_RATIO
            and self.tilt_deg <= MAX_TILT_DEG
            and self.distance_m >= MIN_DISTANCE_M
        )


def mechanism(base_deg: float, platform_deg: float) -> ThreeUPSRPU:
    """A mirrored layout of the published radii; its strokes are placeholders, nothing here asks for them."""
    base, platform, stroke = math.radians(base_deg), math.radians(platform_deg), (0.1, 2.0)
    return ThreeUPSRPU(
        0.4,
        0.3,
        (-base, 0.0, base, math.pi),
        (-platform, 0.0, platform, math.pi),
        0.6,
        (stroke, stroke, stroke, stroke),
    )


def box(counts: tuple[int, int, int, int]) -> NDArray[np.float64]:
    """Grid over the box with its corners, shape (n, 4); alpha >= 0 only, the mirror image holds the other half."""
    ranges = [*WEEDING_BOX]
    ranges[2] = (0.0, ranges[2][1])
    axes = [np.linspace(low, high, count) for (low, high), count in zip(ranges, counts, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 4)


def judge(base_deg: float, platform_deg: float, poses: NDArray[np.float64], *, fully: bool = True) -> Layout:
    """Measure a layout; unless ``fully``, one that breaks a cheap constraint is not asked for singular values."""
    machine = mechanism(base_deg, platform_deg)
    chains = machine.chains(poses)
    longest, shortest = chains.length.max(axis=0), chains.length.min(axis=0)
    for values, pick in ((longest, max), (shortest, min)):
        values[0] = values[2] = pick(values[0], values[2])
    upright = chains.direction[:, :3, 2].min()
    rpu = np.sum(chains.direction[:, 3] * chains.rotation[..., 2], axis=-1).min()
    tilt = math.degrees(math.acos(min(upright, rpu)))
    layout = Layout(
        base_deg,
        platform_deg,
        0.0,
        float((longest / shortest).max()),
        tilt,
        float(leg_distances(chains).min()),
        True,
    )
    if not fully and not layout.allowed:
        return layout
    state = machine.singularity(poses)
    one_sided = bool(np.ptp(np.sign(state.determinant)) == 0.0)
    return replace(layout, smallest=float(state.smallest.min()), one_sided=one_sided)


def grid(step_deg: float) -> list[Layout]:
    """Allowed layouts of a grid of azimuths, best first."""
    poses, found = box(COARSE), []
    azimuths = np.arange(step_deg, 180.0, step_deg)
    for base_deg in azimuths:
        for platform_deg in azimuths:
            found.append(judge(float(base_deg), float(platform_deg), poses, fully=False))
    return sorted((layout for layout in found if layout.allowed), key=lambda layout: -layout.smallest)


def climb(start: Layout, step_deg: float) -> Layout:
    """Go to the best allowed of the eight neighbours until none is better."""
    poses = box(FINE)
    best = judge(start.base_deg, start.platform_deg, poses)
    while True:
        around = [
            judge(best.base_deg + i * step_deg, best.platform_deg + j * step_deg, poses, fully=False)
            for i in (-1, 0, 1)
            for j in (-1, 0, 1)
            if i or j
        ]
        better = [layout for layout in around if layout.allowed and layout.smallest > best.smallest]
        if not better:
            return best
        best = max(better, key=lambda layout: layout.smallest)


def synthesise(starts: int = 24) -> list[Layout]:
    """Layouts in whole degrees where the climb from the best grid points ends, best first, each once."""
    ends = {climb(layout, 1.0) for layout in grid(5.0)[:starts]}
    return sorted((layout for layout in ends if layout.allowed), key=lambda layout: -layout.smallest)


def line(name: str, layout: Layout) -> str:
    """One row of the table."""
    return (
        f"{name:<26} {layout.base_deg:7.2f} {layout.platform_deg:9.2f} {layout.smallest:9.4f} "
        f"{layout.stroke_ratio:8.3f} {layout.tilt_deg:9.2f} {layout.distance_m:11.3f}   "
        f"{'yes' if layout.allowed else 'no'}"
    )


def main() -> None:
    """Search and print the table."""
    print(
        f"{'layout':<26} {'base':>7} {'platform':>9} {'smallest':>9} {'stroke':>8} {'U tilt':>9} "
        f"{'legs apart':>11}   ok"
    )
    print(f"{'':<26} {'deg':>7} {'deg':>9} {'s. value':>9} {'ratio':>8} {'deg':>9} {'m':>11}")
    ends = synthesise()
    for place, layout in enumerate(ends[:10], start=1):
        print(line(f"whole degrees, no. {place}", layout))
    print(line("no. 1 in quarter degrees", climb(ends[0], 0.25)))
    poses = box(FINE)
    print(line("published", judge(90.0, 90.0, poses)))
    angles = ThreeUPSRPU.weeder()
    chosen = judge(math.degrees(angles.base_angles_rad[2]), math.degrees(angles.platform_angles_rad[2]), poses)
    print(line("ThreeUPSRPU.weeder()", chosen))
    print(f"ThreeUPSRPU.weeder(): largest condition number of G {angles.conditioning(poses).number.max():.2f}")


if __name__ == "__main__":
    main()
