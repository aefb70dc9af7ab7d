"""The weeding task with the hoe: what all weeders share, its reach and its process."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from .....kernels.config import ConfigError, nested
from .....simulation.hoe_model import HoeParameters
from ....core import Array
from ...config import FieldTask
from .arm import HoeReach
from .process import HoeProcessConfig

PRESETS = {"loose-soil": {"process.soil_resistance_pa": 2.0e4}}
"""``loose-soil``: half the resistance of a firm seedbed [published range 14-44 kPa: ASABE D497]."""

EXCESS_M = 0.04
"""Moves may overshoot the range along the row by this."""


@dataclass(frozen=True)
class HoeWeedingConfig(FieldTask):
    """Everything that defines a weeding task with the hoe."""

    reach: HoeReach = nested(HoeReach)
    """Where the blade reaches and how fast it moves."""
    process: HoeProcessConfig = nested(HoeProcessConfig)
    """What a stir does to plants."""
    machine: HoeParameters = nested(HoeParameters)
    """Masses, motors and friction; the process sets its blade and soil, the cart its ``camera_ahead_m``, the reach how
    fast it moves."""

    def check(self) -> None:
        """Hold the blade to where the mechanism takes it, over the crop and on and off the ridges."""
        bed = self.scenario.bed
        tall = "scenario.bed.crop_height_m" if bed.ridge_m == 0.0 else "scenario.bed.ridge_m"
        try:
            passing = self.passing
        except ConfigError:
            self.refuse(tall, "no hoe passes over that: give less")
        super().check()
        if bed.flat:
            return
        parameters, (furrow_m, ridge_m) = self.parameters, bed.levels_m
        pose = np.zeros((9, 6))
        ends = np.array(np.meshgrid(*[[-1.0, 0.0, 1.0]] * 2)).reshape(2, -1).T
        ways = (ridge_m + passing.clearance_m, EXCESS_M), (furrow_m - max(self.process.depth_m), 0.0)
        for height_m, excess_m in ways:
            pose[:, :2] = ends * [self.reach.travel_m + excess_m, self.reach.half_width_m]
            pose[:, 2] = height_m - parameters.lowest_tip_m
            if not parameters.mechanism.reachable(pose).all():
                self.refuse(
                    tall,
                    f"the arms do not hold the blade at {height_m:.3f} m over the level that they are mounted for all "
                    "over the window: give less, or another scenario.bed.frame_m",
                )

    @property
    def passing(self) -> HoeProcessConfig:
        """The process over the scenario's crop.

        The blade passes as much higher as the crop is taller, and over the ridges that lie between two furrows.
        """
        higher_m = self.scenario.bed.taller_m + self.scenario.bed.ridge_m
        process = self.process
        return process if higher_m == 0.0 else replace(process, clearance_m=process.clearance_m + higher_m)

    @property
    def parameters(self) -> HoeParameters:
        """The machine under the configuration's hoe and camera."""
        return replace(
            self.machine,
            blade_radius_m=self.process.blade_radius_m,
            soil_resistance_pa=self.process.soil_resistance_pa,
            camera_ahead_m=self.cart.camera_ahead_m,
        )

    @property
    def front_m(self) -> float:
        """The window begins this far in front of the machine's middle; it ends as far behind it."""
        return self.reach.travel_m

    @property
    def half_width_m(self) -> float:
        """Reach to either side."""
        return self.reach.half_width_m

    @property
    def tool_line(self) -> tuple[float, float, float]:
        """The shaft: straight down to the ground."""
        return self.passing.clearance_m, 0.0, 1.0

    @property
    def depths_m(self) -> tuple[float, float, float]:
        """How deep the blade works, by intensity."""
        return self.process.depth_m

    @property
    def label_work_s(self) -> Array:
        """Seconds (species, stage) of the stir that a kind calls for."""
        return self.passing.work_s.sum(axis=1)[self.process.response.labels()]
