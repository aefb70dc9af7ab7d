"""The tray transplanter's numbers and its URDFs, generated from them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..kernels.config import Config, nested, num
from ..mechanisms import TranslationalFiveBar
from .friction import below_limit
from .picker_model import DARK, FRAME, ORANGE
from .urdf import ALONG_X, ALUMINIUM, STEEL, Box, Cylinder, Joint, Link, Part, Robot, Sphere

PHYSICS_ASSET = "urdf/transplanter/transplanter.urdf"
JOINTS = ("arm1", "forearm1", "arm2", "forearm2", "slide_u", "slide_v")
LOOKS = ("arm_bar1", "bracket1", "forearm_bar1", "arm_bar2", "bracket2", "forearm_bar2", "needles1", "needles2")
"""Joints that only a machine with looks has."""


_BAR_WIDTH_M, _BAR_DEPTH_M = 0.034, 0.022
_FOREARM_WIDTH_M = 0.020
_ARM_CHAIN_M = (0.0, 0.060)
"""From the driven arm's pins to the pins of the parallel bar beside it (outwards, up): the first parallelogram."""
_FOREARM_CHAIN_M = (0.055, 0.0)
"""From the forearm's pins to those of its parallel bar (outwards, up): the second parallelogram."""
FINGER_STROKE_M = 0.006
_POST_X_M, _HALF_SPAN_M = -0.10, 0.62


@dataclass(frozen=True)
class TransplanterParameters(Config):
    """Everything that the transplanter's physics and looks depend on."""

    arm: TranslationalFiveBar = nested(TranslationalFiveBar.transplanter)
    """Geometry and masses [assumed but for the window, see TranslationalFiveBar.transplanter]."""
    motor_height_m: float = num(1.690, 0.1, 5.0, "m")
    """Motor axes above the ground [assumed: conveyors at working height]."""
    half_platform_m: float = num(0.045, 0.001, 0.5, "m")
    """Half the distance of the wrists on the platform; the motors stand as much farther out than the mechanism's offset
    [assumed]."""
    gripper_drop_m: float = num(0.250, 0.110, 2.0, "m")
    """Needle tips below the wrists [assumed]."""
    torque_limit_n_m: float = num(90.0, 0.1, 1e4, "N m")
    """Each motor behind its gear [assumed: 1.6 times the 56 N m that the fastest gate with the published payload
    needs]."""
    friction_n_m: float = num(0.0, 0.0, 1e4, "N m")
    """Dry friction of each motor, gear and joints, counted against the motor whichever way it works [assumed]."""
    damping_n_m_s: float = num(0.0, 0.0, 1e3, "N m s/rad")
    """Viscous friction of the same [assumed]."""
    physics_hz: float = num(500.0, 50.0, 1e4, "Hz")
    """Simulation steps a second [assumed; the tracking figures are measured with it]."""

    def check(self) -> None:
        """The arm has masses."""
        if self.arm.masses is None:
            self.refuse("arm.masses", "give LinkMasses(...), or use TranslationalFiveBar.transplanter()")
        below_limit(self, "friction_n_m", "torque_limit_n_m", "N m")


