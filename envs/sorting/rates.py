"""What the sorter's scorecards come to in a packer's units: items an hour."""

from __future__ import annotations

import numpy as np

from ...motion import QUINTIC
from ...simulation.dynamics import prrs_dynamics
from ..rates import Rates, items, motor_power_w
from .config import SortingConfig
from .motors import heaviest_kg, paths

_MOVING = ("approach", "descend", "lift", "carry")
_HALF = 0.5
"""Of the heaviest item's mass: what is carried on the mean of ways with and without an item."""


def rates_of(config: SortingConfig) -> Rates:
    """Of a configuration: the motors; the belt's and the fingers' energy are not modelled."""
    machine, sorter = config.machine, config.machine.sorter
    poses, velocity, acceleration, lengths = paths(machine)
    moves = lengths.max(axis=1) > 0.0
    limits = (
        np.array([sorter.velocity_m_s, sorter.turn_rad_s]),
        np.array([sorter.acceleration_m_s2, sorter.turn_rad_s2]),
    )
    time_s = np.maximum(QUINTIC.duration(lengths, *limits).max(axis=1), machine.shortest_move_s)
    dynamics = prrs_dynamics(sorter, _HALF * heaviest_kg(config), sorter.tool_m)
    friction = (*[sorter.slider_friction_n] * 3, *[sorter.swing_friction_n_m] * 3)
    parts = (poses[moves], velocity[moves], acceleration[moves], time_s[moves])
    power_w = motor_power_w(dynamics, *parts, friction)
    return items()._replace(motor_w=dict.fromkeys(_MOVING, power_w))
