"""What a machine made of the 3-PRRS looks like in a pose. No PyBullet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from ..mechanisms.batching import as_points
from ..mechanisms.prrs_legs import LEG_ANGLES_RAD
from ..motion.orientation import axes, from_euler
from ..rendering.instances import Instances, about_z
from ..rendering.library import MeshLibrary
from .looks import MachineLooks
from .prrs_model import PrrsParameters, leg_robot
from .urdf import Robot


class PrrsLooks:
    """The 3-PRRS with its tool, and what stands still beside it."""

    def __init__(self, library: MeshLibrary, parameters: PrrsParameters, fixtures: Sequence[Robot] = ()):
        """Add the parts to a library; ``fixtures`` stand on the ground under the machine and move with its cart."""
        self.parameters = parameters
        legs = [leg_robot(parameters, leg) for leg in (1, 2, 3)]
        robots = [*legs, parameters.platform_robot(), *fixtures]
        self._looks = MachineLooks(library, robots)
        self._legs, self._fixtures = self._looks.bases[:3], self._looks.bases[4:]
        self._platform = self._looks.bases[3]

    def place(self, pose: ArrayLike, cart_m: float = 0.0) -> Instances:
        """The machine at a pose (6,) of the mechanism, its axis ``cart_m`` along x.

        Raises:
            ValueError: the pose is out of reach, or no number.
        """
        poses = as_points(pose, 6, "pose").reshape(1, 6)
        chains = self.parameters.mechanism.chains(poses)
        origin = np.array([cart_m, 0.0, self.parameters.origin_height_m])
        bases = {name: (turn, origin) for name, turn in zip(self._legs, about_z(LEG_ANGLES_RAD), strict=True)}
        bases[self._platform] = axes(from_euler(poses[0, 3:])), poses[0, :3] + origin
        bases |= {name: (np.eye(3), np.array([cart_m, 0.0, 0.0])) for name in self._fixtures}
        sliders, drives = chains.joints[0, :3].tolist(), chains.joints[0, 3:].tolist()
        values = {}
        for leg, (slider, drive, swing) in enumerate(zip(sliders, drives, chains.swing[0].tolist(), strict=True), 1):
            values |= {f"slider{leg}": slider, f"drive{leg}": drive, f"swing{leg}": swing}
        return self._looks.place([values[name] for name in self._looks.joints], bases)[0]
