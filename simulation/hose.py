"""A flexible hose for the eye: a curve of overlapping capsules between a moving end and a fixed one. No physics."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .client import PhysicsClient, pybullet

Array = NDArray[np.float64]

_FINE = 96


class Hose:
    """A hose in a rendered world.

    Attributes:
        body_ids: PyBullet's numbers of the pieces.
    """

    def __init__(
        self, client: PhysicsClient, length_m: float, radius_m: float, rgba: Sequence[float], pieces: int = 18
    ) -> None:
        """Make the pieces; ``lay`` puts them in place.

        Args:
            client: a world that is rendered.
            length_m: longest curve that the pieces must cover without gaps.
            radius_m: of the hose.
            rgba: its colour.
            pieces: number of capsules.
        """
        self._client = client
        self._pieces = pieces
        shape = pybullet.createVisualShape(
            pybullet.GEOM_CAPSULE,
            radius=radius_m,
            length=1.1 * length_m / pieces,
            rgbaColor=rgba,
            physicsClientId=client.id,
        )
        self.body_ids = [pybullet.createMultiBody(0.0, -1, shape, physicsClientId=client.id) for _ in range(pieces)]

    def lay(self, start: ArrayLike, start_pull: ArrayLike, end: ArrayLike, end_pull: ArrayLike) -> None:
        """Lay the pieces along a cubic curve.

        Args:
            start: (3,), metres.
            start_pull: (3,) from ``start`` to the curve's first control point: direction and stiffness there.
            end: (3,), metres.
            end_pull: (3,) from ``end`` to the curve's second control point.
        """
        first, last = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
        corners = np.stack([first, first + np.asarray(start_pull), last + np.asarray(end_pull), last])
        for body, centre, turn in zip(self.body_ids, *_pieces(corners, self._pieces), strict=True):
            pybullet.resetBasePositionAndOrientation(body, centre, turn, physicsClientId=self._client.id)

    def remove(self) -> None:
        """Take the pieces out of the world."""
        for body in self.body_ids:
            pybullet.removeBody(body, physicsClientId=self._client.id)
        self.body_ids = []


def _pieces(corners: Array, count: int) -> tuple[list[list[float]], list[list[float]]]:
    """Centres (count, 3) and quaternions (count, 4) of equal pieces of the Bezier curve of ``corners`` (4, 3)."""
    t = np.linspace(0.0, 1.0, _FINE)[:, None]
    weights = np.concatenate([(1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3], axis=1)
    curve = weights @ corners
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
    cuts = np.linspace(0.0, travelled[-1], count + 1)
    joints = np.stack([np.interp(cuts, travelled, curve[:, axis]) for axis in range(3)], axis=-1)
    along = np.diff(joints, axis=0)
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    # The shortest turn from +z to the piece: half-way vector; a piece that points straight down turns about x.
    turns = np.stack([-along[:, 1], along[:, 0], np.zeros(count), 1.0 + along[:, 2]], axis=-1)
    size = np.linalg.norm(turns, axis=1, keepdims=True)
    turns = np.where(size > 1e-6, turns / np.maximum(size, 1e-6), np.array([1.0, 0.0, 0.0, 0.0]))
    return (0.5 * (joints[1:] + joints[:-1])).tolist(), turns.tolist()
