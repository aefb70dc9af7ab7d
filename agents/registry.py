"""Names of policies and how to make them for an environment."""

from __future__ import annotations

from collections.abc import Callable
from difflib import get_close_matches
from typing import Any

from ..envs import describe
from .learning.portable import load_for, shipped
from .policies.base import Policy, RandomPolicy
from .policies.weights import LEARNED

Factory = Callable[[Any, int], Policy]


def _safflower() -> dict[str, Factory]:
    from .policies.safflower import FixedOrder, GramsPerSecond, Nearest, NearestTwoOpt, Route

    return {
        "random": lambda config, seed: RandomPolicy(seed),
        "fixed-order": lambda config, seed: FixedOrder(),
        "nearest": lambda config, seed: Nearest(),
        "nearest-2opt": lambda config, seed: NearestTwoOpt(config),
        "grams-per-second": lambda config, seed: GramsPerSecond(config),
        "route": lambda config, seed: Route(config),
    }


def _transplanting() -> dict[str, Factory]:
    from .policies import transplanting as rules

    return {
        "random": lambda config, seed: RandomPolicy(seed),
        "fixed-order": lambda config, seed: rules.FixedOrder(config),
        "fixed-order-speed": lambda config, seed: rules.FixedOrderChosenSpeed(config),
        "nearest": lambda config, seed: rules.Nearest(config),
        "shortest-cycle": lambda config, seed: rules.ShortestCycle(config),
        "assignment": lambda config, seed: rules.Assignment(config),
        "2-opt": lambda config, seed: rules.TwoOpt(config),
    }


def _weeding() -> dict[str, Factory]:
    from .policies import weeding as rules
    from .policies.weeding_horizon import RecedingHorizon

    return {
        "random": lambda config, seed: RandomPolicy(seed),
        "fifo": lambda config, seed: rules.Fifo(config),
        "edf": lambda config, seed: rules.EarliestDeadline(config),
        "nearest": lambda config, seed: rules.Nearest(config),
        "shortest-dwell": lambda config, seed: rules.ShortestDwell(config),
        "kill-per-second": lambda config, seed: rules.KillPerSecond(config),
        "receding-horizon": lambda config, seed: RecedingHorizon(config),
    }


def _weeding_speed() -> dict[str, Factory]:
    from .policies import weeding as rules
    from .policies.weeding_horizon import RecedingHorizon

    return {
        "random": lambda config, seed: RandomPolicy(seed),
        "constant-0.75": lambda config, seed: rules.AtSpeed(RecedingHorizon(config), 0.75),
        "constant-1": lambda config, seed: rules.AtSpeed(RecedingHorizon(config), 1.0),
        "constant-1.5": lambda config, seed: rules.AtSpeed(RecedingHorizon(config), 1.5),
        "hold-backlog": lambda config, seed: rules.HoldBacklog(RecedingHorizon(config)),
    }


def _sorting() -> dict[str, Factory]:
    from .policies import sorting as rules

    return {
        "random": lambda config, seed: RandomPolicy(seed),
        "fifo": lambda config, seed: rules.Fifo(),
        "edf": lambda config, seed: rules.EarliestDeadline(),
        "nearest": lambda config, seed: rules.Nearest(),
        "shortest-cycle": lambda config, seed: rules.ShortestCycle(),
        "value-per-second": lambda config, seed: rules.ValuePerSecond(),
        "receding-horizon": lambda config, seed: rules.RecedingHorizon(config),
        "receding-horizon-value": lambda config, seed: rules.RecedingHorizon(config, by_value=True),
    }


_POLICIES: dict[str, Callable[[], dict[str, Factory]]] = {
    "fieldgym/SafflowerPicking-v0": _safflower,
    "fieldgym/TrayTransplanting-v0": _transplanting,
    "fieldgym/LaserWeeding-v0": _weeding,
    "fieldgym/LaserWeedingSpeed-v0": _weeding_speed,
    "fieldgym/HoeWeeding-v0": _weeding,
    "fieldgym/ProduceSorting-v0": _sorting,
}
_REFERENCES = {
    "fieldgym/SafflowerPicking-v0": "fixed-order",
    "fieldgym/TrayTransplanting-v0": "fixed-order",
    "fieldgym/LaserWeeding-v0": "fifo",
    "fieldgym/LaserWeedingSpeed-v0": "constant-1",
    "fieldgym/HoeWeeding-v0": "fifo",
    "fieldgym/ProduceSorting-v0": "fifo",
}


def policy_names(env_id: str) -> tuple[str, ...]:
    """Policies that there are for an environment.

    Raises:
        ValueError: unknown environment.
    """
    learned = (LEARNED,) if shipped(describe(env_id).id) else ()
    return (*_POLICIES[env_id](), *learned)


def reference_policy(env_id: str) -> str:
    """The paper's own way of choosing, to which the others are compared."""
    return _REFERENCES[describe(env_id).id]


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
    factories = _POLICIES[describe(spec.id).id]()
    path = shipped(spec.id, spec.kwargs.get("scenario") or describe(spec.id).headline_scenario)
    if name == LEARNED and path is not None:
        return load_for(path, env)
    if name not in factories:
        near = get_close_matches(name, factories, n=1)
        hint = f"did you mean {near[0]!r}? " if near else ""
        raise ValueError(
            f"policy {name!r} is unknown for {spec.id}: {hint}choose one of {', '.join(policy_names(spec.id))}"
        )
    return factories[name](env.unwrapped.core.config, seed)
