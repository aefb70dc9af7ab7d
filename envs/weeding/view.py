"""The weeders' front camera at work: tracks for the rules, pictures for people; tools add their machine."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from typing import Generic, TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from ...perception.weeds import Rows, Seedlings, WeedTracker
from ...rendering.shots import MACHINE
from ..core import Array, Sight, StepResult, View
from ..pixels import on_picture
from .core import WeedingCore
from .eyes import Eyes, eyes_of
from .scene import FieldScene
from .standing import Standing
from .state import MODES, WAIT, WeederPlan
from .straying import WHOLE_M
from .timing import G

FRAME_EVERY_M = 0.06
"""The front camera takes a picture after this much way: six or seven of every weed."""
DELAY_S = 0.15
"""From a picture to the use of what it showed [assumed, within the published 50-300 ms]."""
SAME_M = 0.006
"""A track this near to where the tool has worked is of the same plant."""
DRIFT_SHARE = 0.01
"""Standard deviation of the odometry's scale [published range 1-2 % of the distance]."""
_HEEDED = 15
"""The odometry is corrected by the median of so many of the tool camera's last looks."""
_OFF_M, _SETTLED, _OFF_SETTLED_M = 0.008, 4, 0.004
"""What the tool camera is told is off by about this, and by less from so many looks on [identified]."""

_NONE = -1
"""No episode."""
_SETTLE_S = 0.12
"""Pictures of a decision show what it did to plants in its last moment."""
_INSET_PX = 224, 168
"""Size of the small pictures beside the large one."""
_INSETS_FROM_PX = 640, 368
"""A picture holds small ones, and a line of figures, from this size on."""


class FrontCamera:
    """Pictures while driving, tracks, and the odometry that carries them on; one strip of one world."""

    def __init__(self, scene: FieldScene, start_m: float, drift: float, eyes: Eyes):
        """Begin before the strip: the machine has been driving for a camera's view already."""
        self._scene, self._drift, self._eyes = scene, drift, eyes
        self.tracker, self._rows = WeedTracker(least=eyes.least), Rows(scene.config.scenario.rows_m)
        self._slips: list[float] = []
        self._known = 0.0
        cart = scene.config.cart
        self._ahead_m, self._half_view_m = cart.camera_ahead_m, 0.5 * cart.camera_view_m - WHOLE_M
        # Pictures from before the strip came into view show nothing of it.
        self.next_m = max(start_m, 0.0) - scene.config.cart.seen_ahead_m
        self.last: tuple[NDArray[np.uint8], Seedlings] | None = None

    def drive(self, cart_m: float) -> None:
        """Take the pictures that are due until the cart is at ``cart_m``."""
        while self.next_m <= cart_m:
            frame = self._scene.look_front(self.next_m)
            found = self._eyes.front(frame, self._rows)
            middle, half = self.next_m + self._ahead_m, self._half_view_m
            self.tracker.update(found, self.next_m, (middle - half, middle + half))
            self.last = frame.rgb, found
            self.next_m += FRAME_EVERY_M

    def place(self, track_place: Array, last_m: float, cart_m: float) -> Array:
        """Where the odometry believes that a plant is, as the cart's position is true."""
        return self.places(track_place[None], np.array([last_m]), cart_m)[0]

    def places(self, track_places: Array, last_m: Array, cart_m: float) -> Array:
        """The same (n, 2) of plants at ``track_places`` (n, 2) that were last seen from ``last_m`` (n,)."""
        standing, moved = self._scene.standing, track_places.copy()
        errs_m = (self._drift - self._known) * (cart_m - last_m)
        if standing is not None:
            errs_m += np.array([standing.slipped_m(one_m, cart_m) for one_m in last_m.tolist()])
        moved[:, G.along] += errs_m
        return moved

    @property
    def off_m(self) -> float:
        """How far ``place`` is off."""
        return _OFF_M if len(self._slips) < _SETTLED else _OFF_SETTLED_M

    def heed(self, last_m: float, cart_m: float, told: Array, seen: Array) -> None:
        """Learn from where the tool camera sees a plant by how much of its way the odometry errs."""
        if self._eyes.calibrates and cart_m > last_m:
            self._slips.append(self._known + float(told[G.along] - seen[G.along]) / (cart_m - last_m))
            self._known = float(np.median(self._slips[-_HEEDED:]))


