"""The laser weeder's numbers and its URDF, generated from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kernels.config import Config, nested, num
from ..mechanisms import ThreeUPSRPU
from .friction import below_limit
from .urdf import (
    ALONG_Y,
    ALUMINIUM,
    BLACK,
    RUBBER,
    STEEL,
    WHITE,
    Box,
    Colour,
    Cylinder,
    Joint,
    Link,
    Part,
    Robot,
    Sphere,
    Vector,
)

WEEDER_ASSET = "urdf/weeder/weeder.urdf"
JOINTS = ("cart", *(f"{kind}{leg}" for leg in (1, 2, 3) for kind in ("swing", "tilt", "leg")), "swing4", "leg4")
JOINTS = (*JOINTS, "nod", "roll")

FRAME = Colour("frame", 0.62, 0.13, 0.11)
LASER = Colour("laser", 0.20, 0.22, 0.26)
YELLOW = Colour("yellow", 0.95, 0.75, 0.10)

_FLIP: Vector = (np.pi, 0.0, 0.0)
"""The mechanism hangs: its Z points down, its X along the direction of travel."""

_HALF_LENGTH_M = 0.75
_HALF_WIDTH_M = 0.66
_WHEEL_RADIUS_M = 0.28
_CYLINDER_M = 0.36


@dataclass(frozen=True)
class WeederParameters(Config):
    """Everything that the weeder's physics depends on; masses, forces and rates are assumed."""

    mechanism: ThreeUPSRPU = nested(ThreeUPSRPU.weeder)
    """The platform's geometry (published radii, synthesised layout)."""
    base_height_m: float = num(1.45, 0.2, 5.0, "m")
    """Mechanism's base over the ground."""
    platform_mass_kg: float = num(5.0, 0.01, 500.0, "kg")
    """Platform with laser head, its optics and the tool camera."""
    cylinder_mass_kg: float = num(1.5, 0.01, 100.0, "kg")
    """Upper part of a leg."""
    rod_mass_kg: float = num(0.6, 0.01, 100.0, "kg")
    """Lower part of a leg."""
    leg_force_limit_n: float = num(600.0, 1.0, 1e5, "N")
    """Each of the four actuators."""
    leg_friction_n: float = num(0.0, 0.0, 1e5, "N")
    """Dry friction of each actuator, counted against it whichever way it works."""
    leg_damping_n_s_m: float = num(0.0, 0.0, 1e5, "N s/m")
    """Viscous friction of the same."""
    cart_mass_kg: float = num(250.0, 1.0, 10_000.0, "kg")
    """Frame, wheels, laser source, cooler and batteries."""
    cart_force_limit_n: float = num(1500.0, 1.0, 1e6, "N")
    """Thrust of the wheel drives."""
    cart_friction_n: float = num(0.0, 0.0, 1e6, "N")
    """Rolling resistance, counted against the thrust."""
    camera_ahead_m: float = num(0.85, 0.0, 5.0, "m")
    """Front camera in front of the mechanism, only for the looks."""
    camera_height_m: float = num(0.85, 0.05, 5.0, "m")
    """Its height over the ground, only for the looks."""
    physics_hz: float = num(240.0, 30.0, 100_000.0, "1/s")
    """Simulation steps a second."""

    def check(self) -> None:
        """No motor is held by its own friction."""
        below_limit(self, "leg_friction_n", "leg_force_limit_n", "N")
        below_limit(self, "cart_friction_n", "cart_force_limit_n", "N")


