"""What the tool does to a head: shear strokes cut filaments, suction collects them. Pure array functions."""

from __future__ import annotations

import numpy as np

from ..core import Array
from .config import ProcessConfig


def cut_share(process: ProcessConfig, strokes: Array | int, error_m: Array, luck: Array) -> Array:
    """Share of a head's filaments that the strokes cut.

    Every stroke cuts the same share of what is left; the share falls off as a Gaussian with the tool's error, and
    beyond the capture radius the head stays outside the shear hole.

    Args:
        process: parameters of the tool.
        strokes: number of strokes, shape (...).
        error_m: head centre minus tool centre (along, across, up), shape (..., 3).
        luck: standard normal luck of the head, shape (...).

    Returns:
        Shares in [0, 1], shape (...); zero exactly where the head is not captured.
    """
    square = error_m * error_m
    radial_square = square[..., 0] + square[..., 1]
    off = radial_square * (-0.5 / process.cut_radius_m**2) + square[..., 2] * (-0.5 / process.cut_height_m**2)
    uncut = np.power(1.0 - process.stroke_cut * np.exp(off), strokes)
    share = _lucky(1.0 - uncut, process.luck_logit * luck)
    return share * (radial_square <= process.capture_radius_m**2)


def collected_share(process: ProcessConfig, suction_s: Array | float, luck: Array) -> Array:
    """Share of the cut filaments that reaches the box; the rest drops. Shapes (...)."""
    dropped = process.suction_loss * np.exp(np.negative(suction_s) / process.suction_decay_s)
    return _lucky(1.0 - dropped, process.luck_logit * luck)


def _lucky(share: Array, shift: Array) -> Array:
    """Shift a share on the logit scale; 0 and 1 stay what they are."""
    gain = share * np.exp(shift)
    return gain / (gain + (1.0 - share))
