"""Open routes of the picker."""

from itertools import pairwise, permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldgym.agents.policies.routes import MOST_EXACT, open_route, shortest_route


def route_time(times, route):
    """Duration of an open route."""
    return float(sum(times[a, b] for a, b in pairwise([0, *(place + 1 for place in route)])))


def travel_times(n: int, seed: int) -> np.ndarray:
    places = np.random.default_rng(seed).random((n + 1, 2))
    return np.abs(places[:, None] - places[None]).max(axis=-1)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, 6), st.integers(0, 10_000))
def test_no_order_is_quicker_than_the_shortest_route(n, seed):
    times = travel_times(n, seed)
    quickest = min(route_time(times, list(order)) for order in permutations(range(n)))
    assert route_time(times, shortest_route(times)) == pytest.approx(quickest)


@settings(max_examples=30, deadline=None)
@given(st.integers(1, MOST_EXACT + 3), st.integers(0, 10_000))
def test_routes_visit_every_place_once_and_mending_is_never_quicker_than_the_best(n, seed):
    times = travel_times(n, seed)
    mended, shortest = open_route(times), shortest_route(times)
    assert sorted(mended) == sorted(shortest) == list(range(n))
    assert route_time(times, shortest) <= route_time(times, mended) + 1e-12
