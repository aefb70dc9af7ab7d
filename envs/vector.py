"""The native vector environment of a task: n worlds of the batched rules, analytic executor."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any, ClassVar, Generic

import numpy as np
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import NDArray

from .assembly import BACKENDS, Assembly, choice
from .core import Array, NominalExecutor, OutcomeT, PlanT, TaskCore
from .options import checked_options, completed

Observation = dict[str, NDArray[Any]]


class TaskVectorEnv(VectorEnv[Observation, NDArray[np.int64], NDArray[Any]], Generic[PlanT, OutcomeT]):
    """``num_envs`` worlds stepped as one; bit for bit what as many single environments give on equal seeds.

    A task's batched environment is a subclass with its ``assembly`` and a docstring. PyBullet machines run one a
    process: use ``vectorization_mode="async"`` for those.

    Args:
        num_envs: number of worlds.
        scenario: as in ``TaskEnv``, like all arguments that are not named here.
        backend: ``"analytic"``.
        perception: ``"model"`` or ``"perfect"``.
        config: see ``scenario``.
        overrides: see ``scenario``.
        autoreset_mode: ``NEXT_STEP`` (Gymnasium's default: the step after an episode's end ignores the action and
            returns the new episode's first observation with reward 0), ``SAME_STEP`` (the step that ends an episode
            returns the new one's first observation, the last one is in ``info["final_obs"]`` and
            ``info["final_info"]``) or ``DISABLED`` (the caller resets with ``options={"reset_mask": ...}``).
        render_mode: None: the batch draws nothing.
        **settings: see ``scenario``.

    Raises:
        ValueError: an argument is unknown or cannot be batched; the message says what is allowed.
    """

    assembly: ClassVar[Assembly[Any]]
    metadata: dict[str, Any] = {"autoreset_mode": AutoresetMode.NEXT_STEP, "render_modes": []}  # noqa: RUF012

    def __init__(
        self,
        num_envs: int = 1,
        scenario: str | PathLike[str] | None = None,
        backend: str = "analytic",
        perception: str | None = None,
        config: Any = None,
        overrides: Mapping[str, Any] | None = None,
        autoreset_mode: str | AutoresetMode = AutoresetMode.NEXT_STEP,
        render_mode: str | None = None,
        **settings: Any,
    ):
        """Put the parts together."""
        parts, settings = self.equipped(settings)
        perception = _batched(parts, backend, perception, render_mode)
        config = parts.configured(scenario, config, overrides, settings)
        self.backend, self.perception, self.scenario = backend, perception, parts.name_of(config.scenario)
        core: TaskCore[PlanT, OutcomeT] = parts.core(config, parts.perception_model(perception, config), num_envs)
        self.core, self.executor = core, NominalExecutor(core)
        self.num_envs = core.worlds
        self.autoreset_mode = AutoresetMode(autoreset_mode)
        self.metadata = {**self.metadata, "autoreset_mode": self.autoreset_mode}
        self.single_observation_space = core.observation_space
        self.single_action_space = core.action_space
        self.observation_space = batch_space(core.observation_space, core.worlds)
        self.action_space = batch_space(core.action_space, core.worlds)
        self._generators: list[np.random.Generator | None] = [None] * core.worlds
        self._seeds = [-1] * core.worlds
        self._over = np.zeros(core.worlds, bool)
        self._mask = np.zeros((core.worlds, int(core.action_space.n)), np.int8)

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
            seed: one number (world i gets ``seed + i``), one number or None a world, or None to go on drawing.
            options: ``{"reset_mask": bool (n,)}`` resets only those worlds; ``{"fields": [...]}`` plays these fields
                (or files), one a world that is reset, instead of drawing.

        Raises:
            ValueError: the seeds, the mask or the fields do not fit the number of worlds, or an option is unknown.
        """
        n = self.num_envs
        if seed is None or isinstance(seed, int):
            seeds = [None if seed is None else seed + i for i in range(n)]
        else:
            seeds = list(seed)
        if len(seeds) != n:
            raise ValueError(f"{len(seeds)} seeds for {n} worlds: give one seed a world, or a single number")
        asked = checked_options(options, ("reset_mask", "fields"))
        chosen = np.asarray(asked.get("reset_mask", np.ones(n, bool)))
        if chosen.shape != (n,) or chosen.dtype != bool or not chosen.any():
            raise ValueError(f"reset_mask must be a boolean array of shape ({n},) with at least one True")
        for i in np.flatnonzero(chosen):
            if seeds[i] is not None or self._generators[i] is None:
                self._generators[i], self._seeds[i] = seeding.np_random(seeds[i])
        self._restart(np.flatnonzero(chosen), asked.get("fields"))
        self._over[chosen] = False
        observation = self._observe()
        nothing = np.zeros((n, len(self.core.reward_names))), np.zeros((n, len(self.core.phase_names)))
        return observation, self._info(*nothing, chosen)

    def step(
        self, actions: NDArray[np.int64]
    ) -> tuple[Observation, Array, NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Carry out one decision in every world.

        Raises:
            ValueError: the actions are no integers of the action space, one a world.
        """
        plan = self.core.plan(self._checked(actions))
        result = self.core.apply(plan, self.executor.execute(plan))
        terms, phases, terminated, truncated = result
        extra: dict[str, Any] = {}
        if self.autoreset_mode is AutoresetMode.NEXT_STEP and self._over.any():
            # The finished worlds stepped along in the batch; what they did is overwritten by their new episode.
            waking = self._over.copy()
            self._restart(np.flatnonzero(waking))
            terms[waking], phases[waking], terminated[waking], truncated[waking] = 0.0, 0.0, False, False
        self._over = terminated | truncated
        if self.autoreset_mode is AutoresetMode.SAME_STEP and self._over.any():
            extra = self._final(terms, phases)
            self._restart(np.flatnonzero(self._over))
        observation = self._observe()
        # Added up as the single environment adds its terms.
        reward = sum(terms[:, i] for i in range(terms.shape[1]))
        if extra:
            terms, phases = terms.copy(), phases.copy()
            terms[self._over], phases[self._over] = 0.0, 0.0
        info = self._info(terms, phases, np.ones(self.num_envs, bool)) | extra
        return observation, np.asarray(reward), terminated, truncated, info

    def action_masks(self) -> NDArray[np.bool_]:
        """Which actions are possible now, bool (num_envs, n)."""
        return self._mask.astype(bool)

    @property
    def np_random_seed(self) -> tuple[int, ...]:  # type: ignore[override]
        """The seed of every world, -1 before its first reset."""
        return tuple(self._seeds)

    @property
    def np_random(self) -> tuple[np.random.Generator | None, ...]:  # type: ignore[override]
        """The generator of every world, None before its first reset."""
        return tuple(self._generators)

    def close_extras(self, **kwargs: Any) -> None:
        """Free what the executor holds."""
        self.executor.close()

    def _restart(self, rows: NDArray[np.int64], fields: Any = None) -> None:
        generators = [g for g in (self._generators[row] for row in rows) if g is not None]
        if fields is None:
            self.core.reset_rows(rows, generators)
        else:
            if isinstance(fields, str) or not isinstance(fields, Sequence) or len(fields) != len(rows):
                raise ValueError(f"fields must be a list of {len(rows)} fields or files, one a world that is reset")
            pairs = zip(fields, generators, strict=True)
            whole = [completed(self.core, field, generator) for field, generator in pairs]
            self.core.load(rows, self.core.stack(whole))
        self.executor.reset_rows(rows)

    def _observe(self) -> Observation:
        observation = self.core.observe()
        self._mask = observation["action_mask"].copy()
        return observation

    def _info(self, terms: Array, phases: Array, present: NDArray[np.bool_]) -> dict[str, Any]:
        core = self.core
        parts = {
            "rewards": self._columns(core.reward_names, terms, present),
            "phases_s": self._columns(core.phase_names, phases, present),
            "scorecard": self._columns(core.score_names, core.scores(), present),
        }
        info: dict[str, Any] = {"action_mask": self._mask.copy(), "_action_mask": present.copy()}
        for name, part in parts.items():
            info[name], info["_" + name] = part, present.copy()
        return info

    def _final(self, terms: Array, phases: Array) -> dict[str, Any]:
        """The last observation and info of the worlds that end now, in Gymnasium's layout."""
        batch = self._observe()
        last = np.full(self.num_envs, None, object)
        for row in np.flatnonzero(self._over):
            last[row] = {name: values[row].copy() for name, values in batch.items()}
        return {
            "final_obs": last,
            "_final_obs": self._over.copy(),
            "final_info": self._info(terms, phases, self._over),
            "_final_info": self._over.copy(),
        }

    def _columns(self, names: Sequence[str], values: Array, present: NDArray[np.bool_]) -> dict[str, Any]:
        columns: dict[str, Any] = {}
        for i, name in enumerate(names):
            columns[name] = np.where(present, values[:, i], 0.0)
            columns["_" + name] = present.copy()
        return columns

    def _checked(self, actions: Any) -> NDArray[np.int64]:
        n = int(self.core.action_space.n)
        numbers = np.asarray(actions)
        if numbers.shape != (self.num_envs,) or numbers.dtype.kind not in "iu":
            raise ValueError(
                f"actions are {numbers.dtype} of shape {numbers.shape}: give {self.num_envs} integers in 0..{n - 1}"
            )
        if numbers.min() < 0 or numbers.max() >= n:
            bad = int(np.flatnonzero((numbers < 0) | (numbers >= n))[0])
            raise ValueError(f"action {int(numbers[bad])} of world {bad}: allowed range 0..{n - 1}")
        return numbers.astype(np.int64)


def _batched(parts: Assembly[Any], backend: str, perception: str | None, render_mode: str | None) -> str:
    """Perception of a batch, once it is clear that what was asked for can be batched.

    Raises:
        ValueError: an argument is unknown, or needs a machine, a camera or a picture a world.
    """
    if choice("backend", backend, BACKENDS) != "analytic":
        raise ValueError("backend = 'pybullet' is not batched: pass vectorization_mode=\"async\" to gym.make_vec")
    chosen = choice("perception", perception or parts.default_perception(backend), parts.perceptions)
    if chosen == "camera":
        raise ValueError('perception = \'camera\' is not batched: use "model", or vectorization_mode="async"')
    if render_mode is not None:
        raise ValueError(f"render_mode = {render_mode!r}: the batched environment draws nothing, use None")
    return chosen
