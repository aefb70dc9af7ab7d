"""The picker's rendered world: its camera's reports, and pictures for people."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ...perception import blooms
from ...perception.frames import Frame
from ..core import Array, Sight, StepResult, View
from ..pixels import on_picture
from .batch import fixed_order, stop_centres
from .core import SafflowerCore
from .machine import picker_parameters, trajectory
from .scene import Looks, PickerScene
from .state import PickerPlan
from .timing import EMPTY, NOTHING

MATCH_RADIUS_M = 0.025
"""A report farther than this from every head is counted as false."""


class PickerView(View[PickerPlan]):
    """Scene of one world of the rules; follows the rules' state by itself."""

    depth_range_m = 0.2, 1.4

    def __init__(self, core: SafflowerCore, scene: PickerScene | None = None):
        """Build the scene, where none is given; its plants come with the first look or picture."""
        self._core = core
        self._scene = scene or PickerScene(picker_parameters(core.config))
        self._centres = stop_centres(core.config.scenario)
        self._episode = -1
        self._shown = np.zeros(0, np.int64)
        self._picked: set[int] = set()

    def beside(self, core: SafflowerCore) -> PickerView:
        """See ``View.beside``."""
        return PickerView(core, self._scene.another())

    def sense(self) -> None:
        """Where a look is due, render the stop, segment it and hand its reports to the rules in the fixed order."""
        core = self._core
        if not core.state.look_due[0]:
            return
        look = self.look()
        seen = blooms.detect(look)
        stop = int(core.state.stop[0])
        half = 0.5 * core.config.scenario.window_m
        here = np.abs(seen.position[:, 0] - self._centres[stop]) <= half
        position = seen.position[here]
        order = fixed_order(core.config, position[None], np.ones((1, len(position)), bool))[0][0]
        position = position[order]
        core.receive(0, position, seen.stage[here][order], seen.spread_m[here][order], self._heads_behind(position))

    def sight_width(self, rows: int) -> int:
        """See ``View.sight_width``."""
        return self._scene.sight_camera(rows).width

    def sight(self, rows: int) -> Sight:
        """The stop's window from where the camera looked at it, without the machine; what is picked is bare."""
        core = self._core
        self._follow_field()
        self._scene.set_cart(float(core.tables.look_pose[core.state.stop[0], 0]))
        frame = self._scene.look_without_machine(self._scene.sight_camera(rows))
        report = core.state.slot_report[0, :-1]
        place = core.state.track_target[0, report] + core.frame
        place[report == core.state.track_head.shape[1] - 1] = np.nan
        return Sight(frame.rgb, frame.depth_m, on_picture(place, *frame.camera))

    def look(self) -> Frame:
        """What the machine's camera sees now."""
        self._follow()
        return self._scene.look()

    def frame(self) -> NDArray[np.uint8]:
        """Picture of the present state."""
        self._follow()
        return self._scene.render(*self.shot)

    def frames(self, plan: PickerPlan, result: StepResult, frames_per_second: float) -> Iterator[NDArray[np.uint8]]:
        """Pictures of a decision: it stands and locates, moves, stands and cuts; a still machine is drawn once."""
        core = self._core
        phases = dict(zip(core.phase_names, result.phases_s[0].tolist(), strict=True))
        self._load_if_new()
        still = self._draw(plan.start[0])
        yield from _repeat(still, phases["recognise"] * frames_per_second)
        if plan.kind[0] not in (NOTHING, EMPTY):
            cart, tool, _ = trajectory(plan, core.config.machine.clear_level_m, 1.0 / frames_per_second)
            for x, place in zip(cart, tool, strict=True):
                yield self._draw(np.array([x, *place]))
        standing = phases["settle"] + phases["shear"] + phases["suck"]
        still = self._draw(plan.target[0])
        yield from _repeat(still, standing * frames_per_second)
        self._follow()

    def close(self) -> None:
        """Close the scene; idempotent."""
        self._scene.close()

    def _draw(self, pose: Array) -> NDArray[np.uint8]:
        self._scene.set_machine(float(pose[0]), pose[1:])
        return self._scene.render(*self.shot)

    def _follow(self) -> None:
        """Bring the scene to the rules' state."""
        pose = self._core.state.pose[0]
        self._follow_field()
        self._scene.set_machine(float(pose[0]), pose[1:])

    def _follow_field(self) -> None:
        core = self._core
        self._load_if_new()
        for head in np.flatnonzero(core.state.head_visited[0, self._shown]):
            if head not in self._picked:
                self._scene.set_picked(int(head))
                self._picked.add(int(head))

    def _load_if_new(self) -> None:
        core = self._core
        if self._episode == core.episode[0]:
            return
        self._episode = int(core.episode[0])
        self._shown = shown = np.flatnonzero(core.head_exists[0])
        self._picked.clear()
        there = slice(int(core.plant_count[0]))
        self._scene.load(
            Looks(
                head_position=core.state.head_position[0, shown] + core.frame,
                head_stage=core.state.head_stage[0, shown],
                head_spread_m=core.head_size_m[0, shown],
                head_plant=core.head_plant[0, shown],
                head_occluded=core.head_occluded[0, shown],
                plant_base=core.plant_base[0, there],
                plant_height_m=core.plant_height_m[0, there],
                crown_m=core.plant_crown_m[0, there],
                potted=core.config.scenario.potted,
            )
        )

    def _heads_behind(self, position: Array) -> NDArray[np.int64]:
        """Index of the nearest true head of each report, nearest pairs first, for scoring alone."""
        core = self._core
        heads = np.full(len(position), core.state.head_mass_g.shape[1] - 1)
        if len(position) == 0 or len(self._shown) == 0:
            return heads
        truth = core.state.head_position[0, self._shown] + core.frame
        distance = np.linalg.norm(position[:, None] - truth[None], axis=-1)
        nearest = distance.argmin(axis=1)
        close = distance[np.arange(len(position)), nearest] <= MATCH_RADIUS_M
        heads[close] = self._shown[nearest[close]]
        return heads


def _repeat(picture: NDArray[np.uint8], times: float) -> Iterator[NDArray[np.uint8]]:
    for _ in range(round(times)):
        yield picture
