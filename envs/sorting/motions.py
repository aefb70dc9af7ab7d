"""The platform's way through one pick: poses over time, in mechanism coordinates."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...motion import QUINTIC
from ...motion.orientation import LEVEL, euler_angles, slerp
from ..core import Array
from .columns import PHASE
from .config import SortingConfig
from .state import SorterPlan


class Way(NamedTuple):
    """Sampled platform positions (n, 3) and quaternions (n, 4)."""

    position: Array
    turn: Array

    def poses(self) -> Array:
        """Poses (n, 6) as the mechanism takes them."""
        return np.concatenate([self.position, euler_angles(self.turn)], axis=-1)


def follow_share(tau: Array) -> Array:
    """Integral of the quintic shape from 0 to ``tau``: how far a ramp to the belt's speed has come, 1/2 at the end."""
    t = np.clip(tau, 0.0, 1.0)
    return t**4 * (2.5 + t * (t - 3.0))


class PickMotion:
    """Motion of one pick as a function of the time since the wait before it ended.

    Approach: a quintic law on what is left after a ramp, whose speed is the quintic shape times the belt's, has been
    taken off, so that the platform arrives over the item at the belt's speed and without acceleration. Down, grip and
    up happen in the belt's frame. The way to the bin is the approach in reverse; after an empty grip only the ramp's
    second half remains.
    """

    def __init__(self, config: SortingConfig, plan: SorterPlan, row: int = 0):
        """Take the plan of one world."""
        self._level = config.machine.travel_level_m
        self._stop_s = config.machine.stop_s
        self._speed = config.belt.speed_m_s
        phases = plan.phases_s[row]
        self.approach_s, self._down_s = float(phases[PHASE.approach]), float(phases[PHASE.descend])
        self._grip_s, self.carry_s = float(phases[PHASE.grip]), float(phases[PHASE.carry])
        self.closing_s = self.approach_s + self._down_s
        self.lifted_s = self.closing_s + self._grip_s + self._down_s
        self._start, self._start_turn = plan.start[row].copy(), plan.start_turn[row].copy()
        self._meet, self._grip, self._turn = plan.meet[row].copy(), plan.grip[row].copy(), plan.turn[row].copy()
        self._bin = plan.bin[row].copy()

    def duration_s(self, held: bool) -> float:
        """Until the platform rests: over the bin, or over the belt after an empty grip."""
        return self.lifted_s + (self.carry_s if held else self._stop_s)

    def sample(self, time_s: Array, held: bool) -> Way:
        """Where the platform is at times (n,), and how it is turned."""
        v, after = self._speed, self.lifted_s
        position = np.empty((len(time_s), 3))
        tau = time_s / self.approach_s
        come = QUINTIC.sample(time_s, 1.0, self.approach_s).position
        follow = v * (self.approach_s * follow_share(tau) + np.clip(time_s, self.approach_s, after) - self.approach_s)
        own = self._meet[0] - self._start[0] - 0.5 * v * self.approach_s
        position[:, 0] = self._start[0] + come * own + follow
        position[:, 1] = self._start[1] + come * (self._meet[1] - self._start[1])
        depth = self._level - self._grip[2]
        down = QUINTIC.sample(time_s - self.approach_s, depth, self._down_s).position
        up = QUINTIC.sample(time_s - self.closing_s - self._grip_s, depth, self._down_s).position
        position[:, 2] = self._level - down + up
        last_s = self.carry_s if held else self._stop_s
        gone = np.clip((time_s - after) / last_s, 0.0, 1.0)
        position[:, 0] += v * last_s * (gone - follow_share(gone))
        turn = slerp(self._start_turn, self._turn, come)
        if held:
            leave = QUINTIC.sample(time_s - after, 1.0, last_s).position
            lifted_x = self._meet[0] + v * (after - self.approach_s)
            position[:, 0] += leave * (self._bin[0] - lifted_x - 0.5 * v * last_s)
            position[:, 1] += leave * (self._bin[1] - self._meet[1])
            away = time_s > after
            turn[away] = slerp(self._turn, LEVEL, leave[away])
        return Way(position, turn)
