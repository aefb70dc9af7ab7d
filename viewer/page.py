"""A page that shows an environment while somebody's own program plays it."""

from __future__ import annotations

import sys
from contextlib import AbstractContextManager
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from ..perception.frames import Camera
from ..simulation.stage import Spectator, Stage, watched
from .mirror import Mirror
from .reel import Watching
from .show import LOOPBACK, aim, light

PORT = 8080


class Page:
    """Scenes of one environment, served to this machine alone."""

    def __init__(self, title: str, port: int = PORT):
        """Serve it and say where.

        Raises:
            ImportError: viser is not installed.
        """
        import viser

        self.server = viser.ViserServer(host=LOOPBACK, port=port, label=title, verbose=False)
        light(self.server.scene)
        self._mirror = Mirror(self.server.scene, "/scene", np.zeros(3))
        self._watching = Watching()
        self._open = True
        address = f"http://{LOOPBACK}:{self.server.get_port()}"
        print(f"fieldgym: no display here, watch {title} at {address}", file=sys.stderr)

    def watching(self) -> AbstractContextManager[Any]:
        """What is played under this shows."""
        return watched(Spectator(self._take, lambda camera, frame: None))

    def close(self) -> None:
        """Serve it no more; idempotent."""
        if self._open:
            self._open = False
            self.server.stop()

    def _take(self, stage: Stage, camera: Camera, eye: ArrayLike, middle: ArrayLike) -> None:
        first = self._watching.scene is None
        self._watching.take(stage, camera, eye, middle)
        if self._watching.scene is not None:
            with self.server.atomic():
                self._mirror.show(self._watching.scene)
            if first:
                aim(self.server, self._watching.scene, np.zeros(3), 1.1)
