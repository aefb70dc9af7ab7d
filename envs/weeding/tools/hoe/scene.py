"""The strip with the hoe over it: the machine, stirred spots, and weeds that lie about."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .....motion.orientation import axes, from_euler
from .....simulation.hoe_model import HoeParameters
from .....simulation.prrs_looks import PrrsLooks
from ....core import Array
from ...scene import FieldScene, Rgba
from .config import HoeWeedingConfig

STIRRED = (0.25, 0.19, 0.14, 1.0)
WILTED = (0.50, 0.47, 0.20, 1.0)
_TIP_RAD = 1.35


class HoeScene(FieldScene):
    """Draws strip and machine; the blade vanishes in the ground."""

    mark_radius_m, mark_colour = 0.023, STIRRED
    side_eye_m = (0.42, -1.45, 0.62)
    side_middle_m = 0.26

    def __init__(self, config: HoeWeedingConfig, parameters: HoeParameters):
        """Add the meshes of everything."""
        super().__init__(config, parameters.camera_height_m)
        self._machine = PrrsLooks(self.stage.library, parameters, [parameters.cart_robot()])

    def set_machine(self, cart_m: float, pose: ArrayLike) -> None:
        """Put the machine at a cart position and a pose of the mechanism."""
        self._cart_m = cart_m
        self.stage.put("machine", self._machine.place(pose, cart_m))
        centre, parameters = np.asarray(pose, np.float64), self._machine.parameters
        tip = centre[:3] - parameters.tool_m * axes(from_euler(centre[3:]))[:, 2]
        self.tool_m = np.array([cart_m + tip[0], tip[1], 0.05])
        self.show_front_frustum(cart_m)

    def dead_looks(self, at: Array, turn: Array) -> tuple[Array, Array, Rgba]:
        """Uprooted: tipped over beside its place, and wilting."""
        c, s = np.cos(_TIP_RAD), np.sin(_TIP_RAD)
        tip = np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
        return at + np.array([0.0, 0.0, 0.004]), turn @ tip, WILTED
