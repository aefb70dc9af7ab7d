"""Joint positions, Jacobian and Hessian of the 3UPS-RPU platform as functions of its attachment points."""

from __future__ import annotations

from itertools import combinations
from typing import NamedTuple

import numpy as np

from .batching import Array
from .geometry import segment_distance
from .linear import apply, dot, skew


class Attachments(NamedTuple):
    """Where the legs of a 3UPS-RPU platform are fastened, and which orientation model it follows."""

    base: Array
    """A_1..A_4 in the base's axes, shape (4, 3), metres."""
    platform: Array
    """B_1..B_4 in the platform's axes, shape (4, 3), metres."""
    paper_orientation: bool
    """R = Rx(alpha) Ry(beta) with the paper's Y_o instead of Ry(beta) Rx(alpha) with Y_o = 0."""

    @property
    def radius_m(self) -> float:
        """Distance of B_4 from the platform's centre."""
        return -float(self.platform[3, 0])


class ThreeUPSRPUChains(NamedTuple):
    """A posed platform in the base's axes; legs 1-3 are the UPS legs, leg 4 is the RPU leg."""

    base: Array
    """Joints A_i, shape (..., 4, 3), metres."""
    platform: Array
    """Joints B_i, shape (..., 4, 3), metres."""
    centre: Array
    """Platform centre o, shape (..., 3), metres."""
    rotation: Array
    """Platform axes as columns, shape (..., 3, 3)."""
    length: Array
    """Leg lengths, shape (..., 4), metres."""
    direction: Array
    """Unit vectors n_i from A_i to B_i, shape (..., 4, 3)."""

    @property
    def arms(self) -> Array:
        """r_i from the platform's centre to B_i in the base's axes, shape (..., 4, 3), metres."""
        return self.platform - self.centre[..., None, :]


def ring(radius: float, azimuths: tuple[float, ...]) -> Array:
    """Points (n, 3) on a horizontal circle, read-only."""
    joints = radius * np.stack([np.cos(azimuths), np.sin(azimuths), np.zeros(len(azimuths))], axis=-1)
    # sin(pi) is not 0 in floating point; the RPU leg must stand in the plane y = 0 exactly.
    joints[np.abs(joints) < 1e-15 * radius] = 0.0
    joints.setflags(write=False)
    return joints


def pose_chains(at: Attachments, poses: Array) -> ThreeUPSRPUChains:
    """Joint positions, leg lengths and directions at poses (..., 4)."""
    sa, ca, sb, cb = sines(poses)
    centre = np.zeros((*poses.shape[:-1], 3))
    centre[..., 0], centre[..., 2] = poses[..., 0], poses[..., 1]
    rotation = np.zeros((*poses.shape[:-1], 3, 3))
    rotation[..., 0, 0] = cb
    rotation[..., 1, 1] = ca
    rotation[..., 2, 2] = ca * cb
    if at.paper_orientation:
        centre[..., 1] = at.radius_m * sa * sb
        rotation[..., 0, 2] = sb
        rotation[..., 1, 0], rotation[..., 1, 2] = sa * sb, -sa * cb
        rotation[..., 2, 0], rotation[..., 2, 1] = -ca * sb, sa
    else:
        rotation[..., 0, 1], rotation[..., 0, 2] = sa * sb, ca * sb
        rotation[..., 1, 2] = -sa
        rotation[..., 2, 0], rotation[..., 2, 1] = -sb, sa * cb
    # The joints lie in the platform's plane, so two products a coordinate do; sums in a fixed order keep a pose's
    # result the same to the last bit whatever batch it comes in.
    arms = at.platform[:, :1] * rotation[..., None, :, 0] + at.platform[:, 1:2] * rotation[..., None, :, 1]
    platform = centre[..., None, :] + arms
    base = np.broadcast_to(at.base, platform.shape)
    leg = platform - base
    length = np.sqrt(dot(leg, leg))
    with np.errstate(divide="ignore", invalid="ignore"):
        return ThreeUPSRPUChains(base, platform, centre, rotation, length, leg / length[..., None])


def twist_map(at: Attachments, poses: Array) -> Array:
    """Map (..., 6, 4) of pose rates to the twist (v, omega) of the platform's centre."""
    sa, ca, sb, cb = sines(poses)
    result = np.zeros((*poses.shape[:-1], 6, 4))
    result[..., 0, 0] = 1.0
    result[..., 2, 1] = 1.0
    if at.paper_orientation:
        result[..., 1, 2] = at.radius_m * ca * sb
        result[..., 1, 3] = at.radius_m * sa * cb
        result[..., 3, 2] = 1.0
        result[..., 4, 3] = ca
        result[..., 5, 3] = sa
    else:
        result[..., 3, 2] = cb
        result[..., 5, 2] = -sb
        result[..., 4, 3] = 1.0
    return result


