"""Low-poly meshes by formula: boxes, tubes, bodies of revolution. Vertices (n, 3), triangles (m, 3), normals (n, 3)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class Mesh(NamedTuple):
    """Triangles over vertices with their normals, in metres."""

    vertices: Array
    triangles: NDArray[np.int64]
    normals: Array


def flat_shaded(vertices: Array, triangles: NDArray[np.int64], *, two_sided: bool = False) -> Mesh:
    """Give every triangle its own vertices and normal, so that facets stay crisp; leaves need both sides."""
    corners = vertices[triangles]
    if two_sided:
        corners = np.concatenate([corners, corners[:, ::-1]])
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    doubled_area = np.linalg.norm(normal, axis=1, keepdims=True)
    # Rings of no radius and tips of leaves leave triangles without area.
    solid = doubled_area[:, 0] > 1e-12
    corners, normal = corners[solid], normal[solid] / doubled_area[solid]
    return Mesh(corners.reshape(-1, 3), np.arange(3 * len(corners)).reshape(-1, 3), np.repeat(normal, 3, axis=0))


def merged(*meshes: Mesh) -> Mesh:
    """One mesh of several."""
    offsets = np.cumsum([0, *(len(mesh.vertices) for mesh in meshes[:-1])])
    return Mesh(
        np.concatenate([mesh.vertices for mesh in meshes]),
        np.concatenate([mesh.triangles + offset for mesh, offset in zip(meshes, offsets, strict=True)]),
        np.concatenate([mesh.normals for mesh in meshes]),
    )


def turned(mesh: Mesh, rotation: Array, shift: Array | tuple[float, float, float] = (0.0, 0.0, 0.0)) -> Mesh:
    """Rotate (3, 3) and shift (3,) a mesh."""
    return Mesh(mesh.vertices @ rotation.T + np.asarray(shift), mesh.triangles, mesh.normals @ rotation.T)


def rotation_z(angle_rad: float) -> Array:
    """Rotation matrix about z."""
    c, s = np.cos(angle_rad), np.sin(angle_rad)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def surface_of_revolution(radii_m: Array, heights_m: Array, sides: int = 8) -> Mesh:
    """Body turned about z through rings of ``radii_m`` at ``heights_m``, from bottom to top."""
    angles = 2.0 * np.pi * np.arange(sides) / sides
    ring = np.stack([np.cos(angles), np.sin(angles), np.zeros(sides)], axis=-1)
    vertices = np.concatenate([r * ring + np.array([0.0, 0.0, h]) for r, h in zip(radii_m, heights_m, strict=True)])
    i = np.arange(sides)
    j = (i + 1) % sides
    triangles = []
    for level in range(len(radii_m) - 1):
        low, high = level * sides, (level + 1) * sides
        triangles += [np.stack([low + i, low + j, high + j], -1), np.stack([low + i, high + j, high + i], -1)]
    return flat_shaded(vertices, np.concatenate(triangles))


def tube(length_m: float, radius_bottom_m: float, radius_top_m: float, sides: int = 6) -> Mesh:
    """Tapered rod along +z from the origin."""
    return surface_of_revolution(np.array([radius_bottom_m, radius_top_m]), np.array([0.0, length_m]), sides)


def box(size_m: tuple[float, float, float], *, bottom: bool = True) -> Mesh:
    """Box with its centre at the origin; what lies on the ground saves drawing time without its ``bottom``."""
    corners = 0.5 * np.array(size_m) * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    faces = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6]]
    faces += [[1, 5, 7], [1, 7, 3]]
    if bottom:
        faces += [[0, 2, 6], [0, 6, 4]]
    return flat_shaded(corners, np.array(faces))


def rod(start: Array, end: Array, thickness_m: float) -> Mesh:
    """Square rod between two points (3,)."""
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    across = np.cross(along, np.eye(3)[np.abs(along).argmin()])
    across /= np.linalg.norm(across)
    frame = np.asarray(np.stack([across, np.cross(along, across), along], axis=1), np.float64)
    return turned(box((thickness_m, thickness_m, length)), frame, 0.5 * (start + end))


def frustum(half_m: tuple[float, float], depth_m: float, thickness_m: float = 0.004) -> Mesh:
    """Edges of what a camera at the origin sees down to z = -``depth_m``, where it sees ``half_m`` to either side."""
    x, y = half_m
    corners = np.array([(x, y, -depth_m), (-x, y, -depth_m), (-x, -y, -depth_m), (x, -y, -depth_m)])
    rays = [rod(np.zeros(3), corner, thickness_m) for corner in corners]
    return merged(*rays, *(rod(corners[i - 1], corners[i], thickness_m) for i in range(4)))


def ellipsoid(half_axes_m: tuple[float, ...], rings: int = 14, sides: int = 24) -> Mesh:
    """Ellipsoid about the origin with smooth normals; its longest axis goes along x by convention."""
    polar = np.linspace(0.0, np.pi, rings + 1)[:, None]
    around = 2.0 * np.pi * np.arange(sides) / sides
    ball = np.stack(
        np.broadcast_arrays(np.cos(polar), np.sin(polar) * np.cos(around), np.sin(polar) * np.sin(around)), axis=-1
    ).reshape(-1, 3)
    half = np.array(half_axes_m)
    normals = ball / half
    first = (np.arange(rings)[:, None] * sides + np.arange(sides)).ravel()
    second = (np.arange(rings)[:, None] * sides + (np.arange(sides) + 1) % sides).ravel()
    triangles = np.concatenate(
        [np.stack([first, first + sides, second], -1), np.stack([second, first + sides, second + sides], -1)]
    )
    return Mesh(half * ball, triangles, normals / np.linalg.norm(normals, axis=1, keepdims=True))


def ball(radius_m: float, rings: int = 10, sides: int = 16) -> Mesh:
    """Ball about the origin with smooth normals."""
    return ellipsoid((radius_m, radius_m, radius_m), rings, sides)


def cylinder(radius_m: float, length_m: float, sides: int = 20) -> Mesh:
    """Solid cylinder about z, its centre at the origin, with a smooth side."""
    angle = 2.0 * np.pi * np.arange(sides) / sides
    out = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=-1)
    half = np.array([0.0, 0.0, 0.5 * length_m])
    i = np.arange(sides)
    j = (i + 1) % sides
    side = Mesh(
        np.concatenate([radius_m * out - half, radius_m * out + half]),
        np.concatenate([np.stack([i, j, sides + j], -1), np.stack([i, sides + j, sides + i], -1)]),
        np.concatenate([out, out]),
    )
    rim = np.stack([np.zeros(sides - 2, np.int64), i[1:-1], i[2:]], axis=-1)
    top = flat_shaded(radius_m * out + half, rim)
    return merged(side, top, flat_shaded(radius_m * out - half, rim[:, ::-1]))


def capsule(radius_m: float, length_m: float, rings: int = 6, sides: int = 12) -> Mesh:
    """Cylinder about z with half a ball on either end, its centre at the origin; ``length_m`` is the cylinder's."""
    whole = ball(radius_m, rings, sides)
    # The ball's own axis is x: turned to z, and pulled apart at its equator, which gets two rings.
    place, normal = whole.vertices[:, [1, 2, 0]], whole.normals[:, [1, 2, 0]]
    half, count = 0.5 * length_m, (rings // 2 + 1) * sides
    apart = np.array([0.0, 0.0, half])
    upper, lower = place[:count] + apart, place[count - sides :] - apart
    first = (np.arange(rings + 1)[:, None] * sides + np.arange(sides)).ravel()
    second = (np.arange(rings + 1)[:, None] * sides + (np.arange(sides) + 1) % sides).ravel()
    triangles = np.concatenate(
        [np.stack([first, first + sides, second], -1), np.stack([second, first + sides, second + sides], -1)]
    )
    return Mesh(np.concatenate([upper, lower]), triangles, np.concatenate([normal[:count], normal[count - sides :]]))
