"""Open routes through a few places: nearest neighbour mended by 2-opt, and the shortest of all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled


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


MOST_EXACT = 12
"""Places up to which the shortest route of all is found (Held, Karp 1962), in milliseconds."""


def shortest_route(times: NDArray[np.float64]) -> list[int]:
    """The quickest open route; beyond ``MOST_EXACT`` places, one that no 2-opt move shortens.

    Args:
        times: symmetric travel times (n + 1, n + 1).

    Returns:
        The n places as indices 0..n-1, as ``open_route`` does.
    """
    n = len(times) - 1
    return open_route(times) if n > MOST_EXACT else held_karp(np.ascontiguousarray(times, np.float64)).tolist()


@compiled
def held_karp(times: NDArray[np.float64]) -> NDArray[np.int64]:
    """The quickest open route by dynamic programming over sets of places; the work doubles with each.

    Args:
        times: (n + 1, n + 1), from place to place, which need not be symmetric.

    Returns:
        The n places as indices 0..n-1, (n,).
    """
    n = len(times) - 1
    every = 1 << n
    # Shortest way from place 0 through a set of places to one of them, and the place before that one.
    best, before = np.full((every, n), np.inf), np.full((every, n), -1)
    for j in range(n):
        best[1 << j, j] = times[0, j + 1]
    for visited in range(1, every):
        for j in range(n):
            here = best[visited, j]
            if here == np.inf:
                continue
            for k in range(n):
                if visited >> k & 1 == 0:
                    there, way = visited | 1 << k, here + times[j + 1, k + 1]
                    if way < best[there, k]:
                        best[there, k], before[there, k] = way, j
    route = np.empty(n, np.int64)
    visited, last = every - 1, 0
    for j in range(n):
        if best[visited, j] < best[visited, last]:
            last = j
    for i in range(n - 1, -1, -1):
        route[i] = last
        previous = before[visited, last]
        visited, last = visited & ~(1 << last), previous
    return route
