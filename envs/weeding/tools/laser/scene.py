"""The strip with the laser over it, its beam, and the camera beside the laser."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from .....mechanisms.batching import as_points
from .....perception.frames import Camera, Frame
from .....rendering.instances import instances, joined, upright_to
from .....rendering.shapes import ball, cylinder, frustum
from .....simulation.looks import MachineLooks
from .....simulation.weeder_model import JOINTS, WeederParameters, weeder_joints, weeder_robot
from ....core import Array
from ...scene import FieldScene
from .config import WeedingConfig

TOOL_SIGHT = (0.45, 0.80, 0.98, 1.0)
BEAM, GLOW = (1.0, 0.05, 0.05, 1.0), (1.0, 0.85, 0.35, 1.0)
_TOOL_HALF_M = 0.05
"""What the camera beside the laser sees to either side of its target."""
_BEAM_M, _HEAD_M = 1.0, 0.12
"""The visible beam is this long and begins under the laser head; what is below ground is hidden."""


class WeederScene(FieldScene):
    """The strip with the laser over it, its beam, and the camera beside the laser."""

    # From within the frame, behind the laser: neither wheel nor leg stands before the row.
    side_eye_m = (-0.98, -0.36, 0.42)
    side_middle_m = 0.39
    side_view_rad = np.deg2rad(60.0)
    far_eye_m, far_middle_m = (2.10, -4.00, 1.75), 0.75

    def __init__(self, config: WeedingConfig, parameters: WeederParameters):
        """Add the meshes of everything."""
        super().__init__(config, parameters.camera_height_m)
        self._reach, self._parameters = config.aim, parameters
        self.tool = Camera(240, 240, 2.0 * np.arctan(_TOOL_HALF_M / config.aim.gap_m), 0.30, 2.0)
        library = self.stage.library
        self._machine = MachineLooks(library, [weeder_robot(parameters)])
        self._order = [JOINTS.index(name) for name in self._machine.joints]
        self._platform = self._machine.links.index("platform")
        half = (_TOOL_HALF_M, _TOOL_HALF_M)
        self._tool_frustum = library.add(frustum(half, config.aim.gap_m, 0.002))
        self._beam, self._spot = library.add(cylinder(0.003, _BEAM_M, 12)), library.add(ball(0.0045))

    def set_machine(self, cart_m: float, pose: ArrayLike, beam_on: bool = False) -> None:
        """Put the machine at a cart position and a pose of the mechanism, its beam on or off."""
        self._cart_m = cart_m
        joints = weeder_joints(self._parameters, np.array([cart_m]), as_points(pose, 4, "pose").reshape(1, 4))[0]
        parts, turn, shift = self._machine.place(joints[self._order])
        self.show_front_frustum(cart_m)
        top, ray = shift[self._platform], turn[self._platform, :, 2]
        self.stage.put("machine", parts)
        shown = [instances(self._tool_frustum, top, upright_to(-ray), TOOL_SIGHT)]
        met = top + (self._reach.target_height_m - top[2]) / ray[2] * ray
        self.tool_m = np.array([met[0], met[1], 0.03])
        if beam_on:
            along = upright_to(ray)
            shown.append(instances(self._beam, top + (_HEAD_M + 0.5 * _BEAM_M) * ray, along, BEAM))
            shown.append(instances(self._spot, (met[0], met[1], 0.006), along, GLOW))
        self.stage.put("beam", joined(shown), shadow=False)

    def look_tool(self, centre: Array, spot: Array, cart_m: float = 0.0) -> Frame:
        """What the camera beside the laser sees from the platform's ``centre`` (3,) towards a place (2,).

        On ground that is no plane the frame's stand at ``cart_m`` moves both.
        """
        self.plant_around(float(centre[0]))
        target = np.array([spot[0], spot[1], self._reach.target_height_m])
        return self.look_shaken(self.tool, cart_m, centre, target)
