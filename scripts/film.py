"""Films of episodes: one policy, or two beside each other on the same field, on one clock."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import partial
from typing import TypeVar

import numpy as np

from fieldgym.viewer.reel import Reel
from fieldgym.wrappers import Picture

ResultT = TypeVar("ResultT")
Hand = Callable[[Picture], None]


class _Stopped(Exception):
    """Nobody wants to see more."""


def film(write: Hand, plays: Sequence[Callable[[Hand], ResultT]]) -> list[ResultT]:
    """Film what is played side by side; who has ended stands still until all have.

    Args:
        write: takes the frames (h, w, 3).
        plays: each plays something, in a thread of its own, hands every frame of it to its argument, and gives a
            result. Frames with the same number are of the same moment.

    Returns:
        What they gave.
    """
    stopped = threading.Event()
    reels = [Reel(partial(_played, play, stopped)) for play in plays]
    shown: list[Picture | None] = [None] * len(reels)
    try:
        while any([_next(reel, shown, k) for k, reel in enumerate(reels)]):
            write(np.concatenate([picture for picture in shown if picture is not None], axis=1))
        return [reel.result() for reel in reels]
    finally:
        stopped.set()
        for reel in reels:
            with suppress(Exception):
                reel.result()


def _next(reel: Reel[Picture], shown: list[Picture | None], k: int) -> bool:
    """Put a reel's next frame in its place; False when it has none, and at once what went wrong if something did."""
    picture = reel.next()
    if picture is None:
        reel.result()
        return False
    shown[k] = picture
    return True


def _played(play: Callable[[Hand], ResultT], stopped: threading.Event, hand: Hand) -> ResultT:
    def handed(picture: Picture) -> None:
        if stopped.is_set():
            raise _Stopped
        hand(picture)

    return play(handed)
