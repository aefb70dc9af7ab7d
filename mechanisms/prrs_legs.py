"""The three legs of a posed 3-PRRS, in contiguous columns: the arithmetic behind ``ThreePRRS``.

Vectors have the shape (3 components, 3 legs, n poses), so that every operation runs over long contiguous rows.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .batching import Array
from .geometry import segment_distance
from .rotations import sines_and_cosines

LEG_ANGLES_RAD = np.deg2rad([0.0, 120.0, 240.0])
"""Azimuths of the legs on both circles (paper Fig. 1: X points to A1, x to a1)."""

_HALF_ROOT_THREE = 0.5 * np.sqrt(3.0)
RADIAL = np.array([[1.0, -0.5, -0.5], [0.0, _HALF_ROOT_THREE, -_HALF_ROOT_THREE], [0.0, 0.0, 0.0]])
"""Unit vectors along the R1 axes, outwards; column i belongs to leg i. Shape (3, 3)."""
TANGENTIAL = np.array([[0.0, -_HALF_ROOT_THREE, _HALF_ROOT_THREE], [1.0, -0.5, -0.5], [0.0, 0.0, 0.0]])
"""Unit vectors along the R2 axes while theta = 0. Shape (3, 3)."""

_LOCK_AT_HOME = 2.0 * _HALF_ROOT_THREE**3


MARGINS = (
    *(f"leg{leg}_closure" for leg in (1, 2, 3)),
    *(f"slider{leg}_lower" for leg in (1, 2, 3)),
    *(f"slider{leg}_upper" for leg in (1, 2, 3)),
    *(f"cone{leg}" for leg in (1, 2, 3)),
    "clearance12",
    "clearance23",
    "clearance31",
    "platform_lock",
)
"""Keys of ``ThreePRRS.margins`` in order."""


class ThreePRRSChains(NamedTuple):
    """Every joint of posed 3-PRRS legs; axis -2 counts the legs.

    Attributes:
        g: centres of the R2 joints on the sliders, (..., 3, 3), metres.
        a: spherical joints on the platform, (..., 3, 3), metres.
        u: unit vectors of the R2 axes, (..., 3, 3).
        swing: angles of the links about R2, from straight down towards outside, (..., 3), rad.
        joints: (L1, L2, L3, theta1, theta2, theta3), (..., 6).
    """

    g: Array
    a: Array
    u: Array
    swing: Array
    joints: Array


class Legs(NamedTuple):
    """One set of legs a pose; NaN where a link cannot reach its joint.

    Attributes:
        normal: the platform's z axis, (3, n).
        arm: from the platform's centre to the spherical joints a_i, (3, 3, n), metres.
        link: from G_i to a_i, that is l f_i, (3, 3, n), metres.
        spare: l^2 minus the square of the link's horizontal part, (3, n), square metres; negative out of reach.
        slider: displacements L_i, (3, n), metres.
    """

    normal: Array
    arm: Array
    link: Array
    spare: Array
    slider: Array


class LegFrame(NamedTuple):
    """A link in its leg's own directions: radial p, tangential q, downwards s; m^2 = s^2 + q^2. Each (3, n), metres."""

    p: Array
    q: Array
    s: Array
    m_square: Array


def pose_legs(pose: Array, link_m: float, base_radius_m: float, platform_radius_m: float) -> Legs:
    """The legs at poses given as columns (6, n): x, y, z, alpha, beta, gamma."""
    sine, cosine = sines_and_cosines(pose[3:])
    sa, sb, sg = sine
    ca, cb, cg = cosine
    turned = sb * sa
    x_axis = np.stack([cg * cb, sg * cb, -sb])
    y_axis = np.stack([cg * turned - sg * ca, sg * turned + cg * ca, cb * sa])
    normal = np.stack([sg * sa + cg * sb * ca, sg * sb * ca - cg * sa, cb * ca])
    arm = np.empty((3, 3, pose.shape[1]))
    arm[:, 0] = platform_radius_m * x_axis
    arm[:, 1] = (0.5 * platform_radius_m) * (np.sqrt(3.0) * y_axis - x_axis)
    arm[:, 2] = -arm[:, 0] - arm[:, 1]
    link = arm + pose[:3, None]
    slider = link[2].copy()
    link -= base_radius_m * RADIAL[..., None]
    spare = link_m * link_m - link[0] * link[0] - link[1] * link[1]
    s = np.sqrt(spare)
    slider += s
    link[2] = -s
    return Legs(normal, arm, link, spare, slider)


def leg_frame(link: Array) -> LegFrame:
    """Resolve links (3, 3, n) in their legs' radial, tangential and vertical directions."""
    p = link[0] * RADIAL[0][:, None] + link[1] * RADIAL[1][:, None]
    q = link[0] * TANGENTIAL[0][:, None] + link[1] * TANGENTIAL[1][:, None]
    s = -link[2]
    return LegFrame(p, q, s, s * s + q * q)


def free_directions(frame: LegFrame, link_m: float) -> Array:
    """Unit directions (3, 3, n) in which a_i can still move while all six joints are locked (rotation about R2)."""
    m = np.sqrt(frame.m_square)
    tilt = frame.p / (link_m * m)
    free = (m / link_m) * RADIAL[..., None] - (tilt * frame.q) * TANGENTIAL[..., None]
    free[2] += tilt * frame.s
    return free


def platform_lock(arm: Array, free: Array, side_m: float) -> Array:
    """How firmly locked joints hold the platform, (n): 1 at the level centre with D = d, 0 where they hold it no more.

    With the joints locked each a_i keeps one free direction, and the platform's three side lengths must not change:
    three equations in three rates. This is their determinant, made dimensionless; it changes its sign where the
    assembly mode changes.
    """
    determinant = np.zeros(arm.shape[-1])
    forwards, backwards = 1.0, 1.0
    for i, j in ((0, 1), (1, 2), (2, 0)):
        side = arm[:, i] - arm[:, j]
        forwards = forwards * np.sum(side * free[:, i], axis=0)
        backwards = backwards * -np.sum(side * free[:, j], axis=0)
    determinant += forwards
    determinant += backwards
    return determinant / (side_m**3 * _LOCK_AT_HOME)


def clearances(legs: Legs) -> Array:
    """Distances (3, n) in metres between the links 1-2, 2-3 and 3-1, as segments."""
    a = legs.arm
    g = legs.arm - legs.link
    return segment_distance(g, a, np.roll(g, -1, axis=1), np.roll(a, -1, axis=1), axis=0)


def cone_angles(legs: Legs, link_m: float) -> Array:
    """Angles (3, n) in rad between the platform's z axis and the links, seen from the spherical joints."""
    cosine = -np.sum(legs.normal[:, None] * legs.link, axis=0) / link_m
    return np.arccos(np.clip(cosine, -1.0, 1.0))


def write_margins(
    legs: Legs,
    table: Array,
    link_m: float,
    platform_radius_m: float,
    slider_range_m: tuple[float, float],
    cone_rad: float,
    clearance_m: float,
    min_lock: float,
) -> None:
    """Fill ``table`` (16, n) with the margins of n poses to their limits, rows as in ``MARGINS``."""
    low, high = slider_range_m
    table[0:3] = link_m - np.sqrt(link_m**2 - legs.spare)
    table[3:6] = legs.slider - low
    table[6:9] = high - legs.slider
    table[9:12] = cone_rad - cone_angles(legs, link_m)
    table[12:15] = clearances(legs)
    table[12:15] -= clearance_m
    free = free_directions(leg_frame(legs.link), link_m)
    table[15] = platform_lock(legs.arm, free, np.sqrt(3.0) * platform_radius_m) - min_lock
