"""What Gymnasium's own tests meet in place of Gymnasium's environments: a pytest plugin of ``gymnasium_tests.py``.

``FIELDGYM_STAND_IN`` names an id and a backend, as ``fieldgym/HoeWeeding-v0 pybullet``. That environment becomes the
class behind ``CartPole-v1``, which those tests take wherever they need some environment, and its batch the class behind
CartPole's batch. So that it can stand there, it has what the tests expect of CartPole and no task asks for: one array
of numbers as observation, an attribute ``gravity``, an episode that is over after some twenty decisions, and a keyword
``sutton_barto_reward``.
"""

from __future__ import annotations

import inspect
import json
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium import spaces
from gymnasium.envs import classic_control
from gymnasium.envs.classic_control import cartpole
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector.utils import batch_space

import fieldgym
from fieldgym.envs.references import resolved

STAND_IN, TOLD, WHICH = "FIELDGYM_STAND_IN", "FIELDGYM_TOLD", "FIELDGYM_WHICH"
"""Variables: who stands in, the file that outcomes are appended to, and which tests are run."""
EXAMPLE = "those that take an example"
DECISIONS = 20
"""Of an episode of whoever stands in."""
PICTURE_PX = 32
PICTURES_PER_SECOND = 50
"""CartPole's: windows wait so long between two pictures."""
FILES_OF_THEIRS = {
    "tests/envs/mujoco": "Gymnasium's own environments of MuJoCo",
    "tests/envs/functional": "Gymnasium's own environments of JAX",
    "tests/envs/toy_text": "Gymnasium's own taxi",
    "tests/envs/test_env_implementation.py": "what Gymnasium's own environments do, each by its class",
}
"""Below ``tests/envs``: of single environments of Gymnasium's, and of nothing else."""
LEFT_OUT = {
    "test_mujoco_action_dimensions": "of MuJoCo's environments; there is none here",
    "test_box_actions_out_of_bound": "of actions that are boxes of numbers; these are whole numbers",
    "test_sync_vector_env_seed": "wants continuous actions: whole numbers and a batch of them draw unalike",
    "test_make_with_render_mode": "CartPole takes a mode of rendering that it does not have; these ids refuse it",
    "test_pygame_selective_init": "of pygame, with which CartPole draws and these ids do not",
    "test_num_envs_screen_size[*Ant-v4]": "of MuJoCo's ant",
    "wrappers/vector/test_human_rendering.py::test_render_modes": "CartPole's batch takes a mode that it does not have",
}
"""Tests by the end of their name, and why they are not run."""


def specs() -> list[EnvSpec]:
    """Every id on each of its backends, registered under a name that says so."""
    found = []
    for task in fieldgym.tasks():
        space, _, name = task.id.rpartition("/")
        if space != "fieldgym":
            continue
        for backend in task.backends:
            spec = replace(gym.spec(task.id), id=f"{backend}/{name}", kwargs={"backend": backend})
            gym.registry.setdefault(spec.id, spec)
            found.append(spec)
    return found


ENV_ID, _, BACKEND = os.environ.get(STAND_IN, "fieldgym/SafflowerPicking-v0 analytic").partition(" ")
_single: Any = resolved(fieldgym.task(ENV_ID).entry_point)
_batch: Any = resolved(fieldgym.task(ENV_ID).vector_entry_point)
# A picture of the field for every observation would be most of the time; the tests of all ids have it.
_usual: dict[str, Any] = {"perception": "perfect"}


