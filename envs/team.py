"""Threads that step the worlds of a batch side by side, each its own share of them."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from .core import TaskCore

Result = TypeVar("Result")


class Team:
    """Shares of a batch's worlds, one a thread; the caller's thread takes the first.

    A share's rules work on a slice of the batch's own arrays, and what is done in a world depends on no other: numbers
    do not depend on how many threads there are. Kernels let go of Python while they run, those that draw strips and put
    them in place too; what Python itself does goes on one after the other.
    """

    def __init__(self, threads: Any, core: TaskCore[Any, Any], sees: bool):
        """Share the worlds of ``core`` among threads; ``sees`` says whether they have cameras.

        Raises:
            ValueError: the threads are no whole number from 1 up to the number of worlds, or worlds have cameras.
        """
        if isinstance(threads, bool) or not isinstance(threads, int | np.integer) or not 1 <= threads <= core.worlds:
            raise ValueError(f"threads = {threads!r}: give a whole number in 1..{core.worlds}, at most one a world")
        if sees and threads > 1:
            raise ValueError(f"threads = {threads}: worlds that are drawn are stepped by one thread, give 1")
        self.threads, self._core = int(threads), core
        self._shares: list[tuple[TaskCore[Any, Any], slice]] = []
        self._pool: ThreadPoolExecutor | None = None
        self._made_in = 0

    def __getstate__(self) -> dict[str, Any]:
        """What a copy takes over: it hires threads of its own."""
        return {**vars(self), "_shares": [], "_pool": None}

    @property
    def alone(self) -> bool:
        """Whether there is one thread: the caller's."""
        return self.threads == 1

    def each(self, work: Callable[[TaskCore[Any, Any], slice], Result]) -> list[Result]:
        """What ``work`` gives for the rules of every share and the worlds that they are of, in their order.

        All shares are through when it returns; an error of any is raised then.
        """
        (core, where), *others = self._shared()
        if not others:
            return [work(core, where)]
        waiting = [self._hired().submit(work, *share) for share in others]
        try:
            first = work(core, where)
        finally:
            errors = [one.exception() for one in waiting]
        for error in errors:
            if error is not None:
                raise error
        return [first, *(one.result() for one in waiting)]

    def close(self) -> None:
        """Let the threads go; idempotent."""
        if self._pool is not None and self._made_in == os.getpid():
            self._pool.shutdown()
        self._pool = None

    def _shared(self) -> list[tuple[TaskCore[Any, Any], slice]]:
        if not self._shares:
            ends = [self._core.worlds * i // self.threads for i in range(self.threads + 1)]
            wheres = [slice(first, last) for first, last in pairwise(ends)]
            whole = [(self._core, where) for where in wheres]
            self._shares = whole if self.alone else [(self._core.part(where), where) for where in wheres]
        return self._shares

    def _hired(self) -> ThreadPoolExecutor:
        """The threads; a process that was forked has none of its parent's."""
        if self._pool is None or self._made_in != os.getpid():
            self._pool, self._made_in = ThreadPoolExecutor(self.threads - 1, "fieldgym-worlds"), os.getpid()
        return self._pool
