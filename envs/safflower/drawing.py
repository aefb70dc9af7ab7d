"""Draws rows of safflower: where the heads are, how they bloom and what they bear.

Each world hands over one block of uniform and one of normal numbers for the row and one each for the camera from its
own generator; everything else follows from them world by world, so a world's row does not depend on how many worlds are
drawn beside it, and the row is the same whatever the camera is.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc, ndtr

from ...kernels import compiled
from ...kernels.orders import count_upto
from ...mechanisms import FiveBar
from ..arrays import allocated
from ..core import Array
from ..dice import begins
from .batch import Heads, Plants
from .config import OPEN_STAGES, SafflowerConfig, ScenarioConfig
from .field import SPREAD_M

_PRIMARY_HEADS = 5
_BATCH_DAYS = 4.5
"""Days between the flowering batches [published: each lasts 4 to 5 days]."""
_FRESH_DAYS, _OPEN_DAYS = 3.0, 6.0
"""Florets open within 3-4 days; filaments are dry and hard after day 6 [published]."""
_FRESH_SHARE = 0.6
"""Share of fresh heads among the open ones that are presented in pots [assumed]."""
SPREAD_SIGMA = 0.078
"""Relative deviation of the filament spread [published: 47.85 +- 3.73 mm]."""
SIZE_SHARE = 0.7
"""Correlation of a head's size with the logarithm of its mass [assumed]."""
_REST_SHARE = float(np.sqrt(1.0 - SIZE_SHARE**2))
_GOLDEN_ANGLE = np.pi * (3.0 - np.sqrt(5.0))
_PLAY = 0.5
"""How irregularly the heads of a plant are spread: 0 is a perfect spiral [assumed]."""
_REACH_RESERVE_M = 0.012
"""Room that the potted plants leave to the workspace's edge [assumed: pots are turned to fit]."""


@lru_cache(maxsize=32)
def _count_table(scenario: ScenarioConfig) -> NDArray[np.floating]:
    """Cumulative probabilities of 0, 1, ... heads on a plant."""
    counts = np.arange(scenario.max_heads)
    if scenario.dispersion == 0.0:
        return counts / scenario.max_heads
    success = scenario.dispersion / (scenario.dispersion + scenario.mean_heads)
    return betainc(scenario.dispersion, counts + 1.0, success)


def heads_per_plant(scenario: ScenarioConfig) -> float:
    """Mean number of heads on a plant."""
    return float((1.0 - _count_table(scenario)).sum())


def stage_shares(scenario: ScenarioConfig) -> Array:
    """Share of a scenario's heads that are of each stage (4,), over all plants and days."""
    if scenario.potted:
        return np.array([0.0, _FRESH_SHARE, 1.0 - _FRESH_SHARE, 0.0])
    there = 1.0 - _count_table(scenario)
    days = np.linspace(*scenario.visit_day, 101)[:, None, None]
    begins = np.array([0.0, _FRESH_DAYS, _OPEN_DAYS])
    # A plant and a head are a normal number each before or behind the rest.
    past = ndtr((days - _behind_days(scenario)[:, None] - begins) / np.sqrt(2.0)).mean(axis=0)
    ends = np.concatenate([[1.0], there @ past / there.sum(), [0.0]])
    return ends[:-1] - ends[1:]


