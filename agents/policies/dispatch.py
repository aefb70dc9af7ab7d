"""Which row a transplanter's rule presents when it does not plant: of trays in line, or of ordered ones."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...envs.columns import names, numbered
from ...envs.transplanting.columns import NEXT_SOURCE, NEXT_TARGET, TURN_SOURCES, TURN_TARGETS, M
from ...envs.transplanting.config import MOST_ORDERS, MOST_SOURCES
from ...envs.transplanting.order_columns import ORDERS_AT, SOURCES_AT, Order, SourceTray
from .base import Observation

Array = NDArray[np.floating[Any]]
Flags = NDArray[np.bool_]
Moves = NDArray[np.int64]

PLANT = 0
"""A move that is none; the others are actions counted from the end, and below 0."""
S, O = numbered(SourceTray), numbered(Order)  # noqa: E741


class Carousels(NamedTuple):
    """What is shown of both carousels, each from the presented tray on.

    Attributes:
        source: (B, source trays, features), see ``SourceTray``.
        order: (B, orders, features), see ``Order``.
    """

    source: NDArray[np.float32]
    order: NDArray[np.float32]


def carousels(observation: Observation) -> Carousels:
    """The carousels of an observation of ordered trays."""
    machine = observation["machine"]
    return Carousels(
        machine[:, SOURCES_AT:ORDERS_AT].reshape(-1, MOST_SOURCES, len(names(SourceTray))),
        machine[:, ORDERS_AT:].reshape(-1, MOST_ORDERS, len(names(Order))),
    )


def wants_second(observation: Observation) -> NDArray[np.float32]:
    """1 where the presented target cells are to hold the second grade, (B,)."""
    machine = observation["machine"]
    if machine.shape[1] <= ORDERS_AT:
        return np.zeros(len(machine), np.float32)
    return machine[:, ORDERS_AT + O.second]


class Dispatch:
    """Decides what is presented."""

    def __init__(self, config: Any, belief: Any):
        """Take what is known beforehand, and a ``tray_belief.TrayBelief``."""
        self.config, self.belief = config, belief

    def moves(self, observation: Observation, pairs: Flags) -> Moves:
        """Move (B,), ``PLANT`` where one of the ``pairs`` (B, K) is to be planted: there must be one then."""
        raise NotImplementedError


class OneLine(Dispatch):
    """Trays that pass one behind the other: supply while cells lack it, else the next cells."""

    def moves(self, observation: Observation, pairs: Flags) -> Moves:
        """See ``Dispatch``."""
        more = (observation["machine"][:, M.gaps] > 0.0) & (observation["action_mask"][:, NEXT_SOURCE] > 0)
        return np.where(pairs.any(axis=1), PLANT, np.where(more, NEXT_SOURCE, NEXT_TARGET))


class InLine(Dispatch):
    """The common sequence of ordered trays: each order as it stands on the carousel, each source tray until its end."""

    def moves(self, observation: Observation, pairs: Flags) -> Moves:
        """See ``Dispatch``."""
        seen, mask = carousels(observation), observation["action_mask"]
        supply = self._supply(seen, wants_second(observation), mask)
        lacks = (observation["machine"][:, M.gaps] > 0.0) & (supply != PLANT)
        row = np.where(pairs.any(axis=1), PLANT, np.where(lacks, supply, NEXT_TARGET))
        return np.where(self._leaves(seen) & (mask[:, TURN_TARGETS] > 0), TURN_TARGETS, row)

    def _leaves(self, seen: Carousels) -> Flags:
        """Whether another order (B,) is to be presented first."""
        return seen.order[:, 0, O.open] == 0.0

    def _supply(self, seen: Carousels, second: Array, mask: NDArray[np.int8]) -> Moves:
        """How more of the grade comes, ``PLANT`` where none is left (B,)."""
        left = self._left(seen, second)[:, 1:].any(axis=1)
        return np.where(mask[:, NEXT_SOURCE] > 0, NEXT_SOURCE, np.where(left, TURN_SOURCES, PLANT))

    def _left(self, seen: Carousels, second: Array) -> Flags:
        """Source trays (B, trays) that may have the grade (B,)."""
        here = np.where(second[:, None] > 0.0, seen.source[..., S.second], seen.source[..., S.first])
        return (seen.source[..., S.rows] > 0.0) | (here > 0.0)


class EarliestDue(InLine):
    """The order whose lorry leaves first; source trays one after the other."""

    def _leaves(self, seen: Carousels) -> Flags:
        return _soonest(seen).argmin(axis=1) != 0


class Richest(EarliestDue):
    """The order whose lorry leaves first, from the source tray that is taken to show most of its grade soonest."""

    def _supply(self, seen: Carousels, second: Array, mask: NDArray[np.int8]) -> Moves:
        share = seen.source[..., S.share]
        share = np.where(second[:, None] > 0.0, share, 1.0 - share) * (1.0 - self.config.scenario.vacancy)
        here = np.where(second[:, None] > 0.0, seen.source[..., S.second], seen.source[..., S.first])
        most = np.maximum(here, np.where(seen.source[..., S.rows] > 0.0, share, 0.0))
        best = most.argmax(axis=1)
        nothing = most.max(axis=1) <= 0.0
        move = np.where(best > 0, TURN_SOURCES, np.where(mask[:, NEXT_SOURCE] > 0, NEXT_SOURCE, PLANT))
        return np.where(nothing, PLANT, move)


def _soonest(seen: Carousels) -> Array:
    """Time until each order's lorry leaves (B, orders), infinite where it cannot be served."""
    return np.where(seen.order[..., O.open] > 0.0, seen.order[..., O.left], np.inf)
