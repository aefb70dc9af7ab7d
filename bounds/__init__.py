"""What no policy can beat on a given instance, whatever it knows: the field, the drawn luck, the machine's true times.

``instance(env_id, seed, scenario=...).bound()`` gives a valid bound on net rate and return, and the shortest cycle time
at that net rate. Each task adds a module with a function ``instance_of(core, reports)`` and an entry in ``_TASKS``;
the camera's reports are ``"drawn"`` with the field, drawn but carried out by a simulated machine (``"driven"``), or
``"any"``.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any, Protocol

import gymnasium as gym

from .base import METHODS, Bound

__all__ = ["METHODS", "Bound", "Instance", "bounded_ids", "instance"]

_TASKS = {
    "fieldgym/SafflowerPicking-v0": "safflower",
    "fieldgym/TrayTransplanting-v0": "transplanting",
    "fieldgym/ProduceSorting-v0": "sorting",
    "fieldgym/LaserWeeding-v0": "weeding",
    "fieldgym/LaserWeedingSpeed-v0": "weeding",
    "fieldgym/HoeWeeding-v0": "weeding",
}

_UNDRIVEN = ("safflower",)
"""Tasks whose bound does not tell a simulated machine from one that may report anything."""


class Instance(Protocol):
    """One drawn instance of a task, known completely."""

    def bound(self, method: str = "relaxation", time_limit_s: float = 60.0) -> Bound:
        """What no policy can beat.

        Args:
            method: ``"relaxation"`` (fast) or ``"cp-sat"`` (OR-Tools, as tight as the time allows; where a task has no
                such model both are the same).
            time_limit_s: wall seconds for CP-SAT, or for the search that a task has instead.
        """
        ...

    def cycle_time_at(self, net_rate: float) -> float:
        """Seconds that the cycle time cannot fall below with at least this net rate."""
        ...


def bounded_ids() -> tuple[str, ...]:
    """Environments that have a bound."""
    return tuple(_TASKS)


def instance(env_id: str, seed: int, *, backend: str = "analytic", **kwargs: Any) -> Instance:
    """Draw the instance of a seed and know everything about it.

    Args:
        env_id: registered id.
        seed: of the environment.
        backend: with ``"pybullet"`` the tool may stray as far as the simulated machine does; its camera, the default
            there, may report anything. Both make the bound looser.
        **kwargs: of the environment (``scenario``, ``perception``, ...).

    Raises:
        ValueError: the environment has no bound.
    """
    from ..envs import describe

    if describe(env_id).id not in _TASKS:
        raise ValueError(f"{env_id} has no bound yet: choose one of {', '.join(_TASKS)}")
    if backend not in ("analytic", "pybullet"):
        raise ValueError(f"backend = {backend!r}: choose 'analytic' or 'pybullet'")
    perception = kwargs.get("perception") or ("camera" if backend == "pybullet" else "model")
    reports = "drawn" if backend == "analytic" else "driven"
    task = _TASKS[describe(env_id).id]
    if perception == "camera" or (reports == "driven" and task in _UNDRIVEN):
        reports, kwargs = "any", {**kwargs, "perception": "perfect"}
    env: Any = gym.make_vec(env_id, 1, vectorization_mode="vector_entry_point", **kwargs)
    env.reset(seed=seed)
    module = import_module(f".{task}", __name__)
    found = module.instance_of(env.unwrapped.core, reports)
    env.close()
    return found
