"""What the sorting rules work on: constants, the state of the worlds, plans."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...motion import QUINTIC
from ..core import Array
from .config import SortingConfig
from .features import CANDIDATE_FEATURES
from .process import Fingers
from .reach import radii

PICK, WAIT, NOTHING = 0, 1, 2
"""Kinds of decision: grip an item, let the belt run, an illegal action."""
STAND, APPROACH, DESCEND, GRIP, LIFT, CARRY, RELEASE = range(7)
"""Phases."""

COLUMNS = (
    *("passing_s", "y", "first_x", "last_x", "hold_s", "deadline_s", "w", "i", "j", "k"),
    *("carry_least_s", "carry_across_square", "bin_x", "carry_guess_s"),
    *("z", "descend_s", "x_x", "x_y", "x_z", "z_x", "z_y", "z_z", "leave_s"),
)
"""A report's numbers: when the platform over it would pass x = 0; its y; first and last x where an approach may end;
seconds from the approach's end to the lift's; latest end of an approach; the tool's quaternion; for the way to the bin
its least time, square of y, x and a first guess at the time; height of the grip; seconds down (and up again); the
tool's x and z axes; when it leaves, which is later than the deadline only for what cannot be gripped."""
PASSING_S, ACROSS_M, FIRST_M, LAST_M, HOLD_S, DEADLINE_S = range(6)
TURN, LEAST_S, ASIDE_M2, BIN_M, CARRY_S, HEIGHT_M, DESCEND_S, X_AXIS, Z_AXIS = 6, 10, 11, 12, 13, 14, 15, 16, 19
LEAVE_S = 22
"""Places among ``COLUMNS``; the quaternion takes four from ``TURN`` on, an axis three."""

TRUE_S, TRUE_Y, TRUE_Z, LONG, SHORT, NARROW, FLAT, HOLD_LUCK, SLIP_LUCK = 0, 1, 2, 3, 6, 9, 10, 11, 12
TRUE_GRADE, TRUTHS = 13, 14
"""A true item's numbers: when it really passes x = 0, its y, its centre's z in mechanism coordinates, its long and its
short axis (three each), squares of 1 - width / length and 1 - thickness / length, luck of grip and way, grade."""

TIME, LAST, PLACED, VALUE, MISPLACED, DROPPED, WASTED, ILLEGAL, PICKS = range(9)
PHASES, TOTAL, TOTAL_VALUE = 9, 16, 17
TOTALS = 18
"""Columns of the running totals; seven phases begin at ``PHASES``, the last two are the stream's."""


class Tables(NamedTuple):
    """What the rules look up; the same in every world. Places are in mechanism coordinates.

    Attributes:
        fingers: numbers of the grip.
        speed_m_s: of the belt.
        pace: seconds a metre at the speed limit; following the belt adds its speed to the motion's own, so that much
            is kept back.
        square_pace: seconds squared a metre at the acceleration limit.
        turn_pace: as ``pace``, a rad.
        turn_square_pace: as ``square_pace``, a rad.
        down_pace: as ``pace`` for the way down and up, where the whole speed is free.
        shortest_s: a motion is given at least this long.
        stop_s: coming to rest after a grip that holds nothing.
        tool_m: from the platform's centre down to the fingers.
        above_m: the mechanism's origin above the belt.
        level_m: platform height of every traverse.
        yaw_limit_rad: largest yaw commanded.
        tilt_limit_rad: largest tilt commanded.
        tilt_refused_rad: what leans further is not gripped.
        reach_m: (5, 5), ``reach.radii`` at the travel level.
        bins: (4, 2), where each grade is let go.
        values: (4,), of each grade.
        rest_s: (3,), seconds by kind of decision without a motion.
        grip_s: closing the fingers.
        release_s: opening them.
        weights: (4,), of the reward's terms.
        time_limit_s: when the episode is cut off.
        exit_s: from x = 0 until an item has passed.
    """

    fingers: Fingers
    speed_m_s: float
    pace: float
    square_pace: float
    turn_pace: float
    turn_square_pace: float
    down_pace: float
    shortest_s: float
    stop_s: float
    tool_m: float
    above_m: float
    level_m: float
    yaw_limit_rad: float
    tilt_limit_rad: float
    tilt_refused_rad: float
    reach_m: Array
    bins: Array
    values: Array
    rest_s: Array
    grip_s: float
    release_s: float
    weights: Array
    time_limit_s: float
    exit_s: float

    @classmethod
    def of(cls, config: SortingConfig) -> Tables:
        """The numbers of a configuration."""
        machine, belt, grip, weights = config.machine, config.belt, config.grip, config.weights
        sorter = machine.sorter
        pace, square_pace = QUINTIC.paces(sorter.velocity_m_s - belt.speed_m_s, sorter.acceleration_m_s2)
        turn_pace, turn_square_pace = QUINTIC.paces(sorter.turn_rad_s, sorter.turn_rad_s2)
        return cls(
            fingers=Fingers.of(grip),
            speed_m_s=float(belt.speed_m_s),
            pace=float(pace),
            square_pace=float(square_pace),
            turn_pace=float(turn_pace),
            turn_square_pace=float(turn_square_pace),
            down_pace=float(QUINTIC.peak_velocity / sorter.velocity_m_s),
            shortest_s=float(machine.shortest_move_s),
            stop_s=float(machine.stop_s),
            tool_m=float(sorter.tool_m),
            above_m=float(sorter.origin_above_belt_m),
            level_m=float(machine.travel_level_m),
            yaw_limit_rad=float(machine.yaw_limit_rad),
            tilt_limit_rad=float(machine.tilt_limit_rad),
            tilt_refused_rad=float(machine.tilt_limit_rad + grip.refused_tilt_rad),
            reach_m=radii(sorter.mechanism, machine.travel_level_m + 0.005),
            bins=np.array(belt.bins_m, float),
            values=np.array(config.produce.value, float),
            rest_s=np.array([0.0, grip.wait_s, grip.illegal_s]),
            grip_s=float(grip.grip_s),
            release_s=float(grip.release_s),
            weights=np.array([weights.placed, weights.misplaced, weights.dropped, weights.wasted], float),
            time_limit_s=float(config.scenario.time_limit_s),
            exit_s=float(belt.exit_x_m / belt.speed_m_s),
        )