def boxed(rgb: NDArray[np.uint8], found: Seedlings) -> NDArray[np.uint8]:
    """A small copy of the front camera's picture with boxes: yellow about crop plants, red about weeds."""
    picture = rgb.copy()
    for (x, y, w, h), crop in zip(found.box.tolist(), found.crop.tolist(), strict=True):
        cv2.rectangle(picture, (x, y), (x + w, y + h), (250, 220, 60) if crop else (255, 60, 50), 2)
    width = _INSET_PX[0]
    size = width, round(width * len(rgb) / rgb.shape[1])
    return np.asarray(cv2.resize(picture, size, interpolation=cv2.INTER_AREA), np.uint8)


SceneT = TypeVar("SceneT", bound=FieldScene)
Show = Callable[[SceneT], None]
"""Puts the machine of a scene where it is at some time."""


class FieldView(View[WeederPlan], ABC, Generic[SceneT]):
    """Scenes of one world of the rules; follows the rules' state by itself. Each tool adds its machine.

    Attributes:
        core: the rules.
        eyes: what the cameras' pictures are looked at with.
    """

    def __init__(self, core: WeedingCore):
        """Build nothing yet: scenes come with the first look or picture."""
        self.core = core
        self.eyes = eyes_of(core.config.eyes)
        self._watched: SceneT | None = None
        self._stage: SceneT | None = None
        self._front: FrontCamera | None = None
        self._loaded = self._sensed = _NONE
        self._listed: list[int] = []
        self._marks: list[Array] = []
        self._shown_dead = np.zeros(0, bool)
        self._focus: Array | None = None
        self._sight: SceneT | None = None
        self._sighted = _NONE

    def beside(self, core: WeedingCore) -> FieldView[SceneT]:
        """See ``View.beside``."""
        one = type(self)(core)
        one._watched = self.camera_scene().another()
        return one

    @abstractmethod
    def make_scene(self) -> SceneT:
        """A scene: one for the cameras, and one for people with the machine in it."""

    @abstractmethod
    def standing(self) -> Show[SceneT]:
        """The machine as it stands now."""

    @abstractmethod
    def moving(self, plan: WeederPlan, phases_s: Array, time_s: Array) -> Iterator[Show[SceneT]]:
        """The machine at times (n,) of a decision that took ``phases_s`` (1, P)."""

    def sense(self) -> None:
        """Take the pictures that are due and hand the rules all tracks that are known by now."""
        core = self.core
        if self._sensed != self._identity() or self._front is None:
            self._sensed = self._identity()
            scene = self.camera_scene()
            self.show_strip(scene)
            look, ground = float(core.ground_look[0]), core.config.scenario.ground
            told = ground.drift_share is not None
            drift = 0.0 if told else DRIFT_SHARE * (2.0 * look - 1.0) * np.sqrt(3.0)
            self._front = FrontCamera(scene, -core.config.cart.start_m, drift, self.eyes)
            self._listed = []
        cart, front = float(core.state.cart[0]), self._front
        front.drive(cart)
        tracks = front.tracker.tracks
        reached = cart - float(core.state.speed[0]) * DELAY_S
        known = set(self._listed)
        # Once listed, a track keeps its place in the list.
        self._listed += [i for i, t in enumerate(tracks) if t.confirmed_m <= reached and i not in known]
        listed = [tracks[i] for i in self._listed]
        seen = np.array([t.place for t in listed]).reshape(-1, 2)
        place = front.places(seen, np.array([t.last_m for t in listed]), cart)
        crop = np.array([t.is_crop for t in listed], bool)
        votes = np.array([t.votes for t in listed]).reshape(-1, 2, 3)
        gap = np.full(len(listed), 1.0)
        if crop.any():
            gap = np.hypot(*(place[:, None] - place[crop][None]).transpose(2, 0, 1)).min(axis=1)
        half = 0.5 * core.config.scenario.band_m
        done = crop | np.array([t.treated or t.is_doubtful for t in listed], bool) | (np.abs(place[:, G.across]) > half)
        sure = np.array([t.confidence for t in listed], float)
        core.receive(0, place, votes.sum(axis=2).argmax(axis=1), votes.sum(axis=1).argmax(axis=1), gap, sure, done)

    def attend(self, action: int) -> None:
        """Note which plant an action works on, and look at it where the tool has a camera of its own."""
        core = self.core
        option = action % core.base_actions
        if option == core.base_actions - 1 or not core.option_legal(0, option) or self._front is None:
            return
        index = int(core.state.slot_track[0, option // MODES])
        self._front.tracker.tracks[self._listed[index]].treated = True
        self.treat_near(core.state.track_report[0, index])
        if core.config.scenario.ground.tool_camera or core.tables.looks_after:
            self.aim_at(index, action)

    def aim_at(self, index: int, action: int) -> None:
        """Correct the aim of an action at a listed track; without a camera beside the tool nothing is."""

    def heed(self, index: int, told: Array, seen: Array) -> None:
        """Have the odometry learn from where the tool camera sees a listed track's plant that it was ``told`` of."""
        if self._front is not None:
            track = self._front.tracker.tracks[self._listed[index]]
            self._front.heed(track.last_m, float(self.core.state.cart[0]), told, seen)

    @property
    def off_m(self) -> float:
        """How far the odometry puts plants off when they are under the tool."""
        return _OFF_M if self._front is None else self._front.off_m

    def treat_near(self, place: Array) -> None:
        """A plant that fell apart in the front camera's pictures has several tracks: one treatment is for them all."""
        if self._front is None:
            return
        n = len(self._listed)
        same = np.hypot(*(self.core.state.track_report[0, :n] - place).T) <= SAME_M
        for i in np.flatnonzero(same).tolist():
            self._front.tracker.tracks[self._listed[i]].treated = True

    @property
    def depth_range_m(self) -> tuple[float, float]:  # type: ignore[override]
        """From above the highest crop plant to the ground under a leaning ray."""
        height_m = self.camera_scene().eye_m
        return 0.6 * height_m, 1.4 * height_m

    @property
    def _core(self) -> WeedingCore:
        return self.core

    def sight_width(self, rows: int) -> int:
        """See ``View.sight_width``."""
        return self.camera_scene().sight_camera(rows, self.core.machine.front_m).width

    def sight(self, rows: int) -> Sight:
        """The ground from the tool's window to where the camera has been, dead plants as the tool left them."""
        core, state = self.core, self.core.state
        if self._sight is None:
            self._sight = self.camera_scene().another()
        scene, end = self._sight, core.weeds_end
        if self._sighted != self._identity():
            self.show_strip(scene)
            self._sighted = self._identity()
        dead = state.plant_dose[0] >= state.plant_tolerance[0]
        scene.set_dead(dead[:end][core.plant_exists[0, :end]], dead[end:], [])
        frame = scene.look_along(float(state.cart[0]), rows, core.machine.front_m)
        track = state.slot_track[0]
        place = np.column_stack([state.track_report[0, track], np.zeros(len(track))])
        place[track == core.capacity] = np.nan
        return Sight(frame.rgb, frame.depth_m, on_picture(place, *frame.camera))

    def frame(self) -> NDArray[np.uint8]:
        """Picture of the present state."""
        return self._draw(self.standing())

    def frames(self, plan: WeederPlan, result: StepResult, frames_per_second: float) -> Iterator[NDArray[np.uint8]]:
        """Pictures of a decision at a steady rate; what it did to the plants shows at its end."""
        phases = result.phases_s
        total = float(phases[0].sum())
        time = np.arange(0.0, total, 1.0 / frames_per_second)
        aim = plan.aim[0].copy() if plan.kind[0] < WAIT else None
        if aim is not None:
            self._focus = aim
        for show, now in zip(self.moving(plan, phases, time), time.tolist(), strict=True):
            if aim is not None and now >= total - _SETTLE_S:
                self._marks.append(aim)
                aim = None
            yield self._draw(show, settled=aim is None)
        if aim is not None:
            self._marks.append(aim)

    def close(self) -> None:
        """Close the scenes; idempotent."""
        for scene in (self._watched, self._stage, self._sight):
            if scene is not None:
                scene.close()

    def _draw(self, show: Show[SceneT], settled: bool = True) -> NDArray[np.uint8]:
        """A picture; plants that the present decision kills are still alive in it unless it is ``settled``."""
        core = self.core
        if self._stage is None:
            self._stage = self.make_scene()
            self._loaded = _NONE
        dead = core.state.plant_dose[0] >= core.state.plant_tolerance[0]
        if self._loaded != self._identity():
            self.show_strip(self._stage)
            self._loaded, self._marks, self._shown_dead = self._identity(), [], dead & settled
        if settled:
            self._shown_dead = dead
        exists, end = core.plant_exists[0, : core.weeds_end], core.weeds_end
        self._stage.set_dead(self._shown_dead[:end][exists], self._shown_dead[end:], self._marks)
        show(self._stage)
        picture = self._stage.render(*self.shot)
        high, wide, _ = picture.shape
        if self.shot.camera != MACHINE or wide < _INSETS_FROM_PX[0] or high < _INSETS_FROM_PX[1]:
            return picture
        insets = []
        if self._front is not None and self._front.last is not None:
            insets.append(("front camera", boxed(*self._front.last)))
        if self._focus is not None:
            insets.append(("tool", self._stage.close_up(self._focus, *_INSET_PX)))
        top = 8
        for name, inset in insets:
            h, w, _ = inset.shape
            cv2.putText(inset, name, (7, 15), cv2.FONT_HERSHEY_SIMPLEX, 0.42, (245, 245, 245), 1, cv2.LINE_AA)
            cv2.rectangle(inset, (0, 0), (w - 1, h - 1), (245, 245, 245), 2)
            picture[top : top + h, -8 - w : -8] = inset
            top += h + 8
        return self._gauge(picture)

    def _gauge(self, picture: NDArray[np.uint8]) -> NDArray[np.uint8]:
        """Write into a picture what has been killed and missed of what has passed."""
        core = self.core
        names = dict(zip(core.score_names, core.scores()[0].tolist(), strict=True))
        killed = int(names["done"])
        passed = max(np.count_nonzero(core.plant_exists[0, : core.weeds_end] & self._behind()), killed)
        text = f"killed {killed}   missed {passed - killed}   crop lost {int(names['damaged'])}"
        panel = picture[6:58, 6:330]
        panel[:] = (0.35 * panel).astype(np.uint8)
        cv2.putText(picture, text, (16, 28), cv2.FONT_HERSHEY_SIMPLEX, 0.55, (245, 245, 245), 1, cv2.LINE_AA)
        cv2.rectangle(picture, (16, 38), (320, 50), (190, 70, 60), -1)
        cv2.rectangle(picture, (16, 38), (16 + int(304 * killed / max(passed, 1)), 50), (80, 180, 75), -1)
        return picture

    def _behind(self) -> NDArray[np.bool_]:
        core = self.core
        gone = core.state.plant[0, : core.weeds_end, G.along] < core.state.cart[0] - core.machine.front_m
        return gone | (core.state.plant_dose[0] >= core.state.plant_tolerance[0])[: core.weeds_end]

    def camera_scene(self) -> SceneT:
        """The scene that the cameras look at; the machine is left out of it."""
        if self._watched is None:
            self._watched = self.make_scene()
        return self._watched

    def show_strip(self, scene: FieldScene) -> None:
        """Load the rules' present strip into a scene."""
        core, end = self.core, self.core.weeds_end
        exists = core.plant_exists[0, :end]
        scene.load(
            core.state.plant[0, :end][exists],
            core.plant_species[0, :end][exists],
            core.state.plant_kind[0, :end][exists],
            core.plant_look[0, :end][exists],
            core.state.plant[0, end:],
            float(core.ground_look[0]),
            Standing(core.state.surface[0].copy(), core.tables.shape) if core.state.surface.shape[1] else None,
        )

    def _identity(self) -> int:
        return int(self.core.episode[0])
