"""What the tool does to a head: shear strokes cut filaments, suction collects them. Pure array functions."""

from __future__ import annotations

import numpy as np

from ..core import Array
from .config import ProcessConfig


def cut_share(process: ProcessConfig, strokes: Array | int, error_m: Array, odds: Array) -> Array:
    """Share of a head's filaments that the strokes cut.

    Every stroke cuts the same share of what is left; the share falls off as a Gaussian with the tool's error, and
    beyond the capture radius the head stays outside the shear hole.

    Args:
        process: parameters of the tool.
        strokes: number of strokes, shape (...).
        error_m: head centre minus tool centre (along, across, up), shape (..., 3).
        odds: what the head's luck multiplies the odds of being cut with, shape (...).

    Returns:
        Shares in [0, 1], shape (...); zero exactly where the head is not captured.
    """
    square = error_m * error_m
    radial_square = square[..., 0] + square[..., 1]
    off = radial_square * (-0.5 / process.cut_radius_m**2) + square[..., 2] * (-0.5 / process.cut_height_m**2)
    uncut = np.power(1.0 - process.stroke_cut * np.exp(off), strokes)
    return _lucky(1.0 - uncut, uncut, odds) * (radial_square <= process.capture_radius_m**2)


def dropped_share(process: ProcessConfig, suction_s: Array | float) -> Array:
    """Share of the cut filaments that drops on average after a suction time, shape (...)."""
    return np.asarray(process.suction_loss * np.exp(np.negative(suction_s) / process.suction_decay_s))


def collected_share(dropped: Array, odds: Array) -> Array:
    """Share of the cut filaments that reaches the box, from the average loss and the head's luck; shapes (...)."""
    return _lucky(1.0 - dropped, dropped, odds)


def _lucky(share: Array, rest: Array, odds: Array) -> Array:
    """Multiply the odds share : rest, the two adding up to 1; 0 and 1 stay what they are."""
    gain = share * odds
    return gain / (gain + rest)
