"""Rules that are kernels: a decision is one call, and what it works on is handed over as one thing."""

from __future__ import annotations

from collections.abc import Callable
from operator import is_
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray

from ..kernels import compiled, desk, planned
from .core import Array, OutcomeT, Page, PlanT, Rows, StepResult, TaskCore

_SHOWN = ("machine", "candidates", "action_mask")
"""What kernels show, in their order."""
_STEPS = ("plan", "nominal", "apply", "observe", "scores")


class KernelCore(TaskCore[PlanT, OutcomeT]):
    """A core whose task has its steps as kernels, and the two below made of the same kernels.

    They take a desk (see ``kernels.desk``) with ``rules()``, the state and the last plan. A subclass of a task that has
    a step of its own is stepped through its methods.

    Attributes:
        state: arrays that the rules work on, a NamedTuple.
        deciding: kernel (desk, rows, actions, machine, candidates, mask, numbers, terminated, truncated) behind
            ``decide``; the arrays are those of a ``Page``, the rows all worlds.
        showing: kernel (desk, rows, machine, candidates, mask, numbers) behind ``show``.
        stepwise: whether decisions take their steps one by one, because not all of them are kernels.
    """

    state: Any
    stepwise = False
    deciding: ClassVar[Callable[..., None]]
    showing: ClassVar[Callable[..., None]]

    def __init_subclass__(cls, **settings: Any) -> None:
        """Let a step of one's own be taken."""
        super().__init_subclass__(**settings)
        own = vars(cls)
        if "deciding" not in own and any(name in own for name in _STEPS):
            cls.decide, cls.show = TaskCore.decide, TaskCore.show  # type: ignore[method-assign]

    def __init__(self, worlds: int):
        """See ``TaskCore``."""
        super().__init__(worlds)
        self._desk: Any = None
        self._laid: tuple[Any, ...] = ()
        self._layout: list[tuple[str, tuple[int, ...], Any]] = []
        self._every: tuple[Rows, ...] = ()

    def __getstate__(self) -> dict[str, Any]:
        """What a copy takes over: it lays a desk of its own, and may be of fewer worlds."""
        anew = {"_desk": None, "_laid": (), "_layout": [], "_every": ()}
        return {**vars(self), **anew, "_planned": self.planned}

    def rules(self) -> tuple[Any, ...]:
        """What the kernels look up, in the order in which they take it."""
        raise NotImplementedError

    def blank(self) -> Page:
        """A page to be written."""
        if not self._layout:
            spaces = [(name, self.observation_space[name]) for name in _SHOWN]
            self._layout = [(name, (self.worlds, *cast(Any, space.shape)), space.dtype) for name, space in spaces]
        observation = {name: np.empty(shape, kind) for name, shape, kind in self._layout}
        columns = len(self.reward_names) + len(self.phase_names) + len(self.score_names)
        numbers = np.empty((self.worlds, columns))
        return Page(observation, numbers, np.empty(self.worlds, np.bool_), np.empty(self.worlds, np.bool_))

    @property
    def planned(self) -> PlanT:
        """See ``TaskCore.planned``."""
        return self._planned if self.stepwise or self._desk is None else planned(self._desk)

    def decide(self, actions: NDArray[np.int64], page: Page | None = None) -> Page:
        """See ``TaskCore.decide``."""
        if self.stepwise:
            return self._by_steps(actions, page)
        page = self.blank() if page is None else page
        laid = self._lay()
        type(self).deciding(laid, *self._every, actions, *page.observation.values(), *page[1:])
        return page

    def _by_steps(self, actions: NDArray[np.int64], page: Page | None) -> Page:
        plan = self.plan(actions)
        page = self.booked(self.apply(plan, self.nominal(plan)), page)
        # Laying the desk for what is shown makes a plan too.
        self._planned = plan
        return page

    def show(self, rows: Rows | None = None, page: Page | None = None) -> Page:
        """See ``TaskCore.show``."""
        if page is None:
            page = self.blank()
            page.numbers[:], page.terminated[:], page.truncated[:] = 0.0, False, False
        laid = self._lay()
        type(self).showing(laid, self._every[0] if rows is None else rows, *page.observation.values(), page.numbers)
        return page

    def observe(self) -> dict[str, NDArray[Any]]:
        """See ``TaskCore.observe``."""
        return KernelCore.show(self).observation

    def scores(self) -> Array:
        """See ``TaskCore.scores``."""
        return KernelCore.show(self).numbers[:, -len(self.score_names) :]

    def _lay(self) -> Any:
        """The desk, laid anew when the rules or the state are others."""
        parts = (self.state, *self.rules())
        if len(self._laid) != len(parts) or not all(map(is_, self._laid, parts)):
            plan = self._planned = self.plan(np.zeros(self.worlds, np.int64))
            self._desk, self._laid, self._every = desk(parts[1:], self.state, plan), parts, (np.arange(self.worlds),)
        return self._desk


@compiled
def book(result: StepResult, numbers: Array, terminated: NDArray[np.bool_], truncated: NDArray[np.bool_]) -> None:
    """Write what a decision brought into the arrays of a page, see ``Page``; the scores' columns stay."""
    terms, phases = result.rewards.shape[1], result.phases_s.shape[1]
    for w in range(len(terminated)):
        for term in range(terms):
            numbers[w, term] = result.rewards[w, term]
        for phase in range(phases):
            numbers[w, terms + phase] = result.phases_s[w, phase]
        terminated[w], truncated[w] = result.terminated[w], result.truncated[w]
