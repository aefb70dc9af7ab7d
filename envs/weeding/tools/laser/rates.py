"""What the laser weeder's scorecards come to in a grower's units."""

from __future__ import annotations

import numpy as np

from .....simulation.dynamics import weeder_dynamics
from ....rates import Rates, motor_power_w
from ...rates import moves, weeding_rates
from .config import WeedingConfig
from .motors import paths


def rates_of(config: WeedingConfig) -> Rates:
    """Of a configuration: the light on the plants, and the legs in the moves from plant to plant."""
    reach, machine = config.aim, config.parameters
    start, stroke = moves(np.array([reach.travel_m, reach.lean_m, reach.half_width_m]))
    pace, square = (np.array(values) for values in reach.paces)
    lengths = np.abs(stroke)
    time_s = np.maximum((lengths * pace).max(axis=1), np.sqrt((lengths * square).max(axis=1)))
    friction = (0.0, *[machine.leg_friction_n] * 4)
    power_w = motor_power_w(weeder_dynamics(machine), *paths(reach, start, stroke), time_s, friction)
    return weeding_rates({"move": power_w}, config.scenario.demanded)
