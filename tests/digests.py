"""Prints a digest of what every environment computes, bit for bit: python tests/digests.py [WORLDS DECISIONS].

Equal on every processor and with every Python, as long as NumPy and the C library are the same.
"""

import hashlib
import sys
from collections.abc import Mapping
from typing import Any

import gymnasium as gym
import numpy as np

from fieldgym import env_ids


def put(digest: Any, value: Any) -> None:
    """Feed in all numbers of a value, in the order of their names."""
    if isinstance(value, Mapping):
        for name in sorted(value):
            digest.update(str(name).encode())
            put(digest, value[name])
    elif isinstance(value, np.ndarray) and value.dtype != object:
        digest.update(np.ascontiguousarray(value).tobytes())


def digest_of(env_id: str, worlds: int, decisions: int) -> str:
    """Of the rules' own arrays after the reset and at the end, and of everything that the steps give."""
    envs: Any = gym.make_vec(env_id, num_envs=worlds, vectorization_mode="vector_entry_point")
    digest, rng = hashlib.sha256(), np.random.default_rng(0)
    observation, info = envs.reset(seed=5)
    put(digest, envs.unwrapped.get_state().arrays)
    for _ in range(decisions):
        actions = np.array([rng.choice(np.flatnonzero(mask)) for mask in info["action_mask"]])
        observation, reward, terminated, truncated, info = envs.step(actions)
        put(digest, {**observation, "reward": reward, "terminated": terminated, "truncated": truncated, "info": info})
    put(digest, envs.unwrapped.get_state().arrays)
    return digest.hexdigest()


if __name__ == "__main__":
    size = [int(word) for word in sys.argv[1:]] or [16, 40]
    for own in env_ids():
        if own.startswith("fieldgym/"):
            print(own, digest_of(own, *size))
