"""Paths of straight legs with a stop at every corner, sampled in time."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .laws import QUINTIC, Array, MotionLaw


class PathSample(NamedTuple):
    """State along a path, each of shape (n, d)."""

    position: Array
    velocity: Array
    acceleration: Array


@dataclass(frozen=True)
class StoppedPath:
    """Straight legs between corners; the tool rests at each corner.

    Attributes:
        corners: (m + 1, d), metres.
        leg_s: duration of each leg, (m,), seconds. A leg may take longer than the law needs: the tool then waits at
            the leg's end, for instance until a cart has settled.
        moving_s: the part of ``leg_s`` in which the tool moves, (m,), seconds.
        law: motion law of every leg.
    """

    corners: Array
    leg_s: Array
    moving_s: Array
    law: MotionLaw = QUINTIC

    @classmethod
    def under_limits(
        cls, corners: ArrayLike, velocity_limit: float, acceleration_limit: float, law: MotionLaw = QUINTIC
    ) -> StoppedPath:
        """The fastest path through ``corners`` (m + 1, d) under limits in m/s and m/s2."""
        points = np.asarray(corners, dtype=np.float64)
        strokes = np.linalg.norm(np.diff(points, axis=0), axis=-1)
        durations = law.duration(strokes, velocity_limit, acceleration_limit)
        return cls(points, durations, durations, law)

    @property
    def duration_s(self) -> float:
        """Time from the first corner to the last."""
        return float(np.sum(self.leg_s))

    def sample(self, time_s: ArrayLike) -> PathSample:
        """State at times (n,), held at the ends."""
        time = np.atleast_1d(np.asarray(time_s, dtype=np.float64))
        starts = np.concatenate([[0.0], np.cumsum(self.leg_s)])
        leg = np.clip(np.searchsorted(starts, time, side="right") - 1, 0, len(self.leg_s) - 1)
        legs = np.diff(self.corners, axis=0)
        state = self.law.sample(time - starts[leg], 1.0, self.moving_s[leg])
        return PathSample(
            self.corners[leg] + state.position[:, None] * legs[leg],
            state.velocity[:, None] * legs[leg],
            state.acceleration[:, None] * legs[leg],
        )


def gate_corners(start: ArrayLike, end: ArrayLike, height: ArrayLike) -> Array:
    """Corners (..., 4, 2) of a gate path: rise, traverse at ``height``, descend (transplanting paper, Fig. 3).

    Args:
        start: (..., 2), metres; the second coordinate points up.
        end: (..., 2), metres.
        height: (...), metres, absolute level of the traverse.
    """
    first, last = np.broadcast_arrays(np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64))
    level = np.broadcast_to(np.asarray(height, dtype=np.float64), first.shape[:-1])
    above_first = np.stack([first[..., 0], level], axis=-1)
    above_last = np.stack([last[..., 0], level], axis=-1)
    return np.stack([first, above_first, above_last, last], axis=-2)
