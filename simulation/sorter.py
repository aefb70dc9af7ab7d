"""The produce sorter in PyBullet: the 3-PRRS over a belt, with what it carries."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .client import pybullet
from .prrs import PrrsMachine
from .sorter_model import SorterParameters

ITEM_RADIUS_M = 0.03
"""Radius of the ball that a carried item counts as."""


class SorterMachine(PrrsMachine):
    """The 3-PRRS over the belt; the world's origin lies on the floor under it."""

    numbers = SorterParameters
    parameters: SorterParameters

    def reset(self, pose: ArrayLike) -> None:
        """``place`` the machine, with nothing in its fingers, and have its motors hold it there."""
        self.carry(0.0)
        super().reset(pose)

    def carry(self, mass_kg: float) -> None:
        """Hold an item between the fingers, or nothing with 0: it adds to the platform's mass and inertia."""
        if not 0.0 <= mass_kg < np.inf:
            raise ValueError(f"mass_kg = {mass_kg}: give a mass >= 0")
        below = self.parameters.tool_m + self._to_mass[0][2]
        own = 0.4 * ITEM_RADIUS_M**2
        added = mass_kg * np.array([own + below**2, own + below**2, own])
        pybullet.changeDynamics(
            self.platform_id,
            -1,
            mass=self.parameters.platform_mass_kg + mass_kg,
            localInertiaDiagonal=(self._inertia + added).tolist(),
            physicsClientId=self.client.id,
        )
