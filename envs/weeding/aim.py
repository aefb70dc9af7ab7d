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

from dataclasses import dataclass, fields
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...motion import QUINTIC
from ..core import Array


@dataclass(frozen=True)
class LaserReach:
    """Ranges and limits of the aim; within them every pose respects every limit of ``ThreeUPSRPU.weeder()``."""

    base_height_m: float = 1.45
    """Mechanism's base over the ground [assumed]."""
    gap_m: float = 0.85
    """Platform's centre over the targets; the height fits the crop: Z = base height - target height - gap [assumed]."""
    target_height_m: float = 0.02
    """Height of the weeds' growing points over the ground [assumed]."""
    travel_m: float = 0.15
    """Range of X while following, +-; moves may overshoot it by up to 0.05 m [assumed, checked against the limits]."""
    lean_m: float = 0.20
    """Range of the beam's lean along, +-: beta within 13.3 deg [assumed, as above]."""
    half_width_m: float = 0.20
    """Range of the spot across, +-: alpha within 13.3 deg [assumed, as above]."""
    travel_velocity_m_s: float = 1.0
    travel_acceleration_m_s2: float = 10.0
    """Limits of P over ground [assumed: belt or linear-motor actuators of 2 m/s and 20 m/s2]."""
    lean_velocity_m_s: float = 2.0
    lean_acceleration_m_s2: float = 18.0
    """Limits of the lean along and across [assumed: 2.4 rad/s and 21 rad/s2 over the gap]."""
    expected_move_s: float = 0.26
    """Time of a move that the choice of the lean reckons with; the true one is used for everything else."""

    def __post_init__(self) -> None:
        """Check that all are positive and the platform hangs between base and ground."""
        for name in (item.name for item in fields(self)):
            value = getattr(self, name)
            if not 0.0 < value < np.inf:
                raise ValueError(f"LaserReach.{name} = {value}: give a positive, finite number")
        if self.platform_z_m <= 0.0:
            raise ValueError(f"gap_m = {self.gap_m} m leaves no room under a base at {self.base_height_m} m")

    @cached_property
    def by_velocity(self) -> Array:
        """Seconds per metre (3,) of a quintic motion at its velocity limits; see ``QUINTIC.duration``."""
        limits = self.travel_velocity_m_s, self.lean_velocity_m_s, self.lean_velocity_m_s
        return QUINTIC.peak_velocity / np.array(limits)

    @cached_property
    def by_acceleration(self) -> Array:
        """Seconds squared per metre (3,) at its acceleration limits."""
        limits = self.travel_acceleration_m_s2, self.lean_acceleration_m_s2, self.lean_acceleration_m_s2
        return QUINTIC.peak_acceleration / np.array(limits)

    @property
    def platform_z_m(self) -> float:
        """The mechanism's Z (metres below its base)."""
        return self.base_height_m - self.target_height_m - self.gap_m

    @property
    def front_m(self) -> float:
        """Where the window begins: this far in front of the mechanism's middle; it ends as far behind it."""
        return self.travel_m + self.lean_m


class Approach(NamedTuple):
    """Ways to fire at candidates; shapes (..., K, M) for M standing times.

    Attributes:
        beam: (..., K, M, 3), platform over ground, lean along, lean across, metres.
        move_s: duration of the motion there.
        wait_s: how much longer it takes until the weed is within the window.
        legal: whether it can be followed for the whole standing time.
    """

    beam: Array
    move_s: Array
    wait_s: Array
    legal: NDArray[np.bool_]


def poses(reach: LaserReach, beam: ArrayLike, cart_m: ArrayLike) -> Array:
    """Mechanism poses (..., 4) for beam coordinates (..., 3) at cart positions (...)."""
    coordinates = np.asarray(beam, dtype=np.float64)
    tangent = coordinates[..., 1] / reach.gap_m
    beta = np.arctan(tangent)
    alpha = np.arctan(coordinates[..., 2] / (reach.gap_m * np.sqrt(1.0 + tangent * tangent)))
    return np.stack(
        [
            coordinates[..., 0] - np.asarray(cart_m, dtype=np.float64),
            np.full_like(alpha, reach.platform_z_m),
            alpha,
            beta,
        ],
        axis=-1,
    )


def spot(reach: LaserReach, pose: ArrayLike, cart_m: ArrayLike) -> Array:
    """World place (..., 2) where the beam of mechanism poses (..., 4) meets the targets' height."""
    p = np.asarray(pose, dtype=np.float64)
    gap = reach.base_height_m - reach.target_height_m - p[..., 1]
    cart = np.asarray(cart_m, dtype=np.float64)
    along = cart + p[..., 0] + gap * np.tan(p[..., 3])
    return np.stack([along, gap * np.tan(p[..., 2]) / np.cos(p[..., 3])], axis=-1)


class Pace(NamedTuple):
    """What an approach needs to know of the cart's speed alone; shapes (B, 1, M), ``speed`` (B, 1, 1)."""

    speed: Array
    able: NDArray[np.bool_]
    """Whether the platform's travel lasts for the standing time."""
    share: Array
    """Share of the lean in the way."""
    passed: Array
    """Ground that passes until the middle of the work."""
    stood: Array
    """Ground that passes during the work."""


