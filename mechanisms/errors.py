"""What a mechanism says when a pose cannot be held."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .batching import Array


class UnreachablePoseError(ValueError):
    """A pose lies beyond a limit of the mechanism.

    Attributes:
        limit: name of the violated limit, a key of the mechanism's ``margins``.
        margin: signed distance to that limit, negative outside (SI unit of the limit).
        index: index of the first offending pose in the batch, ``()`` for a single pose.
    """

    def __init__(self, mechanism: str, pose: object, limit: str, margin: float, index: tuple[int, ...] = ()):
        """Compose the one-line message from its parts."""
        self.limit = limit
        self.margin = margin
        self.index = index
        where = f" (batch index {index})" if index else ""
        super().__init__(
            f"{mechanism} cannot reach {pose}{where}: limit '{limit}' is violated by {-margin:.4g}; "
            "choose a pose with margins(pose) >= 0 for every limit"
        )


def raise_beyond_limits(mechanism: str, poses: Array, margins: Mapping[str, Array]) -> None:
    """Raise for the first limit that a pose is beyond.

    Args:
        mechanism: its name.
        poses: (..., k).
        margins: by limit, (...); NaN counts as beyond, so what makes a margin NaN comes before it.

    Raises:
        UnreachablePoseError: names the limit and the first pose that is beyond it.
    """
    for name, margin in margins.items():
        bad = np.argwhere(~(np.asarray(margin) >= 0.0))
        if len(bad):
            index = tuple(int(i) for i in bad[0])
            raise UnreachablePoseError(mechanism, poses[index].tolist(), name, float(margin[index]), index)


def positive_length(**lengths_m: float) -> None:
    """Raise ``ValueError`` naming the first length that is not a positive finite number of metres."""
    for name, value in lengths_m.items():
        if not 0.0 < value < float("inf"):
            raise ValueError(f"{name} = {value} m is not a length: give a positive, finite number of metres")