def weeder_robot(parameters: WeederParameters) -> Robot:
    """The weeder as one tree on the cart's way: frame, three UPS legs and the RPU leg that carries the platform.

    Joints, in order: ``cart``; for the UPS legs i = 1..3 ``swing{i}`` about the mechanism's X, ``tilt{i}`` about Y and
    ``leg{i}``, the length; for the RPU leg ``swing4`` about Y, ``leg4``, ``nod`` about Y and ``roll`` about the
    platform's X. The rods' tips 1..3 are free: the machine closes them on the platform at run time.
    """
    at = parameters.mechanism.attachments
    links = [
        Link("way", 1.0, (Part(Box((0.1, 0.1, 0.1)), BLACK, visible=False),)),
        Link("frame", parameters.cart_mass_kg, _frame_parts(parameters)),
        Link("base", 1.0, _base_parts(at.base)),
    ]
    joints = [
        Joint("cart", "prismatic", "way", "frame", axis=(1.0, 0.0, 0.0)),
        Joint("hang", "fixed", "frame", "base", (0.0, 0.0, parameters.base_height_m), _FLIP),
    ]
    x, y, z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    cross = (Part(Sphere(0.022), STEEL),)
    for leg in (1, 2, 3, 4):
        anchor = tuple(float(v) for v in at.base[leg - 1])
        upper, lower = f"cylinder{leg}", f"rod{leg}"
        if leg < 4:
            links.append(Link(f"cross{leg}", 0.15, cross))
            joints.append(Joint(f"swing{leg}", "continuous", "base", f"cross{leg}", anchor, axis=x))  # type: ignore[arg-type]
            joints.append(Joint(f"tilt{leg}", "continuous", f"cross{leg}", upper, axis=y))
        else:
            joints.append(Joint("swing4", "continuous", "base", upper, anchor, axis=y))  # type: ignore[arg-type]
        links.append(Link(upper, parameters.cylinder_mass_kg, _cylinder_parts()))
        links.append(Link(lower, parameters.rod_mass_kg, _rod_parts()))
        joints.append(Joint(f"leg{leg}", "prismatic", upper, lower, axis=z))
    links.append(Link("cross4", 0.15, cross))
    links.append(Link("platform", parameters.platform_mass_kg, _platform_parts(at.platform)))
    joints.append(Joint("nod", "continuous", "rod4", "cross4", axis=y))
    joints.append(Joint("roll", "continuous", "cross4", "platform", (-float(at.platform[3, 0]), 0.0, 0.0), axis=x))
    # A link comes before its joint's child only if the joints lead from the base out: sort links by their joints.
    order = ["way", *(joint.child for joint in joints)]
    return Robot("laser_weeder", tuple(sorted(links, key=lambda link: order.index(link.name))), tuple(joints))


def weeder_joints(
    parameters: WeederParameters, carts: NDArray[np.float64], poses: NDArray[np.float64]
) -> NDArray[np.float64]:
    """All joint positions (n, 14) in the order of ``JOINTS`` for carts (n,) and poses (n, 4) of the mechanism.

    Raises:
        ValueError: a value is not finite.
    """
    if not np.all(np.isfinite(poses)) or not np.all(np.isfinite(carts)):
        raise ValueError("the trajectory holds a NaN or an infinity: every commanded position must be finite")
    mechanism = parameters.mechanism
    chains = mechanism.chains(poses)
    columns = [carts]
    for leg in range(3):
        n = chains.direction[:, leg]
        columns += [np.arctan2(-n[:, 1], n[:, 2]), np.arcsin(n[:, 0]), chains.length[:, leg]]
    angles = mechanism.rpu_angles(poses)
    columns += [angles[:, 0], chains.length[:, 3], angles[:, 1], angles[:, 2]]
    return np.stack(columns, axis=-1)


def _cylinder_parts() -> tuple[Part, ...]:
    """The actuator's housing, from the joint down the leg; the motor sits beside it."""
    return (
        Part(Cylinder(0.028, _CYLINDER_M), ALUMINIUM, (0.0, 0.0, 0.5 * _CYLINDER_M)),
        Part(Cylinder(0.031, 0.03), BLACK, (0.0, 0.0, _CYLINDER_M)),
        Part(Cylinder(0.020, 0.14), BLACK, (0.0, 0.045, 0.12)),
    )


def _rod_parts() -> tuple[Part, ...]:
    """The rod: its frame is the lower joint."""
    return (Part(Cylinder(0.014, 0.42), STEEL, (0.0, 0.0, -0.21)), Part(Sphere(0.022), STEEL))


