"""Where the gripper is at a cell when the arms' drives err."""

from __future__ import annotations

import numpy as np

from ..core import Array
from ..drives import Servos, settled
from .config import SPEEDS, MachineConfig

JOINTS = 0, 2
"""Linear and rotary ones: the arms."""
EMPTY_HANDED = len(SPEEDS)
"""Index of the empty gripper's limit behind the three speeds."""


def falls_s(machine: MachineConfig) -> tuple[float, ...]:
    """Seconds of the fall from the gates' level to a cell under each limit, the empty gripper's last."""
    limits = *machine.carry_acceleration_m_s2, machine.acceleration_m_s2
    return tuple(float(machine.gate(limit).durations(0.0, 0.0, machine.lift_m)) for limit in limits)


def tool_error(
    machine: MachineConfig, servos: Servos, luck: Array, points: Array, fall_m: Array, fall_s: Array, work_s: Array
) -> Array:
    """What the tool is off by (..., 2), across and up, where it has come straight down.

    Args:
        machine: the arm.
        servos: errors of the two arms.
        luck: (..., 2) of the machines.
        points: (..., 2) of the arm's plane.
        fall_m: (...), how far it came down.
        fall_s: (...), in which time.
        work_s: (...), time of the work there.
    """
    down = np.zeros(points.shape)
    down[..., 1] = -1.0
    off = servos.joint_error(luck, machine.arm.joint_rates(points, down))
    error = machine.arm.pose_error(points, off)
    error[..., 1] += servos.rest(fall_s, 0.0, work_s) * fall_m
    return settled(error)
