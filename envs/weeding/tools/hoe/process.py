"""The hoe as a tool of the weeding rules: how it gets to a plant, and what stirring there does to roots.

What the blade sweeps is a disc about the aim. A plant's root zone is a disc about its stem; the dose is the depth of
the blade times the share of the root zone that was swept, in metres. Doses add up.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .....motion import QUINTIC
from ....compiled import compiled
from ....core import Array
from ...config import SPECIES, STAGES
from ...tool import Approach, Place, bind
from ..laser.process import LABEL_KILL
from .config import INTENSITIES, PHASES, HoeProcessConfig, HoeReach

EXPECTED_SHARE = 0.95
"""Share of the root zone that a stir sweeps at the front camera's and the odometry's error; for choosing
intensities only."""

TOUCH_M = 1e-9
"""Discs whose edges are this near to touching from within count as touching: rounding stays out of the lens."""


class HoeArm(NamedTuple):
    """The 3-PRRS with its hoe in the shape that kernels take (see ``Arm``); nothing leans, so a place has no lean.

    Attributes:
        front_m: see ``HoeReach``.
        half_width_m: see ``HoeReach``.
        scale: ranges of the place's coordinates; the lean, always zero, is divided by one.
        travel_m: see ``HoeReach``.
        early_s: longest wait for a target in front of the window.
        pace_s_m: seconds a metre at the velocity limit.
        square_pace_s2_m: seconds squared a metre at the acceleration limit.
    """

    front_m: float
    half_width_m: float
    scale: tuple[float, float, float]
    travel_m: float
    early_s: float
    pace_s_m: float
    square_pace_s2_m: float

    @classmethod
    def of(cls, reach: HoeReach, early_s: float) -> HoeArm:
        """The numbers of a configuration."""
        travel, width = float(reach.travel_m), float(reach.half_width_m)
        pace, square = QUINTIC.paces(reach.velocity_m_s, reach.acceleration_m_s2)
        return cls(travel, width, (travel, 1.0, width), travel, float(early_s), float(pace), float(square))


@compiled
def move_time(arm: HoeArm, carrier_m: float, lean_m: float, across_m: float) -> float:
    """Seconds of a straight move; along and across keep the limits by themselves."""
    way = max(abs(carrier_m), abs(across_m))
    return max(way * arm.pace_s_m, math.sqrt(way * arm.square_pace_s2_m))


@compiled
def approach(
    arm: HoeArm, stand_s: float, place: Place, cart_m: float, speed_m_s: float, along_m: float, across_m: float
) -> Approach:
    """How the hoe would work on one target; see ``tool.approach``. The blade follows the plant for the whole time."""
    move_s = move_time(arm, along_m - place[0], 0.0, across_m - place[2])
    ahead = along_m - cart_m
    wait_s = max((ahead - arm.travel_m) / speed_m_s - move_s, 0.0)
    behind = ahead - speed_m_s * (move_s + wait_s) - speed_m_s * stand_s
    legal = behind >= -arm.travel_m and wait_s <= arm.early_s and abs(across_m) <= arm.half_width_m
    return Approach(along_m, 0.0, across_m, move_s, wait_s, legal)


@compiled
def ready(arm: HoeArm, cart_m: float) -> tuple[float, float, float]:
    """Place of the waiting blade: near the window's front edge, where the next weed comes in."""
    return cart_m + 0.8 * arm.travel_m, 0.0, 0.0


bind(HoeArm, approach, move_time, ready)


class Stir(NamedTuple):
    """A stir in the shape that kernels take (see ``Work``).

    Attributes:
        depth_m: by intensity.
        sweep_m: radius of the swept disc, by intensity.
        root_m: radius of the root zone, by kind of plant.
        reach_m: beyond this distance no root zone is touched.
    """

    depth_m: tuple[float, float, float]
    sweep_m: tuple[float, float, float]
    root_m: tuple[float, float, float, float]
    reach_m: float

    @classmethod
    def of(cls, process: HoeProcessConfig) -> Stir:
        """The numbers of a configuration."""
        gentle, normal, deep = map(float, process.depth_m)
        sweep = process.sweep_m.tolist()
        a, b, c = map(float, process.root_m)
        d = float(process.crop_root_m)
        return cls((gentle, normal, deep), (sweep[0], sweep[1], sweep[2]), (a, b, c, d), max(sweep) + max(a, b, c, d))


