"""Ridges under the crop rows: how high the ground stands across, and what going up and down them takes.

The ground's height at a place is its ridge's and what ``shaking`` knows of the ground besides: tools keep their height
over both. A ridge is as high all along the row.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ...kernels import compiled
from ...motion import QUINTIC
from ..core import Array
from .config import ScenarioConfig
from .state import WeederPlan
from .timing import A, P, move_time


class Ridges(NamedTuple):
    """Ridges in the shape that kernels take.

    Attributes:
        height_m: see ``BedConfig.ridge_m``.
        half_m: half a ridge's width.
        furrow_m: height of the furrows over the level that the tool is mounted for.
        rows: how many there are.
        row_m: from one to the next.
    """

    height_m: float
    half_m: float
    furrow_m: float
    rows: int
    row_m: float

    @classmethod
    def of(cls, scenario: ScenarioConfig) -> Ridges:
        """The numbers of a scenario."""
        bed = scenario.bed
        width_m, furrow_m = float(bed.ridge_width_m), float(bed.levels_m[0])
        return cls(float(bed.ridge_m), 0.5 * width_m, furrow_m, int(bed.rows), float(scenario.row_m))


FLAT = Ridges(0.0, 0.1, 0.0, 1, 0.4)
"""No ridge is higher than its furrows."""


@compiled
def ridge_height(ridges: Ridges, across_m: float) -> float:
    """Height of the ground at a place across; on a ridge it is higher by (1 - d^2)^2 of it, d being 1 at its foot."""
    if ridges.height_m == 0.0:
        return ridges.furrow_m
    for row in range(ridges.rows):
        beside = (across_m - (row - 0.5 * (ridges.rows - 1)) * ridges.row_m) / ridges.half_m
        if abs(beside) < 1.0:
            return ridges.furrow_m + ridges.height_m * (1.0 - beside * beside) ** 2
    return ridges.furrow_m


@compiled
def ridge_heights(ridges: Ridges, across_m: Array) -> Array:
    """``ridge_height`` of places across (n,)."""
    heights = np.empty(len(across_m))
    for i in range(len(across_m)):
        heights[i] = ridge_height(ridges, across_m[i])
    return heights


@compiled
def lift_time(arm: Any, from_m: float, to_m: float) -> float:
    """Seconds that a tool takes to rise or sink with the ridges from one place across to another.

    Up and down it keeps the limits of its carrier.
    """
    rise = ridge_height(arm.ridges, to_m) - ridge_height(arm.ridges, from_m)
    return 0.0 if rise == 0.0 else move_time(arm, rise, 0.0, 0.0)


def risen(ridges: Ridges, plan: WeederPlan, phases_s: Array, time_s: Array) -> Array:
    """Height of the ground that the tool keeps its own over, (n,), at times (n,) of one world's decision."""
    begin, end = ridge_heights(ridges, np.array([plan.start[0, A.across], plan.target[0, A.across]])).tolist()
    move_s = float(phases_s[0, P.move] + phases_s[0, P.wait])
    return begin + QUINTIC.sample(time_s, 1.0, move_s).position * (end - begin)
