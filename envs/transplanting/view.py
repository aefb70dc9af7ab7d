"""The transplanter's rendered world: its cameras' reports, and pictures for people."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ...motion import QUINTIC
from ...perception import trays
from ..core import Array, Sight, StepResult, View
from ..pixels import on_picture
from .config import EMPTY
from .core import TransplantingCore
from .machine import Move, Trajectories, moves
from .rules import FINISH, INDEX_SOURCE, INDEX_TARGET, TransplantPlan
from .scene import CAMERA_ABOVE_M, SIDES, Side, TrayLine, TrayScene

_NEEDLES_S = 0.06
"""Time in which a picture shows the needles closing."""


class TransplantView(View[TransplantPlan]):
    """Scene of one world of the rules; follows the rules' state by itself."""

    depth_range_m = CAMERA_ABOVE_M - 0.15, CAMERA_ABOVE_M + 0.05

    def __init__(self, core: TransplantingCore, scene: TrayScene | None = None):
        """Build the scene, where none is given; its trays come with the first look or picture."""
        self._core = core
        self._scene = scene or TrayScene(core.config)
        self._trajectories = Trajectories(core.config, core.places)
        self._episode = -1
        self._clock: _Clock | None = None
        # The state that is shown; it lags behind the rules while a decision is played.
        self._lines: dict[Side, TrayLine] = {}
        self._offsets: dict[Side, Array] = {}
        self._row: dict[Side, int] = {}
        self._travel: dict[Side, float] = {}

    def beside(self, core: TransplantingCore) -> TransplantView:
        """See ``View.beside``."""
        return TransplantView(core, self._scene.another())

    def sense(self) -> None:
        """Where a look is due, render the rows that came in, classify their cells and hand the rules the reports."""
        core = self._core
        if not core.state.look_due[0].any():
            return
        self._follow()
        rows = {"source": int(core.state.source_row[0]), "target": int(core.state.target_row[0])}
        reports = []
        for due, side in zip(core.state.look_due[0], SIDES, strict=True):
            line = self._lines[side]
            if not due:
                reports.append(np.zeros(line.tray.columns, np.int8))
                continue
            frame = self._scene.look(side, rows[side])
            nursery_pitch_m = self._lines["source"].tray.pitch_m
            cells = trays.Cells(self._scene.cells_m(side), line.tray.pitch_m, nursery_pitch_m)
            reports.append(trays.detect(frame, cells))
        core.receive(0, *reports)

    def sight_width(self, rows: int) -> int:
        """See ``View.sight_width``."""
        return self._scene.sight_camera(rows // 2).width

    def sight(self, rows: int) -> Sight:
        """The presented rows as their cameras would see them now: the source's above the target's."""
        self._follow()
        halves = rows // 2, rows - rows // 2
        width = self.sight_width(rows)
        shown, place = [], []
        for side, height in zip(SIDES, halves, strict=True):
            last = len(self._lines[side].cells) - 1
            row = min(self._row[side], last)
            frame = self._scene.look(side, row, camera=self._scene.sight_camera(height, width))
            middle = on_picture(self._scene.cells_m(side), *frame.camera)
            # A row that has gone by is not presented any more.
            middle[self._row[side] > last] = np.nan
            shown.append(frame)
            place.append(middle + np.array([0.0, 0.0 if side == "source" else halves[0]]))
        rgb, depth = np.concatenate([f.rgb for f in shown]), np.concatenate([f.depth_m for f in shown])
        return Sight(rgb, depth, np.concatenate(place))

    def slot_marks(self) -> NDArray[np.int64]:
        """A pair's source cell and target cell: (K, 2), the target's marks come behind the source's."""
        n, m = self._core.source_shape[1], self._core.target_shape[1]
        return np.stack([np.repeat(np.arange(n), m), n + np.tile(np.arange(m), n)], axis=-1) + 1

    def frame(self) -> NDArray[np.uint8]:
        """Picture of the present state."""
        self._follow()
        return self._scene.render(*self.shot)

    def frames(self, plan: TransplantPlan, result: StepResult, frames_per_second: float) -> Iterator[NDArray[np.uint8]]:
        """Pictures of the decision that was just carried out, on a clock that runs on from one to the next."""
        self._go_back(plan)
        if self._clock is None or self._clock.frames_per_second != frames_per_second:
            self._clock = _Clock(frames_per_second)
        clock = self._clock
        kind = int(plan.kind[0])
        held: tuple[int, float] | None = None
        for move in moves(self._core, plan):
            motion = self._trajectories.motion(move)
            for time_s in clock.ticks(motion.duration_s):
                yield self._draw(motion.sample(time_s).position[0], 0.0 if move.loaded else 1.0, held)
            held = yield from self._grip(move, clock, held)
        here = self._trajectories.points[plan.end[0]]
        phases = dict(zip(self._core.phase_names, result.phases_s[0].tolist(), strict=True))
        if kind in (INDEX_SOURCE, INDEX_TARGET, FINISH):
            yield from self._index(kind, phases["index"], clock, here)
        elif kind > FINISH:
            # A carousel turns under a hood: the old row, then the new one.
            for _ in clock.ticks(phases["index"]):
                yield self._draw(here, 1.0, None)
        for _ in clock.ticks(phases["wait"]):
            yield self._draw(here, 1.0, None)
        self._follow()

    def close(self) -> None:
        """Close the scene; idempotent."""
        self._scene.close()

    def _draw(self, tool: Array, opening: float, held: tuple[int, float] | None) -> NDArray[np.uint8]:
        self._scene.set_tool(tool, opening, held)
        return self._scene.render(*self.shot)

    def _grip(self, move: Move, clock: _Clock, held: tuple[int, float] | None) -> Iterator[NDArray[np.uint8]]:
        """Stand at a move's end while the gripper works; what it then holds is the generator's value."""
        core, process = self._core, self._core.config.process
        n = core.source_shape[1]
        tool = self._trajectories.points[move.end]
        side: Side = "source" if move.end < n else "target"
        column = move.end if move.end < n else move.end - n
        line = self._lines[side]
        row = self._row[side]
        closing = move.then in ("grip", "miss")
        duration = process.grip_s if closing else process.release_s
        for time_s in clock.ticks(duration):
            share = min(time_s / _NEEDLES_S, 1.0)
            yield self._draw(tool, 1.0 - share if closing else share, held)
        in_cell = move.end < core.places.cells
        if move.then == "grip" and in_cell:
            held = int(line.cells[row, column]), float(line.looks[row, column])
            line.cells[row, column], line.hollow[row, column] = EMPTY, True
        elif move.then == "release":
            if in_cell and held is not None:
                # What the rules booked there may be less than what was carried: lost or damaged on the way.
                line.cells[row, column] = core.state.target_cells[0, row, column]
                line.looks[row, column] = held[1]
            held = None
        self._changed()
        return held

    def _index(self, kind: int, duration_s: float, clock: _Clock, tool: Array) -> Iterator[NDArray[np.uint8]]:
        """Move a conveyor on by a row."""
        side: Side = "source" if kind == INDEX_SOURCE else "target"
        begin, row = self._travel[side], self._row[side]
        stroke = self._travel_to(side, row + 1) - begin
        moving = duration_s - self._core.config.machine.conveyor_settle_s
        for time_s in clock.ticks(duration_s):
            self._travel[side] = begin + float(QUINTIC.sample(time_s, stroke, moving).position)
            self._changed()
            yield self._draw(tool, 1.0, None)

    def _follow(self) -> None:
        """Bring the scene to the rules' state."""
        core = self._core
        self._load_if_new()
        for side, cells in zip(SIDES, (core.state.source_cells, core.state.target_cells), strict=True):
            line, now = self._lines[side], cells[0, :-1]
            line.cells[...] = now
        # The target's cells never had plugs of their own.
        source = self._lines["source"]
        source.hollow[...] = (source.cells == EMPTY) & (core.source_began[0] != EMPTY)
        self._row = {"source": int(core.state.source_row[0]), "target": int(core.state.target_row[0])}
        self._travel = {side: self._travel_to(side, self._row[side]) for side in SIDES}
        self._changed()
        self._scene.set_tool(self._trajectories.points[core.state.place[0]])

    def _go_back(self, plan: TransplantPlan) -> None:
        """Bring the scene to where the decision began, whatever was shown before."""
        self._follow()
        kind = int(plan.kind[0])
        if kind < INDEX_SOURCE:
            places = self._core.cells_of_pair(int(plan.pair[0]))
            columns = places[0], places[1] - self._core.source_shape[1]
            for side, column, content in zip(SIDES, columns, plan.held[0], strict=True):
                self._lines[side].cells[self._row[side], column] = content
        elif kind in (INDEX_SOURCE, INDEX_TARGET, FINISH):
            side: Side = "source" if kind == INDEX_SOURCE else "target"
            self._row[side] -= 1
            self._travel[side] = self._travel_to(side, self._row[side])
        self._changed()
        self._scene.set_tool(self._trajectories.points[plan.start[0]])

    def _load_if_new(self) -> None:
        core = self._core
        if self._episode == core.episode[0]:
            return
        self._episode = int(core.episode[0])
        scenario, gap = core.config.scenario, core.config.machine.tray_gap_m
        source, target = core.state.source_cells[0, :-1].copy(), core.state.target_cells[0, :-1].copy()
        self._lines = {
            "source": TrayLine(scenario.source, source, core.source_looks[0].copy(), np.zeros(source.shape, bool), gap),
            "target": TrayLine(scenario.target, target, core.target_looks[0].copy(), np.ones(target.shape, bool), gap),
        }
        self._offsets = {side: line.offsets_m() for side, line in self._lines.items()}
        self._follow()

    def _travel_to(self, side: Side, row: int) -> float:
        """How far a conveyor has to go until a row is presented; one row goes on behind the last."""
        offsets = self._offsets[side]
        behind = max(row - len(offsets) + 1, 0) * self._lines[side].tray.pitch_m
        return float(offsets[min(row, len(offsets) - 1)]) + behind

    def _changed(self) -> None:
        self._scene.set_lines(
            self._lines["source"], self._lines["target"], self._travel["source"], self._travel["target"]
        )


class _Clock:
    """Spreads pictures evenly over pieces of time that follow each other."""

    def __init__(self, frames_per_second: float):
        self.frames_per_second = frames_per_second
        self._period_s = 1.0 / frames_per_second
        self._next_s = 0.0

    def ticks(self, duration_s: float) -> Iterator[float]:
        """Times of the pictures that fall into the next ``duration_s``."""
        while self._next_s < duration_s:
            yield self._next_s
            self._next_s += self._period_s
        self._next_s -= duration_s
