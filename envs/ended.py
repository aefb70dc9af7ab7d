"""What worlds of a batch that are over go on showing."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

Flags = NDArray[np.bool_]
Shown = Mapping[str, NDArray]  # type: ignore[type-arg]


class Ended:
    """The last rows of the worlds that are over, by the name of what is shown; batched rules know no world that rests.

    Attributes:
        rows: by name, an array with a leading world axis.
    """

    def __init__(self) -> None:
        """Nothing has ended yet."""
        self.rows: dict[str, NDArray] = {}  # type: ignore[type-arg]

    def keep(self, ending: Flags, shown: Shown) -> None:
        """Take what the worlds ``ending`` (B,) show now."""
        for name, values in shown.items():
            if name not in self.rows:
                self.rows[name] = np.zeros_like(values)
            self.rows[name][ending] = values[ending]

    def show(self, over: Flags, shown: Shown) -> None:
        """Write into ``shown`` what the worlds ``over`` (B,) ended with."""
        if over.any():
            for name, values in shown.items():
                values[over] = self.rows[name][over]
