"""The fastest rest-to-rest stroke under velocity, acceleration and jerk limits: the S-curve in closed form."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .laws import Array, MotionSample


@dataclass(frozen=True)
class SCurve:
    """Seven phases: jerk up, hold the acceleration, jerk down, cruise, and the same backwards. All fields broadcast.

    Without a jerk limit the ramps take no time and the profile is the trapezoid (or, on short strokes, the triangle).

    Attributes:
        stroke_m: signed length.
        ramp_s: duration of each of the four jerk phases.
        hold_s: duration of each of the two phases of constant acceleration.
        cruise_s: duration at constant velocity.
    """

    stroke_m: Array
    ramp_s: Array
    hold_s: Array
    cruise_s: Array

    @classmethod
    def under_limits(
        cls,
        stroke_m: ArrayLike,
        velocity_limit: ArrayLike,
        acceleration_limit: ArrayLike,
        jerk_limit: ArrayLike = np.inf,
    ) -> SCurve:
        """The time-optimal profile; arguments broadcast.

        Args:
            stroke_m: any sign.
            velocity_limit: m/s, > 0.
            acceleration_limit: m/s2, > 0 and finite unless the jerk limit is.
            jerk_limit: m/s3, > 0.

        Raises:
            ValueError: a limit is not positive, or neither acceleration nor jerk is limited.
        """
        limits = (
            ("velocity_limit", velocity_limit),
            ("acceleration_limit", acceleration_limit),
            ("jerk_limit", jerk_limit),
        )
        for name, limit in limits:
            if not np.all(np.asarray(limit) > 0.0):
                raise ValueError(f"{name} = {limit} must be positive")
        stroke, v, a, j = np.broadcast_arrays(
            *(np.asarray(x, dtype=np.float64) for x in (stroke_m, velocity_limit, acceleration_limit, jerk_limit))
        )
        if np.any(np.isinf(a) & np.isinf(j)):
            raise ValueError("acceleration_limit and jerk_limit are both infinite: limit at least one of them")
        length = np.abs(stroke)
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            # Highest acceleration that the velocity limit and the stroke leave room for, each if met by ramps alone.
            ramp = np.minimum(np.minimum(a / j, np.sqrt(v / j)), np.cbrt(length / (2.0 * j)))
            # Peak velocity over a stroke with no cruise: length = top (top / a + ramp), the ramps at full length.
            by_stroke = np.where(np.isinf(a), np.inf, 0.5 * a * (np.sqrt(ramp**2 + 4.0 * length / a) - ramp))
            full = ramp >= a / j
            top = np.minimum(v, by_stroke)
            hold = np.where(full, np.maximum(top / a - ramp, 0.0), 0.0)
            top = np.where(full, top, np.minimum(j, 1e300) * ramp**2)
            cruise = np.where(top > 0.0, length / top - 2.0 * ramp - hold, 0.0)
        # Where the stroke itself ended the acceleration, what is left for cruising is rounding.
        cruise = np.where(cruise > 1e-12 * (ramp + hold), cruise, 0.0)
        return cls(stroke, ramp, hold, cruise)

    @property
    def duration_s(self) -> Array:
        """Time of the whole stroke."""
        return 4.0 * self.ramp_s + 2.0 * self.hold_s + self.cruise_s

    @property
    def peak_velocity(self) -> Array:
        """Signed, m/s."""
        time = 2.0 * self.ramp_s + self.hold_s + self.cruise_s
        return _quotient(self.stroke_m, time)

    @property
    def peak_acceleration(self) -> Array:
        """Signed, m/s2."""
        return _quotient(self.peak_velocity, self.ramp_s + self.hold_s)

    @property
    def peak_jerk(self) -> Array:
        """Signed, m/s3; infinite (with the stroke's sign) where the acceleration steps."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.stroke_m == 0.0, 0.0, self.peak_acceleration / self.ramp_s)

    def sample(self, time_s: ArrayLike) -> MotionSample:
        """State at ``time_s``, held at the ends; broadcasts against the fields.

        The jerk is zero where the acceleration steps.
        """
        duration = self.duration_s
        time = np.clip(np.asarray(time_s, dtype=np.float64), 0.0, duration)
        late = time > 0.5 * duration
        t = np.where(late, duration - time, time)
        ramp, hold, a, v = self.ramp_s, self.hold_s, self.peak_acceleration, self.peak_velocity
        j = np.where(ramp > 0.0, _quotient(a, ramp), 0.0)
        # Integrate the first half's pieces; each clipped time is how long its phase has lasted.
        t1 = np.minimum(t, ramp)
        t2 = np.clip(t - ramp, 0.0, hold)
        t3 = np.clip(t - ramp - hold, 0.0, ramp)
        t4 = np.maximum(t - 2.0 * ramp - hold, 0.0)
        v1 = 0.5 * j * ramp * ramp
        v2 = v1 + a * hold
        position = j * t1**3 / 6.0 + v1 * t2 + 0.5 * a * t2**2 + v2 * t3 + 0.5 * a * t3**2 - j * t3**3 / 6.0 + v * t4
        velocity = 0.5 * j * t1**2 + a * t2 + a * t3 - 0.5 * j * t3**2
        rising, falling = t < ramp, (t > ramp + hold) & (t < 2.0 * ramp + hold)
        acceleration = np.where(t >= 2.0 * ramp + hold, 0.0, np.where(ramp > 0.0, j * (t1 - t3), a))
        moving = (time > 0.0) & (time < duration)
        return MotionSample(
            np.where(late, self.stroke_m - position, position),
            np.where(moving, velocity, 0.0),
            np.where(moving, np.where(late, -acceleration, acceleration), 0.0),
            np.where(moving, np.where(rising, j, np.where(falling, -j, 0.0)), 0.0),
        )


def _quotient(a: Array, b: Array) -> Array:
    """Quotient that is zero where ``b`` is."""
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(b > 0.0, a / b, 0.0)
