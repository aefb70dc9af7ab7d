"""What every task shares: the batched rules, the executor behind a plan, and the view of the world beside them."""

from __future__ import annotations

import copy
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping, Sequence
from types import MappingProxyType
from typing import Any, Generic, NamedTuple, Protocol, TypeVar

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from ..kernels.config_kinds import show
from ..rendering.shots import Shot
from .columns import Says, documented
from .field import Field, FieldError

Array = NDArray[np.float64]
Rows = NDArray[np.int64]

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


class Page(NamedTuple):
    """What B worlds show after a decision, a row each.

    Attributes:
        observation: as ``TaskCore.observation_space`` names it, each with a leading world axis.
        numbers: reward terms, phases' seconds and scores, shape (B, terms + phases + scores).
        terminated: the task is over, shape (B,).
        truncated: the time is up, shape (B,).
    """

    observation: dict[str, NDArray[Any]]
    numbers: Array
    terminated: NDArray[np.bool_]
    truncated: NDArray[np.bool_]

    def part(self, where: slice) -> Page:
        """The rows of the worlds ``where``: what is written to one is written to both."""
        observation = {name: values[where] for name, values in self.observation.items()}
        return Page(observation, self.numbers[where], self.terminated[where], self.truncated[where])


PlanT = TypeVar("PlanT")
OutcomeT = TypeVar("OutcomeT")
PlanIn = TypeVar("PlanIn", contravariant=True)
OutcomeOut = TypeVar("OutcomeOut", covariant=True)


