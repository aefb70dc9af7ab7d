"""The sorter's rendered world: its camera's reports, and pictures for people."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ...motion.orientation import LEVEL, conjugate, product, tilted
from ...perception.frames import Frame
from ...perception.produce import Belt, Produce, ProduceSettings, detect
from ...rendering.noise import add_noise, stream
from ..columns import names
from ..core import Array, Sight, StepResult, View
from ..pixels import on_picture
from .columns import ITEM, NUMBER, PHASE, REWARD, Report
from .core import SortingCore
from .drawing import FRUIT
from .motions import PickMotion, Way
from .scene import BELT_END_M, BELT_START_M, BIN_HOLDS, CAMERA_HEIGHT_M, OPEN_M, ShownItem, SorterScene, item_colour
from .state import PICK, SorterPlan

MATCH_RADIUS_M = 0.025
"""A report farther than this from every item is counted as false."""
DEPTH_SIGMA_M = 0.001
"""Noise of a depth pixel [assumed: a structured-light camera at half a metre]."""
COLOUR_SIGMA = 3.0
"""Noise of a colour value out of 255 [assumed]."""
GAIN_SIGMA = 0.03
"""Drift of each colour channel's gain from image to image [assumed]."""


_EMPTY_GAP_M = 0.010
"""From the middle of the gripper to either pad where they close on nothing."""
_GRAVITY_M_S2 = 9.81


def sensor_noise(frame: Frame, seed: int, number: int) -> Frame:
    """What a real camera would make of a rendered image; the same for the same episode and image."""
    sigmas = GAIN_SIGMA, COLOUR_SIGMA, DEPTH_SIGMA_M
    with np.errstate(over="ignore"):
        rgb, depth = add_noise(stream([seed, number]), frame.rgb, frame.depth_m, *sigmas)
    return Frame(rgb, depth, frame.camera)


