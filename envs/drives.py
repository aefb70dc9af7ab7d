"""Errors of a machine's drives: encoders that are off, gears with play, friction, and servos that lag.

A machine does not know them: what is planned, and what policies are shown, is the command; the work alone sees the tool
where the joints really are. A joint stands at its command plus the constant error of its encoder. It stays behind by
half its play and by what friction holds back, on the side that it came from; one that did not move stands in the
middle. What that does to the tool is the mechanism's ``pose_error``. A servo that follows its command like a
first-order lag has a rest of a motion's stroke to go at its end, which dies away while the machine waits. Steady speeds
are led by feed-forward and do not lag.

All of it is zero unless a scenario says otherwise, as its ``field`` does. The errors are those of the machine that
plays an episode: they stand in its field, and are drawn from numbers of their own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..kernels.config import Config, nested, num
from ..kernels.elementary import exp
from .field import Array, FieldError, Table, number

_STILL = 1e-6
"""A joint that moves by less than this share of the one that moves most stands still: it is rounding."""


@dataclass(frozen=True)
class LinearDrive(Config):
    """Errors of every linear drive of a machine: of a cart, of legs, of sliders."""

    encoder_m: float = num(0.0, 0.0, 0.005, "m")
    """Standard deviation of a drive's constant error: homing, mounting, pitch [assumed: none in papers' protocols]."""
    backlash_m: float = num(0.0, 0.0, 0.01, "m")
    """Play of screw, rack or belt and of the joints behind it, from side to side [assumed: none likewise]."""
    stiction_m: float = num(0.0, 0.0, 0.005, "m")
    """How far dry friction holds a drive back: friction over the servo's stiffness [assumed: none likewise]."""


@dataclass(frozen=True)
class RotaryDrive(Config):
    """Errors of every rotary drive of a machine: of arms, of links that are swung."""

    encoder_rad: float = num(0.0, 0.0, 0.02, "rad")
    """Standard deviation of a drive's constant error [published range 0.001-0.005 rad: the safflower paper's Table 1,
    see the errata for its unit; none in papers' protocols]."""
    backlash_rad: float = num(0.0, 0.0, 0.04, "rad")
    """Play of the gear and of the joints behind it, from side to side [assumed: none in papers' protocols]."""
    stiction_rad: float = num(0.0, 0.0, 0.02, "rad")
    """How far dry friction holds a drive back: friction over the servo's stiffness [assumed: none likewise]."""


@dataclass(frozen=True)
class DriveErrors(Config):
    """Errors of a machine's drives; none as it stands."""

    linear: LinearDrive = nested(LinearDrive)
    """Of carts that stop at their targets, of legs and sliders."""
    rotary: RotaryDrive = nested(RotaryDrive)
    """Of arms and swings."""
    lag_s: float = num(0.0, 0.0, 0.2, "s")
    """Time constant with which every servo follows a motion from rest to rest [assumed: none in papers' protocols]."""


@dataclass(frozen=True, eq=False)
class DriveLuck(Table):
    """Luck of the machine that plays, a row a driven joint, linear ones first."""

    encoder: Array = number("", -10.0, 10.0, "constant error of its encoder in standard deviations", "normal")


class Servos(NamedTuple):
    """Errors by driven joint, linear ones first, in the joints' own units.

    Attributes:
        encoder: (J,), standard deviations of the constant errors.
        behind: (J,), how far a joint stays behind its command.
        lag_s: time constant of all of them.
    """

    encoder: Array
    behind: Array
    lag_s: float

    @classmethod
    def of(cls, errors: DriveErrors, linear: int, rotary: int) -> Servos:
        """The numbers of a machine with so many linear and rotary drives."""
        slide, turn = errors.linear, errors.rotary
        return cls(
            np.repeat([slide.encoder_m, turn.encoder_rad], [linear, rotary]),
            np.repeat(
                [0.5 * slide.backlash_m + slide.stiction_m, 0.5 * turn.backlash_rad + turn.stiction_rad],
                [linear, rotary],
            ),
            errors.lag_s,
        )

    @property
    def on(self) -> bool:
        """Whether anything errs."""
        return bool(self.encoder.any() or self.behind.any() or self.lag_s > 0.0)

    def joint_error(self, luck: Array, rates: ArrayLike) -> Array:
        """What joints are off by (..., J) where they came to rest.

        Args:
            luck: (..., J), see ``DriveLuck``.
            rates: (..., J), in which direction they moved last: of any size, 0 for one that did not.
        """
        rates = np.asarray(rates, dtype=np.float64)
        moved = np.abs(rates) > _STILL * np.abs(rates).max(axis=-1, keepdims=True)
        return self.encoder * luck - self.behind * np.where(moved, np.sign(rates), 0.0)

    def rest(self, motion_s: ArrayLike, since_s: ArrayLike = 0.0, work_s: ArrayLike = 0.0) -> Array:
        """Share (...) of a stroke on the quintic law that is still to go, on average over the work's time.

        A first-order lag behind a polynomial law is a sum over its derivatives at both ends: with r the time constant
        by the motion's time, ``r^3 (60 - 60 e) - r^4 (360 + 360 e) + r^5 (720 - 720 e)`` of the stroke is left at the
        end, where ``e = exp(-1 / r)``. It dies away exponentially.

        Args:
            motion_s: (...), duration of the motion; there is nothing to go of one that took no time.
            since_s: (...), from its end to the beginning of the work.
            work_s: (...), the work's own time.
        """
        motion, since, work = np.broadcast_arrays(*(np.asarray(v, np.float64) for v in (motion_s, since_s, work_s)))
        if self.lag_s <= 0.0:
            return np.zeros(motion.shape)
        r = self.lag_s / np.maximum(motion, 1e-3 * self.lag_s)
        e = exp(-1.0 / r)
        left = r**3 * (60.0 - 60.0 * e - r * (360.0 + 360.0 * e - r * (720.0 - 720.0 * e)))
        spent = np.maximum(work, 1e-6 * self.lag_s) / self.lag_s
        fade = exp(-np.maximum(since, 0.0) / self.lag_s) * (1.0 - exp(-spent)) / spent
        return np.where(motion > 0.0, np.minimum(np.maximum(left, 0.0), 1.0) * fade, 0.0)


def draw_luck(generators: Sequence[np.random.Generator], joints: int) -> Array:
    """Luck (R, joints) of the machines of R worlds, from numbers far ahead of those that the worlds draw themselves.

    Nothing is taken from the generators: what else they draw is the same with these errors and without.
    """
    luck = np.empty((len(generators), joints))
    for row, generator in enumerate(generators):
        ahead = generator.bit_generator.jumped()  # type: ignore[attr-defined]
        np.random.Generator(ahead).standard_normal(out=luck[row])
    return luck


def whole_luck(given: DriveLuck | None, generator: np.random.Generator, joints: int) -> DriveLuck | None:
    """The luck of a field that was given; drawn where it says nothing, none for a machine without errors.

    Raises:
        FieldError: it is that of a machine with other joints.
    """
    if not joints:
        return None
    if given is None or not len(given):
        return DriveLuck(draw_luck([generator], joints)[0])
    if len(given) != joints:
        raise FieldError(f"{len(given)} rows: this machine has {joints} driven joints, give a row each", "drives", 0)
    return given


def settled(error: Array) -> Array:
    """Errors of a tool without the digits that depend on the processor: metres and radians to a billionth.

    Where a mechanism's limits leave no pose for joints that are off, the tool is where it was sent.
    """
    return np.where(np.isfinite(error), np.round(error, 9), 0.0)
