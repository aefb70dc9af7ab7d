"""What the weeding rules ask of a tool; they know nothing else about it.

A tool is two sets of numbers, NamedTuples of plain floats and tuples: its *arm* and its *work* on plants. Four
functions of them do the rest: ``approach``, ``move_time`` and ``ready`` of an arm, ``dose`` of a work. Each tool
compiles its own and binds them to the types of its numbers with ``bind``; kernels that are handed these numbers then
contain the tool's code. A tool's functions live in this folder: kept machine code is renewed when a file in it changes.

An arm's *place* is three coordinates in which motions are rest to rest over ground: its carrier along the row (world
metres), what the tool leans or reaches beyond it along the row, and the tool's place across. The tool works at
(carrier + lean, across) while the cart drives on below a carrier that stands still over ground.
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from ..compiled import bind, by_kind
from ..core import Array

__all__ = ["Approach", "Arm", "Place", "WeedingProcess", "Work", "approach", "bind", "dose", "move_time", "ready"]

Place = tuple[float, float, float]
"""Carrier, lean and across, metres."""


class Approach(NamedTuple):
    """How the machine would work on one target in one mode.

    Attributes:
        carrier_m: place of the arm during the work; ``lean_m`` and ``across_m`` alike.
        lean_m: see ``carrier_m``.
        across_m: see ``carrier_m``.
        move_s: duration of the motion there.
        wait_s: how much longer it takes until the target is within the window.
        legal: whether it can be followed for the whole standing time.
    """

    carrier_m: float
    lean_m: float
    across_m: float
    move_s: float
    wait_s: float
    legal: bool


class Arm(Protocol):
    """Numbers of a machine that every tool's arm has; all floats."""

    @property
    def front_m(self) -> float:
        """The window begins this far in front of the machine's middle and ends as far behind it."""
        ...

    @property
    def half_width_m(self) -> float:
        """Reach to either side."""
        ...

    @property
    def scale(self) -> tuple[float, float, float]:
        """What a place relative to the cart is divided by before policies are shown it."""
        ...


class Work(Protocol):
    """Numbers of a process that every tool's work on plants has."""

    @property
    def reach_m(self) -> float:
        """Beyond this distance the work does nothing."""
        ...


class WeedingProcess(Protocol):
    """What a tool does to plants. Doses add up; a plant dies when its sum reaches its tolerance."""

    @property
    def modes(self) -> tuple[str, str, str]:
        """Names of the three modes."""
        ...

    @property
    def phases(self) -> tuple[str, ...]:
        """Names of the phases on the target."""
        ...

    @property
    def work(self) -> Any:
        """Numbers for ``dose``; see ``Work``."""
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


@by_kind
def approach(
    arm: Any, stand_s: float, place: Place, cart_m: float, speed_m_s: float, along_m: float, across_m: float
) -> Approach:
    """How the machine at ``place`` would work on a target.

    Args:
        arm: the arm's numbers.
        stand_s: seconds that the tool has to stand over ground.
        place: where the arm stands now.
        cart_m: cart position now.
        speed_m_s: the cart's speed, > 0.
        along_m: the target in the world; ``across_m`` alike.
        across_m: see ``along_m``.
    """
    raise NotImplementedError


@by_kind
def move_time(arm: Any, carrier_m: float, lean_m: float, across_m: float) -> float:
    """Seconds of a motion by a stroke in the three coordinates."""
    raise NotImplementedError


@by_kind
def ready(arm: Any, cart_m: float) -> tuple[float, float, float]:
    """Place of the waiting machine at a cart position."""
    raise NotImplementedError


@by_kind
def dose(work: Any, mode: int, along_m: float, across_m: float, kind: int) -> float:
    """Dose on a plant at an offset from the tool's work; its kind is a weed's stage, or 3 for a crop plant."""
    raise NotImplementedError
