"""Numbers of the hoe: machine, process, and the weeding task that they make.

Every number says where it comes from: [published], [identified] or [assumed], as in ``config``. A round blade is
plunged beside the plant, led once around it and lifted. Sources:

- Kurstjens, Perdok, Goense 2000, Selective uprooting by weed harrowing on sandy soils, Weed Research 40:431-447.
- Tillett, Hague, Grundy, Dedousis 2008, Mechanical within-row weed control for transplanted crops using computer
  vision, Biosystems Engineering 99:171-178: 62-87 % fewer weeds around the crop plants.
- Pot experiments with sugar beets: "Informing the operation of intelligent automated intrarow weeding machines in
  direct-sown sugar beet: effects of hoeing and flaming across early growth stages, tool working distances, and
  intensities".
- Reiser et al. 2019, Agriculture 9:18: a rotary intra-row weeder on a robot, 40 mm deep.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf, pi, sqrt

import numpy as np

from .....motion import QUINTIC
from ....core import Array
from ...config import FieldTask

INTENSITIES = ("gentle", "normal", "deep")
PHASES = ("plunge", "stir", "lift")


@dataclass(frozen=True)
class HoeProcessConfig:
    """Uprooting one weed: the blade, the three intensities, and what plants can take."""

    depth_m: tuple[float, float, float] = (0.012, 0.022, 0.035)
    """Depth of the blade at the intensities gentle, normal, deep [assumed, within the published 10-40 mm]."""
    stir_radius_m: tuple[float, float, float] = (0.005, 0.009, 0.013)
    """Radius of the circle that the blade is led on [assumed]."""
    blade_radius_m: float = 0.014
    """Radius of the round blade [assumed; at least as large as the circle, so that nothing in its middle is left]."""
    clearance_m: float = 0.055
    """Height of the blade over the ground when it moves from plant to plant [assumed: over the leaves]."""
    plunge_velocity_m_s: float = 1.0
    plunge_acceleration_m_s2: float = 10.0
    """Limits of plunge and lift [assumed]."""
    stir_velocity_m_s: float = 0.6
    stir_acceleration_m_s2: float = 10.0
    """Limits of the blade on its circle [assumed]."""
    soil_resistance_pa: float = 4.0e4
    """Resistance of the soil per area that the blade meets, its width x its depth [assumed: a loose seedbed]."""
    root_m: tuple[float, float, float] = (0.006, 0.010, 0.016)
    """Radius of a weed's root zone by stage [assumed]."""
    depth50_m: float = 0.006
    """Depth, over the whole root zone, that uproots half of the two-leaf broadleaves [assumed: a normal stir that is
    well aimed then takes five of six of them; within-row hoes take 62-87 % of all weeds: published]."""
    slope: float = 1.3
    """Steepness of the logistic in ln(depth) [identified: from 10 to 30 mm the share of uprooted plants doubles, at
    51 % on average (Kurstjens et al. 2000)]."""
    stage_factor: tuple[float, float, float] = (0.5, 1.0, 2.0)
    """Depth at cotyledon, two-leaf and four-leaf stage relative to two-leaf [assumed; roots hold better: published]."""
    grass_factor: float = 1.3
    """Depth of grasses relative to broadleaves [assumed; their tufted roots hold better]."""
    crop_root_m: float = 0.010
    """Radius of a crop plant's root zone [published: beets were hoed up to 10 mm from their middle without harm]."""
    crop_depth50_m: float = 0.012
    """Depth over its whole root zone that loses half of the crop plants [assumed: as a four-leaf weed]."""
    crop_slope: float = 2.0
    """Steepness for crop plants [assumed]."""

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name, value in vars(self).items():
            values = value if isinstance(value, tuple) else (value,)
            if len(values) != (3 if isinstance(getattr(type(self), name), tuple) else 1):
                raise ValueError(f"HoeProcessConfig.{name} = {value}: give three numbers")
            if not all(0.0 < v < inf for v in values):
                raise ValueError(f"HoeProcessConfig.{name} = {value}: give positive, finite numbers")
        if max(self.stir_radius_m) > self.blade_radius_m:
            raise ValueError(
                f"stir_radius_m = {self.stir_radius_m}: at most blade_radius_m = {self.blade_radius_m}, or the "
                "middle of the circle would be left unworked"
            )

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
        return force * (2.0 * pi * radius + depth)


def circle_s(radius_m: float, velocity_m_s: float, acceleration_m_s2: float) -> float:
    """Seconds of one turn from rest to rest on a circle, the angle on the quintic law, under the two limits.

    With angle 2 pi s(tau) the speed is 2 pi r s' / T, the acceleration 2 pi r hypot(s'', 2 pi s'^2) / T^2.
    """
    tau = np.linspace(0.0, 1.0, 2001)
    law = QUINTIC.sample(tau, 1.0, 1.0)
    pull = np.hypot(law.acceleration, 2.0 * pi * law.velocity**2).max()
    way = 2.0 * pi * radius_m
    return max(QUINTIC.peak_velocity * way / velocity_m_s, sqrt(way * float(pull) / acceleration_m_s2))


@dataclass(frozen=True)
class HoeReach:
    """Where the blade can work under the cart; within it every pose respects every limit of ``ThreePRRS.hoe()``."""

    travel_m: float = 0.14
    """Range of the blade along the row, +-, while it follows a plant; moves may overshoot it by up to 0.04 m [assumed,
    checked against the limits]."""
    half_width_m: float = 0.20
    """Range to either side [assumed, as above]."""
    velocity_m_s: float = 1.0
    acceleration_m_s2: float = 10.0
    """Limits of a move over ground, along and across by themselves [assumed]."""

    def __post_init__(self) -> None:
        """Check that all are positive."""
        for name, value in vars(self).items():
            if not 0.0 < value < inf:
                raise ValueError(f"HoeReach.{name} = {value}: give a positive, finite number")


@dataclass(frozen=True)
class HoeWeedingConfig(FieldTask):
    """Everything that defines a weeding task with the hoe."""

    reach: HoeReach = field(default_factory=HoeReach)
    process: HoeProcessConfig = field(default_factory=HoeProcessConfig)

    @property
    def front_m(self) -> float:
        """The window begins this far in front of the machine's middle; it ends as far behind it."""
        return self.reach.travel_m

    @property
    def half_width_m(self) -> float:
        """Reach to either side."""
        return self.reach.half_width_m

    def label_work_s(self, species: int, stage: int) -> float:
        """Seconds of the stir that a kind calls for."""
        from .process import label_mode

        return float(self.process.work_s[label_mode(self.process, species, stage)].sum())
