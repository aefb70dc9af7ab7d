"""What uneven ground makes of a decision: where the tool lands, what its camera corrects, how deep it works.

The tool acts in the second of its own phases (the burn, the stir); the camera beside it looks at the beginning of the
first, where the move has ended, from where the tool then really is. So the camera corrects all that frame, odometry and
front camera have put wrong until then; what the frame does afterwards stays.
"""

from __future__ import annotations

from ...kernels import compiled
from ..core import Array
from ..shaking import U, at_line, lands, sinks_m
from .state import Tables, V, Worlds
from .timing import WORK, A, Approach, way_of

ACTS = WORK + 1
"""The phase in which the tool acts."""


@compiled
def cart_after(tables: Tables, worlds: Worlds, w: int, speed: Array, time_s: float) -> float:
    """Where the cart is at a time from the beginning of a decision; ``speed`` (2,) is the plan's."""
    way, _ = way_of(speed[V.before], speed[V.after], tables.acceleration_m_s2, time_s)
    return worlds.cart[w] + way


@compiled
def until(phases_s: Array, phase: int) -> float:
    """Seconds of the phases (P,) before one."""
    total = 0.0
    for before in range(phase):
        total += phases_s[before]
    return total


@compiled
def corrected(
    tables: Tables,
    worlds: Worlds,
    w: int,
    speed: Array,
    way: Approach,
    carried_m: float,
    seen_along_m: float,
    seen_across_m: float,
) -> tuple[float, float]:
    """How far along and across the camera beside the tool corrects it, which has come to a track's place.

    Args:
        tables: of the rules.
        worlds: their state.
        w: the world.
        speed: (2,), the plan's.
        way: how the tool has come there.
        carried_m: by how much the odometry has carried the track on since it was told, see ``carried_on``.
        seen_along_m: where the camera sees a plant; far away where it sees none.
        seen_across_m: see ``seen_along_m``.
    """
    if not tables.looks_after:
        return 0.0, 0.0
    cart = cart_after(tables, worlds, w, speed, way.move_s + way.wait_s)
    x, y = lands(worlds.surface[w], tables.shape, cart, way.carrier_m + carried_m, way.lean_m, way.across_m)
    along, across = seen_along_m - x, seen_across_m - y
    if along * along + across * across > tables.gate_m * tables.gate_m:
        return 0.0, 0.0
    return along, across


@compiled
def carried_on(tables: Tables, worlds: Worlds, w: int, speed: Array, way: Approach) -> float:
    """By how much the odometry has carried a track on when the tool has come to it, beyond what its report says.

    A report says where the plant will be believed when it is under the tool's middle; the tool may come before or after
    that, and then the odometry has erred for less or more of its way.
    """
    if not tables.believes:
        return 0.0
    cart = cart_after(tables, worlds, w, speed, way.move_s + way.wait_s)
    surface, shape = worlds.surface[w], tables.shape
    return at_line(surface, shape, U.slip, cart) - at_line(surface, shape, U.slip, way.carrier_m + way.lean_m)


@compiled
def worked(tables: Tables, worlds: Worlds, w: int, speed: Array, phases_s: Array, target: Array) -> tuple[float, float]:
    """Where a tool at ``target`` (3,) works on average while it acts, with phases (P,): by Simpson's rule."""
    surface, begin = worlds.surface[w], until(phases_s, ACTS)
    along, across = 0.0, 0.0
    for part in range(3):
        cart = cart_after(tables, worlds, w, speed, begin + 0.5 * part * phases_s[ACTS])
        x, y = lands(surface, tables.shape, cart, target[A.carrier], target[A.lean], target[A.across])
        weight = 4.0 / 6.0 if part == 1 else 1.0 / 6.0
        along += weight * x
        across += weight * y
    return along, across


@compiled
def deeper(
    tables: Tables, worlds: Worlds, w: int, speed: Array, phases_s: Array, mode: int, along_m: float, across_m: float
) -> float:
    """Share of its depth that a tool reaches at a place, halfway through its acting; 1 for one that does not dig."""
    depth = tables.depths_m[mode]
    if depth <= 0.0:
        return 1.0
    cart = cart_after(tables, worlds, w, speed, until(phases_s, ACTS) + 0.5 * phases_s[ACTS])
    return max(1.0 + sinks_m(worlds.surface[w], tables.shape, cart, along_m, across_m) / depth, 0.0)
