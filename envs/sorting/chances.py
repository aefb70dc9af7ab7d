"""The random numbers that a stream and what a camera says of it are made of, by name; see ``envs.columns``."""

from __future__ import annotations

from typing import NamedTuple

from ..columns import numbered


class Waits(NamedTuple):
    """Standard exponential numbers of an item: until it comes, and half the square of how far it leans."""

    gap: int
    tilt: int


class Chances(NamedTuple):
    """Uniform numbers of an item: whether it comes with the one before, where, how and what it is, its luck."""

    together: int
    across: int
    yaw: int
    azimuth: int
    kind: int
    length: int
    width: int
    thickness: int
    ripeness: int
    grip: int
    way: int


class Spreads(NamedTuple):
    """Standard normal numbers of an item."""

    slip_along: int
    slip_across: int
    skin: int


class SeenChances(NamedTuple):
    """Uniform numbers of an item before the camera: whether it is seen, and as which grade."""

    seen: int
    grade: int


class Errors(NamedTuple):
    """Standard normal errors of a report."""

    along: int
    across: int
    up: int
    yaw: int
    lean_x: int
    lean_y: int
    length: int
    width: int
    thickness: int


class GhostChances(NamedTuple):
    """Uniform numbers of a report of nothing."""

    passing: int
    across: int
    yaw: int
    length: int
    width: int
    grade: int


WAIT, U, Z = numbered(Waits), numbered(Chances), numbered(Spreads)
SEEN, ERROR, GHOST = numbered(SeenChances), numbered(Errors), numbered(GhostChances)
