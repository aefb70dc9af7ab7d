"""The Gymnasium face of a task: one world of the batched rules."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from os import PathLike
from typing import Any, ClassVar, Generic

import gymnasium as gym
import numpy as np
from numpy.typing import NDArray

from .assembly import Assembly, choice
from .core import Executor, NominalExecutor, OutcomeT, PlanT, StepResult, TaskCore, View
from .field import Field
from .options import checked_options, completed

_ONE_ROW = np.zeros(1, np.int64)


class TaskEnv(gym.Env[Any, Any], Generic[PlanT, OutcomeT]):
    """One world of a task: its rules, an executor, and a view that is made when it is needed.

    A task's environment is a subclass with its ``assembly`` and a docstring.

    Args:
        scenario: a name, or a YAML file with a scenario's numbers; by default the headline.
        backend: ``"pybullet"`` drives the closed-loop machine, ``"analytic"`` computes the same motion.
        perception: ``"camera"`` renders pictures and finds targets in them, ``"model"`` draws from statistics measured
            on such pictures, ``"perfect"`` reports everything as it is. By default the camera with PyBullet, the model
            without.
        config: every number of the task; what else is given replaces its own.
        overrides: single numbers of the configuration by dotted name, ``{"process.power_w": 150.0}``.
        render_mode: ``"rgb_array"`` (``render`` returns a picture), ``"human"`` (a window follows every decision in
            real time) or None.
        **settings: keywords of the task's own, see ``Assembly.settings``.

    Raises:
        ValueError: an argument is unknown or out of range; the message says what is allowed.
    """

    assembly: ClassVar[Assembly[Any]]
    metadata: dict[str, Any] = {"render_modes": ["human", "rgb_array"], "render_fps": 20}  # noqa: RUF012

    def __init__(
        self,
        scenario: str | PathLike[str] | None = None,
        backend: str | None = None,
        perception: str | None = None,
        config: Any = None,
        overrides: Mapping[str, Any] | None = None,
        render_mode: str | None = None,
        **settings: Any,
    ):
        """Put the parts together."""
        if render_mode is not None and render_mode not in self.metadata["render_modes"]:
            raise ValueError(f"render_mode = {render_mode!r}: choose 'human', 'rgb_array' or None")
        parts, settings = self.equipped(settings)
        backend = choice("backend", backend or parts.backends[0], parts.backends)
        perception = choice("perception", perception or parts.default_perception(backend), parts.perceptions)
        config = parts.configured(scenario, config, overrides, settings)
        self.backend, self.perception, self.scenario = backend, perception, parts.name_of(config.scenario)
        self.core: TaskCore[PlanT, OutcomeT] = parts.core(config, parts.perception_model(perception, config), 1)
        driven = backend == "pybullet" and parts.machine is not None
        self.executor: Executor[PlanT, OutcomeT] = (
            parts.machine(self.core) if driven and parts.machine else NominalExecutor(self.core)
        )
        self.render_mode = render_mode
        self.observation_space = self.core.observation_space
        self.action_space = self.core.action_space
        self._make_view, self._view = parts.view, None
        self._window: Any = None
        self._sensing = perception == "camera"
        self._on_frame: Callable[[NDArray[np.uint8]], None] | None = None
        self._frames_per_second = float(self.metadata["render_fps"])
        self._actions = np.zeros(1, np.int64)
        self._last: tuple[PlanT, StepResult] | None = None
        self._mask = np.zeros(0, np.int8)
        self._given: Field | None = None
        self._drawn_from: Any = None

    @classmethod
    def equipped(cls, settings: dict[str, Any]) -> tuple[Assembly[Any], dict[str, Any]]:
        """The parts for these settings, and the settings that are left; a task with several machines chooses here."""
        return cls.assembly, settings

    @property
    def view(self) -> View[PlanT]:
        """The rendered world, made at its first use.

        Raises:
            ValueError: the task has none.
        """
        if self._view is None:
            if self._make_view is None:
                raise ValueError(f"{type(self).__name__} draws nothing: its assembly has no view")
            self._view = self._make_view(self.core)
        return self._view

    @property
    def field(self) -> Any:
        """The field of this episode, with all of its luck; load it with ``reset(options={"field": ...})``.

        Raises:
            ValueError: the environment was not reset yet.
        """
        if self._given is None:
            if self._drawn_from is None:
                raise ValueError("there is no field yet: call reset() first")
            generator = np.random.Generator(type(self.np_random.bit_generator)())
            generator.bit_generator.state = self._drawn_from
            self._given = self.core.draw_field(generator)
        return self._given

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Start an episode; the same seed gives the same field and the same luck.

        Args:
            seed: of the environment's chance, see Gymnasium.
            options: ``{"field": field_or_path}`` plays that field instead of drawing one; what it does not say is drawn
                from the environment's chance.

        Raises:
            ValueError: an option is unknown, or the field does not fit.
        """
        super().reset(seed=seed)
        field = checked_options(options, ("field",)).get("field")
        if field is None:
            self._given, self._drawn_from = None, self.np_random.bit_generator.state
            self.core.reset_rows(_ONE_ROW, [self.np_random])
        else:
            self._given = completed(self.core, field, self.np_random)
            self.core.load(_ONE_ROW, self.core.stack([self._given]))
        self.executor.reset_rows(_ONE_ROW)
        if self._sensing:
            self.view.sense()
        if self.render_mode == "human":
            self._put_in_window(self.view.frame())
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
        if self._window is not None:
            self._window.close()

    def _show(self, plan: PlanT, result: StepResult) -> None:
        """Play the decision: to the recorder at its rate, in a window as fast as it really went."""
        began = time.perf_counter()
        for i, frame in enumerate(self.view.frames(plan, result, self._frames_per_second)):
            if self._on_frame is not None:
                self._on_frame(frame)
            if self.render_mode == "human":
                self._put_in_window(frame)
                time.sleep(max(0.0, began + i / self._frames_per_second - time.perf_counter()))

    def _put_in_window(self, frame: NDArray[np.uint8]) -> None:
        if self._window is None:
            from ..simulation.window import Window

            self._window = Window(f"{type(self).__name__} {self.scenario}")
        self._window.show(frame)

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
