"""Motor efforts of the 3-PRRS by virtual work: sliders, forks, links and platform; no constraint force appears."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .batching import Array, as_points
from .bodies import GRAVITY_M_S2, Bar, Solid
from .linear import apply, skew, solve_where_regular
from .rotations import rotation_from_euler
from .three_prrs import ThreePRRS


@dataclass(frozen=True)
class PrrsDynamics:
    """A 3-PRRS with its masses; positions are poses (..., 6), velocities and accelerations twists and their rates.

    A fork turns about its leg's fixed radial axis, a link is a bar: what it turns with about its own line is left out.

    Attributes:
        mechanism: geometry.
        slider_kg: a carriage and the fork that it carries.
        fork_kg_m2: fork, rotor and gear about the radial axis.
        link: a link, its centre told from the slider's joint.
        platform: platform, tool and what is carried, in the platform's frame.
        viscous: friction of the six motors, see ``Dynamics``.
    """

    mechanism: ThreePRRS
    slider_kg: float
    fork_kg_m2: float
    link: Bar
    platform: Solid
    viscous: tuple[float, ...]

    def efforts(
        self,
        position: ArrayLike,
        velocity: ArrayLike,
        acceleration: ArrayLike,
        gravity_m_s2: float = GRAVITY_M_S2,
        wrench: ArrayLike = (0.0,) * 6,
    ) -> Array:
        """Slider forces in N and driven torques in N m, (..., 6); see ``Dynamics``.

        Args:
            position: (..., 6), metres and radians.
            velocity: twists (v_P, omega), (..., 6).
            acceleration: their time derivatives, (..., 6).
            gravity_m_s2: pulls along -z.
            wrench: (..., 6) that acts on the platform from outside, force and moment about P.
        """
        poses = as_points(position, 6, "position")
        twist, change = as_points(velocity, 6, "velocity"), as_points(acceleration, 6, "acceleration")
        poses, twist, change = np.broadcast_arrays(poses, twist, change)
        gravity = np.array([0.0, 0.0, -gravity_m_s2])
        chains, jacobian = self.mechanism.chains(poses), self.mechanism.jacobian(poses)
        joint = self.mechanism.joint_accelerations(poses, twist, change)
        spin, spin_rate = twist[..., 3:], change[..., 3:]
        wanted = self.platform.wrench(rotation_from_euler(poses[..., 3:]), change[..., :3], spin, spin_rate, gravity)
        wanted = wanted - np.asarray(wrench, dtype=np.float64)
        share = self.link.centre_m / self.mechanism.link_m
        turning = self.link.across_kg_m2 / self.mechanism.link_m**2
        for leg in range(3):
            slider, drive = jacobian[..., leg, :], jacobian[..., leg + 3, :]
            wanted = wanted + slider * (self.slider_kg * (joint[..., leg, None] + gravity_m_s2))
            wanted = wanted + drive * (self.fork_kg_m2 * joint[..., leg + 3, None])
            arm = chains.a[..., leg, :] - poses[..., :3]
            tip = change[..., :3] + np.cross(spin_rate, arm) + np.cross(spin, np.cross(spin, arm))
            top = np.zeros_like(tip)
            top[..., 2] = joint[..., leg]
            tip_map = np.concatenate([np.broadcast_to(np.eye(3), (*arm.shape, 3)), -skew(arm)], axis=-1)
            top_map = np.zeros_like(tip_map)
            top_map[..., 2, :] = slider
            pushed = self.link.mass_kg * ((1.0 - share) * top + share * tip - gravity)
            wanted = wanted + _back((1.0 - share) * top_map + share * tip_map, pushed)
            wanted = wanted + _back(tip_map - top_map, turning * (tip - top))
        return solve_where_regular(np.swapaxes(jacobian, -1, -2), wanted)

    def rates(self, position: ArrayLike, velocity: ArrayLike) -> Array:
        """Rates (..., 6) of sliders and driven rotations for twists (..., 6)."""
        return self.mechanism.joint_rates(position, velocity)


def _back(matrix: Array, vector: Array) -> Array:
    """Matrices (..., m, n) transposed times vectors (..., m)."""
    return apply(np.swapaxes(matrix, -1, -2), vector)
