"""A strip of field under a cart at a steady speed as a time-expanded graph, for any weeding tool; compiled.

States are a finished work on a target, in whatever mode, and the waiting machine. What a way takes follows from the
tool's own ``approach``, from the place at which the arm stood while it worked. That place is known but for its lean
along the row, which the machine chose when it set out, a move earlier: whatever suits the next way best of what it may
have been is taken. Times are rounded down, and a state may be kept for free, so no true schedule is missing; nor is
one when a way is left out that may as well be gone a tick later.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..envs.weeding.timing import A, G, Place, approach, move_time, ready
from ..kernels import compiled
from .shots import Shots

Array = NDArray[np.float64]
Numbers = NDArray[np.int64]

_HALVINGS = 5


class Strip(NamedTuple):
    """What can be worked on, J options in the order of their places along the row.

    Attributes:
        told_m: (J, 2), where the machine believes the target when it sets out.
        aim_m: (J, 2), where it works.
        slack_m: (J,), how far the machine may believe it from ``told_m``.
        stand_s: (J,), standing over it.
        track: (J,), what is worked on once at most, -1 where that is not known.
        cart_m: position of the cart in the beginning.
        speed_m_s: of the cart.
        front_m: the window begins this far in front of the machine's middle and ends as far behind it.
        moment_s: waiting takes at least this.
        tick_s: grain of time.
        until_s: nothing happens after this.
        late_s: from setting out to the work no more passes than this.
    """

    told_m: Array
    aim_m: Array
    slack_m: Array
    stand_s: Array
    track: Numbers
    cart_m: float
    speed_m_s: float
    front_m: float
    moment_s: float
    tick_s: float
    until_s: float
    late_s: float


@compiled
def least_move_s(
    arm: Any,
    carrier_m: float,
    lean_m: float,
    across_m: float,
    aim_m: float,
    low_m: float,
    high_m: float,
    slack_m: float,
) -> tuple[float, float]:
    """Least time of a move to a place from a work at ``aim_m`` along the row, and the lean that it comes with.

    The arm stood there with a lean between ``low_m`` and ``high_m`` and its carrier where that asks for.

    Args:
        arm: the arm's numbers.
        carrier_m: place to move to; ``lean_m`` alike.
        lean_m: see ``carrier_m``.
        across_m: stroke across.
        aim_m: where it worked.
        low_m: least lean.
        high_m: largest lean.
        slack_m: taken off every stroke.
    """
    across = max(abs(across_m) - slack_m, 0.0)
    # The lean's stroke is none at one end of this range, the carrier's at the other; outside both only grow.
    one, other = min(max(lean_m, low_m), high_m), min(max(aim_m - carrier_m, low_m), high_m)
    for _ in range(_HALVINGS):
        middle = 0.5 * (one + other)
        leaning = move_time(arm, 0.0, max(abs(lean_m - middle) - slack_m, 0.0), 0.0)
        carrying = move_time(arm, max(abs(carrier_m - aim_m + middle) - slack_m, 0.0), 0.0, 0.0)
        if leaning < carrying:
            one = middle
        else:
            other = middle
    leaning = move_time(arm, 0.0, max(abs(lean_m - one) - slack_m, 0.0), 0.0)
    carrying = move_time(arm, max(abs(carrier_m - aim_m + other) - slack_m, 0.0), 0.0, 0.0)
    return max(leaning, carrying, move_time(arm, 0.0, 0.0, across)), 0.5 * (one + other)


@compiled
def build(arm: Any, strip: Strip, shortest_s: Array) -> tuple[Numbers, Any, Any, Numbers, Array, int]:
    """Nodes and edges; see ``timeline.Timeline``. The last option, J, is waiting.

    Args:
        arm: the arm's numbers.
        strip: what can be worked on.
        shortest_s: (J,), no move to an option is shorter.
    """
    n, dt, v = len(strip.stand_s), strip.tick_s, strip.speed_m_s
    ticks = int(strip.until_s / dt) + 2
    # Where the machine may stand: modes of one track have a place in common.
    where, places = np.empty(n, np.int64), 0
    for j in range(n):
        if j == 0 or strip.track[j] < 0 or strip.track[j] != strip.track[j - 1]:
            places += 1
        where[j] = places - 1
    begins = np.searchsorted(where, np.arange(places + 1))
    soonest = np.empty(n, np.int64)
    first_tick, last_tick = np.full(places + 1, ticks), np.empty(places + 1, np.int64)
    for j in range(n):
        far = strip.front_m + strip.slack_m[j]
        enters, leaves = (
            (strip.told_m[j, G.along] - far - strip.cart_m) / v,
            (strip.told_m[j, G.along] + far - strip.cart_m) / v,
        )
        soonest[j] = max(int((max(enters, 0.0) + strip.stand_s[j]) / dt), 1)
        first_tick[where[j]] = min(first_tick[where[j]], soonest[j])
        last_tick[where[j]] = min(int(leaves / dt) + 1, ticks - 1)
    first_tick[places], last_tick[places] = 0, ticks - 1
    # Nodes are numbered from the last tick to the first, so every edge leads to a smaller number.
    number = np.full((places + 1, ticks), -1, np.int32)
    nodes = 0
    for tick in range(ticks - 1, -1, -1):
        for p in range(places + 1):
            if first_tick[p] <= tick <= last_tick[p]:
                number[p, tick] = nodes
                nodes += 1
    state, when = np.empty(nodes, np.int64), np.empty(nodes, np.int64)
    for p in range(places + 1):
        for tick in range(first_tick[p], last_tick[p] + 1):
            state[number[p, tick]], when[number[p, tick]] = p, tick
    wait, end_s = np.empty(nodes, np.int64), np.empty(nodes)
    first = np.zeros(nodes + 1, np.int64)
    room = nodes * 8 + 1024
    to, option = np.empty(room, np.int32), np.empty(room, np.int32)
    edges, high = 0, n - 1
    pause = max(int(strip.moment_s / dt), 1)
    grain, early_m = v * dt, v * strip.late_s + strip.front_m + strip.slack_m.max()
    # When an option ends for who sets out from a place a tick later.
    later = np.full((places + 1, n), ticks, np.int32)
    for node in range(nodes):
        first[node] = edges
        at, tick = state[node], when[node]
        waiting, cart = at == places, strip.cart_m + v * tick * dt
        wait[node] = number[at, tick + 1] if tick < last_tick[at] else node
        end_s[node] = tick * dt
        if edges + n + 1 > len(to):
            to, option = np.append(to, np.empty(len(to), np.int32)), np.append(option, np.empty(len(option), np.int32))
        lean_low, lean_high, i = np.inf, -np.inf, -1
        if waiting:
            place = ready(arm, cart)
            lean_low, lean_high = place.lean_m, place.lean_m
        else:
            i = begins[at]
            place = Place(float(strip.aim_m[i, G.along]), 0.0, float(strip.aim_m[i, G.across]))
            for mode in range(begins[at], begins[at + 1]):
                for late in (shortest_s[mode] - dt, strip.late_s):
                    # The lean was chosen a move and the standing time earlier.
                    along, across = float(strip.told_m[i, G.along]), float(strip.told_m[i, G.across])
                    stand = float(strip.stand_s[mode])
                    lean = approach(arm, stand, place, cart - v * (stand + late), v, along, across).lean_m
                    lean_low, lean_high = min(lean_low, lean), max(lean_high, lean)
            if tick + pause < ticks:
                to[edges], option[edges] = number[places, tick + pause], n
                edges += 1
        aim, across_m = place.carrier_m + (place.lean_m if waiting else 0.0), place.across_m
        # Ticks run backwards here, and with them the cart.
        while high >= 0 and strip.told_m[high, G.along] > cart + early_m:
            high -= 1
        for k in range(high, -1, -1):
            told, across = strip.told_m[k, G.along], strip.told_m[k, G.across]
            if told < cart - early_m:
                break
            kept, later[at, k] = later[at, k], ticks
            if last_tick[where[k]] <= tick or where[k] == at:
                continue
            slack = strip.slack_m[k] + (0.0 if waiting else strip.slack_m[i])
            way = approach(arm, strip.stand_s[k], place, cart, v, told, across)
            move_s, lean = least_move_s(
                arm, way.carrier_m, way.lean_m, across - across_m, aim, lean_low, lean_high, slack + grain
            )
            place = Place(aim - lean, lean, across_m)
            way = approach(arm, strip.stand_s[k], place, cart, v, told, across)
            if not way.legal and slack == 0.0 and way.wait_s <= 0.0:
                continue
            # Who sets out too early stands before the window until the target comes in.
            enters_s = (way.move_s + way.wait_s if way.wait_s > 0.0 else 0.0) - slack / v
            if enters_s > strip.late_s:
                continue
            then = int((tick * dt + max(move_s, enters_s) + strip.stand_s[k]) / dt)
            then = max(then, soonest[k], tick + 1)
            later[at, k] = then
            if then <= last_tick[where[k]] and then < kept:
                to[edges], option[edges] = number[where[k], then], k
                edges += 1
    first[nodes] = edges
    return first, to[:edges].copy(), option[:edges].copy(), wait, end_s, int(number[places, 0])


@compiled
def shortest_moves(arm: Any, told_m: Array, aim_m: Array, slack_m: Array, lean_m: float, moment_s: float) -> Array:
    """Least time (J,) of a way to each place from any other one, however the arm leans.

    Args:
        arm: the arm's numbers.
        told_m: (J, 2), where ways lead.
        aim_m: (J, 2), where they begin.
        slack_m: (J,), taken off the strokes to and from a place.
        lean_m: the arm's lean lies between minus and plus this.
        moment_s: a way by the waiting machine takes at least this.
    """
    shortest = np.full(len(told_m), moment_s)
    for k in range(len(told_m)):
        for i in range(len(told_m)):
            if i != k:
                along, across = told_m[k, G.along] - aim_m[i, G.along], told_m[k, G.across] - aim_m[i, G.across]
                slack = slack_m[i] + slack_m[k]
                move_s, _ = least_move_s(arm, along, 0.0, across, 0.0, -2.0 * lean_m, 2.0 * lean_m, slack)
                shortest[k] = min(shortest[k], move_s)
    return shortest


def shortest(arm: Any, config: Any, shots: Shots) -> Array:
    """No way (J,) to an option is shorter."""
    lean_m, moment_s = float(arm.scale[A.lean]), float(config.cart.moment_s)
    return shortest_moves(arm, shots.told_m, shots.aim_m, shots.slack_m, lean_m, moment_s)


def late_s(arm: Any) -> float:
    """From setting out to the work no more passes than this: the widest move, and the longest wait."""
    ranges = arm.scale
    widest = move_time(arm, 2.0 * ranges[A.carrier] + 0.1, 2.0 * ranges[A.lean], 2.0 * ranges[A.across])
    return float(widest) + float(arm.early_s)
