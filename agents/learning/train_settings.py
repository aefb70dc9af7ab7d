"""Settings of a training run: a task's own (see ``TaskSpec.learning``), then a file's, then what is given."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

from ...envs.assembly import meant
from ...envs.task import TaskSpec, task
from ...kernels.config import Config, ConfigError, flag, from_mapping, num, text, to_mapping
from ...kernels.config_files import load_yaml, parse_yaml

OBSERVED = ("features", "pixels")
COMMON_ALGORITHMS = ("maskable-ppo", "ppo")
"""Those that every task has; others come from ``TaskSpec.learners``."""


@dataclass(frozen=True)
class TrainSettings(Config):
    """Everything that decides what a training run learns, its seed apart."""

    algo: str = text("maskable-ppo")
    """"maskable-ppo", "ppo" with the mask inside the network, or one of the task's own: "policy-iteration" is a planner
    with a learned value."""
    scenario: str | None = text(None)
    """Of the environment; None for its headline scenario."""
    steps: int = num(1_000_000, 1, 10**12, "")
    """Decisions to learn from."""
    minutes: float | None = num(None, 1e-9, 1e9, "min")
    """Wall time after which a run ends with fewer decisions, its lesson counted; its steps fall with the time."""
    teacher: str | None = text(None)
    """Scripted policy whose choices are learnt first; None begins with nothing."""
    teacher_decisions: int = num(200_000, 1, 10**12, "")
    """How many of them."""
    teacher_epochs: int = num(4, 1, 10_000, "")
    """Passes over them."""
    num_envs: int = num(256, 1, 100_000, "")
    """Worlds in the batch."""
    n_steps: int = num(64, 1, 1_000_000, "")
    """Decisions a world between two updates."""
    batch_size: int = num(4096, 1, 10**9, "")
    """Of an update's minibatches."""
    n_epochs: int = num(4, 1, 10_000, "")
    """Passes over what was collected."""
    learning_rate: float = num(1e-3, 1e-12, 10.0, "")
    """At the beginning; falls linearly to final_learning_rate."""
    final_learning_rate: float = num(1e-4, 0.0, 10.0, "")
    """At the end."""
    gamma: float = num(0.99, 0.0, 1.0, "")
    """Discount a decision."""
    gae_lambda: float = num(0.95, 0.0, 1.0, "")
    """Of the advantage estimate."""
    clip_range: float = num(0.2, 1e-9, 100.0, "")
    """Of the policy's ratio."""
    ent_coef: float = num(0.005, 0.0, 1e6, "")
    """Weight of the entropy."""
    vf_coef: float = num(0.5, 0.0, 1e6, "")
    """Weight of the value loss."""
    max_grad_norm: float = num(0.5, 1e-12, 1e12, "")
    """Of an update."""
    target_kl: float | None = num(None, 1e-12, 1e6, "")
    """Ends an update's passes early; None never."""
    reward_scale: float = num(1.0, 1e-12, 1e12, "")
    """What learners see is the reward times this."""
    time_limit_ends: bool = flag(True)
    """Nothing is worth anything after the time limit, see ``make_vec_env``."""
    hidden: int = num(48, 1, 100_000, "")
    """Width of the actor."""
    critic_hidden: int = num(48, 1, 100_000, "")
    """Width of the critic."""
    relations: int = num(0, 0, 10_000, "")
    """Numbers that candidates hear of each other, see ``set_policy.SetActor``."""
    episodes: int = num(4096, 1, 10**9, "")
    """Of a round of "policy-iteration", as the next two."""
    depth: int = num(4, 1, 1000, "")
    """Decisions that the planner looks ahead."""
    width: int = num(8, 1, 100_000, "")
    """Sequences that it keeps."""
    observation: str = text("features")
    """"features", or "pixels": a small convolutional network sees the candidates in pictures."""
    pixel_rows: int = num(48, 16, 1080, "")
    """Height of those pictures."""
    channels: int = num(32, 2, 256, "")
    """Of what that network sees at a place."""
    evaluate_every: int = num(10, 1, 10**9, "")
    """Updates between evaluations on held-out seeds."""
    evaluation_episodes: int = num(64, 1, 1_000_000, "")
    """Seeds of each."""

    def check(self) -> None:
        """A minibatch can be filled; pictures are learned from with PPO."""
        if self.observation not in OBSERVED:
            self.refuse("observation", f"= {self.observation!r}: {meant(self.observation, OBSERVED)}")
        if self.observation == "pixels" and self.algo not in COMMON_ALGORITHMS:
            self.refuse("algo", f"= {self.algo!r} does not look at pictures: choose one of {COMMON_ALGORITHMS}")
        if self.batch_size > self.num_envs * self.n_steps:
            self.refuse("batch_size", "is more than num_envs x n_steps: there is nothing to fill it with")

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> TrainSettings:
        """From named values.

        Raises:
            ConfigError: a name is unknown or a value does not fit; the message says which.
        """
        return from_mapping(cls, values)

    def as_dict(self) -> dict[str, Any]:
        """All settings by name."""
        return to_mapping(self)


