"""What can be asked of the worlds of a batch by name, as Gymnasium's own vector environments answer."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from gymnasium.vector import VectorEnv
from numpy.typing import NDArray

_SHARED = ("action_space", "backend", "metadata", "observation_space", "perception", "render_mode", "scenario", "spec")
_OWN = ("action_masks", "np_random", "np_random_seed")
"""What can be asked of the worlds by name: what they share, and what each has for itself."""


class AskedByName(VectorEnv[Any, Any, NDArray[Any]]):
    """A batch whose worlds have attributes: what they share, what each has for itself, and what callers give them."""

    _seeds: list[int]
    _generators: list[np.random.Generator | None]

    def __init__(self) -> None:
        """Nothing was given yet."""
        self._named: dict[str, tuple[Any, ...]] = {}

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of every world, -1 before its first reset."""
        return tuple(self._seeds)

    @property
    def np_random(self) -> tuple[np.random.Generator | None, ...]:  # type: ignore[override]
        """The generator of every world, None before its first reset."""
        return tuple(self._generators)

    def action_masks(self) -> NDArray[np.bool_]:
        """Which actions are possible now, bool (num_envs, n)."""
        raise NotImplementedError

    def call(self, name: str, *args: Any, **kwargs: Any) -> tuple[Any, ...]:
        """What ``name`` is in every world, or gives where it can be called, as Gymnasium's ``SyncVectorEnv`` answers.

        Raises:
            AttributeError: see ``get_attr``.
        """
        return tuple(value(*args, **kwargs) if callable(value) else value for value in self.get_attr(name))

    def get_attr(self, name: str) -> tuple[Any, ...]:
        """An attribute of every world: what it has for itself, what the worlds share, or what ``set_attr`` gave it.

        Raises:
            AttributeError: the worlds of a batch have no attribute of this name.
        """
        if name in self._named:
            return self._named[name]
        if name == "action_masks":
            return tuple(partial(self._mask_of, row) for row in range(self.num_envs))
        if name in _OWN:
            return getattr(self, name)
        if name in ("action_space", "observation_space"):
            return (getattr(self, f"single_{name}"),) * self.num_envs
        if name in _SHARED:
            return (getattr(self, name),) * self.num_envs
        known = ", ".join((*_OWN, *_SHARED, *self._named))
        raise AttributeError(
            f"the worlds of a batch have no attribute {name!r}: ask for {known}, or the batch's `core`"
        )

    def set_attr(self, name: str, values: Any) -> None:
        """Give every world an attribute of a caller's own: a list or tuple of one value a world, or one for all.

        Raises:
            AttributeError: the environment has an attribute of this name; worlds cannot change what they share.
            ValueError: there are more or fewer values than worlds.
        """
        if name not in self._named and hasattr(self, name):
            raise AttributeError(f"{name!r} cannot be set: the worlds of a batch share it, make another batch")
        values = tuple(values) if isinstance(values, list | tuple) else (values,) * self.num_envs
        if len(values) != self.num_envs:
            raise ValueError(f"{len(values)} values for {self.num_envs} worlds: give one a world, or a single one")
        self._named[name] = values

    def _mask_of(self, row: int) -> NDArray[np.bool_]:
        return self.action_masks()[row]
