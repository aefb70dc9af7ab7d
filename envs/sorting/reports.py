"""What follows from a report alone: how the tool must stand, where on the belt it can, how long it stays down."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ...kernels import compiled, fill
from ...kernels.angles import sine_cosine
from ...motion import orientation
from ..core import Array, Rows
from .columns import (
    CANDIDATE,
    ITEM,
    KINDS,
    LENGTH_SCALE_M,
    LIMIT,
    NUMBER,
    PLACE_SCALE_M,
    REPORT,
    TILT_SCALE_RAD,
    TOTAL,
    TRUTH,
    TURN_SCALE_RAD,
)
from .orders import begin_orders
from .process import Fingers, grip_quality, holds, slips
from .reach import reach_m
from .state import Tables, Worlds
from .timing import hold_s, stroke_s, turn_s

SWING_M = 0.006
"""Kept free at the end of the reach: the way to the bin begins at the belt's speed [assumed, tested]."""
_REFUSED_LEAVES_M = 0.10
"""What cannot be gripped is shown until it has left the place where others are."""
_NEVER_S = -1e9

_tilted_by = compiled(orientation.tilted_by)
x_axis, z_axis = compiled(orientation.x_axis), compiled(orientation.z_axis)
"""Parts of ``motion.orientation`` for single turns."""


@compiled
def turned(tilt: float, azimuth: float, yaw: float) -> tuple[float, float, float, float]:
    """``motion.orientation.tilted`` of one turn."""
    st, ct = sine_cosine(0.5 * tilt)
    sy, cy = sine_cosine(0.5 * yaw)
    sa, ca = sine_cosine(azimuth)
    return _tilted_by(st, ct, sy, cy, sa, ca)


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
            worlds.item_free[w, i] = item[ITEM.passing_s] < np.inf
            fill(worlds.item_truth[w, i], 0.0)
            if worlds.item_free[w, i]:
                lay_item(tables, item, worlds.item_truth[w, i])
                totals[TOTAL.items] += 1.0
                totals[TOTAL.worth] += tables.values[int(item[ITEM.grade])]
                end_s = max(end_s, item[ITEM.passing_s] + tables.exit_s)
        if worlds.line_left.shape[1]:
            begin_orders(worlds, w, tables.values)
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
    truth[TRUTH.passing_s] = item[ITEM.passing_s] - item[ITEM.slip_along_m] / tables.paces.speed_m_s
    truth[TRUTH.across_m] = item[ITEM.across_m] + item[ITEM.slip_across_m]
    truth[TRUTH.up_m] = item[ITEM.up_m] - tables.above_m
    w, x, y, z = turned(item[ITEM.tilt_rad], item[ITEM.azimuth_rad], item[ITEM.yaw_rad])
    truth[TRUTH.long_x], truth[TRUTH.long_y], truth[TRUTH.long_z] = x_axis(w, x, y, z)
    truth[TRUTH.short_x], truth[TRUTH.short_y], truth[TRUTH.short_z] = z_axis(w, x, y, z)
    narrow, flat = 1.0 - item[ITEM.width], 1.0 - item[ITEM.thickness]
    truth[TRUTH.narrow], truth[TRUTH.flat] = narrow * narrow, flat * flat
    truth[TRUTH.grip_luck], truth[TRUTH.way_luck] = item[ITEM.grip_luck], item[ITEM.way_luck]
    truth[TRUTH.grade] = item[ITEM.grade]


