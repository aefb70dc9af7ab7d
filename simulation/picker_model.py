"""The safflower picker's numbers and its URDF, generated from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kernels.config import Config, nested, num
from ..mechanisms import FiveBar
from .friction import below_limit
from .urdf import (
    ALONG_X,
    ALONG_Y,
    ALUMINIUM,
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

PICKER_ASSET = "urdf/picker/picker.urdf"
JOINTS = ("cart", "arm1", "forearm1", "arm2", "forearm2", "slide_u", "slide_v")

DARK = Colour("dark", 0.13, 0.13, 0.15)
FRAME = Colour("frame", 0.24, 0.36, 0.47)
ORANGE = Colour("orange", 0.93, 0.45, 0.08)


# The straddle frame: 1.2 m wide and 1.3 m high (published), 0.9 m long (assumed).
_HALF_LENGTH_M = 0.42
_HALF_WIDTH_M = 0.55
_TOP_M = 1.28
_TUBE_M = 0.04
_WHEEL_RADIUS_M = 0.16
_WHEEL_WIDTH_M = 0.07

_TUBE_X_M = -0.03
_TUBE_LENGTH_M = 0.15
HOSE_RADIUS_M = 0.016
HOSE_INLET_M: Vector = (-0.17, 0.10, _TOP_M + 0.12)
"""Where the suction hose enters the collection box, in the frame's coordinates."""


MOTOR_HEIGHT_M = (0.3, 3.0)
"""Range of the height of the motors' axes."""
_LONGEST_M = 5.0
"""No part of the arm is longer: what is, was given in millimetres."""


@dataclass(frozen=True)
class PickerParameters(Config):
    """Everything that the picker's physics depends on."""

    five_bar: FiveBar = nested(FiveBar.safflower)
    """The arm's geometry [identified, see ``FiveBar.safflower``]."""
    motor_height_m: float = num(1.18, *MOTOR_HEIGHT_M, "m")
    """Motor axes above the ground; the frame is set to the crop before a row [assumed, chosen so that the workspace
    spans the published plant heights of 0.43-0.86 m at their upper end]."""
    camera_ahead_m: float = num(0.30, 0.01, 3.0, "m")
    """The camera's place in front of the arm plane, only for the looks [assumed]."""
    camera_above_motors_m: float = num(0.15, 0.01, 3.0, "m")
    """Height of the camera over the motor axes, only for the looks [assumed]."""
    cart_velocity_m_s: float = num(0.3, 1e-3, 10.0, "m/s")
    """Limit of the cart [assumed]."""
    cart_acceleration_m_s2: float = num(0.5, 1e-3, 100.0, "m/s2")
    """Limit of the cart [assumed]."""
    tool_velocity_m_s: float = num(0.5, 1e-3, 10.0, "m/s")
    """Limit of the tool in the arm's plane: its motors are steppers (published), which run slowly [the figure is
    assumed]."""
    tool_acceleration_m_s2: float = num(2.0, 1e-3, 100.0, "m/s2")
    """Limit of the tool in the arm's plane [assumed, as above]."""
    arm_torque_limit_n_m: float = num(12.0, 1e-3, 1e4, "N m")
    """Each arm motor behind its gear [assumed: a NEMA 23 stepper of 3 N m that keeps 1.2 N m at speed, with a 10:1
    gear]."""
    arm_friction_n_m: float = num(0.0, 0.0, 1e4, "N m")
    """Dry friction of each arm's motor, gear and joints, counted against the motor whichever way it works [assumed]."""
    arm_damping_n_m_s: float = num(0.0, 0.0, 1e3, "N m s/rad")
    """Viscous friction of the same [assumed]."""
    rotor_inertia_kg_m2: float = num(0.008, 1e-6, 10.0, "kg m2")
    """That motor's rotor seen through the gear [assumed: 8e-5 kg m2 times 10^2]."""
    cart_force_limit_n: float = num(250.0, 0.1, 1e5, "N")
    """Thrust of the wheel drives [assumed]."""
    cart_friction_n: float = num(0.0, 0.0, 1e5, "N")
    """Rolling resistance, counted against the thrust [assumed: the thrust is what is left of it]."""
    cart_mass_kg: float = num(80.0, 0.1, 5000.0, "kg")
    """Frame, wheels, battery, fan and cabinet [assumed]."""
    arm_mass_kg: float = num(0.30, 1e-3, 100.0, "kg")
    """One driven arm [assumed: aluminium tube and two bearings]."""
    forearm_mass_kg: float = num(0.35, 1e-3, 100.0, "kg")
    """One forearm [assumed, as above]."""
    tool_mass_kg: float = num(1.5, 1e-3, 100.0, "kg")
    """Platform with the shears, their 25GA-370 geared motor (published) and hose [mass assumed]."""
    physics_hz: float = num(96.0, 30.0, 1e4, "Hz")
    """Simulation steps a second [assumed; the tracking figures are measured with it]."""

    def check(self) -> None:
        """The arm is no house."""
        bar = self.five_bar
        longest = max(*bar.arm_m, *bar.forearm_m, bar.half_platform_m, bar.tool_drop_m, bar.base_m)
        if longest > _LONGEST_M:
            self.refuse("five_bar", f"a part is {longest:g} m long, give at most {_LONGEST_M:g} m")
        below_limit(self, "arm_friction_n_m", "arm_torque_limit_n_m", "N m")
        below_limit(self, "cart_friction_n", "cart_force_limit_n", "N")


