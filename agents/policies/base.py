"""What a policy is, and the one that only knows what is allowed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Observation = Mapping[str, NDArray[Any]]
Actions = NDArray[np.int64]


class Policy(Protocol):
    """Chooses actions for a batch of worlds from what a machine would see.

    Every observation array has a leading world axis, so the same policy serves ``Env`` (through ``act_single``) and
    ``VectorEnv``.
    """

    name: str

    def act(self, observation: Observation) -> Actions:
        """Actions (B,) for a batched observation."""
        ...

    def reset(self, rows: NDArray[np.bool_]) -> None:
        """Forget what is remembered of the worlds (B,) in which a new episode begins."""
        ...


class StatelessPolicy:
    """Base of policies that remember nothing."""

    @classmethod
    def make(cls, env: Any, seed: int) -> Any:
        """The policy for an environment; the factory under which it is registered."""
        return cls()

    def reset(self, rows: NDArray[np.bool_]) -> None:
        """Nothing to forget."""


class ConfiguredPolicy(StatelessPolicy):
    """Base of policies that remember nothing and know the task's public numbers."""

    def __init__(self, config: Any):
        """Take what is needed from the configuration."""
        self.config = config

    @classmethod
    def make(cls, env: Any, seed: int) -> Any:
        """The policy for an environment; the factory under which it is registered."""
        return cls(env.unwrapped.core.config)


class RandomPolicy(StatelessPolicy):
    """Any legal action with equal probability."""

    name = "random"

    def __init__(self, seed: int = 0):
        """Seed the policy's own generator."""
        self._generator = np.random.default_rng(seed)

    @classmethod
    def make(cls, env: Any, seed: int) -> RandomPolicy:
        """The policy for an environment."""
        return cls(seed)

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        mask = observation["action_mask"]
        lots = np.where(mask > 0, self._generator.random(mask.shape), -1.0)
        return lots.argmax(axis=1)


def act_single(policy: Policy, observation: Observation) -> int:
    """Action of a policy for the observation of a single environment."""
    return int(policy.act({name: np.asarray(values)[None] for name, values in observation.items()})[0])
