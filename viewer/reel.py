"""What happens in a decision, scene by scene, while it is carried out."""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable, Mapping
from typing import Any, Generic, NamedTuple, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..perception.frames import Camera, Frame
from ..rendering.instances import Instances
from ..rendering.library import MeshLibrary
from ..simulation.stage import Spectator, Stage, watched

T = TypeVar("T")
"""What is seen: scenes, or pictures of them."""
AHEAD = 12
"""Scenes that are worked out before they are shown."""


class Scene(NamedTuple):
    """What stands before people at one moment.

    Attributes:
        library: the meshes.
        groups: what stands there, by group; what has not changed is the same object as before.
        eye: (3,), where a picture would have been taken from, metres.
        middle: (3,), what would have been in its middle.
        view_rad: how much it would have shown from top to bottom.
    """

    library: MeshLibrary
    groups: Mapping[str, Instances]
    eye: NDArray[np.float64]
    middle: NDArray[np.float64]
    view_rad: float


class Look(NamedTuple):
    """What one of the machine's cameras saw last: the camera, and its frame."""

    camera: Camera
    frame: Frame


class Watching:
    """Takes the scenes and looks of what is done under it.

    Attributes:
        scene: the last one; None before the first.
        looks: the last one of each camera, by the camera's size and opening.
    """

    def __init__(self) -> None:
        """Nothing was seen yet."""
        self.scene: Scene | None = None
        self.looks: dict[Camera, Look] = {}
        self._width = 0

    def under(self) -> Any:
        """Context in which it watches."""
        return watched(Spectator(self.take, self._look))

    def take(self, stage: Stage, camera: Camera, eye: ArrayLike, middle: ArrayLike) -> None:
        """Take a scene, if it is the whole one."""
        # Smaller pictures are set into the large one: close-ups of the same scene.
        if camera.width < self._width:
            return
        self._width = camera.width
        place, aim = np.array(eye, np.float64), np.array(middle, np.float64)
        self.scene = Scene(stage.library, dict(stage.groups), place, aim, camera.field_of_view_rad)

    def _look(self, camera: Camera, frame: Frame) -> None:
        self.looks[camera] = Look(camera, frame)


class Reel(Generic[T]):
    """What is seen of one call, which runs in a thread of its own, a little ahead of whoever asks for them.

    Only one reel of an environment may run at a time, and nobody else may touch the environment while it does.
    """

    def __init__(self, act: Callable[[Callable[[T], None]], Any]):
        """Begin.

        Args:
            act: does something and hands every scene of it to its argument; what it gives is the ``result``.
        """
        self._scenes: queue.Queue[T | None] = queue.Queue(AHEAD)
        self._hurried, self._ended = threading.Event(), False
        self._result: Any = None
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._run, args=(act,), daemon=True, name="fieldgym reel")
        self._thread.start()

    def next(self) -> T | None:
        """The next scene; None when there are no more."""
        if self._ended:
            return None
        scene = self._scenes.get()
        if scene is None:
            self._ended = True
            self._thread.join()
        return scene

    def result(self) -> Any:
        """What the call gave; scenes that nobody has asked for are left out."""
        self._hurried.set()
        while self.next() is not None:
            pass
        if self._error is not None:
            raise self._error
        return self._result

    def _run(self, act: Callable[[Callable[[T], None]], Any]) -> None:
        try:
            self._result = act(self._hand)
        except BaseException as error:  # told where the result is asked for
            self._error = error
        self._scenes.put(None)

    def _hand(self, scene: T) -> None:
        if not self._hurried.is_set():
            self._scenes.put(scene)
