"""Run the episodes of a suite, on one process or several, and keep each result the moment it is there."""

from __future__ import annotations

import os
import signal
import sys
import threading
import warnings
from collections import deque
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Future, ProcessPoolExecutor, wait
from contextlib import closing, contextmanager
from dataclasses import dataclass
from multiprocessing import connection, get_context, parent_process
from pathlib import Path
from typing import Any

from ..kernels.config_kinds import one_line
from . import cluster
from .episode import RunEpisode, never, run_episode
from .limits import violations
from .record import Record, failed
from .store import Results, manifest
from .suites import Episode, Suite

ENGINES = ("local", "ray")
THREAD_LIMITS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")


@dataclass(frozen=True)
class RunResult:
    """How a run went.

    Attributes:
        records: every finished episode in the folder, those of earlier runs included; no failed ones.
        bounds: every bound in the folder, likewise.
        failures: the records of what failed in this run.
        skipped: episodes and bounds that an earlier run had finished.
        outdated: those of an earlier run that were left out because a file that they came from has changed.
        violations: results that beat their bound, in words; there must be none.
    """

    records: list[Record]
    bounds: list[Record]
    failures: list[Record]
    skipped: int
    outdated: int
    violations: list[str]


class InterruptedRunError(Exception):
    """The run was stopped with Ctrl-C.

    Attributes:
        finished: episodes of the suite that have a result in the folder.
        total: episodes of the suite.
    """

    def __init__(self, finished: int, total: int):
        """Keep both counts."""
        super().__init__(f"stopped: {finished} of {total} episodes are kept")
        self.finished = finished
        self.total = total


