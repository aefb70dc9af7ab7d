"""What the hoe does: how long a stir takes, what it sweeps, and what that does to roots.

Every number says where it comes from: [published], [identified] or [assumed], as in ``config``. A round blade is
plunged beside the plant, led once around it and lifted. What it sweeps is a disc about the aim. A plant's root zone is
a disc about its stem; the dose is the depth of the blade times the share of the root zone that was swept, in metres.
Doses add up. Sources:

- Kurstjens, Perdok, Goense 2000, Selective uprooting by weed harrowing on sandy soils, Weed Research 40:431-447.
- Tillett, Hague, Grundy, Dedousis 2008, Mechanical within-row weed control for transplanted crops using computer
  vision, Biosystems Engineering 99:171-178: 62-87 % fewer weeds around the crop plants.
- Pot experiments with sugar beets: "Informing the operation of intelligent automated intrarow weeding machines in
  direct-sown sugar beet: effects of hoeing and flaming across early growth stages, tool working distances, and
  intensities".
- Reiser et al. 2019, Agriculture 9:18: a rotary intra-row weeder on a robot, 40 mm deep.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .....kernels import bind, compiled
from .....kernels.config import Config, num
from .....kernels.discs import covered_share
from .....motion import QUINTIC
from ....columns import Says, numbered
from ....core import Array
from ...response import Response

EXPECTED_SHARE = 0.95
"""Share of the root zone that a stir sweeps at the front camera's and the odometry's error; for choosing
intensities only."""

INTENSITIES = ("gentle", "normal", "deep")


class Stirring(NamedTuple):
    """Phases of a stir."""

    plunge: Annotated[int, Says("s", "down to the depth, out to the circle")]
    stir: Annotated[int, Says("s", "once around")]
    lift: Annotated[int, Says("s", "up again")]


B = numbered(Stirring)


@dataclass(frozen=True)
class HoeProcessConfig(Config):
    """Uprooting one weed: the blade, the three intensities, and what plants can take."""

    depth_m: tuple[float, float, float] = num((0.012, 0.022, 0.035), 1e-4, 0.2, "m")
    """Depth of the blade at the intensities gentle, normal, deep [assumed, within the published 10-40 mm]."""
    stir_radius_m: tuple[float, float, float] = num((0.005, 0.009, 0.013), 1e-4, 0.1, "m")
    """Radius of the circle that the blade is led on [assumed]."""
    blade_radius_m: float = num(0.014, 1e-3, 0.1, "m")
    """Radius of the round blade [assumed; at least as large as the circle, so that nothing in its middle is left]."""
    clearance_m: float = num(0.055, 1e-3, 0.5, "m")
    """Height of the blade over the ground when it moves from plant to plant [assumed: over the leaves]."""
    plunge_velocity_m_s: float = num(1.0, 0.01, 50.0, "m/s")
    """Limit of plunge and lift [assumed]."""
    plunge_acceleration_m_s2: float = num(10.0, 0.1, 1000.0, "m/s2")
    """Limit of plunge and lift [assumed]."""
    stir_velocity_m_s: float = num(0.6, 0.01, 50.0, "m/s")
    """Limit of the blade on its circle [assumed]."""
    stir_acceleration_m_s2: float = num(10.0, 0.1, 1000.0, "m/s2")
    """Limit of the blade on its circle [assumed]."""
    soil_resistance_pa: float = num(4.0e4, 1.0, 1.0e7, "Pa")
    """Resistance of the soil per area that the blade meets, its width x its depth [assumed: a loose seedbed]."""
    root_m: tuple[float, float, float] = num((0.006, 0.010, 0.016), 1e-4, 0.1, "m")
    """Radius of a weed's root zone by stage [assumed]."""
    depth50_m: float = num(0.006, 1e-4, 0.2, "m")
    """Depth, over the whole root zone, that uproots half of the two-leaf broadleaves [assumed: a normal stir that is
    well aimed then takes five of six of them; within-row hoes take 62-87 % of all weeds: published]."""
    slope: float = num(1.3, 0.1, 50.0, "")
    """Steepness of the logistic in ln(depth) [identified: from 10 to 30 mm the share of uprooted plants doubles, at 51
    % on average (Kurstjens et al. 2000)]."""
    stage_factor: tuple[float, float, float] = num((0.5, 1.0, 2.0), 0.01, 100.0, "")
    """Depth at cotyledon, two-leaf and four-leaf stage relative to two-leaf [assumed; roots hold better: published]."""
    grass_factor: float = num(1.3, 0.01, 100.0, "")
    """Depth of grasses relative to broadleaves [assumed; their tufted roots hold better]."""
    crop_root_m: float = num(0.010, 1e-4, 0.1, "m")
    """Radius of a crop plant's root zone [published: beets were hoed up to 10 mm from their middle without harm]."""
    crop_depth50_m: float = num(0.012, 1e-4, 0.2, "m")
    """Depth over its whole root zone that loses half of the crop plants [assumed: as a four-leaf weed]."""
    crop_slope: float = num(2.0, 0.1, 50.0, "")
    """Steepness for crop plants [assumed]."""

    def check(self) -> None:
        """Hold the circle to the blade, the depths to their order."""
        if max(self.stir_radius_m) > self.blade_radius_m:
            self.refuse(
                "stir_radius_m",
                f"give at most blade_radius_m = {self.blade_radius_m}, or the middle of the circle is left unworked",
            )
        if list(self.depth_m) != sorted(self.depth_m):
            self.refuse("depth_m", "give ascending depths")

    @property
    def sweep_m(self) -> Array:
        """Radius (3,) of the disc that is worked, by intensity."""
        return np.asarray(self.stir_radius_m) + self.blade_radius_m

    @property
    def work_s(self) -> Array:
        """Seconds (3, 3) of plunge, stir and lift, by intensity."""
        plunge = [
            float(QUINTIC.duration(self.clearance_m + depth, self.plunge_velocity_m_s, self.plunge_acceleration_m_s2))
            for depth in self.depth_m
        ]
        stir = [circle_s(r, self.stir_velocity_m_s, self.stir_acceleration_m_s2) for r in self.stir_radius_m]
        return np.column_stack([plunge, stir, plunge])

    @property
    def energy_j(self) -> Array:
        """Work (3,) against the soil, by intensity: down, once around, and up again."""
        depth, radius = np.asarray(self.depth_m), np.asarray(self.stir_radius_m)
        force = self.soil_resistance_pa * 2.0 * self.blade_radius_m * depth
        # On the way down and up the force grows and falls with the depth.
        return force * (2.0 * math.pi * radius + depth)

    @property
    def response(self) -> Response:
        """What plants can take, in metres of depth over their whole root zone."""
        gentle, normal, deep = (EXPECTED_SHARE * depth for depth in self.depth_m)
        weeds = self.depth50_m, self.slope, self.stage_factor, self.grass_factor
        return Response(*weeds, self.crop_depth50_m, self.crop_slope, (gentle, normal, deep))


