"""The native vector environment of a task: n worlds of the batched rules, analytic executor."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, ClassVar, Generic, NamedTuple

import numpy as np
from gymnasium.error import ResetNeeded
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from .assembly import Assembly, backend_of, choice
from .batch_pictures import Pictured
from .cameras import Cameras
from .core import Array, OutcomeT, Page, PlanT, TaskCore
from .ended import Ended
from .named import info_of
from .options import checked_actions, checked_options, checked_seeds, completed
from .pixels import DEFAULT_ROWS, Shown
from .state import State, check, put, refuse_closed, taken
from .team import Team

Observation = dict[str, NDArray[Any]]
Rules = TaskCore[Any, Any]
_REMEMBERED = ("_over", "_ended")
"""What a state holds of the environment itself."""
_WORTH_SHARING = 8
"""New episodes a thread that take longer than waking the threads up for them."""


class Ending(NamedTuple):
    """What the worlds ``rows`` showed when their episode ended, before they began another: see ``Page``."""

    rows: NDArray[np.int64]
    observation: Observation
    numbers: Array


class TaskVectorEnv(Pictured, Generic[PlanT, OutcomeT]):
    """``num_envs`` worlds stepped as one; bit for bit what as many single environments give on equal seeds.

    A task's batched environment is a subclass with its ``assembly`` and a docstring. PyBullet machines run one a
    process: use ``vectorization_mode="async"`` for those.

    Args:
        num_envs: number of worlds.
        scenario: as in ``TaskEnv``, like all arguments that are not named here.
        backend: ``"analytic"``; ``engine`` is another name of it.
        perception: ``"model"``, ``"perfect"`` or ``"camera"``: every world has its cameras, they draw the same meshes.
        config: see ``scenario``.
        overrides: see ``scenario``.
        autoreset_mode: ``NEXT_STEP`` (Gymnasium's default: the step after an episode's end ignores the action and
            returns the new episode's first observation with reward 0), ``SAME_STEP`` (the step that ends an episode
            returns the new one's first observation, the last one is in ``info["final_obs"]`` and
            ``info["final_info"]``) or ``DISABLED`` (the caller resets with ``options={"reset_mask": ...}``; until then
            a world that is over stays so: whatever is chosen for it, it gives reward 0, its last observation and
            scorecard, and ``terminated`` or ``truncated`` again).
        render_mode: ``"rgb_array"`` (``render`` returns a picture of every world) or None.
        observation: as in ``TaskEnv``, like the next five.
        pixel_rows: see there.
        depth: see there.
        camera: see there.
        width: see there.
        height: see there.
        threads: step so many shares of the worlds side by side, bit for bit as one thread does; for thousands of worlds
            on as many free processors; with few, handing a step over takes longer than the step.
        **settings: see ``scenario``.

    Raises:
        ValueError: an argument is unknown or cannot be batched; the message says what is allowed.
    """

    assembly: ClassVar[Assembly[Any]]

    def __init__(
        self,
        num_envs: int = 1,
        scenario: str | PathLike[str] | None = None,
        backend: str | None = None,
        perception: str | None = None,
        config: Any = None,
        overrides: Mapping[str, Any] | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        engine: str | None = None,
        observation: str = "features",
        pixel_rows: int = DEFAULT_ROWS,
        depth: bool = False,
        camera: str | None = None,
        width: int | None = None,
        height: int | None = None,
        threads: int = 1,
        **settings: Any,
    ):
        """Put the parts together."""
        given = settings
        parts, settings = self.equipped(settings)
        super().__init__(parts, render_mode, (camera, width, height))
        asked = backend_of(backend, engine)
        backend = "analytic" if asked is None else asked
        perception = parts.batched(backend, perception)
        self.shown = Shown.checked(observation, pixel_rows, depth, parts.view is not None)
        config = parts.configured(scenario, config, overrides, settings)
        self.backend, self.perception, self.scenario = backend, perception, parts.name_of(config.scenario)
        self._equipment = {name: value for name, value in given.items() if name not in settings}
        core: TaskCore[PlanT, OutcomeT] = parts.core(config, parts.perception_model(perception, config), num_envs)
        self.core = core
        self.num_envs = core.worlds
        mode = autoreset_mode.value if isinstance(autoreset_mode, AutoresetMode) else autoreset_mode
        self.autoreset_mode = AutoresetMode(choice("autoreset_mode", mode, [each.value for each in AutoresetMode]))
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.metadata["render_fps"] = 1.0 / parts.mean_decision_s(self.scenario)
        self.cameras = self._equip()
        self._team = Team(threads, core, sees=self.cameras is not None)
        known = core.observation_space
        self.single_observation_space = self.cameras.space(known) if self.cameras else known
        self.single_action_space = core.action_space
        self.observation_space = batch_space(self.single_observation_space, core.worlds)
        self.action_space = batch_space(core.action_space, core.worlds)
        self._generators: list[np.random.Generator | None] = [None] * core.worlds
        self._seeds = [-1] * core.worlds
        self._over = np.zeros(core.worlds, bool)
        self._ready, self._ended = False, Ended()
        self._mask = np.zeros((core.worlds, int(core.action_space.n)), np.int8)

    def __getstate__(self) -> dict[str, Any]:
        """What a copy takes over: all but the cameras, which look at the worlds of this one."""
        return {**vars(self), "cameras": None, "_album": None, "_copied": self.cameras.played if self.cameras else []}

    def __setstate__(self, copied: dict[str, Any]) -> None:
        """Become a copy, with cameras that have seen the same."""
        vars(self).update(copied)
        played = vars(self).pop("_copied")
        self.cameras = None if self.closed else self._equip()
        if self.cameras:
            self.cameras.play_again(played)

    def _equip(self) -> Cameras | None:
        return self.drawer(self.shown) if self.perception == "camera" or self.shown.draws else None

    def drawer(self, shown: Shown) -> Cameras:
        """The worlds' views: they see for the rules, or draw observations."""
        view: Any = self.equipped(dict(self._equipment))[0].view
        return Cameras(self.core, view, self.perception == "camera", shown)

    @classmethod
    def equipped(cls, settings: dict[str, Any]) -> tuple[Assembly[Any], dict[str, Any]]:
        """The parts for these settings, and the settings that are left; see ``TaskEnv.equipped``."""
        return cls.assembly, settings

    def reset(
        self,
        *,
        seed: int | Sequence[int | None] | None = None,
        options: dict[str, Any] | None = None,
    ) -> tuple[Observation, dict[str, Any]]:
        """Start new episodes.

        Args:
            seed: a whole number (world i gets ``seed + i``), a number or None for each world, or None to go on drawing.
            options: ``{"reset_mask": bool (n,)}`` resets only those worlds; ``{"fields": [...]}`` plays these fields
                (or files), one a world that is reset, instead of drawing.

        Raises:
            ValueError: the seeds, the mask or the fields do not fit the number of worlds, or an option is unknown.
            gymnasium.error.ClosedEnvironmentError: after ``close``.
        """
        refuse_closed(self.closed)
        n = self.num_envs
        seeds = checked_seeds(seed, n)
        asked = checked_options(options, ("reset_mask", "fields"))
        chosen = np.asarray(asked.get("reset_mask", np.ones(n, bool)))
        if chosen.shape != (n,) or chosen.dtype != bool or not chosen.any():
            raise ValueError(f"reset_mask must be a boolean array of shape ({n},) with at least one True")
        for i in np.flatnonzero(chosen):
            if seeds[i] is not None or self._generators[i] is None:
                self._generators[i], self._seeds[i] = seeding.np_random(seeds[i])
        if asked.get("fields") is not None:
            self._restart(self.core, slice(0, n), np.flatnonzero(chosen), asked["fields"])
        else:
            self._team.each(lambda core, where: self._restart(core, where, np.flatnonzero(chosen[where])))
        self._over[chosen] = False
        self._ready = all(generator is not None for generator in self._generators)
        return self._standing(chosen)

    def step(
        self, actions: NDArray[np.int64]
    ) -> tuple[Observation, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Carry out one decision in every world.

        Raises:
            ValueError: the actions are no integers of the action space, one a world.
            gymnasium.error.ResetNeeded: a world was not reset yet.
            gymnasium.error.ClosedEnvironmentError: after ``close``.
        """
        chosen, before = self._checked(actions), self._over
        page, ending = self._decide(chosen), None
        if self.autoreset_mode is AutoresetMode.NEXT_STEP and before.any():
            # The finished worlds stepped along in the batch; what they did is overwritten by their new episode.
            self._begin(np.flatnonzero(before), page)
            page.terminated[before], page.truncated[before] = False, False
        # Added up as the single environment adds its terms.
        reward = sum((page.numbers[:, i] for i in range(len(self.core.reward_names))), np.zeros(self.num_envs))
        if self.autoreset_mode is AutoresetMode.DISABLED:
            self._rest(before, page)
            reward[before] = 0.0
        self._over = page.terminated | page.truncated
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._over.any():
            rows, seen = np.flatnonzero(self._over), self._seen(page, self._over)
            ending = Ending(rows, {name: values[rows] for name, values in seen.items()}, page.numbers[rows])
            self._begin(rows, page)
        extra = {} if ending is None else self._final(ending)
        observation = self._observation(page)
        info = self._info(page.numbers) | extra
        return observation, reward, page.terminated, page.truncated, info

    def action_masks(self) -> NDArray[np.bool_]:
        """Which actions are possible now, bool (num_envs, n).

        Raises:
            gymnasium.error.ResetNeeded: a world was not reset yet.
        """
        self._refuse_unready()
        return self._mask.astype(bool)

    def get_state(self) -> State:
        """Where the worlds stand; ``set_state`` goes back to it, here or in a batch of equal arguments.

        Raises:
            gymnasium.error.ResetNeeded: a world was not reset yet.
        """
        self._refuse_unready()
        chance = ((g.bit_generator.state, seed) for g, seed in zip(self._generators, self._seeds, strict=True) if g)
        remembered = {name: copy.deepcopy(getattr(self, name)) for name in _REMEMBERED}
        remembered |= {"_played": tuple(self.cameras.played) if self.cameras else ()}
        return taken(self.core, self.perception, tuple(chance), remembered)

    def set_state(self, state: State) -> tuple[Observation, dict[str, Any]]:
        """Stand where a state was taken, the chance of later episodes included; see ``TaskEnv.set_state``.

        Returns:
            Observation and info as of a reset.

        Raises:
            ValueError: the state is of another configuration, perception, number of worlds or kind.
        """
        refuse_closed(self.closed)
        check(state, self.core, self.perception, (*_REMEMBERED, "_played"))
        for row, (chance, seed) in enumerate(state.chance):
            generator, _ = seeding.np_random(0)
            generator.bit_generator.state = chance
            self._generators[row], self._seeds[row] = generator, -1 if seed is None else seed
        remembered = copy.deepcopy(dict(state.remembered))
        played = remembered.pop("_played")
        if self.cameras and self.cameras.senses:
            self.cameras.play_again(played)
        else:
            put(state, self.core)
        vars(self).update(remembered)
        self._ready = True
        return self._standing(np.ones(self.num_envs, bool))

    def close_extras(self, **kwargs: Any) -> None:
        """Free what cameras hold, and let threads go."""
        self._team.close()
        self._close_pictures()

    def _restart(self, core: Rules, where: slice, rows: NDArray[np.int64], fields: Any = None) -> None:
        """Give new episodes to ``rows`` of the worlds ``where``, whose rules ``core`` are."""
        mine = self._generators[where]
        generators = [g for g in (mine[row] for row in rows) if g is not None]
        begun: Sequence[Any] = [g.bit_generator.state for g in generators] if self.cameras else []
        if fields is None:
            core.reset_rows(rows, generators)
        else:
            if isinstance(fields, str) or not isinstance(fields, Sequence) or len(fields) != len(rows):
                raise ValueError(f"fields must be a list of {len(rows)} fields or files, one a world that is reset")
            pairs = zip(fields, generators, strict=True)
            whole = begun = [completed(core, field, generator) for field, generator in pairs]
            core.load(rows, core.stack(whole))
        if self.cameras:
            self.cameras.begin(rows, begun)

    def _decide(self, actions: NDArray[np.int64]) -> Page:
        """A decision of all worlds, each thread's share of them beside the others'."""
        if self.cameras:
            return self._carry_out(actions)
        if self._team.alone:
            return self.core.decide(actions)
        page = self.core.blank()
        self._team.each(lambda core, where: core.decide(actions[where], page.part(where)))
        return page

    def _carry_out(self, actions: NDArray[np.int64]) -> Page:
        """A decision that cameras look at before and after."""
        assert self.cameras
        # What is over has begun anew with SAME_STEP, else nobody looks at it.
        awake = np.ones_like(self._over) if self.autoreset_mode is AutoresetMode.SAME_STEP else ~self._over
        self.cameras.attend(awake, actions)
        plan = self.core.plan(actions)
        result = self.core.apply(plan, self.core.nominal(plan))
        self.cameras.sense(awake)
        return self.core.booked(result)

    def _begin(self, rows: NDArray[np.int64], page: Page) -> None:
        """Give worlds new episodes, and their page what they show then: nothing was decided in them."""
        page.numbers[rows] = 0.0
        if len(rows) < _WORTH_SHARING * self._team.threads or self._team.alone:
            self._restart(self.core, slice(0, self.num_envs), rows)
            self.core.show(rows, page)
            return

        def begin(core: Rules, where: slice) -> None:
            first, end = np.searchsorted(rows, (where.start, where.stop))
            mine = rows[first:end] - where.start
            self._restart(core, where, mine)
            core.show(mine, page.part(where))

        self._team.each(begin)

    def _rest(self, before: NDArray[np.bool_], page: Page) -> None:
        """Let worlds that are over show their end, those that were so ``before`` without a decision."""
        page.numbers[before, : self._scores] = 0.0
        ends = {"terminated": page.terminated, "truncated": page.truncated, "scores": page.numbers[:, self._scores :]}
        self._ended.show(before, ends)
        ending = (page.terminated | page.truncated) & ~before
        if ending.any():
            self._ended.keep(ending, self._seen(page, ending) | ends)

    def _refuse_unready(self) -> None:
        """Refuse to go on after ``close``, and while a world was never reset."""
        refuse_closed(self.closed)
        if not self._ready:
            waiting = next(row for row, generator in enumerate(self._generators) if generator is None)
            raise ResetNeeded(f"world {waiting} was not reset yet: call reset() first, for every world")

    def _standing(self, present: NDArray[np.bool_]) -> tuple[Observation, dict[str, Any]]:
        """Observation and info before any decision."""
        page = self.core.show()
        if self.autoreset_mode is AutoresetMode.DISABLED:
            self._ended.show(self._over, {"scores": page.numbers[:, self._scores :]})
        return self._observation(page), self._info(page.numbers, present)

    @property
    def _scores(self) -> int:
        """The first column of the scores in a page."""
        return len(self.core.reward_names) + len(self.core.phase_names)

    def _seen(self, page: Page, rows: NDArray[np.bool_] | None = None) -> Observation:
        """What the worlds, or of pictures those of ``rows`` (B,), show now."""
        return self.cameras.observe(page.observation, rows) if self.cameras else page.observation

    def _observation(self, page: Page) -> Observation:
        resting = self.autoreset_mode is AutoresetMode.DISABLED
        observation = self._seen(page, ~self._over if resting else None)
        if resting:
            self._ended.show(self._over, observation)
        self._mask = observation["action_mask"].copy()
        return observation

    def _info(self, numbers: Array, present: NDArray[np.bool_] | None = None) -> dict[str, Any]:
        core, phases, scores = self.core, len(self.core.reward_names), self._scores
        blocks = {
            "rewards": (core.reward_names, numbers[:, :phases]),
            "phases_s": (core.phase_names, numbers[:, phases:scores]),
            "scorecard": (core.score_names, numbers[:, scores:]),
        }
        return info_of(blocks, self._mask, present)

    def _final(self, ending: Ending) -> dict[str, Any]:
        """The last observation and info of the worlds that end now, in Gymnasium's layout."""
        rows, observation, ended = ending
        last, numbers = np.full(self.num_envs, None, object), np.zeros((self.num_envs, ended.shape[1]))
        self._mask = np.zeros_like(self._mask)
        numbers[rows], self._mask[rows] = ended, observation["action_mask"]
        for place, row in enumerate(rows):
            last[row] = {name: values[place].copy() for name, values in observation.items()}
        return {
            "final_obs": last,
            "_final_obs": self._over.copy(),
            "final_info": self._info(numbers, self._over),
            "_final_info": self._over.copy(),
        }

    def _checked(self, actions: Any) -> NDArray[np.int64]:
        self._refuse_unready()
        return checked_actions(actions, self.num_envs, int(self.core.action_space.n))
