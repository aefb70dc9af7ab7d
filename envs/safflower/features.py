"""What policies are shown: one declaration of the observation's columns, for kernels, spaces and documentation.

A feature is a quantity divided by its scale, to be of order one, and held to the space: what would be larger than
``LIMIT`` is shown as ``LIMIT``.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..columns import Says, numbered

LIMIT = 10.0
"""Largest size of a number that policies are shown."""
AHEAD_SCALE_M = 0.3
ACROSS_SCALE_M = 0.15
HEIGHT_SCALE_M = 0.2
TRAVEL_SCALE_S = 4.0
SIZE_SCALE_M = 0.05
CLOSES_SCALE_S = 100.0


class Machine(NamedTuple):
    """The cart, its arm and the clock."""

    ahead: Annotated[int, Says("m", "arm plane minus the stop's centre along the row", AHEAD_SCALE_M, -LIMIT, LIMIT)]
    across: Annotated[int, Says("m", "tool from the middle of the row", ACROSS_SCALE_M, -LIMIT, LIMIT)]
    height: Annotated[int, Says("m", "tool above the traverse level", HEIGHT_SCALE_M, -LIMIT, LIMIT)]
    time: Annotated[int, Says("", "simulated time / time limit", 1.0, 0.0, LIMIT)]
    stops_left: Annotated[int, Says("", "stops after this one / stops", 1.0, 0.0, 1.0)]
    remaining: Annotated[int, Says("", "reports of this stop that were not picked / slots", 1.0, 0.0, LIMIT)]


class Candidate(NamedTuple):
    """A report; all zero in an empty slot."""

    present: Annotated[int, Says("", "1 where the slot is taken", 1.0, 0.0, 1.0)]
    along: Annotated[int, Says("m", "report minus arm plane along the row", AHEAD_SCALE_M, -LIMIT, LIMIT)]
    across: Annotated[int, Says("m", "report from the middle of the row", ACROSS_SCALE_M, -LIMIT, LIMIT)]
    height: Annotated[int, Says("m", "report above the traverse level", HEIGHT_SCALE_M, -LIMIT, LIMIT)]
    travel: Annotated[int, Says("s", "motion to get there", TRAVEL_SCALE_S, 0.0, LIMIT)]
    bud: Annotated[int, Says("", "1 where a bud is reported", 1.0, 0.0, 1.0)]
    fresh: Annotated[int, Says("", "1 where a fresh bloom is reported", 1.0, 0.0, 1.0)]
    late: Annotated[int, Says("", "1 where a late bloom is reported", 1.0, 0.0, 1.0)]
    dry: Annotated[int, Says("", "1 where a dry head is reported", 1.0, 0.0, 1.0)]
    size: Annotated[int, Says("m", "reported filament spread", SIZE_SCALE_M, -LIMIT, LIMIT)]
    reachable: Annotated[int, Says("", "1 where the tool reaches it", 1.0, 0.0, 1.0)]


class DemandingMachine(NamedTuple):
    """The same where a bag fills up or filaments wilt."""

    ahead: Annotated[int, Says("m", "arm plane minus the stop's centre along the row", AHEAD_SCALE_M, -LIMIT, LIMIT)]
    across: Annotated[int, Says("m", "tool from the middle of the row", ACROSS_SCALE_M, -LIMIT, LIMIT)]
    height: Annotated[int, Says("m", "tool above the traverse level", HEIGHT_SCALE_M, -LIMIT, LIMIT)]
    time: Annotated[int, Says("", "simulated time / time limit", 1.0, 0.0, LIMIT)]
    stops_left: Annotated[int, Says("", "stops after this one / stops", 1.0, 0.0, 1.0)]
    remaining: Annotated[int, Says("", "reports of this stop that were not picked / slots", 1.0, 0.0, LIMIT)]
    bag: Annotated[int, Says("", "filaments in the bag / what fills it", 1.0, 0.0, LIMIT)]


class DemandingCandidate(NamedTuple):
    """The same where a bag fills up or filaments wilt."""

    present: Annotated[int, Says("", "1 where the slot is taken", 1.0, 0.0, 1.0)]
    along: Annotated[int, Says("m", "report minus arm plane along the row", AHEAD_SCALE_M, -LIMIT, LIMIT)]
    across: Annotated[int, Says("m", "report from the middle of the row", ACROSS_SCALE_M, -LIMIT, LIMIT)]
    height: Annotated[int, Says("m", "report above the traverse level", HEIGHT_SCALE_M, -LIMIT, LIMIT)]
    travel: Annotated[int, Says("s", "motion to get there", TRAVEL_SCALE_S, 0.0, LIMIT)]
    bud: Annotated[int, Says("", "1 where a bud is reported", 1.0, 0.0, 1.0)]
    fresh: Annotated[int, Says("", "1 where a fresh bloom is reported", 1.0, 0.0, 1.0)]
    late: Annotated[int, Says("", "1 where a late bloom is reported", 1.0, 0.0, 1.0)]
    dry: Annotated[int, Says("", "1 where a dry head is reported", 1.0, 0.0, 1.0)]
    size: Annotated[int, Says("m", "reported filament spread", SIZE_SCALE_M, -LIMIT, LIMIT)]
    reachable: Annotated[int, Says("", "1 where the tool reaches it", 1.0, 0.0, 1.0)]
    closes: Annotated[int, Says("s", "reported time left until it wilts, 0 after it", CLOSES_SCALE_S, 0.0, LIMIT)]
    row: Annotated[int, Says("", "row that it stands in, 0 the right-most, 1 the left-most", 1.0, 0.0, 1.0)]


M, C = numbered(Machine), numbered(Candidate)
DM, DC = numbered(DemandingMachine), numbered(DemandingCandidate)
assert (
    DemandingMachine._fields[: len(M)] == Machine._fields and DemandingCandidate._fields[: len(C)] == Candidate._fields
)


def candidate_table(observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
    """Candidates (..., K, F) of an observation, one column a name of ``Candidate``, or of ``DemandingCandidate``."""
    flat = observation["candidates"]
    # There are three efforts a slot, and one or two actions more.
    slots = (observation["action_mask"].shape[-1] - 1) // 3
    return flat.reshape(*flat.shape[:-1], slots, -1)
