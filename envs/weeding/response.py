"""What plants can take of a tool's work: logistic in the logarithm of its dose, by kind (Marx et al. 2012)."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...kernels import compiled
from ...kernels.elementary import power
from ..core import Array
from .config import SPECIES, STAGES

LABEL_KILL = 0.8
"""A mode is recommended for a kind of weed when it is expected to kill this share."""


class Response(NamedTuple):
    """Doses that kill, in the unit of the tool's own.

    Attributes:
        half: kills half of the two-leaf broadleaves.
        slope: of the logistic.
        stage_factor: dose by stage relative to two-leaf.
        grass_factor: dose of grasses relative to broadleaves.
        crop_half: kills half of the crop plants.
        crop_slope: of their logistic.
        expected: by mode, what arrives at the tool's usual error; for choosing modes only.
    """

    half: float
    slope: float
    stage_factor: tuple[float, float, float]
    grass_factor: float
    crop_half: float
    crop_slope: float
    expected: tuple[float, float, float]

    def half_of(self, species: ArrayLike, stage: ArrayLike) -> Array:
        """Dose (...) that kills half of a kind (indices into ``SPECIES`` and ``STAGES``)."""
        factor = np.asarray(self.stage_factor)[np.asarray(stage)]
        return self.half * factor * np.where(np.asarray(species) == 1, self.grass_factor, 1.0)

    def chance(self, dose: ArrayLike, species: ArrayLike, stage: ArrayLike) -> Array:
        """Probability that a dose kills a weed; shapes broadcast."""
        return 1.0 / (1.0 + power(self.half_of(species, stage) / np.maximum(dose, 1e-9), self.slope))

    def crop_chance(self, dose: ArrayLike) -> Array:
        """Probability that a dose kills a crop plant."""
        return 1.0 / (1.0 + power(self.crop_half / np.maximum(dose, 1e-9), self.crop_slope))

    def chances(self) -> Array:
        """Expected probability (species, stage, mode) of a kill."""
        species, stage = np.meshgrid(np.arange(len(SPECIES)), np.arange(len(STAGES)), indexing="ij")
        return self.chance(self.expected, species[..., None], stage[..., None])

    def labels(self) -> NDArray[np.int64]:
        """Mode (species, stage) that a kind calls for: the lowest that is expected to kill enough, else the highest."""
        enough = self.chances() >= LABEL_KILL
        return np.where(enough.any(axis=-1), enough.argmax(axis=-1), enough.shape[-1] - 1)


@compiled
def tolerance(response: Response, species: int, stage: int, luck: float) -> float:
    """Dose that kills a weed: the logistic's quantile, ``luck`` uniform in (0, 1)."""
    half = response.half * response.stage_factor[stage] * (response.grass_factor if species == 1 else 1.0)
    return half * math.pow(luck / (1.0 - luck), 1.0 / response.slope)


@compiled
def crop_tolerance(response: Response, luck: float) -> float:
    """Dose that kills a crop plant, as ``tolerance``."""
    return response.crop_half * math.pow(luck / (1.0 - luck), 1.0 / response.crop_slope)
