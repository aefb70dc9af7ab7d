"""The native vector environment as Stable-Baselines3 wants it, without a Python loop over the worlds.

``MaskablePPO("MultiInputPolicy", make_vec_env("fieldgym/SafflowerPicking-v0", 256), n_steps=64, batch_size=4096)``
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from stable_baselines3.common.vec_env import VecEnv

from ...envs.vector import TaskVectorEnv

Observation = dict[str, NDArray[Any]]


def make_vec_env(
    env_id: str,
    num_envs: int = 1,
    seed: int | None = None,
    *,
    time_limit_ends: bool = False,
    reward_scale: float = 1.0,
    **kwargs: Any,
) -> NativeVecEnv:
    """Make ``num_envs`` worlds of an environment as one SB3 ``VecEnv``, analytic backend.

    Args:
        env_id: a registered id.
        num_envs: worlds in the batch.
        seed: world i starts with ``seed + i`` at the first reset and draws on from there; None: from the system.
        time_limit_ends: report an episode that ran out of time as ended, not as ``TimeLimit.truncated``. SB3 adds the
            value of what would have come later to truncated episodes; the tasks here are scored at their time limit
            and show the time in the observation, so nothing comes later.
        reward_scale: learners see the reward times this; the monitors' ``episode`` info stays unscaled.
        **kwargs: of the environment (``scenario``, ``perception``, ...).

    Raises:
        ValueError: an argument is out of range.
    """
    if num_envs < 1:
        raise ValueError(f"num_envs = {num_envs}: give at least 1 world")
    env = gym.make_vec(
        env_id, num_envs, vectorization_mode="vector_entry_point", autoreset_mode=AutoresetMode.SAME_STEP, **kwargs
    )
    return NativeVecEnv(env, seed, time_limit_ends=time_limit_ends, reward_scale=reward_scale)


class NativeVecEnv(VecEnv):
    """SB3's interface over a ``TaskVectorEnv`` that resets in the same step.

    The info of a world is empty until its episode ends; then it holds ``terminal_observation``,
    ``TimeLimit.truncated``, ``scorecard`` and ``episode`` (return ``r``, decisions ``l``, wall seconds ``t``) as
    ``Monitor`` would write it.

    Attributes:
        native: the environment underneath.
        step_wall_s: wall seconds spent in ``step`` and ``reset`` so far.
    """

    def __init__(
        self,
        env: gym.vector.VectorEnv[Any, Any, Any],
        seed: int | None = None,
        *,
        time_limit_ends: bool = False,
        reward_scale: float = 1.0,
    ):
        """Wrap ``env``.

        Raises:
            TypeError: not one of this package's vector environments.
            ValueError: its autoreset mode is not ``SAME_STEP``, or ``reward_scale`` is not positive.
        """
        native = env.unwrapped
        if not isinstance(native, TaskVectorEnv):
            raise TypeError(f"{type(native).__name__} is no native vector environment of fieldgym")
        if native.autoreset_mode is not AutoresetMode.SAME_STEP:
            raise ValueError(f"autoreset_mode = {native.autoreset_mode.value!r}: make it with 'SameStep'")
        if not reward_scale > 0.0:
            raise ValueError(f"reward_scale = {reward_scale} must be positive")
        self.native: TaskVectorEnv[Any, Any] = native
        super().__init__(native.num_envs, native.single_observation_space, native.single_action_space)
        self.time_limit_ends, self.reward_scale = time_limit_ends, reward_scale
        self.returns, self.lengths = np.zeros(self.num_envs), np.zeros(self.num_envs, np.int64)
        self.step_wall_s = 0.0
        self._started = time.perf_counter()
        self._actions = np.zeros(self.num_envs, np.int64)
        if seed is not None:
            self.seed(seed)

    def reset(self) -> Observation:
        """Start new episodes in every world, with the seeds of ``seed`` if it was called."""
        began = time.perf_counter()
        observation, info = self.native.reset(seed=self._seeds)
        self.returns[:], self.lengths[:] = 0.0, 0
        self._reset_seeds()
        self._reset_options()
        self.reset_infos = [{"action_mask": mask} for mask in info["action_mask"]]
        self.step_wall_s += time.perf_counter() - began
        return observation

    def step_async(self, actions: np.ndarray) -> None:
        """Keep the actions (num_envs,) for ``step_wait``."""
        self._actions = np.asarray(actions).reshape(self.num_envs)

    def step_wait(self) -> tuple[Observation, NDArray[np.float32], NDArray[np.bool_], list[dict[str, Any]]]:
        """Carry the actions out in every world."""
        began = time.perf_counter()
        observation, reward, terminated, truncated, info = self.native.step(self._actions)
        done = terminated | truncated
        self.returns += reward
        self.lengths += 1
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        ended = np.flatnonzero(done)
        if len(ended):
            scores = info["final_info"]["scorecard"]
            wall_s = round(time.perf_counter() - self._started, 6)
            for row in ended.tolist():
                card = {name: float(scores[name][row]) for name in self.native.core.score_names}
                infos[row] = {
                    "terminal_observation": info["final_obs"][row],
                    "TimeLimit.truncated": bool(truncated[row] and not terminated[row]) and not self.time_limit_ends,
                    "episode": {"r": float(self.returns[row]), "l": int(self.lengths[row]), "t": wall_s},
                    "scorecard": card,
                }
            self.returns[ended], self.lengths[ended] = 0.0, 0
        self.step_wall_s += time.perf_counter() - began
        return observation, (reward * self.reward_scale).astype(np.float32), done, infos

    def action_masks(self) -> NDArray[np.bool_]:
        """Which actions are possible now, bool (num_envs, n)."""
        return self.native.action_masks()

    def has_attr(self, attr_name: str) -> bool:
        """Whether every world has the attribute; MaskablePPO asks for ``action_masks``."""
        return hasattr(self, attr_name) or hasattr(self.native, attr_name)

    def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
        """An attribute of the native environment, once a world; its worlds share it.

        Raises:
            AttributeError: it has none of this name.
        """
        if attr_name == "action_masks":
            return [self._mask_of(row) for row in self._rows(indices)]
        return [getattr(self.native, attr_name)] * len(self._rows(indices))

    def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
        """Set an attribute of the native environment.

        Raises:
            ValueError: not for all worlds: they share it.
        """
        if len(self._rows(indices)) != self.num_envs:
            raise ValueError(f"{attr_name}: the worlds of a native environment share their attributes, set it for all")
        setattr(self.native, attr_name, value)

    def env_method(self, method_name: str, *method_args: Any, indices: Any = None, **method_kwargs: Any) -> list[Any]:
        """``action_masks`` of the worlds, one (n,) each; other methods of single environments there are none here.

        Raises:
            AttributeError: another method than ``action_masks``.
        """
        if method_name != "action_masks":
            raise AttributeError(f"{method_name!r}: the worlds of a native environment have only 'action_masks'")
        masks = self.native.action_masks()
        return list(masks if indices is None else masks[self._rows(indices)])

    def env_is_wrapped(self, wrapper_class: type[gym.Wrapper[Any, Any, Any, Any]], indices: Any = None) -> list[bool]:
        """True for ``Monitor``, whose ``episode`` info is written here, else False."""
        from stable_baselines3.common.monitor import Monitor

        return [issubclass(wrapper_class, Monitor)] * len(self._rows(indices))

    def get_images(self) -> Sequence[np.ndarray | None]:
        """Nothing is drawn in a batch."""
        return [None] * self.num_envs

    def close(self) -> None:
        """Free the environment; idempotent."""
        self.native.close()

    def _mask_of(self, row: int) -> Any:
        return lambda: self.native.action_masks()[row]

    def _rows(self, indices: int | Iterable[int] | None) -> list[int]:
        return list(self._get_indices(indices))
