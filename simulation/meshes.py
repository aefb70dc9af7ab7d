"""Low-poly meshes by formula: tubes, leaves, tufts. Vertices (n, 3), triangles (m, 3), normals (n, 3)."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .client import PhysicsClient, pybullet

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


def spiny_leaf(length_m: float, width_m: float, droop_m: float, spines: int = 4) -> Mesh:
    """Lance-shaped leaf along +x with a toothed edge, folded along its vein and drooping at its tip."""
    along = np.linspace(0.0, 1.0, 2 * spines + 1)
    half = 0.5 * width_m * np.sin(np.pi * np.clip(along, 0.02, 1.0)) ** 0.7
    half = half * np.where(np.arange(len(along)) % 2 == 1, 1.0, 0.68)
    x, z = length_m * along, 0.35 * length_m * along - (droop_m + 0.35 * length_m) * along**2
    vein = np.stack([x, np.zeros_like(x), z], axis=-1)
    left, right = vein + np.stack([0 * x, half, 0.4 * half], -1), vein + np.stack([0 * x, -half, 0.4 * half], -1)
    vertices = np.concatenate([vein, left, right])
    n = len(along)
    i = np.arange(n - 1)
    triangles = np.concatenate(
        [
            np.stack([i, i + 1, n + i + 1], -1),
            np.stack([i, n + i + 1, n + i], -1),
            np.stack([i, 2 * n + i + 1, i + 1], -1),
            np.stack([i, 2 * n + i, 2 * n + i + 1], -1),
        ]
    )
    return flat_shaded(vertices, triangles, two_sided=True)


def whorl(leaves: int, leaf: Mesh, rise_m: float) -> Mesh:
    """Leaves around a stem, each a golden angle on and a little higher."""
    golden = np.pi * (3.0 - np.sqrt(5.0))
    parts = [turned(leaf, rotation_z(k * golden), (0.0, 0.0, rise_m * k / leaves)) for k in range(leaves)]
    return merged(*parts)


def tuft(radius_m: float, height_m: float, florets: int = 26) -> Mesh:
    """Brush of filaments: a domed cushion with narrow blades standing out of it, its centre at the origin."""
    golden = np.pi * (3.0 - np.sqrt(5.0))
    bottom = -0.5 * height_m
    rings = np.array([0.45, 0.80, 0.72, 0.40, 0.02])
    levels = bottom + height_m * np.array([0.0, 0.35, 0.62, 0.80, 0.88])
    parts = [surface_of_revolution(radius_m * rings, levels, 9)]
    for k in range(florets):
        lean = np.sqrt((k + 0.5) / florets)
        angle = k * golden
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        side = np.array([-np.sin(angle), np.cos(angle), 0.0]) * 0.10 * radius_m
        foot = 0.55 * radius_m * lean * out + np.array([0.0, 0.0, bottom + 0.45 * height_m])
        tip = radius_m * lean * out + np.array([0.0, 0.0, bottom + height_m * (1.0 - 0.35 * lean**2)])
        parts.append(flat_shaded(np.stack([foot - side, foot + side, tip]), np.array([[0, 1, 2]]), two_sided=True))
    return merged(*parts)


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


class Pool:
    """Copies of one mesh in a world: made once, placed again and again, hidden when not needed.

    PyBullet never gives a mesh's memory back, so that scenes which change must reuse what they have. The software
    renderer works through every triangle of a body wherever it is and skips only what is fully transparent: a thousand
    copies parked out of sight cost a picture 30 ms, a thousand transparent ones 1 ms. Transparent ones still throw
    shadows, so they also go below ground; each to a spot of its own, for a move away from a heap of bodies, which count
    as touching, takes 0.2 ms instead of 0.01 ms.

    Attributes:
        reach_m: distance of the mesh's farthest vertex from its origin.
    """

    def __init__(self, client: PhysicsClient, mesh: Mesh, colour: tuple[float, ...], copies: int):
        """Make ``copies`` bodies with one shared shape."""
        self._client = client
        self.reach_m = float(np.linalg.norm(mesh.vertices, axis=1).max())
        arguments: dict[str, Any] = {
            "vertices": mesh.vertices.tolist(),
            "indices": mesh.triangles.ravel().tolist(),
            "normals": mesh.normals.tolist(),
        }
        shape = pybullet.createVisualShape(
            pybullet.GEOM_MESH, rgbaColor=list(colour), physicsClientId=client.id, **arguments
        )
        self._spots = [(3.0 * self.reach_m * index, 3.0 * shape, -50.0) for index in range(copies)]
        self._bodies = [
            pybullet.createMultiBody(0.0, -1, shape, spot, physicsClientId=client.id) for spot in self._spots
        ]
        self._colours = [tuple(colour)] * copies
        self._visible = np.ones(copies, dtype=bool)
        self._parked = np.ones(copies, dtype=bool)
        self._places = np.zeros((copies, 3))
        self._used = 0
        for index in range(copies):
            self._set_visible(index, False)

    def __len__(self) -> int:
        """Copies that there are."""
        return len(self._bodies)

    @property
    def places(self) -> Array:
        """Positions (n, 3) of the copies placed since the last ``clear``."""
        return self._places[: self._used].copy()

    def clear(self) -> None:
        """Park all copies."""
        for index in range(self._used):
            self.park(index)
        self._used = 0

    def place(
        self,
        position: Array | tuple[float, float, float],
        orientation: tuple[float, ...] | Array = (0.0, 0.0, 0.0, 1.0),
        colour: tuple[float, ...] | None = None,
    ) -> int | None:
        """Show the next copy at a position (3,) with a quaternion (x, y, z, w); None when all are in use."""
        if self._used == len(self._bodies):
            return None
        index, self._used = self._used, self._used + 1
        body = self._bodies[index]
        pybullet.resetBasePositionAndOrientation(
            body, list(position), list(orientation), physicsClientId=self._client.id
        )
        self._places[index], self._parked[index] = position, False
        if colour is not None and self._colours[index] != colour:
            self._colours[index] = colour
            self._visible[index] = False
        self._set_visible(index, True)
        return index

    def show(self, visible: NDArray[np.bool_]) -> None:
        """Of the ``places``, draw only those that ``visible`` (n,) names, until told otherwise; none moves."""
        wanted = visible & ~self._parked[: self._used]
        for index in np.flatnonzero(wanted != self._visible[: self._used]).tolist():
            self._set_visible(index, bool(wanted[index]))

    def park(self, index: int) -> None:
        """Take one placed copy out of sight."""
        pybullet.resetBasePositionAndOrientation(
            self._bodies[index], self._spots[index], [0.0, 0.0, 0.0, 1.0], physicsClientId=self._client.id
        )
        self._parked[index] = True
        self._set_visible(index, False)

    def _set_visible(self, index: int, visible: bool) -> None:
        if self._visible[index] == visible:
            return
        colour = self._colours[index] if visible else (*self._colours[index][:3], 0.0)
        pybullet.changeVisualShape(self._bodies[index], -1, rgbaColor=list(colour), physicsClientId=self._client.id)
        self._visible[index] = visible


def upright_to(direction: Array) -> Array:
    """Quaternion (x, y, z, w) that turns +z into ``direction`` (3,)."""
    d = direction / np.linalg.norm(direction)
    w = 1.0 + d[2]
    if w < 1e-9:
        return np.array([1.0, 0.0, 0.0, 0.0])
    quaternion = np.array([-d[1], d[0], 0.0, w])
    return quaternion / np.linalg.norm(quaternion)


def yaw(angle_rad: float) -> tuple[float, float, float, float]:
    """Quaternion (x, y, z, w) of a turn about z."""
    return (0.0, 0.0, float(np.sin(0.5 * angle_rad)), float(np.cos(0.5 * angle_rad)))


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
