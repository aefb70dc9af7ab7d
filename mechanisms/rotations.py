"""Orientations as Z-Y-X Euler angles, batched over leading axes."""

from __future__ import annotations

import numpy as np

from .batching import Array

_HALF_ANGLE_LIMIT_RAD = 2.5


def sines_and_cosines(angles: Array) -> tuple[Array, Array]:
    """Sines and cosines of an array of angles in radians, at little more than the price of the sines.

    Below 2.5 rad the cosine of the half angle is the positive root of 1 - sin^2, which is well conditioned there;
    arrays that hold a larger angle (or NaN) take the plain functions.
    """
    if angles.size and np.abs(angles).max() < _HALF_ANGLE_LIMIT_RAD:
        half = np.sin(0.5 * angles)
        cosine = half * half
        sine = np.sqrt(1.0 - cosine)
        sine *= half
        sine *= 2.0
        cosine *= -2.0
        cosine += 1.0
        return sine, cosine
    return np.sin(angles), np.cos(angles)


def rotation_from_euler(angles: Array) -> Array:
    """T = Rz(gamma) Ry(beta) Rx(alpha), shape (..., 3, 3), from (alpha, beta, gamma), shape (..., 3), radians."""
    (sa, sb, sg), (ca, cb, cg) = (np.moveaxis(part, -1, 0) for part in (np.sin(angles), np.cos(angles)))
    rows = [
        [cg * cb, cg * sb * sa - sg * ca, cg * sb * ca + sg * sa],
        [sg * cb, sg * sb * sa + cg * ca, sg * sb * ca - cg * sa],
        [-sb, cb * sa, cb * ca],
    ]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)


def euler_from_rotation(rotation: Array) -> Array:
    """(alpha, beta, gamma), shape (..., 3), of rotations (..., 3, 3); at beta = +-pi/2 only their sum is determined."""
    alpha = np.arctan2(rotation[..., 2, 1], rotation[..., 2, 2])
    beta = np.arctan2(-rotation[..., 2, 0], np.hypot(rotation[..., 0, 0], rotation[..., 1, 0]))
    gamma = np.arctan2(rotation[..., 1, 0], rotation[..., 0, 0])
    return np.stack([alpha, beta, gamma], axis=-1)


def euler_rate_map(angles: Array) -> Array:
    """E (..., 3, 3) of omega = E @ (alpha', beta', gamma'), omega in the fixed frame; singular at |beta| = pi/2."""
    _, beta, gamma = np.moveaxis(angles, -1, 0)
    sb, cb, sg, cg = np.sin(beta), np.cos(beta), np.sin(gamma), np.cos(gamma)
    zero = np.zeros_like(beta)
    rows = [[cg * cb, -sg, zero], [sg * cb, cg, zero], [-sb, zero, zero + 1.0]]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
