"""Names instead of column numbers: one declaration of a block of numbers, for kernels and for people.

A block is a ``NamedTuple`` of ints; ``numbered`` makes the instance whose fields are their own places, which costs
compiled code nothing::

    class Totals(NamedTuple):
        time: Annotated[int, Says("s", "simulated time since the episode began")]
        done: Annotated[int, Says("", "finished targets")]

    T = numbered(Totals)     # in a kernel: totals[w, T.done] += 1.0
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, TypeVar, get_type_hints

import numpy as np
from numpy.typing import NDArray

BlockT = TypeVar("BlockT")


class Says(NamedTuple):
    """What one number of a block means.

    Attributes:
        unit: SI unit; empty for a pure number.
        doc: meaning, in a few words.
        scale: what the number is divided by before policies see it.
        low: smallest value that is shown.
        high: largest value that is shown.
    """

    unit: str
    doc: str
    scale: float = 1.0
    low: float = float("-inf")
    high: float = float("inf")


def numbered(block: type[BlockT]) -> BlockT:
    """The instance of a ``NamedTuple`` of ints whose fields hold their own places: 0, 1, 2, ..."""
    return block(*range(len(names(block))))


def names(block: type[Any]) -> tuple[str, ...]:
    """The names of a block, in order."""
    return tuple(block._fields)


def table_of(candidate: type[Any]) -> Callable[[Mapping[str, NDArray[Any]]], NDArray[np.float32]]:
    """What reads the candidates of an observation as a table (..., K, F), one column a name of ``candidate``."""
    columns = len(names(candidate))

    def candidate_table(observation: Mapping[str, NDArray[Any]]) -> NDArray[np.float32]:
        flat = observation["candidates"]
        return flat.reshape(*flat.shape[:-1], -1, columns)

    return candidate_table


def documented(block: type[Any]) -> Mapping[str, Says]:
    """What each number of a block means.

    Raises:
        TypeError: a field says nothing.
    """
    hints = get_type_hints(block, include_extras=True)
    said = {}
    for name in names(block):
        found = [part for part in getattr(hints[name], "__metadata__", ()) if isinstance(part, Says)]
        if not found:
            raise TypeError(f"{block.__name__}.{name}: annotate it with Says(unit, doc)")
        said[name] = found[0]
    return said
