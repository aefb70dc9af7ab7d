"""Waiting for what has to happen: no longer than it takes, and not for ever. Tests sleep nowhere else."""

import time
from collections.abc import Callable

PATIENCE_S = 120.0
"""After this a test gives up; no machine is so slow."""
_PAUSE_S = 0.02


def soon(done: Callable[[], bool], within_s: float) -> bool:
    """Whether something has happened, at the latest after a while."""
    end = time.monotonic() + within_s
    while not (happened := done()) and time.monotonic() < end:
        time.sleep(_PAUSE_S)
    return happened


def until(done: Callable[[], bool], what: str = "it did not happen", patience_s: float = PATIENCE_S) -> None:
    """Wait until something has happened; the test fails with ``what`` if it does not."""
    assert soon(done, patience_s), what


def over_and_over(act: Callable[[], None], done: Callable[[], bool], what: str, again_s: float = 0.5) -> None:
    """Do something again and again, giving each time a while to show, until it has worked."""
    end = time.monotonic() + PATIENCE_S
    while not done():
        assert time.monotonic() < end, what
        act()
        soon(done, again_s)
