"""How long everything takes: tables over the few places that the tool can stand at, and what a decision makes of them.

Rows are straight, so a gate is told by its rise, its width and its fall, and both rows have a handful of cells. Every
duration is looked up; nothing is planned while a task runs. Rules, policies, bound and executor take their seconds from
here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled
from ...motion import QUINTIC, Gate, PathMotion, StoppedPath, minimum_time, rounded
from ..core import Array
from .columns import E, W
from .config import MachineConfig, ScenarioConfig, TransplantingConfig, Tray

STRAIGHT, CLEARING = range(2)
"""Ways to a pair's source cell: straight, or by way of the target cell and the chute where that must be cleared."""
_NARROWEST_M = 0.02
_NODES = 17
"""Widths at which the time-optimal gate is planned; a cubic spline between them is within 0.2 % (tested)."""


@dataclass(frozen=True, eq=False)
class Places:
    """Where the tool can stand, n and m being the cells of a presented source and target row.

    Places are numbered: 0 ... n + m - 1 down at the cells, source row first; the same number of places above them, at
    the gates' level; last, above the chute between the trays. There are P = 2 (n + m) + 1.

    Attributes:
        x_m: across the machine, (P,).
        height_m: above the cells, (P,): 0 or the lift.
    """

    x_m: Array
    height_m: Array

    @property
    def park(self) -> int:
        """The place above the chute."""
        return len(self.x_m) - 1

    @property
    def cells(self) -> int:
        """Cells of both rows, n + m: the distance in numbers from a place to the one above it."""
        return len(self.x_m) // 2


class Times(NamedTuple):
    """Durations and path lengths of a configuration; the last axis of the ways is ``Ways``.

    Attributes:
        approach: (2, P, n m, 2), from a place to the source cell of a pair, ``STRAIGHT`` or ``CLEARING``. Pairs count
            target cells fastest.
        carry: (3, n m, 2), from a pair's source to its target cell, by speed.
        rise: (P, 2), from a place to above it.
        row_s: (2, rows), seconds of each conveyor (see ``Ends``) from each row to the next; there is one row more
            than there are, for worlds of a batch that are over.
        grip_s: seconds to grip.
        release_s: seconds to release.
        handle_s: seconds to grip and to release.
        illegal_s: seconds that an illegal action costs.
        turn_s: (2,), seconds until either carousel (see ``Ends``) has moved on by a tray, where trays are ordered.
    """

    approach: Array
    carry: Array
    rise: Array
    row_s: Array
    grip_s: float
    release_s: float
    handle_s: float
    illegal_s: float
    turn_s: Array


@compiled
def above(times: Times, place: int) -> int:
    """The place above a place."""
    cells = len(times.rise) // 2
    return place + cells if place < cells else place


@compiled
def handling_s(times: Times, clears: bool, grips: bool) -> float:
    """Seconds that the gripper works for a pair; the needles close at the source cell, whether they grip or not."""
    seconds = times.grip_s
    if clears:
        seconds += times.handle_s
    if grips:
        seconds += times.release_s
    return seconds


@lru_cache(maxsize=16)
def places(machine: MachineConfig, source: Tray, target: Tray) -> Places:
    """The places of a machine over two kinds of trays."""
    cells = cell_places(machine, source, target)
    x = np.concatenate([cells, cells, [0.0]])
    height = np.concatenate([np.zeros(len(cells)), np.full(len(cells) + 1, machine.lift_m)])
    return Places(x, height)


def times(config: TransplantingConfig) -> Times:
    """The tables of a configuration; arrays are shared, not to be written into."""
    process, orders = config.process, config.scenario.orders
    return Times(
        *_ways(config.machine, config.scenario.source, config.scenario.target),
        _rows_s(config.machine, config.scenario),
        process.grip_s,
        process.release_s,
        process.grip_s + process.release_s,
        process.illegal_s,
        np.array([orders.source_turn_s, orders.target_turn_s]),
    )


def cell_places(machine: MachineConfig, source: Tray, target: Tray) -> Array:
    """Where the cells of the presented rows are across the machine, (n + m,), metres: source left, target right."""
    rows = []
    for side, tray in ((-1.0, source), (1.0, target)):
        along = np.arange(tray.columns) - 0.5 * (tray.columns - 1)
        rows.append(side * machine.tray_centre_m + along * tray.pitch_m)
    return np.concatenate(rows)


def conveyor_s(machine: MachineConfig, distance_m: float) -> float:
    """Time of a conveyor over a distance and until the plugs stand still."""
    moving = QUINTIC.duration(distance_m, machine.conveyor_velocity_m_s, machine.conveyor_acceleration_m_s2)
    return float(moving) + machine.conveyor_settle_s


def exchange_m(machine: MachineConfig, tray: Tray) -> float:
    """Distance from the last row of a tray to the first row of the next one."""
    return tray.length_m - (tray.rows - 1) * tray.pitch_m + machine.tray_gap_m


def _rows_s(machine: MachineConfig, scenario: ScenarioConfig) -> Array:
    sides = (scenario.source, scenario.source_trays), (scenario.target, scenario.target_trays)
    row_s = np.empty((len(E), max(tray.rows * trays for tray, trays in sides) + 1))
    for side, (tray, _) in zip(row_s, sides, strict=True):
        side[:] = conveyor_s(machine, tray.pitch_m)
        side[tray.rows - 1 :: tray.rows] = conveyor_s(machine, exchange_m(machine, tray))
    return row_s


