"""Motor efforts of the 3UPS-RPU platform under a cart, by virtual work: no constraint force appears."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from .batching import Array, as_points
from .bodies import GRAVITY_M_S2, Bar, Solid
from .linear import apply, dot, skew, solve_where_regular
from .three_ups_rpu import ThreeUPSRPU


@dataclass(frozen=True)
class CartPlatformDynamics:
    """A 3UPS-RPU that hangs under a cart, with its masses.

    A position is (cart, x, z, alpha, beta): the cart's way along the base's X, then the mechanism's pose; motors are
    the cart's drive and the four legs. The base's Z points down. Legs are bars of two parts: a cylinder that hangs on
    the base's joint and a rod that ends in the platform's; what they turn with about their own line is left out.

    Attributes:
        mechanism: geometry.
        cart_kg: cart, base, and joints on it.
        cylinder: upper part of a leg, its centre told from the base's joint.
        rod: lower part, its centre told back from the platform's joint.
        cross_kg: the fourth leg's cross on the platform.
        platform: platform with its tool, in the platform's frame.
        viscous: friction of the five motors, see ``Dynamics``.
    """

    mechanism: ThreeUPSRPU
    cart_kg: float
    cylinder: Bar
    rod: Bar
    cross_kg: float
    platform: Solid
    viscous: tuple[float, ...]

    def efforts(
        self, position: ArrayLike, velocity: ArrayLike, acceleration: ArrayLike, gravity_m_s2: float = GRAVITY_M_S2
    ) -> Array:
        """Forces (..., 5) in N of the cart's drive and the legs; see ``Dynamics``. Arguments (..., 5)."""
        place, v, a = (
            as_points(values, 5, name)
            for values, name in ((position, "position"), (velocity, "velocity"), (acceleration, "acceleration"))
        )
        place, v, a = np.broadcast_arrays(place, v, a)
        pose, rates = place[..., 1:], v[..., 1:]
        mechanism = self.mechanism
        chains, twists = mechanism.chains(pose), mechanism.twist_map(pose)
        twist, change = apply(twists, rates), mechanism.twist_rate(pose, rates, a[..., 1:])
        spin, spin_rate = twist[..., 3:], change[..., 3:]
        # Everything hangs on the cart: its acceleration acts like one more gravity.
        carried = np.zeros_like(twist[..., :3])
        carried[..., 0], carried[..., 2] = a[..., 0], -gravity_m_s2
        wrench = self.platform.wrench(chains.rotation, change[..., :3], spin, spin_rate, -carried)
        along = wrench[..., 0] + self.cart_kg * a[..., 0]
        wanted = _back(twists, wrench)
        for leg in range(4):
            n, length = chains.direction[..., leg, :], chains.length[..., leg, None]
            arm = chains.arms[..., leg, :]
            tip = change[..., :3] + np.cross(spin_rate, arm) + np.cross(spin, np.cross(spin, arm))
            tip_velocity = twist[..., :3] + np.cross(spin, arm)
            tip_map = np.concatenate([np.broadcast_to(np.eye(3), (*arm.shape, 3)), -skew(arm)], axis=-1) @ twists
            stretch = dot(n, tip_velocity)[..., None]
            turn = (tip_velocity - n * stretch) / length
            stretch_rate = dot(n, tip)[..., None] + length * dot(turn, turn)[..., None]
            turn_rate = (tip - n * stretch_rate - 2.0 * stretch * turn) / length
            turn_map = (tip_map - n[..., :, None] * np.sum(n[..., :, None] * tip_map, axis=-2)[..., None, :]) / length[
                ..., None
            ]
            cross = self.cross_kg if leg == 3 else 0.0
            upper, lower = self.cylinder, self.rod
            pushes = (
                (upper.centre_m * turn_map, upper.mass_kg * (upper.centre_m * turn_rate + carried)),
                (tip_map - lower.centre_m * turn_map, lower.mass_kg * (tip - lower.centre_m * turn_rate + carried)),
                (tip_map, cross * (tip + carried)),
            )
            for partial, push in pushes:
                wanted = wanted + _back(partial, push)
                along = along + push[..., 0]
            wanted = wanted + _back(turn_map, (upper.across_kg_m2 + lower.across_kg_m2) * turn_rate)
        legs = solve_where_regular(np.swapaxes(mechanism.rate_map(pose), -1, -2), wanted)
        return np.concatenate([along[..., None], legs], axis=-1)

    def rates(self, position: ArrayLike, velocity: ArrayLike) -> Array:
        """Rates (..., 5) of the cart and the legs in m/s."""
        v = as_points(velocity, 5, "velocity")
        legs = self.mechanism.joint_rates(as_points(position, 5, "position")[..., 1:], v[..., 1:])
        return np.concatenate([np.broadcast_to(v[..., :1], (*legs.shape[:-1], 1)), legs], axis=-1)


def _back(matrix: Array, vector: Array) -> Array:
    """Matrices (..., m, n) transposed times vectors (..., m)."""
    return apply(np.swapaxes(matrix, -1, -2), vector)
