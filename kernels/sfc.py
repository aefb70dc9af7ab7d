"""SFC64, a small fast counting generator (Doty-Humphrey, PractRand), as NumPy has it: less than a nanosecond a step.

A world's own generator gives three numbers that it is begun with, and no more is drawn than what there is needs.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .binding import bind
from .compiling import compiled

SEEDS = 3
"""Numbers that a generator is begun with."""
_SCALE = 9007199254740992.0
_ROUNDS = 12
_ONE, _THREE, _RIGHT, _LEFT, _BACK = np.uint64(1), np.uint64(3), np.uint64(11), np.uint64(24), np.uint64(40)


class Sfc(NamedTuple):
    """State of a generator: three words and a counter."""

    a: Any
    b: Any
    c: Any
    count: Any


@compiled
def stepped(state: Sfc) -> Any:
    """See ``ziggurat``."""
    bits = state.a + state.b + state.count
    a = state.b ^ (state.b >> _RIGHT)
    b = state.c + (state.c << _THREE)
    c = ((state.c << _LEFT) | (state.c >> _BACK)) + bits
    return bits, Sfc(a, b, c, state.count + _ONE)


bind(Sfc, stepped)


@compiled
def begun(numbers: NDArray[np.float64]) -> Any:
    """A generator from three uniform numbers of 53 bits, as NumPy begins one from three words."""
    words = (np.uint64(numbers[0] * _SCALE), np.uint64(numbers[1] * _SCALE), np.uint64(numbers[2] * _SCALE))
    state = Sfc(words[0], words[1], words[2], _ONE)
    for _ in range(_ROUNDS):
        _, state = stepped(state)
    return state
