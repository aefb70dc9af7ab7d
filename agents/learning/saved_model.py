"""Models that Stable-Baselines3 saved, as policies: of whatever algorithm, since its policy alone is loaded."""

from __future__ import annotations

import inspect
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...kernels.files import opened, unpacked_bytes
from ..foreign import MOST_BYTES, in_words
from ..policies.base import Actions, Observation, StatelessPolicy
from ..policies.weights import PolicyFileError


class SavedModelPolicy(StatelessPolicy):
    """The most probable action of a saved model, among the possible ones where it was trained with masks."""

    name = "saved"

    def __init__(self, policy: Any):
        """Take an SB3 policy."""
        self._policy = policy
        self._masked = "action_masks" in inspect.signature(policy.predict).parameters

    def act(self, observation: Observation) -> Actions:
        """Actions (B,)."""
        masks = {"action_masks": observation["action_mask"] > 0} if self._masked else {}
        actions: NDArray[Any] = self._policy.predict(dict(observation), deterministic=True, **masks)[0]
        return actions.astype(np.int64).reshape(len(observation["action_mask"]))


def load_model(path: Path, env: Any) -> SavedModelPolicy:
    """Load a model for an environment. This unpickles what the file holds: only for files that are trusted.

    Raises:
        PolicyFileError: Stable-Baselines3 is missing, the file is no model, or one of another task.
    """
    try:
        from stable_baselines3.common.save_util import load_from_zip_file
    except ImportError:
        raise PolicyFileError(f'{path} needs Stable-Baselines3: pip install "fieldgym[rl]"') from None
    core = env.unwrapped.core
    try:
        with opened(path, MOST_BYTES) as file:
            unpacked = unpacked_bytes(file)
        if unpacked > MOST_BYTES:
            raise ValueError(f"it unpacks to {unpacked} bytes, at most {MOST_BYTES} are read")
        saved: Any = load_from_zip_file(path, device="cpu")
        data, parameters = saved[0], saved[1]
        spaces = data["observation_space"], data["action_space"]
        policy = data["policy_class"](*spaces, lambda _: 0.0, **data["policy_kwargs"])
        policy.load_state_dict(parameters["policy"])
    except Exception as error:  # whatever unpickling a file that is something else brings
        told = in_words(error)[:200]
        raise PolicyFileError(f"{path} cannot be loaded as a model of Stable-Baselines3 ({told})") from error
    if spaces != (core.observation_space, core.action_space):
        raise PolicyFileError(
            f"{path} was trained on other observations or actions than those of {env.unwrapped.spec.id}"
        )
    policy.set_training_mode(False)
    return SavedModelPolicy(policy)