@compiled
def take_reports(tables: Tables, worlds: Worlds, rows: Rows, reports: Array) -> None:
    """Add reports (R, M, REPORT) to the worlds ``rows``; what is done or has left makes room, the rest is lost."""
    empty = worlds.leave_s.shape[1] - 1
    for r, w in enumerate(rows):
        time_s, leave_s, queue = worlds.totals[w, TOTAL.time_s], worlds.leave_s[w], worlds.queue[w]
        count, place = forget(queue, int(worlds.queued[w]), leave_s, time_s), 0
        for m in range(reports.shape[1]):
            report = reports[r, m]
            if report[REPORT.passing_s] == np.inf:
                continue
            while place < empty and time_s < leave_s[place] < np.inf:
                place += 1
            if place == empty:
                break
            number, item = worlds.number[w, place], int(report[REPORT.item])
            prepare(tables, report, number, worlds.feature[w, place])
            leave_s[place], worlds.seen_s[w, place] = number[NUMBER.leave_s], report[REPORT.seen_s]
            worlds.report_item[w, place], worlds.report_grade[w, place] = item, int(report[REPORT.grade])
            held, lost = foresee(tables, number, worlds.item_truth[w, item])
            worlds.report_held[w, place], worlds.report_lost[w, place] = held, lost
            queue_up(queue, count, leave_s, place)
            count += 1
            place += 1
        worlds.queued[w], worlds.first[w] = count, 0
        soon_s, seen_s = np.inf, worlds.seen_s[w]
        for q in range(count - 1, -1, -1):
            soon_s = worlds.soon_s[w, q] = min(soon_s, seen_s[queue[q]])
        show_reports(worlds, w, time_s)


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
def show_reports(worlds: Worlds, w: int, time_s: float) -> None:
    """Show a world's first reports, by leaving time, that have come and whose items are there."""
    first, count, shown, slots = worlds.first[w], worlds.queued[w], 0, worlds.slot_report.shape[1]
    while first < count and worlds.leave_s[w, worlds.queue[w, first]] <= time_s:
        first += 1
    worlds.first[w] = first
    # Behind a place in the queue from where on none has come, none is to be shown.
    for q in range(first, count):
        if worlds.soon_s[w, q] > time_s or shown == slots:
            break
        report = worlds.queue[w, q]
        if worlds.leave_s[w, report] > time_s and worlds.seen_s[w, report] <= time_s:
            worlds.slot_report[w, shown] = report
            shown += 1
    for k in range(shown, slots):
        worlds.slot_report[w, k] = worlds.leave_s.shape[1] - 1