class TaskCore(ABC, Generic[PlanT, OutcomeT]):
    """The rules of a task over B worlds at once; every array has a leading world axis.

    ``plan`` says what the tool must do, an executor says what happened, ``apply`` books it. All chance stands in the
    fields that ``load`` puts into worlds; the other methods draw nothing, so one field is one instance with one luck
    for every policy.

    A *batch* is R fields side by side, arrays with a leading world axis, in a form that the task chooses: ``draw``
    makes one from generators, ``stack`` from fields, ``unstack`` takes one apart again.

    Attributes:
        config: the task's numbers.
        reward_names: terms of the reward.
        phase_names: phases of a decision.
        score_names: of the scorecard; begins with ``COMMON_SCORES``.
        machine_features: what policies are shown of the machine.
        candidate_features: what policies are shown of each candidate; the first says whether the slot is taken.
        field_type: what a field of this task is.
        blocks: what declares the names of its ``machine``, ``candidates``, ``rewards``, ``phases`` and ``scores``, see
            ``columns``; none where a task does not say what they mean.
    """

    config: Any
    reward_names: tuple[str, ...]
    phase_names: tuple[str, ...]
    score_names: tuple[str, ...]
    machine_features: tuple[str, ...]
    candidate_features: tuple[str, ...]
    field_type: type[Field]
    blocks: Mapping[str, type[Any]] = MappingProxyType({})
    observation_space: spaces.Dict
    action_space: spaces.Discrete

    def __init__(self, worlds: int):
        """Prepare ``worlds`` worlds; each must be reset before its first plan."""
        if isinstance(worlds, bool) or not isinstance(worlds, int | np.integer) or worlds < 1:
            raise ValueError(f"num_envs = {show(worlds)}: give at least 1 world")
        self.worlds = int(worlds)
        self._planned: Any = None

    def part(self, where: slice) -> TaskCore[PlanT, OutcomeT]:
        """The worlds ``where`` as rules of their own on the same arrays: what is done to one is done to both.

        Arrays of a batch of rules, its own and those of its ``state``, have a leading world axis and are written to,
        never replaced.
        """
        one = copy.copy(self)
        one.worlds = len(range(self.worlds)[where])
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                setattr(one, name, value[where])
        state = getattr(self, "state", None)
        if state is not None:
            one.state = type(state)(*(values[where] for values in state))  # type: ignore[attr-defined]
        return one

    def world(self, row: int) -> TaskCore[PlanT, OutcomeT]:
        """The world ``row`` as rules of one world, see ``part``."""
        return self.part(slice(row, row + 1))

    def meanings(self) -> dict[str, Mapping[str, Says]]:
        """What each number means by its name, block by block, see ``blocks``."""
        return {name: documented(block) for name, block in self.blocks.items()}

    def blank(self) -> Page:
        """A page to be written."""
        shapes = {
            name: ((self.worlds, *(space.shape or ())), space.dtype) for name, space in self.observation_space.items()
        }
        columns = len(self.reward_names) + len(self.phase_names) + len(self.score_names)
        terminated, truncated = np.empty((2, self.worlds), bool)
        observation = {name: np.empty(shape, kind) for name, (shape, kind) in shapes.items()}
        return Page(observation, np.empty((self.worlds, columns)), terminated, truncated)

    def draw_field(self, generator: np.random.Generator) -> Any:
        """The field that a world with this generator gets; a task overrides this, or ``draw`` for many at once."""
        return self.unstack(self.draw([generator]))[0]

    def draw(self, generators: Sequence[np.random.Generator]) -> Any:
        """Draw a batch, each field from its own generator, whatever is drawn beside it."""
        return self.stack([self.draw_field(generator) for generator in generators])

    def stack(self, fields: Sequence[Any]) -> Any:
        """The batch of fields in which nothing is missing; as it stands, a batch is a list of fields."""
        return list(fields)

    def unstack(self, batch: Any) -> list[Any]:
        """The fields of a batch."""
        return list(batch)

    @property
    def window(self) -> Mapping[str, tuple[float, float]]:
        """By place, the range that the rows of a field's main kind must lie in, where the task says one."""
        return {}

    @abstractmethod
    def load(self, rows: Rows, batch: Any) -> None:
        """Put the fields of a batch into the worlds ``rows`` and stand at their beginning."""

    @abstractmethod
    def plan(self, actions: NDArray[np.int64]) -> PlanT:
        """Turn actions (B,) into what the machine has to do; an illegal action becomes a costly no-op."""

    def nominal(self, plan: PlanT) -> OutcomeT:
        """What happens when a plan is carried out exactly; as it stands, the plan is the outcome."""
        return plan  # type: ignore[return-value]

    @abstractmethod
    def apply(self, plan: PlanT, outcome: OutcomeT) -> StepResult:
        """Book what happened and move every world to its next decision."""

    @abstractmethod
    def observe(self) -> dict[str, NDArray[Any]]:
        """Fresh observation arrays with a leading world axis, as ``observation_space`` names them."""

    @abstractmethod
    def scores(self) -> Array:
        """Scorecard so far, shape (B, len(score_names))."""

    @property
    def planned(self) -> PlanT:
        """The plan of the last ``decide``."""
        return self._planned

    def decide(self, actions: NDArray[np.int64], page: Page | None = None) -> Page:
        """A decision (B,) in every world that goes as planned: ``plan``, ``nominal``, ``apply`` and ``show`` in one.

        Args:
            actions: of the worlds.
            page: is written, by default a fresh one.
        """
        self._planned = plan = self.plan(actions)
        return self.booked(self.apply(plan, self.nominal(plan)), page)

    def booked(self, result: StepResult, page: Page | None = None) -> Page:
        """The page of a decision that ``apply`` has booked; ``page`` is written, by default a fresh one."""
        page = self.show(page=page)
        terms, phases = len(self.reward_names), len(self.phase_names)
        page.numbers[:, :terms], page.numbers[:, terms : terms + phases] = result.rewards, result.phases_s
        page.terminated[:], page.truncated[:] = result.terminated, result.truncated
        return page

    def show(self, rows: Rows | None = None, page: Page | None = None) -> Page:
        """Write observation and scorecard of worlds into a page; what else stands in it stays, in a fresh one nothing.

        Args:
            rows: the worlds, by default all.
            page: is written, by default a fresh one.
        """
        observation, scores = self.observe(), self.scores()
        if page is None:
            over, columns = np.zeros((2, self.worlds), bool), len(self.reward_names) + len(self.phase_names)
            page = Page(observation, np.zeros((self.worlds, columns + scores.shape[1])), *over)
        where = slice(None) if rows is None else rows
        for name, values in observation.items():
            page.observation[name][where] = values[where]
        page.numbers[where, page.numbers.shape[1] - scores.shape[1] :] = scores[where]
        return page

    def result_of(self, page: Page) -> StepResult:
        """What the decision on a page brought."""
        terms, phases = len(self.reward_names), len(self.phase_names)
        rewards, phases_s = page.numbers[:, :terms], page.numbers[:, terms : terms + phases]
        return StepResult(rewards, phases_s, page.terminated, page.truncated)

    def describe(self, plan: PlanT, result: StepResult, row: int = 0) -> str:
        """One line for people about the last decision of one world."""
        return f"{float(result.phases_s[row].sum()):.2f} s"

    def complete(self, field: Any, generator: np.random.Generator) -> Any:
        """A field with nothing missing, or an error that says what does not fit this core.

        Tasks add what only they know: columns that are filled by ``"task"``, and what lies outside the machine's
        window or does not fit into the state.

        Args:
            field: perhaps from a file, with values that were not given.
            generator: draws those that are drawn.

        Raises:
            FieldError: a value is missing, out of range, outside the window, or there are too many.
        """
        if not isinstance(field, self.field_type):
            raise FieldError(f"field is a {type(field).__name__}: this task takes a {self.field_type.__name__}")
        field.check()
        return field.filled(generator)

    def reset_rows(self, rows: Rows, generators: Sequence[np.random.Generator]) -> None:
        """Draw a new instance for each of ``rows`` from its own generator and stand at its beginning."""
        if len(rows):
            self.load(rows, self.draw(generators))

    def misplaced(self) -> str:
        """An array that points outside what it points into, by its name; empty when there is none.

        Kernels do not look: who puts arrays from a file in place asks before anything runs.
        """
        return ""


