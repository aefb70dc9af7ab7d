"""Advice: what a scripted policy makes of every action, put beside the candidates for a network to learn from.

A network that sees a planner's advice begins where the planner ends and learns where to leave it, as in residual policy
learning (Silver et al. 2018, arXiv:1812.06298). Advice is as independent of the slots' order as the adviser is.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .layout import Layout
from .policy import Actions, Observation, Policy
from .portable import LearnedPolicy


def advice_of(policy: Policy, observation: Observation, actions: int) -> NDArray[np.float32]:
    """How good a policy holds each action to be, (B, actions) in [0, 1]: 1 what it does; 0 all else if it is mute."""
    advise: Any = getattr(policy, "advise", None)
    if advise is not None:
        return advise(observation)
    advice = np.zeros((len(observation["action_mask"]), actions), np.float32)
    advice[np.arange(len(advice)), policy.act(observation)] = 1.0
    return advice


def advised(observation: Observation, policy: Policy, layout: Layout) -> dict[str, NDArray[Any]]:
    """An observation with a policy's advice behind the features of candidates and machine.

    Args:
        observation: of B worlds.
        policy: gives the advice.
        layout: of the task, without advice.
    """
    slots, extras = layout.split(advice_of(policy, observation, layout.actions))
    table = observation["candidates"].reshape(-1, layout.candidates, layout.features)
    # Empty slots stay empty.
    slots = slots * (table[..., :1] > 0.0)
    return {
        **observation,
        "candidates": np.concatenate([table, slots], axis=2).reshape(len(table), -1),
        "machine": np.concatenate([observation["machine"], extras], axis=1),
    }


class Advised:
    """A learned policy with its adviser beside it.

    Attributes:
        name: the learned policy's.
        card: the learned policy's.
    """

    def __init__(self, learned: LearnedPolicy, adviser: Policy, layout: Layout):
        """Put them together; ``layout`` is the task's, without advice."""
        self.name, self.card = learned.name, learned.card
        self._learned, self._adviser, self._layout = learned, adviser, layout

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        return self._learned.act(advised(observation, self._adviser, self._layout))

    def reset(self, rows: NDArray[np.bool_]) -> None:
        """Forget what the adviser remembers of worlds (B,)."""
        self._adviser.reset(rows)
