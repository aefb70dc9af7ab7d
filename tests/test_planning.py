"""The beam search against every sequence there is, on toy errands."""

from itertools import permutations, product
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldgym.agents.policies import search as planning
from fieldgym.agents.policies.search import MOST_CANDIDATES, NOTHING, Step, Taken, search, way_of, with_one, within
from fieldgym.kernels import bind, compiled


class Errands(NamedTuple):
    """Places (B, K) on a line with values (B, K) and times until they close (B, K); a second way takes half as long.

    An errand leaves ``left`` of the value of the next place, by the way in which it was run.
    """

    place: np.ndarray
    value: np.ndarray
    closes_s: np.ndarray
    price: float
    left: tuple[float, float] = (1.0, 1.0)


@compiled
def extend(problem, w, x, y, z, clock_s, candidate, option, taken, first):
    at = problem.place[w, candidate]
    done_s = clock_s + abs(at - x) / (1.0 + option)
    gain = problem.value[w, candidate] - 0.3 * option
    if candidate > 0 and taken.used >> (candidate - 1) & 1:
        gain *= problem.left[way_of(taken, candidate - 1)]
    return Step(at, y, z, done_s, gain, done_s <= problem.closes_s[w, candidate])


@compiled
def prospect(problem, w, clock_s, taken, last):
    return -problem.price * clock_s


bind(Errands, extend, prospect)


def brute(problem, w, depth):
    """Best worth of every first decision, over all sequences."""
    k = problem.place.shape[1]
    best = {}
    for length in range(1, depth + 1):
        for order in permutations(range(k), length):
            for options in product((0, 1), repeat=length):
                x, clock, gained, taken = 0.0, 0.0, 0.0, Taken(0, 0, 0)
                for candidate, option in zip(order, options, strict=True):
                    step = planning.extend(problem, w, x, 0.0, 0.0, clock, candidate, option, taken, False)
                    if not step.possible:
                        break
                    x, clock, gained = step.x, step.clock_s, gained + step.gain
                    taken = with_one(taken, candidate, option)
                else:
                    first = 2 * order[0] + options[0]
                    worth = gained + planning.prospect(problem, w, clock, taken, 0)
                    best[first] = max(best.get(first, -np.inf), worth)
    return best


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 3))
def test_a_wide_search_finds_the_best_of_all_sequences(seed, depth):
    rng = np.random.default_rng(seed)
    worlds, k = 3, 4
    problem = Errands(
        rng.normal(size=(worlds, k)), rng.random((worlds, k)), 3.0 * rng.random((worlds, k)), 0.4, (0.2, 0.9)
    )
    answers = search(problem, np.zeros((worlds, 3)), np.zeros(worlds), 2, np.full(worlds, k), depth, 200)
    for w in range(worlds):
        best = brute(problem, w, depth)
        if answers[w] == NOTHING:
            assert max(best.values(), default=-1.0) < 0.0
        else:
            assert best[answers[w]] == pytest.approx(max(best.values()))
            assert best[answers[w]] >= -1e-8


def test_of_equals_the_first_counts_and_something_before_nothing():
    problem = Errands(np.array([[1.0, -1.0]]), np.ones((1, 2)), np.full((1, 2), 9.0), 1.0)
    start, both = np.zeros((1, 3)), np.array([2])
    assert search(problem, start, np.zeros(1), 1, both, 1, 4)[0] == 0
    assert search(problem, start, np.full(1, 1e-3), 1, both, 1, 4)[0] == NOTHING
    assert search(problem, start, np.zeros(1), 1, np.array([0]), 1, 4)[0] == NOTHING


def test_the_most_candidates_are_kept_apart():
    """All lie in the way of the last; each is visited once, so the best sequence of two ends there."""
    k = MOST_CANDIDATES
    value = np.zeros((1, k))
    value[0, -2:] = 5.0
    problem = Errands(np.linspace(0.1, 0.2, k)[None], value, np.full((1, k), 9.0), 1.0)
    assert search(problem, np.zeros((1, 3)), np.zeros(1), 1, np.array([k]), 3, 4)[0] == k - 2


def test_numbers_that_nothing_is_bound_to_are_refused():
    with pytest.raises(KeyError):
        planning.extend((1.0,), 0, 0.0, 0.0, 0.0, 0.0, 0, 0, Taken(0, 0, 0), True)


def test_a_sequence_knows_in_which_way_it_did_what():
    taken = Taken(0, 0, 0)
    for candidate, option in ((3, 2), (0, 1), (MOST_CANDIDATES - 1, 3), (5, 0)):
        taken = with_one(taken, candidate, option)
    assert [way_of(taken, candidate) for candidate in (3, 0, MOST_CANDIDATES - 1, 5)] == [2, 1, 3, 0]
    assert [candidate for candidate in range(MOST_CANDIDATES) if taken.used >> candidate & 1] == [0, 3, 5, 63]


def test_a_search_within_a_budget_grows_wider_while_there_is_time(monkeypatch):
    now_s, widths = [0.0], []
    monkeypatch.setattr("fieldgym.agents.policies.search.time.perf_counter", lambda: now_s[0])

    def plan(width):
        widths.append(width)
        now_s[0] += 1e-3 * width
        return np.array([width])

    assert within(0.0, plan) == [1] and widths == [1]
    widths.clear()
    assert within(30.0, plan) == widths[-1:] == [8]
    assert within(1e9, plan) == [planning.MOST_WIDTH]
