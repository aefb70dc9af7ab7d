"""Meshes in the form that the rasteriser reads: welded, snapped to a grid, one behind the other."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .shapes import Array, Mesh

GRID = 2.0**32
"""Lines a metre of the grid that all coordinates lie on: a quarter of a nanometre apart, so that no processor's last
bit (powers and matrix products differ between them) reaches a picture."""
_FLAT = 0.9999
"""Normals whose cosine to their face's normal is above this belong to flat facets."""


class Meshes(NamedTuple):
    """All meshes of a library, one behind the other.

    Attributes:
        vertex: (v, 3), metres.
        normal: (v, 3), of smooth meshes.
        face: (f, 3) int32, vertices of a face, counted within its mesh.
        face_normal: (f, 3), unit.
        two_sided: (f,) uint8, whether a face shows its back too.
        first_vertex: (m + 1,), where the vertices of a mesh begin.
        first_face: (m + 1,), where its faces begin.
        smooth: (m,) uint8, whether light is worked out at vertices instead of faces.
        centre: (m, 3), of a ball about the mesh.
        radius: (m,), of that ball.
    """

    vertex: Array
    normal: Array
    face: NDArray[np.int32]
    face_normal: Array
    two_sided: NDArray[np.uint8]
    first_vertex: NDArray[np.int64]
    first_face: NDArray[np.int64]
    smooth: NDArray[np.uint8]
    centre: Array
    radius: Array


def snapped(values: Array) -> Array:
    """Coordinates on the grid."""
    return np.rint(np.asarray(values, np.float64) * GRID) / GRID


class MeshLibrary:
    """Meshes by number. A scene adds its meshes once; how often they are drawn is up to its instances.

    Attributes:
        sources: the meshes as they were added.
        largest: vertices of the largest one.
    """

    def __init__(self) -> None:
        """Start empty."""
        self.sources: list[Mesh] = []
        self.largest = 0
        self._parts: list[tuple[Any, ...]] = []
        self._meshes: Meshes | None = None

    def add(self, mesh: Mesh) -> int:
        """Number of a mesh from now on.

        Corners in one place become one vertex, a face and its reversed twin one face with two sides.

        Raises:
            ValueError: the mesh has no face with an area.
        """
        self._parts.append(_welded(mesh))
        self.largest = max(self.largest, len(self._parts[-1][0]))
        self.sources.append(mesh)
        self._meshes = None
        return len(self.sources) - 1

    @property
    def meshes(self) -> Meshes:
        """The arrays of all meshes."""
        if self._meshes is None:
            vertex, normal, face, face_normal, two_sided, smooth = zip(*self._parts, strict=True)
            low = [v.min(axis=0) for v in vertex]
            centre = np.array([0.5 * (a + v.max(axis=0)) for a, v in zip(low, vertex, strict=True)])
            radius = [np.sqrt(np.square(v - c).sum(axis=1).max()) for v, c in zip(vertex, centre, strict=True)]
            self._meshes = Meshes(
                np.concatenate(vertex),
                np.concatenate(normal),
                np.concatenate(face).astype(np.int32),
                np.concatenate(face_normal),
                np.concatenate(two_sided),
                np.cumsum([0, *map(len, vertex)]),
                np.cumsum([0, *map(len, face)]),
                np.array(smooth, np.uint8),
                centre,
                np.array(radius),
            )
        return self._meshes


def _welded(mesh: Mesh) -> tuple[Any, ...]:
    """Vertices, their normals, faces, their normals, their two-sidedness, and whether the mesh is smooth."""
    place, face = snapped(mesh.vertices), np.asarray(mesh.triangles, np.int64).reshape(-1, 3)
    corner = place[face]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    doubled_area = np.sqrt(np.square(normal).sum(axis=1))
    solid = doubled_area > 1e-12
    if not solid.any():
        raise ValueError("a mesh without area cannot be drawn: give triangles with three different corners")
    face, normal = face[solid], snapped(normal[solid] / doubled_area[solid, None])
    smooth = bool((np.einsum("fci,fi->fc", mesh.normals[face], normal) < _FLAT).any())
    bend = snapped(mesh.normals) if smooth else np.zeros_like(place)
    _, first, number = np.unique(
        np.rint(np.column_stack([place, bend]) * GRID).astype(np.int64), axis=0, return_index=True, return_inverse=True
    )
    face = number.reshape(-1)[face]
    kept, two_sided = _without_twins(face, normal)
    return place[first], bend[first], face[kept], normal[kept], two_sided[kept], smooth


def _without_twins(face: NDArray[np.int64], normal: Array) -> tuple[NDArray[np.bool_], NDArray[np.uint8]]:
    """Which faces to keep, and which of them stand for their reversed twins as well."""
    kept, two_sided = np.ones(len(face), bool), np.zeros(len(face), np.uint8)
    fronts: dict[tuple[int, ...], int] = {}
    for number, corners in enumerate(np.sort(face, axis=1).tolist()):
        front = fronts.setdefault(tuple(corners), number)
        if front != number and float(normal[front] @ normal[number]) < -0.99:
            two_sided[front], kept[number] = 1, False
    return kept, two_sided
