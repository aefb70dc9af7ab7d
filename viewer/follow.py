"""A policy that is being learned, as of its last evaluation: played beside the training, in a process of its own."""

from __future__ import annotations

import multiprocessing
import os
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from .play import Play
from .seat import Seat
from .show import LOOPBACK, Viewer

PORT = 8080
_STARTS_WITHIN_S = 120.0
_EVERY_S = 1.0
"""Between two looks at the file."""
_NICE = 10
"""So much the page steps back behind the training."""
MakeSeat = Callable[[Play, str], Seat]


class Follower:
    """Whose turn it is: plays a policy's file, anew whenever it changes, and only while somebody watches."""

    def __init__(self, viewer: Viewer, file: Path):
        """Watch ``file``; until it is there, what the viewer plays goes on."""
        self._viewer, self._file = viewer, file
        self._shown, self._due, self._left = 0, 0.0, True

    def turn(self) -> None:
        """Do what is due, in the viewer's thread."""
        now = time.monotonic()
        if now < self._due:
            return
        self._due = now + _EVERY_S
        viewer = self._viewer
        watched = bool(viewer.server.get_clients())
        stamp = self._file.stat().st_mtime_ns if self._file.is_file() else 0
        if not watched:
            self._left = self._left or viewer.running
            if viewer.running:
                viewer.set_running(False)
        elif stamp != self._shown:
            # What is half written is read at the next turn.
            if self._load(replace(viewer.play, policy=str(self._file))):
                self._shown = stamp
        elif viewer.over:
            self._load(replace(viewer.play, seed=viewer.play.seed + 1))
        elif self._left:
            viewer.set_running(True)
        self._left = self._left and not watched

    def _load(self, play: Play) -> bool:
        try:
            self._viewer.load(play)
            self._viewer.set_running(True)
        except ValueError as error:
            self._viewer.desk.tell(str(error))
            return False
        return True


def beside(play: Play, file: Path, make_seat: MakeSeat, port: int = PORT) -> tuple[Any, str]:
    """Serve a page in a process of its own, which ends with this one.

    Args:
        play: what is shown until the file is there.
        file: of the policy.
        make_seat: a function at the top of a module, for the process to find.
        port: of the page; another free one is taken where it is in use.

    Returns:
        The process, to be terminated, and the page's address.

    Raises:
        OSError: the page could not be served.
    """
    spawned = multiprocessing.get_context("spawn")
    told, tells = spawned.Pipe(duplex=False)
    process = spawned.Process(target=_serve, args=(play, file, make_seat, port, tells), daemon=True)
    process.start()
    tells.close()
    try:
        if not told.poll(_STARTS_WITHIN_S):
            raise OSError("it did not start")
        answer = told.recv()
    except (EOFError, OSError):
        process.terminate()
        raise OSError("the page beside the training did not start: leave --view out") from None
    return process, str(answer)


def _serve(play: Play, file: Path, make_seat: MakeSeat, port: int, tells: Any) -> None:
    if hasattr(os, "nice"):
        os.nice(_NICE)
    parent = os.getppid()
    viewer = Viewer(play, make_seat, LOOPBACK, port, bounded=False)
    try:
        follower = Follower(viewer, file)
        tells.send(viewer.address)
        tells.close()

        def until() -> bool:
            follower.turn()
            return os.getppid() != parent

        viewer.run(until)
    except KeyboardInterrupt:
        pass
    finally:
        viewer.close()
