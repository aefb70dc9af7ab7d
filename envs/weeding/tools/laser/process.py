"""What the laser does to plants: doses, overlap of spot and growing point, and what they can take."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, NamedTuple

import numpy as np

from .....kernels import bind, compiled
from .....kernels.config import Config, num
from ....columns import Says, numbered
from ...response import Response

EXPECTED_OVERLAP = 0.7
"""Share of a shot that reaches the growing point at an aim error of 1.5 mm an axis; for choosing doses only."""

DOSES = ("low", "normal", "high")


class Burning(NamedTuple):
    """Phases of a shot."""

    correct: Annotated[int, Says("s", "the tool camera's picture and the correction of the aim")]
    burn: Annotated[int, Says("s", "the beam is on")]


B = numbered(Burning)


@dataclass(frozen=True)
class ProcessConfig(Config):
    """Burning one weed: the beam, the doses, and what plants can take."""

    power_w: float = num(200.0, 1.0, 10_000.0, "W")
    """Optical power on the plant [assumed; CO2 class, so that the published doses take 0.15-1 s]."""
    dose_j: tuple[float, float, float] = num((30.0, 75.0, 200.0), 0.1, 10_000.0, "J")
    """Energy of the dose levels low, normal, high [assumed; they bracket the published 54 J and its stage factors]."""
    correct_s: float = num(0.05, 0.0, 10.0, "s")
    """Tool camera image, correction of the aim and its small motion, before every shot [assumed]."""
    spot_radius_m: float = num(0.003, 1e-4, 0.05, "m")
    """1/e2 radius of the Gaussian spot [assumed: 6 mm, the widest published spot]."""
    ed95_j: float = num(54.0, 0.1, 10_000.0, "J")
    """Dose that kills 95 % of two-leaf broadleaves when centred [published: Marx et al. 2012, CO2 laser]."""
    slope: float = num(4.0, 0.1, 50.0, "")
    """Steepness of the logistic in ln(dose) [assumed]."""
    stage_factor: tuple[float, float, float] = num((0.4, 1.0, 3.0), 0.01, 100.0, "")
    """Dose at cotyledon, two-leaf and four-leaf stage relative to two-leaf [assumed; published trends]."""
    grass_factor: float = num(1.75, 0.01, 100.0, "")
    """Dose of grasses relative to broadleaves [assumed, between 1.5 and 2; monocots need more: published]."""
    meristem_m: tuple[float, float, float] = num((0.0025, 0.0030, 0.0040), 1e-4, 0.05, "m")
    """Radius of the vulnerable middle (growing point and leaf bases) by stage; it widens the overlap [assumed]."""
    crop_ed50_j: float = num(20.0, 0.1, 10_000.0, "J")
    """Dose on a crop plant's growing point that kills half of them [assumed: a two-leaf broadleaf takes 26 J]."""
    crop_slope: float = num(4.0, 0.1, 50.0, "")
    """Steepness for crop plants [assumed]."""
    crop_heart_m: float = num(0.006, 1e-4, 0.05, "m")
    """Radius of a crop plant's growing point [assumed]."""
    leaf_tolerance_j_m2: float = num(1.0e5, 1.0e2, 1.0e9, "J/m2")
    """Energy per area that a crop's leaf does not survive [assumed: it heats 0.3 mm of water, a leaf's, by 80 K]."""

    def check(self) -> None:
        """Hold the doses to their order."""
        if list(self.dose_j) != sorted(self.dose_j):
            self.refuse("dose_j", "give ascending doses")

    @property
    def ed50_j(self) -> float:
        """Dose that kills half of the two-leaf broadleaves: the logistic's 95 % point taken back to 50 %."""
        return self.ed95_j * math.exp(-math.log(0.95 / 0.05) / self.slope)

    @property
    def response(self) -> Response:
        """What plants can take, in joules."""
        low, normal, high = (EXPECTED_OVERLAP * dose for dose in self.dose_j)
        weeds = self.ed50_j, self.slope, self.stage_factor, self.grass_factor
        return Response(*weeds, self.crop_ed50_j, self.crop_slope, (low, normal, high))


class Burn(NamedTuple):
    """A shot in the shape that kernels take (see ``WeedingProcess.work``).

    Attributes:
        energy_j: by dose level.
        leaf_m: radius within which leaves take more than they survive, by dose level.
        per_m2: by kind of plant, how the logarithm of the overlap falls with the squared offset, negative.
        reach_m: where less than a billionth of a shot arrives.
    """

    energy_j: tuple[float, float, float]
    leaf_m: tuple[float, float, float]
    per_m2: tuple[float, float, float, float]
    reach_m: float

    @classmethod
    def of(cls, process: ProcessConfig) -> Burn:
        """The numbers of a configuration."""
        spot = process.spot_radius_m**2
        square = [spot + radius**2 for radius in (*process.meristem_m, process.crop_heart_m)]
        low, normal, high = map(float, process.dose_j)
        a, b, c, d = (-2.0 / width for width in square)
        burnt = [burnt_m(process, joules) for joules in (low, normal, high)]
        reach_m = math.sqrt(0.5 * max(square) * math.log(1e9))
        return cls((low, normal, high), (burnt[0], burnt[1], burnt[2]), (a, b, c, d), reach_m)


def burnt_m(process: ProcessConfig, energy_j: float) -> float:
    """Radius within which a shot burns leaves, metres.

    A Gaussian beam of 1/e2 radius w brings 2 E / (pi w^2) exp(-2 r^2 / w^2) per area; 0 where that is nowhere enough.
    """
    square = process.spot_radius_m**2
    middle_j_m2 = 2.0 * energy_j / (math.pi * square)
    return math.sqrt(0.5 * square * math.log(max(middle_j_m2 / process.leaf_tolerance_j_m2, 1.0)))


@compiled
def dose(work: Burn, mode: int, along_m: float, across_m: float, kind: int) -> float:
    """Energy that reaches a growing point at an offset e from the beam's middle.

    Of a Gaussian beam of 1/e2 radius w over a Gaussian growing point of radius r: exp(-2 e^2 / (w^2 + r^2)), 1 when
    centred: doses are quoted for centred shots.
    """
    return work.energy_j[mode] * math.exp((along_m * along_m + across_m * across_m) * work.per_m2[kind])


bind(Burn, dose)


class LaserProcess:
    """The laser as a weeding process (see ``WeedingProcess``): a correction of the aim, then the burn."""

    modes = DOSES
    phases = Burning

    def __init__(self, config: ProcessConfig):
        """Tabulate by dose level."""
        self.work, self.response = Burn.of(config), config.response
        self.energy_j = np.array(config.dose_j, float)
        self.work_s = np.column_stack([np.full(len(DOSES), config.correct_s), self.energy_j / config.power_w])
