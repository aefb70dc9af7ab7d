"""Names of the numbers of produce sorting, each standing for its place in its block; see ``envs.columns``."""

from __future__ import annotations

from typing import Annotated, NamedTuple

from ..columns import Says, names, numbered, table_of
from ..core import COMMON_SCORES
from .config import GRADES

PLACE_SCALE_M = 0.2
TILT_SCALE_RAD = 0.35
TURN_SCALE_RAD = 1.0
LENGTH_SCALE_M = 0.06
WAIT_SCALE_S = 4.0
CYCLE_SCALE_S = 2.0
"""What the features are divided by, to be of order one."""
LIMIT = 10.0
"""No feature is shown beyond this: times have no bounds of their own, so they are cut off here."""


class Item(NamedTuple):
    """What is true of an item on the belt, which the ellipsoid touches. The last item of a world stands for none."""

    passing_s: Annotated[int, Says("s", "when its centre passes x = 0; infinite where there is none")]
    across_m: Annotated[int, Says("m", "its centre across the belt")]
    up_m: Annotated[int, Says("m", "its centre above the belt")]
    yaw_rad: Annotated[int, Says("rad", "direction of the long axis before the tilt")]
    tilt_rad: Annotated[int, Says("rad", "lean of the short axis")]
    azimuth_rad: Annotated[int, Says("rad", "where it leans to")]
    length_m: Annotated[int, Says("m", "full length")]
    width: Annotated[int, Says("", "full width / length")]
    thickness: Annotated[int, Says("", "full thickness / length")]
    grade: Annotated[int, Says("", "index among GRADES")]
    ripeness: Annotated[int, Says("", "of a fruit")]
    skin: Annotated[int, Says("", "ripeness that the skin's colour suggests")]
    grip_luck: Annotated[int, Says("", "uniform luck of the grip")]
    way_luck: Annotated[int, Says("", "uniform luck of the way")]
    slip_along_m: Annotated[int, Says("m", "how far along it has left its place on the belt when it is gripped")]
    slip_across_m: Annotated[int, Says("m", "and how far across")]


class Report(NamedTuple):
    """What a camera says of an item: the first ten as of an ``Item``."""

    passing_s: Annotated[int, Says("s", "when its centre passes x = 0; infinite where there is no report")]
    across_m: Annotated[int, Says("m", "its centre across the belt")]
    up_m: Annotated[int, Says("m", "its centre above the belt")]
    yaw_rad: Annotated[int, Says("rad", "direction of the long axis before the tilt")]
    tilt_rad: Annotated[int, Says("rad", "lean of the short axis")]
    azimuth_rad: Annotated[int, Says("rad", "where it leans to")]
    length_m: Annotated[int, Says("m", "full length")]
    width: Annotated[int, Says("", "full width / length")]
    thickness: Annotated[int, Says("", "full thickness / length")]
    grade: Annotated[int, Says("", "index among GRADES")]
    seen_s: Annotated[int, Says("s", "when the report arrives")]
    item: Annotated[int, Says("", "for scoring alone the item behind it, the world's last one where there is none")]


class Truth(NamedTuple):
    """What the fingers meet of an item, as it lies when it is gripped; axes take three numbers each."""

    passing_s: Annotated[int, Says("s", "when its centre really passes x = 0")]
    across_m: Annotated[int, Says("m", "its centre across the belt")]
    up_m: Annotated[int, Says("m", "its centre's z in mechanism coordinates")]
    long_x: Annotated[int, Says("", "its long axis, a unit vector")]
    long_y: Annotated[int, Says("", "see long_x")]
    long_z: Annotated[int, Says("", "see long_x")]
    short_x: Annotated[int, Says("", "its short axis, a unit vector")]
    short_y: Annotated[int, Says("", "see short_x")]
    short_z: Annotated[int, Says("", "see short_x")]
    narrow: Annotated[int, Says("", "square of 1 - width / length")]
    flat: Annotated[int, Says("", "square of 1 - thickness / length")]
    grip_luck: Annotated[int, Says("", "uniform luck of the grip")]
    way_luck: Annotated[int, Says("", "uniform luck of the way")]
    grade: Annotated[int, Says("", "index among GRADES")]


