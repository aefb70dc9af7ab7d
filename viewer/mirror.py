"""A scene in the browser: the same meshes at the same places, and only what has changed is sent again."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..rendering.instances import Instances
from .reel import Scene
from .turns import parted

Array = NDArray[np.float64]
_ROUND_M = 1e-5
"""Places are sent in steps of this: less than a screen shows, and steps compress better than noise."""
_CASTERS = 40
"""Batches of more instances throw no shadow: litter and trays full of plants would, leaf by leaf."""
_FLOOR_M = 2.5
"""What is wider, ground and floors, throws no shadow, as in pictures."""


class _Batch:
    """The instances of one mesh in one group, as one node of the browser's scene."""

    def __init__(self, scene: Any, name: str, vertices: Array, triangles: NDArray[np.int64], things: Instances):
        """Add it."""
        wxyz, scale = parted(things.turn)
        self._things, self._way = things, np.zeros(3)
        self._node = scene.add_batched_meshes_simple(
            name,
            vertices.astype(np.float32),
            triangles.astype(np.uint32),
            batched_wxyzs=_rounded(wxyz),
            batched_positions=_rounded(things.shift),
            batched_scales=_rounded(scale) if _stretched(scale) else None,
            batched_colors=as_light(things.colour),
            lod="off",
            cast_shadow=len(things.mesh) <= _CASTERS and np.ptp(vertices, axis=0).max() < _FLOOR_M,
            side="double" if len(triangles) < 4 else "front",
        )

    def show(self, things: Instances) -> bool:
        """Show others in their place; False where a new node is needed for that."""
        old = self._things
        if len(things.mesh) != len(old.mesh):
            return False
        if np.array_equal(things.colour, old.colour) and np.array_equal(things.turn, old.turn):
            way = things.shift - old.shift
            if not np.ptp(way, axis=0).max() > _ROUND_M:
                # All went the same way: the node moves, its instances stay where they are in it.
                if np.abs(way[0] - self._way).max() > 0.1 * _ROUND_M:
                    self._way = way[0]
                    self._node.position = _rounded(way[0])
                return True
        wxyz, scale = parted(things.turn)
        if _stretched(scale) != (self._node.batched_scales is not None):
            return False
        self._node.batched_positions = _rounded(things.shift)
        if not np.array_equal(things.turn, old.turn):
            self._node.batched_wxyzs = _rounded(wxyz)
            if self._node.batched_scales is not None:
                self._node.batched_scales = _rounded(scale)
        if not np.array_equal(things.colour, old.colour):
            self._node.batched_colors = as_light(things.colour)
        if self._way.any():
            self._way = np.zeros(3)
            self._node.position = self._way
        self._things = things
        return True

    def remove(self) -> None:
        """Take it away."""
        self._node.remove()


class Mirror:
    """One scene among those that a page shows.

    The scene's middle stays where it is in the page: a machine that drives through its field is followed.

    Attributes:
        name: of its root in the browser's scene.
        middle: (3,), of the scene that is shown, in its own metres; None before the first.
    """

    def __init__(self, scene: Any, name: str, place: Array):
        """Add a root.

        Args:
            scene: the browser's (``viser.SceneApi``).
            name: of the root, ``"/a"``.
            place: (3,), where the middle of what is shown goes.
        """
        self.name, self.middle, self.place = name, None, place
        self._scene = scene
        self._root = scene.add_frame(name, show_axes=False)
        self._named = 0
        self._shown: dict[str, Instances] = {}
        self._batches: dict[tuple[str, int], _Batch] = {}

    def show(self, scene: Scene) -> None:
        """Show a scene instead of what is shown."""
        if self.middle is None or np.abs(scene.middle - self.middle).max() > _ROUND_M:
            self.middle = scene.middle
            self._root.position = _rounded(self.place - scene.middle)
        gone = [group for group in self._shown if group not in scene.groups]
        for group in gone:
            self._show_group(scene, group, None)
        for group, things in scene.groups.items():
            if self._shown.get(group) is not things:
                self._show_group(scene, group, things)

    def clear(self) -> None:
        """Show nothing."""
        for batch in self._batches.values():
            batch.remove()
        self._batches.clear()
        self._shown.clear()
        self.middle = None

    def remove(self) -> None:
        """Take it out of the page."""
        self.clear()
        self._root.remove()

    def _show_group(self, scene: Scene, group: str, things: Instances | None) -> None:
        meshes = [] if things is None else np.unique(things.mesh).tolist()
        for key in [key for key in self._batches if key[0] == group and key[1] not in meshes]:
            self._batches.pop(key).remove()
        for mesh in meshes:
            assert things is not None
            some, key = things.where(things.mesh == mesh), (group, mesh)
            batch = self._batches.get(key)
            if batch is None or not batch.show(some):
                if batch is not None:
                    batch.remove()
                source = scene.library.sources[mesh]
                # A page keeps places by name: a name that was used before may bring its old place back.
                self._named += 1
                name = f"{self.name}/{group}/{mesh}-{self._named}"
                self._batches[key] = _Batch(self._scene, name, source.vertices, source.triangles, some)
        if things is None:
            self._shown.pop(group)
        else:
            self._shown[group] = things


def _rounded(values: Array) -> NDArray[np.float32]:
    return (np.rint(values / _ROUND_M) * _ROUND_M).astype(np.float32)


def as_light(colour: NDArray[Any]) -> NDArray[np.uint8]:
    """Colours (n, 3) 0..255 as light: the browser multiplies instances' colours before it makes them ready to show."""
    return np.rint(255.0 * (colour / 255.0) ** 2.2).astype(np.uint8)


def _stretched(scale: Array) -> bool:
    return bool(np.abs(scale - 1.0).max() > 1e-6)
