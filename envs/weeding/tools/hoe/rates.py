"""What the hoe weeder's scorecards come to in a grower's units."""

from __future__ import annotations

import numpy as np

from .....motion import QUINTIC
from .....simulation.dynamics import prrs_dynamics
from ....core import Array
from ....rates import Rates, straight_power_w
from ...rates import moves, weeding_rates
from .config import HoeWeedingConfig

_NORMAL = 1
"""The intensity whose plunges and lifts stand for all."""


def rates_of(config: HoeWeedingConfig) -> Rates:
    """Of a configuration: the work against the soil, and the motors in moves, plunges and lifts.

    What the motors give on the blade's circle is the work against the soil.
    """
    reach, process, machine = config.reach, config.passing, config.parameters
    start, stroke = moves(np.array([reach.travel_m, reach.half_width_m]))
    friction = (*[machine.slider_friction_n] * 3, *[machine.swing_friction_n_m] * 3)
    dynamics = prrs_dynamics(machine)

    def power_w(tip: Array, way: Array, time_s: Array) -> float:
        pose, ways = np.zeros((len(tip), 6)), np.zeros((len(tip), 6))
        pose[:, :3], ways[:, :3] = tip, way
        pose[:, 2] -= machine.lowest_tip_m
        return straight_power_w(dynamics, pose, ways, time_s, friction)

    high, low = np.full(len(start), process.clearance_m), np.full(len(start), -process.depth_m[_NORMAL])
    moving_s = QUINTIC.duration(stroke, reach.velocity_m_s, reach.acceleration_m_s2).max(axis=1)
    moving = power_w(np.column_stack([start, high]), np.column_stack([stroke, 0.0 * high]), moving_s)
    limits = process.plunge_velocity_m_s, process.plunge_acceleration_m_s2
    down_s = QUINTIC.duration(high - low, *limits)
    still = np.zeros_like(start)
    down = power_w(np.column_stack([start, high]), np.column_stack([still, low - high]), down_s)
    up = power_w(np.column_stack([start, low]), np.column_stack([still, high - low]), down_s)
    return weeding_rates({"move": moving, "plunge": down, "lift": up}, config.scenario.demanded)