def transplanter_robot(parameters: TransplanterParameters, *, looks: bool = False) -> Robot:
    """The transplanter as one tree on its fixed frame: two legs of two links, and the platform on its own slides.

    Joint positions are the mechanism's own coordinates: ``arm1`` and ``arm2`` are (theta1, theta2), ``forearm1`` and
    ``forearm2`` are relative to their arms, ``slide_u`` and ``slide_v`` are the tool (x, y) of the mechanism, which is
    (y, z) of the world. The slides are passive and stand for the parallelograms: they hold the platform level. The
    forearms' tips are free; the machine closes them on the platform at run time.

    Args:
        parameters: the machine's numbers.
        looks: add the parallelograms' bars and brackets and the gripper's needles as links of their own. They carry no
            load: a machine of this kind is only placed, never stepped.
    """
    arm, height = parameters.arm, parameters.motor_height_m
    masses = arm.masses
    assert masses is not None
    about_x = (1.0, 0.0, 0.0)
    rotor = masses.rotor_inertia_kg_m2
    links = [Link("frame", 100.0, _frame_parts(parameters))]
    joints: list[Joint] = []
    for leg, side in ((1, 1.0), (2, -1.0)):
        motor_y = side * (arm.motor_offset_m + parameters.half_platform_m)
        names = f"arm{leg}", f"forearm{leg}"
        # Bar and bracket make one body of even density here: the ball has the bracket's share of the volume.
        bar = Box((_BAR_DEPTH_M, arm.arm_m, _BAR_WIDTH_M))
        ball = Sphere(float(np.cbrt(0.75 / np.pi * bar.volume_m3 * masses.elbow_kg / masses.arm_kg)))
        arm_parts = (Part(bar, ORANGE, (0.0, 0.5 * arm.arm_m, 0.0)), Part(ball, DARK, (0.0, arm.arm_m, 0.0)))
        forearm = Box((0.014, arm.forearm_m, _FOREARM_WIDTH_M))
        links.append(Link(names[0], masses.arm_kg + masses.elbow_kg, arm_parts, (rotor, rotor, rotor)))
        links.append(Link(names[1], masses.forearm_kg, (Part(forearm, ALUMINIUM, (0.020, 0.5 * arm.forearm_m, 0.0)),)))
        joints.append(Joint(names[0], "continuous", "frame", names[0], (0.0, motor_y, height), axis=about_x))
        joints.append(Joint(names[1], "continuous", names[0], names[1], (0.0, arm.arm_m, 0.0), axis=about_x))
        if looks:
            _add_chain(links, joints, parameters, leg, side)
    # The slide between frame and platform carries no matter of its own: a gram keeps its inertia invertible.
    links.append(Link("slide", 0.001, (Part(Sphere(0.01), STEEL, visible=False),)))
    links.append(Link("platform", masses.platform_kg, _platform_parts(parameters)))
    joints.append(Joint("slide_u", "prismatic", "frame", "slide", (0.0, 0.0, height), axis=(0.0, 1.0, 0.0)))
    joints.append(Joint("slide_v", "prismatic", "slide", "platform"))
    if looks:
        _add_needles(links, joints, parameters)
    return Robot("tray_transplanter", tuple(links), tuple(joints))


def transplanter_joints(parameters: TransplanterParameters, tools: NDArray[np.float64]) -> NDArray[np.float64]:
    """Joint positions (n, 6) in the order of ``JOINTS`` for tools (n, 2).

    Raises:
        ValueError: a value is not finite.
        UnreachablePoseError: a tool position is beyond the reach of a leg.
    """
    if not np.all(np.isfinite(tools)):
        raise ValueError("the trajectory holds a NaN or an infinity: every commanded position must be finite")
    arm = parameters.arm
    angles = arm.inverse(tools)
    if not np.all(np.isfinite(angles)):
        arm.inverse(tools, strict=True)
    motors = np.array([arm.motor_offset_m, -arm.motor_offset_m])
    across = tools[:, :1] - motors - arm.arm_m * np.cos(angles)
    forearm = np.arctan2(tools[:, 1:] - arm.arm_m * np.sin(angles), across)
    # Any whole turn would do; the nearest keeps the angle continuous along a trajectory.
    bend = np.mod(forearm - angles + np.pi, 2.0 * np.pi) - np.pi
    return np.column_stack([angles[:, 0], bend[:, 0], angles[:, 1], bend[:, 1], tools])


def looks_joints(joints: NDArray[np.float64], opening: float) -> dict[str, float]:
    """Positions by name of all joints of a machine with looks, from those (6,) of ``JOINTS``.

    Args:
        joints: as ``transplanter_joints`` gives them.
        opening: of the gripper's needles, 0 closed, 1 open.
    """
    arm1, forearm1, arm2, forearm2 = joints[:4]
    chain = [arm1, -arm1, arm1 + forearm1, arm2, -arm2, arm2 + forearm2]
    return dict(zip(JOINTS + LOOKS, [*joints, *chain, *[FINGER_STROKE_M * opening] * 2], strict=True))


