"""Where the picker's tool is at a head when its drives err."""

from __future__ import annotations

import numpy as np

from ..core import Array
from ..drives import Servos, settled
from .config import SafflowerConfig
from .state import PickerPlan
from .timing import P

JOINTS = 1, 2
"""Linear and rotary ones: the cart, the arms."""


def tool_error(config: SafflowerConfig, servos: Servos, luck: Array, plan: PickerPlan) -> Array:
    """What the tool is off by (B, 3) in the coordinates of the plan while it cuts: cart, u, v.

    Last of all the tool came down, so that the arms moved as a descent has them; where there is none, across.
    """
    bar, clear_m = config.machine.picker.five_bar, config.machine.clear_level_m
    stroke = plan.target - plan.start
    stroke[:, 2] = np.minimum(plan.target[:, 2] - clear_m, 0.0)
    came = np.zeros((len(stroke), 2))
    came[:, 1] = stroke[:, 2]
    level = plan.descent_s <= 0.0
    came[level, 0] = stroke[level, 1]
    rates = np.column_stack([stroke[:, 0], bar.joint_rates(plan.target[:, 1:], came)])
    off = servos.joint_error(luck, rates)
    # Cart and traverse ended before the wait for the cart and the descent began.
    motion_s = np.column_stack([plan.beside_s, plan.descent_s])
    since_s = np.zeros(stroke.shape)
    since_s[:, :2] = plan.beside_s.max(axis=1, keepdims=True) - plan.beside_s
    since_s[:, :2] += (plan.phases_s[:, P.settle] + plan.descent_s)[:, None]
    rest = servos.rest(motion_s, since_s, plan.phases_s[:, P.shear, None])
    error = np.column_stack([off[:, 0], bar.pose_error(plan.target[:, 1:], off[:, 1:])])
    return settled(error - rest * stroke)
