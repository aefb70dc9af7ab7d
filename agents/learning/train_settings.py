"""Settings of a training run: tuned ones per environment and scenario in ``agents/learning/settings/*.yaml``."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from difflib import get_close_matches
from importlib import resources
from math import isfinite
from pathlib import Path
from typing import Any

ALGORITHMS = ("maskable-ppo", "ppo", "policy-iteration")

MOST_CONFIG_BYTES = 1_000_000


@dataclass(frozen=True)
class TrainSettings:
    """Everything that decides what a training run learns, its seed apart.

    Attributes:
        algo: ``"maskable-ppo"``, ``"ppo"`` with the mask inside the network, or ``"policy-iteration"``, a planner with
            a learned value (see ``agents.learning.policy_iteration``).
        scenario: of the environment; None for its headline scenario.
        steps: decisions to learn from.
        teacher: scripted policy whose choices the network learns before it finds its own; None: begins with nothing.
        teacher_decisions: how many of them.
        teacher_epochs: passes over them.
        num_envs: worlds in the batch.
        n_steps: decisions a world between two updates.
        batch_size: of an update's minibatches.
        n_epochs: passes over what was collected.
        learning_rate: at the beginning; falls linearly to ``final_learning_rate``.
        final_learning_rate: at the end.
        gamma: discount a decision.
        gae_lambda: of the advantage estimate.
        clip_range: of the policy's ratio.
        ent_coef: weight of the entropy.
        vf_coef: weight of the value loss.
        max_grad_norm: of an update.
        target_kl: ends an update's passes early; None never.
        reward_scale: what learners see is the reward times this.
        time_limit_ends: nothing is worth anything after the time limit, see ``make_vec_env``.
        hidden: width of the actor.
        critic_hidden: width of the critic.
        relations: numbers that candidates hear of each other, see ``set_policy.SetActor``; 0: nothing.
        episodes: of a round of ``"policy-iteration"``, as the next two.
        depth: decisions that the planner looks ahead.
        width: sequences that it keeps.
        evaluate_every: updates between evaluations on held-out seeds.
        evaluation_episodes: seeds of each.
    """

    algo: str = "maskable-ppo"
    scenario: str | None = None
    steps: int = 1_000_000
    teacher: str | None = None
    teacher_decisions: int = 200_000
    teacher_epochs: int = 4
    num_envs: int = 256
    n_steps: int = 64
    batch_size: int = 4096
    n_epochs: int = 4
    learning_rate: float = 1e-3
    final_learning_rate: float = 1e-4
    gamma: float = 0.99
    gae_lambda: float = 0.95
    clip_range: float = 0.2
    ent_coef: float = 0.005
    vf_coef: float = 0.5
    max_grad_norm: float = 0.5
    target_kl: float | None = None
    reward_scale: float = 1.0
    time_limit_ends: bool = True
    hidden: int = 48
    critic_hidden: int = 48
    relations: int = 0
    episodes: int = 4096
    depth: int = 4
    width: int = 8
    evaluate_every: int = 10
    evaluation_episodes: int = 64

    def __post_init__(self) -> None:
        """Check types and ranges."""
        for item in fields(self):
            value = getattr(self, item.name)
            if not _fits(value, str(item.type)):
                raise ValueError(f"{item.name} = {value!r} is no {item.type}")
        if self.algo not in ALGORITHMS:
            raise ValueError(f"algo = {self.algo!r}: choose one of {', '.join(ALGORITHMS)}")
        whole = ("steps", "num_envs", "n_steps", "batch_size", "n_epochs", "hidden", "critic_hidden")
        whole += ("episodes", "depth", "width")
        for name in (*whole, "teacher_decisions", "teacher_epochs", "evaluate_every", "evaluation_episodes"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} = {getattr(self, name)}: give at least 1")
        if self.batch_size > self.num_envs * self.n_steps:
            raise ValueError(f"batch_size = {self.batch_size} is more than num_envs x n_steps, nothing to fill it with")
        for name in ("learning_rate", "clip_range", "max_grad_norm", "reward_scale"):
            if not getattr(self, name) > 0.0:
                raise ValueError(f"{name} = {getattr(self, name)} must be positive")
        for name in ("gamma", "gae_lambda"):
            if not 0.0 <= getattr(self, name) <= 1.0:
                raise ValueError(f"{name} = {getattr(self, name)}: allowed range [0, 1]")
        for name in ("final_learning_rate", "ent_coef", "vf_coef", "relations"):
            if not getattr(self, name) >= 0.0:
                raise ValueError(f"{name} = {getattr(self, name)}: allowed range [0, inf)")

    @classmethod
    def of(cls, values: Mapping[str, Any]) -> TrainSettings:
        """From named values.

        Raises:
            ValueError: a name is unknown or a value does not fit; the message says which.
        """
        known = [item.name for item in fields(cls)]
        for name in values:
            if name not in known:
                near = get_close_matches(str(name), known, n=1)
                hint = f"did you mean {near[0]!r}? " if near else ""
                raise ValueError(f"setting {name!r} is unknown: {hint}choose among {', '.join(known)}")
        # 1 is a good learning rate to YAML and an int to Python.
        floats = {item.name for item in fields(cls) if "float" in str(item.type)}
        taken: dict[str, Any] = dict(values)
        for name in floats & set(taken):
            if isinstance(taken[name], int) and not isinstance(taken[name], bool):
                taken[name] = float(taken[name])
        return cls(**taken)

    def as_dict(self) -> dict[str, Any]:
        """All settings by name."""
        return asdict(self)


def tuned(env_id: str, scenario: str | None = None, config: Path | None = None, **given: Any) -> TrainSettings:
    """The settings for an environment: what ships for it, then for its scenario, then a file's, then what is given.

    Args:
        env_id: registered id.
        scenario: None for the file's, or the environment's headline scenario.
        config: YAML of the same form as those that ship: ``defaults`` and ``scenarios`` by name.
        **given: single settings; None leaves them as they are.

    Raises:
        ValueError: a file cannot be read or holds something else than settings.
    """
    from ...envs import task

    spec = task(env_id)
    name = env_id.split("/")[-1] + ".yaml"
    shipped = resources.files(__name__.rpartition(".")[0]) / "settings" / name
    layers = [_parsed(shipped.read_text("utf-8"), name)] if shipped.is_file() else []
    if config is not None:
        try:
            if config.stat().st_size > MOST_CONFIG_BYTES:
                raise ValueError(f"{config} has {config.stat().st_size} bytes, at most {MOST_CONFIG_BYTES} are read")
            layers.append(_parsed(config.read_text("utf-8"), str(config)))
        except (OSError, UnicodeDecodeError) as error:
            raise ValueError(f"cannot read {config} ({error})") from None
    values: dict[str, Any] = {}
    for layer in layers:
        values.update(layer.get("defaults") or {})
    chosen = scenario or values.get("scenario") or spec.headline
    if chosen not in spec.scenarios:
        raise ValueError(f"scenario = {chosen!r}: choose one of {', '.join(spec.scenarios)}")
    for layer in layers:
        values.update((layer.get("scenarios") or {}).get(chosen) or {})
    values.update({key: value for key, value in given.items() if value is not None})
    return TrainSettings.of({**values, "scenario": chosen})


def _parsed(text: str, where: str) -> dict[str, Any]:
    import yaml

    try:
        data = yaml.safe_load(text) or {}
    except yaml.YAMLError as error:
        raise ValueError(f"{where} is no YAML: {' '.join(str(error).split())}") from None
    parts = data.get("scenarios") or {} if isinstance(data, dict) else None
    if (
        not isinstance(data, dict)
        or set(data) - {"defaults", "scenarios"}
        or not isinstance(data.get("defaults") or {}, dict)
        or not isinstance(parts, dict)
        or not all(isinstance(part or {}, dict) for part in parts.values())
    ):
        raise ValueError(f"{where}: give settings under 'defaults:' and, by name, under 'scenarios:'")
    return data


def _fits(value: Any, kind: str) -> bool:
    if value is None:
        return "None" in kind
    if "bool" in kind:
        return isinstance(value, bool)
    if "int" in kind:
        return isinstance(value, int) and not isinstance(value, bool)
    if "float" in kind:
        return isinstance(value, float) and isfinite(value)
    return isinstance(value, str)
