"""What may come of a sorter's picks by their luck: of the grip, of the way, of what a fruit is beneath its skin.

How well the fingers fit what lies behind a report follows from the reports' errors, which a bound knows; whether they
hold it, whether it slips on the way and whether a fruit is ripe is luck of its own for every item, which nobody sees
before the pick. Weeders' and pickers' counterparts are in ``hopes`` and ``safflower``.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.sorting.columns import NUMBER, REWARD, TRUTH
from ..envs.sorting.config import GRADES
from .base import state_of

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

RIPE, GREEN = GRADES.index("ripe"), GRADES.index("green")


class Chances(NamedTuple):
    """What may come of picks of n things, and what that brings beside what a right one brings in its bin.

    Attributes:
        least: (n,), chance that the fingers hold, at least: when the platform strays as is worst; 0 where the item may
            have been taken by another report of it.
        most: (n,), at most: when it strays as is best.
        right: (n,), chance that what is held comes to its bin and is of the grade that is reported.
        held: (n,), mean reward, <= 0, of grips that hold: for what slips and for what is of another grade.
        missed: reward, <= 0, of grips that hold nothing.
    """

    least: Array
    most: Array
    right: Array
    held: Array
    missed: float

    @classmethod
    def sure(cls, n: int) -> Chances:
        """Every pick ends well."""
        return cls(np.ones(n), np.ones(n), np.ones(n), np.zeros(n), 0.0)

    def counted(self) -> Chances:
        """The same where mistakes cost nothing."""
        return self._replace(held=np.zeros(len(self.held)), missed=0.0)

    def of(self, which: NDArray[np.bool_]) -> Chances:
        """Those of some things."""
        return Chances(self.least[which], self.most[which], self.right[which], self.held[which], self.missed)

    def mean(self, gain: Array) -> Array:
        """What picks bring on average, (n,), if a right one brings ``gain``."""
        return self.most * (self.right * gain + self.held) + (1.0 - self.most) * self.missed


def chances_of(core: Any, tables: Any, row: int, reports: Numbers, stray: tuple[float, float]) -> Chances:
    """Chances of picks at reports of a world.

    Args:
        core: the rules.
        tables: what they look up.
        row: the world.
        reports: (n,), which reports.
        stray: metres and radians by which the platform may be off where the fingers close.
    """
    state, fingers, weights = state_of(core), tables.fingers, tables.weights
    reported = state.report_grade[row, reports]
    right = likely(core, reported, state.item_truth[row, state.report_item[row, reports], TRUTH.grade] == reported)
    best, worst = (quality(state, tables, row, reports, sign * stray[0], sign * stray[1]) for sign in (1.0, -1.0))
    seldom, often = (np.minimum(fingers.slip * (1.0 - fit), 1.0) for fit in (best, worst))
    several = np.bincount(state.report_item[row, reports])[state.report_item[row, reports]] > 1
    wrong, dropped = (1.0 - right) * float(weights[REWARD.misplaced]), float(weights[REWARD.dropped])
    return Chances(
        np.where(several, 0.0, np.minimum(fingers.best * worst, 1.0)),
        np.minimum(fingers.best * best, 1.0),
        (1.0 - seldom) * right,
        np.maximum((1.0 - seldom) * wrong + seldom * dropped, (1.0 - often) * wrong + often * dropped),
        float(weights[REWARD.wasted]),
    )


def likely(core: Any, grade: Numbers, right: NDArray[np.bool_]) -> Array:
    """Chance that items are of the grade that is reported, (n,).

    A fruit's grade is its ripeness alone, of which nothing else is seen: so of fruits that the camera takes for no
    tuber it is the posterior by the shares that are drawn. Other grades are as they are.
    """
    share = 1.0 - float(core.config.produce.ripe_from), float(core.config.produce.ripe_from)
    seen, chance = np.asarray(core.perception.confusion, float), right.astype(float)
    for told in (RIPE, GREEN):
        chances = share[0] * seen[RIPE, told], share[1] * seen[GREEN, told]
        if seen[:RIPE, told].sum() == 0.0 and sum(chances) > 0.0:
            chance[grade == told] = chances[told - RIPE] / sum(chances)
    return chance


def quality(worlds: Any, tables: Any, row: int, reports: Numbers, stray_m: float, stray_rad: float) -> Array:
    """How well the fingers fit what is behind each report, (n,), when the platform strays as is best.

    It is 0 where they cannot hold it. With negative numbers the platform strays as is worst.
    """
    number, truth = worlds.number[row, reports], worlds.item_truth[row, worlds.report_item[row, reports]]
    x_axis = number[:, NUMBER.x_axis_x : NUMBER.x_axis_x + 3]
    z_axis = number[:, NUMBER.z_axis_x : NUMBER.z_axis_x + 3]
    tool = number[:, [NUMBER.across_m, NUMBER.across_m, NUMBER.height_m]] - tables.tool_m * z_axis
    off = tool - truth[:, [TRUTH.across_m, TRUTH.across_m, TRUTH.up_m]]
    # Along the belt its speed cancels out.
    off[:, 0] = (
        tables.paces.speed_m_s * (truth[:, TRUTH.passing_s] - number[:, NUMBER.passing_s])
        - tables.tool_m * z_axis[:, 0]
    )
    radial = np.maximum(np.hypot(off[:, 0], off[:, 1]) - stray_m - tables.tool_m * stray_rad, 0.0)
    height = np.maximum(np.abs(off[:, 2]) - stray_m - tables.tool_m * stray_rad, 0.0)
    misfit = np.zeros(len(reports))
    for axis, true, shape in ((x_axis, TRUTH.long_x, TRUTH.narrow), (z_axis, TRUTH.short_x, TRUTH.flat)):
        cosine = np.abs((axis * truth[:, true : true + 3]).sum(axis=1))
        angle = np.clip(np.arccos(np.minimum(cosine, 1.0)) - stray_rad, 0.0, 0.5 * np.pi)
        misfit += np.sin(angle) ** 2 * truth[:, shape]
    fingers = tables.fingers
    exponent = radial**2 * fingers.radial_per_m2 + height**2 * fingers.height_per_m2 + misfit * fingers.misfit
    fits = np.exp(exponent) * (radial**2 <= fingers.capture_m2)
    real = worlds.report_item[row, reports] < worlds.item_truth.shape[1] - 1
    return np.where(real & np.isfinite(number[:, NUMBER.last_m]), fits, 0.0)
