"""Policies by name, and how to make them for an environment."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

from ..envs.assembly import CUSTOM
from ..envs.task import task
from ..kernels.config_fields import plain
from .learning.portable import load_for, shipped
from .policies.base import Policy
from .policies.weights import LEARNED, PolicyFileError
from .sources import policy_names, policy_source

__all__ = ["make_learned", "make_policy", "policy_names", "reference_policy"]

_SHOWN = 3
"""Changed numbers that a warning names."""


def reference_policy(env_id: str) -> str:
    """The paper's own way of choosing, to which the others are compared."""
    return task(env_id).reference


def make_policy(name: str, env: Any, seed: int = 0, *, trust: bool = False) -> Policy:
    """Make a policy for an environment: what was asked for, or an error.

    Args:
        name: one of ``policy_names``, ``file.py:Name``, ``package.module:Name``, ``weights.npz`` or ``model.zip``; the
            policy has it as its ``name``. See ``sources``.
        env: an ``Env`` or ``VectorEnv`` made by Gymnasium; its id and configuration are what the policy needs.
        seed: seed of the policy's own chance, if it has any.
        trust: load saved models of Stable-Baselines3, which may run code.

    Raises:
        ValueError: unknown policy, or one that cannot be made; the message is one line.
    """
    spec = env.unwrapped.spec
    if spec is None:
        raise ValueError("the environment has no spec: make it with gymnasium.make or gymnasium.make_vec")
    return policy_source(spec.id, name, trust).make(env, seed)


def make_learned(env: Any, seed: int) -> Policy:
    """The policy that the package ships for an environment.

    One that was trained on another scenario, or on other numbers, is given with a warning that names both.

    Raises:
        PolicyFileError: nothing ships for it.
    """
    env_id, scenario = env.unwrapped.spec.id, env.unwrapped.scenario
    path = shipped(env_id, scenario)
    if path is None:
        raise PolicyFileError(f"no learned policy ships for {env_id}: train one with fieldgym train")
    policy = load_for(path, env)
    trained_on = path.stem.split(".", 1)[-1]
    before = getattr(policy, "card", {}).get("changes", {})
    changes = _changes(env.unwrapped, trained_on if scenario == CUSTOM else scenario, before)
    if trained_on != scenario or changes:
        was, now = (
            f"{name} with {', '.join(told)}" if told else name
            for name, told in ((trained_on, [f"{key} = {value}" for key, value in before.items()]), (scenario, changes))
        )
        warnings.warn(f"{LEARNED} of {env_id} was trained on {was}, this is {now}", stacklevel=2)
    return policy


def _changes(env: Any, scenario: str, before: Mapping[str, Any]) -> list[str]:
    """The first few numbers of a configuration that are not those of a named scenario with changes, by dotted name."""
    config, plain_one = env.core.config, env.assembly.configured(scenario, overrides=before)
    if config == plain_one:
        return []
    here, there = _leaves(plain(config)), _leaves(plain(plain_one))
    odd = [f"{name} = {here[name]}" for name in here if here[name] != there.get(name, ...) and name != "scenario.name"]
    return [*odd[:_SHOWN], *(["..."] if len(odd) > _SHOWN else [])] or ["other numbers"]


def _leaves(values: Any, name: str = "") -> dict[str, Any]:
    if not isinstance(values, dict):
        return {name: values}
    return {
        path: leaf for key, part in values.items() for path, leaf in _leaves(part, f"{name}.{key}".strip(".")).items()
    }
