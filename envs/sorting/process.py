"""What the gripper does to an item: how well the fingers fit, whether they hold. Scalar formulas, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...kernels import compiled
from .config import GripConfig


class Fingers(NamedTuple):
    """What a grip depends on beside the item: ``GripConfig`` in the shape that a kernel takes.

    Attributes:
        best: share of centred, aligned grips that hold.
        slip: share of held items that slip on the way, times 1 - quality.
        radial_per_m2: how the exponent of the quality falls with the square of the horizontal error, negative.
        height_per_m2: the same for the error in height.
        misfit: the same for the squares of the misfits.
        capture_m2: square of the horizontal error beyond which the fingers close beside the item.
    """

    best: float
    slip: float
    radial_per_m2: float
    height_per_m2: float
    misfit: float
    capture_m2: float

    @classmethod
    def of(cls, grip: GripConfig) -> Fingers:
        """The numbers of a configuration."""
        return cls(
            float(grip.best),
            float(grip.slip),
            -0.5 / grip.centre_sigma_m**2,
            -0.5 / grip.height_sigma_m**2,
            -0.5 / grip.misfit_sigma**2,
            float(grip.capture_m) ** 2,
        )


@compiled
def grip_quality(fingers: Fingers, along_m: float, across_m: float, up_m: float, misfit: float) -> float:
    """How well the fingers fit an item, in [0, 1]; zero where they close beside it.

    Args:
        fingers: parameters of the gripper.
        along_m: tool less item's centre along the belt; ``across_m`` and ``up_m`` alike.
        across_m: see ``along_m``.
        up_m: see ``along_m``.
        misfit: sum of two squares: (1 - width / length) times the sine of the angle between finger direction and long
            axis, and (1 - thickness / length) times the sine of the angle between tool axis and short axis.
    """
    radial_m2 = along_m * along_m + across_m * across_m
    if radial_m2 > fingers.capture_m2:
        return 0.0
    return math.exp(radial_m2 * fingers.radial_per_m2 + up_m * up_m * fingers.height_per_m2 + misfit * fingers.misfit)


@compiled
def holds(fingers: Fingers, quality: float, luck: float) -> bool:
    """Whether the fingers hold the item when they lift it; ``luck`` is uniform in [0, 1)."""
    return luck < fingers.best * quality


@compiled
def slips(fingers: Fingers, quality: float, luck: float) -> bool:
    """Whether a held item slips out on the way to the bin; ``luck`` is uniform in [0, 1)."""
    return luck < fingers.slip * (1.0 - quality)
