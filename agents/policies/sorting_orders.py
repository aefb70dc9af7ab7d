"""A sorting planner that packs to order: it knows which lines wait, until when, and when a full bin is swapped.

What a pick brings depends on what is picked before it: items of one grade fill its lines one after the other, and a bin
that they fill is away while it is swapped. Items that no line waits for bring what is left of their value; where the
machine has something better to do with the time, or nothing at all, they pass.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from ...envs.sorting.columns import CANDIDATE, KINDS, candidate_table
from ...envs.sorting.config import REFERENCE_CYCLE_S, PerceptionModel, SortingConfig
from ...envs.sorting.odds import GRADE_COLUMNS, Odds, shares
from ...envs.sorting.order_columns import BOOK, DUE_SCALE_S, LEFT_SCALE, LINES_SHOWN, READY_SCALE_S, STRIDE
from ...kernels import bind, compiled
from .base import Actions, Observation
from .search import Step, Taken
from .sorting import PickPlanner, Picks, RecedingHorizon, over_bin

Array = NDArray[np.float64]

PRICE = 0.2
"""What a second costs, as a share of what work without pause earns [of 0.05 to 0.45, on seeds 2000-2063]."""
CAUGHT = 0.8
"""Share of what comes that a machine with nothing better to do would deliver [of 0.4 to 0.8, on the same]."""
SAVED = 0.3
"""Worth of an item whose line others would fill as well: the time of one pick later [of 0.1 to 0.8, on the same]."""


class OrderedPicks(NamedTuple):
    """What can be gripped in B worlds, and what is known of orders and bins.

    Attributes:
        picks: see ``Picks``; ``gain`` is what an item brings that a line waits for.
        left: (B, 4, LINES_SHOWN), items that open lines still need, by grade, those that are due first in front.
        due_s: (B, 4, LINES_SHOWN), until when, seconds from now.
        worth: (B, 4, LINES_SHOWN), what filling one of them is worth, as a share.
        room: (B, 4), items until a bin is full.
        ready_s: (B, 4), until an empty bin stands there.
        holds: items in a bin.
        swap_s: until a full one has been swapped.
        surplus: worth of an item that no line waits for, as a share.
    """

    picks: Picks
    left: Array
    due_s: Array
    worth: Array
    room: NDArray[np.int64]
    ready_s: Array
    holds: int
    swap_s: float
    surplus: float


@compiled
def before(problem: OrderedPicks, w: int, grade: int, used: int) -> int:
    """How many items of a grade a sequence has picked."""
    count = 0
    for candidate in range(problem.picks.present.shape[1]):
        count += used >> candidate & 1 and problem.picks.goal[w, candidate] == grade
    return count


@compiled
def wanted(problem: OrderedPicks, w: int, grade: int, ahead: int, time_s: float) -> float:
    """Share of its worth that one more item of a grade brings at a time, when so many ``ahead`` of it fill lines."""
    for line in range(problem.left.shape[2]):
        left = problem.left[w, grade, line]
        if problem.due_s[w, grade, line] >= time_s and left > ahead:
            return problem.worth[w, grade, line]
        ahead = int(max(ahead - left, 0))
    return problem.surplus


@compiled
def let_go_s(problem: OrderedPicks, w: int, grade: int, ahead: int, swapped_s: float, there_s: float) -> float:
    """When an item can be let go over its bin by a machine that is ``there_s``.

    Args:
        problem: numbers of the problem.
        w: the world.
        grade: of the bin.
        ahead: items that the sequence has put there.
        swapped_s: when the last bin that the sequence filled is back; another one of its bins is back before that.
        there_s: when the machine is over it.
    """
    ready_s = problem.ready_s[w, grade] if ahead < problem.room[w, grade] else swapped_s
    return max(there_s, ready_s) + problem.picks.paces.release_s


@compiled
def extend(
    problem: OrderedPicks,
    w: int,
    x: float,
    y: float,
    z: float,
    clock_s: float,
    candidate: int,
    option: int,
    taken: Taken,
    first: bool,
) -> Step:
    """Grip one more item; ``z`` is when the last bin that the sequence filled is back, seconds from now."""
    picks = problem.picks
    if not (picks.possible[w, candidate] if first else picks.present[w, candidate]):
        return Step(x, y, z, clock_s, 0.0, False)
    grade = picks.goal[w, candidate]
    place, ahead = picks.bins[grade], before(problem, w, grade, taken.used)
    if first:
        done_s, possible = picks.done_s[w, candidate], True
    else:
        there_s, possible = over_bin(picks, w, x, y, clock_s, candidate)
        done_s = let_go_s(problem, w, grade, ahead, z, there_s)
    gain = picks.gain[w, candidate] * wanted(problem, w, grade, ahead, done_s)
    if ahead + 1 >= problem.room[w, grade] and (ahead + 1 - problem.room[w, grade]) % problem.holds == 0:
        z = done_s + problem.swap_s
    return Step(place[0], place[1], z, done_s, gain, possible)


@compiled
def prospect(problem: OrderedPicks, w: int, clock_s: float, taken: Taken, last: int) -> float:
    """What the others bring in the queue's order, where they are worth the time, less the price of all the time."""
    picks, used = problem.picks, taken.used
    place, worth = picks.bins[picks.goal[w, last]], 0.0
    x, y, z = place[0], place[1], 0.0
    for candidate in picks.order[w]:
        if not used >> candidate & 1:
            step = extend(problem, w, x, y, z, clock_s, candidate, 0, Taken(used, 0, 0), False)
            if step.possible and step.gain > picks.price * (step.clock_s - clock_s):
                worth += step.gain
                x, y, z, clock_s = step.x, step.y, step.z, step.clock_s
                used |= 1 << candidate
    return worth - picks.price * clock_s


