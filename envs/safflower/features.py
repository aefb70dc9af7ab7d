"""What policies are shown: one declaration of the observation's columns, for kernels, spaces and documentation.

A feature is a quantity divided by its scale, to be of order one, and held to the space: what would be larger than
``LIMIT`` is shown as ``LIMIT``.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..columns import Says, numbered, table_of

LIMIT = 10.0
"""Largest size of a number that policies are shown."""
AHEAD_SCALE_M = 0.3
ACROSS_SCALE_M = 0.15
HEIGHT_SCALE_M = 0.2
TRAVEL_SCALE_S = 4.0
SIZE_SCALE_M = 0.05


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


M, C = numbered(Machine), numbered(Candidate)

candidate_table = table_of(Candidate)
"""Candidates (..., K, F) of an observation, one column a name of ``Candidate``."""
