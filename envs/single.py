"""The Gymnasium face of a task: one world of the batched rules."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from os import PathLike
from typing import Any, ClassVar, Generic

import gymnasium as gym
import numpy as np
from gymnasium.error import ResetNeeded
from numpy.typing import NDArray

from ..kernels.sums import in_order
from .assembly import Assembly, backend_of, choice
from .core import Executor, NominalExecutor, OutcomeT, Page, PlanT, StepResult, TaskCore, View
from .field import Field
from .options import checked_action, checked_options, checked_seed, completed
from .pixels import DEFAULT_ROWS, Pixels, Shown
from .screen import FRAMES_PER_SECOND, Screen, checked_shot
from .state import State, check, put, refuse_closed, refuse_unready, taken

_ONE_ROW = np.zeros(1, np.int64)
_REMEMBERED = ("_over", "_given", "_drawn_from", "_decisions", "_last")
"""What a state holds of the environment itself."""
_REBUILT = ("executor", "_view", "_make_view", "_screen", "_on_frame", "_pixels")
"""What a copy does not take over: it gets a machine and a view of its own, and nobody records it."""


class TaskEnv(gym.Env[Any, Any], Generic[PlanT, OutcomeT]):
    """One world of a task: its rules, an executor, and a view that is made when it is needed.

    A task's environment is a subclass with its ``assembly`` and a docstring. ``copy.deepcopy`` and ``pickle`` give an
    environment that stands at the same place and goes on by itself, with a machine of its own.

    Args:
        scenario: a name, or a YAML file with a scenario's numbers; by default the headline.
        backend: ``"pybullet"`` drives the closed-loop machine, ``"analytic"`` computes the same motion.
        engine: ``backend`` by another name, for callers that keep a ``backend`` for themselves (TorchRL).
        perception: ``"camera"`` renders pictures and finds targets in them, ``"model"`` draws from statistics measured
            on such pictures, ``"perfect"`` reports everything as it is. By default the camera with PyBullet, the model
            without.
        config: every number of the task, or a mapping of them by name; what else is given replaces its own.
        overrides: single numbers of the configuration by dotted name, ``{"process.power_w": 150.0}``.
        render_mode: ``"rgb_array"`` (``render`` returns a picture), ``"human"`` (a window follows every decision in
            real time) or None.
        observation: ``"features"`` (numbers of the candidates), ``"pixels"`` (a picture of them instead) or ``"both"``,
            see ``docs/pixels.md``.
        pixel_rows: height of the pictures.
        depth: add a picture of the depth.
        camera: from where pictures for people are taken, ``"machine"``, ``"overview"``, ``"tool"`` or, where the task
            has it, ``"front"``; see ``Assembly.cameras``.
        width: of pictures for people, in pixels; the height follows where it is not given.
        height: likewise.
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
        engine: str | None = None,
        observation: str = "features",
        pixel_rows: int = DEFAULT_ROWS,
        depth: bool = False,
        camera: str | None = None,
        width: int | None = None,
        height: int | None = None,
        **settings: Any,
    ):
        """Put the parts together."""
        if render_mode is not None:
            choice("render_mode", render_mode, self.metadata["render_modes"])
        parts, rest = self.equipped(settings)
        self._equipment = {name: value for name, value in settings.items() if name not in rest}
        self.shown = Shown.checked(observation, pixel_rows, depth, parts.view is not None)
        asked = backend_of(backend, engine)
        backend = choice("backend", parts.backends[0] if asked is None else asked, parts.backends)
        seen = parts.default_perception(backend) if perception is None else perception
        perception = choice("perception", seen, parts.perceptions)
        config = parts.configured(scenario, config, overrides, rest)
        self.backend, self.perception, self.scenario = backend, perception, parts.name_of(config.scenario)
        self.core: TaskCore[PlanT, OutcomeT] = parts.core(config, parts.perception_model(perception, config), 1)
        self.executor = self._driver(parts)
        self.render_mode, self.shot = render_mode, checked_shot(parts, camera, width, height)
        # One picture a decision, as Gymnasium's RecordVideo takes them, then plays as long as the episode took.
        self.metadata = {**self.metadata, "render_fps": 1.0 / parts.mean_decision_s(self.scenario)}
        self._make_view, self._view, self._closed = parts.view, None, False
        self._pixels = self.drawer(self.shown) if self.shown.draws else None
        known = self.core.observation_space
        self.observation_space = self._pixels.space(known) if self._pixels else known
        self.action_space = self.core.action_space
        self._screen = Screen(f"{type(self).__name__} {self.scenario}")
        self._sensing = perception == "camera"
        self._on_frame: Callable[[NDArray[np.uint8]], None] | None = None
        self._frames_per_second = FRAMES_PER_SECOND
        self._actions = np.zeros(1, np.int64)
        self._last: tuple[PlanT, StepResult] | None = None
        self._page: Page | None = None  # of a decision that nobody has asked about yet
        self._mask = np.zeros(0, np.int8)
        self._given: Field | None = None
        self._drawn_from: Any = None
        self._ready = self._over = False
        # With a camera these lead back to where the world stands, and nothing else does: the view remembers pictures.
        self._decisions: tuple[int, ...] = ()

    def __getstate__(self) -> dict[str, Any]:
        """What a copy takes over."""
        self._remember()
        return {name: value for name, value in vars(self).items() if name not in _REBUILT}

    def __setstate__(self, copied: dict[str, Any]) -> None:
        """Become a copy: with a new machine where the rules say it stands, and a view when it is needed."""
        vars(self).update(copied)
        parts, _ = self.equipped(dict(self._equipment))
        self._make_view, self._view, self._on_frame = parts.view, None, None
        self._screen = Screen(f"{type(self).__name__} {self.scenario}")
        self._pixels = self.drawer(self.shown) if self.shown.draws and not self._closed else None
        self.executor = NominalExecutor(self.core) if self._closed else self._driver(parts)
        if self._ready and not self._closed:
            if self._sensing:
                self._play_again(self._decisions)
            else:
                self.executor.reset_rows(_ONE_ROW)

    def _driver(self, parts: Assembly[Any]) -> Executor[PlanT, OutcomeT]:
        if self.backend == "pybullet" and parts.machine is not None:
            return parts.machine(self.core)
        return NominalExecutor(self.core)

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
        refuse_closed(self._closed)
        if self._view is None:
            if self._make_view is None:
                raise ValueError(f"{type(self).__name__} draws nothing: its assembly has no view")
            self._view = self._make_view(self.core)
            self._view.shot = self.shot
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
            self._given = self.core.draw_field(self._dice())
        return self._given

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Start an episode; the same seed gives the same field and the same luck.

        Args:
            seed: of the environment's chance, a whole number from 0; see Gymnasium.
            options: ``{"field": field_or_path}`` plays that field instead of drawing one; what it does not say is drawn
                from the environment's chance.

        Raises:
            ValueError: the seed is none, an option is unknown, or the field does not fit.
            gymnasium.error.ClosedEnvironmentError: after ``close``.
        """
        refuse_closed(self._closed)
        field = checked_options(options, ("field",)).get("field")
        super().reset(seed=checked_seed(seed))
        if field is None:
            self._given, self._drawn_from = None, self.np_random.bit_generator.state
            self.core.reset_rows(_ONE_ROW, [self.np_random])
        else:
            self._given = completed(self.core, field, self.np_random)
            self.core.load(_ONE_ROW, self.core.stack([self._given]))
        self.executor.reset_rows(_ONE_ROW)
        if self._sensing:
            self.view.sense()
        self._last, self._page, self._decisions = None, None, ()
        self._ready, self._over = True, False
        return self._standing()

    def step(self, action: Any) -> tuple[dict[str, np.ndarray], float, bool, bool, dict[str, Any]]:
        """Carry out one decision.

        Raises:
            ValueError: the action is no integer of the action space.
            gymnasium.error.ResetNeeded: before ``reset``, or after the episode's end.
            gymnasium.error.ClosedEnvironmentError: after ``close``.
        """
        self._actions[0] = self._checked(action)
        watched = self._sensing or self._on_frame is not None or self.render_mode == "human"
        if type(self.executor) is NominalExecutor and not watched:
            page = self._page = self.core.decide(self._actions)
        else:
            page = self._carry_out()
        over, cut = bool(page.terminated[0]), bool(page.truncated[0])
        self._over, observation, info = over or cut, self._observation(page), self._info(page)
        return observation, in_order(info["rewards"].values()), over, cut, info

    def action_masks(self) -> np.ndarray:
        """Which actions are possible now, bool (n,); behind wrappers it is ``env.unwrapped.action_masks()``.

        Raises:
            gymnasium.error.ResetNeeded: before ``reset``.
        """
        refuse_unready(self._ready)
        return self._mask.astype(bool)

    def get_state(self) -> State:
        """Where this environment stands; ``set_state`` goes back to it, here or in an environment of equal arguments.

        Raises:
            gymnasium.error.ResetNeeded: before ``reset``.
        """
        refuse_closed(self._closed)
        refuse_unready(self._ready)
        self._remember()
        chance = ((self.np_random.bit_generator.state, self.np_random_seed),)
        return taken(self.core, self._eyes, chance, {name: getattr(self, name) for name in _REMEMBERED})

    def set_state(self, state: State) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Stand where a state was taken, the chance of later episodes included.

        A machine is placed where the rules say it stands. With a camera the episode is played again up to there, for
        only that brings back what the camera has seen: it takes as long as the decisions took.

        Returns:
            Observation and info as of a reset.

        Raises:
            ValueError: the state is of another configuration, perception or kind.
        """
        refuse_closed(self._closed)
        check(state, self.core, self._eyes, _REMEMBERED)
        ((chance, self._np_random_seed),) = state.chance
        generator = self.np_random
        generator.bit_generator.state = chance
        vars(self).update(state.remembered)
        self._ready, self._page = True, None
        if self._sensing:
            self._play_again(self._decisions)
        else:
            put(state, self.core)
            self.executor.reset_rows(_ONE_ROW)
        return self._standing()

    def describe_last_decision(self) -> str:
        """One line for people about the last decision."""
        self._remember()
        if self._last is None:
            return "ready"
        return self.core.describe(*self._last)

    def render(self) -> NDArray[np.uint8] | None:  # type: ignore[override]
        """Picture (h, w, 3) of the present state with ``render_mode="rgb_array"``; the window follows by itself.

        Raises:
            gymnasium.error.ResetNeeded: before ``reset``.
            gymnasium.error.ClosedEnvironmentError: after ``close``.
        """
        refuse_closed(self._closed)
        refuse_unready(self._ready)
        return self.view.frame() if self.render_mode == "rgb_array" else None

    def record(
        self, on_frame: Callable[[NDArray[np.uint8]], None] | None, frames_per_second: float = FRAMES_PER_SECOND
    ) -> None:
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
        """Free the simulation; idempotent. Nothing can be done with the environment after it."""
        self._closed = True
        self.executor.close()
        if self._view is not None:
            self._view.close()
        self._screen.close()

    def _carry_out(self) -> Page:
        """The decision as the executor carries it out and the view follows it."""
        if self._sensing:
            self.view.attend(int(self._actions[0]))
        plan = self.core.plan(self._actions)
        result = self.core.apply(plan, self.executor.execute(plan))
        if self._on_frame is not None or self.render_mode == "human":
            self._show(plan, result)
        if self._sensing:
            self.view.sense()
            self._decisions += (int(self._actions[0]),)
        self._last, self._page = (plan, result), None
        return self.core.booked(result)

    def _remember(self) -> None:
        """Take down the last decision."""
        if self._page is not None:
            self._last, self._page = (self.core.planned, self.core.result_of(self._page)), None

    def _show(self, plan: PlanT, result: StepResult) -> None:
        """Play the decision: to the recorder at its rate, to people as fast as it really went."""
        rate = self._frames_per_second
        self._screen.play(self.view.frames(plan, result, rate), rate, self._on_frame, self.render_mode == "human")

    @property
    def _eyes(self) -> str:
        """What a state's reports came from; played again on another backend, a camera would look at other times."""
        return f"{self.perception} on {self.backend}" if self._sensing else self.perception

    def _play_again(self, decisions: tuple[int, ...]) -> None:
        """Take the episode's decisions anew, unseen, from its beginning."""
        view = self.view
        told = self._on_frame, self.render_mode
        self._on_frame, self.render_mode = None, "rgb_array"
        try:
            if self._given is None:
                self.core.reset_rows(_ONE_ROW, [self._dice()])
            else:
                self.core.load(_ONE_ROW, self.core.stack([self._given]))
            self.executor.reset_rows(_ONE_ROW)
            view.sense()
            self._decisions, self._over = (), False
            for decision in decisions:
                self.step(decision)
        finally:
            self._on_frame, self.render_mode = told

    def _dice(self) -> np.random.Generator:
        """A generator that stands where this episode's field was drawn."""
        generator = np.random.Generator(type(self.np_random.bit_generator)())
        generator.bit_generator.state = self._drawn_from
        return generator

    def _standing(self) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
        """Observation and info before any decision, and what a window shows then."""
        if self.render_mode == "human":
            self._screen.play((self.view.frame() for _ in range(1)), self._frames_per_second)
        page = self.core.show()
        return self._observation(page), self._info(page)

    def drawer(self, shown: Shown) -> Pixels:
        """What draws observations of this world."""
        return Pixels([self.view], shown)

    def _observation(self, page: Page) -> dict[str, np.ndarray]:
        seen = self._pixels.observe(page.observation) if self._pixels else page.observation
        observation = {name: values[0] for name, values in seen.items()}
        self._mask = observation["action_mask"].copy()
        return observation

    def _info(self, page: Page) -> dict[str, Any]:
        core, numbers = self.core, page.numbers[0].tolist()
        phases = len(core.reward_names)
        scores = phases + len(core.phase_names)
        return {
            "action_mask": self._mask.copy(),
            "rewards": dict(zip(core.reward_names, numbers[:phases], strict=True)),
            "phases_s": dict(zip(core.phase_names, numbers[phases:scores], strict=True)),
            "scorecard": dict(zip(core.score_names, numbers[scores:], strict=True)),
            "fault": self.executor.fault,
        }

    def _checked(self, action: Any) -> int:
        """The action as a number, once it is clear that a decision is due."""
        refuse_closed(self._closed)
        refuse_unready(self._ready)
        if self._over:
            raise ResetNeeded("the episode is over: call reset() before the next step()")
        return checked_action(action, int(self.core.action_space.n))
