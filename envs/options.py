"""What may be asked of a step and of a reset."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from operator import index
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernels.config_kinds import show
from .assembly import meant
from .core import TaskCore
from .field import FieldError
from .field_files import read_field
from .field_rows import other_unit


def checked_action(action: Any, n: int) -> int:
    """One of ``n`` actions as a number.

    Raises:
        ValueError: it is no integer of the action space.
    """
    # Policies give these, and as an array they would take longer than the rules.
    if type(action) is int or type(action) is np.int64:
        value = int(action)
    else:
        number = np.asarray(action)
        if number.size != 1 or number.dtype.kind not in "iu":
            raise ValueError(f"action = {show(action)} is not one integer: give a number in 0..{n - 1}")
        value = int(number.reshape(()))
    if not 0 <= value < n:
        raise ValueError(f"action = {show(value)}: allowed range 0..{n - 1}, see info['action_mask']")
    return value


def checked_actions(actions: Any, worlds: int, n: int) -> NDArray[np.int64]:
    """One of ``n`` actions for each world, (worlds,), as numbers of their own.

    Raises:
        ValueError: they are no integers of the action space, one a world.
    """
    numbers = np.asarray(actions)
    if numbers.shape != (worlds,) or numbers.dtype.kind not in "iu":
        raise ValueError(f"actions are {numbers.dtype} of shape {numbers.shape}: give {worlds} integers in 0..{n - 1}")
    if numbers.min() < 0 or numbers.max() >= n:
        bad = int(np.flatnonzero((numbers < 0) | (numbers >= n))[0])
        raise ValueError(f"action {int(numbers[bad])} of world {bad}: allowed range 0..{n - 1}")
    return numbers.astype(np.int64)


def checked_options(options: Any, known: Sequence[str]) -> Mapping[str, Any]:
    """``options`` of a reset, none of them unknown.

    Raises:
        ValueError: they are no mapping, or an unknown one is among them.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise ValueError(f"options = {show(options)}: give a dict, with any of {', '.join(map(repr, known))}")
    for name in options:
        if name not in known:
            raise ValueError(f"option {show(name)} of reset is unknown: {meant(name, known)}")
    return options


def checked_seed(seed: Any) -> int | None:
    """A seed as Python's own integer; NumPy's are integers too.

    Raises:
        ValueError: it is no whole number from 0.
    """
    if seed is None:
        return None
    try:
        number = -1 if isinstance(seed, bool | np.bool_) else index(seed)
    except Exception:  # whatever an object's own __index__ brings
        number = -1
    if number < 0:
        raise ValueError(f"seed = {show(seed)}: give a whole number from 0, or None")
    return number


def checked_seeds(seed: Any, worlds: int) -> list[int | None]:
    """A seed for every world: number i, ``seed + i`` of a single number, or none.

    Raises:
        ValueError: there are more or fewer than worlds, or one is no whole number from 0.
    """
    if seed is None or np.ndim(seed) == 0:
        first = checked_seed(seed)
        return [None if first is None else first + i for i in range(worlds)]
    seeds = [checked_seed(one) for one in seed]
    if len(seeds) != worlds:
        raise ValueError(f"{len(seeds)} seeds for {worlds} worlds: give one seed a world, or a single number")
    return seeds


def completed(core: TaskCore[Any, Any], field: Any, generator: np.random.Generator) -> Any:
    """A field of a core's task with nothing missing, read from a file where it is a path.

    Args:
        core: completes it, see ``TaskCore.complete``.
        field: a field or a path.
        generator: draws what the field does not say.

    Raises:
        FieldError: it holds no field of this task, or one that does not fit; of a file with the line.
    """
    given = read_field(field, core.field_type) if isinstance(field, str | PathLike) else field
    try:
        return core.complete(given, generator)
    except FieldError as error:
        origin = getattr(given, "origin", None)
        if origin is None:
            raise
        if error.column in core.window and error.column not in origin.hints and error.kind == given.main:
            table = getattr(given, error.kind)
            value = getattr(table, error.column)[error.row]
            advice = other_unit(table.columns()[error.column], value, *core.window[error.column])
            origin = origin._replace(hints={**origin.hints, error.column: advice})
        raise origin.located(error) from None
