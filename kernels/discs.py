"""Discs that lie over one another."""

from __future__ import annotations

import math

from .compiling import compiled

TOUCH_M = 1e-9
"""Discs whose edges are this near to touching from within count as touching: rounding stays out of the lens."""


@compiled
def covered_share(cover_m: float, disc_m: float, distance_m: float) -> float:
    """Share of a disc's area under another disc: their lens, in closed form, by the disc's area.

    Args:
        cover_m: radius of the disc on top, metres.
        disc_m: radius of the disc below it, positive.
        distance_m: between their middles.
    """
    if distance_m >= cover_m + disc_m:
        return 0.0
    if distance_m <= abs(cover_m - disc_m) + TOUCH_M:
        return min(1.0, (cover_m / disc_m) ** 2)
    # Cosines of half the angle that the lens takes of each disc; each disc adds a sector less a triangle.
    square = distance_m * distance_m
    disc = min((square + disc_m * disc_m - cover_m * cover_m) / (2.0 * distance_m * disc_m), 1.0)
    cover = min((square + cover_m * cover_m - disc_m * disc_m) / (2.0 * distance_m * cover_m), 1.0)
    lens = disc_m * disc_m * (math.acos(disc) - disc * math.sqrt(1.0 - disc * disc))
    lens += cover_m * cover_m * (math.acos(cover) - cover * math.sqrt(1.0 - cover * cover))
    return lens / (math.pi * disc_m * disc_m)