class CartPoleEnv(_single):
    """Whoever stands in."""

    gravity = 9.8

    def __init__(self, sutton_barto_reward: bool = False, **kwargs: Any):
        """Be made as CartPole is."""
        super().__init__(**{"backend": BACKEND, "width": PICTURE_PX, **_usual, **kwargs})
        self.metadata["render_fps"] = PICTURES_PER_SECOND
        self._named, self._decided = self.observation_space, 0
        self.observation_space = spaces.flatten_space(self._named)

    def reset(self, **kwargs: Any) -> Any:
        """The task's, in one array."""
        observation, info = super().reset(**kwargs)
        self._decided = 0
        return spaces.flatten(self._named, observation), info

    def step(self, action: Any) -> Any:
        """The task's, in one array, and over early."""
        observation, reward, terminated, truncated, info = super().step(action)
        self._decided += 1
        cut = truncated or (self._decided >= DECISIONS and not terminated)
        return spaces.flatten(self._named, observation), reward, terminated, cut, info


class CartPoleVectorEnv(_batch):
    """The batch of whoever stands in: analytic, as every batch is."""

    def __init__(self, sutton_barto_reward: bool = False, max_episode_steps: int = 0, **kwargs: Any):
        """Be made as CartPole's is."""
        super().__init__(**{**_usual, **kwargs, **({"width": PICTURE_PX} if kwargs.get("render_mode") else {})})
        self.metadata["render_fps"] = PICTURES_PER_SECOND
        self._named = self.single_observation_space
        self.single_observation_space = spaces.flatten_space(self._named)
        self.observation_space = batch_space(self.single_observation_space, self.num_envs)

    def reset(self, **kwargs: Any) -> Any:
        """The task's, in one array a world."""
        observation, info = super().reset(**kwargs)
        return self._flat(observation), info

    def step(self, actions: Any) -> Any:
        """Likewise."""
        observation, *rest = super().step(actions)
        return (self._flat(observation), *rest)

    def _flat(self, observation: dict[str, Any]) -> Any:
        parts = [observation[name].reshape(self.num_envs, -1) for name in self._named]
        return np.concatenate(parts, axis=1).astype(self.single_observation_space.dtype)


def pytest_configure() -> None:
    """Take CartPole's place, with nobody watching."""
    for module in (cartpole, classic_control):
        module.CartPoleEnv = CartPoleEnv  # type: ignore[attr-defined]
    cartpole.CartPoleVectorEnv = CartPoleVectorEnv  # type: ignore[misc]
    from fieldgym.envs import screen
    from fieldgym.simulation.window import Window

    Window.open = lambda self: None  # type: ignore[method-assign]
    Window.show = lambda self, rgb: None  # type: ignore[method-assign]
    screen.time = type("Unhurried", (), {"sleep": lambda seconds: None, "perf_counter": lambda: 0.0})  # type: ignore[assignment]


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Leave out what is not meant, and keep to those that take an example where only they are asked for."""
    for item in list(items):
        why = next((why for name, why in LEFT_OUT.items() if _named_so(item.nodeid, name)), "")
        if why:
            item.add_marker(pytest.mark.skip(reason=f"left out: {why}"))
        if os.environ.get(WHICH) == EXAMPLE and not _takes_an_example(item):
            items.remove(item)


def _named_so(nodeid: str, name: str) -> bool:
    start, star, end = name.partition("[*")
    if star:
        return f"::{start}[" in nodeid and nodeid.endswith(end)
    return nodeid.partition("[")[0].endswith((f"::{name}", f"/{name}"))


def _takes_an_example(item: Any) -> bool:
    """Whether CartPole stands in the test, or in what it gets from a fixture."""
    fixtures = [found[-1].func for found in item._fixtureinfo.name2fixturedefs.values()]
    for function in (item.function, *fixtures):
        try:
            if "CartPole" in inspect.getsource(function):
                return True
        except (OSError, TypeError):
            continue
    return False


def pytest_runtest_logreport(report: pytest.TestReport) -> None:
    """Write down what became of a test."""
    if report.when != "call" and report.passed:
        return
    why = report.longrepr[2] if report.skipped and isinstance(report.longrepr, tuple) else ""
    row = {"test": report.nodeid, "outcome": report.outcome, "why": why, "when": report.when}
    with Path(os.environ[TOLD]).open("a", encoding="utf-8") as told:
        told.write(json.dumps(row) + "\n")
