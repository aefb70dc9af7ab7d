"""What no policy can beat on a given instance, whatever it knows: the field, the drawn luck, the machine's true times.

``instance(env_id, seed, scenario=...).bound()`` gives a valid bound on net rate and return, and the shortest cycle time
at that net rate; beside it what no policy can beat on average that does not know the luck (``Bound.expected``), and
what a schedule that knows it got from the rules (``Bound.found``).

A task's specification names a function ``instance_of(core, reports)``; the camera's reports are ``"drawn"`` with the
field, drawn but carried out by a simulated machine (``"driven"``), or ``"any"``.
"""

from __future__ import annotations

from typing import Any, Protocol

import gymnasium as gym

from ..envs.assembly import choice
from ..envs.references import resolved
from ..envs.task import task, tasks
from .base import METHODS, Bound

__all__ = ["METHODS", "Bound", "Instance", "bounded_ids", "instance"]


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
    return tuple(spec.id for spec in tasks() if spec.bound is not None)


def instance(
    env_id: str, seed: int, *, backend: str = "analytic", field: Any = None, carried_out: bool = True, **kwargs: Any
) -> Instance:
    """Draw the instance of a seed and know everything about it.

    Args:
        env_id: registered id.
        seed: of the environment.
        backend: with ``"pybullet"`` the tool may stray as far as the simulated machine does; its camera, the default
            there, may report anything. Both make the bound looser.
        field: a field or file that is played instead of a drawn one.
        carried_out: whether a schedule that knows the luck is wanted too (``Bound.found``) where it takes longer to be
            sought than the bounds take.
        **kwargs: of the environment (``scenario``, ``perception``, ...).

    Raises:
        ValueError: the environment has no bound.
    """
    spec = task(env_id)
    if spec.bound is None:
        raise ValueError(f"{env_id} has no bound yet: choose one of {', '.join(bounded_ids())}")
    choice("backend", backend, spec.backends)
    instance_of, perception = resolved(spec.bound), kwargs.get("perception")
    reports = "drawn" if backend == "analytic" else "driven"
    if (perception or spec.assembly.default_perception(backend)) == "camera":
        reports, kwargs = "any", {**kwargs, "perception": "perfect"}
    env: Any = gym.make_vec(env_id, 1, vectorization_mode="vector_entry_point", **kwargs)
    if reports != "any" and any(getattr(env.unwrapped.core, cause, False) for cause in ("errs", "rough")):
        # Where drives err or a frame stands tilted, work may be done anywhere: as if a camera had reported anything.
        env.close()
        reports, kwargs = "any", {**kwargs, "perception": "perfect"}
        env = gym.make_vec(env_id, 1, vectorization_mode="vector_entry_point", **kwargs)
    env.reset(seed=seed, options=None if field is None else {"fields": [field]})
    found = instance_of(env.unwrapped.core, reports)
    env.close()
    return found if carried_out or not hasattr(found, "without_schedule") else found.without_schedule()
