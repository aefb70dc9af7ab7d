"""What a policy is, and the one that only knows what is allowed."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from ..foreign import ForeignError, guarded

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


class Planner(Policy, Protocol):
    """A policy that tells what it believes, so that beliefs can be held to what happens."""

    def expected(self, observation: Observation, actions: Actions) -> NDArray[np.float64]:
        """What decisions (B,) that were just taken are expected to bring, in what the planner adds up; 0 for none."""
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


class GuestPolicy:
    """A policy that comes from outside the package: any object with ``act``, checked whenever it decides.

    Attributes:
        name: it was made by.
        guest: the object itself; its ``reset`` is called where it has one.
    """

    def __init__(self, guest: Any, name: str):
        """Take what decides."""
        self.guest, self.name = guest, name
        self._reset = getattr(guest, "reset", None)

    def act(self, observation: Observation) -> Actions:
        """Actions (B,).

        Raises:
            ForeignError: the policy fails, or gives something else; one line with file and line number.
        """
        actions = np.asarray(guarded(lambda: self.guest.act(observation), f"policy {self.name!r}: "))
        worlds = len(observation["action_mask"])
        if actions.shape != (worlds,) or actions.dtype.kind not in "iu":
            raise ForeignError(
                f"policy {self.name!r}: act gave {actions.dtype} of shape {actions.shape}: give a whole number a "
                f"world, shape ({worlds},)"
            )
        return actions.astype(np.int64, copy=False)

    def reset(self, rows: NDArray[np.bool_]) -> None:
        """Forget what is remembered of the worlds (B,) in which a new episode begins."""
        reset = self._reset
        if callable(reset):
            guarded(lambda: reset(rows), f"policy {self.name!r}: ")


def act_single(policy: Policy, observation: Observation) -> int:
    """Action of a policy for the observation of a single environment."""
    return int(policy.act({name: np.asarray(values)[None] for name, values in observation.items()})[0])
