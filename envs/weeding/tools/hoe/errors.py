"""Where the hoe's blade is when the drives of sliders and swings err."""

from __future__ import annotations

import numpy as np

from .....motion.orientation import axes, from_euler
from ....core import Array
from ....drives import settled
from ...core import WeedingCore
from ...ridges import ridge_heights
from ...state import WAIT, V, WeederPlan
from ...timing import WORK, A, P
from .config import HoeWeedingConfig
from .process import B

_ANGLES = np.arange(8) * (0.25 * np.pi)
"""Places on the circle at which it is asked on which side the joints stay behind."""


class HoeCore(WeedingCore):
    """The weeding rules with the hoe as their tool."""

    config: HoeWeedingConfig
    driven = 3, 3

    def tool_error(self, plan: WeederPlan) -> Array:
        """See ``ErringCore``: (B, 6) of the mechanism's pose over the middle of the circle.

        On its way round each joint stays behind on either side for about half the time; the rest of it comes from the
        platform's running back at the cart's speed.
        """
        parameters, process, phases = self.config.parameters, self.config.passing, plan.phases_s
        mode = np.minimum(plan.kind, WAIT)
        depth = np.append(process.depth_m, -process.clearance_m)[mode]
        radius = np.append(process.stir_radius_m, 0.0)[mode]
        stir_s = phases[:, WORK + B.stir]
        speed = plan.speed[:, V.before]
        pose = np.zeros((len(mode), 6))
        pose[:, 0] = plan.target[:, A.carrier] - plan.cart
        pose[:, 0] -= speed * (phases[:, : WORK + B.stir].sum(axis=1) + 0.5 * stir_s)
        pose[:, 1], pose[:, 2] = plan.target[:, A.across], -depth - parameters.lowest_tip_m
        pose[:, 2] += ridge_heights(self.machine.ridges, plan.target[:, A.across])
        round_m_s = 2.0 * np.pi * radius / np.maximum(stir_s, 1e-9)
        twist = np.zeros((len(mode), len(_ANGLES), 6))
        twist[..., 0] = -round_m_s[:, None] * np.sin(_ANGLES) - speed[:, None]
        twist[..., 1] = round_m_s[:, None] * np.cos(_ANGLES)
        mechanism = parameters.mechanism
        rates = mechanism.joint_rates(pose[:, None], twist)
        off = self.servos.joint_error(self.drive_luck[:, None], rates).mean(axis=1)
        rest = self.servos.rest(phases[:, P.move] + phases[:, P.wait], phases[:, WORK + B.plunge], stir_s)
        error = mechanism.pose_error(pose, off)
        error[:, :2] -= rest[:, None] * (plan.target - plan.start)[:, [A.carrier, A.across]]
        return settled(error)

    def work_error(self, plan: WeederPlan) -> Array:
        """See ``WeedingCore``: the blade is below the platform, where its tilt counts."""
        error = self.tool_error(plan)
        return settled((error[:, :3] - self.config.parameters.tool_m * axes(from_euler(error[:, 3:]))[..., 2])[:, :2])
