"""Inverse kinematics of the machines with two arms and two forearms, as machine code.

Poses are treated in pieces, whose columns stay in the processor's cache and of which the compiler makes vectors. A
pose by itself goes through the same arithmetic, so that its result is the same to the last bit in any batch.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled
from ..kernels.angles import arctangent

Array = NDArray[np.float64]

SHIFT, DROP, SCALE, LEAD, SIDE, LEVEL = range(6)
"""Columns of the legs' numbers: the wrist's place from the tool centre, x less the motor's and y, m; 0.5 / arm, 1/m;
(arm^2 - forearm^2) / (2 arm), m; 1 for the leg whose elbow points to -x and -1 for the other; the height over the
motors, m, below which no wrist has a closure with an upright arm."""

_HANGING = -0.5 * np.pi
_PIECE = 256


@compiled
def arm_angle(x_m: float, y_m: float, scale: float, lead_m: float, side: float, level_m: float) -> float:
    """Angle of a driven arm whose forearm holds a wrist at (x, y) from its motor, rad; NaN where it cannot reach.

    The half-angle root of the loop closure: with phi = q + pi/2 and t = tan(phi/2) it is one quadratic in t. For the
    wanted closure (root - x) / (y - reach) turns to 0/0 where the other one's arm is upright; multiplied out it reads
    (y + reach) / (root + x), which is sound there. Both vanish only where arm and forearm lie on the vertical with the
    arm upright.
    """
    square = x_m * x_m + y_m * y_m
    reach = square * scale + lead_m
    positive = np.sqrt(square - reach * reach)
    root = -positive if side < 0.0 else positive
    high = not (y_m < level_m)
    turned = high & (side * x_m > 0.0)
    upright = high & (root == x_m) & (y_m == reach)
    rise = y_m + reach if turned else (1.0 if upright else root - x_m)
    run = root + x_m if turned else (0.0 if upright else y_m - reach)
    return 2.0 * arctangent(rise, run) + _HANGING


@compiled
def inverse_of_one(position: Array, legs: Array, angles: Array) -> None:
    """Fill the arms' angles (2,) for a tool position (2,); ``legs`` (2, 6) in the columns above."""
    for leg in range(2):
        x, y = position[0] + legs[leg, SHIFT], position[1] + legs[leg, DROP]
        angles[leg] = arm_angle(x, y, legs[leg, SCALE], legs[leg, LEAD], legs[leg, SIDE], legs[leg, LEVEL])


@compiled
def inverse_of_many(positions: Array, legs: Array, angles: Array) -> None:
    """``inverse_of_one`` for positions (n, 2) and angles (n, 2)."""
    x, y = np.empty(_PIECE), np.empty(_PIECE)
    column = np.empty(_PIECE)
    for start in range(0, len(positions), _PIECE):
        count = min(_PIECE, len(positions) - start)
        for i in range(count):
            x[i], y[i] = positions[start + i, 0], positions[start + i, 1]
        for leg in range(2):
            shift, drop, scale, lead = legs[leg, SHIFT], legs[leg, DROP], legs[leg, SCALE], legs[leg, LEAD]
            side, level = legs[leg, SIDE], legs[leg, LEVEL]
            for i in range(count):
                column[i] = arm_angle(x[i] + shift, y[i] + drop, scale, lead, side, level)
            for i in range(count):
                angles[start + i, leg] = column[i]