def outside(arrays: Any, **limits: int) -> str:
    """The first of the named arrays with a whole number that is below 0 or not below its limit; empty without one."""
    for name, limit in limits.items():
        values = getattr(arrays, name)
        if not ((values >= 0) & (values < limit)).all():
            return name
    return ""


def observation_space(core: TaskCore[Any, Any], slots: int, actions: int, limit: float = 10.0) -> spaces.Dict:
    """The space of a task's observations: its machine's features, K slots of candidates' features, and the mask."""
    flat = slots * len(core.candidate_features)
    return spaces.Dict(
        {
            "machine": spaces.Box(-limit, limit, (len(core.machine_features),), np.float32),
            "candidates": spaces.Box(-limit, limit, (flat,), np.float32),
            "action_mask": spaces.Box(0, 1, (actions,), np.int8),
        }
    )


class Executor(Protocol[PlanIn, OutcomeOut]):
    """Carries a plan out and says what happened."""

    fault: str
    """Why the last decision's motion failed, empty where it did not."""

    def reset_rows(self, rows: Rows) -> None:
        """Put the machines of ``rows`` where the rules say they stand."""
        ...

    def execute(self, plan: PlanIn) -> OutcomeOut:
        """Carry out the plan of every world."""
        ...

    def close(self) -> None:
        """Free what is held; idempotent."""
        ...


class NominalExecutor(Generic[PlanT, OutcomeT]):
    """The analytic backend: what is planned happens, exactly and at once."""

    fault = ""

    def __init__(self, core: TaskCore[PlanT, OutcomeT]):
        """Take the rules whose plans are carried out."""
        self._core = core

    def reset_rows(self, rows: Rows) -> None:
        """Nothing to prepare."""

    def execute(self, plan: PlanT) -> OutcomeT:
        """What the plan says."""
        return self._core.nominal(plan)

    def close(self) -> None:
        """Nothing to free."""


class Sight(NamedTuple):
    """A picture of what can be chosen, as an observation.

    Attributes:
        rgb: (h, w, 3).
        depth_m: (h, w), along the view.
        place_px: (m, 2), column and row at which mark m + 1 stands; not finite where there is none.
    """

    rgb: NDArray[np.uint8]
    depth_m: NDArray[np.float32]
    place_px: Array


class View(Protocol[PlanIn]):
    """The rendered world of one environment: what its cameras see and what people are shown.

    Attributes:
        depth_range_m: depths that a ``sight`` lies between.
        shot: from where people look, and the size of their pictures; set once, before the first.
    """

    depth_range_m: tuple[float, float] = (0.0, 2.0)
    shot: Shot = Shot()

    def sense(self) -> None:
        """Hand the rules a camera's reports where a look is due."""
        ...

    def attend(self, action: int) -> None:
        """Look at what an action is about to work on, where the machine has a camera for it."""

    def beside(self, core: Any) -> View[PlanIn]:
        """The view of another world, which shares this one's meshes."""
        ...

    def sight_width(self, rows: int) -> int:
        """Columns of a ``sight`` of that many rows."""
        ...

    def sight(self, rows: int) -> Sight:
        """What can be chosen now, seen from above, as it is at this moment; it follows from the rules' state alone."""
        ...

    def slot_marks(self) -> NDArray[np.int64]:
        """(K, j): the marks in a ``sight`` that belong to each slot; as it stands, slot k has mark k + 1."""
        core: Any = self._core  # type: ignore[attr-defined]
        slots = core.observation_space["candidates"].shape[0] // len(core.candidate_features)
        return np.arange(1, slots + 1)[:, None]

    def frame(self) -> NDArray[np.uint8]:
        """Picture (h, w, 3) of the present state."""
        ...

    def frames(self, plan: PlanIn, result: StepResult, frames_per_second: float) -> Iterator[NDArray[np.uint8]]:
        """Pictures of the decision that was just carried out, at a simulated rate."""
        ...

    def close(self) -> None:
        """Free what is held; idempotent."""
        ...
