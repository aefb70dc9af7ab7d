"""What the tool does to a head: shear strokes cut filaments, suction collects them. Scalar formulas, compiled."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...kernels import compiled
from .config import ProcessConfig


class Shears(NamedTuple):
    """What a cut depends on beside the head: ``ProcessConfig`` in the shape that a kernel takes.

    Attributes:
        stroke_cut: share that one stroke cuts with no error.
        radial_per_m2: how the exponent of that share falls with the square of the radial error, negative.
        upright_per_m2: the same for the error in height.
        capture_m2: square of the radius beyond which the head stays outside the shear hole.
    """

    stroke_cut: float
    radial_per_m2: float
    upright_per_m2: float
    capture_m2: float

    @classmethod
    def of(cls, process: ProcessConfig) -> Shears:
        """The numbers of a configuration."""
        return cls(
            float(process.stroke_cut),
            -0.5 / process.cut_radius_m**2,
            -0.5 / process.cut_height_m**2,
            float(process.capture_radius_m) ** 2,
        )


@compiled
def lucky(share: float, rest: float, odds: float) -> float:
    """Multiply the odds share : rest, the two adding up to 1; 0 and 1 stay what they are."""
    gain = share * odds
    return gain / (gain + rest)


@compiled
def cut_share(shears: Shears, strokes: float, along_m: float, across_m: float, up_m: float, odds: float) -> float:
    """Share of a head's filaments that the strokes cut.

    Every stroke cuts the same share of what is left; the share falls off as a Gaussian with the tool's error, and
    beyond the capture radius the head stays outside the shear hole.

    Args:
        shears: parameters of the tool.
        strokes: number of strokes.
        along_m: head centre minus tool centre along the row; ``across_m`` and ``up_m`` alike.
        across_m: see ``along_m``.
        up_m: see ``along_m``.
        odds: what the head's luck multiplies the odds of being cut with.

    Returns:
        A share in [0, 1]; zero exactly where the head is not captured.
    """
    radial_m2 = along_m * along_m + across_m * across_m
    if radial_m2 > shears.capture_m2:
        return 0.0
    off = radial_m2 * shears.radial_per_m2 + up_m * up_m * shears.upright_per_m2
    uncut = (1.0 - shears.stroke_cut * math.exp(off)) ** strokes
    return lucky(1.0 - uncut, uncut, odds)


def dropped_share(process: ProcessConfig, suction_s: float) -> float:
    """Share of the cut filaments that drops on average after a suction time."""
    return process.suction_loss * math.exp(-suction_s / process.suction_decay_s)


@compiled
def collected_share(dropped: float, odds: float) -> float:
    """Share of the cut filaments that reaches the box, from the average loss and the head's luck."""
    return lucky(1.0 - dropped, dropped, odds)
