"""Training a set policy with (Maskable) PPO: measured, evaluated on held-out seeds, and safe against being killed."""

from __future__ import annotations

import json
import math
import os
import platform
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import LinearSchedule

from .. import __version__
from . import checkpoint, portable
from .evaluation import Scores, evaluate, mean
from .imitation import imitate
from .layout import layout_of
from .registry import make_policy
from .sb3 import NativeVecEnv, make_vec_env
from .set_policy import MaskableSetPolicy, SetPolicy
from .train_settings import TrainSettings

TRAINING_SEEDS = 1_000_000_000
"""World i of a run with seed s begins with the instance ``TRAINING_SEEDS + 10_000 s + i``, far from the seeds below."""
HELD_OUT_SEEDS = 1_000_000
"""First of the seeds with which a run chooses its best weights; scores are told on others, which begin at 0."""
STATE, BEST, LAST, CURVE = "state.pt", "best.npz", "last.npz", "curve.json"
RECENT_EPISODES = 200


@dataclass
class Progress:
    """How far a run is; sums go on after a resume.

    Attributes:
        steps: decisions learned from.
        total: decisions wanted.
        updates: so far.
        returns: mean return of the latest training episodes, NaN before the first.
        net_rate: the same for the net rate.
        cycle_time_s: the same for the cycle time.
        taught: share of its teacher's decisions that the network took over, NaN without a teacher.
        environment_s: wall seconds inside the environment.
        acting_s: choosing actions and keeping what was seen.
        learning_s: updates.
        other_s: evaluations, checkpoints.
        held_out: latest evaluation, empty before the first.
    """

    steps: int = 0
    total: int = 0
    updates: int = 0
    returns: float = math.nan
    net_rate: float = math.nan
    cycle_time_s: float = math.nan
    taught: float = math.nan
    environment_s: float = 0.0
    acting_s: float = 0.0
    learning_s: float = 0.0
    other_s: float = 0.0
    held_out: dict[str, float] = field(default_factory=dict)

    @property
    def wall_s(self) -> float:
        """Wall seconds, those before a resume included."""
        return self.environment_s + self.acting_s + self.learning_s + self.other_s

    def split(self) -> str:
        """Where the time went, in words."""
        total = max(self.wall_s, 1e-9)
        parts = {
            "environment": self.environment_s,
            "choosing actions": self.acting_s,
            "learning": self.learning_s,
            "evaluation and checkpoints": self.other_s,
        }
        shares = ", ".join(f"{name} {seconds / total:.0%}" for name, seconds in parts.items())
        return f"{self.steps:,} decisions in {self.wall_s:.0f} s ({self.steps / total:,.0f}/s): {shares}"


@dataclass(frozen=True)
class Result:
    """What a run leaves: the folder's best policy, how it went, and the curve of held-out scores."""

    best: Path
    progress: Progress
    curve: list[dict[str, float]]


def train(
    env_id: str,
    settings: TrainSettings,
    folder: Path,
    *,
    seed: int = 0,
    resume: bool = False,
    threads: int | None = None,
    on_update: Callable[[Progress], None] = lambda progress: None,
) -> Result:
    """Train until ``settings.steps`` decisions are learned from.

    Every update ends with a checkpoint ``state.pt``; after a kill, ``resume=True`` goes on from the last one and takes
    the decisions that the unbroken run would have taken. ``best.npz`` holds the weights with the highest return on the
    held-out seeds so far, ``last.npz`` the latest, ``curve.json`` every evaluation, ``tensorboard/`` the learner's log.

    Args:
        env_id: registered id.
        settings: what to do; on a resume only ``steps`` may differ.
        folder: where everything goes.
        seed: of the run.
        resume: go on from the folder's checkpoint.
        threads: of PyTorch; None leaves them as they are.
        on_update: called after every update.

    Raises:
        CheckpointError: the checkpoint cannot be used.
        ValueError: ``seed`` is out of range.
    """
    if not 0 <= seed < 100_000:
        raise ValueError(f"seed = {seed}: allowed range [0, 99999]")
    folder.mkdir(parents=True, exist_ok=True)
    if threads is not None:
        torch.set_num_threads(threads)
    saved = checkpoint.read(folder / STATE) if resume else None
    first_seed = TRAINING_SEEDS + 10_000 * seed
    env = make_vec_env(
        env_id,
        settings.num_envs,
        scenario=settings.scenario,
        time_limit_ends=settings.time_limit_ends,
        reward_scale=settings.reward_scale,
    )
    try:
        # SB3 hands its own seed on to the environment.
        model = _model(env, settings, first_seed)
        run = _Run(env_id, settings, seed, folder, model, env, on_update)
        model.set_logger(configure(str(folder / "tensorboard"), ["tensorboard"]))
        if saved is not None:
            run.restore(saved)
        elif settings.teacher is not None:
            run.learn_from(settings.teacher)
        left = settings.steps - model.num_timesteps
        if left > 0:
            model.learn(left, callback=run, reset_num_timesteps=False, log_interval=1)
        return Result(folder / BEST, run.progress, run.curve)
    finally:
        env.close()


