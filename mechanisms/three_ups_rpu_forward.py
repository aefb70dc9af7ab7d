"""Forward kinematics of a platform on linear legs: Newton's method along a continuation of the leg lengths."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from .batching import Array

LengthsAndMap = Callable[[Array], tuple[Array, Array]]
"""Maps poses (n, 4) to joint values (n, 4) and their derivatives by the pose (n, 4, 4)."""

_PIECE_M = 0.03
_MAX_PIECES = 100
_CLOSED_M = 1e-13
_ACCEPTED_M = 1e-12
_LAST_ITERATIONS = 20
_SMALLEST_DETERMINANT = 1e-12


class ForwardResult(NamedTuple):
    """Poses found from joint values."""

    pose: Array
    """Shape (..., 4), metres and radians; NaN where not converged."""
    converged: np.ndarray
    """Whether the lengths are met to 1e-12 m without a singularity between seed and pose, shape (...)."""
    iterations: np.ndarray
    """Newton steps taken, shape (...)."""


def forward_by_continuation(lengths_and_map: LengthsAndMap, lengths: Array, seed_pose: Array) -> ForwardResult:
    """Follow the leg lengths from a seed pose to the wanted ones, then close the rest with Newton's method.

    The straight way between the two sets of lengths is cut into pieces of at most 30 mm with two Newton steps each,
    so the pose stays in the seed's assembly mode; a change of the Jacobian determinant's sign means that a singular
    pose was crossed, behind which another mode begins, and ends the search. Every element of a batch walks alone.

    Args:
        lengths_and_map: joint values and their derivatives at poses.
        lengths: wanted joint values, shape (..., 4), metres.
        seed_pose: regular poses to start from, same shape.
    """
    goal, pose = lengths.reshape(-1, 4), seed_pose.reshape(-1, 4).copy()
    count = len(goal)
    start, derivative = lengths_and_map(pose)
    side = np.linalg.det(derivative)
    pieces = np.ceil(np.max(np.abs(goal - start), axis=-1, initial=0.0) / _PIECE_M)
    walking = np.isfinite(pieces) & (pieces <= _MAX_PIECES) & (np.abs(side) > _SMALLEST_DETERMINANT)
    side = np.sign(side)
    pieces = np.where(walking, np.maximum(pieces, 1.0), 0.0)
    iterations = np.zeros(count, dtype=np.int64)

    def step(rows: np.ndarray, wanted: Array) -> Array:
        """One Newton step of some rows; returns their lengths' error before it, NaN for rows that are lost."""
        reached, slope = lengths_and_map(pose[rows])
        determinant = np.linalg.det(slope)
        lost = ~(determinant * side[rows] > _SMALLEST_DETERMINANT)
        error = np.where(lost[:, None], np.nan, wanted - reached)
        safe = np.where(lost[:, None, None], np.eye(4), slope)
        pose[rows] += np.linalg.solve(safe, error[..., None])[..., 0]
        iterations[rows] += 1
        walking[rows[lost]] = False
        return np.max(np.abs(error), axis=-1)

    for piece in range(1, int(pieces.max(initial=0.0)) + 1):
        for _ in range(2):
            rows = np.flatnonzero(walking & (piece <= pieces))
            part = (piece / pieces[rows])[:, None]
            step(rows, start[rows] + part * (goal[rows] - start[rows]))
    closed = np.zeros(count, dtype=bool)
    for _ in range(_LAST_ITERATIONS):
        rows = np.flatnonzero(walking & ~closed)
        if len(rows) == 0:
            break
        closed[rows] = step(rows, goal[rows]) <= _CLOSED_M
    reached, derivative = lengths_and_map(pose)
    with np.errstate(invalid="ignore"):
        met = np.max(np.abs(goal - reached), axis=-1, initial=0.0) <= _ACCEPTED_M
        converged = walking & met & (np.linalg.det(derivative) * side > _SMALLEST_DETERMINANT)
    pose[~converged] = np.nan
    shape = lengths.shape[:-1]
    return ForwardResult(pose.reshape(lengths.shape), converged.reshape(shape), iterations.reshape(shape))
