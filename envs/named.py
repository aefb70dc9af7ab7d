"""Columns by name in an info dictionary, made when somebody looks: most steps' are never read."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray


class NamedColumns(dict[str, Any]):
    """``{name: (B,), "_name": bool (B,)}`` of a block's columns, in Gymnasium's layout; fills itself at the first look.

    It is a dictionary in every respect but when its entries are made: copies, pickles and merges of it are plain ones.
    """

    __slots__ = ("_waiting",)

    def __init__(self, names: Sequence[str], values: NDArray[np.float64], present: NDArray[np.bool_]):
        """Keep what the entries are made of.

        Args:
            names: of the columns.
            values: (B, names), which nobody writes to any more: those of a page.
            present: (B,), the worlds that the block is of, alike; the others' values are 0.
        """
        # Not empty: JSON's encoder takes a dictionary's size before it asks for its entries.
        super().__init__({names[0]: None} if len(names) else {})
        self._waiting: tuple[Any, ...] | None = (names, values, present)

    def filled(self) -> dict[str, Any]:
        """Itself, with its entries."""
        if self._waiting is not None:
            (names, values, present), self._waiting = self._waiting, None
            kept = values if present.all() else np.where(present[:, None], values, 0.0)
            for name, column in zip(names, kept.T.copy(), strict=True):
                super().__setitem__(name, column)
                super().__setitem__("_" + name, present.copy())
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """As a plain dictionary."""
        return dict, (dict(self.filled()),)

    def __deepcopy__(self, memo: dict[int, Any]) -> dict[str, Any]:
        """A plain dictionary."""
        return {name: values.copy() for name, values in self.items()}

    def copy(self) -> dict[str, Any]:
        """A plain dictionary."""
        return dict(self)


def info_of(
    blocks: Mapping[str, tuple[Sequence[str], NDArray[np.float64]]],
    mask: NDArray[np.int8],
    present: NDArray[np.bool_] | None = None,
) -> dict[str, Any]:
    """Info of a batch in Gymnasium's layout.

    Args:
        blocks: names and values (B, names) of each block by its name; nobody writes to the values any more.
        mask: (B, actions), what is possible.
        present: (B,), the worlds that have an info, by default all; the others' values are 0.
    """
    there = np.ones(len(mask), np.bool_) if present is None else present.copy()
    shown = mask.copy() if present is None else np.where(there[:, None], mask, np.int8(0))
    info: dict[str, Any] = {"action_mask": shown, "_action_mask": there.copy()}
    for name, (names, values) in blocks.items():
        info[name], info["_" + name] = NamedColumns(names, values, there), there.copy()
    return info


def _after_filling(method: Callable[..., Any]) -> Callable[..., Any]:
    def call(self: NamedColumns, *args: Any, **kwargs: Any) -> Any:
        return method(self.filled(), *args, **kwargs)

    call.__name__, call.__doc__ = method.__name__, method.__doc__
    return call


_READING = (
    "__contains__",
    "__eq__",
    "__getitem__",
    "__iter__",
    "__len__",
    "__ne__",
    "__or__",
    "__repr__",
    "__reversed__",
)
_OTHERS = (
    "__delitem__",
    "__ior__",
    "__reversed__",
    "__ror__",
    "__setitem__",
    "clear",
    "pop",
    "popitem",
    "setdefault",
    "update",
)
for _name in (*_READING, *_OTHERS, "get", "items", "keys", "values"):
    setattr(NamedColumns, _name, _after_filling(getattr(dict, _name)))
