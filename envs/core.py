"""What every task shares: the batched rules, the executor behind a plan, and the view of the world beside them."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

BACKENDS = ("analytic", "pybullet")
PERCEPTIONS = ("perfect", "model", "camera")

COMMON_SCORES = (
    "net_rate",
    "cycle_time_s",
    "throughput_per_min",
    "duration_s",
    "done",
    "missed",
    "damaged",
    "illegal",
)
"""Scorecard keys that every task reports; tasks add their phases as ``phase_<name>_s`` and keys of their own."""


class StepResult(NamedTuple):
    """What a batched decision brought.

    Attributes:
        rewards: weighted reward terms, shape (B, terms), in the order of ``TaskCore.reward_names``.
        phases_s: seconds of this decision spent in each phase, shape (B, phases), as ``TaskCore.phase_names``.
        terminated: the task is over, shape (B,).
        truncated: the time is up, shape (B,).
    """

    rewards: Array
    phases_s: Array
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]


PlanT = TypeVar("PlanT")
OutcomeT = TypeVar("OutcomeT")
PlanIn = TypeVar("PlanIn", contravariant=True)
OutcomeOut = TypeVar("OutcomeOut", covariant=True)
ConfigT = TypeVar("ConfigT", bound=Any)


class TaskCore(ABC, Generic[PlanT, OutcomeT]):
    """The rules of a task over B worlds at once; every array has a leading world axis.

    ``plan`` says what the tool must do, an executor says what happened, ``apply`` books it. All chance is drawn in
    ``reset_rows``; the other methods draw nothing, so one seed is one field with one luck for every policy.
    """

    reward_names: tuple[str, ...]
    phase_names: tuple[str, ...]
    score_names: tuple[str, ...]
    observation_space: spaces.Dict
    action_space: spaces.Discrete

    def __init__(self, worlds: int):
        """Prepare ``worlds`` worlds; each must be reset before its first plan."""
        if worlds < 1:
            raise ValueError(f"num_envs = {worlds}: give at least 1 world")
        self.worlds = worlds

    @abstractmethod
    def reset_rows(self, rows: Rows, generators: Sequence[np.random.Generator]) -> None:
        """Draw a new instance for each of ``rows`` from its own generator and stand at its beginning."""

    @abstractmethod
    def plan(self, actions: NDArray[np.int64]) -> PlanT:
        """Turn actions (B,) into what the machine has to do; an illegal action becomes a costly no-op."""

    @abstractmethod
    def apply(self, plan: PlanT, outcome: OutcomeT) -> StepResult:
        """Book what happened and move every world to its next decision."""

    @abstractmethod
    def observe(self) -> dict[str, NDArray[Any]]:
        """Fresh observation arrays with a leading world axis, as ``observation_space`` names them."""

    @abstractmethod
    def scores(self) -> Array:
        """Scorecard so far, shape (B, len(score_names))."""

    @abstractmethod
    def describe(self, plan: PlanT, result: StepResult, row: int = 0) -> str:
        """One line for people about the last decision of one world."""


class Executor(Protocol[PlanIn, OutcomeOut]):
    """Carries a plan out and says what happened."""

    def reset_rows(self, rows: Rows) -> None:
        """Put the machines of ``rows`` where the rules say they stand."""
        ...

    def execute(self, plan: PlanIn) -> OutcomeOut:
        """Carry out the plan of every world."""
        ...

    def close(self) -> None:
        """Free what is held; idempotent."""
        ...


class View(Protocol[PlanIn]):
    """The rendered world of one environment: what its cameras see and what people are shown."""

    def sense(self) -> None:
        """Hand the rules a camera's reports where a look is due."""
        ...

    def frame(self) -> NDArray[np.uint8]:
        """Picture (h, w, 3) of the present state."""
        ...

    def frames(self, plan: PlanIn, result: StepResult, frames_per_second: float) -> Iterator[NDArray[np.uint8]]:
        """Pictures of the decision that was just carried out, at a simulated rate."""
        ...

    def close(self) -> None:
        """Free what is held; idempotent."""
        ...


def configured(config: ConfigT, scenarios: Mapping[str, Any], scenario: str | None, **changes: Any) -> ConfigT:
    """``config`` with one of ``scenarios`` by its name and with all ``changes`` that are not None.

    Raises:
        ValueError: the scenario is unknown, or a change out of range.
    """
    if scenario is not None:
        changes["scenario"] = scenarios[choice("scenario", scenario, tuple(scenarios))]
    return replace(config, **{name: value for name, value in changes.items() if value is not None})


def choice(name: str, value: object, allowed: Sequence[str]) -> str:
    """Return ``value`` when it is one of ``allowed``, else raise an error that lists them."""
    if value not in allowed:
        raise ValueError(f"{name} = {value!r} is unknown: choose one of {', '.join(map(repr, allowed))}")
    return str(value)
