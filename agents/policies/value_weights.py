"""What a sorting planner with a learned value has learned, as plain arrays; see ``sorting_value``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from .weights import LEARNED, PolicyFileError, Weights, check_weights, whole

if TYPE_CHECKING:
    from .sorting_value import ValueSearch

FORMAT = "fieldgym-sorting-value-1"
GAINS, ARRIVALS, LEFT, ENDS = 12, 4, 8, 5
"""Weights of an item's expected reward, numbers of the arrivals, knots of the time left and of the time to the end."""
PAIRS = LEFT * (LEFT + 1) // 2 + LEFT * LEFT
VALUE = 2 * LEFT + PAIRS + ENDS + 4
"""Features of a belt."""
SHAPES = {"gain": (GAINS,), "arrivals": (ARRIVALS,), "value": (VALUE,)}
MOST_DEPTH, MOST_WIDTH = 16, 256


class ValueWeights:
    """Learned weights before they are fitted to an environment.

    Attributes:
        depth: picks ahead.
        width: sequences kept at each depth.
        weights: ``gain``, ``arrivals`` and ``value``, see ``sorting_value``.
        card: what is known of the policy.
        name: of the policy in tables.
    """

    def __init__(self, depth: int, width: int, weights: Weights, card: Mapping[str, Any], name: str = LEARNED):
        """Take weights.

        Raises:
            PolicyFileError: a size is out of range, or a weight cannot be used.
        """
        if not (1 <= depth <= MOST_DEPTH and 1 <= width <= MOST_WIDTH):
            raise PolicyFileError(f"depth = {depth} or width = {width} is out of range")
        check_weights(weights, SHAPES)
        self.depth, self.width, self.weights, self.card, self.name = depth, width, weights, dict(card), name

    @classmethod
    def of(cls, card: Mapping[str, Any], weights: Weights, name: str) -> ValueWeights:
        """From what a file holds.

        Raises:
            PolicyFileError: the card's sizes or the weights cannot be used.
        """
        return cls(whole(card.get("depth"), "depth"), whole(card.get("width"), "width"), weights, card, name)

    @property
    def head(self) -> dict[str, Any]:
        """What a card has to say for the weights to be read."""
        return {"format": FORMAT, "depth": self.depth, "width": self.width}

    def fitted(self, env: Any) -> ValueSearch:
        """The policy for an environment.

        Raises:
            PolicyFileError: the environment is none of sorting.
        """
        from ...envs.sorting.config import SortingConfig
        from .sorting_value import ValueSearch

        config = env.unwrapped.core.config
        if not isinstance(config, SortingConfig):
            raise PolicyFileError("it was made for sorting, this environment is another task")
        return ValueSearch(config, self)
