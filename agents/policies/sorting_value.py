"""A sorting planner whose sequences end in a learned value: what is on the belt after them is worth to a machine.

The value of a belt is linear in features of what lies on it: how many items, and how much gain, have how much time left
until they can no longer be gripped; the products of these, because items with little time get into each other's way;
what gripping them in the queue's order brings and how long it takes; how long the stream still goes on.
``policy_iteration`` learns the weights from play.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...envs.sorting.columns import CANDIDATE, KINDS, MACHINE, PLACE_SCALE_M, candidate_table
from ...envs.sorting.config import SortingConfig
from ...envs.sorting.odds import GRADE_COLUMNS
from ...kernels import bind, compiled
from .base import Actions, Observation
from .search import Step, Taken
from .sorting import PickPlanner, Picks, queue
from .sorting import extend as extend_picks
from .value_weights import ARRIVALS, ENDS, FORMAT, GAINS, LEFT, SHAPES, VALUE
from .weights import LEARNED, PolicyFileError, Weights, check_weights, whole

Array = NDArray[np.float64]

_LEFT_S = np.array([0.25, 1.0, 1.75, 2.75, 3.75, 5.25, 7.25, 9.25])
"""Time left, in seconds: an item counts in part for the one before and the one after its own. One with less than the
first is gone before the tool is there."""
_END_S = np.array([-17.0, -7.0, -2.0, 3.0, 8.0])
"""The time until the last item comes into view, and as much longer, counts while it is positive."""
_PAIR_SCALE, _END_SCALE_S = 0.1, 10.0
_RATE, _ARRIVE_LEFT, _ARRIVE_GAIN, _LAST = range(ARRIVALS)
_PORTIONS = 4
MOST_DEPTH, MOST_WIDTH = 16, 256
_PLACE = slice(MACHINE.x, MACHINE.x + 2)

assert len(_LEFT_S) == LEFT and len(_END_S) == ENDS


class ValuedPicks(NamedTuple):
    """What can be gripped in B worlds, and what is known of the value of what is left on the belt.

    Attributes:
        picks: see ``Picks``.
        time_s: (B,), since the episode began.
        place_m: (B, 2), where the platform is.
        arrivals: (4,), items a second that come into view, the time that they have left then, their mean gain, and when
            the last one comes.
        value: (VALUE,), weights of the features.
    """

    picks: Picks
    time_s: Array
    place_m: Array
    arrivals: Array
    value: Array


@compiled
def _count(row: Array, left_s: float, items: float, gain: float) -> None:
    """Count items with this much time left, and their gain."""
    if left_s < _LEFT_S[0]:
        return
    after = 1
    while after < LEFT - 1 and left_s >= _LEFT_S[after]:
        after += 1
    share = min((left_s - _LEFT_S[after - 1]) / (_LEFT_S[after] - _LEFT_S[after - 1]), 1.0)
    row[after - 1] += (1.0 - share) * items
    row[after] += share * items
    row[LEFT + after - 1] += (1.0 - share) * gain
    row[LEFT + after] += share * gain


@compiled
def describe(problem: ValuedPicks, w: int, x: float, y: float, clock_s: float, used: int, row: Array) -> None:
    """Write the features (VALUE,) of world ``w`` after ``clock_s`` seconds in which the ``used`` items were gripped.

    The platform is then at ``x``, ``y``. Items that will have come into view by then count as they come on average.
    """
    picks, arrivals = problem.picks, problem.arrivals
    for i in range(VALUE):
        row[i] = 0.0
    for candidate in range(picks.present.shape[1]):
        if picks.present[w, candidate] and not used >> candidate & 1:
            left_s = (picks.last_m[w, candidate] - picks.along_m[w, candidate]) / picks.paces.speed_m_s - clock_s
            _count(row, left_s, 1.0, picks.gain[w, candidate])
    seen_s = min(max(arrivals[_LAST] - problem.time_s[w], 0.0), clock_s)
    items = arrivals[_RATE] * seen_s / _PORTIONS
    for portion in range(_PORTIONS if seen_s > 0.0 else 0):
        since_s = clock_s - seen_s * (portion + 0.5) / _PORTIONS
        _count(row, arrivals[_ARRIVE_LEFT] - since_s, items, arrivals[_ARRIVE_GAIN] * items)
    place = 2 * LEFT
    for i in range(LEFT):
        for j in range(i, LEFT):
            row[place] = _PAIR_SCALE * row[i] * row[j]
            place += 1
        for j in range(LEFT):
            row[place] = _PAIR_SCALE * row[i] * row[LEFT + j]
            place += 1
    until_s = arrivals[_LAST] - problem.time_s[w] - clock_s
    for end in range(ENDS):
        row[place + end] = max(until_s + _END_S[end], 0.0) / _END_SCALE_S
    worth, done_s = queue(picks, w, x, y, clock_s, used)
    row[place + ENDS], row[place + ENDS + 1], row[place + ENDS + 2] = 1.0, worth, done_s - clock_s
    # The averages above are not all that more items are worth: this weight, which is found by trial, mends the rest.
    row[place + ENDS + 3] = seen_s


@compiled
def describe_all(problem: ValuedPicks) -> Array:
    """Features (B, VALUE) of the worlds as they are."""
    rows = np.empty((len(problem.time_s), VALUE))
    for w in range(len(rows)):
        describe(problem, w, problem.place_m[w, 0], problem.place_m[w, 1], 0.0, 0, rows[w])
    return rows


@compiled
def extend(
    problem: ValuedPicks,
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
    """Grip one more item."""
    return extend_picks(problem.picks, w, x, y, z, clock_s, candidate, option, taken, first)


@compiled
def prospect(problem: ValuedPicks, w: int, clock_s: float, taken: Taken, last: int) -> float:
    """The learned value of what a sequence leaves."""
    row, place = np.empty(VALUE), problem.picks.bins[problem.picks.goal[w, last]]
    describe(problem, w, place[0], place[1], clock_s, taken.used, row)
    worth = 0.0
    for i in range(VALUE):
        worth += row[i] * problem.value[i]
    return worth


bind(ValuedPicks, extend, prospect)


def gain_features(table: NDArray[np.float32]) -> Array:
    """What the expected reward of gripping candidates (..., F) is linear in: (..., GAINS), grades by powers of quality.

    Besides the grip it knows what a camera mixes up: that is learned by grade.
    """
    grades, quality = (
        table[..., GRADE_COLUMNS].astype(np.float64),
        table[..., CANDIDATE.quality, None].astype(np.float64),
    )
    return np.concatenate([grades, grades * quality, grades * quality**2], axis=-1)


assert GAINS == 3 * KINDS


class ValueSearch(PickPlanner):
    """Plans with a beam search whose sequences end in a learned value.

    Attributes:
        name: of the policy in tables.
        card: what is known of it.

    Args:
        config: the task's public numbers.
        learned: the weights.
    """

    def __init__(self, config: SortingConfig, learned: ValueWeights):
        """Take the machine's times from the configuration."""
        super().__init__(config, learned.depth, learned.width)
        self.name, self.card = learned.name, learned.card
        self._config = config
        self._gain, self._arrivals, self._value = (
            learned.weights[key].astype(np.float64) for key in ("gain", "arrivals", "value")
        )

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        problem = self.problem(observation)
        return self._plan(problem, problem.picks)

    def gain(self, observation: Observation) -> Array:
        """Reward that gripping each candidate is expected to bring (B, K)."""
        return gain_features(candidate_table(observation)) @ self._gain

    def problem(self, observation: Observation) -> ValuedPicks:
        """What the search works on."""
        gain = self.gain(observation)
        place_m = observation["machine"][:, _PLACE].astype(np.float64) * PLACE_SCALE_M
        time_s = elapsed_s(observation, self._config)
        return ValuedPicks(self._picks(observation, gain, 0.0), time_s, place_m, self._arrivals, self._value)


def elapsed_s(observation: Observation, config: SortingConfig) -> Array:
    """Seconds (B,) since the episode began."""
    return observation["machine"][:, MACHINE.time].astype(np.float64) * config.scenario.time_limit_s


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
        config = env.unwrapped.core.config
        if not isinstance(config, SortingConfig):
            raise PolicyFileError("it was made for sorting, this environment is another task")
        return ValueSearch(config, self)