@compiled
def covered_share(sweep_m: float, root_m: float, distance_m: float) -> float:
    """Share of a root zone within the swept disc, the middles of the two discs a distance apart: their lens.

    Args:
        sweep_m: radius of the swept disc.
        root_m: radius of the root zone.
        distance_m: between their middles.
    """
    if distance_m >= sweep_m + root_m:
        return 0.0
    if distance_m <= abs(sweep_m - root_m) + TOUCH_M:
        return min(1.0, (sweep_m / root_m) ** 2)
    # Cosines of half the angle that the lens takes of each disc; each disc adds a sector less a triangle.
    square = distance_m * distance_m
    root = min((square + root_m * root_m - sweep_m * sweep_m) / (2.0 * distance_m * root_m), 1.0)
    sweep = min((square + sweep_m * sweep_m - root_m * root_m) / (2.0 * distance_m * sweep_m), 1.0)
    lens = root_m * root_m * (math.acos(root) - root * math.sqrt(1.0 - root * root))
    lens += sweep_m * sweep_m * (math.acos(sweep) - sweep * math.sqrt(1.0 - sweep * sweep))
    return lens / (math.pi * root_m * root_m)


@compiled
def dose(work: Stir, mode: int, along_m: float, across_m: float, kind: int) -> float:
    """Depth over the root zone of a plant at an offset from the stir's middle, metres."""
    distance = math.sqrt(along_m * along_m + across_m * across_m)
    return work.depth_m[mode] * covered_share(work.sweep_m[mode], work.root_m[kind], distance)


bind(Stir, dose)


def depth50_m(process: HoeProcessConfig, species: ArrayLike, stage: ArrayLike) -> Array:
    """Depth (...) over the root zone that uproots half of a kind (indices into ``SPECIES`` and ``STAGES``)."""
    factor = np.asarray(process.stage_factor)[np.asarray(stage)]
    return process.depth50_m * factor * np.where(np.asarray(species) == 1, process.grass_factor, 1.0)


def uproot_probability(process: HoeProcessConfig, dose_m: ArrayLike, species: ArrayLike, stage: ArrayLike) -> Array:
    """Logistic in the logarithm of the dose; shapes broadcast."""
    ratio = depth50_m(process, species, stage) / np.maximum(dose_m, 1e-9)
    return 1.0 / (1.0 + ratio**process.slope)


def uproot_table(process: HoeProcessConfig) -> Array:
    """Expected probability (species, stage, intensity) that a stir at the usual aim error uproots a weed."""
    species, stage = np.meshgrid(np.arange(len(SPECIES)), np.arange(len(STAGES)), indexing="ij")
    doses = EXPECTED_SHARE * np.asarray(process.depth_m)
    return uproot_probability(process, doses, species[..., None], stage[..., None])


def label_mode(process: HoeProcessConfig, species: int, stage: int) -> int:
    """Lowest intensity that is expected to uproot four of five weeds of a kind, else the deepest."""
    enough = np.flatnonzero(uproot_table(process)[species, stage] >= LABEL_KILL)
    return int(enough[0]) if len(enough) else len(INTENSITIES) - 1


def crop_loss(process: HoeProcessConfig, gap_m: ArrayLike) -> Array:
    """Probability (..., 3) that a stir at distances (...) from a crop plant loses it, by intensity."""
    gap = np.atleast_1d(np.asarray(gap_m, dtype=np.float64))
    share = np.array([[covered_share(r, process.crop_root_m, d) for r in process.sweep_m] for d in gap.ravel()])
    depth = np.asarray(process.depth_m) * share.reshape(*gap.shape, 3)
    return 1.0 / (1.0 + (process.crop_depth50_m / np.maximum(depth, 1e-9)) ** process.crop_slope)


class HoeProcess:
    """The hoe as a weeding process (see ``WeedingProcess``): plunge, one turn, lift. There is no tool camera."""

    modes = INTENSITIES
    phases = PHASES

    def __init__(self, config: HoeProcessConfig):
        """Tabulate by intensity."""
        self.config = config
        self.work = Stir.of(config)
        self.energy_j, self.work_s = config.energy_j, config.work_s

    def tolerance(self, species: NDArray[np.int64], stage: NDArray[np.int64], luck: Array) -> Array:
        """Dose (...) that uproots each weed: the logistic's quantile."""
        return depth50_m(self.config, species, stage) * (luck / (1.0 - luck)) ** (1.0 / self.config.slope)

    def crop_tolerance(self, luck: Array) -> Array:
        """Dose (...) from which each crop plant is lost."""
        return self.config.crop_depth50_m * (luck / (1.0 - luck)) ** (1.0 / self.config.crop_slope)
