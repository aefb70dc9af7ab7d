"""Where an environment stands, as a value: taken, kept, sent to another process, and gone back to."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium.error import ClosedEnvironmentError, ResetNeeded
from numpy.typing import NDArray

from .core import TaskCore

_EPISODE = "episode"
"""Views follow it to notice another episode: a world that is gone back to is one."""


@dataclass(frozen=True)
class State:
    """Everything that the future of an environment depends on; may be pickled, and is read only.

    Made by ``get_state`` and taken by ``set_state``; from a file it is as trustworthy as any pickle.

    Attributes:
        config: of the environment; only an equal one takes the state.
        perception: likewise.
        arrays: of the rules by name, each with a leading world axis.
        chance: of every world, the state of its generator and its seed.
        remembered: what the environment itself remembers, by name.
    """

    config: Any
    perception: str
    arrays: Mapping[str, NDArray[Any]]
    chance: tuple[tuple[Mapping[str, Any], int | None], ...]
    remembered: Mapping[str, Any]


def held(core: TaskCore[Any, Any]) -> dict[str, NDArray[Any]]:
    """The arrays that the rules work on, by name: the core's own and those of its ``state``."""
    own = {name: value for name, value in vars(core).items() if name != _EPISODE}
    parts = getattr(own.pop("state", None), "_asdict", dict)()
    own |= {f"state.{name}": value for name, value in parts.items()}
    return {name: value for name, value in own.items() if isinstance(value, np.ndarray)}


def taken(
    core: TaskCore[Any, Any],
    perception: str,
    chance: tuple[tuple[Mapping[str, Any], int | None], ...],
    remembered: Mapping[str, Any],
) -> State:
    """Where rules stand, with what their environment adds to it."""
    arrays = {name: values.copy() for name, values in held(core).items()}
    for values in arrays.values():
        values.flags.writeable = False
    return State(core.config, perception, arrays, chance, remembered)


def check(state: Any, core: TaskCore[Any, Any], perception: str, remembered: tuple[str, ...]) -> None:
    """Refuse what an environment with these rules cannot stand at.

    Raises:
        ValueError: it is no state, or one of another configuration, perception, number of worlds or kind.
    """
    if not isinstance(state, State):
        raise ValueError(f"state is a {type(state).__name__}: give what get_state() returned")
    if state.perception != perception:
        raise ValueError(f"the state is of perception = {state.perception!r}, this environment has {perception!r}")
    if len(state.chance) != core.worlds:
        raise ValueError(f"the state is of {len(state.chance)} worlds, this environment has {core.worlds}")
    if set(state.remembered) != set(remembered):
        raise ValueError("the state is of a batch or of a single environment, this is the other: use its own kind")
    if state.config != core.config:
        raise ValueError("the state is of another configuration: make this environment with the same arguments")
    now = held(core)
    odd = sorted(set(now) ^ set(state.arrays))
    if odd:
        raise ValueError(f"the state's arrays are not those of these rules ({', '.join(odd[:3])}): take a new one")
    for name, values in now.items():
        given = state.arrays[name]
        if given.shape != values.shape or given.dtype != values.dtype:
            raise ValueError(
                f"the state's {name} is {given.dtype} {given.shape}, these rules have {values.dtype} {values.shape}"
            )


def put(state: State, core: TaskCore[Any, Any]) -> None:
    """Let rules stand where a checked state stands; for those who follow them it is another episode."""
    for name, values in held(core).items():
        values[...] = state.arrays[name]
    episode = getattr(core, _EPISODE, None)
    if isinstance(episode, np.ndarray):
        episode += 1


def refuse_closed(closed: bool) -> None:
    """Raise the error that Gymnasium has for calls after ``close()``."""
    if closed:
        raise ClosedEnvironmentError("the environment is closed: make a new one")


def refuse_unready(ready: bool, what: str = "") -> None:
    """Raise the error that Gymnasium has for calls before ``reset()``; ``what`` says who was not reset."""
    if not ready:
        raise ResetNeeded(f"{what or 'the environment'} was not reset yet: call reset() first")
