"""What the weeding rules ask of a machine and of its process; the rules know nothing else about them."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from ..core import Array, Rows
from .aim import Approach


class WeedingMachine(Protocol):
    """Where a tool can work while the cart drives on, and how long it takes to get there.

    The machine's place is a row of S coordinates in which motions are rest to rest over ground.
    """

    front_m: float
    """The window begins this far in front of the machine's middle and ends as far behind it."""
    half_width_m: float
    """Reach to either side."""

    def ready(self, cart_m: Array) -> Array:
        """Coordinates (B, S) of the waiting machine at cart positions (B,)."""
        ...

    def move_time(self, stroke: Array) -> Array:
        """Seconds (...) of a motion by ``stroke`` (..., S)."""
        ...

    def approach(
        self, stand_s: Array, place: Array, cart_m: Array, speed_m_s: Array, along_m: Array, across_m: Array
    ) -> Approach:
        """Ways to work on targets (B, K) for standing times (M,); see ``aim.approach``."""
        ...

    def corrected(self, place: Array, shift_m: Array) -> Array:
        """Coordinates (B, S) after the tool camera has moved the aim by ``shift_m`` (B, 2)."""
        ...

    def features(self, place: Array, cart_m: Array) -> Array:
        """Three numbers of order one (B, 3) that tell policies where the machine is: place, lean along, lean across."""
        ...


class WeedingProcess(Protocol):
    """What a tool does to plants. Doses add up; a plant dies when its sum reaches its tolerance."""

    @property
    def modes(self) -> tuple[str, ...]:
        """Names of the three modes."""
        ...

    @property
    def phases(self) -> tuple[str, ...]:
        """Names of the phases on the target."""
        ...

    work_s: Array
    """Seconds (M, len(phases)) of each phase by mode."""
    energy_j: Array
    """Energy (M,) by mode."""

    def tolerance(self, species: NDArray[np.int64], stage: NDArray[np.int64], luck: Array) -> Array:
        """Dose (...) that kills each weed; ``luck`` is uniform in (0, 1)."""
        ...

    def crop_tolerance(self, luck: Array) -> Array:
        """Dose (...) that kills each crop plant."""
        ...

    def dose(self, mode: Rows, square_m2: Array, kind: NDArray[np.int64]) -> Array:
        """Dose (B, W) on plants at squared distances ``square_m2`` (B, W) from the tool's work, modes (B,).

        ``kind`` (B, W) is a weed's stage, or 3 for a crop plant.
        """
        ...
