"""Where people see an environment with ``render_mode="human"``: a window, or a page where there is no display."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, nullcontext
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernels.config_kinds import show
from ..rendering.shots import Shot
from .assembly import Assembly, choice
from .references import resolved

PAGE = "fieldgym.viewer.page:Page"
"""Shows scenes in the browser; loaded where there is no display."""
FRAMES_PER_SECOND = 20.0
"""Pictures a second where people watch."""
_LEAST_PX, _MOST_PX = 32, 4096


def checked_shot(parts: Assembly[Any], camera: str | None, width: int | None, height: int | None) -> Shot:
    """The picture for people that is asked for; what is None is the task's own.

    Raises:
        ValueError: the task has no such camera, or a size is no number of pixels that can be drawn.
    """
    asked = {"camera": camera, "width": width, "height": height}
    given = {name: value for name, value in asked.items() if value is not None}
    if not given:
        return Shot(camera=parts.cameras[0]) if parts.cameras else Shot()
    if not parts.cameras:
        name, value = next(iter(given.items()))
        raise ValueError(
            f"{name} = {show(value)}: pictures of this task are as they are, its assembly names no cameras"
        )
    for name, value in given.items():
        if name != "camera" and (
            isinstance(value, bool) or not isinstance(value, int | np.integer) or not _LEAST_PX <= value <= _MOST_PX
        ):
            raise ValueError(f"{name} = {show(value)}: give a whole number of pixels in {_LEAST_PX}..{_MOST_PX}")
    return Shot(width, height, choice("camera", parts.cameras[0] if camera is None else camera, parts.cameras))


class Screen:
    """A window on the desktop, or a page in the browser; it opens when it is first needed."""

    def __init__(self, title: str):
        """Open nothing yet."""
        self._title = title
        self._window: Any = None
        self._page: Any = None

    def play(
        self,
        frames: Iterator[NDArray[np.uint8]],
        frames_per_second: float,
        on_frame: Callable[[NDArray[np.uint8]], None] | None = None,
        human: bool = True,
    ) -> None:
        """Play pictures (h, w, 3): to ``on_frame`` as they come, to people (``human``) as fast as it really went.

        Raises:
            RuntimeError: there is neither a display nor what serves a page.
        """
        began = time.perf_counter()
        # Who records wants pictures, and pictures are what a page then does without: it has scenes.
        with self._watching() if human and on_frame is None else nullcontext():
            for i, frame in enumerate(frames):
                if on_frame is not None:
                    on_frame(frame)
                if human:
                    if self._window is not None:
                        self._window.show(frame)
                    time.sleep(max(0.0, began + i / frames_per_second - time.perf_counter()))

    def close(self) -> None:
        """Close it; idempotent."""
        for shown in (self._window, self._page):
            if shown is not None:
                shown.close()

    def _watching(self) -> AbstractContextManager[Any]:
        """What is played to people under: what a page watches."""
        if self._window is None and self._page is None:
            self._open()
        return nullcontext() if self._page is None else self._page.watching()

    def _open(self) -> None:
        from ..simulation.window import Window

        window = Window(self._title)
        try:
            window.open()
            self._window = window
        except RuntimeError as error:
            try:
                self._page = resolved(PAGE)(self._title)
            except ImportError:
                raise RuntimeError(f'{error}; or see it in a browser: pip install "fieldgym[view]"') from error
