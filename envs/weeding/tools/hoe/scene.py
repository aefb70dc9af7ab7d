"""The strip with the hoe over it: the machine, stirred spots, and weeds that lie about."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .....simulation.client import pybullet
from .....simulation.hoe import HoeMachine
from .....simulation.hoe_model import HoeParameters
from ....core import Array
from ...scene import FieldScene, Quaternion, Rgba
from .config import HoeWeedingConfig

STIRRED = (0.25, 0.19, 0.14, 1.0)
WILTED = (0.50, 0.47, 0.20, 1.0)


class HoeScene(FieldScene):
    """Draws strip and machine; the ground is drawn without depth, so the blade vanishes in it."""

    mark_radius_m, mark_colour = 0.023, STIRRED
    side_eye_m = (0.42, -1.45, 0.62)
    side_middle_m = 0.26

    def __init__(
        self, config: HoeWeedingConfig, parameters: HoeParameters, *, window: bool = False, machine: bool = True
    ):
        """Make everything; the camera's pictures come faster without the ``machine``."""
        super().__init__(config, parameters.camera_height_m, parameters.physics_hz, window=window)
        self._machine = HoeMachine(parameters, self.client) if machine else None

    def set_machine(self, cart_m: float, pose: ArrayLike) -> None:
        """Put the machine at a cart position and a pose of the mechanism."""
        if self._machine is None:
            raise RuntimeError("this scene was made without its machine")
        self._cart_m = cart_m
        self._machine.place_at(cart_m, pose)
        self.show_front_frustum(cart_m)

    def dead_looks(self, at: Array, turn: Quaternion) -> tuple[Array, Quaternion, Rgba]:
        """Uprooted: tipped over beside its place, and wilting."""
        tip = pybullet.getQuaternionFromEuler((1.35, 0.0, 0.0))
        lying = pybullet.multiplyTransforms((0.0, 0.0, 0.0), turn, (0.0, 0.0, 0.0), tip)[1]
        return at + np.array([0.0, 0.0, 0.004]), lying, WILTED