def _batches(scenario: ScenarioConfig) -> NDArray[np.int64]:
    """Which batch each head (S,) of a plant flowers in: the terminal one, primary and secondary ones."""
    return np.minimum((np.arange(scenario.max_heads) + _PRIMARY_HEADS - 1) // _PRIMARY_HEADS, 2)


def _behind_days(scenario: ScenarioConfig) -> Array:
    """How much later than the first each head (S,) flowers."""
    return np.asarray(_BATCH_DAYS * _batches(scenario), np.float64)


@lru_cache(maxsize=8)
def reach_table(bar: FiveBar) -> tuple[Array, Array]:
    """Levels below the motors (ascending) and the half width that the arm reaches there, both in metres."""
    levels = np.arange(-0.60, 0.0, 0.001)
    widths = np.linspace(0.0, 0.5 * bar.base_m, 400)
    grid = np.stack(np.broadcast_arrays(0.5 * bar.base_m + widths, levels[:, None]), axis=-1)
    gap = ~bar.reachable(grid)
    first_gap = np.where(gap.any(axis=1), gap.argmax(axis=1), len(widths))
    return levels, np.where(first_gap > 0, widths[np.maximum(first_gap - 1, 0)], -1.0)


class Reach(NamedTuple):
    """How wide the arm reaches: ``reach_table`` of its machine, for kernels."""

    level_m: Array
    width_m: Array

    @classmethod
    def of(cls, config: SafflowerConfig) -> Reach:
        """Of a configuration."""
        return cls(*reach_table(config.machine.picker.five_bar))


@compiled
def half_width_m(reach: Reach, level_m: float, below: float, above: float) -> float:
    """Half the width that the arm reaches at a level, ``below`` and ``above`` beyond the table's ends."""
    levels, widths = reach.level_m, reach.width_m
    i, last = count_upto(levels, level_m) - 1, len(levels) - 1
    if i < 0:
        return below
    if i == last:
        return widths[last] if level_m == levels[last] else above
    return (widths[i + 1] - widths[i]) / (levels[i + 1] - levels[i]) * (level_m - levels[i]) + widths[i]


class Growth(NamedTuple):
    """What a row grows from: configuration and scenario in the shape that a kernel takes; S heads at most on a plant.

    Attributes:
        counts: (S,), cumulative probabilities of 0, 1, ... heads on a plant.
        along_m: (P,), where the plants stand along the row.
        across_m: (P,), and across.
        potted: see ``ScenarioConfig``.
        height_m: the lowest height and the range, when potted, or mean and standard deviation.
        top_m: of the tallest plant, when potted.
        crown_m: the narrowest crown and the range.
        drop_m: (S,), how far below the plant's top each head stands at most.
        behind_days: (S,), how much later than the first each head flowers.
        turn_rad: (S,), where about the stem each head stands.
        visit_day: the first day and the range.
        reach: of the arm.
        motor_height_m: of the motors' axes.
        occluded: share of heads behind leaves.
        mass_g: of an open head.
        mass_spread: standard deviation of the logarithm of a head's mass.
        mass_lift: half its square.
    """

    counts: Array
    along_m: Array
    across_m: Array
    potted: bool
    height_m: tuple[float, float]
    top_m: float
    crown_m: tuple[float, float]
    drop_m: Array
    behind_days: Array
    turn_rad: Array
    visit_day: tuple[float, float]
    reach: Reach
    motor_height_m: float
    occluded: float
    mass_g: float
    mass_spread: float
    mass_lift: float

    @classmethod
    def of(cls, config: SafflowerConfig) -> Growth:
        """The numbers of a configuration."""
        scenario = config.scenario
        number = np.arange(scenario.max_heads)
        low, high = scenario.plant_height_m
        first, last = scenario.visit_day
        narrow, wide = scenario.crown_m
        stands_m = scenario.stands_m()
        return cls(
            counts=np.array(_count_table(scenario), float),
            along_m=stands_m[:, 0].copy(),
            across_m=stands_m[:, 1].copy(),
            potted=bool(scenario.potted),
            height_m=(float(low), float(high - low if scenario.potted else high)),
            top_m=float(high),
            crown_m=(float(narrow), float(wide - narrow)),
            drop_m=np.asarray(scenario.head_drop_m, float)[_batches(scenario)],
            behind_days=_behind_days(scenario),
            turn_rad=_GOLDEN_ANGLE * number,
            visit_day=(float(first), float(last - first)),
            reach=Reach.of(config),
            motor_height_m=float(scenario.motor_height_m),
            occluded=float(scenario.occluded),
            mass_g=float(config.head_mass_g),
            mass_spread=float(config.head_mass_spread),
            mass_lift=float(0.5 * config.head_mass_spread**2),
        )

    @property
    def random_numbers(self) -> tuple[int, int]:
        """Uniform and normal numbers that a world's row is drawn from."""
        plants, heads = len(self.along_m), len(self.along_m) * len(self.counts)
        return 4 * plants + 5 * heads + 1, 2 * plants + 5 * heads


class Chances(NamedTuple):
    """Where in a world's blocks the numbers of its plants and heads begin, in this order; normal ones end in ``_z``.

    What a scenario does not ask for takes no place.
    """

    number: int
    height: int
    crown: int
    drop: int
    ahead: int
    across: int
    turn: int
    fresh: int
    day: int
    occluded: int
    height_z: int
    plant_z: int
    head_z: int
    size_z: int
    mass_z: int
    cut_z: int
    fall_z: int

    @classmethod
    def of(cls, growth: Growth) -> Chances:
        """The places for a scenario."""
        plants, heads = len(growth.along_m), len(growth.along_m) * len(growth.counts)
        uniform = [plants] * 3 + [heads] * 3 + [plants, heads * growth.potted, 1 - growth.potted, heads]
        normal = [plants, plants * (1 - growth.potted), heads * (1 - growth.potted)] + [heads] * 4
        return cls(*begins(uniform), *begins(normal))


def draw_heads(growth: Growth, uniform: Array, normal: Array) -> tuple[Heads, Plants]:
    """Grow the plants of R worlds from their random blocks (R, .)."""
    rows, plants = len(uniform), len(growth.along_m)
    grown = allocated(Heads, rows, heads=plants * len(growth.counts)), allocated(Plants, rows, plants=plants)
    grow(growth, Chances.of(growth), uniform, normal, *grown)
    return grown


@compiled
def grow(growth: Growth, at: Chances, uniform: Array, normal: Array, heads: Heads, plants: Plants) -> None:
    """Let the plants of R worlds, and the heads on them, grow from their random blocks (R, .)."""
    most = len(growth.counts)
    for r in range(len(plants.count)):
        u, z = uniform[r], normal[r]
        plants.count[r] = len(growth.along_m)
        for p in range(len(growth.along_m)):
            crown = growth.crown_m[0] + growth.crown_m[1] * u[at.crown + p]
            lift = 0.0
            if growth.potted:
                height = growth.height_m[0] + growth.height_m[1] * u[at.height + p]
                lift = growth.top_m - height
            else:
                height = growth.height_m[0] + growth.height_m[1] * z[at.height_z + p]
            plants.base[r, p, 0], plants.base[r, p, 1], plants.base[r, p, 2] = (
                growth.along_m[p],
                growth.across_m[p],
                lift,
            )
            plants.height_m[r, p], plants.crown_m[r, p] = height, crown
            count = count_upto(growth.counts, u[at.number + p])
            for k in range(count):
                i = most * p + k
                up = max((lift + height) - growth.drop_m[k] * u[at.drop + i], 0.0)
                if growth.potted:
                    ahead, across = in_pot(growth, crown, count, k, u[at.ahead + i], u[at.across + i], up)
                    stage = 1 if u[at.fresh + i] < _FRESH_SHARE else 2
                else:
                    turn = u[at.turn + p] + _PLAY * _PLAY * u[at.across + i]
                    ahead, across = in_row(growth, crown, count, k, u[at.ahead + i], turn)
                    day = growth.visit_day[0] + growth.visit_day[1] * u[at.day]
                    age = day - growth.behind_days[k] - z[at.plant_z + p] - z[at.head_z + i]
                    stage = (1 if age > 0.0 else 0) + (1 if age > _FRESH_DAYS else 0) + (1 if age > _OPEN_DAYS else 0)
                mix = SIZE_SHARE * z[at.size_z + i] + _REST_SHARE * z[at.mass_z + i]
                place = heads.position[r, i]
                place[0], place[1], place[2] = growth.along_m[p] + ahead, growth.across_m[p] + across, up
                heads.exists[r, i], heads.stage[r, i], heads.plant[r, i] = True, stage, p
                heads.size_m[r, i] = SPREAD_M * (1.0 + SPREAD_SIGMA * z[at.size_z + i])
                if stage == OPEN_STAGES[0] or stage == OPEN_STAGES[1]:
                    heads.mass_g[r, i] = growth.mass_g * math.exp(growth.mass_spread * mix - growth.mass_lift)
                heads.occluded[r, i] = u[at.occluded + i] < growth.occluded
                heads.cut_luck[r, i], heads.drop_luck[r, i] = z[at.cut_z + i], z[at.fall_z + i]


@compiled
def in_pot(
    growth: Growth, crown_m: float, count: int, k: int, ahead_u: float, across_u: float, up_m: float
) -> tuple[float, float]:
    """Where head ``k`` of ``count`` of a pot stands from its stem, along and across.

    Stems of a pot stand apart, left and right in turn, so that no flower hides another (the paper reports none
    missed), and pots are turned so that the arm reaches every head.
    """
    ahead = crown_m * ((k + 0.25 + 0.5 * ahead_u) / count - 0.5)
    half = half_width_m(growth.reach, up_m - growth.motor_height_m, growth.reach.width_m[0], growth.reach.width_m[-1])
    side = 1.0 - 2.0 * (k % 2)
    return ahead, side * (0.35 + 0.65 * across_u) * min(0.5 * crown_m, half - _REACH_RESERVE_M)


@compiled
def in_row(growth: Growth, crown_m: float, count: int, k: int, ahead_u: float, turn: float) -> tuple[float, float]:
    """Where head ``k`` of ``count`` of a plant in the field stands from its stem, along and across.

    Heads of a plant keep apart: golden-angle places with some play, the terminal head in the middle.
    """
    share = (k + _PLAY * ahead_u) / count
    radius = 0.5 * crown_m * math.sqrt(min(share, 1.0))
    angle = growth.turn_rad[k] + 2.0 * np.pi * turn
    return radius * math.cos(angle), radius * math.sin(angle)
