"""Where the laser's beam is when the legs' drives err."""

from __future__ import annotations

import numpy as np

from .....kernels import compiled
from ....core import Array
from ....drives import settled
from ...core import WeedingCore
from ...ridges import ridge_heights
from ...state import V, WeederPlan
from ...timing import WORK, A, P, way_of
from .aim import poses, spot
from .config import WeedingConfig
from .process import B


class LaserCore(WeedingCore):
    """The weeding rules with the laser as their tool."""

    config: WeedingConfig
    driven = 4, 0

    def tool_error(self, plan: WeederPlan) -> Array:
        """See ``ErringCore``: (B, 4) of the mechanism's pose in the middle of the burn.

        While it burns the platform runs back at the cart's speed, so that the legs stay behind on that side.
        """
        pose, _, speed = self._burning(plan)
        mechanism = self.config.machine.mechanism
        rates = np.zeros(pose.shape)
        rates[:, 0] = -speed
        off = self.servos.joint_error(self.drive_luck, mechanism.joint_rates(pose, rates))
        phases = plan.phases_s
        rest = self.servos.rest(
            phases[:, P.move] + phases[:, P.wait], phases[:, WORK + B.correct], phases[:, WORK + B.burn]
        )
        cart = pose[:, 0] * 0.0
        aim, begin = self.config.aim, ridge_heights(self.machine.ridges, plan.start[:, A.across])
        stroke = poses(aim, plan.target, cart, self._rise(plan)) - poses(aim, plan.start, cart, begin)
        return settled(mechanism.pose_error(pose, off) - rest[:, None] * stroke)

    def work_error(self, plan: WeederPlan) -> Array:
        """See ``WeedingCore``."""
        pose, cart, _ = self._burning(plan)
        aim, rise = self.config.aim, self._rise(plan)
        return settled(spot(aim, pose + self.tool_error(plan), cart, rise) - spot(aim, pose, cart, rise))

    def _burning(self, plan: WeederPlan) -> tuple[Array, Array, Array]:
        """Pose (B, 4), cart (B,) and the cart's speed (B,) in the middle of the burn."""
        phases = plan.phases_s
        middle_s = phases[:, : WORK + B.burn].sum(axis=1) + 0.5 * phases[:, WORK + B.burn]
        way, speed = _driven(plan.speed, self.config.cart.acceleration_m_s2, middle_s)
        cart = plan.cart + way
        return poses(self.config.aim, plan.target, cart, self._rise(plan)), cart, speed

    def _rise(self, plan: WeederPlan) -> Array:
        """Height (B,) of the ridges where the tool works."""
        return ridge_heights(self.machine.ridges, plan.target[:, A.across])


@compiled
def _driven(speed: Array, acceleration: float, time_s: Array) -> tuple[Array, Array]:
    """Ways and speeds (B,) of carts at times (B,)."""
    way, now = np.empty(len(time_s)), np.empty(len(time_s))
    for w in range(len(time_s)):
        way[w], now[w] = way_of(speed[w, V.before], speed[w, V.after], acceleration, time_s[w])
    return way, now
