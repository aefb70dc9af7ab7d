"""Policies by name, and how to make them for an environment."""

from __future__ import annotations

import warnings
from typing import Any

from ..envs.assembly import meant
from ..envs.task import factories, resolved, task
from .learning.portable import load_for, shipped
from .policies.base import Policy
from .policies.weights import LEARNED, PolicyFileError


def policy_names(env_id: str) -> tuple[str, ...]:
    """Policies that there are for an environment.

    Raises:
        ValueError: unknown environment.
    """
    return tuple(name for name in factories(env_id) if name != LEARNED or shipped(task(env_id).id))


def reference_policy(env_id: str) -> str:
    """The paper's own way of choosing, to which the others are compared."""
    return task(env_id).reference


def make_policy(name: str, env: Any, seed: int = 0) -> Policy:
    """Make a policy for an environment.

    Args:
        name: one of ``policy_names``.
        env: an ``Env`` or ``VectorEnv`` made by Gymnasium; its id and configuration are what the policy needs.
        seed: seed of the policy's own chance, if it has any.

    Raises:
        ValueError: unknown policy; the message lists the choices.
    """
    spec = env.unwrapped.spec
    if spec is None:
        raise ValueError("the environment has no spec: make it with gymnasium.make or gymnasium.make_vec")
    known = factories(spec.id)
    if name not in known:
        raise ValueError(f"policy {name!r} is unknown for {spec.id}: {meant(name, policy_names(spec.id))}")
    return resolved(known[name])(env, seed)


def make_learned(env: Any, seed: int) -> Policy:
    """The policy that the package ships for an environment.

    One that was trained on another scenario is given with a warning that names both.

    Raises:
        PolicyFileError: nothing ships for it.
    """
    env_id, scenario = env.unwrapped.spec.id, env.unwrapped.scenario
    path = shipped(env_id, scenario)
    if path is None:
        raise PolicyFileError(f"no learned policy ships for {env_id}: train one with fieldgym train")
    policy = load_for(path, env)
    trained_on = path.stem.split(".", 1)[-1]
    if trained_on != scenario:
        warnings.warn(f"{LEARNED} of {env_id} was trained on {trained_on}, this is {scenario}", stacklevel=2)
    return policy
