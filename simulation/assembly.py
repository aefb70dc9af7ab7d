"""What the machines are put together from, for whichever engine: trees of links, pinned points, motors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..mechanisms.prrs_legs import LEG_ANGLES_RAD
from .closed_loop import Closure, Motor, Quaternion, Vector
from .picker_model import PickerParameters, picker_robot
from .prrs_model import PrrsParameters, leg_robot
from .transplanter_model import TransplanterParameters, transplanter_robot
from .urdf import Robot
from .weeder_model import WeederParameters, weeder_robot

_UPRIGHT: Quaternion = (0.0, 0.0, 0.0, 1.0)


@dataclass(frozen=True)
class Placed:
    """A tree of links and where its base stands.

    Attributes:
        name: unique in the machine.
        robot: the tree.
        position_m: of the base link's frame.
        quaternion: of the base link's frame, (x, y, z, w).
        fixed: whether the base link is part of the world; a free platform is not.
    """

    name: str
    robot: Robot
    position_m: Vector = (0.0, 0.0, 0.0)
    quaternion: Quaternion = _UPRIGHT
    fixed: bool = True


@dataclass(frozen=True)
class Assembly:
    """A closed-loop machine.

    Attributes:
        name: of the machine.
        parts: its trees; joint and link names are unique across them.
        closures: points of two links that must coincide.
        motors: driven joints with what friction leaves of their limits.
    """

    name: str
    parts: tuple[Placed, ...]
    closures: tuple[Closure, ...]
    motors: tuple[Motor, ...]


def picker_assembly(parameters: PickerParameters) -> Assembly:
    """The picker: cart, two two-link legs and a level platform, pinned at its wrists."""
    p, bar = parameters, parameters.five_bar
    closures = [
        Closure(
            f"forearm{leg}",
            (0.0, bar.forearm_m[leg - 1], 0.0),
            "platform",
            (0.0, side * bar.half_platform_m, bar.tool_drop_m),
        )
        for leg, side in ((1, -1.0), (2, 1.0))
    ]
    motors = [Motor("cart", p.cart_force_limit_n - p.cart_friction_n)]
    motors += _alike(("arm1", "arm2"), p.arm_torque_limit_n_m - p.arm_friction_n_m, p.arm_damping_n_m_s)
    return _tree("picker", picker_robot(parameters), closures, motors)


def transplanter_assembly(parameters: TransplanterParameters) -> Assembly:
    """The transplanter: two two-link legs and a level platform, pinned at its wrists."""
    p = parameters
    closures = [
        Closure(f"forearm{leg}", (0.0, p.arm.forearm_m, 0.0), "platform", (0.0, side * p.half_platform_m, 0.0))
        for leg, side in ((1, 1.0), (2, -1.0))
    ]
    motors = _alike(("arm1", "arm2"), p.torque_limit_n_m - p.friction_n_m, p.damping_n_m_s)
    return _tree("transplanter", transplanter_robot(parameters), closures, motors)


def weeder_assembly(parameters: WeederParameters) -> Assembly:
    """The laser weeder: cart, three UPS legs and the RPU leg with the platform, on which the three are pinned."""
    p, tips = parameters, parameters.mechanism.attachments.platform
    closures = [
        Closure(f"rod{leg}", (0.0, 0.0, 0.0), "platform", (float(tip[0]), float(tip[1]), float(tip[2])))
        for leg, tip in zip((1, 2, 3), tips[:3], strict=True)
    ]
    motors = [Motor("cart", p.cart_force_limit_n - p.cart_friction_n)]
    legs = [f"leg{leg}" for leg in (1, 2, 3, 4)]
    motors += _alike(legs, p.leg_force_limit_n - p.leg_friction_n, p.leg_damping_n_s_m)
    return _tree("weeder", weeder_robot(parameters), closures, motors)


def prrs_assembly(parameters: PrrsParameters) -> Assembly:
    """A 3-PRRS: three legs and a free platform, pinned on their links."""
    p, mechanism = parameters, parameters.mechanism
    base = (0.0, 0.0, p.origin_height_m)
    parts, closures = [], []
    for leg, angle in enumerate(LEG_ANGLES_RAD.tolist(), 1):
        turn = (0.0, 0.0, float(np.sin(0.5 * angle)), float(np.cos(0.5 * angle)))
        parts.append(Placed(f"leg{leg}", leg_robot(parameters, leg), base, turn))
        radius = mechanism.platform_radius_m
        joint = (radius * float(np.cos(angle)), radius * float(np.sin(angle)), 0.0)
        closures.append(Closure(f"link{leg}", (0.0, 0.0, -mechanism.link_m), "platform", joint))
    parts.append(Placed("platform", parameters.platform_robot(), base, fixed=False))
    sliders, drives = ([f"{kind}{leg}" for leg in (1, 2, 3)] for kind in ("slider", "drive"))
    motors = _alike(sliders, p.slider_force_limit_n - p.slider_friction_n, p.slider_damping_n_s_m)
    motors += _alike(drives, p.swing_torque_limit_n_m - p.swing_friction_n_m, p.swing_damping_n_m_s)
    return Assembly(p.name, tuple(parts), tuple(closures), tuple(motors))


def _alike(names: Sequence[str], limit: float, damping: float) -> list[Motor]:
    return [Motor(name, limit, damping) for name in names]


def _tree(name: str, robot: Robot, closures: Sequence[Closure], motors: Sequence[Motor]) -> Assembly:
    return Assembly(name, (Placed(name, robot),), tuple(closures), tuple(motors))