def usable_cores() -> int:
    """Cores that this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def run_suite(
    suite: Suite,
    folder: Path,
    jobs: int | None = 1,
    resume: bool = False,
    run: RunEpisode = run_episode,
    engine: str = "local",
    on_start: Callable[[int, int], None] = lambda skipped, total: None,
    on_record: Callable[[Record], None] = lambda record: None,
) -> RunResult:
    """Run what is missing of ``suite`` and add it to ``folder``.

    The results do not depend on ``jobs``: each episode makes its own environment from its own seed.

    Args:
        suite: what to run.
        folder: where results go, see ``Results``.
        jobs: worker processes; with 1 the episodes run in this process. On a cluster, how many episodes are run at a
            time. None for one a core, or one a CPU of the cluster.
        resume: keep the finished episodes that lie in ``folder``.
        run: what runs an episode.
        engine: one of ``ENGINES``: ``"local"``, or ``"ray"`` to spread the episodes over a Ray cluster.
        on_start: called once with the number of skipped episodes and of all.
        on_record: called with every record after it has been written.

    Raises:
        ResultsError: the folder cannot be used.
        InterruptedRunError: Ctrl-C; what was finished is kept.
        EngineError: the cluster cannot be used.
        ValueError: ``jobs`` < 1, or there is no such engine.
    """
    if jobs is not None and jobs < 1:
        raise ValueError(f"jobs = {jobs}: give at least 1")
    if engine not in ENGINES:
        raise ValueError(f"engine = {engine!r}: choose one of {', '.join(ENGINES)}")
    if engine == "ray":
        cluster.load()  # before anything is written
    episodes = suite.episodes()
    results = Results(folder, manifest(suite), resume, episodes)
    failures: list[Record] = []
    try:
        done = results.finished(episodes)
        todo = [episode for episode in episodes if episode not in done]
        on_start(len(done), len(episodes))
        spread = _records if engine == "local" else cluster.run_on_ray
        with closing(spread(todo, run, jobs)) as records:
            for record in records:
                if "error" in record:
                    failures.append(record)
                with _ctrl_c_waits():
                    results.append(record)
                on_record(record)
    except KeyboardInterrupt:
        raise InterruptedRunError(len(results.finished(episodes)), len(episodes)) from None
    finally:
        results.close()
    kept, bounds = ([record for record in part if "error" not in record] for part in (results.records, results.bounds))
    return RunResult(kept, bounds, failures, len(done), results.outdated, violations(kept, bounds))


def _records(todo: Sequence[Episode], run: RunEpisode, jobs: int | None) -> Generator[Record, None, None]:
    jobs = min(jobs or usable_cores(), max(len(todo), 1))
    if jobs > 1:
        yield from _in_processes(todo, jobs, run)
    else:
        yield from (run(episode, never) for episode in todo)


def _in_processes(todo: Sequence[Episode], jobs: int, run: RunEpisode) -> Iterator[Record]:
    """Yield records as workers finish them.

    A worker that dies takes its whole pool with it. Only the episodes that were under way can have killed it: they run
    again alone, and one that dies alone is the culprit and gets a failure record.
    """
    waiting, suspects = deque(todo), deque[Episode]()
    while waiting:
        yield from _until_a_worker_dies(waiting, jobs, run, suspects)
    for suspect in suspects:
        again, died = deque([suspect]), deque[Episode]()
        yield from _until_a_worker_dies(again, 1, run, died)
        if died:
            yield failed(suspect, "the worker process died (out of memory, or a crash in native code)")


def _until_a_worker_dies(
    waiting: deque[Episode], jobs: int, run: RunEpisode, suspects: deque[Episode]
) -> Iterator[Record]:
    """Take episodes off ``waiting`` and yield their records; on a death move what was under way to ``suspects``."""
    context = get_context("spawn")
    stop = context.Event()
    under_way: dict[Future[Record], Episode] = {}
    with _one_thread_each():
        pool = ProcessPoolExecutor(jobs, context, _prepare_worker, (stop,))
        try:
            while waiting or under_way:
                while waiting and len(under_way) < 2 * jobs:
                    with _ctrl_c_waits():  # workers inherit the block and keep it
                        under_way[pool.submit(_work, run, waiting[0])] = waiting[0]
                    waiting.popleft()
                finished, _ = wait(under_way, return_when=FIRST_COMPLETED)
                for future in finished:
                    record = future.result()
                    del under_way[future]
                    yield record
        except BrokenExecutor:
            suspects.extend(under_way.values())
        finally:
            stop.set()
            pool.shutdown(wait=True, cancel_futures=True)


@contextmanager
def _ctrl_c_waits() -> Iterator[None]:
    """Hold Ctrl-C back until the block is left: what is done here is done whole.

    A process that starts in the block inherits the mask and never hears Ctrl-C. In this process the mask alone would
    not do: the signal may reach another thread, and Python then interrupts the main one all the same.
    """
    if threading.current_thread() is not threading.main_thread() or not hasattr(signal, "pthread_sigmask"):
        yield
        return
    came: list[int] = []
    handler = signal.signal(signal.SIGINT, lambda number, frame: came.append(number))
    mask = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, mask)
        signal.signal(signal.SIGINT, handler)
        if came:
            signal.raise_signal(signal.SIGINT)


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let each worker's linear algebra use one thread: the workers are what fills the cores."""
    before = {name: os.environ.get(name) for name in THREAD_LIMITS}
    os.environ.update({name: value or "1" for name, value in before.items()})
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]


_stop: Any = None
"""In a worker: the event that ends it."""


def _prepare_worker(stop: Any) -> None:
    global _stop
    _stop = stop
    warnings.showwarning = lambda message, *_, **__: print(f"fieldgym: {one_line(str(message))}", file=sys.stderr)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_die_with_parent, daemon=True).start()


def _die_with_parent() -> None:
    """End this worker when the benchmark was killed: its queue would never tell it."""
    parent = parent_process()
    if parent is not None:
        connection.wait([parent.sentinel])
        os._exit(1)


def _work(run: RunEpisode, episode: Episode) -> Record:
    return run(episode, _stop.is_set)
