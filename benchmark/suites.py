"""Which episodes a benchmark runs: conditions, policies and seeds, all stated before the first one starts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

SUITES = ("quick", "full", "tiers")
BACKENDS = ("pybullet", "analytic")

BOUND = "bound"
"""Stands where a policy stands: what no policy can beat on that instance, see ``limits``."""

QUICK_EPISODES = 8
QUICK_TOUR_EPISODES = 2
"""The first environment is compared, the others are shown: together they take two minutes on two cores."""
FULL_EPISODES = 200
FULL_PYBULLET_EPISODES = 24
FULL_FIRST_SEED = 100_000
"""The large suites use the seeds from here on, which nothing else does: rules were tried on seeds from 0 on, cameras
and parameters were fitted from 900,000 on, learned policies chose their weights from 1,000,000 on and learned from
1,000,000,000 on. The quick suite shows seeds from 0 on."""


@dataclass(frozen=True, order=True)
class Condition:
    """What is held equal while policies are compared.

    Attributes:
        env_id: registered id of the environment.
        scenario: one of the environment's scenarios.
        backend: ``"pybullet"`` or ``"analytic"``.
        perception: ``"perfect"``, ``"model"`` or ``"camera"``.
    """

    env_id: str
    scenario: str
    backend: str
    perception: str

    def __str__(self) -> str:
        """One line for titles."""
        name = self.env_id.removeprefix("fieldgym/")
        return f"{name}, {self.scenario}, {self.backend}, {self.perception} perception"


@dataclass(frozen=True)
class Episode:
    """One episode to run: everything that decides its result.

    Attributes:
        condition: what the policy meets.
        policy: its name, or ``BOUND``.
        seed: of the environment.
        timeline: keep what the machine did each second.
    """

    condition: Condition
    policy: str
    seed: int
    timeline: bool = field(default=False, compare=False)

    def __str__(self) -> str:
        """One line for progress and errors."""
        return f"{self.condition}: {self.policy}, seed {self.seed}"


@dataclass(frozen=True)
class Case:
    """A condition with the policies and the seeds to run under it; every policy gets every seed.

    Attributes:
        condition: what the policies meet.
        policies: names, in the order in which tables show them.
        reference: the policy that the others are compared with.
        seeds: of the environment; equal seeds are equal fields with equal luck, so comparisons are paired. The timeline
            of the first one is kept.
        bounded: whether the instances have a bound.
    """

    condition: Condition
    policies: tuple[str, ...]
    reference: str
    seeds: tuple[int, ...]
    bounded: bool = False

    def episodes(self) -> Iterator[Episode]:
        """Seeds outermost, so that an interrupted run holds complete pairs."""
        for seed in self.seeds:
            for policy in self.policies:
                yield Episode(self.condition, policy, seed, timeline=seed == self.seeds[0])
            if self.bounded:
                yield Episode(self.condition, BOUND, seed)


@dataclass(frozen=True)
class Suite:
    """Named cases."""

    name: str
    cases: tuple[Case, ...]

    def episodes(self) -> list[Episode]:
        """All episodes, case by case."""
        return [episode for case in self.cases for episode in case.episodes()]

    def narrowed(
        self,
        env_id: str | None = None,
        policies: Sequence[str] | None = None,
        episodes: int | None = None,
        backend: str | None = None,
    ) -> Suite:
        """The same suite with fewer environments or other policies, another number of seeds, another backend.

        Args:
            env_id: keep the cases of this environment.
            policies: run these instead of all.
            episodes: number of seeds instead of the suite's own, from its first one on.
            backend: keep the cases of this backend; where an environment has none, run its cases on it.

        Raises:
            ValueError: the suite has no such environment, or ``episodes`` < 1.
        """
        cases = [case for case in self.cases if env_id is None or case.condition.env_id == env_id]
        if not cases:
            known = sorted({case.condition.env_id for case in self.cases})
            raise ValueError(f"the suite {self.name} has no case of {env_id}: choose one of {', '.join(known)}")
        if episodes is not None and episodes < 1:
            raise ValueError(f"episodes = {episodes}: run at least 1")
        if policies is not None:
            cases = [replace(case, policies=tuple(policies)) for case in cases]
        if episodes is not None:
            cases = [replace(case, seeds=tuple(range(case.seeds[0], case.seeds[0] + episodes))) for case in cases]
        if backend is not None:
            there = {case.condition.env_id for case in cases if case.condition.backend == backend}
            cases = [
                case if case.condition.backend == backend else _moved(case, backend)
                for case in cases
                if case.condition.backend == backend or case.condition.env_id not in there
            ]
        return replace(self, cases=tuple(cases))


def _moved(case: Case, backend: str) -> Case:
    """``case`` on another backend, seen the way that backend sees."""
    perception = default_perception(case.condition.env_id, backend)
    return replace(case, condition=replace(case.condition, backend=backend, perception=perception))


def default_perception(env_id: str, backend: str) -> str:
    """What a machine on this backend sees with: its camera in PyBullet where the task has one, else the model of it."""
    from ..envs import task

    return "camera" if backend == "pybullet" and "camera" in task(env_id).perceptions else "model"


def suite(name: str) -> Suite:
    """The suite of this name over every registered environment.

    ``quick``: each environment's headline scenario in PyBullet, the first one (the picking paper's protocol) with its
    camera, the others on fewer seeds with the model of theirs, without bounds. ``full``: every headline scenario on
    many seeds with the analytic backend, and on the first of them in PyBullet, both with the camera's model, so that
    the two differ in what carries plans out alone. ``tiers``: every scenario on many seeds with the analytic backend.

    Raises:
        ValueError: there is no such suite.
    """
    from ..agents import policy_names, reference_policy
    from ..bounds import bounded_ids
    from ..envs import env_ids, task

    if name not in SUITES:
        raise ValueError(f"no suite is called {name!r}: choose one of {', '.join(SUITES)}")
    cases = []
    for env_id in env_ids():
        spec = task(env_id)
        headline = (spec.headline,)
        if name == "quick":
            first = env_id == env_ids()[0]
            sees = default_perception(env_id, "pybullet") if first else "model"
            parts = [(headline, "pybullet", sees, 0, QUICK_EPISODES if first else QUICK_TOUR_EPISODES)]
        elif name == "full":
            parts = [
                (headline, "analytic", "model", FULL_FIRST_SEED, FULL_EPISODES),
                (headline, "pybullet", "model", FULL_FIRST_SEED, FULL_PYBULLET_EPISODES),
            ]
        else:
            parts = [(spec.scenarios, "analytic", "model", FULL_FIRST_SEED, FULL_EPISODES)]
        cases += [
            Case(
                Condition(env_id, scenario, backend, perception),
                tuple(policy_names(env_id)),
                reference_policy(env_id),
                tuple(range(first_seed, first_seed + episodes)),
                name != "quick" and env_id in bounded_ids(),
            )
            for scenarios, backend, perception, first_seed, episodes in parts
            for scenario in scenarios
        ]
    return Suite(name, tuple(cases))