bind(OrderedPicks, extend, prospect)


class OrderHorizon(PickPlanner):
    """Counts what a sequence is expected to deliver, and what the queue's order would still deliver after it.

    Less a price for all the time. A line that is due late can be filled later, so that filling it now is worth less.

    Args:
        config: the task's public numbers.
        depth: picks ahead.
        width: sequences kept at each depth.
        by_value: count values instead of items.
        perception: statistics of the camera; None: those that ship with the package.
        budget_ms: see ``PickPlanner``.
    """

    name = "receding-horizon"

    def __init__(
        self,
        config: SortingConfig,
        depth: int = 7,
        width: int = 16,
        *,
        by_value: bool = False,
        perception: PerceptionModel | None = None,
        budget_ms: float | None = None,
    ):
        """See ``PickPlanner``."""
        super().__init__(config, depth, width, budget_ms)
        orders, values = config.scenario.orders, np.array(config.produce.value, float)
        self._full = values
        self._values = values if by_value else np.ones(KINDS)
        self._orders, self._odds = orders, Odds(config, perception or PerceptionModel.measured())
        # By number a surplus item counts nothing.
        self._rate_hz = CAUGHT * config.scenario.rate_hz * shares(config)
        self._surplus = orders.surplus if by_value else 0.0
        self._price = PRICE * float(np.mean(self._odds.aligned * self._values)) / REFERENCE_CYCLE_S

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        table = candidate_table(observation).astype(np.float64)
        gain = self._odds.placed(table) * (table[..., GRADE_COLUMNS] @ self._values)
        picks = self._picks(observation, gain, self._price)
        return self._plan(self.problem(observation, picks), picks, 0.0)

    def gain(self, observation: Observation) -> Array:
        """What gripping each candidate now is expected to deliver (B, K), what is sold loose as its share."""
        table = candidate_table(observation).astype(np.float64)
        full = table[..., GRADE_COLUMNS] @ self._full
        waited_for = table[..., CANDIDATE.value] > 0.5 * (1.0 + self._orders.surplus) * full
        worth = table[..., GRADE_COLUMNS] @ self._values
        return self._odds.placed(table) * worth * np.where(waited_for, 1.0, self._surplus)

    def problem(self, observation: Observation, picks: Picks) -> OrderedPicks:
        """What the search works on."""
        machine, holds = observation["machine"][:, BOOK:].astype(np.float64), self._orders.bin_holds
        book = machine.reshape(len(machine), KINDS, STRIDE)
        lines = book[..., 2:].reshape(*book.shape[:2], LINES_SHOWN, 2)
        due_s = lines[..., 1] * DUE_SCALE_S
        return OrderedPicks(
            picks=picks,
            left=np.round(lines[..., 0] * LEFT_SCALE),
            due_s=due_s,
            worth=self._worth(np.round(lines[..., 0] * LEFT_SCALE), due_s),
            room=holds - np.round(book[..., 0] * holds).astype(np.int64),
            ready_s=book[..., 1] * READY_SCALE_S,
            holds=holds,
            swap_s=self._orders.swap_s,
            surplus=self._surplus,
        )

    def _worth(self, left: Array, due_s: Array) -> Array:
        """What filling one more item of a line now is worth (B, 4, LINES_SHOWN), as a share of its value.

        What comes later may fill it as well: an item that is filled now is worth its value with the chance that there
        will be too few, else the time that filling it later would take.
        """
        needed = left.cumsum(axis=2)
        come = self._rate_hz[:, None] * due_s
        lacking = ndtr((needed - come) / np.sqrt(come + 1.0))
        return SAVED + (1.0 - SAVED) * lacking


def receding_horizon(env: Any, seed: int) -> PickPlanner:
    """``receding-horizon``: the one that knows of orders where there are any."""
    return _planner(env, False)


def receding_horizon_by_value(env: Any, seed: int) -> PickPlanner:
    """``receding-horizon-value``: counts values instead of items."""
    return _planner(env, True)


def _planner(env: Any, by_value: bool) -> PickPlanner:
    core = env.unwrapped.core
    kind = OrderHorizon if core.config.scenario.orders.shipments else RecedingHorizon
    return kind(core.config, by_value=by_value, perception=core.perception)
