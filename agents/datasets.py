"""Experience of policies as Minari datasets: offline learners learn from it, and its episodes can be played again."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np

from ..envs.field_files import write_field
from ..envs.task import RANDOM, task
from .policies.base import Policy
from .rollout import decisions

LEVELS = ("expert", "medium", "random")
"""Names of datasets that every environment can have: of its best policy, of the one that the others are compared with,
and of chance."""
HOW_TO_INSTALL = 'pip install "fieldgym[datasets]"'


class Collected(NamedTuple):
    """What was written.

    Attributes:
        dataset: of Minari.
        returns: of the episodes, (N,).
        decisions: of all episodes together.
    """

    dataset: Any
    returns: np.ndarray
    decisions: int


def level_policy(env_id: str, level: str) -> str:
    """The policy behind the name of a level, see ``LEVELS``: the shipped learned one where there is one."""
    from .registry import policy_names

    if level == "random":
        return RANDOM
    if level == "medium":
        return task(env_id).reference
    names = policy_names(env_id)
    return "learned" if "learned" in names else names[-1]


def collect(
    make_policy: Callable[[Any], Policy],
    env_id: str,
    seeds: Sequence[int],
    dataset_id: str,
    *,
    algorithm: str,
    on_episode: Callable[[int], None] = lambda finished: None,
    **kwargs: Any,
) -> Collected:
    """Play one episode a seed and write all of it as a Minari dataset.

    Observations hold their masks; infos hold the terms of the reward by name, the phases and the scorecard; metadata of
    an episode hold its seed, its return, the package's version and the file, beside the data, of the field that it was
    played on. ``dataset.recover_environment()`` makes the same environment, in which ``reset(seed=...)`` and the
    recorded actions give the same episode again.

    Args:
        make_policy: gets the environment and returns the policy.
        env_id: registered id.
        seeds: of the environment.
        dataset_id: what Minari calls it, ``namespace/name-v0``.
        algorithm: what the dataset says of the policy.
        on_episode: called with the number of finished episodes.
        **kwargs: of the environment; its specification goes into the dataset as JSON.

    Raises:
        ImportError: Minari is not installed.
        ValueError: no seeds, a name that Minari does not take, or that a dataset has already.
    """
    try:
        from minari import create_dataset_from_buffers
        from minari.data_collector import EpisodeBuffer
        from minari.dataset.minari_dataset import parse_dataset_id
        from minari.storage import get_dataset_path
    except ImportError:
        raise ImportError(f"datasets need Minari: {HOW_TO_INSTALL}", name="minari") from None
    from .. import __version__

    if len(seeds) == 0:
        raise ValueError("seeds are empty: give at least one")
    try:
        version = parse_dataset_id(dataset_id)[2]
    except (TypeError, ValueError):
        raise ValueError(f"dataset {dataset_id!r}: give a name of the form namespace/name-v0") from None
    if Path(get_dataset_path(dataset_id)).exists():
        raise ValueError(f"a dataset is called {dataset_id!r} already: take another name, or -v{version + 1}")
    env: Any = gym.make(env_id, disable_env_checker=True, **kwargs)
    buffers, metadata, fields = [], [], []
    try:
        policy = make_policy(env)
        for number, seed in enumerate(map(int, seeds)):
            observation, info = env.reset(seed=seed)
            fields.append(env.unwrapped.field)
            seen, infos, rest = [observation], [_numbers(info)], []
            for decision in decisions(env, policy, observation):
                seen.append(decision.after)
                infos.append(_numbers(decision.info))
                rest.append((decision.action, decision.reward, decision.terminated, decision.truncated))
            actions, rewards, terminations, truncations = (list(column) for column in zip(*rest, strict=True))
            buffers.append(
                EpisodeBuffer(
                    id=number,
                    seed=seed,
                    observations=_stacked(seen),
                    actions=[np.int64(action) for action in actions],
                    rewards=rewards,
                    terminations=terminations,
                    truncations=truncations,
                    infos=_stacked(infos),
                )
            )
            field = f"fields/episode_{number}.csv"
            metadata.append({"seed": seed, "return": sum(rewards), "field": field, "fieldgym": __version__})
            on_episode(number + 1)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # Minari asks for an author's address
            dataset = create_dataset_from_buffers(
                dataset_id,
                buffers,
                env=env.spec,
                observation_space=env.observation_space,
                action_space=env.action_space,
                algorithm_name=algorithm,
                author="fieldgym",
                description=f"{env_id}, scenario {env.unwrapped.scenario}: {len(seeds)} episodes of {algorithm}.",
                requirements=[f"fieldgym=={__version__}"],
            )
    finally:
        env.close()
    dataset.storage.update_episode_metadata(metadata)
    folder = Path(dataset.storage.data_path)
    (folder / "fields").mkdir(exist_ok=True)
    for field, item in zip(fields, metadata, strict=True):
        write_field(field, folder / item["field"])
    returns = np.array([item["return"] for item in metadata])
    return Collected(dataset, returns, sum(len(buffer.rewards) for buffer in buffers))


def _numbers(info: dict[str, Any]) -> dict[str, Any]:
    """What of an environment's info goes into a dataset, every number an array."""
    names = ("rewards", "phases_s", "scorecard")
    return {name: {key: np.float64(value) for key, value in info[name].items()} for name in names}


def _stacked(steps: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """Equal trees of a sequence as one tree of arrays with a leading axis of steps."""
    return {
        name: _stacked([step[name] for step in steps])
        if isinstance(value, dict)
        else np.stack([s[name] for s in steps])
        for name, value in steps[0].items()
    }
