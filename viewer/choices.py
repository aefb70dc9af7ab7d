"""What can be decided, in words, and what policies make of it."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..agents.policies.base import Policy, act_single
from ..agents.policies.layout import Layout
from ..envs.belief import Belief
from ..envs.columns import documented


class Choice(NamedTuple):
    """An action taken apart.

    Attributes:
        slot: of the candidate; None for an action that belongs to none.
        text: in words.
    """

    slot: int | None
    text: str


def choice_of(action: int, layout: Layout, belief: Belief | None) -> Choice:
    """An action taken apart."""
    base = layout.candidates * layout.options + layout.extras
    block, rest = divmod(action, base)
    blocks = belief.blocks if belief is not None else tuple(f"block {k}" for k in range(layout.blocks))
    also = f", {blocks[block]}" if len(blocks) > block and blocks[block] else ""
    if rest >= layout.candidates * layout.options:
        number = rest - layout.candidates * layout.options
        extra = belief.extras[number] if belief is not None else f"extra {number}"
        return Choice(None, f"{extra}{also}")
    slot, option = divmod(rest, layout.options)
    way = belief.options[option] if belief is not None else f"option {option}"
    return Choice(slot, f"slot {slot}: {way}{also}")


def possible(observation: Any, layout: Layout, belief: Belief | None) -> dict[str, int]:
    """The actions that are possible now, by what they are called."""
    legal = np.flatnonzero(np.asarray(observation["action_mask"]) > 0).tolist()
    return {choice_of(action, layout, belief).text: action for action in legal}


def features(observation: Any, layout: Layout, belief: Belief, slot: int) -> list[tuple[str, str, str]]:
    """What policies are shown of a candidate: name, value in its unit, meaning."""
    row = np.asarray(observation["candidates"]).reshape(layout.candidates, layout.features)[slot]
    return [
        (name, f"{value * says.scale:.3g} {says.unit}".strip(), says.doc)
        for (name, says), value in zip(documented(belief.candidate).items(), row.tolist(), strict=True)
    ]


def shares(policy: Policy, observation: Any) -> NDArray[np.float64] | None:
    """How much a policy is for each action, (actions,), sums to one; None for a policy that only says which.

    Policies that weigh actions have ``logits``, as learned ones do.
    """
    weigh = getattr(policy, "logits", None)
    if not callable(weigh):
        return None
    batch = {name: np.asarray(values)[None] for name, values in observation.items()}
    logits = np.asarray(weigh(batch), np.float64)[0]
    logits = np.where(batch["action_mask"][0] > 0, logits, -np.inf)
    weights = np.exp(logits - logits.max())
    return weights / weights.sum()


def asked(policies: dict[str, Policy], observation: Any) -> dict[str, int]:
    """What each policy would do where it stood before this observation."""
    return {name: act_single(policy, observation) for name, policy in policies.items()}
