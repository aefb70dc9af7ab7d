"""Names of the task's numbers: what kernels index, what policies are shown, what the scorecard reports."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..columns import Says, numbered, table_of

PLACE_SCALE_M = 0.3
MOVE_SCALE_S = 1.0
"""What features are divided by, to be of order one."""
SHOWN = 10.0
"""Every feature is held to [-SHOWN, SHOWN], the observation space: a slow machine's moves and the time behind a short
limit have no end of their own."""

NEXT_SOURCE, NEXT_TARGET = -2, -1
"""The actions that move a conveyor on, counted from the end; before them stand the pairs, each at every speed."""
TURN_SOURCES, TURN_TARGETS = -4, -3
"""Where trays are ordered, the actions that bring the next tray of a carousel; they stand before those two."""


class Ends(NamedTuple):
    """The two sides of the machine: where a plug comes from, where it goes to."""

    source: Annotated[int, Says("", "the supply's conveyor, on the left")]
    target: Annotated[int, Says("", "the conveyor of the trays to serve, on the right")]


class Ways(NamedTuple):
    """What a way of the tool takes."""

    s: Annotated[int, Says("s", "duration")]
    m: Annotated[int, Says("m", "length of the path")]


class Phases(NamedTuple):
    """Phases of a decision."""

    travel: Annotated[int, Says("s", "the tool moves, no plug for a cell in the gripper")]
    carry: Annotated[int, Says("s", "the tool carries a plug to its cell")]
    handle: Annotated[int, Says("s", "the gripper closes and opens")]
    index: Annotated[int, Says("s", "a conveyor moves on by a row and settles")]  # type: ignore[override]
    wait: Annotated[int, Says("s", "nothing happens: what an illegal action costs")]


class Rewards(NamedTuple):
    """Terms of the reward."""

    planted: Annotated[int, Says("", "target cells that came to hold a healthy seedling, less those that ceased to")]
    spoiled: Annotated[int, Says("", "healthy seedlings torn, lost, damaged, or sent away with their row")]
    time: Annotated[int, Says("s", "simulated time")]


class Lucks(NamedTuple):
    """Uniform numbers that decide what happens to a plug."""

    extract: Annotated[int, Says("", "below the chance of extraction the plug leaves its cell whole")]
    lose: Annotated[int, Says("", "below the speed's chance the plug is lost on the way")]
    damage: Annotated[int, Says("", "below the speed's chance the plug arrives damaged")]


class Harms(NamedTuple):
    """What may happen to a gripped plug, the more the faster it is carried."""

    lose: Annotated[int, Says("", "it is lost on the way")]
    damage: Annotated[int, Says("", "it is not lost, but arrives damaged")]


class Totals(NamedTuple):
    """Running totals of an episode; the phases stand together, in their order."""

    time: Annotated[int, Says("s", "simulated time since the episode began")]
    last: Annotated[int, Says("s", "when the last healthy seedling was planted")]
    done: Annotated[int, Says("", "healthy seedlings planted")]
    damaged: Annotated[int, Says("", "seedlings torn, hurt or crushed")]
    illegal: Annotated[int, Says("", "illegal actions")]
    travel_s: Annotated[int, Says("s", "seconds of the phase")]
    carry_s: Annotated[int, Says("s", "seconds of the phase")]
    handle_s: Annotated[int, Says("s", "seconds of the phase")]
    index_s: Annotated[int, Says("s", "seconds of the phase")]
    wait_s: Annotated[int, Says("s", "seconds of the phase")]
    lost: Annotated[int, Says("", "plugs lost on the way or set beside their cell")]
    torn: Annotated[int, Says("", "plugs that did not leave their cell whole")]
    wasted: Annotated[int, Says("", "healthy seedlings that left with their source row")]
    cleared: Annotated[int, Says("", "seedlings taken out of target cells")]
    transplants: Annotated[int, Says("", "transplants tried")]
    travel_m: Annotated[int, Says("m", "length of the tool's path")]
    healthy: Annotated[int, Says("", "target cells that hold a healthy seedling")]
    cells: Annotated[int, Says("", "target cells")]
    gaps: Annotated[int, Says("", "target cells without a healthy seedling at the beginning")]


class Scores(NamedTuple):
    """The scorecard."""

    net_rate: Annotated[int, Says("", "target cells that hold a healthy seedling / target cells")]
    cycle_time_s: Annotated[int, Says("s", "when the last healthy seedling was planted / healthy seedlings planted")]
    throughput_per_min: Annotated[int, Says("1/min", "healthy seedlings planted a minute of simulated time")]
    duration_s: Annotated[int, Says("s", "simulated time")]
    done: Annotated[int, Says("", "healthy seedlings planted")]
    missed: Annotated[int, Says("", "target cells without a healthy seedling")]
    damaged: Annotated[int, Says("", "seedlings torn, hurt or crushed; those torn are counted in torn too")]
    illegal: Annotated[int, Says("", "illegal actions")]
    phase_travel_s: Annotated[int, Says("s", "seconds of the phase")]
    phase_carry_s: Annotated[int, Says("s", "seconds of the phase")]
    phase_handle_s: Annotated[int, Says("s", "seconds of the phase")]
    phase_index_s: Annotated[int, Says("s", "seconds of the phase")]
    phase_wait_s: Annotated[int, Says("s", "seconds of the phase")]
    lost: Annotated[int, Says("", "plugs lost on the way or set beside their cell")]
    torn: Annotated[int, Says("", "plugs that did not leave their cell whole")]
    wasted: Annotated[int, Says("", "healthy seedlings that left with their source row")]
    cleared: Annotated[int, Says("", "seedlings taken out of target cells")]
    transplants: Annotated[int, Says("", "transplants tried")]
    travel_m: Annotated[int, Says("m", "length of the tool's path")]
    healthy: Annotated[int, Says("", "target cells that hold a healthy seedling")]
    cells: Annotated[int, Says("", "target cells")]
    gaps: Annotated[int, Says("", "target cells without a healthy seedling at the beginning")]
    filled: Annotated[int, Says("", "share of the gaps that hold a healthy seedling now")]


class Machine(NamedTuple):
    """What policies are shown of the machine."""

    place: Annotated[int, Says("m", "the tool's place across the machine", PLACE_SCALE_M, -SHOWN, SHOWN)]
    down: Annotated[int, Says("", "whether the tool is in a cell", 1.0, 0.0, 1.0)]
    time: Annotated[int, Says("", "simulated time / time limit", 1.0, 0.0, SHOWN)]
    source_rows: Annotated[int, Says("", "rows left in the supply / all", 1.0, -1.0, 1.0)]
    target_rows: Annotated[int, Says("", "target rows left / all", 1.0, -1.0, 1.0)]
    ready: Annotated[int, Says("", "presented source cells reported planted / columns", 1.0, 0.0, 1.0)]
    gaps: Annotated[int, Says("", "presented target cells reported empty or poor / columns", 1.0, 0.0, 1.0)]


class Candidate(NamedTuple):
    """What policies are shown of each pair of presented cells; rows of impossible pairs are zero."""

    present: Annotated[int, Says("", "whether the pair is possible", 1.0, 0.0, 1.0)]
    source: Annotated[int, Says("m", "the source cell's place across the machine", PLACE_SCALE_M, -SHOWN, SHOWN)]
    target: Annotated[int, Says("m", "the target cell's place across the machine", PLACE_SCALE_M, -SHOWN, SHOWN)]
    carry: Annotated[int, Says("s", "carrying at normal speed", MOVE_SCALE_S, 0.0, SHOWN)]
    approach: Annotated[
        int,
        Says("s", "until the tool is at the source cell, clearing included, gripping not", MOVE_SCALE_S, 0.0, SHOWN),
    ]
    source_poor: Annotated[int, Says("", "whether the source cell is reported poor", 1.0, 0.0, 1.0)]
    clear: Annotated[int, Says("", "whether the target cell is reported poor", 1.0, 0.0, 1.0)]


E, W, P, R = numbered(Ends), numbered(Ways), numbered(Phases), numbered(Rewards)
L, H, T, S = numbered(Lucks), numbered(Harms), numbered(Totals), numbered(Scores)
M, C = numbered(Machine), numbered(Candidate)

candidate_table = table_of(Candidate)
"""Candidates (..., K, F) of an observation, one column a name of ``Candidate``."""
