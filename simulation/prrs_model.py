"""What every machine made of the 3-PRRS has in common: its numbers and the URDF of a leg."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..kernels.config import Config, nested, num
from ..mechanisms import ThreePRRS
from .friction import below_limit
from .urdf import ALONG_X, ALONG_Y, Box, Colour, Cylinder, Joint, Link, Part, Robot, Sphere


@dataclass(frozen=True)
class PrrsParameters(Config):
    """Geometry, limits and masses; forces, masses and rates are assumed."""

    mechanism: ThreePRRS = nested(ThreePRRS.sorter)
    """The 3-PRRS."""
    tool_m: float = num(0.090, 1e-3, 1.0, "m")
    """From the tool's working point up to the platform's centre P."""
    velocity_m_s: float = num(1.0, 1e-3, 20.0, "m/s")
    """Limit of the platform's centre."""
    acceleration_m_s2: float = num(10.0, 1e-2, 500.0, "m/s2")
    """Limit of the platform's centre, without what following a belt or a plant adds."""
    turn_rad_s: float = num(4.0, 1e-3, 100.0, "rad/s")
    """Limit of the platform's angular velocity."""
    turn_rad_s2: float = num(40.0, 1e-2, 5000.0, "rad/s2")
    """Limit of its angular acceleration."""
    slider_force_limit_n: float = num(120.0, 1e-3, 1e5, "N")
    """Each slider's ball screw."""
    swing_torque_limit_n_m: float = num(10.0, 1e-3, 1e4, "N m")
    """Each driven rotation behind its gear."""
    slider_friction_n: float = num(0.0, 0.0, 1e5, "N")
    """Dry friction of each slider, counted against its motor whichever way it works."""
    slider_damping_n_s_m: float = num(0.0, 0.0, 1e5, "N s/m")
    """Viscous friction of the same."""
    swing_friction_n_m: float = num(0.0, 0.0, 1e4, "N m")
    """Dry friction of each driven rotation, likewise."""
    swing_damping_n_m_s: float = num(0.0, 0.0, 1e3, "N m s/rad")
    """Viscous friction of the same."""
    slider_mass_kg: float = num(1.6, 1e-3, 100.0, "kg")
    """Carriage with the rotary motor that it carries."""
    yoke_mass_kg: float = num(0.25, 1e-3, 100.0, "kg")
    """Fork of R1 and R2."""
    rotor_inertia_kg_m2: float = num(0.004, 1e-7, 10.0, "kg m2")
    """That motor's rotor seen through the gear."""
    link_mass_kg: float = num(0.20, 1e-3, 100.0, "kg")
    """One link with its joints (carbon tube)."""
    platform_mass_kg: float = num(0.9, 1e-3, 100.0, "kg")
    """Platform and tool."""
    physics_hz: float = num(240.0, 30.0, 100_000.0, "1/s")
    """Simulation steps a second (the tracking figures are measured with it)."""

    name = "prrs"
    """Of the machine; its URDFs and their folder bear it."""

    def check(self) -> None:
        """The mechanism's lengths are in metres."""
        mechanism = self.mechanism
        for name in ("link_m", "base_diameter_m", "platform_diameter_m"):
            if not 0.01 <= getattr(mechanism, name) <= 3.0:
                self.refuse(f"mechanism.{name}", "give a number in [0.01, 3] m")
        if max(map(abs, mechanism.slider_range_m)) > 3.0:
            self.refuse("mechanism.slider_range_m", "give numbers in [-3, 3] m")
        below_limit(self, "slider_friction_n", "slider_force_limit_n", "N")
        below_limit(self, "swing_friction_n_m", "swing_torque_limit_n_m", "N m")

    @property
    def origin_height_m(self) -> float:
        """World height of the mechanism's z = 0."""
        raise NotImplementedError

    def platform_robot(self) -> Robot:
        """The free platform with its tool; the origin is the platform's centre P."""
        raise NotImplementedError

    def assets(self) -> dict[str, str]:
        """Text of the three legs' and the platform's URDF, by path below ``assets/``."""
        robots = [*(leg_robot(self, leg) for leg in (1, 2, 3)), self.platform_robot()]
        names = [*(f"leg{leg}" for leg in (1, 2, 3)), "platform"]
        return {f"urdf/{self.name}/{name}.urdf": robot.to_xml() for name, robot in zip(names, robots, strict=True)}


ALUMINIUM = Colour("aluminium", 0.76, 0.78, 0.81)
CARBON = Colour("carbon", 0.12, 0.12, 0.13)
BLUE = Colour("blue", 0.16, 0.34, 0.62)
ORANGE = Colour("orange", 0.95, 0.48, 0.10)
STEEL = Colour("steel", 0.50, 0.52, 0.55)

