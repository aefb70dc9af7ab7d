"""Policy iteration for a planner with a learned value: play, fit what the play was worth, plan with that, play again.

The value of a state under the policy that played is fitted by least squares of temporal differences, LSTD(lambda)
(Boyan 2002, Machine Learning 49, 233-246); planning with it makes the next policy (Lagoudakis and Parr 2003, J. Machine
Learning Research 4, 1107-1149, who improve by one decision where this searches several). Made for sorting, whose
planner says what its features are (``sorting_value``).
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.logger import configure

from ...envs.sorting.columns import CANDIDATE, candidate_table
from ...envs.task import task
from ...kernels.files import read_file, replace_file
from ...kernels.locks import FolderLock
from ..evaluation import evaluate, mean
from ..policies.base import Actions, Observation, Policy
from ..policies.sorting import time_left_s
from ..policies.sorting_value import ValueWeights, describe_all, elapsed_s, gain_features
from ..policies.value_weights import GAINS, SHAPES, VALUE
from ..registry import make_policy
from ..rollout import batch_decisions
from .runs import BEST, CheckpointError, Journal, Progress, Result, first_training_seed
from .train_settings import TrainSettings, algorithms

Array = NDArray[np.float64]

NAME = "policy-iteration"
STATE = "state.json"
MOST_STATE_BYTES = 50_000_000
_RIDGE = 1.0
_TRIALS = (-0.06, -0.03, 0.0, 0.03, 0.06)
"""Worth of a second of new arrivals beyond their averages, tried about the last one found."""
_TRIAL_SHARE = 4
"""Every how many-th of a round's instances a trial plays."""


class Moment(NamedTuple):
    """A decision in all worlds: what was seen (B, .), done (B,), earned (B,), and which episodes (B,) were going on."""

    observation: Observation
    actions: Actions
    rewards: Array
    under_way: NDArray[np.bool_]


def iterate(
    env_id: str,
    settings: TrainSettings,
    folder: Path,
    *,
    seed: int = 0,
    resume: bool = False,
    on_update: Callable[[Progress], None] = lambda progress: None,
) -> Result:
    """Play rounds of ``settings.episodes`` episodes until ``settings.steps`` decisions are learned from.

    In the first round the teacher plays, and what items bring and how they arrive is learned; in the second it plays
    again and the first value is fitted; from then on the search with the latest value plays. Every round ends with a
    checkpoint ``state.json``; the other files are those of ``training.train``.

    Args:
        env_id: of a task that names this among its ``learners``.
        settings: ``scenario``, ``steps``, ``minutes``, ``teacher``, ``episodes``, ``gae_lambda`` (of LSTD), ``depth``,
            ``width`` and ``evaluation_episodes`` count; on a resume only ``steps`` and ``minutes`` may differ.
        folder: where everything goes.
        seed: of the run.
        resume: go on from the folder's checkpoint.
        on_update: called after every round.

    Raises:
        CheckpointError: the checkpoint cannot be used.
        FolderBusyError: another run writes into the folder.
        ValueError: the task does not name it, no teacher, or ``seed`` is out of range.
    """
    if NAME not in algorithms(task(env_id)):
        known = " or ".join(algorithms(task(env_id)))
        raise ValueError(f"algo = {NAME!r} is not made for {env_id}: choose {known}")
    if settings.teacher is None:
        raise ValueError(f"algo = {NAME!r} needs a teacher: name a scripted policy")
    first_seed = first_training_seed(seed)
    saved = _saved(folder / STATE) if resume else None
    folder.mkdir(parents=True, exist_ok=True)
    with FolderLock(folder):
        logger = configure(str(folder / "tensorboard"), ["tensorboard"])
        record = Journal(env_id, settings, seed, folder, logger)
        env: Any = gym.make_vec(
            env_id,
            settings.episodes,
            vectorization_mode="vector_entry_point",
            scenario=settings.scenario,
            autoreset_mode=AutoresetMode.DISABLED,
        )
        try:
            run = _Run(record, env, first_seed)
            if saved is not None:
                run.restore(saved)
            # However few decisions are asked for: without a value there is no policy.
            while not record.curve or (record.progress.steps < settings.steps and record.time_left > 0.0):
                run.play_round()
                on_update(record.progress)
            return Result(folder / BEST, record.progress, record.curve)
        finally:
            env.close()


