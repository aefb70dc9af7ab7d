"""What machines look like: the parts of their trees of links as instances, placed by joint positions. No PyBullet."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..kernels import compiled
from ..rendering.instances import NOBODY, Instances, instances
from ..rendering.library import MeshLibrary
from ..rendering.shapes import Array, Mesh, ball, box, cylinder, merged, turned
from .urdf import Box, Colour, Cylinder, Link, Robot, Shape, rotation_matrix

_FACETS_M = 0.004
"""Sides of round parts are about this wide, from 10 sides for a pin to 32 for a wheel."""


class MachineLooks:
    """The visible parts of one or more robots, in a library once and for all; ``place`` says where they are.

    Attributes:
        joints: names of the joints that move, in the order of ``place``'s positions.
        links: names of all links.
    """

    def __init__(self, library: MeshLibrary, robots: Sequence[Robot], identity: int = NOBODY):
        """Add the parts to a library.

        Args:
            library: of the scene.
            robots: trees; their names of links and joints differ.
            identity: of all pixels that show the machine.
        """
        self._identity = identity
        joints = [joint for robot in robots for joint in robot.joints]
        # Of every robot the base first, and after it a child behind its parent.
        order = [name for robot in robots for name in (robot.links[0].name, *(joint.child for joint in robot.joints))]
        self.links = tuple(order)
        self.joints = tuple(joint.name for joint in joints if joint.kind != "fixed")
        self.bases = tuple(robot.links[0].name for robot in robots)
        number = {name: k for k, name in enumerate(order)}
        n = len(order)
        self._parent, self._column, self._slides = np.full(n, -1), np.full(n, -1), np.zeros(n, bool)
        self._turn, self._shift, self._axis = np.tile(np.eye(3), (n, 1, 1)), np.zeros((n, 3)), np.zeros((n, 3))
        for joint in joints:
            k = number[joint.child]
            self._parent[k] = number[joint.parent]
            self._turn[k], self._shift[k] = rotation_matrix(joint.rpy_rad), joint.xyz_m
            self._axis[k] = joint.axis
            self._slides[k] = joint.kind == "prismatic"
            if joint.kind != "fixed":
                self._column[k] = self.joints.index(joint.name)
        meshes, self._owner, colours = [], [], []
        for link in (link for robot in robots for link in robot.links):
            for colour, mesh in _painted(link):
                meshes.append(library.add(mesh))
                self._owner.append(number[link.name])
                colours.append((colour.red, colour.green, colour.blue))
        self._meshes, self._colours = np.array(meshes), np.array(colours)

    def place(
        self, positions: ArrayLike, bases: Mapping[str, tuple[ArrayLike, ArrayLike]] | None = None
    ) -> tuple[Instances, Array, Array]:
        """The machine with its joints at ``positions``: instances, and all links' turns (l, 3, 3) and places (l, 3).

        Args:
            positions: (len(joints),), radians and metres.
            bases: turn (3, 3) and place (3,) of robots' base links, by name; at the origin where none is given.

        Raises:
            ValueError: a position is no number.
        """
        turn, shift = self._turn.copy(), self._shift.copy()
        for name, (base_turn, base_shift) in (bases or {}).items():
            turn[self.links.index(name)], shift[self.links.index(name)] = base_turn, base_shift
        values = np.asarray(positions, np.float64)
        if values.shape != (len(self.joints),):
            raise ValueError(f"positions has shape {values.shape}: give one for each of {self.joints}")
        _chain(self._parent, self._column, self._slides, self._axis, values, turn, shift)
        parts = instances(self._meshes, shift[self._owner], turn[self._owner], self._colours, self._identity)
        return parts, turn, shift


@compiled
def _chain(
    parent: NDArray[np.int64],
    column: NDArray[np.int64],
    slides: NDArray[np.bool_],
    axis: Array,
    values: Array,
    turn: Array,
    shift: Array,
) -> None:
    """Turn links' poses in their parents at rest into their poses in the world under joint positions."""
    own, out = np.empty((3, 3)), np.empty((3, 3))
    for k in range(len(parent)):
        if column[k] >= 0:
            value = values[column[k]]
            x, y, z = axis[k, 0], axis[k, 1], axis[k, 2]
            if slides[k]:
                for r in range(3):
                    shift[k, r] += value * (turn[k, r, 0] * x + turn[k, r, 1] * y + turn[k, r, 2] * z)
            else:
                c, s = np.cos(value), np.sin(value)
                d = 1.0 - c
                own[0, 0], own[0, 1], own[0, 2] = c + x * x * d, x * y * d - z * s, x * z * d + y * s
                own[1, 0], own[1, 1], own[1, 2] = y * x * d + z * s, c + y * y * d, y * z * d - x * s
                own[2, 0], own[2, 1], own[2, 2] = z * x * d - y * s, z * y * d + x * s, c + z * z * d
                for r in range(3):
                    for q in range(3):
                        out[r, q] = turn[k, r, 0] * own[0, q] + turn[k, r, 1] * own[1, q] + turn[k, r, 2] * own[2, q]
                _write(out, turn, k)
        p = parent[k]
        if p >= 0:
            for r in range(3):
                for q in range(3):
                    out[r, q] = (
                        turn[p, r, 0] * turn[k, 0, q] + turn[p, r, 1] * turn[k, 1, q] + turn[p, r, 2] * turn[k, 2, q]
                    )
            x, y, z = shift[k, 0], shift[k, 1], shift[k, 2]
            for r in range(3):
                shift[k, r] = turn[p, r, 0] * x + turn[p, r, 1] * y + turn[p, r, 2] * z + shift[p, r]
            _write(out, turn, k)


@compiled
def _write(matrix: Array, turn: Array, k: int) -> None:
    """Make ``matrix`` the ``k``-th; Numba's own assignment of a part of an array takes ten seconds to compile."""
    for r in range(3):
        for q in range(3):
            turn[k, r, q] = matrix[r, q]


def _painted(link: Link) -> list[tuple[Colour, Mesh]]:
    """The visible parts of a link, those of one colour as one mesh."""
    by_colour: dict[Colour, list[Mesh]] = {}
    for part in link.parts:
        if part.visible:
            mesh = turned(_solid(part.shape), rotation_matrix(part.rpy_rad), part.xyz_m)
            by_colour.setdefault(part.colour, []).append(mesh)
    return [(colour, merged(*meshes)) for colour, meshes in by_colour.items()]


def _solid(shape: Shape) -> Mesh:
    if isinstance(shape, Box):
        return box(shape.size_m)
    sides = int(np.clip(np.ceil(2.0 * np.pi * shape.radius_m / _FACETS_M), 10, 32))
    if isinstance(shape, Cylinder):
        return cylinder(shape.radius_m, shape.length_m, sides)
    return ball(shape.radius_m, 8, 12)
