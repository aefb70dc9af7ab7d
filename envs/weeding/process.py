"""What the laser does to plants: doses, overlap of spot and growing point, and what they can take. Pure functions."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..core import Array, Rows
from .config import DOSES, STAGES, ProcessConfig

EXPECTED_OVERLAP = 0.7
"""Share of a shot that reaches the growing point at an aim error of 1.5 mm an axis; for choosing doses only."""
LABEL_KILL = 0.8
"""A dose is recommended for a kind of weed when it is expected to kill this share."""


def ed50_j(process: ProcessConfig, species: ArrayLike, stage: ArrayLike) -> Array:
    """Centred dose (...) that kills half of the weeds of a kind (indices into ``SPECIES`` and ``STAGES``)."""
    factor = np.asarray(process.stage_factor)[np.asarray(stage)]
    return process.ed50_j * factor * np.where(np.asarray(species) == 1, process.grass_factor, 1.0)


def kill_probability(process: ProcessConfig, dose_j: ArrayLike, species: ArrayLike, stage: ArrayLike) -> Array:
    """Logistic in the logarithm of the dose on the growing point (Marx et al. 2012); shapes broadcast."""
    ratio = ed50_j(process, species, stage) / np.maximum(dose_j, 1e-9)
    return 1.0 / (1.0 + ratio**process.slope)


def tolerance_j(process: ProcessConfig, species: ArrayLike, stage: ArrayLike, luck: Array) -> Array:
    """Dose at which one plant dies: the logistic's quantile, so a dose d kills with ``kill_probability(d)``."""
    odds = luck / (1.0 - luck)
    return ed50_j(process, species, stage) * odds ** (1.0 / process.slope)


def overlap(spot_radius_m: float, plant_radius_m: ArrayLike, square_m2: ArrayLike) -> Array:
    """Share of a shot that reaches a growing point at squared offset ``square_m2``.

    A Gaussian beam of 1/e2 radius w over a Gaussian growing point of radius r: exp(-2 e^2 / (w^2 + r^2)), 1 when
    centred: doses are quoted for centred shots.
    """
    return np.exp(np.multiply(square_m2, -2.0) / (spot_radius_m**2 + np.square(plant_radius_m)))


def label_dose(process: ProcessConfig, species: int, stage: int) -> int:
    """Lowest dose level that is expected to kill four of five weeds of a kind, else the highest."""
    chance = kill_probability(process, EXPECTED_OVERLAP * np.asarray(process.dose_j), species, stage)
    enough = np.flatnonzero(chance >= LABEL_KILL)
    return int(enough[0]) if len(enough) else len(DOSES) - 1


class LaserProcess:
    """The laser as a weeding process (see ``WeedingProcess``): a correction of the aim, then the burn."""

    modes = DOSES
    phases = ("correct", "burn")

    def __init__(self, config: ProcessConfig):
        """Tabulate by dose level."""
        self.config = config
        self.energy_j = np.asarray(config.dose_j)
        self.work_s = np.column_stack([np.full(len(DOSES), config.correct_s), self.energy_j / config.power_w])
        radius = np.array([*config.meristem_m, config.crop_heart_m])
        self._falloff = -2.0 / (config.spot_radius_m**2 + radius * radius)

    def tolerance(self, species: NDArray[np.int64], stage: NDArray[np.int64], luck: Array) -> Array:
        """Dose (...) that kills each weed."""
        return tolerance_j(self.config, species, stage, luck)

    def crop_tolerance(self, luck: Array) -> Array:
        """Dose (...) that kills each crop plant."""
        return self.config.crop_ed50_j * (luck / (1.0 - luck)) ** (1.0 / self.config.crop_slope)

    def dose(self, mode: Rows, square_m2: Array, kind: NDArray[np.int64]) -> Array:
        """Dose (B, W) that reaches the growing points of plants of a kind: a weed's stage, or 3 for a crop plant."""
        return self.energy_j.take(mode)[:, None] * np.exp(square_m2 * self._falloff.take(kind))


def chance_table(process: ProcessConfig) -> Array:
    """Expected kill probability (species, stage, dose) of a shot at the usual aim error."""
    species, stage = np.meshgrid([0, 1], np.arange(len(STAGES)), indexing="ij")
    doses = EXPECTED_OVERLAP * np.asarray(process.dose_j)
    return kill_probability(process, doses, species[..., None], stage[..., None])
