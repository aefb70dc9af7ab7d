"""How a task's observation and actions divide into a machine, a set of candidates and what can be done with each."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Layout:
    """Sizes behind the flat vectors of a task.

    An action number is ``block * (candidates * options + extras) + slot * options + option``, or in the last
    ``extras`` places of a block one that belongs to no candidate (drive on, wait, index).

    Attributes:
        machine: features of the machine.
        candidates: slots K.
        features: features of a candidate; the first says whether the slot is taken.
        options: ways of treating a candidate.
        extras: actions that belong to no candidate.
        blocks: how often that scheme repeats (cart speeds, where a task has them).
    """

    machine: int
    candidates: int
    features: int
    options: int
    extras: int
    blocks: int = 1

    def __post_init__(self) -> None:
        """Check the ranges."""
        for name in ("machine", "candidates", "features", "options", "blocks"):
            if getattr(self, name) < 1:
                raise ValueError(f"Layout.{name} = {getattr(self, name)}: give at least 1")
        if self.extras < 0:
            raise ValueError(f"Layout.extras = {self.extras}: give at least 0")

    @property
    def actions(self) -> int:
        """Number of actions."""
        return self.blocks * (self.candidates * self.options + self.extras)

    def join(self, slot_logits: Any, extra_logits: Any, concatenate: Any) -> Any:
        """Order logits as the actions are numbered; works on NumPy arrays and, with its own function, on tensors.

        Args:
            slot_logits: (B, K, blocks * options).
            extra_logits: (B, blocks * extras).
            concatenate: ``np.concatenate`` or ``torch.cat``; called with a list and the axis.

        Returns:
            Logits (B, actions).
        """
        b, k, n = len(slot_logits), slot_logits.shape[1], self.options
        parts = []
        for block in range(self.blocks):
            parts.append(slot_logits[:, :, block * n : (block + 1) * n].reshape(b, k * n))
            parts.append(extra_logits[:, block * self.extras : (block + 1) * self.extras])
        return concatenate(parts, 1)

    def permute(self, order: NDArray[np.int64]) -> NDArray[np.int64]:
        """Action numbers (actions,) after slot i took the place of slot ``order[i]``."""
        numbers = np.arange(self.actions).reshape(self.blocks, -1)
        slots = numbers[:, : self.candidates * self.options].reshape(self.blocks, self.candidates, self.options)
        moved = slots[:, order].reshape(self.blocks, -1)
        return np.concatenate([moved, numbers[:, self.candidates * self.options :]], axis=1).ravel()


def layout_of(env: Any) -> Layout:
    """The layout of an environment of this package (``Env`` or ``VectorEnv``).

    Raises:
        ValueError: the sizes of its spaces do not fit the scheme.
    """
    core = env.unwrapped.core
    actions, flat = int(core.action_space.n), int(core.observation_space["candidates"].shape[0])
    features = len(core.candidate_features)
    candidates, rest = divmod(flat, features)
    # A task that repeats its scheme once a cart speed says how long one repetition is.
    base = int(getattr(core, "base_actions", actions))
    options, extras = divmod(base, candidates)
    layout = Layout(core.observation_space["machine"].shape[0], candidates, features, options, extras, actions // base)
    if rest or layout.actions != actions:
        raise ValueError(f"{actions} actions and {flat} candidate numbers do not divide into {layout}")
    return layout
