"""What stands nearest to a place on a strip: kernels over plants (N, 2) that are sorted along the row."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...kernels import compiled
from ..core import Array
from .timing import G

LOOKED_AT = 6
"""Weeds on either side of one that may be the nearest to it."""


@compiled
def passed(plants: Array, along_m: float, guess: int) -> int:
    """How many plants stand before a place along the row, looked for from ``guess`` on: the answer for one near it."""
    while guess > 0 and plants[guess - 1, G.along] >= along_m:
        guess -= 1
    while guess < len(plants) and plants[guess, G.along] < along_m:
        guess += 1
    return guess


@compiled
def nearest_along(plants: Array, along_m: float, before: int) -> int:
    """Index of the plant that is nearest along the row, of which ``before`` are ``passed``; of equals the first."""
    left, right = max(before - 1, 0), min(before, len(plants) - 1)
    return left if along_m - plants[left, G.along] <= plants[right, G.along] - along_m else right


@compiled
def crop_index(crop: Array, along_m: float, before: int, beside: int) -> int:
    """As ``nearest_along``, but for the crop plants without ``beside`` neighbours on a side."""
    return min(max(nearest_along(crop, along_m, before), beside), len(crop) - 1 - beside)


@compiled
def gap_to_crop(crop: Array, along_m: float, across_m: float, before: int) -> float:
    """Distance from a place to the nearest crop plant of any row, of which ``before`` are ``passed``."""
    best = np.inf
    for i in range(before, len(crop)):
        along = crop[i, G.along] - along_m
        if along >= best:
            break
        best = min(best, np.hypot(along, crop[i, G.across] - across_m))
    for i in range(before - 1, -1, -1):
        along = crop[i, G.along] - along_m
        if -along >= best:
            break
        best = min(best, np.hypot(along, crop[i, G.across] - across_m))
    return best


@compiled
def gap_to_weed(weed: Array, reach_m: Array, count: int, i: int, looked_at: int, most_m: float) -> float:
    """Distance from weed ``i`` to the nearest other one, less how far the leaves of both reach.

    Args:
        weed: places, sorted along.
        reach_m: (count,), how far from their stems leaves reach; zeros for the distance of the stems.
        count: so many of them are weeds.
        i: the weed.
        looked_at: only so many on either side along may be the nearest.
        most_m: what is farther may count as infinitely far.
    """
    best, both_m = np.inf, reach_m[i] + reach_m[:count].max()
    for j in range(i + 1, min(i + looked_at + 1, count)):
        along = weed[j, G.along] - weed[i, G.along]
        if along - both_m >= min(best, most_m):
            break
        best = min(best, np.hypot(along, weed[j, G.across] - weed[i, G.across]) - (reach_m[i] + reach_m[j]))
    for j in range(i - 1, max(i - looked_at - 1, -1), -1):
        along = weed[i, G.along] - weed[j, G.along]
        if along - both_m >= min(best, most_m):
            break
        best = min(best, np.hypot(along, weed[i, G.across] - weed[j, G.across]) - (reach_m[i] + reach_m[j]))
    return best


@compiled
def nearest_weeds(weed: Array, places: Array) -> NDArray[np.int64]:
    """``nearest_along`` of places (R, T, 2) among the weeds (R, N, 2) of their own world, (R, T)."""
    index = np.empty(places.shape[:2], np.int64)
    for r in range(len(places)):
        before = 0
        for t in range(places.shape[1]):
            before = passed(weed[r], places[r, t, G.along], before)
            index[r, t] = nearest_along(weed[r], places[r, t, G.along], before)
    return index


@compiled
def crop_gaps(crop: Array, places: Array) -> Array:
    """``gap_to_crop`` (T,) of places (T, 2) among crop plants (C, 2)."""
    gaps, before = np.empty(len(places)), 0
    for t in range(len(places)):
        before = passed(crop, places[t, G.along], before)
        gaps[t] = gap_to_crop(crop, places[t, G.along], places[t, G.across], before)
    return gaps


@compiled
def weed_gaps(weed: Array, reach_m: Array, looked_at: int) -> Array:
    """``gap_to_weed`` (N,) of weeds (N, 2) with leaves that reach so far (N,)."""
    gaps = np.empty(len(weed))
    for i in range(len(weed)):
        gaps[i] = gap_to_weed(weed, reach_m, len(weed), i, looked_at, np.inf)
    return gaps
