"""The Gymnasium face of a task: one world of the batched rules."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any, Generic

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from .core import BACKENDS, PERCEPTIONS, Executor, OutcomeT, PlanT, StepResult, TaskCore, View, choice

_ONE_ROW = np.zeros(1, np.int64)


class TaskEnv(gym.Env[Any, Any], Generic[PlanT, OutcomeT]):
    """Single environment over a ``TaskCore`` with one world, an executor and a view that is made when it is needed.

    Args:
        core: the rules, one world.
        executor: what carries plans out.
        make_view: makes the rendered world; its argument asks for a window.
        sensing: whether reports come from the view's camera.
        render_mode: ``"rgb_array"`` (``render`` returns a picture), ``"human"`` (a window follows every decision in
            real time) or None.

    Raises:
        ValueError: unknown render mode.
    """

    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 20}  # noqa: RUF012

    def __init__(
        self,
        core: TaskCore[PlanT, OutcomeT],
        executor: Executor[PlanT, OutcomeT],
        make_view: Callable[[bool], View[PlanT]],
        sensing: bool = False,
        render_mode: str | None = None,
    ):
        """Join the parts."""
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"render_mode = {render_mode!r}: choose 'human', 'rgb_array' or None")
        self.core, self.executor = core, executor
        self.render_mode = render_mode
        self.observation_space = core.observation_space
        self.action_space = core.action_space
        self._make_view, self._view = make_view, None
        self._sensing = sensing
        self._on_frame: Callable[[NDArray[np.uint8]], None] | None = None
        self._frames_per_second = float(self.metadata["render_fps"])
        self._actions = np.zeros(1, np.int64)
        self._last: tuple[PlanT, StepResult] | None = None
        self._mask = np.zeros(0, np.int8)

    @property
    def view(self) -> View[PlanT]:
        """The rendered world, made at its first use."""
        if self._view is None:
            self._view = self._make_view(self.render_mode == "human")
        return self._view

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Draw a new instance; the same seed gives the same field and the same luck. ``options`` are not used."""
        super().reset(seed=seed)
        self.core.reset_rows(_ONE_ROW, [self.np_random])
        self.executor.reset_rows(_ONE_ROW)
        if self._sensing:
            self.view.sense()
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
        if self._on_frame is not None or self.render_mode == "human":
            self._show(plan, result)
        if self._sensing:
            self.view.sense()
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

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """Picture (h, w, 3) of the present state with ``render_mode="rgb_array"``; the window follows by itself."""
        return self.view.frame() if self.render_mode == "rgb_array" else None

    def record(self, on_frame: Callable[[NDArray[np.uint8]], None] | None, frames_per_second: float = 20.0) -> None:
        """Hand every decision's pictures to ``on_frame`` from now on; None ends it.

        Args:
            on_frame: takes a picture (h, w, 3), uint8.
            frames_per_second: pictures a simulated second.

        Raises:
            ValueError: the rate is not positive.
        """
        if not frames_per_second > 0.0:
            raise ValueError(f"frames_per_second = {frames_per_second} must be positive")
        self._on_frame, self._frames_per_second = on_frame, frames_per_second

    def close(self) -> None:
        """Free the simulation; idempotent."""
        self.executor.close()
        if self._view is not None:
            self._view.close()

    def _show(self, plan: PlanT, result: StepResult) -> None:
        """Play the decision: to the recorder at its rate, in a window as fast as it really went."""
        began = time.perf_counter()
        for i, frame in enumerate(self.view.frames(plan, result, self._frames_per_second)):
            if self._on_frame is not None:
                self._on_frame(frame)
            if self.render_mode == "human":
                time.sleep(max(0.0, began + i / self._frames_per_second - time.perf_counter()))

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
        n = int(self.core.action_space.n)
        number = np.asarray(action)
        if number.size != 1 or number.dtype.kind not in "iu":
            raise ValueError(f"action = {action!r} is not one integer: give a number in 0..{n - 1}")
        value = int(number.reshape(()))
        if not 0 <= value < n:
            raise ValueError(f"action = {value}: allowed range 0..{n - 1}, see info['action_mask']")
        return value


def single_perception(backend: str, perception: str | None) -> str:
    """Perception of a single environment: what is asked for, or the camera with PyBullet and its model without.

    Raises:
        ValueError: an argument is unknown.
    """
    by_default = "camera" if choice("backend", backend, BACKENDS) == "pybullet" else "model"
    return choice("perception", perception or by_default, PERCEPTIONS)