class Worlds(NamedTuple):
    """State of B worlds with N items, M reports and K slots.

    Attributes:
        item_truth: (B, N + 1, TRUTHS); item N stands for none.
        item_free: (B, N + 1), whether the item is still on the belt.
        number: (B, M + 1, columns), what ``COLUMNS`` says of each report; report M stands for none.
        feature: (B, M + 1, F), what does not depend on the time or on where the platform is.
        leave_s: (B, M + 1), when a report leaves the reach; minus infinity once it has been tried.
        seen_s: (B, M + 1), when it arrives.
        report_item: (B, M + 1).
        report_grade: (B, M + 1).
        report_held: (B, M + 1), whether the fingers hold what is there if the tool goes where the report says.
        report_lost: (B, M + 1), whether it then slips on the way.
        queue: (B, M + 1), reports in the order in which they leave.
        queued: (B,), how many there are.
        first: (B,), place in the queue of the first that has not left.
        slot_report: (B, K), report in each slot.
        end_s: (B,), when the last item has passed.
        place: (B, 2), platform at the travel level.
        turn: (B, 4), its quaternion.
        level: (B,), whether that is none.
        totals: (B, TOTALS).
    """

    item_truth: Array
    item_free: NDArray[np.bool_]
    number: Array
    feature: NDArray[np.float32]
    leave_s: Array
    seen_s: Array
    report_item: NDArray[np.int64]
    report_grade: NDArray[np.int64]
    report_held: NDArray[np.bool_]
    report_lost: NDArray[np.bool_]
    queue: NDArray[np.int64]
    queued: NDArray[np.int64]
    first: NDArray[np.int64]
    slot_report: NDArray[np.int64]
    end_s: Array
    place: Array
    turn: Array
    level: NDArray[np.bool_]
    totals: Array

    @classmethod
    def room(cls, worlds: int, items: int, reports: int, slots: int) -> Worlds:
        """Room for so many items, reports and slots a world."""
        b, n, m = worlds, items + 1, reports + 1
        return cls(
            item_truth=np.zeros((b, n, TRUTHS)),
            item_free=np.zeros((b, n), bool),
            number=np.zeros((b, m, len(COLUMNS))),
            feature=np.zeros((b, m, len(CANDIDATE_FEATURES)), np.float32),
            leave_s=np.full((b, m), np.inf),
            seen_s=np.full((b, m), np.inf),
            report_item=np.full((b, m), items),
            report_grade=np.zeros((b, m), np.int64),
            report_held=np.zeros((b, m), bool),
            report_lost=np.zeros((b, m), bool),
            queue=np.full((b, m), reports),
            queued=np.zeros(b, np.int64),
            first=np.zeros(b, np.int64),
            slot_report=np.full((b, slots), reports),
            end_s=np.zeros(b),
            place=np.zeros((b, 2)),
            turn=np.zeros((b, 4)),
            level=np.ones(b, bool),
            totals=np.zeros((b, TOTALS)),
        )


class SorterPlan(NamedTuple):
    """What the sorter has to do in each world. Places are the platform's centre in mechanism coordinates.

    Attributes:
        kind: (B,), ``PICK``, ``WAIT`` or ``NOTHING``; only for the first the platform moves.
        slot: (B,), candidate slot.
        report: (B,), report behind it, the empty one where nothing is gripped.
        grade: (B,), the grade that it reports.
        start: (B, 2), x and y at the travel level.
        start_turn: (B, 4), quaternion.
        meet: (B, 2), x and y at the travel level when the approach ends, over the moving item.
        grip: (B, 3), where the fingers close.
        turn: (B, 4), quaternion of the grip.
        axes: (B, 6), the tool's x and z axes at the grip.
        bin: (B, 2), where the item is let go, level and unturned.
        phases_s: (B, 7), nominal seconds of each phase when the fingers hold the item.
    """

    kind: NDArray[np.int64]
    slot: NDArray[np.int64]
    report: NDArray[np.int64]
    grade: NDArray[np.int64]
    start: Array
    start_turn: Array
    meet: Array
    grip: Array
    turn: Array
    axes: Array
    bin: Array
    phases_s: Array


class Grip(NamedTuple):
    """What came of closing the fingers: whether they hold, and whether the item slips out on the way, (B,) each."""

    held: NDArray[np.bool_]
    lost: NDArray[np.bool_]


class Candidate(NamedTuple):
    """A report as seen from now: where it is met and how long everything takes.

    Attributes:
        meet_m: x of the platform when the approach ends.
        wait_s: before the approach.
        approach_s: until the tool is over the item.
        carry_s: from the lift to the bin.
        possible: whether that is in time.
    """

    meet_m: float
    wait_s: float
    approach_s: float
    carry_s: float
    possible: bool
