"""Arrays of many worlds, declared once: name, type, shape, and what stands where nothing is.

A state is a ``NamedTuple`` of arrays; what each means stands below it::

    class Worlds(NamedTuple):
        head_mass_g: Annotated[Array, shaped("heads")]
        "What is left on the head."
        track_head: Annotated[NDArray[np.int64], shaped("tracks", empty="heads")]
        "The head behind a report."

    allocated(Worlds, 8, heads=61, tracks=80)    # (8, 61) zeros, and (8, 80) times 60: the last head stands for none
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache
from typing import Any, NamedTuple, TypeVar, get_args, get_type_hints

import numpy as np

from .columns import names

StateT = TypeVar("StateT", bound=tuple[Any, ...])


class Shape(NamedTuple):
    """Shape and content of an array that holds nothing yet.

    Attributes:
        sizes: of its axes but for the first, that of the worlds: numbers, names of sizes, or blocks of named columns.
        empty: what stands in it: a number, or the last place of a size by its name.
    """

    sizes: tuple[int | str | type[Any], ...]
    empty: float | str


def shaped(*sizes: int | str | type[Any], empty: float | str = 0) -> Shape:
    """What is written beside the type of an array; see ``Shape``."""
    return Shape(sizes, empty)


def allocated(state: type[StateT], worlds: int, **sizes: int) -> StateT:
    """A state of worlds that hold nothing yet, with these sizes by name."""
    arrays = []
    for dtype, made in _declared(state):
        shape = (worlds, *(_length(size, sizes) for size in made.sizes))
        empty = sizes[made.empty] - 1 if isinstance(made.empty, str) else made.empty
        arrays.append(np.full(shape, empty, dtype) if empty else np.zeros(shape, dtype))
    return state(*arrays)


def _length(size: int | str | type[Any], sizes: Mapping[str, int]) -> int:
    if isinstance(size, str):
        return sizes[size]
    return size if isinstance(size, int) else len(names(size))


@cache
def _declared(state: type[Any]) -> list[tuple[Any, Shape]]:
    """Scalar type and shape of every array."""
    hints = get_type_hints(state, include_extras=True)
    found = []
    for name in state._fields:
        array, made = get_args(hints[name])
        found.append((get_args(get_args(array)[1])[0], made))
    return found
