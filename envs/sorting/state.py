"""What the sorting rules work on: tables, the state of the worlds, plans."""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..arrays import shaped
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
        surplus: worth of an item that no order line waits for, as a share.
        bin_holds: items in a bin, where there are orders.
        swap_s: until a full one has been swapped.
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
    surplus: float
    bin_holds: int
    swap_s: float

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
            surplus=float(config.scenario.orders.surplus),
            bin_holds=int(config.scenario.orders.bin_holds),
            swap_s=float(config.scenario.orders.swap_s),
        )


class Worlds(NamedTuple):
    """State of the worlds, each array's first axis."""

    item_truth: Annotated[Array, shaped("items", Truth)]
    """What is true of items; the last one stands for none."""
    item_free: Annotated[NDArray[np.bool_], shaped("items")]
    """Whether the item is still on the belt."""
    number: Annotated[Array, shaped("reports", Number)]
    """Numbers of reports; the last one stands for none."""
    feature: Annotated[NDArray[np.float32], shaped("reports", Candidate)]
    """What does not depend on the time or on where the platform is."""
    leave_s: Annotated[Array, shaped("reports", empty=np.inf)]
    """When a report leaves the reach; minus infinity once it has been tried."""
    seen_s: Annotated[Array, shaped("reports", empty=np.inf)]
    """When it arrives."""
    report_item: Annotated[NDArray[np.int64], shaped("reports", empty="items")]
    """The item behind a report, for scoring alone."""
    report_grade: Annotated[NDArray[np.int64], shaped("reports")]
    """The grade that it reports."""
    report_held: Annotated[NDArray[np.bool_], shaped("reports")]
    """Whether the fingers hold what is there if the tool goes where the report says."""
    report_lost: Annotated[NDArray[np.bool_], shaped("reports")]
    """Whether it then slips on the way."""
    queue: Annotated[NDArray[np.int64], shaped("reports", empty="reports")]
    """Reports in the order in which they leave."""
    soon_s: Annotated[Array, shaped("reports", empty=np.inf)]
    """By place in the queue: when the first of the report there and of those behind it arrives."""
    queued: Annotated[NDArray[np.int64], shaped()]
    """How many there are."""
    first: Annotated[NDArray[np.int64], shaped()]
    """Place in the queue of the first that has not left."""
    slot_report: Annotated[NDArray[np.int64], shaped("slots", empty="reports")]
    """Report in each slot."""
    end_s: Annotated[Array, shaped()]
    """When the last item has passed."""
    place: Annotated[Array, shaped(2)]
    """Platform at the travel level."""
    turn: Annotated[Array, shaped(4)]
    """Its quaternion."""
    level: Annotated[NDArray[np.bool_], shaped(empty=1)]
    """Whether that is none."""
    totals: Annotated[Array, shaped(Totals)]
    """See ``Totals``."""
    line_grade: Annotated[NDArray[np.int64], shaped("lines")]
    """What an order line wants, in the order of their cut-offs; this and what follows is empty without orders."""
    line_count: Annotated[NDArray[np.int64], shaped("lines")]
    """How many of it."""
    line_left: Annotated[NDArray[np.int64], shaped("lines")]
    """How many of them it still lacks."""
    line_due_s: Annotated[Array, shaped("lines", empty=np.inf)]
    """Until when."""
    bin_items: Annotated[NDArray[np.int64], shaped("bins")]
    """What lies in the bin of each grade, right or wrong."""
    bin_ready_s: Annotated[Array, shaped("bins")]
    """When the bin that was swapped last stands there."""
    tallies: Annotated[Array, shaped("tallies")]
    """See ``order_columns.Tallies``."""


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