@compiled
def prepare(tables: Tables, report: Array, number: Array, feature: Array) -> None:
    """Write what follows from a report; one that cannot be gripped has no last x and no deadline."""
    paces, speed, grade = tables.paces, tables.paces.speed_m_s, int(report[REPORT.grade])
    yaw_seen, tilt_seen = _wrapped(report[REPORT.yaw_rad]), report[REPORT.tilt_rad]
    yaw = min(max(yaw_seen, -tables.yaw_limit_rad), tables.yaw_limit_rad)
    tilt = min(tilt_seen, tables.tilt_limit_rad)
    qw, qx, qy, qz = turned(tilt, report[REPORT.azimuth_rad], yaw)
    number[NUMBER.turn_w], number[NUMBER.turn_x], number[NUMBER.turn_y], number[NUMBER.turn_z] = qw, qx, qy, qz
    number[NUMBER.x_axis_x], number[NUMBER.x_axis_y], number[NUMBER.x_axis_z] = x_axis(qw, qx, qy, qz)
    tool_x, tool_y, tool_z = z_axis(qw, qx, qy, qz)
    number[NUMBER.z_axis_x], number[NUMBER.z_axis_y], number[NUMBER.z_axis_z] = tool_x, tool_y, tool_z
    passing = report[REPORT.passing_s] - tables.tool_m * tool_x / speed
    y = report[REPORT.across_m] + tables.tool_m * tool_y
    z = min(max(report[REPORT.up_m] + tables.tool_m * tool_z - tables.above_m, 0.0), tables.level_m)
    down = stroke_s(tables.level_m - z, paces.down_pace, paces.square_pace)
    hold = hold_s(down, paces.grip_s)
    reach = max(reach_m(tables.reach_m, tilt, yaw), 0.0)
    half = math.sqrt(max(reach * reach - y * y, 0.0))
    last = half - SWING_M - speed * hold
    fits = tilt_seen <= tables.tilt_refused_rad and last > -half
    turn = 2.0 * math.acos(min(qw, 1.0))
    least = turn_s(turn, paces.turn_pace, paces.turn_square_pace, paces.shortest_s)
    bin_x, across = tables.bins[grade, 0], tables.bins[grade, 1] - y
    aside = math.sqrt(across * across + bin_x * bin_x)
    number[NUMBER.passing_s], number[NUMBER.across_m], number[NUMBER.first_m] = passing, y, -half
    number[NUMBER.hold_s], number[NUMBER.last_m] = hold, last if fits else -np.inf
    number[NUMBER.deadline_s] = passing + last / speed if fits else _NEVER_S
    number[NUMBER.leave_s] = passing + (last if fits else _REFUSED_LEAVES_M) / speed
    number[NUMBER.least_s], number[NUMBER.aside_m2], number[NUMBER.bin_m] = least, across * across, bin_x
    number[NUMBER.carry_s] = max(stroke_s(aside, paces.pace, paces.square_pace), least)
    number[NUMBER.height_m], number[NUMBER.descend_s] = z, down

    narrow = (1.0 - report[REPORT.width]) * sine_cosine(yaw_seen - yaw)[0]
    flat = (1.0 - report[REPORT.thickness]) * sine_cosine(tilt_seen - tilt)[0]
    misfit = narrow * narrow + flat * flat
    quality = grip_quality(tables.fingers, 0.0, 0.0, 0.0, misfit)
    feature[CANDIDATE.present] = 1.0
    feature[CANDIDATE.across] = shown(y / PLACE_SCALE_M)
    feature[CANDIDATE.sin_2yaw], feature[CANDIDATE.cos_2yaw] = sine_cosine(2.0 * yaw_seen)
    feature[CANDIDATE.tilt], feature[CANDIDATE.turn] = shown(tilt_seen / TILT_SCALE_RAD), turn / TURN_SCALE_RAD
    feature[CANDIDATE.length] = shown(report[REPORT.length_m] / LENGTH_SCALE_M)
    for other in range(KINDS):
        feature[CANDIDATE.ware + other] = 1.0 if other == grade else 0.0
    feature[CANDIDATE.value], feature[CANDIDATE.quality] = tables.values[grade], tables.fingers.best * quality


@compiled
def shown(feature: float) -> float:
    """A feature as policies are shown it: within ``LIMIT``."""
    return min(max(feature, -LIMIT), LIMIT)


@compiled
def foresee(tables: Tables, number: Array, truth: Array) -> tuple[bool, bool]:
    """``fate`` with the tool where a report says, whenever that is: the belt's speed cancels out."""
    return fate(
        tables.fingers,
        tables.paces.speed_m_s * (truth[TRUTH.passing_s] - number[NUMBER.passing_s])
        - tables.tool_m * number[NUMBER.z_axis_x],
        number[NUMBER.across_m] - tables.tool_m * number[NUMBER.z_axis_y] - truth[TRUTH.across_m],
        number[NUMBER.height_m] - tables.tool_m * number[NUMBER.z_axis_z] - truth[TRUTH.up_m],
        number[NUMBER.x_axis_x : NUMBER.x_axis_x + 6],
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
        truth: (``Truth``), the item's numbers.
    """
    long = axes[0] * truth[TRUTH.long_x] + axes[1] * truth[TRUTH.long_y] + axes[2] * truth[TRUTH.long_z]
    short = axes[3] * truth[TRUTH.short_x] + axes[4] * truth[TRUTH.short_y] + axes[5] * truth[TRUTH.short_z]
    misfit = (1.0 - long * long) * truth[TRUTH.narrow] + (1.0 - short * short) * truth[TRUTH.flat]
    quality = grip_quality(fingers, along_m, across_m, up_m, misfit)
    return holds(fingers, quality, truth[TRUTH.grip_luck]), slips(fingers, quality, truth[TRUTH.way_luck])
