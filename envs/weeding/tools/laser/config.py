"""The weeding task with the laser: what all weeders share, its reach and its process."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .....kernels.config import nested
from .....simulation.weeder_model import WeederParameters
from ....core import Array
from ...config import FieldTask
from .aim import LaserReach, poses
from .process import ProcessConfig

PRESETS = {
    "co2-2012": {
        "process.ed95_j": 54.0,
        "process.dose_j": (30.0, 75.0, 200.0),
        "process.spot_radius_m": 0.003,
        "process.power_w": 200.0,
        "process.crop_ed50_j": 20.0,
    },
    "commercial": {
        "process.ed95_j": 20.0,
        "process.dose_j": (11.0, 28.0, 74.0),
        "process.spot_radius_m": 0.0015,
        "process.power_w": 150.0,
        "process.crop_ed50_j": 7.4,
    },
    "settled": {"process.correct_s": 0.30},
}
"""``co2-2012``: the dose that Marx et al. 2012 published, with their widest spot; the default's own numbers.
``commercial``: 20 J a weed on a spot of 3 mm from 150 W [published: a vendor's pages, LaserWeeder G1], doses and crop
in proportion. On the spot both are 1.9-2.8 J/mm2: a dose belongs to its spot. ``settled``: before a shot the platform
settles for 0.25 s, as an industrial parallel robot does to within 0.1 mm [published: ABB IRB 365, ISO 9283]."""

CORNERS = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 3)).reshape(3, -1).T
"""Of the window in three coordinates, and the middles between them."""

EXCESS_M = 0.05
"""Moves may overshoot the range of X by this."""


@dataclass(frozen=True)
class WeedingConfig(FieldTask):
    """Everything that defines a weeding task with the laser."""

    reach: LaserReach = nested(LaserReach)
    """Where the beam reaches and how fast the aim moves."""
    process: ProcessConfig = nested(ProcessConfig)
    """What the beam does to plants."""
    machine: WeederParameters = nested(WeederParameters)
    """Masses, motors and friction; the reach sets its ``base_height_m``, the cart its ``camera_ahead_m``."""

    def check(self) -> None:
        """Hold the platform to where its legs take it, over the crop and on and off the ridges."""
        super().check()
        bed = self.scenario.bed
        if bed.flat:
            return
        aim, mechanism = self.aim, self.parameters.mechanism
        ends = np.array([aim.travel_m + EXCESS_M, aim.lean_m, aim.half_width_m]) * CORNERS
        for level_m in bed.levels_m:
            pose = poses(aim, ends, 0.0, level_m)
            if pose[0, 1] <= 0.0 or not mechanism.reachable(pose).all():
                self.refuse(
                    "scenario.bed.crop_height_m" if bed.ridge_m == 0.0 else "scenario.bed.ridge_m",
                    f"the legs do not hold the platform {pose[0, 1]:.3f} m below their base all over the window: give "
                    "less, or another scenario.bed.frame_m",
                )

    @property
    def aim(self) -> LaserReach:
        """The reach over the scenario's crop: the platform stands as much higher as the crop is taller."""
        taller_m = self.scenario.bed.taller_m
        return self.reach if taller_m == 0.0 else replace(self.reach, gap_m=self.reach.gap_m + taller_m)

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
    def tool_line(self) -> tuple[float, float, float]:
        """The beam: from the platform's middle to the growing points."""
        return self.aim.gap_m, self.reach.target_height_m, 0.0

    @property
    def looks_after(self) -> bool:
        """Whether the camera beside the laser corrects it after the move."""
        return self.scenario.ground.uneven

    @property
    def label_work_s(self) -> Array:
        """Seconds (species, stage) of the correction and of the dose that a kind calls for."""
        process = self.process
        return process.correct_s + np.array(process.dose_j)[process.response.labels()] / process.power_w