def picker_robot(parameters: PickerParameters) -> Robot:
    """The picker as one tree on the cart's rail: frame, two legs of two links, and the platform on its own slides.

    Joint positions are the five-bar's own coordinates: ``cart`` is x along the row, ``arm1`` and ``arm2`` are (q1, q4),
    ``forearm1`` and ``forearm2`` are relative to their arms, ``slide_u`` and ``slide_v`` are the tool centre (u, v).
    The slides are passive; they hold the platform level, as the paper's equations assume. The forearms' tips are free:
    the machine closes them on the platform at run time.
    """
    bar = parameters.five_bar
    plane_y = -0.5 * bar.base_m
    height = parameters.motor_height_m
    links = [
        Link("rail", 1.0, (Part(Box((0.1, 0.1, 0.1)), DARK, visible=False),)),
        Link("frame", parameters.cart_mass_kg, _frame_parts(parameters)),
    ]
    joints = [Joint("cart", "prismatic", "rail", "frame", axis=(1.0, 0.0, 0.0))]
    about_x = (1.0, 0.0, 0.0)
    rotor = parameters.rotor_inertia_kg_m2
    for leg in (0, 1):
        arm, forearm = bar.arm_m[leg], bar.forearm_m[leg]
        names = f"arm{leg + 1}", f"forearm{leg + 1}"
        links.append(Link(names[0], parameters.arm_mass_kg, _bar_parts(arm, 0.0, 0.036, 0.020), (rotor, rotor, rotor)))
        links.append(Link(names[1], parameters.forearm_mass_kg, _bar_parts(forearm, 0.020, 0.026, 0.014)))
        joints.append(
            Joint(names[0], "continuous", "frame", names[0], (0.0, plane_y + leg * bar.base_m, height), axis=about_x)
        )
        joints.append(Joint(names[1], "continuous", names[0], names[1], (0.0, arm, 0.0), axis=about_x))
    # The slide between frame and platform carries no matter of its own: a gram keeps its inertia invertible.
    links.append(Link("slide", 0.001, (Part(Sphere(0.01), STEEL, visible=False),)))
    links.append(Link("platform", parameters.tool_mass_kg, _platform_parts(bar)))
    joints.append(Joint("slide_u", "prismatic", "frame", "slide", (0.0, plane_y, height), axis=(0.0, 1.0, 0.0)))
    joints.append(Joint("slide_v", "prismatic", "slide", "platform"))
    return Robot("safflower_picker", tuple(links), tuple(joints))


