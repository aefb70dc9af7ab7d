"""Rest-to-rest motion laws: how far along its stroke a tool is at each instant."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

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


@dataclass(frozen=True)
class PolynomialLaw:
    """A polynomial s(tau) on [0, 1] from 0 to 1 with rest at both ends.

    Attributes:
        name: what the law is called in tables.
        coefficients: of tau^0, tau^1, ...
        peak_velocity: max of ds/dtau; the real peak is this times stroke / duration.
        peak_acceleration: max of |d2s/dtau2|; times stroke / duration^2.
        peak_jerk: max of |d3s/dtau3|; times stroke / duration^3.
    """

    name: str
    coefficients: tuple[float, ...]
    peak_velocity: float
    peak_acceleration: float
    peak_jerk: float

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
        for name, limit in (
            ("velocity_limit", velocity_limit),
            ("acceleration_limit", acceleration_limit),
            ("jerk_limit", jerk_limit),
        ):
            if not np.all(np.asarray(limit) > 0.0):
                raise ValueError(f"{name} = {limit} must be positive")
        return self.duration_unchecked(stroke_m, velocity_limit, acceleration_limit, jerk_limit)

    def duration_unchecked(
        self,
        stroke_m: ArrayLike,
        velocity_limit: ArrayLike,
        acceleration_limit: ArrayLike,
        jerk_limit: ArrayLike = np.inf,
    ) -> Array:
        """``duration`` for limits that a configuration has already checked: the rule engines call it every decision."""
        stroke = np.abs(np.asarray(stroke_m, dtype=np.float64))
        by_velocity = self.peak_velocity * stroke / velocity_limit
        by_acceleration = np.sqrt(self.peak_acceleration * stroke / acceleration_limit)
        shortest = np.maximum(by_velocity, by_acceleration)
        if jerk_limit is np.inf:
            return shortest
        return np.maximum(shortest, np.cbrt(self.peak_jerk * stroke / jerk_limit))

    def sample(self, time_s: ArrayLike, stroke_m: ArrayLike, duration_s: ArrayLike) -> MotionSample:
        """State at ``time_s`` (held at the ends outside [0, duration]); arguments broadcast.

        A stroke of zero duration is at its end at once.
        """
        stroke, duration = np.asarray(stroke_m, dtype=np.float64), np.asarray(duration_s, dtype=np.float64)
        with np.errstate(divide="ignore", invalid="ignore"):
            tau = np.where(duration > 0.0, np.clip(np.asarray(time_s) / duration, 0.0, 1.0), 1.0)
            moving = (tau > 0.0) & (tau < 1.0)
            polynomial = np.polynomial.Polynomial(self.coefficients)
            values = [stroke * polynomial(tau)]
            for order in (1, 2, 3):
                scaled = polynomial.deriv(order)(tau) * stroke / duration**order
                values.append(np.where(moving, scaled, 0.0))
        return MotionSample(*values)


QUINTIC = PolynomialLaw("quintic", (0.0, 0.0, 0.0, 10.0, -15.0, 6.0), 15.0 / 8.0, 10.0 / np.sqrt(3.0), 60.0)
"""Quintic law of the transplanting paper, eqs 1-5 (eq. 3 with its leading term +tau)."""

SEPTIC = PolynomialLaw(
    "septic",
    (0.0, 0.0, 0.0, 0.0, 35.0, -84.0, 70.0, -20.0),
    35.0 / 16.0,
    84.0 * np.sqrt(5.0) / 25.0,
    105.0 / 2.0,
)
"""Septic law of the transplanting paper, eqs 6-10 (eq. 9 with its leading term +tau)."""