COLUMN_RADIUS_M = 0.046
"""Half width of the hanging column that carries the guide rails."""
GANTRY_LEVEL_M = 0.66
"""Underside of the gantry in the mechanism's coordinates."""
_CARRIAGE_UP_M = 0.085
"""Middle of the carriage above the joint centre G that it carries on an arm."""
_JOINT_M = 0.016


def hub_parts(parameters: PrrsParameters) -> list[Part]:
    """The platform itself, without a tool: a plate, three arms and the sockets of the spherical joints."""
    radius = 0.5 * parameters.mechanism.platform_diameter_m
    parts = [Part(Cylinder(0.62 * radius, 0.010), ALUMINIUM, (0.0, 0.0, -0.006))]
    for k in range(3):
        angle = 2.0 * np.pi * k / 3.0
        c, s = float(np.cos(angle)), float(np.sin(angle))
        parts.append(
            Part(Box((radius, 0.028, 0.010)), BLUE, (0.5 * radius * c, 0.5 * radius * s, -0.006), (0.0, 0.0, angle))
        )
        parts.append(Part(Cylinder(0.015, 0.014), ALUMINIUM, (radius * c, radius * s, -0.014)))
    return parts


def leg_robot(parameters: PrrsParameters, leg: int) -> Robot:
    """Leg ``leg`` (1..3) in its own frame: x outwards, y tangential, z up, origin on the machine's axis at z = 0.

    Joint positions are the mechanism's own: ``slider`` is L, ``drive`` is theta about the outward axis, ``swing`` the
    angle of the link from straight down towards outside. The link's tip is free: the machine closes it on the
    platform at run time.
    """
    mechanism = parameters.mechanism
    radius, low = 0.5 * mechanism.base_diameter_m, mechanism.slider_range_m[0]
    foot = low + _CARRIAGE_UP_M - 0.045
    length = GANTRY_LEVEL_M - foot
    rail_at = COLUMN_RADIUS_M * 0.5
    rail = Link(
        f"rail{leg}",
        5.0,
        (
            Part(Box((0.030, 0.052, length)), ALUMINIUM, (0.5 * rail_at, 0.0, foot + 0.5 * length)),
            Part(Box((0.010, 0.016, length)), STEEL, (rail_at + 0.008, 0.0, foot + 0.5 * length)),
            Part(Cylinder(0.006, length), STEEL, (rail_at + 0.008, 0.019, foot + 0.5 * length)),
        ),
    )
    inwards = radius - rail_at - 0.020
    slider = Link(
        f"slider{leg}",
        parameters.slider_mass_kg,
        (
            Part(Box((0.022, 0.046, 0.070)), BLUE, (-inwards, 0.0, _CARRIAGE_UP_M)),
            Part(Box((0.016, 0.030, _CARRIAGE_UP_M)), ALUMINIUM, (-inwards, 0.0, 0.5 * _CARRIAGE_UP_M)),
            # The rotary motor lies along the outward axis of R1, its gear in front of the fork.
            Part(Cylinder(0.017, 0.034), CARBON, (-inwards + 0.004, 0.0, 0.0), ALONG_X),
        ),
    )
    rotor = parameters.rotor_inertia_kg_m2
    yoke = Link(
        f"yoke{leg}",
        parameters.yoke_mass_kg,
        (
            Part(Cylinder(0.010, 0.030), STEEL, (-0.018, 0.0, 0.0), ALONG_X),
            Part(Box((0.024, 0.008, 0.026)), ALUMINIUM, (-0.002, -_JOINT_M, 0.0)),
            Part(Box((0.024, 0.008, 0.026)), ALUMINIUM, (-0.002, _JOINT_M, 0.0)),
            Part(Cylinder(0.005, 2.6 * _JOINT_M), STEEL, (0.0, 0.0, 0.0), ALONG_Y),
        ),
        (rotor, rotor, rotor),
    )
    length_m = mechanism.link_m
    link = Link(
        f"link{leg}",
        parameters.link_mass_kg,
        (
            Part(Cylinder(0.0095, length_m - 0.030), CARBON, (0.0, 0.0, -0.5 * length_m)),
            Part(Cylinder(0.013, 0.034), ORANGE, (0.0, 0.0, -0.022)),
            Part(Cylinder(0.013, 0.026), ORANGE, (0.0, 0.0, 0.026 - length_m)),
            Part(Sphere(0.0125), STEEL, (0.0, 0.0, -length_m)),
        ),
    )
    names = [part.name for part in (rail, slider, yoke, link)]
    joints = (
        Joint(f"slider{leg}", "prismatic", names[0], names[1], (radius, 0.0, 0.0)),
        Joint(f"drive{leg}", "continuous", names[1], names[2], axis=(1.0, 0.0, 0.0)),
        Joint(f"swing{leg}", "continuous", names[2], names[3], axis=(0.0, -1.0, 0.0)),
    )
    return Robot(f"{parameters.name}_leg{leg}", (rail, slider, yoke, link), joints)