def picker_joints(
    parameters: PickerParameters, carts: NDArray[np.float64], tools: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Joint positions (n, 7) in the order of ``JOINTS`` for carts (n,) and tools (n, 2).

    Raises:
        ValueError: a value is not finite.
        UnreachablePoseError: a tool position is beyond the reach of a leg.
    """
    if not np.all(np.isfinite(tools)) or not np.all(np.isfinite(carts)):
        raise ValueError("the trajectory holds a NaN or an infinity: every commanded position must be finite")
    bar = parameters.five_bar
    chains = bar.chains(tools)
    if not np.all(np.isfinite(chains.q)):
        bar.inverse(tools, strict=True)
    forearm = chains.q_passive - chains.q
    columns = [carts, chains.q[:, 0], forearm[:, 0], chains.q[:, 1], forearm[:, 1], tools[:, 0], tools[:, 1]]
    return np.stack(columns, axis=-1)


def hose_outlet_m(bar: FiveBar) -> Vector:
    """Top of the suction tube in the platform's frame, whose origin is the tool centre."""
    return (_TUBE_X_M, 0.0, bar.tool_drop_m + _TUBE_LENGTH_M)


def _bar_parts(length_m: float, x_m: float, width_m: float, depth_m: float) -> tuple[Part, ...]:
    """A flat tube along y with round ends and a pin at each joint."""
    tube = Box((depth_m, length_m, width_m))
    end, pin = Cylinder(0.6 * width_m, depth_m), Cylinder(0.008, 0.05)
    parts = [Part(tube, ALUMINIUM, (x_m, length_m / 2, 0.0))]
    for y in (0.0, length_m):
        parts.append(Part(end, ALUMINIUM, (x_m, y, 0.0), ALONG_X))
        parts.append(Part(pin, STEEL, (x_m - 0.005, y, 0.0), ALONG_X))
    return tuple(parts)


def _platform_parts(bar: FiveBar) -> tuple[Part, ...]:
    """The picking device about the tool centre: platform, shears' housing, flower sleeve and suction tube."""
    level = bar.tool_drop_m
    width = 2.0 * bar.half_platform_m + 0.034
    sleeve = max(0.5 * level, 0.01)
    return (
        Part(Box((0.018, width, 0.030)), ALUMINIUM, (0.0, 0.0, level)),
        Part(Box((0.070, 0.074, max(level - sleeve, 0.01))), ORANGE, (-0.004, 0.0, 0.5 * (level + sleeve) - 0.008)),
        Part(Cylinder(0.027, sleeve), WHITE, (0.0, 0.0, 0.5 * sleeve)),
        Part(Cylinder(0.031, 0.006), ORANGE, (0.0, 0.0, 0.003)),
        # The shears' geared motor lies across in front, the suction tube stands behind the arms' plane.
        Part(Cylinder(0.0125, 0.055), DARK, (0.026, 0.0, level + 0.006), ALONG_Y),
        Part(Cylinder(HOSE_RADIUS_M, _TUBE_LENGTH_M), WHITE, (_TUBE_X_M, 0.0, level + 0.5 * _TUBE_LENGTH_M)),
        Part(Cylinder(0.020, 0.012), DARK, (_TUBE_X_M, 0.0, level + _TUBE_LENGTH_M)),
        Part(Box((0.030, 0.024, 0.014)), WHITE, (-0.018, 0.0, level - 0.006)),
    )


def _frame_parts(parameters: PickerParameters) -> tuple[Part, ...]:
    """The straddle cart: posts, rails, gantry with the motors, wheels, cabinet, collection box, fan and camera."""
    parts: list[Part] = []
    post = Box((_TUBE_M, _TUBE_M, _TOP_M - _WHEEL_RADIUS_M))
    for x in (-_HALF_LENGTH_M, _HALF_LENGTH_M):
        for y in (-_HALF_WIDTH_M, _HALF_WIDTH_M):
            parts.append(Part(post, FRAME, (x, y, 0.5 * (_TOP_M + _WHEEL_RADIUS_M))))
            outwards = np.copysign(0.009, y)
            wheel_at = (0.88 * x, y + outwards, _WHEEL_RADIUS_M)
            parts.append(Part(Cylinder(_WHEEL_RADIUS_M, _WHEEL_WIDTH_M), RUBBER, wheel_at, ALONG_Y))
            parts.append(Part(Cylinder(0.55 * _WHEEL_RADIUS_M, _WHEEL_WIDTH_M + 0.006), WHITE, wheel_at, ALONG_Y))
            parts.append(Part(Cylinder(0.030, _WHEEL_WIDTH_M + 0.012), DARK, wheel_at, ALONG_Y))
        parts.append(Part(Box((_TUBE_M, 2.0 * _HALF_WIDTH_M, _TUBE_M)), FRAME, (x, 0.0, _TOP_M)))
    along = Box((2.0 * _HALF_LENGTH_M, _TUBE_M, _TUBE_M))
    for y in (-_HALF_WIDTH_M, _HALF_WIDTH_M):
        for z in (2.0 * _WHEEL_RADIUS_M + 0.04, parameters.motor_height_m, _TOP_M):
            parts.append(Part(along, FRAME, (0.0, y, z)))
    return (*parts, *_gantry_parts(parameters), *_equipment_parts(parameters))


def _gantry_parts(parameters: PickerParameters) -> list[Part]:
    bar, height = parameters.five_bar, parameters.motor_height_m
    parts = [Part(Box((0.04, 2.0 * _HALF_WIDTH_M, 0.06)), ALUMINIUM, (-0.125, 0.0, height))]
    for y in (-0.5 * bar.base_m, 0.5 * bar.base_m):
        parts.append(Part(Box((0.012, 0.085, 0.085)), ALUMINIUM, (-0.030, y, height)))
        parts.append(Part(Box((0.075, 0.060, 0.060)), DARK, (-0.072, y, height)))
        parts.append(Part(Cylinder(0.022, 0.016), STEEL, (-0.016, y, height), ALONG_X))
    return parts


def _equipment_parts(parameters: PickerParameters) -> list[Part]:
    x, z = parameters.camera_ahead_m, parameters.motor_height_m + parameters.camera_above_motors_m
    front = max(_HALF_LENGTH_M, x)
    return [
        # The camera sits above its own viewpoint, so that its case never stands in its view.
        Part(Box((0.028, 0.095, 0.026)), DARK, (x, 0.0, z + 0.016)),
        Part(Box((front - x + 0.02, 0.03, 0.012)), ALUMINIUM, (0.5 * (front + x) + 0.01, 0.0, z + 0.035)),
        Part(Box((0.02, 0.03, max(z + 0.041 - _TOP_M, 0.01))), ALUMINIUM, (front, 0.0, 0.5 * (z + 0.041 + _TOP_M))),
        # Rear: control cabinet on one side, suction fan and collection box in the middle.
        Part(Box((0.20, 0.24, 0.30)), WHITE, (-0.40, -0.40, _TOP_M - 0.17)),
        Part(Box((0.24, 0.26, 0.20)), ORANGE, (-0.34, 0.10, _TOP_M + 0.12)),
        Part(Cylinder(0.075, 0.10), DARK, (-0.34, 0.30, _TOP_M + 0.10), ALONG_Y),
        Part(Cylinder(0.022, 0.06), DARK, (HOSE_INLET_M[0] - 0.03, *HOSE_INLET_M[1:]), ALONG_X),
        Part(Box((0.26, 0.50, 0.012)), ALUMINIUM, (-0.34, 0.16, _TOP_M + 0.018)),
    ]
