"""What policies are shown: names and scales of the observation's columns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core import Array

MACHINE_FEATURES = ("place", "lean_along", "lean_across", "speed", "set_speed", "progress", "backlog")
CANDIDATE_FEATURES = (
    "present",
    "along",
    "across",
    "leaves",
    "move",
    "wait",
    "grass",
    "cotyledon",
    "two_leaf",
    "four_leaf",
    "crop_gap",
)

ALONG_SCALE_M = 0.3
ACROSS_SCALE_M = 0.2
LEAVES_SCALE_S = 4.0
TIME_SCALE_S = 0.5
SPEED_SCALE = 0.1
CROP_GAP_SCALE_M = 0.05
"""What the features are divided by, to be of order one."""


def candidate_table(observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
    """Candidates (..., K, F) of an observation, one column a name of ``CANDIDATE_FEATURES``."""
    flat = observation["candidates"]
    return flat.reshape(*flat.shape[:-1], -1, len(CANDIDATE_FEATURES))


def track_features(
    report: Array, species: NDArray[np.int64], stage: NDArray[np.int64], gap_m: Array
) -> NDArray[np.float32]:
    """What policies are shown of tracks (..., T) that does not depend on where the machine is."""
    feature = np.zeros((*species.shape, len(CANDIDATE_FEATURES)), np.float32)
    feature[..., 0] = 1.0
    feature[..., 2] = report[..., 1] * (1.0 / ACROSS_SCALE_M)
    feature[..., 6] = species
    feature[..., 7:10] = stage[..., None] == np.arange(3)
    feature[..., 10] = np.minimum(gap_m * (1.0 / CROP_GAP_SCALE_M), 4.0)
    return feature
