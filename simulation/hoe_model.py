"""The hoeing machine's numbers and its URDFs, generated from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kernels.config import nested, num
from ..mechanisms import ThreePRRS
from .prrs_model import ALUMINIUM, CARBON, GANTRY_LEVEL_M, ORANGE, STEEL, PrrsParameters, hub_parts
from .urdf import ALONG_Y, BLACK, RUBBER, WHITE, Box, Colour, Cylinder, Link, Part, Robot

FRAME = Colour("frame", 0.16, 0.36, 0.24)

_HALF_LENGTH_M = 0.62
_HALF_WIDTH_M = 0.52
_WHEEL_RADIUS_M = 0.24


@dataclass(frozen=True)
class HoeParameters(PrrsParameters):
    """The 3-PRRS under a cart, with a round hoe blade on a stem (``ThreePRRS.hoe``); all assumed.

    World: x along the row, y across, z up, ground at z = 0. The cart drives at a constant speed, so that its frame is
    as good as the ground's for the physics: the machine is simulated in the cart's frame.
    """

    mechanism: ThreePRRS = nested(ThreePRRS.hoe)
    """The 3-PRRS."""
    tool_m: float = num(0.160, 1e-3, 1.0, "m")
    """From the blade's underside up to the platform's centre P."""
    slider_force_limit_n: float = num(250.0, 1e-3, 1e5, "N")
    """Each slider's ball screw."""
    swing_torque_limit_n_m: float = num(20.0, 1e-3, 1e4, "N m")
    """Each driven rotation behind its gear."""
    platform_mass_kg: float = num(1.2, 1e-3, 100.0, "kg")
    """Platform and hoe."""
    lowest_tip_m: float = num(-0.040, -1.0, -1e-4, "m")
    """World height of the blade's underside at the mechanism's z = 0, below the ground."""
    blade_radius_m: float = num(0.014, 1e-3, 0.2, "m")
    """Of the hoe blade."""
    soil_resistance_pa: float = num(4.0e4, 1e-3, 1e7, "Pa")
    """Force against the blade's motion per area of soil that it meets, blade width x depth; a loose seedbed."""
    camera_ahead_m: float = num(0.85, 1e-3, 10.0, "m")
    """Front camera in front of the mechanism, only for the looks."""
    camera_height_m: float = num(0.85, 1e-3, 10.0, "m")
    """Its height over the ground, only for the looks."""

    name = "hoe"

    def check(self) -> None:
        """The blade gets below the ground, the hub does not."""
        super().check()
        if not -self.tool_m < self.lowest_tip_m:
            self.refuse(
                "lowest_tip_m", f"the hub must stay above the ground: give more than -tool_m = {-self.tool_m} m"
            )

    @property
    def origin_height_m(self) -> float:
        """World height of the mechanism's z = 0."""
        return self.tool_m + self.lowest_tip_m

    def platform_robot(self) -> Robot:
        """The platform with its hoe: a stem and a round blade, its underside ``tool_m`` below P."""
        stem = self.tool_m - 0.022
        parts = [
            *hub_parts(self),
            Part(Cylinder(0.024, 0.024), CARBON, (0.0, 0.0, -0.022)),
            Part(Cylinder(0.008, stem), ORANGE, (0.0, 0.0, -0.020 - 0.5 * stem)),
            Part(Cylinder(self.blade_radius_m, 0.005), STEEL, (0.0, 0.0, 0.0025 - self.tool_m)),
            Part(Cylinder(0.7 * self.blade_radius_m, 0.006), STEEL, (0.0, 0.0, 0.008 - self.tool_m)),
        ]
        return Robot("hoe_platform", (Link("platform", self.platform_mass_kg, tuple(parts)),), ())

    def cart_robot(self) -> Robot:
        """The cart, for the looks; its origin is on the ground under the machine's axis."""
        return Robot("hoe_cart", (Link("frame", 150.0, _frame_parts(self)),), ())

    def assets(self) -> dict[str, str]:
        """Text of every URDF of the machine, by its path below ``assets/``."""
        return {**super().assets(), f"urdf/{self.name}/cart.urdf": self.cart_robot().to_xml()}


def _frame_parts(parameters: HoeParameters) -> tuple[Part, ...]:
    """A low portal over the row: side beams on wheels, the plate that carries the rails, batteries, front camera."""
    plate = parameters.origin_height_m + GANTRY_LEVEL_M
    top = plate + 0.045
    parts: list[Part] = [Part(Cylinder(0.15, 0.012), ALUMINIUM, (0.0, 0.0, plate + 0.006))]
    for y in (-_HALF_WIDTH_M, _HALF_WIDTH_M):
        parts.append(Part(Box((2.0 * _HALF_LENGTH_M, 0.05, 0.05)), FRAME, (0.0, y, top)))
        for x in (-_HALF_LENGTH_M, _HALF_LENGTH_M):
            height = top - _WHEEL_RADIUS_M
            parts.append(Part(Box((0.05, 0.05, height)), FRAME, (x, y, _WHEEL_RADIUS_M + 0.5 * height)))
            at = (x, y + 0.07 * np.sign(y), _WHEEL_RADIUS_M)
            parts.append(Part(Cylinder(_WHEEL_RADIUS_M, 0.08), RUBBER, at, ALONG_Y))
            parts.append(Part(Cylinder(0.5 * _WHEEL_RADIUS_M, 0.086), WHITE, at, ALONG_Y))
    for x in (-_HALF_LENGTH_M, -0.13, 0.13, _HALF_LENGTH_M):
        parts.append(Part(Box((0.05, 2.0 * _HALF_WIDTH_M, 0.05)), FRAME, (x, 0.0, top)))
    parts.append(Part(Box((0.26, 0.62, 0.20)), WHITE, (-0.44, 0.0, top + 0.13)))
    parts.append(Part(Box((0.20, 0.30, 0.05)), ORANGE, (-0.44, 0.0, top + 0.25)))
    # The front camera on its boom; the case stands above its own viewpoint.
    x, z = parameters.camera_ahead_m, parameters.camera_height_m
    boom = x - _HALF_LENGTH_M + 0.05
    parts.append(Part(Box((0.05, 0.10, 0.04)), BLACK, (x, 0.0, z + 0.024)))
    parts.append(Part(Box((boom, 0.03, 0.03)), ALUMINIUM, (x - 0.5 * boom + 0.02, 0.0, z + 0.06)))
    parts.append(Part(Box((0.03, 0.03, z + 0.075 - top)), ALUMINIUM, (_HALF_LENGTH_M, 0.0, 0.5 * (z + 0.075 + top))))
    return tuple(parts)
