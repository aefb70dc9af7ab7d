"""Episodes spread over a Ray cluster: the same records as on one machine, whatever becomes of a worker.

Ray is optional and imported here only. Every node needs the same state of this package; a node with another one is told
apart by the digest of its source, before it runs anything. Policies and fields from files must lie at the same place on
every node, modules must be importable there; an episode whose policy is missing or another one has that as its error.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Generator, Sequence
from functools import lru_cache
from importlib import import_module
from typing import Any

from .episode import RunEpisode, never
from .record import Record, failed
from .store import source_digest
from .suites import Episode

ATTEMPTS = 3
"""Times that an episode is begun; one that loses as many workers is taken for what kills them."""
HOW_TO_INSTALL = "pip install ray"


class EngineError(Exception):
    """The engine cannot be used; the message says why and what to do."""


def load() -> Any:
    """The module ``ray``.

    Raises:
        EngineError: it is not installed.
    """
    try:
        ray = import_module("ray")
    except ImportError:
        ray = None
    # A folder called ray in the working directory can be imported too.
    if not hasattr(ray, "remote"):
        raise EngineError(
            f"--engine ray needs Ray, which is not installed here: {HOW_TO_INSTALL}, or leave --engine out"
        )
    return ray


def run_on_ray(
    todo: Sequence[Episode], run: RunEpisode, jobs: int | None = None, address: str | None = None, ray: Any = None
) -> Generator[Record, None, None]:
    """Yield records as nodes finish them.

    A worker that is lost (killed, out of memory, its node gone) loses its episode, which is begun again elsewhere.

    Args:
        todo: what to run.
        run: runs one episode on a node.
        jobs: episodes at a time; None for as many as the cluster has CPUs.
        address: of a running cluster; None for the one that RAY_ADDRESS names, or else a new one on this machine.
        ray: the module, or what stands in for it.

    Raises:
        EngineError: Ray is missing or cannot be reached, or a node has another state of this package.
    """
    ray = ray or load()
    ours = not ray.is_initialized()
    if ours:
        try:
            ray.init(address=address, log_to_driver=False, configure_logging=False)
        except (ConnectionError, RuntimeError, ValueError) as error:
            raise EngineError(f"cannot reach the Ray cluster ({' '.join(str(error).split())})") from None
    try:
        # Ray's own second try would be silent: who loses workers is to be told.
        remote = ray.remote(num_cpus=1, max_retries=0)(_on_node)
        # Twice as many as there are CPUs are handed out, so that none waits for its next one.
        at_once = jobs or 2 * max(int(ray.cluster_resources().get("CPU", 1)), 1)
        yield from _all(ray, remote, deque(todo), run, at_once)
    finally:
        if ours:
            ray.shutdown()


def _all(
    ray: Any, remote: Any, waiting: deque[Episode], run: RunEpisode, at_once: int
) -> Generator[Record, None, None]:
    under_way: dict[Any, Episode] = {}
    begun: dict[Episode, int] = {}
    digest = source_digest()
    lost = (ray.exceptions.WorkerCrashedError, ray.exceptions.NodeDiedError, ray.exceptions.OutOfMemoryError)
    try:
        while waiting or under_way:
            while waiting and len(under_way) < at_once:
                episode = waiting.popleft()
                begun[episode] = begun.get(episode, 0) + 1
                under_way[remote.remote(run, episode, digest)] = episode
            finished, _ = ray.wait(list(under_way), num_returns=1)
            for reference in finished:
                episode = under_way.pop(reference)
                try:
                    record = ray.get(reference)
                except lost:
                    if begun[episode] < ATTEMPTS:
                        waiting.append(episode)
                        continue
                    record = failed(
                        episode, f"{ATTEMPTS} workers died with it (out of memory, or a crash in native code)"
                    )
                if record is None:
                    raise EngineError("a node has another state of this package: install the same one on every node")
                yield record
    finally:
        for reference in under_way:
            ray.cancel(reference, force=True)


def _on_node(run: RunEpisode, episode: Episode, digest: str) -> Record | None:
    """Run an episode where the package is the one that the benchmark was started with; None elsewhere."""
    return run(episode, never) if _own_digest() == digest else None


@lru_cache(maxsize=1)
def _own_digest() -> str:
    return source_digest()
