"""The hoe's strip as its camera and people see it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ....core import Array
from ...core import WeedingCore
from ...ridges import ridge_height
from ...state import V, WeederPlan
from ...view import FieldView, Show
from .config import HoeWeedingConfig
from .machine import poses, tip_way
from .scene import HoeScene


class HoeView(FieldView[HoeScene]):
    """Scenes of the hoe; see ``FieldView``."""

    def __init__(self, core: WeedingCore):
        """Build nothing yet: scenes come with the first look or picture."""
        super().__init__(core)
        self._config: HoeWeedingConfig = core.config
        self._parameters = self._config.parameters

    def make_scene(self) -> HoeScene:
        """A scene: one for the camera, and one for people with the machine in it."""
        return HoeScene(self._config, self._parameters)

    def standing(self) -> Show[HoeScene]:
        """The machine as it stands now, its blade up."""
        state = self.core.state
        along, _, across = state.place[0]
        high = self._config.passing.clearance_m + ridge_height(self.core.machine.ridges, float(across))
        return self._show(float(state.cart[0]), np.array([along, across, high]))

    def moving(self, plan: WeederPlan, phases_s: Array, time_s: Array) -> Iterator[Show[HoeScene]]:
        """The machine at times (n,) of a decision."""
        tip = tip_way(self._config.passing, plan, phases_s, time_s, self.core.machine.ridges)
        cart = plan.cart[0] + plan.speed[0, V.before] * time_s
        for x, place in zip(cart.tolist(), tip, strict=True):
            yield self._show(x, place)

    def _show(self, cart_m: float, tip: Array) -> Show[HoeScene]:
        pose = poses(self._parameters, tip[None], np.array([cart_m]))[0]
        return lambda scene: scene.set_machine(cart_m, pose)
