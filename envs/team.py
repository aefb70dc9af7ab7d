"""Threads that step the worlds of a batch side by side, each its own share of them."""

from __future__ import annotations

import os
import threading
import weakref
from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from ..kernels.config_kinds import show
from .core import TaskCore

Result = TypeVar("Result")


class Worker:
    """A thread that does what it is asked to, one thing after the other, and sleeps in between.

    Handing over is a lock that one side lets go of and the other waits for: an executor's queue and its promises cost
    more than the steps of some thousand worlds.
    """

    def __init__(self) -> None:
        """Hire the thread."""
        self._asked, self._done = threading.Lock(), threading.Lock()
        self._asked.acquire()
        self._done.acquire()
        self._work: Callable[[], Any] | None = None
        self._result: Any = None
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._serve, name="fieldgym-worlds", daemon=True)
        self._thread.start()

    def ask(self, work: Callable[[], Any] | None) -> None:
        """Let the thread begin with ``work``, whose ``answer`` is then waited for once; None lets it go."""
        self._work = work
        self._asked.release()

    def answer(self) -> tuple[Any, BaseException | None]:
        """What the work gave, and what it raised, once it is through."""
        self._done.acquire()
        (result, error), self._result, self._error = (self._result, self._error), None, None
        return result, error

    def join(self) -> None:
        """Wait until a thread that was let go has ended."""
        self._thread.join()

    def _serve(self) -> None:
        while True:
            self._asked.acquire()
            if self._work is None:
                return
            try:
                self._result = self._work()
            except BaseException as error:
                self._error = error
            self._work = None
            self._done.release()


def _let_go(workers: Sequence[Worker], made_in: int) -> None:
    """Let threads go; those of the process that this one was forked from are not there."""
    if made_in == os.getpid():
        for worker in workers:
            worker.ask(None)


class Team:
    """Shares of a batch's worlds, one a thread; the caller's thread takes the first.

    A share's rules work on a slice of the batch's own arrays, and what is done in a world depends on no other: numbers
    do not depend on how many threads there are. Kernels let go of Python while they run; what Python itself does goes
    on one after the other.
    """

    def __init__(self, threads: Any, core: TaskCore[Any, Any], sees: bool):
        """Share the worlds of ``core`` among threads; ``sees`` says whether they have cameras.

        Raises:
            ValueError: the threads are no whole number from 1 up to the number of worlds, or worlds have cameras.
        """
        if isinstance(threads, bool) or not isinstance(threads, int | np.integer) or not 1 <= threads <= core.worlds:
            raise ValueError(f"threads = {show(threads)}: give a whole number in 1..{core.worlds}, at most one a world")
        if sees and threads > 1:
            raise ValueError(f"threads = {threads}: worlds that are drawn are stepped by one thread, give 1")
        self.threads, self._core = int(threads), core
        self._shares: list[tuple[TaskCore[Any, Any], slice]] = []
        self._workers: list[Worker] = []
        self._leaving: weakref.finalize[..., Any] | None = None
        self._made_in = 0

    def __getstate__(self) -> dict[str, Any]:
        """What a copy takes over: it hires threads of its own."""
        return {**vars(self), "_shares": [], "_workers": [], "_leaving": None}

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
        workers = self._hired()
        for worker, share in zip(workers, others, strict=True):
            worker.ask(partial(work, *share))
        try:
            first = work(core, where)
        finally:
            try:
                answers = [worker.answer() for worker in workers]
            except BaseException:
                # Interrupted while others are at work: nobody will take their answers.
                self._dismiss()
                raise
        for _, error in answers:
            if error is not None:
                raise error
        return [first, *(result for result, _ in answers)]

    def close(self) -> None:
        """Let the threads go; idempotent."""
        ours = self._workers if self._made_in == os.getpid() else []
        self._dismiss()
        for worker in ours:
            worker.join()

    def _dismiss(self) -> None:
        if self._leaving is not None:
            self._leaving()
        self._workers, self._leaving = [], None

    def _shared(self) -> list[tuple[TaskCore[Any, Any], slice]]:
        if not self._shares:
            ends = [self._core.worlds * i // self.threads for i in range(self.threads + 1)]
            wheres = [slice(first, last) for first, last in pairwise(ends)]
            whole = [(self._core, where) for where in wheres]
            self._shares = whole if self.alone else [(self._core.part(where), where) for where in wheres]
        return self._shares

    def _hired(self) -> list[Worker]:
        """The threads; a process that was forked has none of its parent's."""
        if not self._workers or self._made_in != os.getpid():
            self._dismiss()
            self._workers, self._made_in = [Worker() for _ in range(self.threads - 1)], os.getpid()
            self._leaving = weakref.finalize(self, _let_go, self._workers, self._made_in)
        return self._workers
