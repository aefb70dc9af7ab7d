"""Marks in the page: what a machine believes, what is true, and what its policy would do."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..envs.belief import DONE, LOST, OPEN, Belief
from ..rendering.shapes import Mesh, ball, surface_of_revolution
from .mirror import as_light
from .reel import Look
from .turns import parted

Array = NDArray[np.float64]
BELIEVED, CHOSEN, PICKED = (235, 160, 20), (20, 90, 230), (215, 30, 150)
TRUE = {OPEN: (250, 250, 250), DONE: (40, 170, 70), LOST: (210, 45, 40)}
_THICK = 0.2
_FRUSTUM_M = 0.16
"""Depth of a camera's picture in the page."""


class Marks:
    """Those of one seat."""

    def __init__(self, scene: Any, root: str):
        """Add nothing yet but what they hang on.

        Args:
            scene: the browser's.
            root: name of the seat's root.
        """
        self._scene, self._name = scene, f"{root}/marks"
        self._frame = scene.add_frame(self._name, show_axes=False)
        self._rings: Any = None
        self._balls: Any = None
        self._aim: Any = None
        self._label: Any = None
        self._frusta: dict[Any, Any] = {}
        self._drift, self._began_s = np.zeros(3), 0.0
        self.shown = {"believed": True, "true": False, "cameras": True}

    def show(self, belief: Belief, chosen: int | None, picked: int | None, text: str, now_s: float) -> None:
        """Show a belief and the choice that it has led to.

        Args:
            belief: at the decision.
            chosen: slot that the policy goes for, None for an action without one.
            picked: slot that a person looks at.
            text: the policy's choice in words.
            now_s: simulated time of the decision.
        """
        self._drift, self._began_s = belief.drift_m_s, now_s
        self._frame.position = np.zeros(3)
        self._show_rings(belief, chosen, picked)
        self._show_balls(belief)
        there = chosen is not None and bool(np.isfinite(belief.slot_m[chosen]).all())
        if not there or chosen is None:
            self._label = _dropped(self._label)
            return
        place = belief.slot_m[chosen] + np.array([0.0, 0.0, 2.5 * belief.size_m])
        if self._label is None:
            self._label = self._scene.add_label(f"{self._name}/choice", text, position=place, anchor="bottom-center")
        self._label.text, self._label.position, self._label.visible = text, place, self.shown["believed"]

    def go_on(self, now_s: float) -> None:
        """Let the marks move on with what they mark."""
        if self._drift.any():
            self._frame.position = np.round(self._drift * (now_s - self._began_s), 4)

    def look(self, looks: dict[Any, Look]) -> None:
        """Show what cameras have seen last, where they were."""
        for camera, look in looks.items():
            pose = look.frame.camera.world_from_camera
            wxyz, _ = parted(pose[None, :3, :3])
            node = self._frusta.get(camera)
            if node is None:
                node = self._frusta[camera] = self._scene.add_camera_frustum(
                    f"{self._name.rpartition('/')[0]}/camera{len(self._frusta)}",
                    fov=camera.field_of_view_rad,
                    aspect=camera.width / camera.height,
                    scale=_FRUSTUM_M,
                    thickness=0.003,
                    color=(250, 200, 60),
                    image=look.frame.rgb,
                    format="jpeg",
                    jpeg_quality=80,
                    cast_shadow=False,
                )
            else:
                node.image = look.frame.rgb
            node.wxyz, node.position, node.visible = wxyz[0], pose[:3, 3], self.shown["cameras"]

    def set_shown(self, what: str, shown: bool) -> None:
        """Show or hide a kind of marks: ``"believed"``, ``"true"`` or ``"cameras"``."""
        self.shown[what] = shown
        nodes = {
            "believed": [self._rings, self._aim, self._label],
            "true": [self._balls],
            "cameras": list(self._frusta.values()),
        }[what]
        for node in nodes:
            if node is not None:
                node.visible = shown

    def _show_rings(self, belief: Belief, chosen: int | None, picked: int | None) -> None:
        colours = np.tile(np.array(BELIEVED, np.uint8), (len(belief.slot_m), 1))
        for slot, colour in ((chosen, CHOSEN), (picked, PICKED)):
            if slot is not None:
                colours[slot] = colour
        there = np.isfinite(belief.slot_m[:, 0])
        # Pairs share their ends: one ring a place, in the colour that says most.
        weight = there * (1.0 + (np.arange(len(there)) == chosen) + 2.0 * (np.arange(len(there)) == picked))
        order = np.argsort(-weight, kind="stable")
        _, first = np.unique(np.nan_to_num(belief.slot_m[order]).round(4), axis=0, return_index=True)
        alone = np.zeros(len(there), bool)
        alone[order[first]] = True
        scale = (there & alone).astype(np.float32)
        self._rings = self._batch(self._rings, "believed", _ring(belief.size_m), belief.slot_m, colours, scale)
        if belief.to_m is None:
            return
        ends, tints = [], []
        for slot, colour in ((chosen, CHOSEN), (picked, PICKED)):
            seen = slot is not None and bool(there[slot])
            ends.append(belief.to_m[slot] if seen else np.zeros(3))
            tints.append((colour, seen))
        self._aim = self._batch(
            self._aim,
            "aim",
            _ring(belief.size_m),
            np.array(ends),
            np.array([colour for colour, _ in tints], np.uint8),
            np.array([seen for _, seen in tints], np.float32),
        )

    def _show_balls(self, belief: Belief) -> None:
        colours = np.array([TRUE[int(kind)] for kind in belief.stands], np.uint8).reshape(-1, 3)
        place = belief.true_m + np.array([0.0, 0.0, 0.3 * belief.size_m])
        if not len(place):
            self._balls = _dropped(self._balls)
            return
        dot = ball(0.35 * belief.size_m, 6, 8)
        self._balls = self._batch(self._balls, "true", dot, place, colours, np.ones(len(place), np.float32))

    def _batch(
        self, node: Any, what: str, mesh: Mesh, place: Array, colour: NDArray[np.uint8], scale: NDArray[np.float32]
    ) -> Any:
        """A node with marks of one mesh; the given one where it has room for them."""
        at = np.nan_to_num(place).astype(np.float32)
        if node is not None and len(node.batched_positions) == len(at):
            node.batched_positions, node.batched_colors, node.batched_scales = at, as_light(colour), scale
            return node
        _dropped(node)
        shown = self.shown["true" if what == "true" else "believed"]
        return self._scene.add_batched_meshes_simple(
            f"{self._name}/{what}",
            mesh.vertices.astype(np.float32),
            mesh.triangles.astype(np.uint32),
            batched_wxyzs=np.tile(np.array([1.0, 0.0, 0.0, 0.0], np.float32), (len(at), 1)),
            batched_positions=at,
            batched_scales=scale,
            batched_colors=as_light(colour),
            lod="off",
            cast_shadow=False,
            receive_shadow=False,
            visible=shown,
        )


def _ring(radius_m: float) -> Mesh:
    thick = _THICK * radius_m
    radii = radius_m + thick * np.array([-1.0, 1.0, 1.0, -1.0, -1.0])
    return surface_of_revolution(radii, thick * np.array([-1.0, -1.0, 1.0, 1.0, -1.0]), 20)


def _dropped(node: Any) -> None:
    if node is not None:
        node.remove()
