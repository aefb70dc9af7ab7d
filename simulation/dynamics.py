"""The machines' closed-form dynamics, with the masses and inertias that PyBullet simulates. No PyBullet here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..mechanisms.bodies import Bar, Solid
from ..mechanisms.dynamics import LinkMasses, TwoLegsDynamics
from ..mechanisms.prrs_dynamics import PrrsDynamics
from ..mechanisms.three_ups_rpu_dynamics import CartPlatformDynamics
from .picker_model import PickerParameters, picker_robot
from .prrs_model import PrrsParameters, leg_robot
from .transplanter_model import TransplanterParameters
from .urdf import Inertia, Link, Robot
from .weeder_model import WeederParameters, weeder_robot


def picker_dynamics(parameters: PickerParameters) -> TwoLegsDynamics:
    """The picker's arm; its cart is a mass on a rail (``picker_moved_kg``), which the arm's plane does not feel."""
    bar, links = parameters.five_bar, _links(picker_robot(parameters))
    arm, forearm = (links[name].inertia() for name in ("arm1", "forearm1"))
    masses = LinkMasses(
        arm_kg=arm.mass_kg,
        arm_centre=float(arm.centre_m[1]) / bar.arm_m[0],
        arm_inertia_kg_m2=float(arm.tensor_kg_m2[0, 0]),
        rotor_inertia_kg_m2=0.0,
        elbow_kg=0.0,
        forearm_kg=forearm.mass_kg,
        forearm_centre=float(forearm.centre_m[1]) / bar.forearm_m[0],
        forearm_inertia_kg_m2=float(forearm.tensor_kg_m2[0, 0]),
        platform_kg=parameters.tool_mass_kg,
    )
    return TwoLegsDynamics(bar, masses, (parameters.arm_damping_n_m_s,) * 2)


def picker_moved_kg(parameters: PickerParameters) -> float:
    """What the cart's drive moves."""
    return sum(link.mass_kg for link in picker_robot(parameters).links[1:])


def transplanter_dynamics(parameters: TransplanterParameters, payload_kg: float = 0.0) -> TwoLegsDynamics:
    """The transplanter with something in its gripper."""
    masses = parameters.arm.masses
    assert masses is not None
    carried = replace(masses, platform_kg=masses.platform_kg + payload_kg)
    return TwoLegsDynamics(parameters.arm, carried, (parameters.damping_n_m_s,) * 2)


def prrs_dynamics(parameters: PrrsParameters, payload_kg: float = 0.0, payload_below_m: float = 0.0) -> PrrsDynamics:
    """A 3-PRRS that carries a point mass ``payload_below_m`` under its platform's centre."""
    links = _links(leg_robot(parameters, 1))
    fork, link = links["yoke1"].inertia(), links["link1"].inertia()
    return PrrsDynamics(
        parameters.mechanism,
        parameters.slider_mass_kg + parameters.yoke_mass_kg,
        float(fork.tensor_kg_m2[0, 0]),
        _bar(link, -1.0),
        _carrying(parameters.platform_robot().links[0], payload_kg, payload_below_m),
        (parameters.slider_damping_n_s_m,) * 3 + (parameters.swing_damping_n_m_s,) * 3,
    )


def weeder_moved_kg(parameters: WeederParameters) -> float:
    """What the cart's drive moves."""
    return sum(link.mass_kg for link in weeder_robot(parameters).links[1:])


def weeder_dynamics(parameters: WeederParameters) -> CartPlatformDynamics:
    """The laser weeder's cart and platform."""
    links = _links(weeder_robot(parameters))
    hung = [links[name].mass_kg for name in ("frame", "base", "cross1", "cross2", "cross3")]
    return CartPlatformDynamics(
        parameters.mechanism,
        sum(hung),
        _bar(links["cylinder1"].inertia(), 1.0),
        _bar(links["rod1"].inertia(), -1.0),
        links["cross4"].mass_kg,
        _carrying(links["platform"], 0.0, 0.0),
        (0.0,) + (parameters.leg_damping_n_s_m,) * 4,
    )


def _links(robot: Robot) -> dict[str, Link]:
    return {link.name: link for link in robot.links}


def _bar(inertia: Inertia, side: float) -> Bar:
    """A link whose line is its z axis, seen from its frame's origin towards ``side`` of it."""
    across = 0.5 * float(inertia.tensor_kg_m2[0, 0] + inertia.tensor_kg_m2[1, 1])
    return Bar(inertia.mass_kg, side * float(inertia.centre_m[2]), across)


def _carrying(link: Link, payload_kg: float, below_m: float) -> Solid:
    """A platform with a point mass under its frame's origin."""
    own = link.inertia()
    point = np.array([0.0, 0.0, -below_m])
    mass = own.mass_kg + payload_kg
    centre = (own.mass_kg * own.centre_m + payload_kg * point) / mass
    tensor = own.tensor_kg_m2.copy()
    for kg, at in ((own.mass_kg, own.centre_m), (payload_kg, point)):
        offset = at - centre
        tensor += kg * (offset @ offset * np.eye(3) - np.outer(offset, offset))
    rows = tuple((float(row[0]), float(row[1]), float(row[2])) for row in tensor)
    return Solid(mass, (float(centre[0]), float(centre[1]), float(centre[2])), rows)
