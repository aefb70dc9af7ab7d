"""What policies are shown: names and scales of the observation's columns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .config import GRADES

MACHINE_FEATURES = ("x", "y", "turned", "time", "in_view")
CANDIDATE_FEATURES = (
    *("present", "along", "across", "cos_2yaw", "sin_2yaw", "tilt", "turn", "length"),
    *GRADES,
    *("value", "quality", "approach", "wait", "cycle", "slack", "possible"),
)

PLACE_SCALE_M = 0.2
TILT_SCALE_RAD = 0.35
TURN_SCALE_RAD = 1.0
LENGTH_SCALE_M = 0.06
WAIT_SCALE_S = 4.0
CYCLE_SCALE_S = 2.0
"""What the features are divided by, to be of order one."""


def candidate_table(observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
    """Candidates (..., K, F) of an observation, one column a name of ``CANDIDATE_FEATURES``."""
    flat = observation["candidates"]
    return flat.reshape(*flat.shape[:-1], -1, len(CANDIDATE_FEATURES))
