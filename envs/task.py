"""Tasks and policies by name: what is registered, by this package or by anybody else's."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from importlib import import_module, metadata
from typing import Any

import gymnasium as gym

from .references import resolved

TASKS_GROUP, POLICIES_GROUP = "fieldgym.tasks", "fieldgym.policies"
"""Entry-point groups in which installed packages announce a ``TaskSpec`` (or several), and a function that registers
policies."""

_LOG = logging.getLogger("fieldgym")

RANDOM, BEST = "random", "best"
Factory = Callable[[Any, int], Any]
"""Makes a policy from an environment (``Env`` or ``VectorEnv``) and a seed."""


@dataclass(frozen=True)
class TaskSpec:
    """Everything that the package has to know of a task.

    What stands for code may be the object itself or, so that nothing loads before it is used, text of the form
    ``"package.module:name"``.

    Attributes:
        id: what ``gymnasium.make`` calls it, ``namespace/Name-v0``.
        entry_point: the class of the environment, a ``TaskEnv`` with its ``assembly``.
        vector_entry_point: the class of the batched environment, a ``TaskVectorEnv``.
        machine: what works, in words.
        decision: what a policy decides, in words.
        actions: the action space, in words.
        policies: name -> factory (see ``Factory``), in the order of tables. ``random`` is there by itself.
        reference: the policy that the others are compared with.
        best: scenario -> the policy that is recommended for it, under ``""`` that for all others: what ``best`` means.
            Without any the reference is.
        sights: what the cameras of the benchmark's reference see and what looks at it: changes of the configuration by
            dotted name, and on how many fields.
        planners: those of the policies that search some decisions ahead; tables tell the best of them apart from the
            best rule.
        paper: where the machine comes from.
        bound: a function of the rules (one world) and of ``"drawn"``, ``"driven"`` or ``"any"`` reports that knows what
            no policy can beat (see ``bounds``); None where nobody has one.
        learning: settings of ``fieldgym train`` by name, or a YAML file of them inside a package
            (``"package:folder/file.yaml"``).
        learners: algorithms of the task's own by name, beside those that every task has.
        demands: scenarios that demand a net rate, and the perception under which it can be met, for the benchmark.
        ordering: scenarios beside the headline that the leaderboard shows because there the order of work matters.
        lineups: scenario -> those of ``policies`` that the benchmark runs on it, under ``""`` those for all others;
            without any it runs all.
    """

    id: str
    entry_point: str | type
    vector_entry_point: str | type
    machine: str
    decision: str
    actions: str
    policies: Mapping[str, str | Factory]
    reference: str
    paper: str = ""
    bound: str | Callable[[Any, str], Any] | None = None
    learning: str | Mapping[str, Any] | None = None
    learners: Mapping[str, str | Callable[..., Any]] = field(default_factory=dict)
    demands: Mapping[str, str] = field(default_factory=dict)
    ordering: tuple[str, ...] = ()
    lineups: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    best: Mapping[str, str] = field(default_factory=dict)
    planners: tuple[str, ...] = ()
    sights: tuple[tuple[Mapping[str, Any], int], ...] = (({}, 200),)

    def __post_init__(self) -> None:
        """Check what can be checked without loading anything."""
        if "/" not in self.id or "-v" not in self.id:
            raise ValueError(f"TaskSpec.id = {self.id!r}: give 'namespace/Name-v0'")
        if self.reference not in (*self.policies, RANDOM):
            raise ValueError(f"TaskSpec.reference = {self.reference!r}: name one of its policies")
        for scenario, name in self.best.items():
            if name not in (*self.policies, RANDOM):
                raise ValueError(f"TaskSpec.best[{scenario!r}] = {name!r}: name one of its policies")
        for scenario, lineup in self.lineups.items():
            for name in (name for name in lineup if name not in self.policies):
                raise ValueError(f"TaskSpec.lineups[{scenario!r}] has {name!r}: name some of its policies")
        for name in self.planners:
            if name not in self.policies:
                raise ValueError(f"TaskSpec.planners: {name!r} is none of its policies")

    @property
    def name(self) -> str:
        """The id without its namespace."""
        return self.id.split("/")[-1]

    def recommended(self, scenario: str) -> str:
        """The policy that ``best`` means on a scenario."""
        return self.best.get(scenario, self.best.get("", self.reference))

    def lineup(self, scenario: str, known: tuple[str, ...]) -> tuple[str, ...]:
        """Those of the known policies that the benchmark runs on a scenario; what is not the task's own always."""
        chosen = self.lineups.get(scenario, self.lineups.get("", tuple(self.policies)))
        return tuple(name for name in known if name in chosen or name not in self.policies)

    @property
    def assembly(self) -> Any:
        """The parts of its environments (an ``Assembly``)."""
        return resolved(self.entry_point).assembly

    @property
    def scenarios(self) -> tuple[str, ...]:
        """Names of its scenarios."""
        return tuple(self.assembly.scenarios)

    @property
    def headline(self) -> str:
        """The scenario that is meant where none is named."""
        return self.assembly.headline

    @property
    def backends(self) -> tuple[str, ...]:
        """What can carry a decision out."""
        return self.assembly.backends

    @property
    def perceptions(self) -> tuple[str, ...]:
        """What policies can be shown."""
        return self.assembly.perceptions