def _model(env: NativeVecEnv, settings: TrainSettings, seed: int) -> Any:
    from sb3_contrib import MaskablePPO
    from stable_baselines3 import PPO

    algorithm: Any = MaskablePPO if settings.algo == "maskable-ppo" else PPO
    policy = MaskableSetPolicy if settings.algo == "maskable-ppo" else SetPolicy
    return algorithm(
        policy,
        env,
        learning_rate=LinearSchedule(settings.learning_rate, settings.final_learning_rate, 1.0),
        n_steps=settings.n_steps,
        batch_size=settings.batch_size,
        n_epochs=settings.n_epochs,
        gamma=settings.gamma,
        gae_lambda=settings.gae_lambda,
        clip_range=settings.clip_range,
        ent_coef=settings.ent_coef,
        vf_coef=settings.vf_coef,
        max_grad_norm=settings.max_grad_norm,
        target_kl=settings.target_kl,
        seed=seed,
        device="cpu",
        policy_kwargs={
            "layout": layout_of(env.native),
            "hidden": settings.hidden,
            "critic_hidden": settings.critic_hidden,
            "relations": settings.relations,
        },
    )


class _Run(BaseCallback):
    """Measures, evaluates and keeps a run, between SB3's rollouts and updates."""

    def __init__(
        self,
        env_id: str,
        settings: TrainSettings,
        seed: int,
        folder: Path,
        learner: Any,
        env: NativeVecEnv,
        on_update: Callable[[Progress], None],
    ):
        super().__init__()
        self.env_id, self.settings, self.seed, self.folder = env_id, settings, seed, folder
        self.learner, self.worlds, self.on_update = learner, env, on_update
        self.progress = Progress(total=settings.steps)
        self.curve: list[dict[str, float]] = []
        self.best = -math.inf
        self.recent: deque[list[float]] = deque(maxlen=RECENT_EPISODES)
        self._mark = time.perf_counter()
        self._inside = 0.0
        self._collected = False

    def restore(self, saved: dict[str, Any]) -> None:
        """Go on from a checkpoint."""
        run = saved["text"]["run"]
        before, now = dict(run["settings"]), self.settings.as_dict()
        for name in now:
            if name != "steps" and before.get(name) != now[name]:
                raise checkpoint.CheckpointError(
                    f"the checkpoint in {self.folder} was made with {name} = {before.get(name)!r}, now it is "
                    f"{now[name]!r}: go on with the same settings, or start without --resume"
                )
        if run["env_id"] != self.env_id or run["seed"] != self.seed:
            raise checkpoint.CheckpointError(
                f"the checkpoint in {self.folder} is of {run['env_id']} with seed {run['seed']}: "
                "choose that, another --out, or start without --resume"
            )
        checkpoint.restore(saved, self.learner, self.worlds)
        self.progress = Progress(**{**run["progress"], "total": self.settings.steps})
        self.curve, self.best = run["curve"], run["best"] if run["best"] is not None else -math.inf
        self.recent.extend(run["recent"])

    def learn_from(self, teacher: str) -> None:
        """Begin with what a scripted policy does."""
        settings = self.settings
        self.progress.taught = imitate(
            self.learner,
            self.worlds,
            make_policy(teacher, self.worlds.native, self.seed),
            settings.teacher_decisions,
            settings.teacher_epochs,
            settings.batch_size,
        )
        # The run begins with fresh instances, as one without a teacher does.
        self.worlds.seed(TRAINING_SEEDS + 10_000 * self.seed)
        self.progress.learning_s += self._lap()
        self._evaluate()
        self.progress.other_s += self._lap()

    def _on_training_start(self) -> None:
        # SB3 empties its episode buffer when learning begins; the checkpoint keeps it for the log.
        self.learner.ep_info_buffer.extend(getattr(self.learner, "_restored_episodes", ()))
        self._mark, self._inside = time.perf_counter(), self.worlds.step_wall_s

    def _on_rollout_start(self) -> None:
        if self._collected:
            self._after_update()

    def _on_step(self) -> bool:
        for row in np.flatnonzero(self.locals["dones"]).tolist():
            info = self.locals["infos"][row]
            card = info["scorecard"]
            self.recent.append([info["episode"]["r"], card["net_rate"], card["cycle_time_s"]])
        return True

    def _on_rollout_end(self) -> None:
        inside = self.worlds.step_wall_s - self._inside
        self._inside = self.worlds.step_wall_s
        self.progress.environment_s += inside
        self.progress.acting_s += self._lap() - inside
        self._collected = True
        if self.recent:
            latest = np.array(self.recent)
            for column, name in enumerate(("return", "net_rate", "cycle_time_s")):
                self.logger.record(f"episode/{name}", mean(latest[:, column]))

    def _on_training_end(self) -> None:
        if self._collected:
            self._after_update(final=True)

    def _after_update(self, final: bool = False) -> None:
        progress = self.progress
        progress.learning_s += self._lap()
        self._collected = False
        progress.steps, progress.updates = self.learner.num_timesteps, progress.updates + 1
        if self.recent:
            latest = np.array(self.recent)
            progress.returns, progress.net_rate = mean(latest[:, 0]), mean(latest[:, 1])
            progress.cycle_time_s = mean(latest[:, 2])
        if final or progress.updates % self.settings.evaluate_every == 0:
            self._evaluate()
        progress.other_s += self._lap()
        checkpoint.write(self.folder / STATE, self.learner, self.worlds, self._text())
        progress.other_s += self._lap()
        self.on_update(progress)

    def _evaluate(self) -> None:
        layout, hidden, relations = self.learner.policy.layout, self.settings.hidden, self.settings.relations
        weights = {
            name: values.detach().numpy().copy()
            for name, values in self.learner.policy.mlp_extractor.actor.state_dict().items()
        }
        policy = portable.LearnedPolicy(layout, hidden, weights, {}, relations=relations)
        seeds = range(HELD_OUT_SEEDS, HELD_OUT_SEEDS + self.settings.evaluation_episodes)
        scores = evaluate(lambda env: policy, self.env_id, seeds, scenario=self.settings.scenario)
        point = _point(scores)
        self.progress.held_out = point
        self.curve.append({"steps": self.progress.steps, "wall_s": round(self.progress.wall_s, 1), **point})
        for name, value in point.items():
            self.learner.logger.record(f"held_out/{name}", value)
        self.learner.logger.dump(self.progress.steps)
        names = [LAST]
        if point["return"] > self.best:
            self.best = point["return"]
            names.append(BEST)
        for name in names:
            portable.save(self.folder / name, layout, hidden, weights, self._card(point), relations=relations)
        text = json.dumps(self.curve, indent=1) + "\n"
        temporary = self.folder / f".{CURVE}.{os.getpid()}.tmp"
        temporary.write_text(text)
        os.replace(temporary, self.folder / CURVE)

    def _card(self, point: dict[str, float]) -> dict[str, Any]:
        return {
            "env_id": self.env_id,
            "scenario": self.settings.scenario,
            "algorithm": self.settings.algo,
            "settings": self.settings.as_dict(),
            "seed": self.seed,
            "training_seeds": f"from {TRAINING_SEEDS + 10_000 * self.seed}, one a world, drawn on from there",
            "chosen_on_seeds": [HELD_OUT_SEEDS, HELD_OUT_SEEDS + self.settings.evaluation_episodes - 1],
            "decisions": self.progress.steps,
            "wall_s": round(self.progress.wall_s, 1),
            "wall_split": self.progress.split(),
            "held_out": point,
            "learning_curve": self.curve,
            "task_numbers": portable.task_digest(self.worlds.native),
            "fieldgym": __version__,
            "torch": torch.__version__,
            "machine": f"{platform.system()} {platform.machine()}, {torch.get_num_threads()} threads",
        }

    def _text(self) -> dict[str, Any]:
        finite_best = self.best if math.isfinite(self.best) else None
        progress = {name: getattr(self.progress, name) for name in Progress.__dataclass_fields__}
        return {
            "env_id": self.env_id,
            "seed": self.seed,
            "settings": self.settings.as_dict(),
            "progress": progress,
            "curve": self.curve,
            "best": finite_best,
            "recent": list(self.recent),
        }

    def _lap(self) -> float:
        before, self._mark = self._mark, time.perf_counter()
        return self._mark - before


def _point(scores: Scores) -> dict[str, float]:
    return {
        "return": round(mean(scores.returns), 6),
        "net_rate": round(mean(scores.scorecard["net_rate"]), 6),
        "cycle_time_s": round(mean(scores.scorecard["cycle_time_s"]), 4),
    }
