"""The weeding task with the laser: what all weeders share, its reach and its process."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .....kernels.config import nested
from .....simulation.weeder_model import WeederParameters
from ....core import Array
from ...config import FieldTask
from .aim import LaserReach
from .process import ProcessConfig


@dataclass(frozen=True)
class WeedingConfig(FieldTask):
    """Everything that defines a weeding task with the laser."""

    reach: LaserReach = nested(LaserReach)
    """Where the beam reaches and how fast the aim moves."""
    process: ProcessConfig = nested(ProcessConfig)
    """What the beam does to plants."""
    machine: WeederParameters = nested(WeederParameters)
    """Masses, motors and friction; the reach sets its ``base_height_m``, the cart its ``camera_ahead_m``."""

    @property
    def parameters(self) -> WeederParameters:
        """The machine under the configuration's reach and cameras."""
        return replace(self.machine, base_height_m=self.reach.base_height_m, camera_ahead_m=self.cart.camera_ahead_m)

    @property
    def front_m(self) -> float:
        """The window begins this far in front of the machine's middle; it ends as far behind it."""
        return self.reach.front_m

    @property
    def half_width_m(self) -> float:
        """Reach to either side."""
        return self.reach.half_width_m

    @property
    def label_work_s(self) -> Array:
        """Seconds (species, stage) of the correction and of the dose that a kind calls for."""
        process = self.process
        return process.correct_s + np.array(process.dose_j)[process.response.labels()] / process.power_w