def _add_chain(
    links: list[Link], joints: list[Joint], parameters: TransplanterParameters, leg: int, side: float
) -> None:
    """Parallel bars of a leg and the elbow bracket between them, each with its own joint."""
    arm = parameters.arm
    about_x = (1.0, 0.0, 0.0)
    out, up = side * _ARM_CHAIN_M[0], _ARM_CHAIN_M[1]
    beyond = side * _FOREARM_CHAIN_M[0], _FOREARM_CHAIN_M[1]
    motor_y = side * (arm.motor_offset_m + parameters.half_platform_m)
    thin = Box((0.012, arm.arm_m, 0.016))
    links.append(Link(f"arm_bar{leg}", 0.1, (Part(thin, STEEL, (-0.016, 0.5 * arm.arm_m, 0.0)),)))
    joints.append(
        Joint(
            f"arm_bar{leg}",
            "continuous",
            "frame",
            f"arm_bar{leg}",
            (0.0, motor_y + out, parameters.motor_height_m + up),
            axis=about_x,
        )
    )
    width, height = abs(beyond[0]) + 0.024, abs(up) + 0.024
    bracket = (
        Part(Box((0.008, 0.026, height)), DARK, (0.014, 0.5 * out, 0.5 * up)),
        Part(Box((0.008, width, 0.026)), DARK, (0.014, 0.5 * beyond[0], 0.5 * beyond[1])),
        Part(Cylinder(0.010, 0.050), STEEL, (0.0, 0.0, 0.0), ALONG_X),
    )
    links.append(Link(f"bracket{leg}", 0.1, bracket))
    joints.append(
        Joint(f"bracket{leg}", "continuous", f"arm{leg}", f"bracket{leg}", (0.0, arm.arm_m, 0.0), axis=about_x)
    )
    rod = Box((0.010, arm.forearm_m, 0.012))
    links.append(Link(f"forearm_bar{leg}", 0.1, (Part(rod, STEEL, (0.024, 0.5 * arm.forearm_m, 0.0)),)))
    joints.append(
        Joint(f"forearm_bar{leg}", "continuous", f"bracket{leg}", f"forearm_bar{leg}", (0.0, *beyond), axis=about_x)
    )


def _add_needles(links: list[Link], joints: list[Joint], parameters: TransplanterParameters) -> None:
    """Two pairs of needles that close towards each other."""
    tip = -parameters.gripper_drop_m
    for number, side in ((1, 1.0), (2, -1.0)):
        needles = tuple(
            Part(Box((0.003, 0.003, 0.085)), STEEL, (x, side * 0.010, tip + 0.0425)) for x in (-0.006, 0.006)
        )
        holder = Part(Box((0.026, 0.008, 0.020)), ALUMINIUM, (0.0, side * 0.010, tip + 0.090))
        links.append(Link(f"needles{number}", 0.02, (*needles, holder)))
        joints.append(Joint(f"needles{number}", "prismatic", "platform", f"needles{number}", axis=(0.0, side, 0.0)))


def _platform_parts(parameters: TransplanterParameters) -> tuple[Part, ...]:
    """Platform between the wrists, the gripper's stem and its pneumatic cylinder."""
    half, drop = parameters.half_platform_m, parameters.gripper_drop_m
    width = 2.0 * (half + _FOREARM_CHAIN_M[0]) + 0.03
    stem = drop - 0.100
    return (
        Part(Box((0.030, width, 0.018)), ALUMINIUM, (0.010, 0.0, 0.0)),
        Part(Cylinder(0.014, stem), DARK, (0.0, 0.0, -0.5 * stem)),
        Part(Box((0.030, 0.046, 0.022)), ORANGE, (0.0, 0.0, -stem)),
    )


def _frame_parts(parameters: TransplanterParameters) -> tuple[Part, ...]:
    """The portal that carries the motors over the conveyors."""
    arm, height = parameters.arm, parameters.motor_height_m
    top = height + 0.03
    parts = [
        Part(Box((0.06, 2.0 * _HALF_SPAN_M, 0.10)), FRAME, (_POST_X_M, 0.0, top)),
        Part(Box((0.05, 2.0 * _HALF_SPAN_M, 0.05)), FRAME, (_POST_X_M, 0.0, 0.12)),
    ]
    for y in (-_HALF_SPAN_M, _HALF_SPAN_M):
        parts.append(Part(Box((0.06, 0.06, top)), FRAME, (_POST_X_M, y, 0.5 * top)))
        parts.append(Part(Box((0.60, 0.06, 0.04)), FRAME, (_POST_X_M, y, 0.02)))
    for side in (-1.0, 1.0):
        y = side * (arm.motor_offset_m + parameters.half_platform_m)
        parts.append(Part(Cylinder(0.048, 0.10), DARK, (_POST_X_M - 0.05, y, height), ALONG_X))
        parts.append(Part(Cylinder(0.040, 0.05), ALUMINIUM, (-0.045, y, height), ALONG_X))
        parts.append(Part(Box((0.008, 0.030, 0.10)), ALUMINIUM, (-0.03, y, height + 0.03)))
    return tuple(parts)
