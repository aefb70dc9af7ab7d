"""What follows from a report alone: how the tool must stand, where on the belt it can, how long it stays down."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...motion import orientation
from ..compiled import compiled, fill, shortest
from ..core import Array, Rows
from .config import GRADES
from .features import CANDIDATE_FEATURES, LENGTH_SCALE_M, PLACE_SCALE_M, TILT_SCALE_RAD, TURN_SCALE_RAD
from .field import (
    ARRIVAL_S,
    AZIMUTH,
    GRADE,
    GRIP_LUCK,
    LENGTH_M,
    OF_ITEM,
    SEEN_S,
    SLIP_ACROSS_M,
    SLIP_ALONG_M,
    THICKNESS,
    TILT,
    WAY_LUCK,
    WIDTH,
    Y_M,
    YAW,
    Z_M,
)
from .process import Fingers, grip_quality, holds, slips
from .reach import reach_m
from .state import (
    ACROSS_M,
    ASIDE_M2,
    BIN_M,
    CARRY_S,
    DEADLINE_S,
    DESCEND_S,
    FIRST_M,
    FLAT,
    HEIGHT_M,
    HOLD_LUCK,
    HOLD_S,
    LAST_M,
    LEAST_S,
    LEAVE_S,
    LONG,
    NARROW,
    PASSING_S,
    SHORT,
    SLIP_LUCK,
    TIME,
    TOTAL,
    TOTAL_VALUE,
    TRUE_GRADE,
    TRUE_S,
    TRUE_Y,
    TRUE_Z,
    TURN,
    X_AXIS,
    Z_AXIS,
    Tables,
    Worlds,
)

SWING_M = 0.006
"""Kept free at the end of the reach: the way to the bin begins at the belt's speed [assumed, tested]."""
_REFUSED_LEAVES_M = 0.10
"""What cannot be gripped is shown until it has left the place where others are."""
_NEVER_S = -1e9
_GRADE, _WORTH = CANDIDATE_FEATURES.index(GRADES[0]), CANDIDATE_FEATURES.index("value")

turned = compiled(orientation.tilted_parts)
x_axis, z_axis = compiled(orientation.x_axis), compiled(orientation.z_axis)
"""Parts of ``motion.orientation`` for single turns."""


def wrapped(yaw: Any) -> Any:
    """Angles (...) in (-pi/2, pi/2]: an ellipsoid looks the same after half a turn."""
    return yaw - np.pi * np.ceil(yaw / np.pi - 0.5)


_wrapped = compiled(wrapped)


@compiled
def begin_worlds(tables: Tables, worlds: Worlds, rows: Rows, items: Array) -> None:
    """Begin anew with drawn items; the platform rests level in the middle, no report has come."""
    for w in rows:
        totals = worlds.totals[w]
        fill(totals, 0.0)
        end_s = 0.0
        for i in range(items.shape[1] - 1):
            item = items[w, i]
            worlds.item_free[w, i] = item[ARRIVAL_S] < np.inf
            if worlds.item_free[w, i]:
                lay_item(tables, item, worlds.item_truth[w, i])
                totals[TOTAL] += 1.0
                totals[TOTAL_VALUE] += tables.values[int(item[GRADE])]
                end_s = max(end_s, item[ARRIVAL_S] + tables.exit_s)
        worlds.end_s[w] = end_s
        fill(worlds.place[w], 0.0)
        fill(worlds.turn[w], 0.0)
        worlds.turn[w, 0], worlds.level[w] = 1.0, True
        worlds.queued[w], worlds.first[w] = 0, 0
        fill(worlds.leave_s[w], np.inf)
        for k in range(worlds.slot_report.shape[1]):
            worlds.slot_report[w, k] = worlds.leave_s.shape[1] - 1


@compiled
def lay_item(tables: Tables, item: Array, truth: Array) -> None:
    """Write the numbers of a true item, as it lies when it is gripped."""
    truth[TRUE_S] = item[ARRIVAL_S] - item[SLIP_ALONG_M] / tables.speed_m_s
    truth[TRUE_Y] = item[Y_M] + item[SLIP_ACROSS_M]
    truth[TRUE_Z] = item[Z_M] - tables.above_m
    w, x, y, z = turned(item[TILT], item[AZIMUTH], item[YAW])
    truth[LONG], truth[LONG + 1], truth[LONG + 2] = x_axis(w, x, y, z)
    truth[SHORT], truth[SHORT + 1], truth[SHORT + 2] = z_axis(w, x, y, z)
    truth[NARROW], truth[FLAT] = (1.0 - item[WIDTH]) ** 2, (1.0 - item[THICKNESS]) ** 2
    truth[HOLD_LUCK], truth[SLIP_LUCK] = item[GRIP_LUCK], item[WAY_LUCK]
    truth[TRUE_GRADE] = item[GRADE]


