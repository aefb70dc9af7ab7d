"""Weights of learned policies: plain arrays with names, checked before anything is computed with them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

Weights = Mapping[str, NDArray[np.float32]]

LEARNED = "learned"
"""Name under which a shipped policy is found."""


class PolicyFileError(ValueError):
    """A policy file cannot be used; the message says why and what to do."""


def check_weights(weights: Weights, wanted: Mapping[str, tuple[int, ...]]) -> None:
    """Refuse weights that do not have the wanted names and shapes.

    Raises:
        PolicyFileError: a weight is missing, unknown, of the wrong shape or type, or not finite.
    """
    if set(weights) != set(wanted):
        odd = sorted(set(weights) ^ set(wanted))
        raise PolicyFileError(f"the weights {', '.join(map(repr, odd[:4]))} are missing or unknown")
    for key, shape in wanted.items():
        values = weights[key]
        if values.dtype != np.float32 or values.shape != shape:
            raise PolicyFileError(f"weight {key!r} is {values.dtype} {values.shape}, wanted float32 {shape}")
        if not np.isfinite(values).all():
            raise PolicyFileError(f"weight {key!r} holds numbers that are not finite")


def whole(value: Any, name: str) -> int:
    """A number that a card gives.

    Raises:
        PolicyFileError: it is no whole number.
    """
    if not isinstance(value, int) or isinstance(value, bool):
        raise PolicyFileError(f"{name} = {value!r} is no whole number")
    return value
