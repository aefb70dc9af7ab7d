"""Forward kinematics of the 3-PRRS: Newton's method on the links' three swings."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .batching import Array
from .prrs_legs import RADIAL, TANGENTIAL

_NEWTON_STEPS = 25
_LARGEST_STEP_RAD = 0.3
_CONTINUATION_STEPS = 24
_TOLERANCE = 2e-14
_PAIRS = ((0, 1), (1, 2), (2, 0))


class SwingSolution(NamedTuple):
    """Spherical joints (3, 3, n) and what is known about them, (n) each."""

    a: Array
    converged: np.ndarray
    iterations: np.ndarray


class _Legs(NamedTuple):
    """What the joints fix: G_i and the two directions that span each link's circle, (3, 3, n)."""

    g: Array
    upward: Array


def solve_swings(
    joints: Array, swing: Array, seed_joints: Array, link_m: float, base_radius_m: float, side_m: float
) -> SwingSolution:
    """Close the platform over links that swing about their R2 axes.

    Args:
        joints: (6, n).
        swing: swings of the seed, (3, n), rad, from straight down outwards.
        seed_joints: the seed's own joints, (6, n), where a continuation starts.
        link_m: l.
        base_radius_m: D / 2.
        side_m: distance of the spherical joints.
    """
    legs = _pose_sliders(joints, base_radius_m)
    start_sign = np.sign(_determinant(_pose_sliders(seed_joints, base_radius_m), swing, link_m))
    found, residual, count = _newton(legs, swing, link_m, side_m)
    converged = _accept(legs, found, residual, start_sign, link_m, side_m)
    rows = np.flatnonzero(~converged & np.isfinite(swing).all(axis=0) & np.isfinite(joints).all(axis=0))
    if len(rows):
        led, residual[rows], steps = _continue(
            joints[:, rows], swing[:, rows], seed_joints[:, rows], link_m, base_radius_m, side_m
        )
        found[:, rows] = led
        count[rows] += steps
        part = _Legs(legs.g[..., rows], legs.upward[..., rows])
        converged[rows] = _accept(part, led, residual[rows], start_sign[rows], link_m, side_m)
    return SwingSolution(_ends(legs, found, link_m)[0], converged, count)


def _continue(
    joints: Array, swing: Array, seed_joints: Array, link_m: float, base_radius_m: float, side_m: float
) -> tuple[Array, Array, np.ndarray]:
    """Lead the joints from the seed's to the wanted ones in equal steps, closing the platform after each."""
    count = np.zeros(joints.shape[1], dtype=int)
    residual = np.full(joints.shape[1], np.nan)
    for share in np.linspace(0.0, 1.0, _CONTINUATION_STEPS + 1)[1:]:
        legs = _pose_sliders(seed_joints + share * (joints - seed_joints), base_radius_m)
        swing, residual, steps = _newton(legs, swing, link_m, side_m)
        count += steps
    return swing, residual, count


def _newton(legs: _Legs, swing: Array, link_m: float, side_m: float) -> tuple[Array, Array, np.ndarray]:
    """Newton steps until the sides fit; elements that are done no longer move."""
    swing = swing.copy()
    count = np.zeros(swing.shape[1], dtype=int)
    residual = np.full(swing.shape[1], np.nan)
    active = np.flatnonzero(np.isfinite(swing).all(axis=0))
    for step in range(_NEWTON_STEPS + 1):
        part = _Legs(legs.g[..., active], legs.upward[..., active])
        sides, slopes = _sides(part, swing[:, active], link_m)
        error = 0.5 * (np.sum(sides * sides, axis=0) - side_m * side_m)
        residual[active] = np.abs(error).max(axis=0) / side_m
        move = _solve_cyclic(slopes, -error)
        size = np.abs(move).max(axis=0)
        # One more step after the last that mattered: quadratic convergence makes it exact to rounding.
        going = (residual[active] > _TOLERANCE * side_m) & np.isfinite(size)
        if step == _NEWTON_STEPS or not going.any():
            break
        with np.errstate(divide="ignore", invalid="ignore"):
            move *= np.minimum(1.0, _LARGEST_STEP_RAD / size)
        active, move = active[going], move[:, going]
        swing[:, active] += move
        count[active] += 1
    return swing, residual, count


def _accept(legs: _Legs, swing: Array, residual: Array, start_sign: Array, link_m: float, side_m: float) -> np.ndarray:
    """Sides that fit, links that hang, and the seed's assembly mode."""
    sign = np.sign(_determinant(legs, swing, link_m))
    hanging = (np.abs(swing) < 0.5 * np.pi).all(axis=0)
    return (residual < 1e-12 * side_m) & hanging & (sign == start_sign)


def _pose_sliders(joints: Array, base_radius_m: float) -> _Legs:
    g = np.empty((3, 3, joints.shape[1]))
    g[:] = base_radius_m * RADIAL[..., None]
    g[2] = joints[:3]
    upward = -np.sin(joints[3:]) * TANGENTIAL[..., None]
    upward[2] = np.cos(joints[3:])
    return _Legs(g, upward)


def _ends(legs: _Legs, swing: Array, link_m: float) -> tuple[Array, Array]:
    """Spherical joints and their derivatives to the swings, (3, 3, n) each."""
    sine, cosine = link_m * np.sin(swing), link_m * np.cos(swing)
    radial = RADIAL[..., None]
    return legs.g + sine * radial - cosine * legs.upward, cosine * radial + sine * legs.upward


def _sides(legs: _Legs, swing: Array, link_m: float) -> tuple[Array, Array]:
    """Platform sides (3 components, 3 pairs, n) and the slopes (2, 3, n) of half their squares."""
    a, free = _ends(legs, swing, link_m)
    sides = np.stack([a[:, i] - a[:, j] for i, j in _PAIRS], axis=1)
    first = np.stack([np.sum(sides[:, k] * free[:, i], axis=0) for k, (i, _) in enumerate(_PAIRS)])
    second = np.stack([-np.sum(sides[:, k] * free[:, j], axis=0) for k, (_, j) in enumerate(_PAIRS)])
    return sides, np.stack([first, second])


def _determinant(legs: _Legs, swing: Array, link_m: float) -> Array:
    first, second = _sides(legs, swing, link_m)[1]
    return np.prod(first, axis=0) + np.prod(second, axis=0)


def _solve_cyclic(slopes: Array, right: Array) -> Array:
    """Solve a_k x_k + b_k x_(k+1) = r_k (indices cyclic) for (3, n)."""
    a, b = slopes
    with np.errstate(divide="ignore", invalid="ignore"):
        scale = 1.0 / (a[0] * a[1] * a[2] + b[0] * b[1] * b[2])
        x = (right[0] * a[1] * a[2] - b[0] * right[1] * a[2] + b[0] * b[1] * right[2]) * scale
        y = (right[1] * a[2] * a[0] - b[1] * right[2] * a[0] + b[1] * b[2] * right[0]) * scale
        z = (right[2] * a[0] * a[1] - b[2] * right[0] * a[1] + b[2] * b[0] * right[1]) * scale
    return np.stack([x, y, z])
