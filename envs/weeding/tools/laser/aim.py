"""Aiming the laser: where the beam must lean and where the platform must stand, in closed form.

Frames. The world has x along the direction of travel, y across, z up, ground at z = 0. The mechanism hangs under the
cart: its analysis X is the world's x, its Y is -y, its Z points down; its base lies ``base_height_m`` above the ground.
The beam leaves the platform's centre along the platform's normal. With the pose (X, Z, alpha, beta) and the height
``gap`` of the platform over the target, the spot falls at

    x = cart + X + gap tan(beta),    y = gap tan(alpha) / cos(beta).

So a spot on the ground has two free parameters (Z and the share of x that the beam's lean takes). The machine works in
*beam coordinates*: the platform's place over ground P = cart + X and the lean of the beam (L, M) = spot - (P, 0), all
metres. They are linear in the spot; angles come from them by two arctangents:

    tan(beta) = L / gap,    tan(alpha) = M cos(beta) / gap.

**Following.** While it burns, the platform stands still over ground: X runs backwards with the cart's speed and both
angles are constant, which is what the paper has its translation along Y for. A weed is followed for as long as |X|
stays within its range.

**Choice of the lean.** The platform's mean place while following and the lean share the weed's mean place over the
cart in proportion to their ranges. Of all leans that is the one whose smallest relative margin (of X to
its range over the whole time of following, of L to its own) is largest: the two margins are linear in the lean with
slopes of opposite sign, so the largest minimum is where they are equal.

**Moves** are rest to rest over ground: a quintic law in (P, L, M) under limits of velocity and acceleration.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .....kernels import bind, compiled
from .....kernels.config import Config, num
from .....motion import QUINTIC
from ....core import Array
from ...ridges import FLAT, Ridges, lift_time
from ...timing import A, Approach, Place


@dataclass(frozen=True)
class LaserReach(Config):
    """Ranges and limits of the aim; within the defaults every pose respects every limit of ``ThreeUPSRPU.weeder()``."""

    base_height_m: float = num(1.45, 0.2, 5.0, "m")
    """Mechanism's base over the ground [assumed]."""
    gap_m: float = num(0.85, 0.05, 5.0, "m")
    """Platform's centre over the targets; the height fits the crop: Z = base height - target height - gap [assumed]."""
    target_height_m: float = num(0.02, 1e-4, 1.0, "m")
    """Height of the weeds' growing points over the ground [assumed]."""
    travel_m: float = num(0.15, 0.005, 2.0, "m")
    """Range of X while following, +-; moves may overshoot it by up to 0.05 m [assumed, checked against the limits]."""
    lean_m: float = num(0.20, 0.005, 2.0, "m")
    """Range of the beam's lean along, +-: beta within 13.3 deg [assumed, as above]."""
    half_width_m: float = num(0.20, 0.005, 2.0, "m")
    """Range of the spot across, +-: alpha within 13.3 deg [assumed, as above]."""
    travel_velocity_m_s: float = num(1.0, 0.01, 50.0, "m/s")
    """Limit of P over ground [assumed: belt or linear-motor actuators of 2 m/s]."""
    travel_acceleration_m_s2: float = num(10.0, 0.1, 1000.0, "m/s2")
    """Limit of P over ground [assumed: belt or linear-motor actuators of 20 m/s2]."""
    lean_velocity_m_s: float = num(2.0, 0.01, 50.0, "m/s")
    """Limit of the lean along and across [assumed: 2.4 rad/s over the gap]."""
    lean_acceleration_m_s2: float = num(18.0, 0.1, 1000.0, "m/s2")
    """Limit of the lean along and across [assumed: 21 rad/s2 over the gap]."""
    expected_move_s: float = num(0.26, 0.001, 10.0, "s")
    """Time of a move that the choice of the lean reckons with; the true one is used for everything else [assumed]."""

    def check(self) -> None:
        """Hold the platform between base and ground."""
        if self.platform_z_m <= 0.0:
            self.refuse("gap_m", f"it leaves no room under a base at {self.base_height_m} m")

    @property
    def paces(self) -> tuple[tuple[float, float, float], tuple[float, float, float]]:
        """Seconds per metre at the velocity limits and seconds squared per metre at the acceleration limits.

        Of the quintic motion of platform, lean along and lean across; see ``QUINTIC.paces``.
        """
        velocity = np.array([self.travel_velocity_m_s, self.lean_velocity_m_s, self.lean_velocity_m_s])
        acceleration = np.array(
            [self.travel_acceleration_m_s2, self.lean_acceleration_m_s2, self.lean_acceleration_m_s2]
        )
        pace, square = QUINTIC.paces(velocity, acceleration)
        return tuple(pace.tolist()), tuple(square.tolist())

    @property
    def platform_z_m(self) -> float:
        """The mechanism's Z (metres below its base)."""
        return self.base_height_m - self.target_height_m - self.gap_m

    @property
    def front_m(self) -> float:
        """Where the window begins: this far in front of the mechanism's middle; it ends as far behind it."""
        return self.travel_m + self.lean_m


