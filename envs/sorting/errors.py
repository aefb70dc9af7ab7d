"""Where the sorter's fingers close when the drives of sliders and swings err."""

from __future__ import annotations

import numpy as np

from ...motion.orientation import axes, euler_angles, from_euler
from ..core import Array
from ..drives import Servos, settled
from .columns import PHASE
from .config import SortingConfig
from .state import SorterPlan

JOINTS = 3, 3
"""Linear and rotary ones: sliders, swings."""


def tool_error(config: SortingConfig, servos: Servos, luck: Array, plan: SorterPlan) -> Array:
    """What the platform's pose is off by (B, 6) as the fingers close, in mechanism coordinates.

    It follows the belt then, so that the joints stay behind as they move with it.
    """
    mechanism = config.machine.sorter.mechanism
    pose = _grips(plan)
    along = np.zeros(pose.shape)
    along[:, 0] = config.belt.speed_m_s
    off = servos.joint_error(luck, mechanism.joint_rates(pose, along))
    phases = plan.phases_s
    approach_s, descend_s = phases[:, PHASE.approach], phases[:, PHASE.descend]
    # What is left of the approach when the ramp to the belt's speed has been taken off, see ``motions``.
    stroke = np.zeros((len(pose), 3))
    stroke[:, :2] = plan.meet - plan.start
    stroke[:, 0] -= 0.5 * config.belt.speed_m_s * approach_s
    stroke[:, 2] = plan.grip[:, 2] - config.machine.travel_level_m
    motion_s = np.column_stack([approach_s, approach_s, descend_s])
    since_s = np.column_stack([descend_s, descend_s, np.zeros(len(pose))])
    error = mechanism.pose_error(pose, off)
    error[:, :3] -= servos.rest(motion_s, since_s, phases[:, PHASE.grip, None]) * stroke
    return settled(error)


def held_at(plan: SorterPlan, error: Array) -> tuple[Array, Array]:
    """Platform positions (B, 3) and the tool's x and z axes (B, 6) of poses that are off by ``error`` (B, 6)."""
    pose = _grips(plan) + error
    tool = axes(from_euler(pose[:, 3:]))
    return pose[:, :3], np.concatenate([tool[..., 0], tool[..., 2]], axis=-1)


def _grips(plan: SorterPlan) -> Array:
    """Commanded poses (B, 6) as the fingers close."""
    return np.concatenate([plan.grip, euler_angles(plan.turn)], axis=-1)
