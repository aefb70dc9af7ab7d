"""What is drawn for many worlds at once: blocks of numbers, each world's row from its own generator."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import ceil, prod, sqrt

import numpy as np
from scipy.special import pdtr

from ..kernels.chance import fill_blocks
from .core import Array


def draw_blocks(generators: Sequence[np.random.Generator], lengths: Sequence[int]) -> list[Array]:
    """Blocks (R, n) of these lengths, uniform and standard normal numbers in turn; each world draws its own rows.

    What comes first is the same whatever is drawn after it: a field, whatever the camera is.
    """
    blocks = [np.empty((len(generators), length)) for length in lengths]
    fill_blocks(generators, blocks)
    return blocks


def begins(lengths: Sequence[int]) -> list[int]:
    """Where parts of these lengths begin that lie one after the other."""
    return [sum(lengths[:part]) for part in range(len(lengths))]


class Block:
    """Hands out columns of the worlds' random blocks in a fixed order."""

    def __init__(self, numbers: Array):
        """Take a block (R, n)."""
        self.numbers = numbers
        self.used = 0

    def take(self, *shape: int) -> Array:
        """The next numbers (R, *shape)."""
        count = prod(shape)
        part = self.numbers[:, self.used : self.used + count]
        self.used += count
        return part.reshape(len(self.numbers), *shape)


@lru_cache(maxsize=64)
def poisson_table(mean: float, sigmas: float, more: int) -> Array:
    """Cumulative Poisson probabilities of 0, 1, ... up to so many standard deviations and a few more over the mean."""
    slots = ceil(mean + sigmas * sqrt(mean) + more) if mean > 0.0 else 0
    return pdtr(np.arange(slots), mean)