def poses(reach: LaserReach, beam: ArrayLike, cart_m: ArrayLike, rise_m: ArrayLike = 0.0) -> Array:
    """Mechanism poses (..., 4) for beam coordinates (..., 3) at cart positions (...).

    The ground lies ``rise_m`` (...) higher than what the mechanism is mounted for.
    """
    coordinates = np.asarray(beam, dtype=np.float64)
    tangent = coordinates[..., A.lean] / reach.gap_m
    beta = np.arctan(tangent)
    alpha = np.arctan(coordinates[..., A.across] / (reach.gap_m * np.sqrt(1.0 + tangent * tangent)))
    return np.stack(
        [
            coordinates[..., A.carrier] - np.asarray(cart_m, dtype=np.float64),
            np.full_like(alpha, reach.platform_z_m) - np.asarray(rise_m, dtype=np.float64),
            alpha,
            beta,
        ],
        axis=-1,
    )


def spot(reach: LaserReach, pose: ArrayLike, cart_m: ArrayLike, rise_m: ArrayLike = 0.0) -> Array:
    """World place (..., 2) where the beam of mechanism poses (..., 4) meets the height of targets ``rise_m`` higher."""
    p = np.asarray(pose, dtype=np.float64)
    gap = reach.base_height_m - reach.target_height_m - p[..., 1] - np.asarray(rise_m, dtype=np.float64)
    cart = np.asarray(cart_m, dtype=np.float64)
    along = cart + p[..., 0] + gap * np.tan(p[..., 3])
    return np.stack([along, gap * np.tan(p[..., 2]) / np.cos(p[..., 3])], axis=-1)


class LaserArm(NamedTuple):
    """The platform with its laser in the shape that kernels take (see ``timing.Arm``).

    A place is the platform over ground and the beam's lean along and across.

    Attributes:
        front_m: see ``LaserReach``.
        half_width_m: see ``LaserReach``.
        scale: ranges of the place's coordinates.
        travel_m: see ``LaserReach``; ``lean_m`` and ``expected_move_s`` alike.
        lean_m: see ``travel_m``.
        expected_move_s: see ``travel_m``.
        early_s: longest wait for a target in front of the window.
        pace_s_m: see ``LaserReach``.
        square_pace_s2_m: see ``LaserReach``.
        ridges: which the platform follows.
    """

    front_m: float
    half_width_m: float
    scale: tuple[float, float, float]
    travel_m: float
    lean_m: float
    expected_move_s: float
    early_s: float
    pace_s_m: tuple[float, float, float]
    square_pace_s2_m: tuple[float, float, float]
    ridges: Ridges

    @classmethod
    def of(cls, reach: LaserReach, early_s: float, ridges: Ridges = FLAT) -> LaserArm:
        """The numbers of a configuration."""
        return cls(
            float(reach.front_m),
            float(reach.half_width_m),
            (float(reach.travel_m), float(reach.lean_m), float(reach.half_width_m)),
            float(reach.travel_m),
            float(reach.lean_m),
            float(reach.expected_move_s),
            float(early_s),
            *reach.paces,
            ridges,
        )


@compiled
def move_time(arm: LaserArm, carrier_m: float, lean_m: float, across_m: float) -> float:
    """Seconds of a motion by a stroke of platform and leans: each keeps its own limits, the slowest sets the time."""
    carrier, lean, across = abs(carrier_m), abs(lean_m), abs(across_m)
    by_velocity = max(carrier * arm.pace_s_m[A.carrier], lean * arm.pace_s_m[A.lean], across * arm.pace_s_m[A.across])
    square = arm.square_pace_s2_m
    square_s2 = max(carrier * square[A.carrier], lean * square[A.lean], across * square[A.across])
    return max(by_velocity, math.sqrt(square_s2))


@compiled
def approach(
    arm: LaserArm, stand_s: float, place: Place, cart_m: float, speed_m_s: float, along_m: float, across_m: float
) -> Approach:
    """How the machine would fire at one target; see ``timing.approach`` and the choice of the lean above."""
    half = arm.travel_m - 0.5 * stand_s * speed_m_s
    share = arm.lean_m / (max(half, 0.0) + arm.lean_m)
    passed = speed_m_s * (arm.expected_move_s + 0.5 * stand_s)
    lean = min(max((along_m - (cart_m + passed)) * share, -arm.lean_m), arm.lean_m)
    carrier = along_m - lean
    move_s = move_time(arm, carrier - place.carrier_m, lean - place.lean_m, across_m - place.across_m)
    move_s = max(move_s, lift_time(arm, place.across_m, across_m))
    ahead = carrier - cart_m
    wait_s = max((ahead - arm.travel_m) / speed_m_s - move_s, 0.0)
    behind = ahead - speed_m_s * (move_s + wait_s) - speed_m_s * stand_s
    legal = half >= 0.0 and behind >= -arm.travel_m and wait_s <= arm.early_s and abs(across_m) <= arm.half_width_m
    return Approach(carrier, lean, across_m, move_s, wait_s, legal)


@compiled
def ready(arm: LaserArm, cart_m: float) -> Place:
    """Place of the waiting machine: near the window's front edge, where the next weed comes in."""
    return Place(cart_m + 0.8 * arm.travel_m, 0.8 * arm.lean_m, 0.0)


bind(LaserArm, approach, move_time, ready)
