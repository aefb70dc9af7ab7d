"""A network's first lesson: do what a scripted policy does, and foresee what it earns."""

from __future__ import annotations

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray

from ..policies.base import Policy
from .sb3 import NativeVecEnv

Array = NDArray[np.float32]

DOUBT = 0.1
"""Weight of the entropy: a pupil that is sure of everything tries nothing else later."""


def imitate(learner: Any, env: NativeVecEnv, teacher: Policy, decisions: int, epochs: int, batch_size: int) -> float:
    """Teach actor and critic from ``decisions`` of a teacher in the learner's own worlds.

    The actor learns the teacher's choices (cross-entropy), the critic the rewards that followed to the episode's end;
    decisions whose episode did not end are left out.

    Args:
        learner: SB3's, with a set policy that has not learned anything yet.
        env: its worlds; they start new episodes here, and again when the learner begins.
        teacher: acts on the worlds' observations.
        decisions: to learn from.
        epochs: passes over them.
        batch_size: of a minibatch.

    Returns:
        Share of the decisions in which the most likely action is now the teacher's.

    Raises:
        ValueError: no episode ended within ``decisions``.
    """
    observations, actions, gains = _watch(env, teacher, decisions, learner.gamma)
    network, optimizer = learner.policy, learner.policy.optimizer
    for group in optimizer.param_groups:
        group["lr"] = learner.lr_schedule(1.0)
    for _ in range(epochs):
        for rows in torch.randperm(len(actions)).split(batch_size):
            part = {name: values[rows].float() for name, values in observations.items()}
            value, likelihood, entropy = network.evaluate_actions(part, actions[rows])
            miss = torch.nn.functional.mse_loss(value.flatten(), gains[rows])
            loss = learner.vf_coef * miss - (likelihood + DOUBT * entropy).mean()
            optimizer.zero_grad()
            loss.backward()
            torch.nn.utils.clip_grad_norm_(network.parameters(), learner.max_grad_norm)
            optimizer.step()
    same = 0
    with torch.no_grad():
        for rows in torch.arange(len(actions)).split(batch_size):
            part = {name: values[rows].float() for name, values in observations.items()}
            chosen = network.get_distribution(part).mode()
            same += int((chosen == actions[rows]).sum())
    # What PPO's optimiser remembers shall not be the lesson's gradients.
    optimizer.state.clear()
    return same / len(actions)


def _watch(
    env: NativeVecEnv, teacher: Policy, decisions: int, gamma: float
) -> tuple[dict[str, torch.Tensor], torch.Tensor, torch.Tensor]:
    """Observations, actions (N,) and discounted rewards to the end (N,) of the decisions of ended episodes."""
    seen: list[tuple[dict[str, Any], NDArray[np.int64], Array, NDArray[np.bool_]]] = []
    observation = env.reset()
    teacher.reset(np.ones(env.num_envs, bool))
    for _ in range(-(-decisions // env.num_envs)):
        chosen = teacher.act(observation)
        env.step_async(chosen)
        following, rewards, over, _ = env.step_wait()
        seen.append((observation, chosen, rewards, over))
        if over.any():
            teacher.reset(over)
        observation = following
    to_go, ended = np.zeros(env.num_envs, np.float32), np.zeros(env.num_envs, bool)
    gains, kept = [], []
    for _, _, rewards, over in reversed(seen):
        ended |= over
        to_go = rewards + np.float32(gamma) * np.where(over, np.float32(0.0), to_go)
        gains.append(to_go)
        kept.append(ended.copy())
    chosen_rows = torch.from_numpy(np.concatenate(kept[::-1]))
    if not chosen_rows.any():
        raise ValueError(f"no episode ended within {decisions} decisions of the teacher: give more")
    observations = {
        name: torch.from_numpy(np.concatenate([step[0][name] for step in seen]))[chosen_rows] for name in seen[0][0]
    }
    actions = torch.from_numpy(np.concatenate([step[1] for step in seen]))[chosen_rows]
    return observations, actions, torch.from_numpy(np.concatenate(gains[::-1]))[chosen_rows]
