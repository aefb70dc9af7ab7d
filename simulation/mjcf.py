"""The machines as MJCF, the format of MuJoCo: the same trees, masses, pinned points and motors as the URDFs'."""

from __future__ import annotations

from xml.etree import ElementTree

import numpy as np
from numpy.typing import ArrayLike

from .assembly import Assembly, Placed
from .client import GRAVITY_M_S2
from .urdf import Box, Cylinder, Joint, Link, Part

_KINDS = {"continuous": "hinge", "prismatic": "slide"}
_SERVO_TRAVEL = 3e-5
"""How far, in m or rad, a motor gives way to its whole limit: its servo's stiffness is the limit over this."""


def to_mjcf(assembly: Assembly, step_s: float) -> str:
    """A machine's MJCF text.

    Every motor is a ``position`` actuator of its joint's name within its limit, critically damped for what its joint
    moves in its own tree. With the control ``q* + kv / kp q'*`` it is a servo on q* with velocity feed-forward.
    Closures are ``connect`` constraints between sites ``first0``, ``second0`` and so on. A free platform has a free
    joint of its link's name. Shapes are drawn and do not collide.

    Args:
        assembly: the machine.
        step_s: time step.
    """
    root = ElementTree.Element("mujoco", model=assembly.name)
    ElementTree.SubElement(root, "compiler", angle="radian", autolimits="true")
    ElementTree.SubElement(
        root,
        "option",
        timestep=_number(step_s),
        gravity=_numbers((0.0, 0.0, -GRAVITY_M_S2)),
        integrator="implicitfast",
        solver="Newton",
        iterations="50",
        tolerance="0",
    )
    world = ElementTree.SubElement(root, "worldbody")
    damping = {motor.joint: motor.damping for motor in assembly.motors}
    bodies: dict[str, ElementTree.Element] = {}
    for part in assembly.parts:
        _add_tree(world, part, damping, bodies)
    equality = ElementTree.SubElement(root, "equality")
    for number, closure in enumerate(assembly.closures):
        sites = f"first{number}", f"second{number}"
        for site, link, pivot in zip(
            sites, (closure.first, closure.second), (closure.first_pivot_m, closure.second_pivot_m), strict=True
        ):
            ElementTree.SubElement(bodies[link], "site", name=site, pos=_numbers(pivot))
        # As hard as the step allows.
        ElementTree.SubElement(
            equality,
            "connect",
            site1=sites[0],
            site2=sites[1],
            solref=_numbers((2.0 * step_s, 1.0)),
            solimp="0.9999 0.9999 0.001",
        )
    actuators = ElementTree.SubElement(root, "actuator")
    for motor in assembly.motors:
        ElementTree.SubElement(
            actuators,
            "position",
            name=motor.joint,
            joint=motor.joint,
            kp=_number(motor.limit / _SERVO_TRAVEL),
            dampratio="1",
            forcerange=_numbers((-motor.limit, motor.limit)),
        )
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _add_tree(
    world: ElementTree.Element, part: Placed, damping: dict[str, float], bodies: dict[str, ElementTree.Element]
) -> None:
    robot = part.robot
    x, y, z, w = part.quaternion
    base = _body(world, robot.links[0], part.position_m, (w, x, y, z))
    if not part.fixed:
        ElementTree.SubElement(base, "freejoint", name=robot.links[0].name)
    bodies[robot.links[0].name] = base
    links = {link.name: link for link in robot.links}
    for joint in robot.joints:
        body = _body(bodies[joint.parent], links[joint.child], joint.xyz_m, quaternion(joint.rpy_rad))
        bodies[joint.child] = body
        if joint.kind != "fixed":
            _add_joint(body, joint, damping.get(joint.name, 0.0))


def _body(parent: ElementTree.Element, link: Link, position_m: ArrayLike, quaternion: ArrayLike) -> ElementTree.Element:
    body = ElementTree.SubElement(parent, "body", name=link.name, pos=_numbers(position_m), quat=_numbers(quaternion))
    inertia = link.inertia()
    tensor = inertia.tensor_kg_m2
    moments = [*np.diag(tensor), tensor[0, 1], tensor[0, 2], tensor[1, 2]]
    ElementTree.SubElement(
        body,
        "inertial",
        pos=_numbers(inertia.centre_m),
        mass=_number(inertia.mass_kg),
        fullinertia=_numbers(moments),
    )
    for part in (part for part in link.parts if part.visible):
        body.append(_geom(part))
    return body


def _add_joint(body: ElementTree.Element, joint: Joint, damping: float) -> None:
    ElementTree.SubElement(
        body, "joint", name=joint.name, type=_KINDS[joint.kind], axis=_numbers(joint.axis), damping=_number(damping)
    )


def _geom(part: Part) -> ElementTree.Element:
    if isinstance(part.shape, Box):
        kind, size = "box", [0.5 * edge for edge in part.shape.size_m]
    elif isinstance(part.shape, Cylinder):
        kind, size = "cylinder", [part.shape.radius_m, 0.5 * part.shape.length_m]
    else:
        kind, size = "sphere", [part.shape.radius_m]
    colour = part.colour.red, part.colour.green, part.colour.blue, part.colour.alpha
    return ElementTree.Element(
        "geom",
        type=kind,
        size=_numbers(size),
        pos=_numbers(part.xyz_m),
        quat=_numbers(quaternion(part.rpy_rad)),
        rgba=_numbers(colour),
        contype="0",
        conaffinity="0",
    )


def quaternion(rpy_rad: ArrayLike) -> np.ndarray:
    """Unit quaternion (w, x, y, z) of URDF's fixed-axis roll, pitch, yaw."""
    half = 0.5 * np.asarray(rpy_rad, dtype=np.float64)
    (cr, cp, cy), (sr, sp, sy) = np.cos(half), np.sin(half)
    return np.array(
        [
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        ]
    )


def _number(value: float) -> str:
    return f"{0.0 if abs(value) < 1e-15 else value:.12g}"


def _numbers(values: ArrayLike) -> str:
    return " ".join(_number(float(value)) for value in np.asarray(values, dtype=np.float64))
