"""Which episodes a benchmark runs: conditions, policies and seeds, all stated before the first one starts."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

SUITES = ("quick", "full")
BACKENDS = ("pybullet", "analytic")

QUICK_EPISODES = 8
QUICK_TOUR_EPISODES = 3
"""The first environment is compared, the others are shown: together they take two minutes on two cores."""
FULL_EPISODES = 200
FULL_PYBULLET_EPISODES = 16


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
    """One episode to run: everything that decides its result."""

    condition: Condition
    policy: str
    seed: int

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
        seeds: of the environment; equal seeds are equal fields with equal luck, so comparisons are paired.
    """

    condition: Condition
    policies: tuple[str, ...]
    reference: str
    seeds: tuple[int, ...]

    def episodes(self) -> Iterator[Episode]:
        """Seeds outermost, so that an interrupted run holds complete pairs."""
        for seed in self.seeds:
            for policy in self.policies:
                yield Episode(self.condition, policy, seed)


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
            episodes: seeds 0 ... episodes - 1 instead of the suite's own.
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
            cases = [replace(case, seeds=tuple(range(episodes))) for case in cases]
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
    from ..envs import describe

    return "camera" if backend == "pybullet" and "camera" in describe(env_id).perceptions else "model"


def suite(name: str) -> Suite:
    """The suite of this name over every registered environment.

    ``quick``: each environment's headline scenario in PyBullet, the first one (the picking paper's protocol) with its
    camera, the others on fewer seeds with the model of theirs. ``full``: every scenario on many seeds with the analytic
    backend, and the quick suite's conditions on more seeds.

    Raises:
        ValueError: there is no such suite.
    """
    from ..agents import policy_names, reference_policy
    from ..envs import ENV_IDS, describe

    if name not in SUITES:
        raise ValueError(f"no suite is called {name!r}: choose one of {', '.join(SUITES)}")
    cases = []
    for env_id in ENV_IDS:
        task, policies, reference = describe(env_id), tuple(policy_names(env_id)), reference_policy(env_id)

        def case(
            scenario: str,
            backend: str,
            episodes: int,
            env_id: str = env_id,
            policies: tuple[str, ...] = policies,
            reference: str = reference,
            perception: str | None = None,
        ) -> Case:
            condition = Condition(env_id, scenario, backend, perception or default_perception(env_id, backend))
            return Case(condition, policies, reference, tuple(range(episodes)))

        first = env_id == ENV_IDS[0]
        if name == "full":
            cases += [case(scenario, "analytic", FULL_EPISODES) for scenario in task.scenarios]
            episodes = FULL_PYBULLET_EPISODES
        else:
            episodes = QUICK_EPISODES if first else QUICK_TOUR_EPISODES
        cases.append(case(task.headline_scenario, "pybullet", episodes, perception=None if first else "model"))
    return Suite(name, tuple(cases))
