"""How long things take on a weeder: the one time model of rules, planners, bounds and executors, for any tool.

A tool's machine is a set of numbers, its *arm*, a NamedTuple of plain floats and tuples. ``approach``, ``move_time``
and ``ready`` are the arm's own: each tool compiles its own and binds them to the type of its numbers (see ``bind``);
kernels that are handed these numbers then contain the tool's code. How long the work itself takes does not depend on
where it is done, see ``process``.

An arm's *place* is three coordinates in which motions are rest to rest over ground: its carrier along the row (world
metres), what the tool leans or reaches beyond it along the row, and the tool's place across. The tool works at
(carrier + lean, across) while the cart drives on below a carrier that stands still over ground.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple, Protocol

import numpy as np

from ...kernels import by_kind, compiled
from ..columns import Says, numbered
from ..core import Array


class Ground(NamedTuple):
    """A place on the ground."""

    along: Annotated[int, Says("m", "along the row; the strip begins at 0")]
    across: Annotated[int, Says("m", "from the middle of the row, to the left")]


class Coordinates(NamedTuple):
    """An arm's place as a row of an array."""

    carrier: Annotated[int, Says("m", "along the row, over ground")]
    lean: Annotated[int, Says("m", "what the tool leans or reaches beyond the carrier along the row")]
    across: Annotated[int, Says("m", "the tool from the middle of the row")]


class Moving(NamedTuple):
    """Phases of a decision before those of the tool's work; the last of all is ``pause``, the rest of a wait."""

    move: Annotated[int, Says("s", "motion to the target, or to where the machine waits")]
    wait: Annotated[int, Says("s", "until the target is within the window")]


G, A, P = numbered(Ground), numbered(Coordinates), numbered(Moving)
WORK = len(P)
"""The first of the tool's own phases."""


class Place(NamedTuple):
    """An arm's place.

    Attributes:
        carrier_m: along the row, over ground.
        lean_m: what the tool leans or reaches beyond the carrier along the row.
        across_m: the tool from the middle of the row.
    """

    carrier_m: float
    lean_m: float
    across_m: float


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
    def ridges(self) -> Any:
        """What the tool rises and sinks with; see ``ridges.Ridges``."""
        ...

    @property
    def scale(self) -> tuple[float, float, float]:
        """What a place relative to the cart is divided by before policies are shown it."""
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
def ready(arm: Any, cart_m: float) -> Place:
    """Place of the waiting machine at a cart position."""
    raise NotImplementedError


@compiled
def way_of(before: float, after: float, acceleration: float, time_s: float) -> tuple[float, float]:
    """Way and speed of a cart after ``time_s`` in which it goes from one speed to another at a steady rate."""
    if before == after:
        return after * time_s, after
    ramp_s = abs(after - before) / acceleration
    short = min(time_s, ramp_s)
    reached = before + (acceleration if after > before else -acceleration) * short
    way = 0.5 * (before + reached) * short + after * (time_s - short)
    return way, after if time_s >= ramp_s else reached


@compiled
def ways_of(before: float, after: float, acceleration: float, times_s: Array) -> Array:
    """Ways (n,) of ``way_of`` at times (n,)."""
    ways = np.empty(len(times_s))
    for i in range(len(times_s)):
        ways[i], _ = way_of(before, after, acceleration, times_s[i])
    return ways


def whole_steps(phases_s: Array, works: bool, step_s: float) -> tuple[Array, int]:
    """Phases (1, P) cut to whole steps of a simulation, and how many these are: up to one step longer than planned.

    What is missing to a whole step is spent before the work, where the machine stands already, else at the end.
    """
    phases, nominal_s = phases_s.copy(), float(phases_s.sum())
    steps = max(int(np.ceil(nominal_s / step_s - 1e-9)), 1)
    phases[0, P.wait if works else -1] += steps * step_s - nominal_s
    return phases, steps
