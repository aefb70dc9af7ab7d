"""What a machine believes of its field beside what is true, for people who watch."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .core import Array

OPEN, DONE, LOST = range(3)
"""How a true target stands: to be done, done, or gone."""


class Belief(NamedTuple):
    """One world, at a decision. Places are world metres.

    Attributes:
        slot_m: (K, 3), where the candidate of each slot is believed to be; NaN in an empty slot.
        to_m: (K, 3), where it would be brought to, where a task decides that too; else None.
        true_m: (n, 3), the true targets.
        stands: (n,), how each of them stands: ``OPEN``, ``DONE`` or ``LOST``.
        size_m: radius of a mark about a target.
        drift_m_s: (3,), how places move on until the next decision.
        options: names of the ways to treat a candidate.
        extras: names of the actions that belong to no candidate.
        blocks: names of the repetitions of all that, see ``agents.policies.layout``.
        candidate: declares the features of a candidate.
    """

    slot_m: Array
    to_m: Array | None
    true_m: Array
    stands: NDArray[np.int64]
    size_m: float
    drift_m_s: Array
    options: tuple[str, ...]
    extras: tuple[str, ...]
    blocks: tuple[str, ...]
    candidate: type[Any]


STILL = np.zeros(3)
STILL.setflags(write=False)


def placed(rows: NDArray[np.int64], empty: int, place_m: Array) -> Array:
    """Places (K, 3) of the reports in slots (K,), NaN where a slot holds the ``empty`` one."""
    found = place_m[rows].astype(np.float64)
    found[rows == empty] = np.nan
    return found
