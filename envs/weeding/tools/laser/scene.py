"""The strip with the laser over it, its beam, and the camera beside the laser."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .....perception.frames import Camera, Frame
from .....simulation.client import pybullet
from .....simulation.meshes import Pool, frustum, upright_to
from .....simulation.weeder import WeederMachine
from .....simulation.weeder_model import WeederParameters
from ....core import Array
from ...scene import FieldScene
from .config import WeedingConfig

TOOL_SIGHT = (0.45, 0.80, 0.98, 1.0)
_TOOL_HALF_M = 0.05
"""What the camera beside the laser sees to either side of its target."""


class WeederScene(FieldScene):
    """The strip with the laser over it, its beam, and the camera beside the laser."""

    # From within the frame, behind the laser: neither wheel nor leg stands before the row.
    side_eye_m = (-0.98, -0.36, 0.42)
    side_middle_m = 0.39
    side_view_rad = np.deg2rad(60.0)

    def __init__(
        self, config: WeedingConfig, parameters: WeederParameters, *, window: bool = False, machine: bool = True
    ):
        """Make everything; the cameras' pictures come faster without the ``machine``."""
        super().__init__(config, parameters.camera_height_m, parameters.physics_hz, window=window)
        self._reach = config.reach
        self._machine = WeederMachine(parameters, self.client) if machine else None
        self.tool = Camera(240, 240, 2.0 * np.arctan(_TOOL_HALF_M / config.reach.gap_m), 0.30, 2.0)
        half = (_TOOL_HALF_M, _TOOL_HALF_M)
        self._tool_frustum = Pool(self.client, frustum(half, config.reach.gap_m, 0.002), TOOL_SIGHT, 1)
        red = {"rgbaColor": [1.0, 0.05, 0.05, 0.55], "physicsClientId": self.client.id}
        shape = pybullet.createVisualShape(pybullet.GEOM_CYLINDER, radius=0.003, length=1.0, **red)
        self._beam = pybullet.createMultiBody(0.0, -1, shape, [0, 0, -20], physicsClientId=self.client.id)
        glow = {"rgbaColor": [1.0, 0.85, 0.35, 1.0], "physicsClientId": self.client.id}
        shape = pybullet.createVisualShape(pybullet.GEOM_SPHERE, radius=0.0045, **glow)
        self._spot = pybullet.createMultiBody(0.0, -1, shape, [0, 0, -20], physicsClientId=self.client.id)

    def set_machine(self, cart_m: float, pose: ArrayLike, beam_on: bool = False) -> None:
        """Put the machine at a cart position and a pose of the mechanism, its beam on or off."""
        if self._machine is None:
            raise RuntimeError("this scene was made without its machine")
        self._cart_m = cart_m
        self._machine.place(cart_m, pose)
        self.show_front_frustum(cart_m)
        top = self._machine.platform_world()
        foot = np.array([*self._machine.beam_world(0.0), 0.0])
        ray = (foot - top) / np.linalg.norm(foot - top)
        self._tool_frustum.clear()
        self._tool_frustum.place(top, upright_to(-ray))
        at = [0.0, 0.0, -20.0]
        turn = [0.0, 0.0, 0.0, 1.0]
        spot = at
        if beam_on:
            # The visible beam is 1 m long and begins under the laser head; what is below ground is hidden.
            middle = top + 0.12 * ray + 0.5 * ray
            at, spot = middle.tolist(), [*self._machine.beam_world(self._reach.target_height_m), 0.006]
            turn = upright_to(ray).tolist()
        pybullet.resetBasePositionAndOrientation(self._beam, at, turn, physicsClientId=self.client.id)
        pybullet.resetBasePositionAndOrientation(self._spot, spot, turn, physicsClientId=self.client.id)

    def look_tool(self, centre: Array, spot: Array) -> Frame:
        """What the camera beside the laser sees from the platform's ``centre`` (3,) towards a place (2,)."""
        self.plant_around(float(centre[0]))
        return self.look_down(self.tool, centre, np.array([spot[0], spot[1], self._reach.target_height_m]))
