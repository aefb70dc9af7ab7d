"""The page: a server, the seats that play, and one loop that carries time on."""

from __future__ import annotations

import queue
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ..rendering.renderer import SUN
from .choices import choice_of
from .desk import Desk
from .limits import bound_of
from .marks import Marks
from .mirror import Mirror
from .play import Play
from .reel import Scene
from .seat import Seat

LOOPBACK = "127.0.0.1"
SCENES_PER_SECOND = 45.0
"""Scenes a second of the viewer's own time, whatever the speed."""
SPEEDS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0, 16.0)
_LONGEST_S = 0.1
"""A turn of the loop carries time on by this at most: what computes slower than it plays plays slower."""
_APART_M = 3.0
"""Between two machines side by side."""
_NARROW = 0.8
"""A page of less width a height is a phone's."""
_CAPTION_M = 0.55
"""Height of a replay's line of figures above the middle of what is shown."""
_NEAR = 2.5
"""A click means a candidate within so many times the size of its mark."""


class Viewer:
    """A live view of episodes in a browser.

    Attributes:
        play: what is played.
        seats: who plays, one or two.
        speed: simulated seconds a second.
        speeds: those to choose from.
        bound: what no policy can beat on this field, as parts of a scorecard; None where nobody knows.
        running: whether time goes on.
        now_s: simulated time.
        picked: slot of the first seat's candidates that a person looks at.
        updates: scenes that were shown so far.
    """

    def __init__(
        self,
        play: Play,
        make_seat: Callable[[Play, str], Seat],
        host: str = LOOPBACK,
        port: int = 8080,
        speed: float = 1.0,
        bounded: bool = True,
    ):
        """Serve the page.

        Args:
            play: what is played first.
            make_seat: makes the seat of a policy.
            host: who may connect; the loopback alone by default.
            port: of the page.
            speed: at first.
            bounded: find out beside the game what no policy can beat.
        """
        import viser

        self.play, self.speed, self.running = play, speed, False
        self.speeds = tuple(sorted({*SPEEDS, speed}))
        self.bound: dict[str, float] | None = None
        self.seats: list[Seat] = []
        self.updates = 0
        self._make_seat, self._bounded = make_seat, bounded
        self._mirrors: list[Mirror] = []
        self._marks: list[Marks] = []
        self.picked: int | None = None
        self.now_s = 0.0
        self._single, self._loads = False, 0
        self._hidden = frozenset({"true"})
        self._orders: queue.Queue[Callable[[], None]] = queue.Queue()
        self._closing = threading.Event()
        self.server = viser.ViserServer(host=host, port=port, label="fieldgym", verbose=False)
        light(self.server.scene)
        self.desk = Desk(self.server, self)

        @self.server.scene.on_click()
        def _(event: Any) -> None:
            self.order(lambda: self.pick_along(event.ray_origin, event.ray_direction))

        @self.server.on_client_connect
        def _(client: Any) -> None:
            self.order(lambda: self._aim_narrow(client))

        self.load(play)

    @property
    def address(self) -> str:
        """Of the page."""
        return f"http://{self.server.get_host()}:{self.server.get_port()}"

    def order(self, deed: Callable[[], None]) -> None:
        """Have something done in the loop's thread, which alone touches seats."""
        self._orders.put(deed)

    def load(self, play: Play, fresh: bool = True) -> None:
        """Begin an episode.

        Args:
            play: what is played from now on.
            fresh: make new environments and policies; else the present ones go back to the start.

        Raises:
            ValueError: something of it does not exist; what was played before goes on.
        """
        framed = 0
        names = [play.policy, *([play.against] if play.against else [])]
        if fresh:
            seats = [self._make_seat(play, name) for name in names]
            framed = len(self.seats)
            for seat in self.seats:
                seat.close()
            for mirror in self._mirrors:
                mirror.remove()
            self.seats, self._mirrors, self._marks = seats, [], []
        self.play, self._single, self.running = play, False, False
        scenes = [seat.begin(lambda env: _reset(env, play)) for seat in self.seats]
        self.now_s = max(seat.now_s for seat in self.seats)
        if fresh:
            # Names are not used again: a page may hear of their removal late.
            self._loads += 1
            aside = _aside(scenes[0])
            self._mirrors = [
                Mirror(self.server.scene, f"/seat{self._loads}-{k}", k * _APART_M * aside) for k in range(len(scenes))
            ]
            self._marks = [Marks(self.server.scene, mirror.name) for mirror in self._mirrors]
            if len(scenes) != framed:
                self._aim(scenes[0], 0.5 * (len(scenes) - 1) * _APART_M * aside)
        for mirror, scene in zip(self._mirrors, scenes, strict=True):
            self._show(mirror, scene)
        self.picked = self.bound = None
        for k in range(len(self.seats)):
            self.mark(k)
        self.desk.loaded()
        if self._bounded:
            threading.Thread(target=self._find_bound, args=(play,), daemon=True, name="fieldgym bound").start()

    def set_running(self, running: bool) -> None:
        """Let time go on, or stop it."""
        self.running, self._single = running and not self.over, False
        self.desk.running()

    def single(self, action: int | None = None) -> None:
        """Play the first seat's next decision, or the rest of the present one, and stop."""
        if self.over:
            return
        first = self.seats[0]
        if not first.busy:
            first.start(self._rate, action)
        self.running = self._single = True
        self.desk.running()

    def pick(self, slot: int | None) -> None:
        """Look at a candidate of the first seat."""
        self.picked = slot
        self.mark(0)
        self.desk.picked()

    def pick_along(self, origin: Any, direction: Any) -> None:
        """Look at the candidate of the first seat that is nearest to a ray in the page."""
        belief, middle = self.seats[0].belief, self._mirrors[0].middle
        if belief is None or middle is None or self.seats[0].busy:
            return
        root = self._mirrors[0].place - middle
        way = belief.slot_m + root - np.asarray(origin, np.float64)
        ray = np.asarray(direction, np.float64) / np.linalg.norm(direction)
        along = way @ ray
        off = np.linalg.norm(way - along[:, None] * ray, axis=1)
        off[~np.isfinite(off) | (along < 0.0)] = np.inf
        nearest = int(off.argmin())
        self.pick(nearest if off[nearest] < _NEAR * belief.size_m else None)

    def show_marks(self, what: str, shown: bool) -> None:
        """Show or hide a kind of marks."""
        self._hidden = (self._hidden - {what}) if shown else (self._hidden | {what})
        for marks in self._marks:
            marks.set_shown(what, shown)

    def mark(self, k: int) -> None:
        """Show what a seat believes and has chosen."""
        seat, marks = self.seats[k], self._marks[k]
        for what in marks.shown:
            marks.shown[what] = what not in self._hidden
        if seat.belief is not None:
            chosen = None if seat.choice is None else choice_of(seat.choice, seat.layout, seat.belief)
            with self.server.atomic():
                marks.show(
                    seat.belief,
                    None if chosen is None else chosen.slot,
                    self.picked if k == 0 else None,
                    "" if chosen is None else f"{seat.policy.name}: {chosen.text}",
                    seat.now_s,
                )
                marks.look(seat.watching.looks)

    @property
    def over(self) -> bool:
        """Whether every seat's episode has ended."""
        return all(seat.over for seat in self.seats)

    def run(self, until: Callable[[], bool] = lambda: False) -> None:
        """Play until the viewer is closed, or until ``until`` says so."""
        last = due = time.perf_counter()
        while not self._closing.is_set() and not until():
            self._obey()
            now = time.perf_counter()
            self.desk.tick()
            if self.running:
                self.go_on(min(now - last, _LONGEST_S) * self.speed)
            last = now
            # Late turns are made up for, but not many of them.
            due = max(due + 1.0 / SCENES_PER_SECOND, time.perf_counter() - _LONGEST_S)
            time.sleep(max(0.0, due - time.perf_counter()))

    def stop(self) -> None:
        """End the loop."""
        self._closing.set()

    def close(self) -> None:
        """Close the page and the environments; idempotent."""
        self.stop()
        for seat in self.seats:
            seat.close()
        self.server.stop()

    @property
    def _rate(self) -> float:
        return SCENES_PER_SECOND / self.speed

    def _obey(self) -> None:
        # What is ordered meanwhile has its turn later: time goes on in between.
        for _ in range(self._orders.qsize()):
            try:
                self._orders.get()()
            except ValueError as error:
                self.desk.tell(str(error))

    def go_on(self, ahead_s: float) -> None:
        """Carry time on."""
        now_s = self.now_s + ahead_s
        for k, (seat, mirror) in enumerate(zip(self.seats, self._mirrors, strict=True)):
            newest = None
            while not seat.over:
                if not seat.busy:
                    if seat.now_s > now_s:
                        break
                    seat.start(self._rate)
                scene, ended = seat.until(now_s)
                newest = scene or newest
                if not ended:
                    break
                newest = seat.finish() or newest
                self.desk.decided()
                self.picked = None if k == 0 else self.picked
                self.mark(k)
                if k == 0 and self._single:
                    self.now_s = now_s = max(self.now_s, min(now_s, seat.now_s))
                    self.set_running(False)
                    break
            if newest is not None:
                self._show(mirror, newest)
            self._marks[k].go_on(now_s)
        self.now_s = now_s
        if self.over:
            self.set_running(False)

    def _find_bound(self, play: Play) -> None:
        """Ask for the bound, in a thread of its own, and have it shown if this is still what is played."""
        found = bound_of(play)

        def take() -> None:
            if self.play == play:
                self.bound = found
                self.desk.bounded()

        self.order(take)

    def _show(self, mirror: Mirror, scene: Scene) -> None:
        with self.server.atomic():
            mirror.show(scene)
        self.updates += 1

    def caption(self) -> Callable[[str], None]:
        """A line above the first machine: what writes the time and every net rate behind its argument."""
        high = np.array([0.0, 0.0, _CAPTION_M])
        label = self.server.scene.add_label("/caption", "", position=high, anchor="bottom-center")

        def write(text: str) -> None:
            rates = ", ".join(f"{seat.policy.name} {100.0 * seat.scorecard['net_rate']:.1f} %" for seat in self.seats)
            line = f"{text}: {rates}"
            if label.text != line:
                label.text = line

        return write

    def _aim(self, scene: Scene, middle: Any) -> None:
        """Point the pages' cameras; with two machines from farther, beside the panel."""
        alone = len(self.seats) == 1
        aim(self.server, scene, middle + (0.0 if alone else 0.5) * _aside(scene), 1.1 if alone else 3.0)

    def _aim_narrow(self, client: Any) -> None:
        """On a page that is higher than wide the panel lies below: have the first machine in the upper half."""
        scene = self.seats[0].watching.scene
        if scene is None or client.camera.aspect > _NARROW:
            return
        away = 0.8 * (scene.eye - scene.middle) / client.camera.aspect
        low = self._mirrors[0].place - np.array([0.0, 0.0, 0.22 * float(np.linalg.norm(away))])
        client.camera.position, client.camera.look_at = low + away, low


