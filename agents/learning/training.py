"""Training a set policy with (Maskable) PPO: measured, evaluated on held-out seeds, and safe against being killed."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.logger import configure
from stable_baselines3.common.utils import LinearSchedule

from ...kernels.locks import FolderLock
from ..evaluation import mean
from ..policies.layout import layout_of
from ..policies.network import NetworkPolicy
from ..policies.pixels import PixelPolicy
from ..registry import make_policy
from . import checkpoint
from .imitation import imitate
from .pixel_policy import MaskableSeeingPolicy, SeeingPolicy, SeeingPolicyBase
from .runs import BEST, CheckpointError, Journal, Progress, Result, first_training_seed
from .sb3 import NativeVecEnv, make_vec_env
from .set_policy import MaskableSetPolicy, SetPolicy
from .train_settings import TrainSettings

STATE = "state.pt"
RECENT_EPISODES = 200
OF_THE_NETWORK = ("hidden", "critic_hidden", "relations")
OF_THE_LEARNER = (
    *("n_steps", "batch_size", "n_epochs", "gamma", "gae_lambda"),
    *("clip_range", "ent_coef", "vf_coef", "max_grad_norm", "target_kl"),
)
"""Settings that have the same name in Stable-Baselines3."""


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
        settings: what to do; on a resume only ``steps`` and ``minutes`` may differ.
        folder: where everything goes.
        seed: of the run.
        resume: go on from the folder's checkpoint.
        threads: of PyTorch; None leaves them as they are.
        on_update: called after every update, and before the first where a teacher was learned from.

    Raises:
        CheckpointError: the checkpoint cannot be used.
        FolderBusyError: another run writes into the folder.
        ValueError: ``seed`` is out of range.
    """
    first_seed = first_training_seed(seed)
    if threads is not None:
        torch.set_num_threads(threads)
    saved = checkpoint.read(folder / STATE) if resume else None
    folder.mkdir(parents=True, exist_ok=True)
    with FolderLock(folder):
        env = make_vec_env(
            env_id,
            settings.num_envs,
            scenario=settings.scenario,
            time_limit_ends=settings.time_limit_ends,
            reward_scale=settings.reward_scale,
            **_pictures(settings),
        )
        try:
            # SB3 hands its own seed on to the environment.
            logger = configure(str(folder / "tensorboard"), ["tensorboard"])
            record = Journal(env_id, settings, seed, folder, logger)
            model = _model(env, record, first_seed)
            run = _Run(record, model, env, on_update)
            model.set_logger(logger)
            if saved is not None:
                run.restore(saved)
            elif settings.teacher is not None:
                run.learn_from(settings.teacher)
                on_update(record.progress)
            left = settings.steps - model.num_timesteps
            if left > 0 and record.time_left > 0.0:
                model.learn(left, callback=run, reset_num_timesteps=False, log_interval=1)
            return Result(folder / BEST, record.progress, record.curve)
        finally:
            env.close()


def _model(env: NativeVecEnv, record: Journal, seed: int) -> Any:
    from sb3_contrib import MaskablePPO
    from stable_baselines3 import PPO

    settings = record.settings
    falling = LinearSchedule(settings.learning_rate, settings.final_learning_rate, 1.0)

    def rate(left: float) -> float:
        return falling(min(left, record.time_left))

    maskable = settings.algo == "maskable-ppo"
    algorithm: Any = MaskablePPO if maskable else PPO
    policy: Any = MaskableSetPolicy if maskable else SetPolicy
    sizes: dict[str, Any] = {}
    if env.native.cameras is not None:
        policy = MaskableSeeingPolicy if maskable else SeeingPolicy
        sizes = {"marks": env.native.cameras.marks, "channels": settings.channels}
    return algorithm(
        policy,
        env,
        learning_rate=rate,
        seed=seed,
        device="cpu",
        policy_kwargs={
            "layout": layout_of(env.native),
            **{name: getattr(settings, name) for name in OF_THE_NETWORK},
            **sizes,
        },
        **{name: getattr(settings, name) for name in OF_THE_LEARNER},
    )


def _pictures(settings: TrainSettings) -> dict[str, Any]:
    """What environments are asked for; a teacher wants to be told the candidates' numbers."""
    if settings.observation == "features":
        return {}
    return {"observation": "both" if settings.teacher else "pixels", "pixel_rows": settings.pixel_rows}


