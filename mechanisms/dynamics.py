"""Motor torques of the machines with two arms and two forearms, by virtual work."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
from numpy.typing import ArrayLike

from .batching import Array, as_points
from .bodies import GRAVITY_M_S2
from .linear import apply
from .two_legs import TwoLegs, solve_pair


@dataclass(frozen=True)
class LinkMasses:
    """Masses and inertias of one of two equal legs, and of what they carry. All of a leg's bars count together.

    Attributes:
        arm_kg: driven arm.
        arm_centre: its centre of mass as a share of its length from the motor.
        arm_inertia_kg_m2: about its centre of mass.
        rotor_inertia_kg_m2: motor and gear, seen at the arm.
        elbow_kg: bracket at the elbow, which keeps its orientation.
        forearm_kg: forearm.
        forearm_centre: its centre of mass as a share of its length from the elbow.
        forearm_inertia_kg_m2: about its centre of mass.
        platform_kg: platform and gripper without payload.
    """

    arm_kg: float
    arm_centre: float
    arm_inertia_kg_m2: float
    rotor_inertia_kg_m2: float
    elbow_kg: float
    forearm_kg: float
    forearm_centre: float
    forearm_inertia_kg_m2: float
    platform_kg: float

    def __post_init__(self) -> None:
        """Check the signs."""
        for entry in fields(self):
            if not 0.0 <= getattr(self, entry.name) < np.inf:
                raise ValueError(f"{entry.name} = {getattr(self, entry.name)}: give a finite value >= 0")

    @classmethod
    def of_uniform_bars(
        cls,
        arm_kg: float,
        arm_m: float,
        forearm_kg: float,
        forearm_m: float,
        elbow_kg: float,
        platform_kg: float,
        rotor_inertia_kg_m2: float,
    ) -> LinkMasses:
        """Bars of even mass along their length: centre in the middle, inertia m l^2 / 12."""
        return cls(
            arm_kg,
            0.5,
            arm_kg * arm_m**2 / 12.0,
            rotor_inertia_kg_m2,
            elbow_kg,
            forearm_kg,
            0.5,
            forearm_kg * forearm_m**2 / 12.0,
            platform_kg,
        )


def motor_torques(
    machine: TwoLegs,
    masses: LinkMasses,
    position: ArrayLike,
    velocity: ArrayLike,
    acceleration: ArrayLike,
    payload_kg: ArrayLike = 0.0,
    gravity: float = GRAVITY_M_S2,
) -> Array:
    """Torques that the motors exert on the arms along a motion.

    Every body's inertia force and weight is projected on the tool's two directions by the partial velocities of its
    centre of mass, then on the joints by the Jacobian; no constraint forces appear.

    Args:
        machine: geometry.
        masses: of both legs.
        position: (..., 2), metres; ``velocity`` in m/s and ``acceleration`` in m/s2 likewise.
        velocity: see ``position``.
        acceleration: see ``position``.
        payload_kg: (...), carried by the platform.
        gravity: m/s2, pulls along -y.

    Returns:
        (..., 2) torques in N m, positive anticlockwise; NaN where unreachable.
    """
    points = as_points(position, 2, "position")
    v, a = as_points(velocity, 2, "velocity"), as_points(acceleration, 2, "acceleration")
    points, v, a = np.broadcast_arrays(points, v, a)
    pose = machine._pose(points)
    jacobian = machine._jacobian(pose)
    rates, accelerations = machine._joint_motion(pose, v, a)
    weight = np.array([0.0, gravity])
    carried = masses.platform_kg + np.asarray(payload_kg, dtype=np.float64)
    force = carried[..., None] * (a + weight)
    for index, leg in enumerate(machine._legs):
        angle, passive = pose.arm[..., index], pose.forearm[..., index]
        along = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        across = np.stack([-along[..., 1], along[..., 0]], axis=-1)
        forearm_across = np.stack([-np.sin(passive), np.cos(passive)], axis=-1)
        row, rate, spin = jacobian[..., index, :], rates[..., index, None], accelerations[..., index, None]
        reach = masses.arm_centre * leg.arm_m
        # Per unit of the elbow's acceleration and partial velocity, everything on the arm is a multiple of them.
        elbow_push = leg.arm_m * (across * spin - along * rate**2)
        elbow_partial = leg.arm_m * across[..., :, None] * row[..., None, :]
        # The arm and its rotor: d(work)/d(tool) = row * torque about the motor.
        turning = masses.arm_inertia_kg_m2 + masses.rotor_inertia_kg_m2 + masses.arm_kg * reach**2
        lift = masses.arm_kg * gravity * reach * along[..., :1]
        force = force + row * (turning * spin + lift)
        force = force + masses.elbow_kg * _project(elbow_partial, elbow_push + weight)
        # The forearm's centre lies between elbow and wrist, the wrist moves with the tool.
        share = masses.forearm_centre
        partial = (1.0 - share) * elbow_partial + share * np.eye(2)
        push = (1.0 - share) * elbow_push + share * a
        force = force + masses.forearm_kg * _project(partial, push + weight)
        swing_row = np.sum(forearm_across[..., :, None] * (np.eye(2) - elbow_partial), axis=-2) / leg.forearm_m
        swing = np.sum(forearm_across * (a - elbow_push), axis=-1, keepdims=True) / leg.forearm_m
        force = force + masses.forearm_inertia_kg_m2 * swing_row * swing
    return solve_pair(np.swapaxes(jacobian, -1, -2), force)


def _project(partial: Array, vector: Array) -> Array:
    """Partial velocities (..., 2, 2) transposed times vectors (..., 2)."""
    return apply(np.swapaxes(partial, -1, -2), vector)


@dataclass(frozen=True)
class TwoLegsDynamics:
    """A machine of two arms and two forearms with its masses (``bodies.Dynamics``); positions are the tool's, (..., 2).

    Attributes:
        mechanism: geometry.
        masses: of both legs and of what they carry.
        viscous: friction of the two motors, see ``Dynamics``.
    """

    mechanism: TwoLegs
    masses: LinkMasses
    viscous: tuple[float, ...]

    def efforts(
        self, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike, gravity_m_s2: float = GRAVITY_M_S2
    ) -> Array:
        """Motor torques (..., 2) in N m; see ``motor_torques``."""
        return motor_torques(self.mechanism, self.masses, position, velocity, acceleration, 0.0, gravity_m_s2)

    def rates(self, position: ArrayLike, velocity: ArrayLike) -> Array:
        """Rates (..., 2) of the motors in rad/s."""
        return self.mechanism.joint_rates(position, velocity)
