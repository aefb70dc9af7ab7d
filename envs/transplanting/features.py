"""What policies are shown: names and scales of the observation's columns."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

MACHINE_FEATURES = ("place", "down", "time", "source_rows", "target_rows", "ready", "gaps")
CANDIDATE_FEATURES = ("present", "source", "target", "carry", "approach", "source_poor", "clear")

PLACE_SCALE_M = 0.3
MOVE_SCALE_S = 1.0
"""What the features are divided by, to be of order one."""


def candidate_table(observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
    """Candidates (..., K, F) of an observation, one column a name of ``CANDIDATE_FEATURES``."""
    flat = observation["candidates"]
    return flat.reshape(*flat.shape[:-1], -1, len(CANDIDATE_FEATURES))
