"""How the hoe gets to a plant: the 3-PRRS over ground, its blade on the plant while the cart drives on."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from .....kernels import bind, compiled
from .....kernels.config import Config, num
from .....motion import QUINTIC
from ...ridges import FLAT, Ridges, lift_time
from ...timing import Approach, Place


@dataclass(frozen=True)
class HoeReach(Config):
    """Where the blade can work under the cart; in the default ranges it keeps every limit of ``ThreePRRS.hoe()``."""

    travel_m: float = num(0.14, 0.005, 2.0, "m")
    """Range of the blade along the row, +-, while it follows a plant; moves may overshoot it by up to 0.04 m [assumed,
    checked against the limits]."""
    half_width_m: float = num(0.20, 0.005, 2.0, "m")
    """Range to either side [assumed, as above]."""
    velocity_m_s: float = num(1.0, 0.01, 50.0, "m/s")
    """Limit of a move over ground, along and across by themselves [assumed]."""
    acceleration_m_s2: float = num(10.0, 0.1, 1000.0, "m/s2")
    """Limit of a move over ground, along and across by themselves [assumed]."""


class HoeArm(NamedTuple):
    """The 3-PRRS with its hoe in the shape that kernels take (``timing.Arm``); nothing leans: a place has no lean.

    Attributes:
        front_m: see ``HoeReach``.
        half_width_m: see ``HoeReach``.
        scale: ranges of the place's coordinates; the lean, always zero, is divided by one.
        travel_m: see ``HoeReach``.
        early_s: longest wait for a target in front of the window.
        pace_s_m: seconds a metre at the velocity limit.
        square_pace_s2_m: seconds squared a metre at the acceleration limit.
        ridges: which the blade follows.
    """

    front_m: float
    half_width_m: float
    scale: tuple[float, float, float]
    travel_m: float
    early_s: float
    pace_s_m: float
    square_pace_s2_m: float
    ridges: Ridges

    @classmethod
    def of(cls, reach: HoeReach, early_s: float, ridges: Ridges = FLAT) -> HoeArm:
        """The numbers of a configuration."""
        travel, width = float(reach.travel_m), float(reach.half_width_m)
        pace, square = QUINTIC.paces(reach.velocity_m_s, reach.acceleration_m_s2)
        return cls(travel, width, (travel, 1.0, width), travel, float(early_s), float(pace), float(square), ridges)


@compiled
def move_time(arm: HoeArm, carrier_m: float, lean_m: float, across_m: float) -> float:
    """Seconds of a straight move; along and across keep the limits by themselves."""
    way = max(abs(carrier_m), abs(across_m))
    return max(way * arm.pace_s_m, math.sqrt(way * arm.square_pace_s2_m))


@compiled
def approach(
    arm: HoeArm, stand_s: float, place: Place, cart_m: float, speed_m_s: float, along_m: float, across_m: float
) -> Approach:
    """How the hoe would work on one target; see ``timing.approach``. The blade follows the plant for the whole time."""
    move_s = move_time(arm, along_m - place.carrier_m, 0.0, across_m - place.across_m)
    move_s = max(move_s, lift_time(arm, place.across_m, across_m))
    ahead = along_m - cart_m
    wait_s = max((ahead - arm.travel_m) / speed_m_s - move_s, 0.0)
    behind = ahead - speed_m_s * (move_s + wait_s) - speed_m_s * stand_s
    legal = behind >= -arm.travel_m and wait_s <= arm.early_s and abs(across_m) <= arm.half_width_m
    return Approach(along_m, 0.0, across_m, move_s, wait_s, legal)


@compiled
def ready(arm: HoeArm, cart_m: float) -> Place:
    """Place of the waiting blade: near the window's front edge, where the next weed comes in."""
    return Place(cart_m + 0.8 * arm.travel_m, 0.0, 0.0)


bind(HoeArm, approach, move_time, ready)
