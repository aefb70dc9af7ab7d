"""How long everything takes: the one time model that rules, reports, planners and bounds share. Scalars, compiled.

A pick: wait until the item is near enough, approach (the tool arrives over the item at the belt's speed), go down, grip
and come up while following the belt, carry to the bin, let go. Horizontal motions follow the quintic law under limits
of speed and acceleration relative to the belt; none is shorter than the turn that goes with it.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ...kernels import compiled
from ...motion import QUINTIC
from .config import SortingConfig

GUESS_S = 0.15
"""First guess at how much longer an approach takes than turning alone."""
_ROUNDS = 2


class Paces(NamedTuple):
    """What times depend on: the configuration in the shape that a kernel takes.

    Attributes:
        speed_m_s: of the belt.
        pace: seconds a metre at the speed limit; following the belt adds its speed to the motion's own, so that much
            is kept back.
        square_pace: seconds squared a metre at the acceleration limit.
        turn_pace: as ``pace``, a rad.
        turn_square_pace: as ``square_pace``, a rad.
        down_pace: as ``pace`` for the way down and up, where the whole speed is free.
        shortest_s: a motion is given at least this long.
        stop_s: coming to rest after a grip that holds nothing.
        grip_s: closing the fingers.
        release_s: opening them.
    """

    speed_m_s: float
    pace: float
    square_pace: float
    turn_pace: float
    turn_square_pace: float
    down_pace: float
    shortest_s: float
    stop_s: float
    grip_s: float
    release_s: float

    @classmethod
    def of(cls, config: SortingConfig) -> Paces:
        """The numbers of a configuration."""
        machine, sorter, grip = config.machine, config.machine.sorter, config.grip
        speed = config.belt.speed_m_s
        pace, square_pace = QUINTIC.paces(sorter.velocity_m_s - speed, sorter.acceleration_m_s2)
        turn_pace, turn_square_pace = QUINTIC.paces(sorter.turn_rad_s, sorter.turn_rad_s2)
        return cls(
            speed_m_s=speed,
            pace=float(pace),
            square_pace=float(square_pace),
            turn_pace=float(turn_pace),
            turn_square_pace=float(turn_square_pace),
            down_pace=float(QUINTIC.peak_velocity / sorter.velocity_m_s),
            shortest_s=machine.shortest_move_s,
            stop_s=machine.stop_s,
            grip_s=grip.grip_s,
            release_s=grip.release_s,
        )


@compiled
def stroke_s(stroke: float, pace: float, square_pace: float) -> float:
    """``motion.laws.shortest`` of a stroke >= 0, in the operations that cost a kernel least; the same bits."""
    return max(stroke * pace, math.sqrt(stroke * square_pace))


@compiled
def turn_s(angle_rad: float, turn_pace: float, turn_square_pace: float, shortest_s: float) -> float:
    """Seconds that a turn takes, and so the motion that it goes with at least."""
    return max(stroke_s(angle_rad, turn_pace, turn_square_pace), shortest_s)


@compiled
def hold_s(descend_s: float, grip_s: float) -> float:
    """Seconds from the approach's end to the lift's: down, grip and up."""
    return 2.0 * descend_s + grip_s


@compiled
def way_s(along_m: float, across_m2: float, slack_m: float, pace: float, square_pace: float, least_s: float) -> float:
    """Seconds of a horizontal motion: along, the square across, what is taken off, and the least that it takes."""
    way = max(math.sqrt(along_m * along_m + across_m2) - slack_m, 0.0)
    return max(stroke_s(way, pace, square_pace), least_s)


@compiled
def approach_s(
    speed_m_s: float,
    now_m: float,
    first_m: float,
    from_m: float,
    across_m2: float,
    slack_m: float,
    pace: float,
    square_pace: float,
    least_s: float,
    guess_s: float,
) -> float:
    """Seconds until the tool is over an item that moves on.

    The time is a fixed point. The belt is slow against the tool, so that two rounds bring it to 0.1 % of the distance.

    Args:
        speed_m_s: of the belt.
        now_m: x of the platform over the item, now.
        first_m: first x where the approach may end.
        from_m: x of the platform.
        across_m2: square of the way across.
        slack_m: taken off the way.
        pace: see ``Paces``, as the next.
        square_pace: see ``pace``.
        least_s: the least that it takes.
        guess_s: first guess at how much more it takes.
    """
    approach = least_s + guess_s
    for _ in range(_ROUNDS):
        follow = speed_m_s * approach
        ahead = max(now_m + follow, first_m) - from_m
        approach = way_s(ahead - 0.5 * follow, across_m2, slack_m, pace, square_pace, least_s)
    return approach


@compiled
def carry_s(
    speed_m_s: float,
    way_m: float,
    aside_m2: float,
    slack_m: float,
    pace: float,
    square_pace: float,
    least_s: float,
    guess_s: float,
) -> float:
    """Seconds from the lift to the bin; the belt's speed dies away on the way. Arguments as of ``approach_s``.

    Args:
        speed_m_s: of the belt.
        way_m: from where the item is lifted to the bin, along the belt.
        aside_m2: square of the way across.
        slack_m: taken off the way.
        pace: see ``Paces``, as the next.
        square_pace: see ``pace``.
        least_s: the least that it takes.
        guess_s: first guess at the time.
    """
    carry = guess_s
    for _ in range(_ROUNDS):
        carry = way_s(way_m - 0.5 * speed_m_s * carry, aside_m2, slack_m, pace, square_pace, least_s)
    return carry
