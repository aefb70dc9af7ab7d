"""The same scenes through PyBullet's software renderer, for one release: what the own renderer is held against."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial.transform import Rotation

from ..perception.frames import Camera, Frame
from ..rendering.cameras import pose_of, view_of
from ..rendering.instances import Instances
from ..rendering.library import MeshLibrary
from ..rendering.renderer import SUN, Look
from .client import PhysicsClient, pybullet


class TinyWorld:
    """Instances as PyBullet's bodies. Usable as a context manager."""

    def __init__(self, library: MeshLibrary, things: Instances):
        """Make a body of each instance; takes longer than a picture."""
        self._things = things
        self._client = PhysicsClient()
        self._bodies = _bodies(self._client, library, things)

    def look(self, camera: Camera, eye: ArrayLike, target: ArrayLike, up: ArrayLike, shadow: bool = False) -> Look:
        """What a camera sees; the same as ``Renderer.look`` but for ties, edges and rounding.

        Args:
            camera: its size and opening.
            eye: (3,), metres.
            target: (3,), metres.
            up: (3,), direction.
            shadow: draw shadows, wrong ones where the scene is large.
        """
        points = [[float(v) for v in np.asarray(point)] for point in (eye, target, up)]
        opening = np.rad2deg(camera.field_of_view_rad)
        _, _, rgba, buffer, seen = pybullet.getCameraImage(
            camera.width,
            camera.height,
            pybullet.computeViewMatrix(*points),
            pybullet.computeProjectionMatrixFOV(opening, camera.width / camera.height, camera.near_m, camera.far_m),
            shadow=int(shadow),
            lightDirection=(SUN.towards / SUN.towards[2] * 1.6).tolist(),
            lightColor=SUN.colour.tolist(),
            lightAmbientCoeff=SUN.ambient,
            lightDiffuseCoeff=SUN.diffuse,
            lightSpecularCoeff=SUN.specular,
            renderer=pybullet.ER_TINY_RENDERER,
            physicsClientId=self._client.id,
        )
        shape = camera.height, camera.width
        rgb = np.asarray(rgba, np.uint8).reshape(*shape, 4)[..., :3].copy()
        buffer = np.asarray(buffer, np.float64).reshape(shape)
        depth = camera.far_m * camera.near_m / (camera.far_m - (camera.far_m - camera.near_m) * buffer)
        identity = np.full(max(self._bodies, default=0) + 2, -1, np.int32)
        identity[list(self._bodies)] = self._things.identity[list(self._bodies.values())]
        frame = Frame(rgb, depth.astype(np.float32), pose_of(view_of(camera, eye, target, up)))
        return Look(frame, identity[np.asarray(seen).reshape(shape)])

    def __enter__(self) -> TinyWorld:
        """Return the world itself."""
        return self

    def __exit__(self, *exception: object) -> None:
        """Close it."""
        self._client.close()


def _bodies(client: PhysicsClient, library: MeshLibrary, things: Instances) -> dict[int, int]:
    """A body for every instance: PyBullet's number -> the instance's."""
    bodies = {}
    for i, kind in enumerate(things.mesh.tolist()):
        mesh, turn = library.sources[kind], things.turn[i]
        place, normal, upright = mesh.vertices, mesh.normals, [0.0, 0.0, 0.0, 1.0]
        if np.allclose(turn @ turn.T, np.eye(3), atol=1e-9):
            upright = Rotation.from_matrix(turn).as_quat().tolist()
        else:
            place, normal = place @ turn.T, normal @ np.linalg.inv(turn)
            normal /= np.linalg.norm(normal, axis=1, keepdims=True)
        shape = pybullet.createVisualShape(
            pybullet.GEOM_MESH,
            vertices=place.tolist(),
            indices=mesh.triangles.ravel().tolist(),
            normals=normal.tolist(),
            # A little above whole numbers, for the renderer cuts.
            rgbaColor=[*((things.colour[i] + 0.25) / 255.0).tolist(), 1.0],
            physicsClientId=client.id,
        )
        at = things.shift[i].tolist()
        bodies[pybullet.createMultiBody(0.0, -1, shape, at, upright, physicsClientId=client.id)] = i
    return bodies
