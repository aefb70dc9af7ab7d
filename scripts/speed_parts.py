"""Where a step's time goes in batches: kernels, drawing, loading, info, Python; and what a reset costs."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from fieldgym.agents import reference_policy
from fieldgym.envs import env_ids
from fieldgym.scripts.speed_decisions import chosen
from fieldgym.scripts.speed_lines import Line, best_of

TOGETHER = 20
"""Worlds that are reset in one call."""
RESET_US = {
    "fieldgym/SafflowerPicking-v0": 27.5,
    "fieldgym/LaserWeeding-v0": 114.5,
    "fieldgym/ProduceSorting-v0": 38.0,
}
"""Half of what drawing a world and putting it in place took, of 20 together, when fields were first drawn in blocks."""


class Parts(NamedTuple):
    """Microseconds of a step, on average.

    Attributes:
        kernels: the decision itself, observation and scores included.
        draw: fields of the worlds that begin anew.
        load: putting them in place.
        show: what these worlds show.
        info: the info dictionary.
        python: all the rest.
    """

    kernels: float
    draw: float
    load: float
    show: float
    info: float
    python: float

    @property
    def whole(self) -> float:
        """Of the step."""
        return sum(self)

    @property
    def resets(self) -> float:
        """Share that resets take."""
        return (self.draw + self.load + self.show) / self.whole

    def __str__(self) -> str:
        """The shares, in percent."""
        return ", ".join(f"{name} {100.0 * part / self.whole:.0f} %" for name, part in self._asdict().items())


def resets(quick: bool) -> Iterator[Line]:
    """What a reset of some worlds takes a world, and what share of a step of 1,024 worlds resets are."""
    for env_id in env_ids():
        name = env_id.removeprefix("fieldgym/").removesuffix("-v0")
        core, rows = _core(env_id, TOGETHER), np.arange(TOGETHER)
        generators = [np.random.default_rng(seed) for seed in range(TOGETHER)]
        seconds = best_of(lambda c=core, r=rows, g=generators: c.reset_rows(r, g), 20 if quick else 100)
        cost_us = 1e6 * seconds / TOGETHER
        yield Line(f"{name}, a reset of {TOGETHER} together", cost_us, "us", RESET_US.get(env_id), True, "a world")
        # Long enough for worlds that began together to have parted.
        parts = parts_of(env_id, 1024, 250 if quick else 600)
        yield Line(f"{name}, resets in a batch of 1,024", 100.0 * parts.resets, "%", note="of a step")


def profile(quick: bool) -> Iterator[Line]:
    """Where a step's time goes, for every batch that has a target."""
    for env_id in env_ids():
        name = env_id.removeprefix("fieldgym/").removesuffix("-v0")
        for worlds in (1, 64, 1024):
            parts = parts_of(env_id, worlds, max(250 if quick else 600, 1_000 // worlds))
            yield Line(f"{name}, batch of {worlds:,}", parts.whole, "us a step", note=str(parts))


def parts_of(env_id: str, worlds: int, steps: int) -> Parts:
    """Parts of a step of a batch that plays what its reference policy decided."""
    env: Any = gym.make_vec(env_id, num_envs=worlds, vectorization_mode="vector_entry_point")
    whole = env.unwrapped
    spent: dict[str, float] = dict.fromkeys(("decide", "draw", "load", "show", "_info"), 0.0)
    for name in spent:
        _watch(whole if name == "_info" else whole.core, name, spent)
    decided = chosen(env, reference_policy(env_id), steps)
    spent.update(dict.fromkeys(spent, 0.0))
    total = 0.0
    for actions in decided:
        start = time.thread_time()
        env.step(actions)
        total += time.thread_time() - start
    env.close()
    known = [1e6 * seconds / steps for seconds in spent.values()]
    return Parts(*known, python=1e6 * total / steps - sum(known))


def _core(env_id: str, worlds: int) -> Any:
    env: Any = gym.make_vec(env_id, num_envs=worlds, vectorization_mode="vector_entry_point")
    return env.unwrapped.core


def _watch(owner: Any, name: str, spent: dict[str, float]) -> None:
    """Let a method of one object add its CPU time to ``spent``."""
    method: Callable[..., Any] = getattr(owner, name)

    def timed(*args: Any, **kwargs: Any) -> Any:
        start = time.thread_time()
        try:
            return method(*args, **kwargs)
        finally:
            spent[name] += time.thread_time() - start

    setattr(owner, name, timed)