@lru_cache(maxsize=16)
def _ways(machine: MachineConfig, source: Tray, target: Tray) -> tuple[Array, Array, Array]:
    """The ways of ``Times``."""
    where, cells = places(machine, source, target), cell_places(machine, source, target)
    x, height, n, m = where.x_m, where.height_m, source.columns, target.columns
    ends = np.append(np.arange(n + m), where.park)
    to = _gates(machine.gate(), machine.lift_m, x, height, ends)
    # Standing where one has to go: no gate at all.
    same = (np.arange(len(x))[:, None] == ends) & (height[:, None] == 0.0)
    to[same] = 0.0
    pair_source, pair_target = np.repeat(np.arange(n), m), n + np.tile(np.arange(m), n)
    chute = n + m
    clearing = to[:, pair_target] + to[pair_target, chute] + to[-1, pair_source]
    carries = [
        _gates(machine.gate(limit), machine.lift_m, cells, np.zeros(n + m), np.arange(n, n + m))[:n].reshape(n * m, -1)
        for limit in machine.carry_acceleration_m_s2
    ]
    rise_m = np.where(height == 0.0, machine.lift_m, 0.0)
    rise = _way(machine.gate().durations(rise_m, 0.0, 0.0), rise_m)
    return np.stack([to[:, pair_source], clearing]), np.stack(carries), rise


def _way(seconds: Array, metres: Array) -> Array:
    """Durations and lengths side by side along a new last axis, see ``Ways``."""
    way = np.empty((*seconds.shape, 2))
    way[..., W.s], way[..., W.m] = seconds, metres
    return way


def gate_motion(gate: Gate, start: Array, end: Array, level_m: float) -> StoppedPath | PathMotion:
    """The timed way from one place to another over the gates' level.

    A tool that starts or ends at that level has one corner to pass, not two; ways with rounded corners round it as far
    as the straight piece and the traverse leave room.

    Args:
        gate: style and limits.
        start: (2,), across and up, metres.
        end: (2,), likewise.
        level_m: height of the traverse.
    """
    rise, fall, across = level_m - start[1], level_m - end[1], abs(end[0] - start[0])
    radius = min(max(rise, fall) - gate.straight_m, across, gate.radius_m)
    if gate.style not in _ROUNDED or min(rise, fall) > 1e-9 or radius <= 1e-6:
        return gate.motion(start, end, level_m)
    # The corner lies above whichever end is below the level.
    corner = np.array([start[0] if rise > fall else end[0], level_m])
    path = rounded(np.stack([start, corner, end]), float(radius))
    return minimum_time(path, gate.velocity_limit, gate.acceleration_limit)


_ROUNDED = ("blended", "time-optimal")


@lru_cache(maxsize=4096)
def _hook(gate: Gate, lift_m: float, across_m: float) -> tuple[float, float]:
    """Duration and path length of a way with one corner."""
    motion = gate_motion(gate, np.zeros(2), np.array([across_m, lift_m]), lift_m)
    return motion.duration_s, motion.path.length_m if isinstance(motion, PathMotion) else lift_m + across_m


def _gates(gate: Gate, lift_m: float, x: Array, height: Array, ends: NDArray[np.int64]) -> Array:
    """Ways (P, len(ends), 2) from every place to those named by ``ends``."""
    across = np.abs(x[:, None] - x[ends])
    rise, fall = np.broadcast_arrays((lift_m - height)[:, None], lift_m - height[ends])
    if gate.style not in _ROUNDED:
        return _way(gate.durations(rise, across, fall), rise + across + fall)
    seconds, metres = np.zeros(across.shape), np.zeros(across.shape)
    hooks = ((rise == 0.0) != (fall == 0.0)) & (across > 0.0)
    for row, column in zip(*np.nonzero(hooks), strict=True):
        seconds[row, column], metres[row, column] = _hook(gate, lift_m, round(float(across[row, column]), 9))
    planned = ~hooks
    if gate.style == "time-optimal":
        smooth = planned & (rise > 0.0) & (fall > 0.0) & (across >= _NARROWEST_M)
        if smooth.any():
            splines = _splines(gate, lift_m, float(across[smooth].max()))
            seconds[smooth], metres[smooth] = (spline(across[smooth]) for spline in splines)
        planned = planned & ~smooth
    strokes = rise[planned], across[planned], fall[planned]
    seconds[planned], metres[planned] = gate.durations(*strokes), _lengths(gate, *strokes)
    return _way(seconds, metres)


@lru_cache(maxsize=64)
def _splines(gate: Gate, lift_m: float, widest_m: float) -> tuple[Any, Any]:
    """Duration and length over the width, cubic splines, for gates that are too costly to plan one by one."""
    from scipy.interpolate import CubicSpline

    widths = np.geomspace(_NARROWEST_M, widest_m, _NODES)
    seconds = gate.durations(lift_m, widths, lift_m)
    return CubicSpline(widths, seconds), CubicSpline(widths, _lengths(gate, lift_m, widths, lift_m))


def _lengths(gate: Gate, rise: Array | float, across: Array, fall: Array | float) -> Array:
    strokes = np.broadcast_arrays(*(np.round(np.asarray(v, float), 9) for v in (rise, across, fall)))
    rows, back = np.unique(np.stack([v.ravel() for v in strokes], axis=-1), axis=0, return_inverse=True)
    found = [gate.path((0.0, 0.0), (w, u - d), u).length_m if u + w + d > 0.0 else 0.0 for u, w, d in rows.tolist()]
    return np.array(found)[back.reshape(-1)].reshape(strokes[0].shape)