_PIXELS = {"algo": "maskable-ppo", "num_envs": 32, "n_steps": 64, "batch_size": 256, "evaluation_episodes": 64}
"""Pictures cost more to look at than to decide on: smaller batches of them."""


def algorithms(spec: TaskSpec) -> tuple[str, ...]:
    """What a task can be learned with."""
    return (*COMMON_ALGORITHMS, *spec.learners)


def tuned(env_id: str, scenario: str | None = None, config: Path | None = None, **given: Any) -> TrainSettings:
    """The settings for an environment: the task's own, those for its scenario, then a file's, then what is given.

    For pictures the part ``pixels`` comes behind a file's defaults and scenario.

    Args:
        env_id: registered id.
        scenario: a name or a scenario file; None for the file's, or the environment's headline scenario.
        config: YAML of the same form as the tasks' own: ``defaults``, ``pixels``, and ``scenarios`` by name.
        **given: single settings; None leaves them as they are.

    Raises:
        ValueError: a file cannot be read or holds something else than settings, or a name is unknown.
    """
    spec = task(env_id)
    layers = [_own(spec)]
    if config is not None:
        layers.append(_parts(load_yaml(config), str(config)))
    values: dict[str, Any] = {}
    for layer in layers:
        values.update(layer.get("defaults") or {})
    chosen = scenario or values.get("scenario") or spec.headline
    spec.assembly.scenario(chosen)
    for layer in layers:
        values.update((layer.get("scenarios") or {}).get(chosen) or {})
    if (given.get("observation") or values.get("observation")) == "pixels":
        values.update(_PIXELS)
        for layer in layers:
            values.update(layer.get("pixels") or {})
    values.update({key: value for key, value in given.items() if value is not None})
    settings = TrainSettings.of({**values, "scenario": chosen})
    if settings.algo not in algorithms(spec):
        raise ConfigError("algo", f" = {settings.algo!r}: {meant(settings.algo, algorithms(spec))}", "TrainSettings")
    return settings


def _own(spec: TaskSpec) -> dict[str, Any]:
    """The settings that come with a task, as parts of a file."""
    if spec.learning is None:
        return {}
    if isinstance(spec.learning, Mapping):
        return {"defaults": dict(spec.learning)}
    package, _, name = spec.learning.partition(":")
    return _parts(parse_yaml(resources.files(package).joinpath(name).read_text("utf-8"), name), name)


def _parts(data: Mapping[str, Any], where: str) -> dict[str, Any]:
    scenarios = data.get("scenarios") or {}
    if (
        set(data) - {"defaults", "scenarios", "pixels"}
        or not isinstance(data.get("pixels") or {}, Mapping)
        or not isinstance(data.get("defaults") or {}, Mapping)
        or not isinstance(scenarios, Mapping)
        or not all(isinstance(part or {}, Mapping) for part in scenarios.values())
    ):
        raise ConfigError("", "give settings under 'defaults:' and, by name, under 'scenarios:'", place=where)
    return dict(data)
