"""What the gripper does to an item: how well the fingers fit, whether they hold. Pure array functions."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..core import Array
from .config import GripConfig


def grip_quality(
    grip: GripConfig, off_centre_square: Array, off_height: Array, yaw_misfit_square: Array, tilt_misfit_square: Array
) -> Array:
    """How well the fingers fit an item, in [0, 1]; zero where they close beside it.

    Args:
        grip: parameters of the gripper.
        off_centre_square: square of the horizontal distance of the tool from the item's centre, (...), m2.
        off_height: vertical distance, (...), metres.
        yaw_misfit_square: square of (1 - width / length) times the sine of the angle between finger direction and
            long axis, (...).
        tilt_misfit_square: square of (1 - thickness / length) times the sine of the angle between tool axis and short
            axis, (...).
    """
    loss = off_centre_square * (0.5 / grip.centre_sigma_m**2) + off_height * off_height * (0.5 / grip.height_sigma_m**2)
    loss += (yaw_misfit_square + tilt_misfit_square) * (0.5 / grip.misfit_sigma**2)
    return np.exp(-loss) * (off_centre_square <= grip.capture_m**2)


def holds(grip: GripConfig, quality: Array, luck: Array) -> NDArray[np.bool_]:
    """Whether the fingers hold the item when they lift it; ``luck`` is uniform in [0, 1). Shapes (...)."""
    return luck < grip.best * quality


def slips(grip: GripConfig, quality: Array, luck: Array) -> NDArray[np.bool_]:
    """Whether a held item slips out on the way to the bin. Shapes (...)."""
    return luck < grip.slip * (1.0 - quality)