@compiled
def take_reports(tables: Tables, worlds: Worlds, rows: Rows, reports: Array) -> None:
    """Add reports (R, M, REPORT) to the worlds ``rows``; what is done or has left makes room, the rest is lost."""
    empty = worlds.leave_s.shape[1] - 1
    for r, w in enumerate(rows):
        time_s, leave_s, queue = worlds.totals[w, TIME], worlds.leave_s[w], worlds.queue[w]
        count, place = forget(queue, int(worlds.queued[w]), leave_s, time_s), 0
        for m in range(reports.shape[1]):
            report = reports[r, m]
            if report[ARRIVAL_S] == np.inf:
                continue
            while place < empty and time_s < leave_s[place] < np.inf:
                place += 1
            if place == empty:
                break
            number, item = worlds.number[w, place], int(report[OF_ITEM])
            prepare(tables, report, number, worlds.feature[w, place])
            leave_s[place], worlds.seen_s[w, place] = number[LEAVE_S], report[SEEN_S]
            worlds.report_item[w, place], worlds.report_grade[w, place] = item, int(report[GRADE])
            held, lost = foresee(tables, number, worlds.item_truth[w, item])
            worlds.report_held[w, place], worlds.report_lost[w, place] = held, lost
            queue_up(queue, count, leave_s, place)
            count += 1
            place += 1
        worlds.queued[w], worlds.first[w] = count, 0
        show_reports(worlds.slot_report[w], queue, 0, count, leave_s, worlds.seen_s[w], time_s)


@compiled
def forget(queue: Rows, count: int, leave_s: Array, time_s: float) -> int:
    """Take out of the queue what has been tried or has left; gives how many are left."""
    kept = 0
    for q in range(count):
        if leave_s[queue[q]] > time_s:
            queue[kept] = queue[q]
            kept += 1
    return kept


@compiled
def queue_up(queue: Rows, count: int, leave_s: Array, report: int) -> None:
    """Put a report where it belongs in the order of leaving."""
    q = count
    while q > 0 and leave_s[queue[q - 1]] > leave_s[report]:
        queue[q] = queue[q - 1]
        q -= 1
    queue[q] = report


@compiled
def show_reports(slots: Rows, queue: Rows, first: int, count: int, leave_s: Array, seen_s: Array, time_s: float) -> int:
    """Show the first reports, by leaving time, that have come and whose items are there; returns the first ahead."""
    while first < count and leave_s[queue[first]] <= time_s:
        first += 1
    shown = 0
    for q in range(first, count):
        report = queue[q]
        if leave_s[report] > time_s and seen_s[report] <= time_s:
            slots[shown] = report
            shown += 1
            if shown == len(slots):
                break
    for k in range(shown, len(slots)):
        slots[k] = len(leave_s) - 1
    return first


