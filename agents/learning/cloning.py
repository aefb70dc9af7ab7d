"""Behaviour cloning: a set network learns which action the policy of a dataset took, and nothing else."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray

from ..policies.layout import Layout
from ..policies.network import NetworkPolicy
from .set_policy import MASKED, SetActor


class Lessons(NamedTuple):
    """Decisions of all episodes of a dataset, one after another.

    Attributes:
        machine: (N, m) float32.
        candidates: (N, K F) float32.
        action_mask: (N, actions) int8.
        actions: (N,), what was chosen.
        episodes: (N,), the number of the episode.
    """

    machine: NDArray[np.float32]
    candidates: NDArray[np.float32]
    action_mask: NDArray[np.int8]
    actions: NDArray[np.int64]
    episodes: NDArray[np.int64]


class Cloned(NamedTuple):
    """What was learned.

    Attributes:
        policy: in NumPy, as ``portable.save`` writes it.
        agreement: share of the held-out decisions in which it chooses what the dataset's policy chose.
        decisions: that it learned from.
    """

    policy: NetworkPolicy
    agreement: float
    decisions: int


def lessons_of(dataset: Any) -> Lessons:
    """The decisions of a Minari dataset that ``collect`` wrote.

    Raises:
        ValueError: its observations have no machine, candidates and mask.
    """
    columns: dict[str, list[NDArray[Any]]] = {name: [] for name in Lessons._fields}
    for number, episode in enumerate(dataset.iterate_episodes()):
        actions = np.asarray(episode.actions, np.int64)
        for name in ("machine", "candidates", "action_mask"):
            if not isinstance(episode.observations, dict) or name not in episode.observations:
                raise ValueError(
                    f"dataset {dataset.id!r} has no observations[{name!r}]: write one with fieldgym collect"
                )
            # The last observation is of the end: nothing was decided there.
            columns[name].append(episode.observations[name][: len(actions)])
        columns["actions"].append(actions)
        columns["episodes"].append(np.full(len(actions), number))
    return Lessons(*(np.concatenate(columns[name]) for name in Lessons._fields))


def clone(
    lessons: Lessons,
    layout: Layout,
    card: dict[str, Any],
    *,
    hidden: int = 64,
    relations: int = 0,
    epochs: int = 12,
    batch_size: int = 512,
    learning_rate: float = 2e-3,
    held_out: float = 0.1,
    seed: int = 0,
    on_epoch: Callable[[int, float], None] = lambda epoch, loss: None,
) -> Cloned:
    """Learn the actions by cross-entropy over those that were possible.

    Args:
        lessons: what was decided.
        layout: of the task.
        card: what the policy's file says of it.
        hidden: width of the network.
        relations: numbers that candidates hear of each other, see ``SetActor``.
        epochs: passes over the decisions.
        batch_size: of a minibatch.
        learning_rate: of Adam, at the beginning; it falls to nothing in a straight line.
        held_out: share of the episodes, the last ones, that ``agreement`` is counted on; nothing is learned from them.
        seed: of the first weights and of the minibatches.
        on_epoch: called with the number of finished passes and the mean loss of the last one.

    Raises:
        ValueError: there are too few episodes to hold any out.
    """
    episodes = int(lessons.episodes[-1]) + 1 if len(lessons.episodes) else 0
    known = lessons.episodes < episodes - max(1, round(held_out * episodes))
    if not known.any():
        raise ValueError(f"{episodes} episodes: give at least 2, one to learn from and one that is held out")
    chance = torch.Generator().manual_seed(seed)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        actor = SetActor(layout, hidden, relations)
    machine, candidates, mask, actions = (torch.from_numpy(values[known]) for values in lessons[:4])
    optimizer = torch.optim.Adam(actor.parameters(), lr=learning_rate)
    count, done = len(actions), 0
    steps = epochs * -(-count // batch_size)
    for epoch in range(epochs):
        total = 0.0
        for rows in torch.randperm(count, generator=chance).split(batch_size):
            optimizer.param_groups[0]["lr"] = learning_rate * (1.0 - done / steps)
            logits = actor(machine[rows], candidates[rows].reshape(len(rows), layout.candidates, layout.features))
            logits = torch.where(mask[rows] > 0, logits, MASKED)
            loss = torch.nn.functional.cross_entropy(logits, actions[rows])
            optimizer.zero_grad()
            loss.backward()
            optimizer.step()
            total, done = total + float(loss.detach()) * len(rows), done + 1
        on_epoch(epoch + 1, total / count)
    weights = {name: values.detach().numpy().copy() for name, values in actor.state_dict().items()}
    policy = NetworkPolicy(layout, hidden, weights, card, relations=relations)
    rest = {name: values[~known] for name, values in zip(Lessons._fields[:3], lessons, strict=False)}
    same = [
        policy.act({name: values[some] for name, values in rest.items()}) == lessons.actions[~known][some]
        for some in np.array_split(np.arange(int((~known).sum())), max(1, int((~known).sum()) // 4096))
    ]
    return Cloned(policy, float(np.concatenate(same).mean()), count)
