"""How an environment is put together: the parts that a task has, and what may be asked of them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from os import PathLike
from pathlib import Path
from typing import Any, Generic, TypeVar

from ..kernels.config import Config, ConfigError, from_mapping, override
from ..kernels.config_kinds import show
from .core import Executor, TaskCore, View

BACKENDS = ("pybullet", "analytic")
PERCEPTIONS = ("perfect", "model", "camera")
PRESET = "preset"
"""Among overrides: the name of a preset, or several."""
MOST_BASES = 16
"""Scenario files that may build on each other."""
CUSTOM = "custom"
"""Name of a scenario that came as numbers, not by name."""

USUAL_DECISION_S = 1.0
"""Of a task of which nobody has measured it [assumed]."""

ConfigT = TypeVar("ConfigT", bound=Config)


@dataclass(frozen=True)
class Assembly(Generic[ConfigT]):
    """The parts of a task's environments.

    Attributes:
        config: type of the configuration; made without arguments it is the headline scenario's. It has a field
            ``scenario``.
        scenarios: named values of that field.
        core: makes the rules of a configuration, a perception model (None when reports come from a camera) and a number
            of worlds.
        perfect: the perception model without errors; None where a task has no camera at all.
        measured: the perception model fitted to rendered pictures; None where there is none.
        machine: makes the executor that drives one world's machine in PyBullet; None where there is none.
        view: makes the rendered world of a single environment.
        cameras: from where it shows itself to people, the first by default; empty where its pictures are as they are.
        decision_s: seconds that a decision takes on average, by scenario, where somebody has measured them.
        belief: what the machine believes of one world's field beside what is true, a ``Belief``, for people to see.
        within_motors: lowers a configuration's limits of speed and acceleration to what its machine's motors can give,
            or refuses motors that cannot hold it; None where no motor is modelled. See ``motors``.
        rates: how scorecards of a configuration are read in a grower's units, a ``rates.Rates``; None where finished
            targets an hour say it all.
        presets: named sets of overrides that belong together, for ``overrides={"preset": name}``.
        settings: keyword arguments of ``gym.make`` that are short for a part of the configuration, by name: a dotted
            name of the configuration, or a function of the configuration and the value.
        fixed: what an environment's configuration always has, by dotted name.
    """

    config: type[ConfigT]
    scenarios: Mapping[str, Any]
    core: Callable[[ConfigT, Any, int], TaskCore[Any, Any]]
    perfect: Callable[[ConfigT], Any] | None = None
    measured: Callable[[ConfigT], Any] | None = None
    machine: Callable[[Any], Executor[Any, Any]] | None = None
    view: Callable[[Any], View[Any]] | None = None
    cameras: tuple[str, ...] = ()
    decision_s: Mapping[str, float] = field(default_factory=dict)
    belief: Callable[[Any], Any] | None = None
    within_motors: Callable[[ConfigT], ConfigT] | None = None
    rates: Callable[[ConfigT], Any] | None = None
    presets: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    settings: Mapping[str, str | Callable[[ConfigT, Any], ConfigT]] = field(default_factory=dict)
    fixed: Mapping[str, Any] = field(default_factory=dict)

    @property
    def headline(self) -> str:
        """The scenario that is meant where none is named."""
        default = self.config().scenario  # type: ignore[attr-defined]
        return self.name_of(default)

    @property
    def backends(self) -> tuple[str, ...]:
        """What can carry a plan out, the default first."""
        return BACKENDS if self.machine is not None else BACKENDS[1:]

    @property
    def perceptions(self) -> tuple[str, ...]:
        """What policies can be shown."""
        there = (True, self.measured is not None, self.view is not None and self.measured is not None)
        return tuple(name for name, is_there in zip(PERCEPTIONS, there, strict=True) if is_there)

    def name_of(self, scenario: Any) -> str:
        """The name of a scenario, ``CUSTOM`` for one that has none."""
        return next((name for name, known in self.scenarios.items() if known == scenario), CUSTOM)

    def mean_decision_s(self, scenario: str) -> float:
        """Seconds that a decision takes on average, in the headline scenario where nobody knows of this one."""
        return self.decision_s.get(scenario, self.decision_s.get(self.headline, USUAL_DECISION_S))

    def default_perception(self, backend: str) -> str:
        """What a machine on a backend sees with: its camera in PyBullet where it has one, else the model of it."""
        best = "camera" if backend == "pybullet" else "model"
        return best if best in self.perceptions else self.perceptions[-1]

    def batched(self, backend: str, perception: str | None) -> str:
        """Perception of a batch, once it is clear that what was asked for can be batched.

        Raises:
            ValueError: an argument is unknown, or needs a machine a world.
        """
        if choice("backend", backend, BACKENDS) != "analytic":
            raise ValueError("backend = 'pybullet' is not batched: pass vectorization_mode=\"async\" to gym.make_vec")
        return choice("perception", _given(perception, self.default_perception(backend)), self.perceptions)

    def perception_model(self, perception: str, config: ConfigT) -> Any:
        """Statistics behind a perception level; None when reports come from a camera."""
        make = {"perfect": self.perfect, "model": self.measured}.get(perception)
        return make(config) if make is not None else None

    def configured(
        self,
        scenario: str | PathLike[str] | None = None,
        config: ConfigT | Mapping[str, Any] | None = None,
        overrides: Mapping[str, Any] | None = None,
        settings: Mapping[str, Any] | None = None,
    ) -> ConfigT:
        """The configuration that is asked for, with limits that its machine's motors can give.

        Args:
            scenario: a name, or a YAML file with a scenario's numbers; None for the configuration's own.
            config: None for the headline scenario's; a mapping of its fields by name is what JSON makes of one.
            overrides: single numbers by dotted name; and ``preset``, a name or several of ``Assembly.presets``, whose
                numbers come before the single ones.
            settings: see ``Assembly.settings``; None stands for what was not given.

        Raises:
            ValueError: something is unknown, of another task or out of range; the message is one line.
        """
        if config is None:
            config = self.config()
        elif isinstance(config, Mapping):
            config = from_mapping(self.config, config)
        elif not isinstance(config, self.config):
            raise ValueError(f"config is a {type(config).__name__}: this environment takes a {self.config.__name__}")
        if scenario is not None:
            config = override(config, {"scenario": self.scenario(scenario)})
        for name, value in (settings or {}).items():
            if name not in self.settings:
                told = meant(name, (*KEYWORDS, *self.settings))
                raise TypeError(f"got an unexpected keyword argument {name!r}: {told}")
            if value is not None:
                setting = self.settings[name]
                config = override(config, {setting: value}) if isinstance(setting, str) else setting(config, value)
        if overrides is not None and not isinstance(overrides, Mapping):
            raise ValueError(f"overrides = {show(overrides)}: give numbers by their dotted names")
        asked = override(config, {**self._expanded(overrides or {}), **self.fixed})
        return asked if self.within_motors is None else self.within_motors(asked)

    def _expanded(self, overrides: Mapping[str, Any]) -> dict[str, Any]:
        """Overrides with the numbers of their presets, if any."""
        numbers = {name: value for name, value in overrides.items() if name != PRESET}
        asked, found = overrides.get(PRESET, ()), {}
        for name in asked if isinstance(asked, list | tuple) else (asked,):
            if not isinstance(name, str) or name not in self.presets:
                there = meant(name, tuple(self.presets)) if self.presets else "this task has none"
                raise ValueError(f"preset = {show(name)} is unknown: {there}")
            found |= self.presets[name]
        return {**found, **numbers}

    def scenario(self, scenario: str | PathLike[str], based: int = 0) -> Any:
        """A scenario by its name or from a YAML file.

        Args:
            scenario: name or file.
            based: files that build on it.

        Raises:
            ValueError: there is no such scenario, or the file is no scenario of this task.
        """
        text = str(scenario) if isinstance(scenario, str | PathLike) else ""
        if text in self.scenarios:
            return self.scenarios[text]
        if not text.endswith((".yaml", ".yml")):
            what = show(text or scenario)
            raise ValueError(
                f"scenario = {what} is unknown: {meant(text, tuple(self.scenarios))}, or name a .yaml file"
            )
        from ..kernels.config_files import load_yaml

        if based > MOST_BASES:
            told = f"more than {MOST_BASES} files that build on each other by 'base': does one build on itself?"
            raise ValueError(f"scenario = {show(text)}: {told}")
        data, base = load_yaml(Path(text)), None
        if "base" in data:
            try:
                base = self.scenario(data["base"], based + 1)
            except ConfigError:
                raise
            except ValueError as error:
                raise ConfigError("base", f": {error}", place=data.place("base")) from None
            del data["base"]
        return from_mapping(type(next(iter(self.scenarios.values()))), data, base)


KEYWORDS = (
    "scenario", "backend", "engine", "perception", "config", "overrides", "render_mode", "observation", "pixel_rows",
    "depth", "camera", "width", "height",
)  # fmt: skip


def meant(name: object, known: Sequence[str]) -> str:
    """What to choose instead of an unknown name, the nearest first."""
    near = get_close_matches(name[:100], known, n=1, cutoff=0.5) if isinstance(name, str) else []
    hint = f"did you mean {near[0]!r}? " if near else ""
    return f"{hint}choose one of {', '.join(map(repr, known))}"


def backend_of(backend: str | None, engine: str | None) -> str | None:
    """The one that was given of two names of the same keyword.

    Raises:
        ValueError: both were given, and differ.
    """
    if backend is None or engine is None:
        return _given(backend, engine)
    if not (isinstance(backend, str) and isinstance(engine, str) and backend == engine):
        told = "two names of one keyword, give one of them"
        raise ValueError(f"backend = {show(backend)} and engine = {show(engine)}: {told}")
    return backend


def choice(name: str, value: object, allowed: Sequence[str]) -> str:
    """Return ``value`` when it is one of ``allowed``, else raise an error that lists them."""
    # Arrays would be compared one by one.
    if not isinstance(value, str) or value not in allowed:
        raise ValueError(f"{name} = {show(value)} is unknown: {meant(value, allowed)}")
    return str(value)


def _given(value: Any, otherwise: Any) -> Any:
    """A keyword's value, or what is meant where it was left out."""
    return otherwise if value is None else value