class _Run(BaseCallback):
    """Measures, evaluates and keeps a run, between SB3's rollouts and updates."""

    def __init__(self, record: Journal, learner: Any, env: NativeVecEnv, on_update: Callable[[Progress], None]):
        super().__init__()
        self.record, self.settings = record, record.settings
        self.learner, self.worlds, self.on_update = learner, env, on_update
        self.recent: deque[list[float]] = deque(maxlen=RECENT_EPISODES)
        self._inside = 0.0
        self._collected = False

    @property
    def progress(self) -> Progress:
        """How far the run is."""
        return self.record.progress

    def restore(self, saved: dict[str, Any]) -> None:
        """Go on from a checkpoint."""
        run = saved["text"]["run"]
        self.record.restore(run)
        checkpoint.restore(saved, self.learner, self.worlds)
        try:
            self.recent.extend(np.array(run["recent"], float).reshape(-1, 3).tolist())
        except (KeyError, TypeError, ValueError):
            raise CheckpointError("the checkpoint's latest episodes are damaged: start without --resume") from None

    def learn_from(self, teacher: str) -> None:
        """Begin with what a scripted policy does."""
        settings, record = self.settings, self.record
        self.progress.taught = imitate(
            self.learner,
            self.worlds,
            make_policy(teacher, self.worlds.native, record.seed),
            settings.teacher_decisions,
            settings.teacher_epochs,
            settings.batch_size,
        )
        # The run begins with fresh instances, as one without a teacher does.
        self.worlds.seed(first_training_seed(record.seed))
        self.progress.learning_s += record.lap()
        self._evaluate()
        self.progress.other_s += record.lap()

    def _on_training_start(self) -> None:
        # SB3 empties its episode buffer when learning begins; the checkpoint keeps it for the log.
        self.learner.ep_info_buffer.extend(getattr(self.learner, "_restored_episodes", ()))
        self._inside = self.worlds.step_wall_s
        self.record.lap()

    def _on_rollout_start(self) -> None:
        if self._collected:
            self._after_update()

    def _on_step(self) -> bool:
        for row in np.flatnonzero(self.locals["dones"]).tolist():
            info = self.locals["infos"][row]
            card = info["scorecard"]
            self.recent.append([info["episode"]["r"], card["net_rate"], card["cycle_time_s"]])
        return self.record.time_left > 0.0

    def _on_rollout_end(self) -> None:
        inside = self.worlds.step_wall_s - self._inside
        self._inside = self.worlds.step_wall_s
        self.progress.environment_s += inside
        self.progress.acting_s += self.record.lap() - inside
        self._collected = True
        if self.recent:
            latest = np.array(self.recent)
            for column, name in enumerate(("return", "net_rate", "cycle_time_s")):
                self.logger.record(f"episode/{name}", mean(latest[:, column]))

    def _on_training_end(self) -> None:
        if self._collected:
            self._after_update(final=True)

    def _after_update(self, final: bool = False) -> None:
        progress, record = self.progress, self.record
        progress.learning_s += record.lap()
        self._collected = False
        progress.steps, progress.updates = self.learner.num_timesteps, progress.updates + 1
        if self.recent:
            latest = np.array(self.recent)
            progress.returns, progress.net_rate = mean(latest[:, 0]), mean(latest[:, 1])
            progress.cycle_time_s = mean(latest[:, 2])
        if final or progress.updates % self.settings.evaluate_every == 0 or record.time_left <= 0.0:
            self._evaluate()
        progress.other_s += record.lap()
        run = {**record.text(), "recent": list(self.recent)}
        checkpoint.write(record.folder / STATE, self.learner, self.worlds, run)
        progress.other_s += record.lap()
        self.on_update(progress)

    def _evaluate(self) -> None:
        policy = self.learner.policy
        sizes = policy.layout, policy.hidden, policy.learned(), {}
        network: Any = None
        if isinstance(policy, SeeingPolicyBase):
            channels, rows = policy.channels, self.settings.pixel_rows
            network = PixelPolicy(*sizes, channels=channels, rows=rows, relations=policy.relations)
        else:
            network = NetworkPolicy(*sizes, relations=policy.relations)
        facts = {"torch": torch.__version__, "threads": torch.get_num_threads()}
        self.record.keep(network, self.worlds.native, **facts)
