"""What policies are shown: names and scales of the observation's columns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .config import STAGES

MACHINE_FEATURES = ("ahead", "across", "height", "time", "stops_left", "remaining")
CANDIDATE_FEATURES = ("present", "along", "across", "height", "travel", *STAGES, "size", "reachable")

AHEAD_SCALE_M = 0.3
ACROSS_SCALE_M = 0.15
HEIGHT_SCALE_M = 0.2
TRAVEL_SCALE_S = 4.0
SIZE_SCALE_M = 0.05
"""What the features are divided by, to be of order one."""


def candidate_table(observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
    """Candidates (..., K, F) of an observation, one column a name of ``CANDIDATE_FEATURES``."""
    flat = observation["candidates"]
    return flat.reshape(*flat.shape[:-1], -1, len(CANDIDATE_FEATURES))
