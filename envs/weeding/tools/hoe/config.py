"""The weeding task with the hoe: what all weeders share, its reach and its process."""

from __future__ import annotations

from dataclasses import dataclass, replace

from .....kernels.config import nested
from .....simulation.hoe_model import HoeParameters
from ....core import Array
from ...config import FieldTask
from .arm import HoeReach
from .process import HoeProcessConfig

PRESETS = {"loose-soil": {"process.soil_resistance_pa": 2.0e4}}
"""``loose-soil``: half the resistance of a firm seedbed [published range 14-44 kPa: ASABE D497]."""


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
        return self.process.clearance_m, 0.0, 1.0

    @property
    def depths_m(self) -> tuple[float, float, float]:
        """How deep the blade works, by intensity."""
        return self.process.depth_m

    @property
    def label_work_s(self) -> Array:
        """Seconds (species, stage) of the stir that a kind calls for."""
        return self.process.work_s.sum(axis=1)[self.process.response.labels()]
