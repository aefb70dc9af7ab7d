"""A set policy in NumPy: what ``set_policy.SetActor`` computes, without PyTorch."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .base import Actions, Observation, StatelessPolicy
from .layout import Layout, layout_of
from .weights import LEARNED, PolicyFileError, Weights, check_weights, whole

FORMAT = "fieldgym-set-policy-1"
MOST_HIDDEN = 512


def shapes(layout: Layout, hidden: int, relations: int = 0) -> dict[str, tuple[int, ...]]:
    """Names and shapes of an actor's weights, as ``set_policy.SetActor`` names them."""
    h, r = hidden, relations
    heard = {"from_one.weight": (r, h), "from_one.bias": (r,), "to_other.weight": (r, h)} if r else {}
    return heard | {
        "encoder.candidate.weight": (h, layout.features),
        "encoder.candidate.bias": (h,),
        "encoder.machine.weight": (h, layout.machine),
        "encoder.second.weight": (h, h),
        "encoder.second.bias": (h,),
        "encoder.context.weight": (h, 2 * h + layout.machine + 1),
        "encoder.context.bias": (h,),
        "own.weight": (h, h + 2 * r),
        "own.bias": (h,),
        "shared.weight": (h, h),
        "options.weight": (layout.blocks * layout.options, h),
        "options.bias": (layout.blocks * layout.options,),
        "extras.weight": (layout.blocks * layout.extras, h),
        "extras.bias": (layout.blocks * layout.extras,),
    }


class NetworkPolicy(StatelessPolicy):
    """A trained set policy in NumPy: the most probable possible action.

    Attributes:
        name: of the policy in tables.
        layout: of the task that it decides.
        card: what is known of it: task, settings, seeds, scores, weaknesses.
    """

    def __init__(
        self,
        layout: Layout,
        hidden: int,
        weights: Weights,
        card: Mapping[str, Any],
        name: str = LEARNED,
        *,
        relations: int = 0,
    ):
        """Take checked weights.

        Raises:
            PolicyFileError: a weight is missing, of the wrong shape or type, or not finite.
        """
        check_weights(weights, shapes(layout, hidden, relations))
        self.name, self.layout, self.hidden, self.relations, self.card = name, layout, hidden, relations, dict(card)
        self.weights: Weights = {key: np.ascontiguousarray(values) for key, values in weights.items()}
        # Transposed once: a matrix product with the batch in front is what every call needs.
        self._w = {key: np.ascontiguousarray(values.T) for key, values in self.weights.items()}

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        return np.where(observation["action_mask"] > 0, self.logits(observation), -np.inf).argmax(axis=1)

    def logits(self, observation: Observation) -> NDArray[np.float32]:
        """Logits (B, actions) before the mask.

        Raises:
            ValueError: the observation is of another task or number of slots.
        """
        layout, w = self.layout, self._w
        machine, flat = observation["machine"], observation["candidates"]
        # What is shown of the machine and of candidates beyond what the network knows stands behind that.
        known, actions = machine[..., : layout.machine], observation["action_mask"].shape[1:]
        features, rest = divmod(flat.shape[-1], layout.candidates)
        fits = known.shape[1:] == (layout.machine,) and flat.ndim == 2 and actions == (layout.actions,)
        if not fits or rest or features < layout.features:
            raise ValueError(
                f"machine {machine.shape[1:]}, candidates {flat.shape[1:]} and actions {actions} do not fit this "
                f"policy, made for {layout.machine}, {layout.candidates} x {layout.features} and {layout.actions} "
                "numbers"
            )
        table = flat.reshape(-1, layout.candidates, features)
        candidates = np.ascontiguousarray(table[..., : layout.features])
        present = (candidates[..., :1] > 0.0).astype(np.float32)
        code = candidates @ w["encoder.candidate.weight"] + w["encoder.candidate.bias"]
        code += (known @ w["encoder.machine.weight"])[:, None]
        code = np.maximum(code, 0.0) @ w["encoder.second.weight"] + w["encoder.second.bias"]
        code = np.maximum(code, 0.0)
        there = code * present
        count = present.sum(axis=1)
        mean = there.sum(axis=1) / np.maximum(count, 1.0)
        pooled = np.concatenate([mean, there.max(axis=1), known, count / np.float32(layout.candidates)], axis=1)
        context = np.maximum(pooled @ w["encoder.context.weight"] + w["encoder.context.bias"], 0.0)
        if self.relations:
            code = np.concatenate([code, self._heard(code, present)], axis=2)
        joined = code @ w["own.weight"] + w["own.bias"] + (context @ w["shared.weight"])[:, None]
        slots = (np.maximum(joined, 0.0) @ w["options.weight"] + w["options.bias"]) * present
        extras = context @ w["extras.weight"] + w["extras.bias"]
        return layout.join(slots, extras, np.concatenate)

    def _heard(self, code: NDArray[np.float32], present: NDArray[np.float32]) -> NDArray[np.float32]:
        """Mean and maximum (B, K, 2 R) over the present candidates of what each is to each candidate (B, K, H)."""
        w, there = self._w, present[:, None]
        one = code @ w["from_one.weight"] + w["from_one.bias"]
        pairs = np.maximum(one[:, :, None] + (code @ w["to_other.weight"])[:, None], 0.0) * there
        mean = pairs.sum(axis=2) / np.maximum(there.sum(axis=2), 1.0)
        return np.concatenate([mean, pairs.max(axis=2)], axis=2)

    @classmethod
    def of(cls, card: Mapping[str, Any], weights: Weights, name: str) -> NetworkPolicy:
        """From what a file holds.

        Raises:
            PolicyFileError: the card's sizes or the weights cannot be used.
        """
        try:
            hidden, relations = whole(card.get("hidden"), "hidden"), whole(card.get("relations", 0), "relations")
            layout = Layout(**{str(key): whole(value, key) for key, value in card["layout"].items()})
        except (TypeError, AttributeError, ValueError, KeyError) as error:
            raise PolicyFileError(f"its card's layout cannot be used ({error})") from None
        if not (1 <= hidden <= MOST_HIDDEN and 0 <= relations <= MOST_HIDDEN) or max(vars(layout).values()) > 4096:
            raise PolicyFileError(f"its card's hidden = {hidden}, relations = {relations} or layout is out of range")
        return cls(layout, hidden, weights, card, name, relations=relations)

    @property
    def head(self) -> dict[str, Any]:
        """What a card has to say for the weights to be read."""
        sizes = {"layout": vars(self.layout), "hidden": self.hidden, "relations": self.relations}
        return {"format": FORMAT, **sizes}

    def fitted(self, env: Any) -> NetworkPolicy:
        """The same weights for an environment's number of slots; what was learned of K is kept as it is.

        What the environment shows of its machine and its candidates beyond what the policy was made for is not looked
        at.

        Raises:
            PolicyFileError: the environment's sizes are others.
        """
        found = layout_of(env)
        layout = replace(
            found,
            machine=min(found.machine, self.layout.machine),
            features=min(found.features, self.layout.features),
        )
        if replace(self.layout, candidates=layout.candidates) != layout:
            raise PolicyFileError(f"it was made for {self.layout}, this environment has {found}")
        if self.layout == layout:
            return self
        return NetworkPolicy(layout, self.hidden, self.weights, self.card, self.name, relations=self.relations)