def pace_terms(reach: LaserReach, stand_s: Array, speed_m_s: Array) -> Pace:
    """See ``Pace``; standing times (M,) and speeds (B,)."""
    speed = speed_m_s[:, None, None]
    half = reach.travel_m - (0.5 * stand_s) * speed
    share = reach.lean_m / (np.maximum(half, 0.0) + reach.lean_m)
    return Pace(speed, half >= 0.0, share, speed * (reach.expected_move_s + 0.5 * stand_s), speed * stand_s)


def approach(
    reach: LaserReach,
    stand_s: Array,
    beam: Array,
    cart_m: Array,
    speed_m_s: Array,
    along_m: Array,
    across_m: Array,
    early_s: float,
    pace: Pace | None = None,
) -> Approach:
    """How the machine would fire at candidates, for each standing time.

    Args:
        reach: ranges and limits.
        stand_s: (M,) seconds that the platform has to stand over ground.
        beam: (B, 3) where it stands now.
        cart_m: (B,) cart position now.
        speed_m_s: (B,) the cart's speed, > 0.
        along_m: (B, K) targets in the world.
        across_m: (B, K).
        early_s: longest wait for a target that is not in the window yet.
        pace: ``pace_terms`` of the standing times and speeds, where they are at hand.
    """
    speed, able, share, passed, stood = pace or pace_terms(reach, stand_s, speed_m_s)
    cart = cart_m[:, None, None]
    along = along_m[..., None]
    middle = along - (cart + passed)
    target = np.empty((*middle.shape, 3))
    lean = np.minimum(np.maximum(middle * share, -reach.lean_m), reach.lean_m)
    np.subtract(along, lean, out=target[..., 0])
    target[..., 1] = lean
    target[..., 2] = across_m[..., None]
    move_s = move_time(reach, target - beam[:, None, None])
    ahead = target[..., 0] - cart
    wait_s = np.maximum((ahead - reach.travel_m) / speed - move_s, 0.0)
    behind = ahead - speed * (move_s + wait_s) - stood
    legal = (behind >= -reach.travel_m) & (wait_s <= early_s) & able
    legal &= np.abs(target[..., 2]) <= reach.half_width_m
    return Approach(target, move_s, wait_s, legal)


def move_time(reach: LaserReach, stroke: Array) -> Array:
    """Seconds (...) of a motion by ``stroke`` (..., 3) in beam coordinates."""
    way = np.abs(stroke)
    times = np.maximum(way * reach.by_velocity, np.sqrt(way * reach.by_acceleration))
    return np.maximum(np.maximum(times[..., 0], times[..., 1]), times[..., 2])


def ready_beam(reach: LaserReach, cart_m: Array) -> Array:
    """Beam coordinates (B, 3) of the waiting machine: near the window's front edge, where the next weed comes in."""
    beam = np.zeros((len(cart_m), 3))
    beam[:, 0] = cart_m + 0.8 * reach.travel_m
    beam[:, 1] = 0.8 * reach.lean_m
    return beam


class Dwell(NamedTuple):
    """What a cart speed leaves for one weed."""

    speed_m_s: float
    residence_s: float
    """Time that a weed is within the reachable window."""
    longest_s: float
    """Longest standing over one weed, limited by the platform's travel."""


def dwell_table(reach: LaserReach, speeds_m_s: ArrayLike) -> list[Dwell]:
    """Residence in the window and longest following at cart speeds; the window is 2 ``front_m`` long at any speed."""
    return [
        Dwell(float(v), 2.0 * reach.front_m / float(v), 2.0 * reach.travel_m / float(v))
        for v in np.atleast_1d(np.asarray(speeds_m_s, dtype=np.float64))
    ]


class LaserMachine:
    """The platform with its laser as a weeding machine (see ``WeedingMachine``); coordinates are beam coordinates."""

    def __init__(self, reach: LaserReach, early_s: float):
        """Take the ranges; ``early_s`` is the longest wait for a target in front of the window."""
        self.reach, self._early_s = reach, early_s
        self.front_m, self.half_width_m = reach.front_m, reach.half_width_m
        self.scale = np.array([reach.travel_m, reach.lean_m, reach.half_width_m])
        self._inverse_scale = 1.0 / self.scale
        self._key = b""
        self._pace: Pace | None = None

    def ready(self, cart_m: Array) -> Array:
        """See ``ready_beam``."""
        return ready_beam(self.reach, cart_m)

    def move_time(self, stroke: Array) -> Array:
        """See ``move_time``."""
        return move_time(self.reach, stroke)

    def approach(
        self, stand_s: Array, place: Array, cart_m: Array, speed_m_s: Array, along_m: Array, across_m: Array
    ) -> Approach:
        """See ``approach``."""
        # A cart that keeps its speed keeps these terms: they are a fifth of the work.
        key = stand_s.tobytes() + speed_m_s.tobytes()
        if key != self._key:
            self._key, self._pace = key, pace_terms(self.reach, stand_s, speed_m_s)
        return approach(self.reach, stand_s, place, cart_m, speed_m_s, along_m, across_m, self._early_s, self._pace)

    def corrected(self, place: Array, shift_m: Array) -> Array:
        """The platform takes the correction along, the lean the one across."""
        result = place.copy()
        result[:, 0] += shift_m[:, 0]
        result[:, 2] += shift_m[:, 1]
        return result

    def features(self, place: Array, cart_m: Array) -> Array:
        """Platform in front of the cart's middle, lean along, lean across, each over its range."""
        result = place * self._inverse_scale
        result[:, 0] -= cart_m * self._inverse_scale[0]
        return result
