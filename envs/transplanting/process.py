"""What gripping and carrying do to a plug."""

from __future__ import annotations

import numpy as np

from ..core import Array
from .columns import H, Harms
from .config import SPEEDS, MachineConfig, ProcessConfig


def speed_chances(machine: MachineConfig, process: ProcessConfig) -> Array:
    """Chances (3, 2) of each speed, see ``Harms``: logistic in the carrying acceleration."""
    chances = np.empty((len(SPEEDS), len(Harms._fields)))
    chances[:, H.lose] = _logistic(machine, process.loss_half_m_s2, process.loss_width_m_s2)
    chances[:, H.damage] = _logistic(machine, process.damage_half_m_s2, process.damage_width_m_s2)
    return chances


def _logistic(machine: MachineConfig, half_m_s2: float, width_m_s2: float) -> Array:
    # Far below the half the exponential overflows, and the chance is 0.
    with np.errstate(over="ignore"):
        return 1.0 / (1.0 + np.exp((half_m_s2 - np.array(machine.carry_acceleration_m_s2)) / width_m_s2))