_TASKS: dict[str, TaskSpec] = {}
_POLICIES: dict[str, dict[str, str | Factory]] = {}
_WAITING: list[metadata.EntryPoint] = []


def register_task(spec: TaskSpec) -> None:
    """Make a task known: to ``gymnasium.make``, the command, the benchmark, training and the reports.

    Registering an equal one again changes nothing.

    Raises:
        ValueError: another task has this id.
    """
    known = _TASKS.get(spec.id)
    if known is not None and known != spec:
        raise ValueError(f"a task is called {spec.id!r} already: choose another id or a new version number")
    _TASKS[spec.id] = spec
    if spec.id not in gym.registry:
        gym.register(spec.id, entry_point=spec.entry_point, vector_entry_point=spec.vector_entry_point)


def register_policy(env_id: str, name: str, factory: str | Factory) -> None:
    """Make a policy known by name for a task.

    Args:
        env_id: id of the task; it may be registered later.
        name: what tables call it.
        factory: makes it from an environment and a seed.

    Raises:
        ValueError: the name is taken, or could be a file's or a module's.
    """
    if not name or any(sign in name for sign in ":/\\ ,") or name.endswith((".npz", ".zip", ".py")):
        raise ValueError(f"policy name {name!r}: give a word without spaces, commas, colons and slashes")
    spec = _TASKS.get(env_id)
    taken = _POLICIES.setdefault(env_id, {})
    if name in (RANDOM, BEST) or (spec is not None and name in spec.policies) or taken.get(name, factory) != factory:
        raise ValueError(f"a policy of {env_id} is called {name!r} already: choose another name")
    taken[name] = factory


def tasks() -> tuple[TaskSpec, ...]:
    """Every task, in the order in which they were registered."""
    load_plugins()
    return tuple(_TASKS.values())


def env_ids() -> tuple[str, ...]:
    """The ids of every task."""
    return tuple(spec.id for spec in tasks())


def task(env_id: str) -> TaskSpec:
    """The task of an id; ``module:id`` imports the module first, and registers the specifications that stand in it.

    Raises:
        ValueError: unknown id; the message lists the choices.
    """
    module, _, bare = env_id.rpartition(":")
    if module and bare not in _TASKS:
        try:
            register_from(module)
        except ImportError as error:
            raise ValueError(f"environment {env_id!r}: cannot import {module} ({error})") from None
    load_plugins()
    if bare in _TASKS:
        return _TASKS[bare]
    from .assembly import meant

    raise ValueError(f"environment {bare!r} is unknown: {meant(bare, tuple(_TASKS))}")


def register_from(module: str) -> None:
    """Import a module and register the specifications that stand in it."""
    for found in vars(import_module(module)).values():
        if isinstance(found, TaskSpec):
            register_task(found)


def factories(env_id: str) -> dict[str, str | Factory]:
    """The policies of a task by name: its own, then those that were registered for it."""
    spec = task(env_id)
    own = {RANDOM: "fieldgym.agents.policies.base:RandomPolicy.make", **spec.policies}
    return {**own, **_POLICIES.get(spec.id, {})}


def load_plugins(search: bool = False) -> None:
    """Register what installed packages announce; one that fails is told in one line and does not stop the others.

    Args:
        search: look for packages; without it only those go on that were being imported at the last try.
    """
    if search:
        for group in (TASKS_GROUP, POLICIES_GROUP):
            _WAITING.extend(metadata.entry_points(group=group))
    waiting, _WAITING[:] = list(_WAITING), []
    for entry in waiting:
        if _being_imported(entry.module):
            _WAITING.append(entry)
            continue
        try:
            found = entry.load()
            if entry.group == POLICIES_GROUP:
                found()
            else:
                for spec in (found,) if isinstance(found, TaskSpec) else found:
                    register_task(spec)
        except Exception as error:
            told = " ".join(f"{type(error).__name__}: {error}".split())
            _LOG.warning("plug-in %r (%s) of %s was left out: %s", entry.name, entry.value, entry.group, told)


def _being_imported(module: str) -> bool:
    """Whether a module, or the package it lies in, is half imported: it imports this package itself."""
    parts = module.split(".")
    for n in range(1, len(parts) + 1):
        spec = getattr(sys.modules.get(".".join(parts[:n])), "__spec__", None)
        if getattr(spec, "_initializing", False):
            return True
    return False
