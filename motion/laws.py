"""Rest-to-rest motion laws: how far along its stroke a tool is at each instant."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class MotionSample(NamedTuple):
    """State along a stroke; every field has the shape of the broadcast arguments."""

    position: Array
    """Distance travelled, metres."""
    velocity: Array
    """m/s."""
    acceleration: Array
    """m/s2."""
    jerk: Array
    """m/s3."""


def shortest(stroke_m: Any, pace: Any, square_pace: Any) -> Any:
    """Duration of strokes of either sign, in seconds, for the two ``MotionLaw.paces`` of the limits."""
    stroke = np.abs(stroke_m)
    return np.maximum(stroke * pace, np.sqrt(stroke * square_pace))


@dataclass(frozen=True)
class MotionLaw:
    """A shape s(tau) on [0, 1] from 0 to 1 with rest at both ends, stretched to any stroke and duration.

    Attributes:
        name: what the law is called in tables.
        peak_velocity: max of ds/dtau; the real peak is this times stroke / duration.
        peak_acceleration: max of |d2s/dtau2|; times stroke / duration^2.
        peak_jerk: max of |d3s/dtau3|; times stroke / duration^3.
    """

    name: str
    peak_velocity: float
    peak_acceleration: float
    peak_jerk: float

    def shape(self, tau: Array) -> tuple[Array, Array, Array, Array]:
        """The shape and its first three derivatives at ``tau`` in [0, 1]."""
        raise NotImplementedError

    def duration(
        self,
        stroke_m: ArrayLike,
        velocity_limit: ArrayLike,
        acceleration_limit: ArrayLike,
        jerk_limit: ArrayLike = np.inf,
    ) -> Array:
        """Shortest duration in seconds under the limits; arguments broadcast, zero strokes take no time.

        T = max(c S / v, sqrt(K S / a), cbrt(J S / j)): eqs 5 and 10 of the transplanting paper hold only where the
        acceleration is what limits.

        Args:
            stroke_m: length of the stroke, its sign does not matter.
            velocity_limit: m/s, > 0.
            acceleration_limit: m/s2, > 0.
            jerk_limit: m/s3, > 0.

        Raises:
            ValueError: a limit is not positive.
        """
        v, a, j = (np.asarray(limit, dtype=np.float64) for limit in (velocity_limit, acceleration_limit, jerk_limit))
        for name, limit in (("velocity_limit", v), ("acceleration_limit", a), ("jerk_limit", j)):
            if not np.all(limit > 0.0):
                raise ValueError(f"{name} = {limit} must be positive")
        return self.duration_unchecked(stroke_m, v, a, j)

    def duration_unchecked(
        self,
        stroke_m: ArrayLike,
        velocity_limit: float | Array,
        acceleration_limit: float | Array,
        jerk_limit: float | Array = np.inf,
    ) -> Array:
        """``duration`` for limits that a configuration has already checked: the rule engines call it every decision."""
        stroke = np.abs(stroke_m)
        duration = shortest(stroke, *self.paces(velocity_limit, acceleration_limit))
        if jerk_limit is np.inf:
            return duration
        return np.maximum(duration, np.cbrt(self.peak_jerk * stroke / jerk_limit))

    def paces(self, velocity_limit: float | Array, acceleration_limit: float | Array) -> tuple[Any, Any]:
        """Seconds a metre where the speed limits, and seconds squared a metre where the acceleration does."""
        return self.peak_velocity / velocity_limit, self.peak_acceleration / acceleration_limit

    def sample(self, time_s: ArrayLike, stroke_m: ArrayLike, duration_s: ArrayLike) -> MotionSample:
        """State at ``time_s`` (held at the ends outside [0, duration]); arguments broadcast.

        A stroke of zero duration is at its end at once.
        """
        stroke, duration = np.asarray(stroke_m, dtype=np.float64), np.asarray(duration_s, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            tau = np.where(duration > 0.0, np.clip(np.asarray(time_s) / duration, 0.0, 1.0), 1.0)
            moving = (tau > 0.0) & (tau < 1.0)
            position, *derivatives = self.shape(tau)
            values = [stroke * position]
            for order, derivative in enumerate(derivatives, start=1):
                values.append(np.where(moving, derivative * stroke / duration**order, 0.0))
        return MotionSample(*values)


@dataclass(frozen=True)
class PolynomialLaw(MotionLaw):
    """A polynomial law.

    Attributes:
        coefficients: of tau^0, tau^1, ...
    """

    coefficients: tuple[float, ...]

    @cached_property
    def derivatives(self) -> tuple[tuple[float, ...], ...]:
        """Coefficients of the shape and of its first three derivatives."""
        rows = [self.coefficients]
        for _ in range(3):
            rows.append(tuple(power * factor for power, factor in enumerate(rows[-1]))[1:])
        return tuple(rows)

    def shape(self, tau: Array) -> tuple[Array, Array, Array, Array]:
        """See ``MotionLaw.shape``."""
        position, velocity, acceleration, jerk = (_horner(row, tau) for row in self.derivatives)
        return position, velocity, acceleration, jerk


def _horner(coefficients: tuple[float, ...], tau: Array) -> Array:
    """A polynomial's values; NumPy's own class makes itself anew and maps its domain at each look."""
    value = coefficients[-1] + tau * 0.0
    for coefficient in coefficients[-2::-1]:
        value = coefficient + value * tau
    return value


@dataclass(frozen=True)
class ModifiedTrapezoid(MotionLaw):
    """The cam designer's modified trapezoid: constant acceleration between sine ramps of an eighth of the duration."""

    @classmethod
    def standard(cls) -> ModifiedTrapezoid:
        """With its peaks: velocity 2, acceleration A = 8 pi / (pi + 2) = 4.888, jerk 4 pi A = 61.43."""
        acceleration = 8.0 * np.pi / (np.pi + 2.0)
        return cls("modified trapezoid", 2.0, acceleration, 4.0 * np.pi * acceleration)

    def shape(self, tau: Array) -> tuple[Array, Array, Array, Array]:
        """See ``MotionLaw.shape``."""
        u = np.minimum(tau, 1.0 - tau)
        peak, w = self.peak_acceleration, 4.0 * np.pi
        # The three pieces of the first half, each continued from the end of the one before it; the second half is
        # the first one turned about its end.
        v1, s1 = peak / w, peak * (1.0 / (8.0 * w) - 1.0 / (w * w))
        v2, s2 = v1 + 0.25 * peak, s1 + 0.25 * v1 + peak / 32.0
        middle, late = u - 0.125, u - 0.375
        pieces = [u < 0.125, u < 0.375]
        jerk = np.select(pieces, [peak * w * np.cos(w * u), np.zeros_like(u)], -peak * w * np.sin(w * late))
        acceleration = np.select(pieces, [peak * np.sin(w * u), np.full_like(u, peak)], peak * np.cos(w * late))
        velocity = np.select(pieces, [v1 * (1.0 - np.cos(w * u)), v1 + peak * middle], v2 + peak / w * np.sin(w * late))
        position = np.select(
            pieces,
            [v1 * (u - np.sin(w * u) / w), s1 + v1 * middle + 0.5 * peak * middle**2],
            s2 + v2 * late + peak / w**2 * (1.0 - np.cos(w * late)),
        )
        second = tau > 0.5
        return np.where(second, 1.0 - position, position), velocity, np.where(second, -acceleration, acceleration), jerk


QUINTIC = PolynomialLaw("quintic", 15.0 / 8.0, 10.0 / np.sqrt(3.0), 60.0, (0.0, 0.0, 0.0, 10.0, -15.0, 6.0))
"""Quintic law of the transplanting paper, eqs 1-5 (eq. 3 with its leading term +tau)."""

SEPTIC = PolynomialLaw(
    "septic",
    35.0 / 16.0,
    84.0 * np.sqrt(5.0) / 25.0,
    105.0 / 2.0,
    (0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0),
)
"""Septic law of the transplanting paper, eqs 6-10 (eq. 9 with its leading term +tau)."""

MODIFIED_TRAPEZOID = ModifiedTrapezoid.standard()
"""Lower peak acceleration for its duration than either polynomial; jerk steps at the ends."""