class Number(NamedTuple):
    """What follows from a report alone; x and y of the platform in mechanism coordinates."""

    passing_s: Annotated[int, Says("s", "when the platform over it would pass x = 0")]
    across_m: Annotated[int, Says("m", "y of the platform over it")]
    first_m: Annotated[int, Says("m", "first x where an approach may end")]
    last_m: Annotated[int, Says("m", "last one; minus infinity for what cannot be gripped")]
    hold_s: Annotated[int, Says("s", "from the approach's end to the lift's")]
    deadline_s: Annotated[int, Says("s", "latest end of an approach")]
    turn_w: Annotated[int, Says("", "the tool's quaternion at the grip")]
    turn_x: Annotated[int, Says("", "see turn_w")]
    turn_y: Annotated[int, Says("", "see turn_w")]
    turn_z: Annotated[int, Says("", "see turn_w")]
    least_s: Annotated[int, Says("s", "least time of a turn between level and the grip, and so of any way")]
    aside_m2: Annotated[int, Says("m2", "square of the way to the bin across the belt")]
    bin_m: Annotated[int, Says("m", "x of the bin")]
    carry_s: Annotated[int, Says("s", "first guess at the time of the way to the bin")]
    height_m: Annotated[int, Says("m", "z of the platform at the grip")]
    descend_s: Annotated[int, Says("s", "seconds down, and up again")]
    x_axis_x: Annotated[int, Says("", "the tool's x axis at the grip")]
    x_axis_y: Annotated[int, Says("", "see x_axis_x")]
    x_axis_z: Annotated[int, Says("", "see x_axis_x")]
    z_axis_x: Annotated[int, Says("", "the tool's z axis at the grip")]
    z_axis_y: Annotated[int, Says("", "see z_axis_x")]
    z_axis_z: Annotated[int, Says("", "see z_axis_x")]
    leave_s: Annotated[int, Says("s", "when it leaves: later than the deadline only for what cannot be gripped")]


class Phases(NamedTuple):
    """Phases of a decision."""

    wait: Annotated[int, Says("s", "standing still: until an item is near enough, or because nothing is done")]
    approach: Annotated[int, Says("s", "until the tool is over the item and follows the belt")]
    descend: Annotated[int, Says("s", "down to the item")]
    grip: Annotated[int, Says("s", "closing the fingers")]
    lift: Annotated[int, Says("s", "up again")]
    carry: Annotated[int, Says("s", "to the bin; after an empty grip coming to rest")]
    release: Annotated[int, Says("s", "opening the fingers")]


class Rewards(NamedTuple):
    """Terms of the reward."""

    placed: Annotated[int, Says("", "an item put into the bin of its grade, times the grade's value")]
    misplaced: Annotated[int, Says("", "an item put into another bin")]
    dropped: Annotated[int, Says("", "an item that slipped out on the way")]
    wasted: Annotated[int, Says("", "a grip that held nothing")]


class Totals(NamedTuple):
    """Running totals of a world; the last two are the stream's."""

    time_s: Annotated[int, Says("s", "simulated time since the episode began")]
    last_placed_s: Annotated[int, Says("s", "when the last item was put into the bin of its grade")]
    last_pick_s: Annotated[int, Says("s", "when the last item was put down, in whichever bin")]
    placed: Annotated[int, Says("", "items in the bins of their grades")]
    value: Annotated[int, Says("", "what they are worth")]
    misplaced: Annotated[int, Says("", "items in other bins")]
    dropped: Annotated[int, Says("", "items that slipped out on the way")]
    wasted: Annotated[int, Says("", "grips that held nothing")]
    illegal: Annotated[int, Says("", "illegal actions")]
    picks: Annotated[int, Says("", "items put down, in whichever bin")]
    wait_s: Annotated[int, Says("s", "spent in this phase, as the next six")]
    approach_s: Annotated[int, Says("s", "see wait_s")]
    descend_s: Annotated[int, Says("s", "see wait_s")]
    grip_s: Annotated[int, Says("s", "see wait_s")]
    lift_s: Annotated[int, Says("s", "see wait_s")]
    carry_s: Annotated[int, Says("s", "see wait_s")]
    release_s: Annotated[int, Says("s", "see wait_s")]
    items: Annotated[int, Says("", "items of the stream")]
    worth: Annotated[int, Says("", "what they would be worth, all placed")]


class Scores(NamedTuple):
    """The scorecard."""

    net_rate: Annotated[int, Says("", "items in the bins of their grades / items of the stream")]
    cycle_time_s: Annotated[int, Says("s", "time until the last item was put into its grade's bin / such items")]
    throughput_per_min: Annotated[int, Says("1/min", "items in the bins of their grades, a minute")]
    duration_s: Annotated[int, Says("s", "simulated time since the episode began")]
    done: Annotated[int, Says("", "items in the bins of their grades")]
    missed: Annotated[int, Says("", "items neither put down nor dropped")]
    damaged: Annotated[int, Says("", "items that slipped out of the fingers and fell")]
    illegal: Annotated[int, Says("", "illegal actions")]
    phase_wait_s: Annotated[int, Says("s", "spent in this phase, as the next six")]
    phase_approach_s: Annotated[int, Says("s", "see phase_wait_s")]
    phase_descend_s: Annotated[int, Says("s", "see phase_wait_s")]
    phase_grip_s: Annotated[int, Says("s", "see phase_wait_s")]
    phase_lift_s: Annotated[int, Says("s", "see phase_wait_s")]
    phase_carry_s: Annotated[int, Says("s", "see phase_wait_s")]
    phase_release_s: Annotated[int, Says("s", "see phase_wait_s")]
    value_rate: Annotated[int, Says("", "value of the items in the right bins / value of the stream")]
    misplaced: Annotated[int, Says("", "items in wrong bins")]
    wasted: Annotated[int, Says("", "grips that held nothing")]
    total: Annotated[int, Says("", "items of the stream")]
    picks_per_min: Annotated[int, Says("1/min", "items put down, in whichever bin, a minute")]
    pick_cycle_s: Annotated[int, Says("s", "time until the last item was put down / items put down, in whichever bin")]


