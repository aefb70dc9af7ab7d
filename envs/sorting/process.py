"""What the gripper does to an item: how well the fingers fit, whether they hold. Pure array functions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..core import Array
from .config import GripConfig


def grip_quality(grip: GripConfig, off: Array, misfit: Array) -> Array:
    """How well the fingers fit an item, in [0, 1]; zero where they close beside it.

    Args:
        grip: parameters of the gripper.
        off: tool less item's centre (along, across, up), (3, ...), metres.
        misfit: (2, ...): squares of (1 - width / length) times the sine of the angle between finger direction and long
            axis, and of (1 - thickness / length) times the sine of the angle between tool axis and short axis.
    """
    square = off * off
    radial = square[0] + square[1]
    loss = radial * (0.5 / grip.centre_sigma_m**2)
    loss += square[2] * (0.5 / grip.height_sigma_m**2)
    loss += (misfit[0] + misfit[1]) * (0.5 / grip.misfit_sigma**2)
    return np.exp(-loss) * (radial <= grip.capture_m**2)


def holds(grip: GripConfig, quality: Array, luck: Array) -> NDArray[np.bool_]:
    """Whether the fingers hold the item when they lift it; ``luck`` is uniform in [0, 1). Shapes (...)."""
    return luck < grip.best * quality


def slips(grip: GripConfig, quality: Array, luck: Array) -> NDArray[np.bool_]:
    """Whether a held item slips out on the way to the bin. Shapes (...)."""
    return luck < grip.slip * (1.0 - quality)
