"""Which episodes a benchmark runs: conditions, policies and seeds, all stated before the first one starts."""

from __future__ import annotations

import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from ..agents.foreign import in_words
from ..agents.sources import REGISTERED, PolicySource, policy_names, policy_source, task_code
from ..envs.task import TaskSpec, task, tasks
from .fields import FieldFile
from .parts import PARTS, few

SUITES = tuple(PARTS)

BOUND = "bound"
"""Stands where a policy stands: what no policy can beat on that instance, see ``limits``."""


@dataclass(frozen=True, order=True)
class Condition:
    """What is held equal while policies are compared.

    Attributes:
        env_id: registered id of the environment, ``module:id`` where a module has to be imported for it.
        scenario: one of the environment's scenarios, or the name of the file that its numbers came from.
        backend: ``"pybullet"`` or ``"analytic"``.
        perception: ``"perfect"``, ``"model"`` or ``"camera"``.
        changes: numbers of the configuration that are not the scenario's, a JSON object by dotted name, keys in order;
            a scenario from a file stands in it whole. Empty without any.
        fields: folder of the field files that are played; empty where fields are drawn from seeds.
    """

    env_id: str
    scenario: str
    backend: str
    perception: str
    changes: str = ""
    fields: str = ""

    def __str__(self) -> str:
        """One line for titles."""
        name = self.env_id.rpartition(":")[2].removeprefix("fieldgym/")
        return ", ".join((name, self.scenario, self.backend, f"{self.perception} perception", *self.specials()))

    def title(self) -> str:
        """One line for a single policy's episodes: the whole id, without what it sees with."""
        return ", ".join((self.env_id.rpartition(":")[2], self.scenario, self.backend, *self.specials()))

    def specials(self) -> tuple[str, ...]:
        """What is special about it, in words: changed numbers and a folder of fields."""
        numbers = [f"{key} = {value}" for key, value in self.numbers.items() if key != SCENARIO]
        return (*numbers, *([f"fields of {self.fields}"] if self.fields else []))

    @property
    def instances(self) -> str:
        """What episodes differ in, in a word: a field's file or a seed."""
        return "field" if self.fields else "seed"

    @property
    def numbers(self) -> dict[str, Any]:
        """The changed numbers by dotted name."""
        return json.loads(self.changes) if self.changes else {}

    @property
    def settings(self) -> dict[str, Any]:
        """Keyword arguments of its environments, but for the backend."""
        numbers = _joined(self.numbers)
        named = {} if SCENARIO in numbers else {"scenario": self.scenario}
        return {**named, "perception": self.perception, **({"overrides": numbers} if numbers else {})}


SCENARIO = "scenario"
"""Dotted name of a configuration's scenario."""


def _joined(numbers: dict[str, Any]) -> dict[str, Any]:
    """The same numbers with those of the scenario inside a scenario from a file, where there is one."""
    if SCENARIO not in numbers:
        return numbers
    rest = {}
    for name, value in numbers.items():
        if name.startswith(f"{SCENARIO}."):
            *path, last = name.split(".")
            inner = numbers
            for part in path:
                inner = inner[part]
            inner[last] = value
        else:
            rest[name] = value
    return rest


def changes_of(numbers: Mapping[str, Any]) -> str:
    """``Condition.changes`` of numbers by dotted name."""
    return json.dumps(numbers, sort_keys=True) if numbers else ""


@dataclass(frozen=True)
class Episode:
    """One episode to run: everything that decides its result.

    Attributes:
        condition: what the policy meets.
        policy: its name, or ``BOUND``.
        seed: of the environment.
        timeline: keep what the machine did each second.
        field: the file that is played; ``seed`` draws what it leaves open. None: all is drawn.
        source: where the policy comes from; None for one of the package's own.
        task_code: digest of the task's code; empty for one of the package's own.
    """

    condition: Condition
    policy: str
    seed: int
    timeline: bool = field(default=False, compare=False)
    field: FieldFile | None = None
    source: PolicySource | None = None
    task_code: str = ""

    def __str__(self) -> str:
        """One line for progress and errors."""
        return f"{self.condition}: {self.policy}, {f'seed {self.seed}' if self.field is None else self.field.name}"