def aim(server: Any, scene: Scene, place: Any, farther: float) -> None:
    """Point the cameras of all pages, those to come too, at a place (3,) as a picture's camera would be."""
    away = farther * (scene.eye - scene.middle)
    camera = server.initial_camera
    camera.position, camera.look_at, camera.fov = place + away, place, scene.view_rad
    for client in server.get_clients().values():
        client.camera.position, client.camera.look_at = place + away, place


def light(scene: Any) -> None:
    """The sun of the pictures, and the sky; nothing of it has to be fetched."""
    scene.configure_environment_map(None)
    scene.configure_default_lights(False)
    scene.add_light_hemisphere("/light/sky", sky_color=(226, 236, 246), ground_color=(150, 140, 128), intensity=2.6)
    scene.add_light_directional(
        "/light/sun", color=(255, 250, 240), intensity=2.4, cast_shadow=True, position=tuple(4.0 * SUN.towards)
    )


def _reset(env: Any, play: Play) -> tuple[Any, Any]:
    return env.reset(seed=play.seed, options=None if play.field is None else {"field": play.field})


def _aside(scene: Scene) -> Any:
    """The level axis that goes to the right in a picture, a unit vector (3,)."""
    ahead = scene.middle - scene.eye
    right = np.array([ahead[1], -ahead[0]])
    axis = int(np.abs(right).argmax())
    return np.eye(3)[axis] * np.sign(right[axis])
