"""What cells hold, given what is reported of them: sowing and cameras' errors taken together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..core import Array


def sown(vacancy: float, poor: NDArray[np.floating]) -> Array:
    """What cells hold (..., 3), empty, healthy or poor, of sowings (...,) with these shares of poor seedlings."""
    poor = np.asarray(poor, np.float64)
    return np.stack([np.full(poor.shape, vacancy), (1.0 - vacancy) * (1.0 - poor), (1.0 - vacancy) * poor], axis=-1)


def held(sowing: Array, confusion: Array) -> Array:
    """Chances (..., 3, 3) of each content (last) given each report, of sowings (..., 3); nobody's report says nothing.

    Args:
        sowing: shares of what cells hold.
        confusion: (3, 3), chances of each report (last) of each content.
    """
    both = np.swapaxes(sowing[..., None] * confusion, -1, -2)
    reported = both.sum(axis=-1, keepdims=True)
    return np.where(reported > 0.0, both / np.where(reported > 0.0, reported, 1.0), sowing[..., None, :])
