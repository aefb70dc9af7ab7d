"""The produce sorter's numbers and its URDFs, generated from them."""

from __future__ import annotations

from dataclasses import dataclass

from ..kernels.config import num
from .prrs_model import CARBON, ORANGE, PrrsParameters, hub_parts
from .urdf import Box, Colour, Cylinder, Link, Part, Robot

RUBBER = Colour("rubber", 0.10, 0.30, 0.55)


@dataclass(frozen=True)
class SorterParameters(PrrsParameters):
    """The 3-PRRS over a belt (``ThreePRRS.sorter``). World: x with the belt, y across, z up, floor at z = 0.

    The platform's speed and acceleration are limited relative to the floor, following the belt apart; tracking is
    required at 1 m/s.
    """

    belt_height_m: float = num(0.80, 0.1, 3.0, "m")
    """Top of the belt above the floor (assumed)."""
    origin_above_belt_m: float = num(0.095, 0.0, 0.5, "m")
    """The mechanism's z = 0 above the belt: the lowest grip is just inside the workspace (assumed)."""
    physics_hz: float = num(120.0, 30.0, 100_000.0, "1/s")
    """Simulation steps a second (the tracking figures are measured with it)."""

    name = "sorter"

    @property
    def origin_height_m(self) -> float:
        """World height of the mechanism's z = 0."""
        return self.belt_height_m + self.origin_above_belt_m

    def platform_robot(self) -> Robot:
        """The platform with its gripper; the grip centre is below P.

        The fingers stand across the item's width, so that they close along y.
        """
        tool = self.tool_m
        parts = [
            *hub_parts(self),
            Part(Cylinder(0.022, 0.030), CARBON, (0.0, 0.0, -0.026)),
            Part(Box((0.034, 0.100, 0.016)), ORANGE, (0.0, 0.0, -0.046)),
            *(
                Part(Box((0.030, 0.008, tool - 0.036)), RUBBER, (0.0, side * 0.040, -0.5 * (tool + 0.052)))
                for side in (-1.0, 1.0)
            ),
        ]
        return Robot("sorter_platform", (Link("platform", self.platform_mass_kg, tuple(parts)),), ())