def circle_s(radius_m: float, velocity_m_s: float, acceleration_m_s2: float) -> float:
    """Seconds of one turn from rest to rest on a circle, the angle on the quintic law, under the two limits.

    With angle 2 pi s(tau) the speed is 2 pi r s' / T, the acceleration 2 pi r hypot(s'', 2 pi s'^2) / T^2.
    """
    tau = np.linspace(0.0, 1.0, 2001)
    law = QUINTIC.sample(tau, 1.0, 1.0)
    pull = np.hypot(law.acceleration, 2.0 * math.pi * law.velocity**2).max()
    way = 2.0 * math.pi * radius_m
    return max(QUINTIC.peak_velocity * way / velocity_m_s, math.sqrt(way * float(pull) / acceleration_m_s2))


class Stir(NamedTuple):
    """A stir in the shape that kernels take (see ``WeedingProcess.work``).

    Attributes:
        depth_m: by intensity.
        leaf_m: radius of the swept disc, by intensity; leaves over it are torn off or buried.
        root_m: radius of the root zone, by kind of plant.
        reach_m: beyond this distance no root zone is touched.
    """

    depth_m: tuple[float, float, float]
    leaf_m: tuple[float, float, float]
    root_m: tuple[float, float, float, float]
    reach_m: float

    @classmethod
    def of(cls, process: HoeProcessConfig) -> Stir:
        """The numbers of a configuration."""
        gentle, normal, deep = map(float, process.depth_m)
        sweep = process.sweep_m.tolist()
        a, b, c = map(float, process.root_m)
        d = float(process.crop_root_m)
        return cls((gentle, normal, deep), (sweep[0], sweep[1], sweep[2]), (a, b, c, d), max(sweep) + max(a, b, c, d))


@compiled
def dose(work: Stir, mode: int, along_m: float, across_m: float, kind: int) -> float:
    """Depth over the root zone of a plant at an offset from the stir's middle, metres."""
    distance = math.sqrt(along_m * along_m + across_m * across_m)
    return work.depth_m[mode] * covered_share(work.leaf_m[mode], work.root_m[kind], distance)


bind(Stir, dose)


def crop_loss(process: HoeProcessConfig, gap_m: ArrayLike) -> Array:
    """Probability (..., 3) that a stir at distances (...) from a crop plant loses it, by intensity."""
    gap = np.atleast_1d(np.asarray(gap_m, dtype=np.float64))
    share = np.array([[covered_share(r, process.crop_root_m, d) for r in process.sweep_m] for d in gap.ravel()])
    return process.response.crop_chance(np.asarray(process.depth_m) * share.reshape(*gap.shape, 3))


class HoeProcess:
    """The hoe as a weeding process (``process.WeedingProcess``): plunge, one turn, lift. There is no tool camera."""

    modes = INTENSITIES
    phases = Stirring

    def __init__(self, config: HoeProcessConfig):
        """Tabulate by intensity."""
        self.work, self.response = Stir.of(config), config.response
        self.energy_j, self.work_s = config.energy_j, config.work_s
