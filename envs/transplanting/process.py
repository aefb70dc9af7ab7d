"""What gripping and carrying do to a plug. Pure array functions."""

from __future__ import annotations

import numpy as np

from ..core import Array
from .config import MachineConfig, ProcessConfig


def loss_chances(machine: MachineConfig, process: ProcessConfig) -> Array:
    """Chance to lose a gripped plug on the way, by speed, shape (3,)."""
    return _logistic(machine, process.loss_half_m_s2, process.loss_width_m_s2)


def damage_chances(machine: MachineConfig, process: ProcessConfig) -> Array:
    """Chance that a plug that is not lost arrives damaged, by speed, shape (3,)."""
    return _logistic(machine, process.damage_half_m_s2, process.damage_width_m_s2)


def _logistic(machine: MachineConfig, half_m_s2: float, width_m_s2: float) -> Array:
    # Far below the half the exponential overflows, and the chance is 0.
    with np.errstate(over="ignore"):
        return 1.0 / (1.0 + np.exp((half_m_s2 - np.array(machine.carry_acceleration_m_s2)) / width_m_s2))
