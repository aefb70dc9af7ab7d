"""How long every motion of a task takes: tables over the few places that the tool can stand at.

Rows are straight, so a gate is told by its rise, its width and its fall, and both rows have a handful of cells. Every
duration that the rules need is looked up; nothing is planned while a task runs.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from ...motion import QUINTIC, Gate, PathMotion, StoppedPath, minimum_time, rounded
from ..core import Array
from .config import MachineConfig, Tray

_NARROWEST_M = 0.02
_NODES = 17
"""Widths at which the time-optimal gate is planned; a cubic spline between them is within 0.2 % (tested)."""


@dataclass(frozen=True)
class Motions:
    """Places and the gates between them, n and m being the cells of a presented source and target row.

    The tool's places are numbered: 0 ... n + m - 1 down at the cells, source row first; the same number of places above
    them, at the gates' level; last, above the chute between the trays. There are P = 2 (n + m) + 1.

    Attributes:
        x_m: where the places are across the machine, (P,).
        height_m: above the cells, (P,): 0 or the lift.
        approach_s: from a place to the source cell of a pair, (2, P, n m). Pairs count target cells fastest. The second
            half is for target cells that must be cleared first: to the target cell, with its seedling to the chute, on
            to the source.
        approach_m: path length of that.
        carry_s: from source to target, by speed, (3, n m).
        carry_m: path length of that, (3, n m).
        rise_s: from a place to above it, (P,).
        rise_m: path length of that.
        index_s: time of a conveyor to the next row, (2,): source, target.
        exchange_s: time of a conveyor from a tray's last row to the next tray's first one, (2,).
    """

    x_m: Array
    height_m: Array
    approach_s: Array
    approach_m: Array
    carry_s: Array
    carry_m: Array
    rise_s: Array
    rise_m: Array
    index_s: Array
    exchange_s: Array

    @property
    def park(self) -> int:
        """The place above the chute."""
        return len(self.x_m) - 1

    @property
    def cells(self) -> int:
        """Cells of both rows, n + m: the distance in numbers from a place to the one above it."""
        return len(self.x_m) // 2


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


@lru_cache(maxsize=16)
def motions(machine: MachineConfig, source: Tray, target: Tray) -> Motions:
    """The tables of a configuration."""
    cells = cell_places(machine, source, target)
    n, m = source.columns, target.columns
    x = np.concatenate([cells, cells, [0.0]])
    height = np.concatenate([np.zeros(n + m), np.full(n + m + 1, machine.lift_m)])
    ends = np.append(np.arange(n + m), len(x) - 1)
    to_s, to_m = _gates(machine.gate(), machine.lift_m, x, height, ends)
    # Standing where one has to go: no gate at all.
    same = (np.arange(len(x))[:, None] == ends) & (height[:, None] == 0.0)
    to_s, to_m = np.where(same, 0.0, to_s), np.where(same, 0.0, to_m)
    pair_source, pair_target = np.repeat(np.arange(n), m), n + np.tile(np.arange(m), n)

    def approach(table: Array) -> Array:
        chute = n + m
        via_target = table[:, pair_target] + table[pair_target, chute] + table[-1, pair_source]
        return np.stack([table[:, pair_source], via_target])

    carries = [
        _gates(machine.gate(limit), machine.lift_m, cells, np.zeros(n + m), np.arange(n, n + m))
        for limit in machine.carry_acceleration_m_s2
    ]
    rise = np.where(height == 0.0, machine.lift_m, 0.0)
    trays = source, target
    return Motions(
        x,
        height,
        approach(to_s),
        approach(to_m),
        np.stack([seconds[:n].ravel() for seconds, _ in carries]),
        np.stack([metres[:n].ravel() for _, metres in carries]),
        machine.gate().durations(rise, 0.0, 0.0),
        rise,
        np.array([conveyor_s(machine, tray.pitch_m) for tray in trays]),
        np.array([conveyor_s(machine, exchange_m(machine, tray)) for tray in trays]),
    )


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


def _gates(gate: Gate, lift_m: float, x: Array, height: Array, ends: NDArray[np.int64]) -> tuple[Array, Array]:
    """Durations and path lengths (P, len(ends)) from every place to those named by ``ends``."""
    across = np.abs(x[:, None] - x[ends])
    rise, fall = np.broadcast_arrays((lift_m - height)[:, None], lift_m - height[ends])
    if gate.style not in _ROUNDED:
        return gate.durations(rise, across, fall), rise + across + fall
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
    return seconds, metres


@lru_cache(maxsize=64)
def _splines(gate: Gate, lift_m: float, widest_m: float) -> tuple[CubicSpline, CubicSpline]:
    """Duration and length over the width, for gates that are too costly to plan one by one."""
    widths = np.geomspace(_NARROWEST_M, widest_m, _NODES)
    seconds = gate.durations(lift_m, widths, lift_m)
    return CubicSpline(widths, seconds), CubicSpline(widths, _lengths(gate, lift_m, widths, lift_m))


def _lengths(gate: Gate, rise: Array | float, across: Array, fall: Array | float) -> Array:
    strokes = np.broadcast_arrays(*(np.round(np.asarray(v, float), 9) for v in (rise, across, fall)))
    rows, back = np.unique(np.stack([v.ravel() for v in strokes], axis=-1), axis=0, return_inverse=True)
    found = [gate.path((0.0, 0.0), (w, u - d), u).length_m if u + w + d > 0.0 else 0.0 for u, w, d in rows.tolist()]
    return np.array(found)[back.reshape(-1)].reshape(strokes[0].shape)
