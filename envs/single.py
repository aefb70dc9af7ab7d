"""The Gymnasium face of a task: one world of the batched rules."""

from __future__ import annotations

from typing import Any, ClassVar, Generic

import gymnasium as gym
import numpy as np

from .core import Executor, OutcomeT, PlanT, Sensor, StepResult, TaskCore

_ONE_ROW = np.zeros(1, np.int64)


class TaskEnv(gym.Env[dict[str, np.ndarray], np.int64], Generic[PlanT, OutcomeT]):
    """Single environment over a ``TaskCore`` with one world, an executor and, where the task has one, a camera."""

    metadata: ClassVar[dict[str, Any]] = {"render_modes": ["human", "rgb_array"], "render_fps": 20}

    def __init__(
        self,
        core: TaskCore[PlanT, OutcomeT],
        executor: Executor[PlanT, OutcomeT],
        sensor: Sensor | None = None,
        render_mode: str | None = None,
    ):
        """Join the parts; ``core.worlds`` must be 1."""
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"render_mode = {render_mode!r}: choose 'human', 'rgb_array' or None")
        self.core, self.executor, self.sensor = core, executor, sensor
        self.render_mode = render_mode
        self.observation_space = core.observation_space
        self.action_space = core.action_space
        self._actions = np.zeros(1, np.int64)
        self._last: tuple[PlanT, StepResult] | None = None
        self._mask = np.zeros(0, np.int8)

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Draw a new instance; the same seed gives the same field and the same luck. ``options`` are not used."""
        super().reset(seed=seed)
        self.core.reset_rows(_ONE_ROW, [self.np_random])
        self.executor.reset_rows(_ONE_ROW)
        if self.sensor is not None:
            self.sensor.sense()
        self._last = None
        observation = self._observe()
        zeros = [0.0] * len(self.core.reward_names), [0.0] * len(self.core.phase_names)
        return observation, self._info(*zeros)

    def step(self, action: Any) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Carry out one decision.

        Raises:
            ValueError: the action is no integer of the action space.
        """
        self._actions[0] = self._checked(action)
        plan = self.core.plan(self._actions)
        result = self.core.apply(plan, self.executor.execute(plan))
        if self.sensor is not None:
            self.sensor.sense()
        self._last = plan, result
        rewards = result.rewards[0].tolist()
        observation = self._observe()
        info = self._info(rewards, result.phases_s[0].tolist())
        return observation, sum(rewards), bool(result.terminated[0]), bool(result.truncated[0]), info

    def action_masks(self) -> np.ndarray:
        """Which actions are possible now, bool (n,)."""
        return self._mask.astype(bool)

    def describe_last_decision(self) -> str:
        """One line for people about the last decision."""
        if self._last is None:
            return "ready"
        return self.core.describe(*self._last)

    def close(self) -> None:
        """Free the simulation; idempotent."""
        self.executor.close()
        if self.sensor is not None:
            self.sensor.close()

    def _observe(self) -> dict[str, np.ndarray]:
        observation = {name: values[0] for name, values in self.core.observe().items()}
        self._mask = observation["action_mask"].copy()
        return observation

    def _info(self, rewards: list[float], phases_s: list[float]) -> dict[str, Any]:
        core = self.core
        return {
            "action_mask": self._mask.copy(),
            "rewards": dict(zip(core.reward_names, rewards, strict=True)),
            "phases_s": dict(zip(core.phase_names, phases_s, strict=True)),
            "scorecard": dict(zip(core.score_names, core.scores()[0].tolist(), strict=True)),
        }

    def _checked(self, action: Any) -> int:
        n = int(self.action_space.n)
        number = np.asarray(action)
        if number.size != 1 or number.dtype.kind not in "iu":
            raise ValueError(f"action = {action!r} is not one integer: give a number in 0..{n - 1}")
        value = int(number.reshape(()))
        if not 0 <= value < n:
            raise ValueError(f"action = {value}: allowed range 0..{n - 1}, see info['action_mask']")
        return value
