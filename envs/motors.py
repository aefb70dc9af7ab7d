"""What a machine's motors can do: speeds and accelerations that they can give wherever it works, or a refusal.

Plans keep to limits of the tool's speed and acceleration. Where a motor is too weak for them, or a tool too heavy, they
are lowered, as one would set them on the real machine: to the largest that its motors can give on every motion of a set
that covers the machine's reach. Rules, planners, bounds and both backends then see the lower limits. Where the motors
suffice, nothing changes.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..kernels.config_kinds import ConfigError
from ..mechanisms.bodies import EffortTerms
from ..motion.efforts import duration_under_efforts
from .core import Array

PLANNED = 0.95
"""Share of a motor's limit that plans may use; the servo keeps the rest."""
SLOWEST = 0.01
"""A machine that cannot give this share of its acceleration is refused: a motion would take ten times as long."""
_ROUNDING = 1e-6


class Motor(NamedTuple):
    """What one motor can give.

    Attributes:
        setting: dotted name of its limit in the configuration.
        limit: that limit, N or N m.
        unit: of it.
        lost: what of it friction and other work take.
    """

    setting: str
    limit: float
    unit: str
    lost: float = 0.0

    @property
    def planned(self) -> float:
        """What motions may use of it."""
        return PLANNED * (self.limit - self.lost)


class Motions(NamedTuple):
    """Motions that cover what a machine is asked to do.

    Attributes:
        terms: efforts of each, (n, samples, motors), as if it took one second.
        wanted_s: how long each takes under the limits of speed and acceleration, (n,).
        accelerating_s: how long under the limit of acceleration alone, (n,).
    """

    terms: EffortTerms
    wanted_s: Array
    accelerating_s: Array


class Shares(NamedTuple):
    """Shares, at most 1, of a machine's limits of acceleration and speed that its motors can give."""

    acceleration: float
    speed: float


ALL = Shares(1.0, 1.0)


def shares(motions: Motions, motors: Sequence[Motor], owner: str) -> Shares:
    """The largest shares at which all motions stay within the motors' limits.

    A motion that its acceleration limits needs a lower acceleration, one that reaches its top speed a lower speed.

    Raises:
        ConfigError: a motor cannot hold the machine, or hardly move it; in the name of ``owner``.
    """
    slow_s = np.maximum(motions.wanted_s, motions.accelerating_s / math.sqrt(SLOWEST))
    needed = np.abs(motions.terms.at(np.maximum(slow_s, 1e-3)[:, None])).max(axis=(0, 1))
    planned = np.array([motor.planned for motor in motors])
    worst = int(np.argmax(needed / np.maximum(planned, 1e-12)))
    if not needed[worst] <= planned[worst]:
        refuse(motors[worst], float(needed[worst]), owner)
    shortest_s = duration_under_efforts(*motions.terms, planned)
    binding = shortest_s > motions.wanted_s * (1.0 + _ROUNDING)
    if not binding.any():
        return ALL
    fast = motions.wanted_s > motions.accelerating_s * (1.0 + _ROUNDING)
    ratio = np.where(binding, motions.wanted_s / np.where(binding, shortest_s, 1.0), 1.0)
    slow = np.where(fast, 1.0, ratio)
    return Shares(float(np.square(slow).min()), float(np.where(fast, ratio, 1.0).min()))


HOLDING = "hold the machine and move it slowly wherever it works"


def refuse(motor: Motor, needed: float, owner: str, work: str = HOLDING) -> None:
    """Refuse a motor that cannot give what is needed.

    Raises:
        ConfigError: always; it names motor, need and limit.
    """
    least = needed / PLANNED + motor.lost
    raise ConfigError(
        motor.setting,
        f" = {motor.limit:g} {motor.unit}: the motor needs {least:.3g} {motor.unit} to {work}: give more, or less mass "
        "and friction",
        owner,
    )
