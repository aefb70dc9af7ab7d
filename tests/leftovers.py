"""What a test could leave behind for those that run after it in the same process."""

import os
import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import gymnasium as gym
import numpy as np

from fieldgym.envs.task import _POLICIES, _TASKS

OF_TOOLS = {"PYTEST_CURRENT_TEST", "LD_LIBRARY_PATH"}
"""Variables of the environment that pytest sets, and OpenCV when it is imported."""


def state() -> dict[str, Any]:
    """By name, what tests may change only for themselves."""
    return {
        "the working folder": os.getcwd(),
        "what Ctrl-C does": signal.getsignal(signal.SIGINT),
        "NumPy's handling of errors": np.geterr(),
        **{f"${name}": value for name, value in os.environ.items() if name not in OF_TOOLS},
    }


def changed(before: dict[str, Any], after: dict[str, Any]) -> list[str]:
    """Names of what is not as it was; variables that are new are none: libraries set theirs when they are imported."""
    return sorted(name for name, value in before.items() if after.get(name) != value)


@contextmanager
def restored() -> Iterator[None]:
    """What the package adds to by design is as it was: tasks, policies and Gymnasium's ids, and the module path."""
    kept: list[tuple[dict[str, Any], dict[str, Any]]] = [
        (_TASKS, dict(_TASKS)),
        (_POLICIES, {env_id: dict(own) for env_id, own in _POLICIES.items()}),
        (gym.registry, dict(gym.registry)),
    ]
    path = list(sys.path)
    yield
    # Libraries add folders of their own when they are imported, and need them from then on.
    sys.path[:] = path + [folder for folder in sys.path if folder not in path and "site-packages" in folder]
    for registry, before in kept:
        if registry != before:
            registry.clear()
            registry.update(before)
