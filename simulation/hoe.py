"""The hoeing machine in PyBullet: the 3-PRRS under a cart that drives on, with soil that resists its blade."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..mechanisms.batching import as_points
from ..motion.orientation import axes, from_euler
from .client import pybullet
from .closed_loop import Body
from .hoe_model import HoeParameters
from .prrs import PrrsMachine, PrrsResult

Array = NDArray[np.float64]

YIELD_M_S = 0.02
"""Below this speed of the blade the soil's resistance falls to zero with the speed: it does not push back."""


class HoeMachine(PrrsMachine):
    """The 3-PRRS with its hoe. Poses are relative to the cart, in whose frame it is simulated."""

    numbers = HoeParameters
    parameters: HoeParameters

    def soil_force(self, pose: ArrayLike, speed_m_s: float, ground_m: ArrayLike = 0.0) -> tuple[Array, Array]:
        """Force of the soil on the blade along a motion, (n, 3) N, and where it acts, (n, 3) in the cart's frame.

        It opposes the blade's motion over ground with ``soil_resistance_pa`` x blade width x depth.

        Args:
            pose: (n, 6), n >= 2, at ``physics_hz``.
            speed_m_s: of the cart.
            ground_m: height of the ground under the blade over the cart's own level, one or (n,).
        """
        parameters = self.parameters
        poses = as_points(pose, 6, "pose")
        tip = poses[:, :3] - parameters.tool_m * axes(from_euler(poses[:, 3:]))[..., 2]
        tip[:, 2] += parameters.origin_height_m
        velocity = np.gradient(tip, 1.0 / parameters.physics_hz, axis=0)
        velocity[:, 0] += speed_m_s
        depth = np.maximum(np.asarray(ground_m, np.float64) - tip[:, 2], 0.0)
        size = parameters.soil_resistance_pa * 2.0 * parameters.blade_radius_m * depth
        speed = np.linalg.norm(velocity, axis=1)
        return -(size / np.maximum(speed, YIELD_M_S))[:, None] * velocity, tip

    def hoe(
        self,
        pose: ArrayLike,
        speed_m_s: float,
        on_step: Callable[[int], None] | None = None,
        *,
        measure: bool = False,
        ground_m: ArrayLike = 0.0,
    ) -> PrrsResult:
        """``run`` a motion with the soil's resistance, the cart driving at ``speed_m_s``; see ``soil_force``."""
        poses = as_points(pose, 6, "pose")
        if poses.ndim != 2 or len(poses) < 2:
            return self.run(poses, on_step, measure=measure)
        force, tip = self.soil_force(poses, speed_m_s, ground_m)
        felt = np.any(force != 0.0, axis=1)
        pushes, places = force.tolist(), tip.tolist()
        body, client = self.platform_id, self.client.id

        def resist(row: int) -> None:
            if felt[row]:
                pybullet.applyExternalForce(body, -1, pushes[row], places[row], pybullet.WORLD_FRAME, client)

        def after(row: int) -> None:
            # A force lasts for one step.
            if row + 1 < len(pushes):
                resist(row)
            if on_step is not None:
                on_step(row)

        resist(0)
        return self.run(poses, after, measure=measure)

    def _fixtures(self, paths: dict[str, Path]) -> list[Body]:
        return [Body("cart", paths["cart"])]