class Machine(NamedTuple):
    """What policies are shown of the machine, cut off at ``LIMIT``."""

    x: Annotated[int, Says("m", "the platform along the belt", PLACE_SCALE_M, -LIMIT, LIMIT)]
    y: Annotated[int, Says("m", "the platform across the belt", PLACE_SCALE_M, -LIMIT, LIMIT)]
    turned: Annotated[int, Says("", "sine of half its rotation", 1.0, 0.0, 1.0)]
    time: Annotated[int, Says("", "time since the episode began / time limit", 1.0, 0.0, LIMIT)]
    in_view: Annotated[int, Says("", "reports shown / slots", 1.0, 0.0, 1.0)]


class Candidate(NamedTuple):
    """What policies are shown of each candidate, cut off at ``LIMIT``; empty slots are zero."""

    present: Annotated[int, Says("", "whether the slot is taken", 1.0, 0.0, 1.0)]
    along: Annotated[int, Says("m", "x of the platform over the item, now", PLACE_SCALE_M, -LIMIT, LIMIT)]
    across: Annotated[int, Says("m", "y of the platform over the item", PLACE_SCALE_M, -LIMIT, LIMIT)]
    cos_2yaw: Annotated[int, Says("", "cosine of twice the reported yaw", 1.0, -1.0, 1.0)]
    sin_2yaw: Annotated[int, Says("", "sine of twice the reported yaw", 1.0, -1.0, 1.0)]
    tilt: Annotated[int, Says("rad", "reported tilt", TILT_SCALE_RAD, 0.0, LIMIT)]
    turn: Annotated[int, Says("rad", "of the tool from level", TURN_SCALE_RAD, 0.0, LIMIT)]
    length: Annotated[int, Says("m", "reported length", LENGTH_SCALE_M, 0.0, LIMIT)]
    ware: Annotated[int, Says("", "whether this grade is reported", 1.0, 0.0, 1.0)]
    seed: Annotated[int, Says("", "see ware", 1.0, 0.0, 1.0)]
    ripe: Annotated[int, Says("", "see ware", 1.0, 0.0, 1.0)]
    green: Annotated[int, Says("", "see ware", 1.0, 0.0, 1.0)]
    value: Annotated[int, Says("", "of the reported grade", 1.0, 0.0, LIMIT)]
    quality: Annotated[int, Says("", "expected share of grips that hold", 1.0, 0.0, 1.0)]
    approach: Annotated[int, Says("s", "from the end of the wait until the tool is over it", 1.0, 0.0, LIMIT)]
    wait: Annotated[int, Says("s", "before the approach", WAIT_SCALE_S, 0.0, LIMIT)]
    cycle: Annotated[int, Says("s", "until the item is in its bin", CYCLE_SCALE_S, 0.0, LIMIT)]
    slack: Annotated[int, Says("s", "until it is too late, not less than minus the scale", WAIT_SCALE_S, -1.0, LIMIT)]
    possible: Annotated[int, Says("", "whether it can be gripped now", 1.0, 0.0, 1.0)]


ITEM, REPORT, TRUTH, NUMBER = numbered(Item), numbered(Report), numbered(Truth), numbered(Number)
PHASE, REWARD, TOTAL, SCORE = numbered(Phases), numbered(Rewards), numbered(Totals), numbered(Scores)
MACHINE, CANDIDATE = numbered(Machine), numbered(Candidate)

COMMON = REPORT.seen_s
"""So many numbers begin an item and a report alike."""
KINDS = len(GRADES)

# Blocks that kernels walk through from their first name on.
assert names(Item)[:COMMON] == names(Report)[:COMMON]
assert names(Scores)[: len(COMMON_SCORES)] == COMMON_SCORES
assert names(Totals)[TOTAL.wait_s : TOTAL.release_s + 1] == tuple(f"{name}_s" for name in names(Phases))
assert names(Scores)[SCORE.phase_wait_s : SCORE.value_rate] == tuple(f"phase_{name}_s" for name in names(Phases))
assert names(Candidate)[CANDIDATE.ware : CANDIDATE.value] == GRADES
assert (TRUTH.long_z, TRUTH.short_z) == (TRUTH.long_x + 2, TRUTH.short_x + 2)
assert (NUMBER.turn_z, NUMBER.x_axis_z, NUMBER.z_axis_z) == (
    NUMBER.turn_w + 3,
    NUMBER.x_axis_x + 2,
    NUMBER.x_axis_x + 5,
)

candidate_table = table_of(Candidate)
"""Candidates (..., K, F) of an observation, one column a name of ``Candidate``."""