def _platform_parts(joints: np.ndarray) -> tuple[Part, ...]:
    """Ring with its four joints, laser head and tool camera below; the platform's Z is the beam."""
    parts = [Part(Cylinder(0.085, 0.012), ALUMINIUM), Part(Cylinder(0.12, 0.006), FRAME, (0.0, 0.0, -0.006))]
    for joint in joints:
        reach = float(np.hypot(joint[0], joint[1]))
        turn = float(np.arctan2(joint[1], joint[0]))
        middle = (0.5 * float(joint[0]), 0.5 * float(joint[1]), 0.0)
        parts.append(Part(Box((reach, 0.035, 0.010)), ALUMINIUM, middle, (0.0, 0.0, turn)))
        parts.append(Part(Cylinder(0.024, 0.024), BLACK, (float(joint[0]), float(joint[1]), 0.0)))
    parts.append(Part(Box((0.07, 0.07, 0.12)), LASER, (0.0, 0.0, 0.05)))
    parts.append(Part(Cylinder(0.018, 0.06), YELLOW, (0.0, 0.0, 0.13)))
    parts.append(Part(Box((0.035, 0.05, 0.05)), BLACK, (0.065, 0.0, 0.06)))
    parts.append(Part(Cylinder(0.014, 0.03), WHITE, (0.065, 0.0, 0.095)))
    return tuple(parts)


def _base_parts(joints: np.ndarray) -> tuple[Part, ...]:
    """Four joints' brackets under the frame's deck."""
    parts = [Part(Box((0.06, 0.06, 0.03)), BLACK, (float(j[0]), float(j[1]), -0.012)) for j in joints]
    return tuple(parts)


def _frame_parts(parameters: WeederParameters) -> tuple[Part, ...]:
    """A portal cart over the row: deck with the base's ring, legs and wheels, laser source, cooler, front camera."""
    top = parameters.base_height_m + 0.045
    parts: list[Part] = []
    for y in (-_HALF_WIDTH_M, _HALF_WIDTH_M):
        parts.append(Part(Box((2.0 * _HALF_LENGTH_M, 0.06, 0.06)), FRAME, (0.0, y, top)))
        parts.append(Part(Box((2.0 * _HALF_LENGTH_M, 0.05, 0.05)), FRAME, (0.0, y, 2.0 * _WHEEL_RADIUS_M + 0.08)))
        for x in (-_HALF_LENGTH_M, _HALF_LENGTH_M):
            height = top - _WHEEL_RADIUS_M
            parts.append(Part(Box((0.06, 0.06, height)), FRAME, (x, y, _WHEEL_RADIUS_M + 0.5 * height)))
            at = (0.9 * x, y, _WHEEL_RADIUS_M)
            parts.append(Part(Cylinder(_WHEEL_RADIUS_M, 0.09), RUBBER, at, ALONG_Y))
            parts.append(Part(Cylinder(0.5 * _WHEEL_RADIUS_M, 0.096), WHITE, at, ALONG_Y))
    for x in (-_HALF_LENGTH_M, -0.44, 0.44, _HALF_LENGTH_M):
        parts.append(Part(Box((0.06, 2.0 * _HALF_WIDTH_M, 0.06)), FRAME, (x, 0.0, top)))
    for y in (-0.36, 0.0, 0.36):
        parts.append(Part(Box((0.94, 0.05, 0.04)), FRAME, (0.0, y, top)))
    # Behind: laser source, cooler and batteries.
    parts.append(Part(Box((0.30, 0.50, 0.28)), WHITE, (-0.60, -0.30, top + 0.17)))
    parts.append(Part(Box((0.28, 0.36, 0.22)), YELLOW, (-0.60, 0.32, top + 0.14)))
    parts.append(Part(Cylinder(0.09, 0.02), BLACK, (-0.60, 0.32, top + 0.26)))
    # In front: the camera on its boom; the case stands above its own viewpoint.
    x, z = parameters.camera_ahead_m, parameters.camera_height_m
    parts.append(Part(Box((0.05, 0.10, 0.04)), BLACK, (x, 0.0, z + 0.024)))
    parts.append(Part(Box((0.03, 0.03, top - z)), ALUMINIUM, (x + 0.03, 0.0, 0.5 * (top + z) + 0.03)))
    parts.append(Part(Box((x - _HALF_LENGTH_M + 0.08, 0.03, 0.03)), ALUMINIUM, (0.5 * (x + _HALF_LENGTH_M), 0.0, top)))
    return tuple(parts)
