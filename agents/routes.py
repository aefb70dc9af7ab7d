"""Open routes through a few places by nearest neighbour and 2-opt."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray


def open_route(times: NDArray[np.float64]) -> list[int]:
    """Order in which to visit places 1..n from place 0 without coming back.

    Args:
        times: symmetric travel times (n + 1, n + 1).

    Returns:
        The n places as indices 0..n-1 (place 1 is 0), a route that no 2-opt move shortens.
    """
    n = len(times) - 1
    route, left = [0], set(range(1, n + 1))
    while left:
        here = times[route[-1]]
        nearest = min(left, key=lambda place: (here[place], place))
        route.append(nearest)
        left.remove(nearest)
    improved = True
    while improved:
        improved = False
        for i in range(1, n):
            for j in range(i + 1, n + 1):
                # Reversing route[i..j] changes its two ends; behind the last place nothing follows.
                before = times[route[i - 1], route[i]]
                after = times[route[i - 1], route[j]]
                if j < n:
                    before += times[route[j], route[j + 1]]
                    after += times[route[i], route[j + 1]]
                if after < before - 1e-12:
                    route[i : j + 1] = route[i : j + 1][::-1]
                    improved = True
    return [place - 1 for place in route[1:]]


def route_time(times: NDArray[np.float64], route: list[int]) -> float:
    """Duration of an open route in the form that ``open_route`` returns."""
    stops = [0, *(place + 1 for place in route)]
    return float(sum(times[a, b] for a, b in pairwise(stops)))
