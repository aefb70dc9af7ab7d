"""What all weeders' scorecards come to in a grower's units: hectares an hour."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..core import Array
from ..rates import Rates, Scores

_MOVES, _NEAR = 200, 0.7
"""Moves from plant to plant: anywhere across the row, along it by this share of the reach at most [identified: the
motors' mean power is then within a fifth of what ``fifo`` and ``nearest`` ask of both machines on their own moves]."""


def weeding_rates(motor_w: Mapping[str, float], demanded: float) -> Rates:
    """How scorecards of a weeder are read whose motors take ``motor_w`` watts by phase and that owes a share."""
    return Rates("ha", lambda scores: scores["ha_per_h"], _tool_j, motor_w, "crop_loss_percent", demanded)


def _tool_j(scores: Scores) -> float:
    """Energy of all works."""
    return scores["joules_per_weed"] * max(scores["done"], 1.0)


def moves(reach: Array) -> tuple[Array, Array]:
    """Starts and strokes (n, .) of moves between plants that follow each other along the row, the same on every call.

    Args:
        reach: half the range of each coordinate, the one across the row last.
    """
    generator = np.random.default_rng(0)
    first, last = generator.uniform(-1.0, 1.0, (2, _MOVES, len(reach)))
    last[:, :-1] = np.clip(first[:, :-1] + _NEAR * last[:, :-1], -1.0, 1.0)
    return first * reach, (last - first) * reach
