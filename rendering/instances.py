"""What stands in a scene: arrays of meshes, places, turns and colours."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .library import snapped
from .shapes import Array

FARTHEST_M = 1e5
"""No instance stands farther from the origin; what does has a wrong unit, or is no number."""
NOBODY = -1
"""Identity of what has none."""


class Instances(NamedTuple):
    """Meshes put into a scene.

    Attributes:
        mesh: (n,) int32, number in the library.
        turn: (n, 3, 3), rotation, perhaps with a scale along each of the mesh's axes.
        shift: (n, 3), metres.
        colour: (n, 3), whole numbers 0..255.
        identity: (n,) int32, what a frame's pixels are told to show.
    """

    mesh: NDArray[np.int32]
    turn: Array
    shift: Array
    colour: Array
    identity: NDArray[np.int32]

    def where(self, chosen: NDArray[np.bool_]) -> Instances:
        """Those that ``chosen`` (n,) names."""
        return Instances(
            self.mesh[chosen], self.turn[chosen], self.shift[chosen], self.colour[chosen], self.identity[chosen]
        )

    def moved(self, way_m: ArrayLike) -> Instances:
        """The same, all shifted by a way (3,)."""
        return self._replace(shift=snapped(self.shift + np.asarray(way_m, np.float64)))


def instances(
    mesh: ArrayLike,
    shift: ArrayLike,
    turn: ArrayLike | None = None,
    colour: ArrayLike = (1.0, 1.0, 1.0),
    identity: ArrayLike = NOBODY,
) -> Instances:
    """Instances from columns, each with one row for all or a row for each.

    Args:
        mesh: (n,) numbers in the library.
        shift: (n, 3), metres.
        turn: (n, 3, 3); upright where it is left out.
        colour: (n, 3) or more columns, red, green, blue in [0, 1]. Cameras' lighting starts from whole numbers: they
            are cut, not rounded.
        identity: (n,).

    Raises:
        ValueError: a place or turn is no number, or out of range.
    """
    places = np.asarray(shift, np.float64).reshape(-1, 3)
    turns = np.eye(3)[None] if turn is None else np.asarray(turn, np.float64).reshape(-1, 3, 3)
    kinds = np.asarray(mesh, np.int32).reshape(-1)
    n = max(len(places), len(turns), len(kinds))
    n = 0 if min(len(places), len(turns), len(kinds)) == 0 else n
    if not np.all(np.abs(places) < FARTHEST_M) or not np.all(np.abs(turns) < FARTHEST_M):
        raise ValueError(f"an instance's place or turn is no number or beyond {FARTHEST_M:g} m: give finite metres")
    colours = np.floor(255.0 * np.asarray(colour, np.float64).reshape(-1, np.shape(colour)[-1])[:, :3])
    return Instances(
        np.broadcast_to(kinds, (n,)).copy() if n else kinds[:0],
        np.broadcast_to(snapped(turns), (n, 3, 3)).copy(),
        np.broadcast_to(snapped(places), (n, 3)).copy(),
        np.broadcast_to(colours, (n, 3)).copy() if n else np.zeros((0, 3)),
        np.broadcast_to(np.asarray(identity, np.int32).reshape(-1), (n,)).copy() if n else np.zeros(0, np.int32),
    )


def joined(parts: Sequence[Instances]) -> Instances:
    """Several instances as one; nothing of none."""
    if not parts:
        return instances(np.zeros(0, np.int32), np.zeros((0, 3)))
    mesh, turn, shift, colour, identity = zip(*parts, strict=True)
    return Instances(*map(np.concatenate, (mesh, turn, shift, colour, identity)))


def about_z(angle_rad: ArrayLike) -> Array:
    """Rotations (n, 3, 3) about z by angles (n,)."""
    angle = np.asarray(angle_rad, np.float64).reshape(-1)
    turn = np.zeros((len(angle), 3, 3))
    turn[:, 0, 0] = turn[:, 1, 1] = np.cos(angle)
    turn[:, 1, 0] = np.sin(angle)
    turn[:, 0, 1] = -turn[:, 1, 0]
    turn[:, 2, 2] = 1.0
    return turn


def upright_to(direction: ArrayLike) -> Array:
    """The shortest rotations (n, 3, 3) that turn +z into directions (n, 3)."""
    d = np.asarray(direction, np.float64).reshape(-1, 3)
    x, y, z = (d / np.linalg.norm(d, axis=1, keepdims=True)).T
    # Straight down there is no shortest one: half a turn about x.
    down = 1.0 + z < 1e-9
    share = 1.0 / np.where(down, 1.0, 1.0 + z)
    turn = np.empty((len(d), 3, 3))
    turn[:, 0] = np.stack([1.0 - x * x * share, -x * y * share, x], axis=-1)
    turn[:, 1] = np.stack([-x * y * share, 1.0 - y * y * share, y], axis=-1)
    turn[:, 2] = np.stack([-x, -y, z], axis=-1)
    turn[down] = np.diag([1.0, -1.0, -1.0])
    return turn


def from_quaternion(quaternion: ArrayLike) -> Array:
    """Rotations (n, 3, 3) of unit quaternions (n, 4), (x, y, z, w)."""
    x, y, z, w = np.asarray(quaternion, np.float64).reshape(-1, 4).T
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), -1, 0)
