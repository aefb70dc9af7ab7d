"""What the sorting rules work on: tables, the state of the worlds, plans."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..columns import names
from ..core import Array
from .columns import Candidate, Number, Rewards, Totals, Truth
from .config import SortingConfig
from .process import Fingers
from .reach import ABOVE_M, radii
from .timing import Paces

PICK, WAIT, NOTHING = 0, 1, 2
"""Kinds of decision: grip an item, let the belt run, an illegal action."""


class Tables(NamedTuple):
    """What the rules look up; the same in every world. Places are in mechanism coordinates.

    Attributes:
        fingers: numbers of the grip.
        paces: what times depend on.
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
        weights: (4,), of ``Rewards``.
        time_limit_s: when the episode is cut off.
        exit_s: from x = 0 until an item has passed.
    """

    fingers: Fingers
    paces: Paces
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
    weights: Array
    time_limit_s: float
    exit_s: float

    @classmethod
    def of(cls, config: SortingConfig) -> Tables:
        """The numbers of a configuration."""
        machine, belt, grip, weights = config.machine, config.belt, config.grip, config.weights
        sorter = machine.sorter
        return cls(
            fingers=Fingers.of(grip),
            paces=Paces.of(config),
            tool_m=float(sorter.tool_m),
            above_m=float(sorter.origin_above_belt_m),
            level_m=float(machine.travel_level_m),
            yaw_limit_rad=float(machine.yaw_limit_rad),
            tilt_limit_rad=float(machine.tilt_limit_rad),
            tilt_refused_rad=float(machine.tilt_limit_rad + grip.refused_tilt_rad),
            reach_m=radii(sorter.mechanism, machine.travel_level_m + ABOVE_M),
            bins=np.array(belt.bins_m, float),
            values=np.array(config.produce.value, float),
            rest_s=np.array([0.0, grip.wait_s, grip.illegal_s]),
            weights=np.array([getattr(weights, name) for name in names(Rewards)]),
            time_limit_s=float(config.scenario.time_limit_s),
            exit_s=float(belt.exit_x_m / belt.speed_m_s),
        )


class Worlds(NamedTuple):
    """State of B worlds with N items, M reports and K slots.

    Attributes:
        item_truth: (B, N + 1, ``Truth``); item N stands for none.
        item_free: (B, N + 1), whether the item is still on the belt.
        number: (B, M + 1, ``Number``); report M stands for none.
        feature: (B, M + 1, ``Candidate``), what does not depend on the time or on where the platform is.
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
        totals: (B, ``Totals``).
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
            item_truth=np.zeros((b, n, len(Truth._fields))),
            item_free=np.zeros((b, n), bool),
            number=np.zeros((b, m, len(Number._fields))),
            feature=np.zeros((b, m, len(Candidate._fields)), np.float32),
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
            totals=np.zeros((b, len(Totals._fields))),
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