def _saved(path: Path) -> dict[str, Any]:
    """What a checkpoint holds: the run's own values and the weights."""
    try:
        state = json.loads(read_file(path, MOST_STATE_BYTES))
        weights = {name: np.array(state[name], float).reshape(shape) for name, shape in SHAPES.items()}
        run = state["run"]
    except FileNotFoundError:
        raise CheckpointError(f"there is no checkpoint {path}: start without --resume") from None
    except (OSError, ValueError, KeyError, TypeError, OverflowError, RecursionError) as error:
        reason = " ".join(str(error).split())
        raise CheckpointError(f"{path} is damaged ({reason[:200]}): start without --resume") from None
    if not all(np.isfinite(values).all() for values in weights.values()):
        raise CheckpointError(f"{path} is damaged (a weight is no number): start without --resume")
    return {"run": run, "weights": weights}


class _Run:
    """Rounds of play and fitting; what one round leaves is all that the next one needs."""

    def __init__(self, record: Journal, env: Any, first_seed: int):
        self.record, self.settings, self.env, self.first_seed = record, record.settings, env, first_seed
        self.weights: dict[str, Array] = {name: np.zeros(shape) for name, shape in SHAPES.items()}

    def learned(self, worth: float | None = None) -> ValueWeights:
        """What was learned so far, in the precision of a file; with another worth of a second, where one is given."""
        weights = {name: values.astype(np.float32) for name, values in self.weights.items()}
        if worth is not None:
            weights["value"][-1] = worth
        return ValueWeights(self.settings.depth, self.settings.width, weights, {})

    def play_round(self) -> None:
        """Play, fit, evaluate, and write the checkpoint."""
        progress, record = self.record.progress, self.record
        record.lap()
        teacher = make_policy(self.settings.teacher or "", self.env, record.seed)
        if progress.updates == 0:
            self._watch(self._play(teacher))
        else:
            player = teacher if progress.updates == 1 else self.learned().fitted(self.env)
            value = self.weights["value"]
            value[:-1] = self._fitted(self._play(player))[:-1]
            progress.learning_s += record.lap()
            value[-1] = self._best_trial()
            progress.acting_s += record.lap()
            record.keep(self.learned(), self.env, training_seeds=[self.first_seed, self._seeds()[-1]])
        progress.updates += 1
        progress.other_s += record.lap()
        state = {"run": record.text(), **{name: values.tolist() for name, values in self.weights.items()}}
        replace_file(record.folder / STATE, json.dumps(state))
        progress.other_s += record.lap()

    def restore(self, saved: dict[str, Any]) -> None:
        """Go on from a checkpoint."""
        self.record.restore(saved["run"])
        self.weights = saved["weights"]

    def _seeds(self) -> list[int]:
        """Instances of this round; every round has its own."""
        first = self.first_seed + self.record.progress.updates * self.settings.episodes
        return list(range(first, first + self.settings.episodes))

    def _play(self, policy: Policy) -> Iterator[Moment]:
        """Play the round's episodes to their ends, decision by decision."""
        progress, record, env = self.record.progress, self.record, self.env
        observation, _ = env.reset(seed=self._seeds())
        total = np.zeros(self.settings.episodes)
        for decision in batch_decisions(env, policy, observation):
            stepped_s = record.lap() - decision.thought_s
            progress.acting_s += decision.thought_s
            progress.environment_s += stepped_s
            progress.steps += int(decision.under_way.sum())
            earned = decision.rewards * decision.under_way
            total += earned
            yield Moment(decision.observation, decision.actions, earned, decision.under_way)
            progress.learning_s += record.lap()
        card = {
            name: mean(values)
            for name, values in zip(env.unwrapped.core.score_names, env.unwrapped.core.scores().T, strict=True)
        }
        progress.returns = mean(total)
        progress.net_rate, progress.cycle_time_s = card["net_rate"], card["cycle_time_s"]

    def _watch(self, moments: Iterator[Moment]) -> None:
        """Learn what gripping an item brings, and how items come into view."""
        matrix, right = _RIDGE * np.eye(GAINS), np.zeros(GAINS)
        before: tuple[NDArray[np.float32], Array] | None = None
        came: list[Array] = []
        for moment in moments:
            table = candidate_table(moment.observation)
            picked = np.flatnonzero(moment.under_way & (moment.actions < table.shape[1]))
            rows = gain_features(table[picked, moment.actions[picked]])
            matrix += rows.T @ rows
            right += rows.T @ moment.rewards[picked]
            across = table[..., CANDIDATE.across]
            time_s = elapsed_s(moment.observation, self.env.unwrapped.core.config)
            if before is not None:
                # A report keeps its place across the belt, to the last digit.
                new = (table[..., CANDIDATE.present] > 0.0) & ~(across[:, :, None] == before[0][:, None]).any(axis=2)
                world, slot = np.nonzero(new & moment.under_way[:, None])
                # It came, on average, half a decision ago.
                ago_s = 0.5 * (time_s - before[1])[world]
                left_s = time_left_s(table[world, slot].T.astype(float)) + ago_s
                numbers = [world.astype(float), time_s[world] - ago_s, left_s]
                came.append(np.column_stack([*numbers, gain_features(table[world, slot])]))
            before = np.where(table[..., CANDIDATE.present] > 0.0, across, np.nan), time_s
        self.weights["gain"] = np.asarray(np.linalg.solve(matrix, right), float)
        self.weights["arrivals"] = self._arrivals(np.concatenate(came))

    def _arrivals(self, came: Array) -> Array:
        """Rate, time left, gain and end of what came into view: rows of world, time, time left, gain's features."""
        world, time_s = came[:, 0].astype(int), came[:, 1]
        worlds = self.settings.episodes
        last = np.zeros(worlds)
        np.maximum.at(last, world, time_s)
        count = np.bincount(world, minlength=worlds)
        rate = count.sum() / last.sum()
        return np.array(
            [rate, came[:, 2].mean(), (came[:, 3:] @ self.weights["gain"]).mean(), last.mean() + 1.0 / rate]
        )

    def _fitted(self, moments: Iterator[Moment]) -> Array:
        """Weights of the value of the policy that plays: LSTD(lambda) without discount."""
        decay, helper = self.settings.gae_lambda, self.learned().fitted(self.env)
        matrix, right = _RIDGE * np.eye(VALUE), np.zeros(VALUE)
        trace, before, earned = np.zeros((self.settings.episodes, VALUE)), None, np.zeros(0)
        for moment in moments:
            rows = describe_all(helper.problem(moment.observation)) * moment.under_way[:, None]
            if before is not None:
                matrix += trace.T @ (before - rows)
                right += trace.T @ earned
            trace = (decay * trace + rows) * moment.under_way[:, None]
            before, earned = rows, moment.rewards
        if before is not None:
            matrix += trace.T @ before
            right += trace.T @ earned
        return np.asarray(np.linalg.solve(matrix, right), float)

    def _best_trial(self) -> float:
        """Worth of a second of new arrivals with which the search earns most, on some of the round's instances."""
        seeds = self._seeds()[::_TRIAL_SHARE]
        tried = self.weights["value"][-1] + np.array(_TRIALS)
        scenario = self.settings.scenario
        earned = [
            mean(evaluate(self.learned(worth).fitted, self.record.env_id, seeds, scenario=scenario).returns)
            for worth in tried
        ]
        curve = np.polyfit(tried, earned, 2)
        best = -0.5 * curve[1] / curve[0] if curve[0] < 0.0 else tried[int(np.argmax(earned))]
        return float(np.clip(best, tried[0], tried[-1]))
