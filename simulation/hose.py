"""A flexible hose for the eye: a curve of overlapping capsules between a moving end and a fixed one. No physics."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..rendering.instances import NOBODY, Instances, instances, upright_to
from ..rendering.library import MeshLibrary
from ..rendering.shapes import capsule

_FINE = 96
_OVERLAP = 1.1


class Hose:
    """A hose in a scene; ``lay`` says where it is."""

    def __init__(
        self,
        library: MeshLibrary,
        length_m: float,
        radius_m: float,
        colour: tuple[float, ...],
        pieces: int = 18,
        identity: int = NOBODY,
    ) -> None:
        """Add a piece to a library.

        Args:
            library: of the scene.
            length_m: longest curve that the pieces must cover without gaps.
            radius_m: of the hose.
            colour: red, green, blue.
            pieces: number of capsules.
            identity: of all pixels that show it.
        """
        self._mesh = library.add(capsule(radius_m, _OVERLAP * length_m / pieces))
        self._colour, self._pieces, self._identity = colour, pieces, identity

    def lay(self, start: ArrayLike, start_pull: ArrayLike, end: ArrayLike, end_pull: ArrayLike) -> Instances:
        """The pieces along a cubic curve.

        Args:
            start: (3,), metres.
            start_pull: (3,) from ``start`` to the curve's first control point: direction and stiffness there.
            end: (3,), metres.
            end_pull: (3,) from ``end`` to the curve's second control point.
        """
        first, last = np.asarray(start, dtype=np.float64), np.asarray(end, dtype=np.float64)
        corners = first, first + np.asarray(start_pull), last + np.asarray(end_pull), last
        t = np.linspace(0.0, 1.0, _FINE)[:, None]
        weights = (1 - t) ** 3, 3 * t * (1 - t) ** 2, 3 * t**2 * (1 - t), t**3
        curve = np.stack([weight * corner for weight, corner in zip(weights, corners, strict=True)]).sum(axis=0)
        travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(curve, axis=0), axis=1))])
        cuts = np.linspace(0.0, travelled[-1], self._pieces + 1)
        joints = np.stack([np.interp(cuts, travelled, curve[:, axis]) for axis in range(3)], axis=-1)
        middles, along = 0.5 * (joints[1:] + joints[:-1]), np.diff(joints, axis=0)
        return instances(self._mesh, middles, upright_to(along), self._colour, self._identity)