class SorterView(View[SorterPlan]):
    """Scene of one world of the rules; follows the rules' state by itself."""

    depth_range_m = CAMERA_HEIGHT_M - 0.10, CAMERA_HEIGHT_M + 0.10

    def __init__(self, core: SortingCore, scene: SorterScene | None = None):
        """Build the scene, where none is given."""
        self._core, self._config = core, core.config
        self._scene = scene or SorterScene(core.config)
        self._settings = ProduceSettings(ware_from_m=core.config.produce.ware_from_m)
        self._episode, self._frames = -1, 0
        self._free = np.zeros(0, bool)
        self._binned: list[tuple[int, ShownItem]] = []
        self._in_bin = np.zeros(4, np.int64)

    def beside(self, core: SortingCore) -> SorterView:
        """See ``View.beside``."""
        return SorterView(core, self._scene.another())

    def sense(self) -> None:
        """Take the images that were due since the last look and hand their reports to the rules."""
        core, belt = self._core, self._config.belt
        self._load_if_new()
        now = float(core.time_s[0])
        while self._due_s(self._frames) <= now and self._due_s(self._frames) <= float(core.state.end_s[0]):
            taken_s, seen = self.take(self._frames)
            half = 0.5 * belt.camera_step_m
            near = np.abs(seen.position[:, 0] - belt.camera_x_m) <= half
            if near.any():
                core.receive(0, self._reports(seen.where(near), taken_s))
            self._frames += 1

    def take(self, number: int) -> tuple[float, Produce]:
        """Render the belt as it was when an image was due, and find the produce in it: the time and the items."""
        self._load_if_new()
        taken_s = self._due_s(number)
        self._scene.set_belt(self._config.belt.speed_m_s * taken_s)
        self._scene.set_items(self._items(taken_s, np.ones_like(self._free)))
        look = sensor_noise(self._scene.look(), int(self._core.sensor_seed[0]), number)
        height = self._config.machine.sorter.belt_height_m
        return taken_s, detect(look, Belt(height), self._settings)

    def sight_width(self, rows: int) -> int:
        """See ``View.sight_width``."""
        return self._scene.sight_camera(rows).width

    def sight(self, rows: int) -> Sight:
        """The belt from the camera to the end of the reach, without the machine over it."""
        core, state, speed = self._core, self._core.state, self._config.belt.speed_m_s
        now, tool_m = float(core.time_s[0]), core.tables.tool_m
        self._scene.set_belt(speed * now)
        self._scene.set_items(self._items(now, state.item_free[0]))
        frame = self._scene.look_along(rows)
        report = state.slot_report[0]
        number = state.number[0, report]
        # Where the item is, from where the platform has to be over it.
        along = speed * (now - number[:, NUMBER.passing_s]) - tool_m * number[:, NUMBER.z_axis_x]
        across = number[:, NUMBER.across_m] - tool_m * number[:, NUMBER.z_axis_y]
        up = number[:, NUMBER.height_m] - tool_m * number[:, NUMBER.z_axis_z] + core.tables.above_m
        place = np.column_stack([along, across, self._config.machine.sorter.belt_height_m + up])
        place[report == state.number.shape[1] - 1] = np.nan
        return Sight(frame.rgb, frame.depth_m, on_picture(place, *frame.camera))

    def frame(self) -> NDArray[np.uint8]:
        """Picture of the present state."""
        core = self._core
        self._load_if_new()
        self._settle()
        at = np.array([[*core.state.place[0], self._config.machine.travel_level_m]])
        return self._draw(float(core.time_s[0]), Way(at, core.state.turn[:1]), 0)

    def frames(self, plan: SorterPlan, result: StepResult, frames_per_second: float) -> Iterator[NDArray[np.uint8]]:
        """Pictures of a decision: waiting, the way to the item and down, and to the bin."""
        core = self._core
        self._load_if_new()
        elapsed_s = float(result.phases_s[0].sum())
        began_s = float(core.time_s[0]) - elapsed_s
        waiting_s = float(result.phases_s[0, PHASE.wait])
        times = np.arange(0.0, elapsed_s, 1.0 / frames_per_second)
        moving = plan.kind[0] == PICK
        held = bool(moving and result.phases_s[0, PHASE.release] > 0.0)
        item = int(core.state.report_item[0, plan.report[0]]) if held else -1
        at = np.array([[*plan.start[0], self._config.machine.travel_level_m]])
        way = Way(np.repeat(at, len(times), 0), np.repeat(plan.start_turn[:1], len(times), 0))
        gaps, grasp = np.full(len(times), OPEN_M), (np.zeros(3), LEVEL)
        closing_s, falls_s = np.inf, np.inf
        dropped = held and result.rewards[0, REWARD.dropped] != 0.0
        if moving:
            motion = PickMotion(self._config, plan)
            way = motion.sample(times - waiting_s, held)
            closing_s = waiting_s + motion.closing_s
            # Before an empty bin stands there, the fingers stay shut.
            opens_s, open_s = elapsed_s - self._config.grip.release_s, elapsed_s
            shut_m = _EMPTY_GAP_M
            if held:
                lies = core.items[0, item]
                shut_m = 0.5 * lies[ITEM.length_m] * lies[ITEM.width]
                grasp = self._grasp(item, began_s + closing_s, motion.sample(np.array([motion.closing_s]), held))
            else:
                opens_s = waiting_s + motion.lifted_s
            if dropped:
                falls_s = closing_s + 0.6 * (elapsed_s - closing_s)
                opens_s = open_s = np.inf
            shut_s = closing_s + 0.5 * self._config.grip.grip_s
            gaps = np.interp(times, [closing_s, shut_s, opens_s, open_s], [OPEN_M, shut_m, shut_m, OPEN_M])
        for k, time in enumerate(times.tolist()):
            carried = None
            if held and time >= closing_s:
                carried = self._carried(item, way, k, grasp)
            if carried is not None and time >= falls_s:
                # It lets go where it is, over the belt or beside it, and is out of the game.
                carried.position[2] -= 0.5 * _GRAVITY_M_S2 * (time - falls_s) ** 2
            yield self._draw(began_s + time, way, k, carried, float(gaps[k]))
        if dropped:
            self._free[item] = False
        if held and not dropped:
            self._put_in_bin(item, plan)
        self._settle()

    def close(self) -> None:
        """Close the scene; idempotent."""
        self._scene.close()

    def _due_s(self, number: int) -> float:
        """When an image is taken: one each step of the belt, from when the first item could pass the camera."""
        belt = self._config.belt
        first = (belt.camera_x_m - belt.start_x_m) / belt.speed_m_s
        return first + number * belt.camera_step_m / belt.speed_m_s

    def _load_if_new(self) -> None:
        core = self._core
        if self._episode == int(core.episode[0]):
            return
        self._episode, self._frames = int(core.episode[0]), 0
        self._free = core.state.item_free[0].copy()
        self._binned, self._in_bin = [], np.zeros(4, np.int64)
        self._scene.set_items([])

    def _settle(self) -> None:
        """Items that the rules took while nobody watched are in their bins."""
        core = self._core
        taken = np.flatnonzero(self._free & ~core.state.item_free[0])
        for item in taken.tolist():
            self._free[item] = False
            self._lay(item, int(core.items[0, item, ITEM.grade]))

    def _put_in_bin(self, item: int, plan: SorterPlan) -> None:
        self._free[item] = False
        self._lay(item, int(plan.grade[0]))

    def _lay(self, item: int, grade: int) -> None:
        number = int(self._in_bin[grade])
        self._in_bin[grade] += 1
        orders = self._config.scenario.orders
        if number % (orders.bin_holds if orders.shipments else BIN_HOLDS) == 0:
            # A full bin is exchanged for an empty one.
            self._binned = [entry for entry in self._binned if entry[0] != grade]
        # The long ones lie along the belt: a bin is not much wider than two of them.
        turn = tilted(0.15, 1.7 * item, 0.3 * (item % 3 - 1))
        self._binned.append((grade, self._shown(item, self._scene.bin_place(grade, number), turn)))

    def _draw(
        self, time_s: float, way: Way, row: int, carried: ShownItem | None = None, gap_m: float = OPEN_M
    ) -> NDArray[np.uint8]:
        scene = self._scene
        items = self._items(time_s, self._free, -1 if carried is None else carried.key)
        items += [] if carried is None else [carried]
        items += [shown for _, shown in self._binned]
        scene.set_belt(self._config.belt.speed_m_s * time_s)
        scene.set_items(items)
        scene.set_machine(way.poses()[row], gap_m)
        return scene.render(*self.shot)

    def _grasp(self, item: int, time_s: float, way: Way) -> tuple[Array, Array]:
        """Where an item lies in the frame of the platform at a moment: offset (3,) and quaternion (4,)."""
        position, turn = self._lies(item, time_s)
        back = conjugate(way.turn[0])
        position[2] -= self._config.machine.sorter.origin_height_m
        return _rotate(back, position - way.position[0]), product(back, turn)

    def _carried(self, item: int, way: Way, row: int, grasp: tuple[Array, Array]) -> ShownItem:
        """An item that moves with the platform."""
        where = way.position[row] + _rotate(way.turn[row], grasp[0])
        where[2] += self._config.machine.sorter.origin_height_m
        return self._shown(item, where, product(way.turn[row], grasp[1]))

    def _lies(self, item: int, time_s: float) -> tuple[Array, Array]:
        """World position (3,) and quaternion of an item on the belt."""
        lies = self._core.items[0, item]
        x = self._config.belt.speed_m_s * (time_s - lies[ITEM.passing_s])
        position = np.array([x, lies[ITEM.across_m], self._config.machine.sorter.belt_height_m + lies[ITEM.up_m]])
        return position, tilted(lies[ITEM.tilt_rad], lies[ITEM.azimuth_rad], lies[ITEM.yaw_rad])

    def _items(self, time_s: float, shown: NDArray[np.bool_], but: int = -1) -> list[ShownItem]:
        # What does not exist comes at infinity and never is on the belt.
        x = self._config.belt.speed_m_s * (time_s - self._core.items[0, :, ITEM.passing_s])
        there = shown & (x > BELT_START_M + 0.04) & (x < BELT_END_M - 0.04)
        return [self._shown(int(item), *self._lies(int(item), time_s)) for item in np.flatnonzero(there) if item != but]

    def _shown(self, item: int, position: Array, quaternion: Array) -> ShownItem:
        lies = self._core.items[0, item]
        length, width, thickness, skin = lies[[ITEM.length_m, ITEM.width, ITEM.thickness, ITEM.skin]].tolist()
        fruit = int(lies[ITEM.grade]) // 2 == FRUIT
        axes_m = (round(length, 6), round(length * width, 6), round(length * thickness, 6))
        return ShownItem(item, position, quaternion, axes_m, item_colour(fruit, skin, (0.618 * item) % 1.0))

    def _reports(self, seen: Produce, taken_s: float) -> Array:
        belt, height = self._config.belt, self._config.machine.sorter.belt_height_m
        passing = taken_s - seen.position[:, 0] / belt.speed_m_s
        report = {
            "passing_s": passing,
            "across_m": seen.position[:, 1],
            "up_m": seen.position[:, 2] - height,
            "yaw_rad": seen.yaw,
            "tilt_rad": seen.tilt,
            "azimuth_rad": seen.azimuth,
            "length_m": seen.axes_m[:, 0],
            "width": seen.axes_m[:, 1] / seen.axes_m[:, 0],
            "thickness": np.minimum(seen.axes_m[:, 2] / seen.axes_m[:, 0], 1.0),
            "grade": seen.grade,
            "seen_s": np.full(len(passing), taken_s + belt.latency_s),
            "item": self._items_behind(seen, taken_s),
        }
        return np.stack([report[name] for name in names(Report)], axis=-1)

    def _items_behind(self, seen: Produce, taken_s: float) -> NDArray[np.int64]:
        """Index of the true item nearest to each report, for scoring alone."""
        items = self._core.items[0]
        place = np.stack(
            [self._config.belt.speed_m_s * (taken_s - items[:, ITEM.passing_s]), items[:, ITEM.across_m]], axis=-1
        )
        # What does not exist comes at infinity.
        place[np.isinf(place[:, 0])] = np.inf
        distance = np.linalg.norm(seen.position[:, None, :2] - place[None], axis=-1)
        nearest = distance.argmin(axis=1)
        return np.where(distance.min(axis=1) <= MATCH_RADIUS_M, nearest, len(place) - 1)


def _rotate(quaternion: Array, vector: Array) -> Array:
    """Turn a vector (3,) by a quaternion (4,)."""
    w, axis = quaternion[0], quaternion[1:]
    aside = np.asarray(np.cross(axis, vector), dtype=np.float64) + w * vector
    return vector + 2.0 * np.asarray(np.cross(axis, aside), dtype=np.float64)