def twist_rate(at: Attachments, poses: Array, rates: Array, accelerations: Array) -> Array:
    """Linear and angular acceleration (..., 6): the map times the pose accelerations plus the map's own change."""
    result = apply(twist_map(at, poses), accelerations)
    sa, ca, sb, cb = sines(poses)
    ad, bd = rates[..., 2], rates[..., 3]
    if at.paper_orientation:
        result[..., 1] += at.radius_m * (2.0 * ca * cb * ad * bd - sa * sb * (ad * ad + bd * bd))
        result[..., 4] -= sa * ad * bd
        result[..., 5] += ca * ad * bd
    else:
        result[..., 3] -= sb * ad * bd
        result[..., 5] -= cb * ad * bd
    return result


def lengths_and_map(at: Attachments, poses: Array) -> tuple[Array, Array]:
    """Leg lengths (..., 4) and the map (..., 4, 4) of pose rates to leg rates."""
    chains = pose_chains(at, poses)
    moment = np.cross(chains.arms, chains.direction)
    result = np.empty((*poses.shape[:-1], 4, 4))
    result[..., 0], result[..., 1] = chains.direction[..., 0], chains.direction[..., 2]
    sa, ca, sb, cb = (value[..., None] for value in sines(poses))
    if at.paper_orientation:
        aside = at.radius_m * chains.direction[..., 1]
        result[..., 2] = moment[..., 0] + aside * ca * sb
        result[..., 3] = moment[..., 1] * ca + moment[..., 2] * sa + aside * sa * cb
    else:
        result[..., 2] = moment[..., 0] * cb - moment[..., 2] * sb
        result[..., 3] = moment[..., 1]
    return chains.length, result


def jacobian(at: Attachments, poses: Array, chains: ThreeUPSRPUChains) -> Array:
    """G (..., 6, 6): four legs, the constraint force along n5 at B_4, the constraint couple about n6 (eq. 10)."""
    arms = chains.arms
    result = np.zeros((*poses.shape[:-1], 6, 6))
    result[..., :4, :3] = chains.direction
    result[..., :4, 3:] = np.cross(arms, chains.direction)
    result[..., 4, 1] = 1.0
    result[..., 4, 3], result[..., 4, 5] = -arms[..., 3, 2], arms[..., 3, 0]
    sa, ca, sb, cb = sines(poses)
    if at.paper_orientation:
        result[..., 5, 4], result[..., 5, 5] = -sa, ca
    else:
        result[..., 5, 3], result[..., 5, 5] = sb, cb
    return result


def hessian(at: Attachments, poses: Array) -> Array:
    """H_1..H_6 (..., 6, 6, 6) with (leg accelerations, 0, 0) = G A + V^T H V (eqs 13-16, corrected)."""
    chains = pose_chains(at, poses)
    rows = jacobian(at, poses, chains)[..., :4, :]
    arm = skew(chains.arms)
    result = np.zeros((*poses.shape[:-1], 6, 6, 6))
    legs = result[..., :4, :, :]
    legs[..., :3, :3] = np.eye(3)
    legs[..., :3, 3:] = -arm
    legs[..., 3:, :3] = arm
    legs[..., 3:, 3:] = -arm @ arm
    legs -= rows[..., :, None] * rows[..., None, :]
    legs /= chains.length[..., None, None]
    legs[..., 3:, 3:] += arm @ skew(chains.direction)
    result[..., 4, 3:, 3:] = arm[..., 3, :, :] @ skew(np.array([0.0, 1.0, 0.0]))
    sa, ca, sb, cb = sines(poses)
    if at.paper_orientation:
        result[..., 5, 3, 4], result[..., 5, 3, 5] = -ca, -sa
    else:
        result[..., 5, 4, 3], result[..., 5, 4, 5] = cb, -sb
    return result


def leg_accelerations(chains: ThreeUPSRPUChains, twist: Array, acceleration: Array) -> Array:
    """Leg accelerations (..., 4) in m/s2: eq. 13 with V^T H_i V written out as vectors."""
    arms = chains.arms
    spin = np.cross(twist[..., None, 3:], arms)
    velocity = twist[..., None, :3] + spin
    joints = acceleration[..., None, :3] + np.cross(acceleration[..., None, 3:], arms)
    joints = joints + np.cross(twist[..., None, 3:], spin)
    along = dot(velocity, chains.direction)
    return dot(joints, chains.direction) + (dot(velocity, velocity) - along * along) / chains.length


def leg_distances(chains: ThreeUPSRPUChains) -> Array:
    """Distances (..., 6) in metres between the centre lines of the six pairs of legs (12, 13, 14, 23, 24, 34)."""
    a, b = chains.base, chains.platform
    pairs = [
        segment_distance(a[..., i, :], b[..., i, :], a[..., j, :], b[..., j, :]) for i, j in combinations(range(4), 2)
    ]
    return np.stack(pairs, axis=-1)


def sines(poses: Array) -> tuple[Array, Array, Array, Array]:
    """sin(alpha), cos(alpha), sin(beta), cos(beta), shape (...) each."""
    alpha, beta = poses[..., 2], poses[..., 3]
    return np.sin(alpha), np.cos(alpha), np.sin(beta), np.cos(beta)