@dataclass(frozen=True)
class Case:
    """A condition with the policies and the seeds to run under it; every policy gets every seed.

    Attributes:
        condition: what the policies meet.
        policies: names, in the order in which tables show them.
        reference: the policy that the others are compared with.
        seeds: of the environment; equal seeds are equal fields with equal luck, so comparisons are paired. The timeline
            of the first one is kept.
        bounds: so many of the instances, the first ones, have their bound beside them; gaps are told of these.
        fields: files that are played instead, every one with the first seed.
        sources: where policies come from that are not the package's own.
        task_code: see ``Episode``.
    """

    condition: Condition
    policies: tuple[str, ...]
    reference: str
    seeds: tuple[int, ...]
    bounds: int = 0
    fields: tuple[FieldFile, ...] = ()
    sources: tuple[PolicySource, ...] = ()
    task_code: str = ""

    def episodes(self) -> Iterator[Episode]:
        """Seeds outermost, so that an interrupted run holds complete pairs."""
        source = {each.name: each for each in self.sources}
        instances = [(self.seeds[0], file) for file in self.fields] or [(seed, None) for seed in self.seeds]
        for i, (seed, file) in enumerate(instances):
            for policy in self.policies:
                yield Episode(self.condition, policy, seed, i == 0, file, source.get(policy), self.task_code)
            if i < self.bounds:
                yield Episode(self.condition, BOUND, seed, field=file, task_code=self.task_code)


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
        perception: str | None = None,
    ) -> Suite:
        """The same suite with fewer environments or other policies, another number of seeds, another backend.

        Args:
            env_id: keep the cases of this environment.
            policies: run these instead of all.
            episodes: number of seeds instead of the suite's own, from its first one on.
            backend: keep the cases of this backend; where an environment has none, run its cases on it.
            perception: keep the cases of this perception.

        Raises:
            ValueError: the suite has no such environment or perception, or ``episodes`` < 1.
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
        if perception is not None:
            seen = sorted({case.condition.perception for case in cases})
            cases = [case for case in cases if case.condition.perception == perception]
            if not cases:
                raise ValueError(
                    f"no case of the suite {self.name} has {perception} perception: {', '.join(seen)} have"
                )
        return replace(self, cases=tuple(cases))

    def under(self, scenario: str | None = None, numbers: Mapping[str, Any] | None = None) -> Suite:
        """The same suite under another scenario, or with other numbers; cases that become the same are run once.

        Args:
            scenario: its name, for titles; None leaves each case its own.
            numbers: changes of the configuration by dotted name, a scenario from a file among them.
        """
        cases: dict[Condition, Case] = {}
        for case in self.cases:
            where = replace(case.condition, changes=changes_of({**case.condition.numbers, **(numbers or {})}))
            where = where if scenario is None else replace(where, scenario=scenario)
            cases.setdefault(where, replace(case, condition=where, policies=_lined_up(case, scenario)))
        return replace(self, cases=tuple(cases.values()))

    def on_fields(self, folder: str, files: Sequence[FieldFile]) -> Suite:
        """The same suite on field files instead of seeds."""
        cases = [
            replace(
                case,
                condition=replace(case.condition, fields=folder),
                fields=tuple(files),
                bounds=len(files) if case.bounds else 0,
            )
            for case in self.cases
        ]
        return replace(self, cases=tuple(cases))

    def traced(self, trust: bool = False) -> Suite:
        """The same suite with where its policies and tasks come from, as far as they are not the package's own.

        Args:
            trust: allow saved models of Stable-Baselines3, which may run code.

        Raises:
            PolicySourceError: there is no such policy, or its file or module cannot be used.
        """
        cases = []
        for case in self.cases:
            env_id = case.condition.env_id
            sources = [policy_source(env_id, name, trust) for name in case.policies]
            for source in sources:
                source.factory()
            foreign = tuple(source for source in sources if source.kind != REGISTERED or source.sha256)
            cases.append(replace(case, sources=foreign, task_code=task_code(env_id)))
        return replace(self, cases=tuple(cases))


def _lined_up(case: Case, scenario: str | None) -> tuple[str, ...]:
    """The policies of a case under another scenario: its own where some were chosen, else those that are for it."""
    spec, known, own = task(case.condition.env_id), policy_names(case.condition.env_id), case.condition.scenario
    if scenario is not None and case.policies == spec.lineup(own, known):
        return spec.lineup(scenario, known)
    if scenario is not None and case.policies == spec.lineup(own, few(spec, own, known)):
        return spec.lineup(scenario, few(spec, scenario, known))
    return case.policies


def _moved(case: Case, backend: str) -> Case:
    """``case`` on another backend, seen the way that backend sees."""
    perception = task(case.condition.env_id).assembly.default_perception(backend)
    return replace(case, condition=replace(case.condition, backend=backend, perception=perception))


def _there(spec: TaskSpec, backend: str, perception: str) -> tuple[str, str]:
    """Backend and perception that a task has, the wanted ones where there are."""
    backend = backend if backend in spec.backends else spec.backends[0]
    return backend, perception if perception in spec.perceptions else spec.assembly.default_perception(backend)


def usable_tasks() -> list[TaskSpec]:
    """Every registered task that can be loaded; others are named in a warning of one line."""
    found = []
    for spec in tasks():
        try:
            spec.assembly  # noqa: B018  loads its code
        except Exception as error:
            warnings.warn(f"task {spec.id!r} was left out: {in_words(error)}", stacklevel=2)
        else:
            found.append(spec)
    return found


def suite(name: str, ids: Sequence[str] | None = None) -> Suite:
    """The suite of this name over every registered environment.

    ``quick``: each environment's headline scenario in PyBullet, the first one (the picking paper's protocol) with its
    camera, the others on fewer seeds with the model of theirs, without bounds. ``full``: every headline scenario on
    many seeds with the analytic backend, and on the first of them in PyBullet (the reference, what is recommended and
    what has learned), both with the camera's model, so that the two differ in what carries plans out alone; and the
    reference on seeds of these with the analytic backend and its rendered cameras, which differ from the first in what
    sees alone, with all of ``TaskSpec.sights`` and perfect perception beside them where there are several; and the
    scenarios in which the order of work matters; and the rules on the scenarios that demand a net rate, without bounds;
    all of it on the seeds that are held out for it. Bounds stand beside the first of the seeds. ``tiers``: every
    scenario on many shown seeds with the analytic backend. See ``kernels.seeds``. A task without a simulated machine,
    or without a camera, is run with what it has.

    Args:
        name: one of ``SUITES``.
        ids: environments, ``module:id`` among them; None for all.

    Raises:
        ValueError: there is no such suite.
    """
    if name not in SUITES:
        raise ValueError(f"no suite is called {name!r}: choose one of {', '.join(SUITES)}")
    cases: dict[Condition, Case] = {}
    for env_id in [spec.id for spec in usable_tasks()] if ids is None else ids:
        spec = task(env_id)
        for part in PARTS[name](spec, policy_names(env_id)):
            backend, perception = _there(spec, part.backend, part.perception)
            known = spec.bound is not None and perception == "model" and part.scenario not in spec.demands
            case = Case(
                Condition(env_id, part.scenario, backend, perception, changes_of(part.changes)),
                spec.lineup(part.scenario, part.policies),
                spec.reference,
                tuple(part.block.take(part.episodes)),
                part.bounds if known else 0,
            )
            cases.setdefault(case.condition, case)
    return Suite(name, tuple(cases.values()))