@compiled
def prepare(tables: Tables, report: Array, number: Array, feature: Array) -> None:
    """Write what follows from a report; one that cannot be gripped has no last x and no deadline."""
    speed, grade = tables.speed_m_s, int(report[GRADE])
    yaw_seen, tilt_seen = _wrapped(report[YAW]), report[TILT]
    yaw = min(max(yaw_seen, -tables.yaw_limit_rad), tables.yaw_limit_rad)
    tilt = min(tilt_seen, tables.tilt_limit_rad)
    qw, qx, qy, qz = turned(tilt, report[AZIMUTH], yaw)
    number[TURN], number[TURN + 1], number[TURN + 2], number[TURN + 3] = qw, qx, qy, qz
    number[X_AXIS], number[X_AXIS + 1], number[X_AXIS + 2] = x_axis(qw, qx, qy, qz)
    tool_x, tool_y, tool_z = z_axis(qw, qx, qy, qz)
    number[Z_AXIS], number[Z_AXIS + 1], number[Z_AXIS + 2] = tool_x, tool_y, tool_z
    passing = report[ARRIVAL_S] - tables.tool_m * tool_x / speed
    y = report[Y_M] + tables.tool_m * tool_y
    z = min(max(report[Z_M] + tables.tool_m * tool_z - tables.above_m, 0.0), tables.level_m)
    down = shortest(tables.level_m - z, tables.down_pace, tables.square_pace)
    hold = 2.0 * down + tables.grip_s
    reach = reach_m(tables.reach_m, tilt, yaw)
    half = math.sqrt(max(reach * reach - y * y, 0.0))
    last = half - SWING_M - speed * hold
    fits = tilt_seen <= tables.tilt_refused_rad and last > -half
    turn = 2.0 * math.acos(min(qw, 1.0))
    least = max(shortest(turn, tables.turn_pace, tables.turn_square_pace), tables.shortest_s)
    bin_x, across = tables.bins[grade, 0], tables.bins[grade, 1] - y
    aside = math.sqrt(across * across + bin_x * bin_x)
    number[PASSING_S], number[ACROSS_M], number[FIRST_M], number[HOLD_S] = passing, y, -half, hold
    number[LAST_M] = last if fits else -np.inf
    number[DEADLINE_S] = passing + last / speed if fits else _NEVER_S
    number[LEAVE_S] = passing + (last if fits else _REFUSED_LEAVES_M) / speed
    number[LEAST_S], number[ASIDE_M2], number[BIN_M] = least, across * across, bin_x
    number[CARRY_S] = max(shortest(aside, tables.pace, tables.square_pace), least)
    number[HEIGHT_M], number[DESCEND_S] = z, down

    misfit = ((1.0 - report[WIDTH]) * math.sin(yaw_seen - yaw)) ** 2
    misfit += ((1.0 - report[THICKNESS]) * math.sin(tilt_seen - tilt)) ** 2
    feature[0], feature[1], feature[2] = 1.0, 0.0, y / PLACE_SCALE_M
    feature[3], feature[4] = math.cos(2.0 * yaw_seen), math.sin(2.0 * yaw_seen)
    feature[5], feature[6] = tilt_seen / TILT_SCALE_RAD, turn / TURN_SCALE_RAD
    feature[7] = report[LENGTH_M] / LENGTH_SCALE_M
    for other in range(len(tables.values)):
        feature[_GRADE + other] = 1.0 if other == grade else 0.0
    feature[_WORTH] = tables.values[grade]
    feature[_WORTH + 1] = tables.fingers.best * grip_quality(tables.fingers, 0.0, 0.0, 0.0, misfit)


@compiled
def foresee(tables: Tables, number: Array, truth: Array) -> tuple[bool, bool]:
    """``fate`` with the tool where a report says, whenever that is: the belt's speed cancels out."""
    return fate(
        tables.fingers,
        tables.speed_m_s * (truth[TRUE_S] - number[PASSING_S]) - tables.tool_m * number[Z_AXIS],
        number[ACROSS_M] - tables.tool_m * number[Z_AXIS + 1] - truth[TRUE_Y],
        number[HEIGHT_M] - tables.tool_m * number[Z_AXIS + 2] - truth[TRUE_Z],
        number[X_AXIS : X_AXIS + 6],
        truth,
    )


@compiled
def fate(
    fingers: Fingers, along_m: float, across_m: float, up_m: float, axes: Array, truth: Array
) -> tuple[bool, bool]:
    """Whether the fingers hold, and whether the item would slip on the way, if it is there.

    Args:
        fingers: numbers of the grip.
        along_m: tool less item's centre; ``across_m`` and ``up_m`` alike.
        across_m: see ``along_m``.
        up_m: see ``along_m``.
        axes: (6,), the tool's x and z axes.
        truth: (TRUTHS,), the item's numbers.
    """
    long = axes[0] * truth[LONG] + axes[1] * truth[LONG + 1] + axes[2] * truth[LONG + 2]
    short = axes[3] * truth[SHORT] + axes[4] * truth[SHORT + 1] + axes[5] * truth[SHORT + 2]
    misfit = (1.0 - long * long) * truth[NARROW] + (1.0 - short * short) * truth[FLAT]
    quality = grip_quality(fingers, along_m, across_m, up_m, misfit)
    return holds(fingers, quality, truth[HOLD_LUCK]), slips(fingers, quality, truth[SLIP_LUCK])
