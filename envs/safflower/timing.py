"""How long everything takes: one time model for rules, policies, bounds and the machine.

A decision is a rise of the tool to the level of the traverses, cart and tool moving side by side, a wait until the
cart stands still, a descent, and work that takes its time standing. Motions are quintic, as short as the limits allow.
"""

from __future__ import annotations

from typing import Annotated, NamedTuple

import numpy as np

from ...kernels import compiled
from ...motion import QUINTIC
from ...motion.compiled import shortest
from ..columns import Says, numbered
from ..core import Array
from .config import EFFORTS, SafflowerConfig

DRIVE, NOTHING, FINISH, EMPTY = 3, 4, 5, 6
"""Kinds of decision after the three efforts: drive on, an illegal action, leave the row, empty the bag."""
STILL_M = 1e-4
"""A cart that moves less than this stands still and need not settle."""


class Phases(NamedTuple):
    """What the seconds of a decision are spent on."""

    recognise: Annotated[int, Says("s", "locating a head, or segmenting the image of a stop")]
    drive: Annotated[int, Says("s", "moving the cart to another stop")]
    travel: Annotated[int, Says("s", "moving tool and cart to a head")]
    settle: Annotated[int, Says("s", "waiting until plants and frame stand still")]
    shear: Annotated[int, Says("s", "cutting")]
    suck: Annotated[int, Says("s", "collecting after the last stroke, or emptying the bag")]


P = numbered(Phases)


class Rates(NamedTuple):
    """What the time of a motion depends on beside its strokes, in the shape that a kernel takes.

    Attributes:
        cart_pace_s_m: seconds a metre of the cart at its speed limit.
        cart_square_s2_m: seconds squared a metre of the cart at its acceleration limit.
        tool_pace_s_m: the same of the tool.
        tool_square_s2_m: the same of the tool.
        settle_s: wait after the cart has moved.
        clear_m: level of the traverses, in the arm's plane.
    """

    cart_pace_s_m: float
    cart_square_s2_m: float
    tool_pace_s_m: float
    tool_square_s2_m: float
    settle_s: float
    clear_m: float

    @classmethod
    def of(cls, config: SafflowerConfig) -> Rates:
        """The numbers of a configuration."""
        picker = config.machine.picker
        cart_pace, cart_square = QUINTIC.paces(picker.cart_velocity_m_s, picker.cart_acceleration_m_s2)
        tool_pace, tool_square = QUINTIC.paces(picker.tool_velocity_m_s, picker.tool_acceleration_m_s2)
        return cls(
            cart_pace_s_m=float(cart_pace),
            cart_square_s2_m=float(cart_square),
            tool_pace_s_m=float(tool_pace),
            tool_square_s2_m=float(tool_square),
            settle_s=config.machine.settle_s,
            clear_m=config.machine.clear_level_m,
        )


def standing_s(config: SafflowerConfig) -> Array:
    """Seconds (kinds, phases) of a decision by its kind, motion and what follows from it apart."""
    process = config.process
    table = np.zeros((EMPTY + 1, len(P)))
    table[:, P.recognise] = [process.locate_s] * len(EFFORTS) + [process.recognise_s, process.illegal_s, 0.0, 0.0]
    table[:DRIVE, P.shear] = np.array(process.strokes) * process.stroke_m / process.shear_speed
    table[:DRIVE, P.suck] = process.suction_s
    table[EMPTY, P.suck] = config.scenario.bag.empty_s
    return table


@compiled
def cart_s(rates: Rates, stroke_m: float) -> float:
    """Motion of the cart by a stroke of either sign."""
    return shortest(stroke_m, rates.cart_pace_s_m, rates.cart_square_s2_m)


@compiled
def tool_s(rates: Rates, stroke_m: float) -> float:
    """Motion of the tool by a stroke of either sign."""
    return shortest(stroke_m, rates.tool_pace_s_m, rates.tool_square_s2_m)


@compiled
def beside_s(rates: Rates, along_m: float, across_m: float) -> float:
    """Cart and tool moving side by side, on the level of the traverses."""
    return max(cart_s(rates, along_m), tool_s(rates, across_m))


@compiled
def level_s(rates: Rates, height_m: float) -> float:
    """Rise from a height in the arm's plane to the level of the traverses, or descent to it."""
    return tool_s(rates, max(rates.clear_m - height_m, 0.0))


@compiled
def settling_s(rates: Rates, along_m: float) -> float:
    """Wait after a motion of the cart."""
    return rates.settle_s if abs(along_m) > STILL_M else 0.0


@compiled
def levels_s(rates: Rates, height_m: Array) -> Array:
    """``level_s`` of heights (n,)."""
    times = np.empty(len(height_m))
    for i in range(len(height_m)):
        times[i] = level_s(rates, height_m[i])
    return times


@compiled
def legs_s(rates: Rates, begin: Array, end: Array, slack_m: float, settle: bool) -> Array:
    """Times (n, m) between places whose first two columns are along and across, on the level of the traverses.

    Args:
        rates: of the machine.
        begin: (n, 2 or more), metres.
        end: (m, 2 or more), metres.
        slack_m: strokes are shorter by this.
        settle: whether the wait for the cart counts.
    """
    times = np.empty((len(begin), len(end)))
    for i in range(len(begin)):
        for j in range(len(end)):
            along = max(abs(end[j, 0] - begin[i, 0]) - slack_m, 0.0)
            across = max(abs(end[j, 1] - begin[i, 1]) - slack_m, 0.0)
            times[i, j] = beside_s(rates, along, across)
            if settle:
                times[i, j] += settling_s(rates, along)
    return times
