"""What Gymnasium's own tests ask of vector environments, asked of every id's own batch and of both of Gymnasium's."""

import copy
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.spaces import Dict, MultiDiscrete
from gymnasium.utils.env_checker import data_equivalence
from gymnasium.vector import AsyncVectorEnv, AutoresetMode, SyncVectorEnv, VectorEnv, VectorWrapper
from gymnasium.wrappers import vector as around

from fieldgym import env_ids
from fieldgym.envs.vector import TaskVectorEnv

OWN = tuple(env_id for env_id in env_ids() if env_id.startswith("fieldgym/"))
BACKENDS = ("analytic", "pybullet")
EQUIPPED = [(env_id, backend) for env_id in OWN for backend in BACKENDS]
KINDS = {"vector_entry_point": TaskVectorEnv, "sync": SyncVectorEnv, "async": AsyncVectorEnv}
MODES = list(AutoresetMode)
WORLDS = 3
SLOW = pytest.mark.slow
EVERYWHERE: list[Any] = [(env_id, "analytic", kind) for env_id in OWN for kind in KINDS]
EVERYWHERE += [(env_id, "pybullet", "sync") for env_id in OWN]
# Every process starts an engine, which takes seconds: one machine of arms and one of sliders stand for all.
IN_PROCESSES = [env_id for env_id in OWN if "Picking" in env_id or "Hoe" in env_id]
EVERYWHERE += [pytest.param(env_id, "pybullet", "async", marks=SLOW) for env_id in IN_PROCESSES]
everywhere = pytest.mark.parametrize(("env_id", "backend", "kind"), EVERYWHERE)


def worlds_of(env_id: str, kind: str, mode: Any = AutoresetMode.NEXT_STEP, worlds: int = WORLDS, **kwargs: Any) -> Any:
    """Worlds that see everything as it is, on the analytic backend where nothing else is said."""
    given = {"backend": "analytic", "perception": "perfect", **kwargs}
    if "Weeding" in env_id:
        given["overrides"] = {"scenario.strip_m": 1.0}  # a bed whose end is reached within the test
    if kind == "vector_entry_point":
        return gym.make_vec(env_id, worlds, kind, autoreset_mode=mode, **given)
    of_the_batch = {"autoreset_mode": mode} | ({"context": given.pop("context")} if "context" in given else {})
    return gym.make_vec(env_id, worlds, kind, of_the_batch, **given)


def chosen(masks: Any, rng: np.random.Generator, hurry: float = 0.7) -> np.ndarray:
    """A legal action a world, mostly the last one, which goes on and so soon ends an episode."""
    actions = []
    for mask in masks:
        legal = np.flatnonzero(mask)
        actions.append(int(legal[-1] if rng.random() < hurry else rng.choice(legal)))
    return np.array(actions)


@everywhere
def test_a_batch_of_every_kind_is_what_it_says(env_id, backend, kind):
    """Spaces, shapes, types and seeds of a reset and of a step, the numbers of worlds, and its specification."""
    env = worlds_of(env_id, kind, worlds=WORLDS, backend=backend)
    assert isinstance(env, KINDS[kind]) and env.num_envs == WORLDS and env.render_mode is None
    assert isinstance(env.observation_space, Dict) and isinstance(env.action_space, MultiDiscrete)
    assert env.metadata["autoreset_mode"] is AutoresetMode.NEXT_STEP
    observation, info = env.reset(seed=42)
    assert env.np_random_seed == (42, 43, 44)
    for turn in range(2):
        assert observation in env.observation_space
        for name, values in observation.items():
            assert values.dtype == env.observation_space[name].dtype and values.shape[0] == WORLDS
            assert values.shape[1:] == env.single_observation_space[name].shape
        assert isinstance(info, dict) and np.array_equal(info["action_mask"], observation["action_mask"])
        if turn:
            break
        observation, reward, terminated, truncated, info = env.step(
            chosen(observation["action_mask"], np.random.default_rng(0))
        )
        assert reward.dtype == np.float64 and terminated.dtype == truncated.dtype == np.bool_
        assert reward.shape == terminated.shape == truncated.shape == (WORLDS,)
    env.reset()
    assert env.np_random_seed == (42, 43, 44)
    env.close()
    env.close()


@everywhere
def test_a_specification_of_a_batch_makes_it_again(env_id, backend, kind):
    env = worlds_of(env_id, kind, AutoresetMode.SAME_STEP, worlds=2, backend=backend)
    again: Any = gym.make_vec(env.spec)
    assert again.spec == env.spec and type(again) is type(env) and again.num_envs == env.num_envs
    for name in ("observation_space", "single_observation_space", "action_space", "single_action_space", "render_mode"):
        assert getattr(again, name) == getattr(env, name)
    assert again.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert data_equivalence(again.reset(seed=3), env.reset(seed=3), exact=True)
    again.close()
    env.close()


@pytest.mark.parametrize("env_id", OWN)
def test_without_a_word_the_batch_is_the_task_s_own(env_id):
    for worlds in (1, 4):
        env: Any = gym.make_vec(env_id, worlds)
        assert isinstance(env, TaskVectorEnv) and env.num_envs == worlds
        env.close()
    for kind in ("invalid", 123):
        with pytest.raises(ValueError, match="Invalid vectorization mode"):
            gym.make_vec(env_id, vectorization_mode=kind)  # type: ignore[arg-type]
    assert gym.make(env_id, backend="analytic").metadata.keys() == {"render_modes", "render_fps"}


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(
    ("env_id", "backend"),
    [(env_id, "analytic") for env_id in OWN]
    + [pytest.param(env_id, "pybullet", marks=SLOW) for env_id in IN_PROCESSES],
)
def test_kinds_of_batches_give_the_same(env_id, backend, mode):
    """Observations, rewards, ends and infos, through the ends of episodes, with the worlds in one process or in many.

    The batch of a task has no faults of machines to tell of, since it moves none, and is asked where that is all.
    """
    machine = backend == "pybullet"
    kinds = ("sync", "async") if machine else tuple(KINDS)
    envs = [worlds_of(env_id, kind, mode, backend=backend) for kind in kinds]
    rng, ended = np.random.default_rng(1), 0
    seen = [env.reset(seed=5) for env in envs]
    for _ in range(12 if machine else 150):
        actions = chosen(seen[0][0]["action_mask"], rng)
        steps = [env.step(actions) for env in envs]
        same(steps)
        seen = [(step[0], step[4]) for step in steps]
        over = steps[0][2] | steps[0][3]
        ended += int(over.sum())
        if mode is AutoresetMode.SAME_STEP and over.any():
            final = steps[0][4]["final_info"]
            assert not final["action_mask"][~over].any() and np.array_equal(final["_action_mask"], over)
            assert [last is not None for last in steps[0][4]["final_obs"]] == over.tolist()
        if mode is AutoresetMode.DISABLED and over.any():
            seen = [env.reset(options={"reset_mask": over.copy()}) for env in envs]
            same(seen)
    assert ended or machine
    for env in envs:
        env.close()


def same(answers: list[tuple[Any, ...]]) -> None:
    """All say the same, but for the fault that only environments with a machine have a word for."""
    first = without_faults(answers[0])
    for other in answers[1:]:
        assert data_equivalence(first, without_faults(other), exact=True)


def without_faults(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: without_faults(part) for key, part in value.items() if key not in ("fault", "_fault")}
    return tuple(without_faults(part) for part in value) if isinstance(value, tuple) else value


@everywhere
def test_a_reset_of_some_worlds_leaves_the_others_alone(env_id, backend, kind):
    env = worlds_of(env_id, kind, AutoresetMode.DISABLED, backend=backend)
    first, _ = env.reset(seed=[0, 1, 2])
    rng = np.random.default_rng(2)
    observation = first
    for _ in range(3):
        observation, *_ = env.step(chosen(observation["action_mask"], rng, hurry=0.0))
    again, _ = env.reset(seed=[0, 1, 0], options={"reset_mask": np.array([True, True, False])})
    for name, values in again.items():
        assert np.array_equal(values[:2], first[name][:2]) and np.array_equal(values[2], observation[name][2])
    refused = ([True], [True, True, False, False], [[True] * 3], [False] * 3, [1, 1, 0], [1.0, 1.0, 0.0])
    for mask in refused:
        with pytest.raises((ValueError, TypeError), match="reset_mask"):
            env.reset(options={"reset_mask": np.array(mask)})
        if kind == "async":
            break  # its worlds are shut down by the first error
    env.close(**({"terminate": True} if kind == "async" else {}))


@pytest.mark.parametrize("env_id", OWN)
@pytest.mark.parametrize("kind", ["vector_entry_point", "sync"])
def test_one_action_a_world_no_more_and_no_less(env_id, kind):
    env = worlds_of(env_id, kind, AutoresetMode.DISABLED)
    env.reset(seed=0)
    actions = chosen(env.call("action_masks"), np.random.default_rng(0))
    for wrong in (actions[:-1], np.concatenate([actions, actions[:1]]), 0):
        with pytest.raises((ValueError, TypeError)):
            env.step(wrong)
    for right in (actions, actions.tolist(), tuple(actions.tolist())):
        env.step(right)
        env.reset(seed=0)
    env.close()


@everywhere
def test_worlds_are_asked_and_told_by_name(env_id, backend, kind):
    env = worlds_of(env_id, kind, backend=backend)
    env.reset(seed=0)
    assert env.call("scenario") == env.get_attr("scenario") and len(set(env.call("scenario"))) == 1
    assert env.call("backend") == (backend,) * WORLDS
    masks = env.call("action_masks")
    assert isinstance(masks, tuple) and [mask.shape for mask in masks] == [(int(env.single_action_space.n),)] * WORLDS
    env.set_attr("gravity", [9.81, 3.72, 8.87])
    assert env.get_attr("gravity") == (9.81, 3.72, 8.87)
    env.set_attr("gravity", 1.62)
    assert env.call("gravity") == (1.62,) * WORLDS
    env.close()


@pytest.mark.parametrize("env_id", OWN)
def test_equally_seeded_batches_draw_equal_actions(env_id):
    first, second = (worlds_of(env_id, "vector_entry_point") for _ in range(2))
    for env in (first, second):
        env.action_space.seed(123)
    drawn = [[env.action_space.sample() for _ in range(20)] for env in (first, second)]
    assert np.array_equal(drawn[0], drawn[1]) and np.std(drawn[0]) > 0.0
    assert all(action in first.action_space for action in drawn[0])


@pytest.mark.parametrize(("env_id", "backend"), EQUIPPED)
def test_a_batch_of_gymnasium_s_shows_a_picture_a_world(env_id, backend):
    env = worlds_of(env_id, "sync", worlds=2, backend=backend, render_mode="rgb_array", width=64)
    env.reset(seed=[1, 2])
    pictures = env.render()
    assert env.render_mode == "rgb_array" and isinstance(pictures, tuple) and len(pictures) == 2
    assert all(picture.shape[1:] == (64, 3) and picture.dtype == np.uint8 for picture in pictures)
    env.close()
    with pytest.raises(ValueError, match=r"^render_mode = 'human' is unknown: choose one of 'rgb_array'$"):
        gym.make_vec(env_id, 2, "vector_entry_point", render_mode="human")


@pytest.mark.parametrize("env_id", OWN)
def test_the_task_s_own_batch_shows_what_its_worlds_would_show_alone(env_id):
    """Before, within and after an episode, also of a copy, from the camera and of the size that were asked for."""
    asked: Any = {"render_mode": "rgb_array", "width": 48, "camera": "overview"}
    env: Any = worlds_of(env_id, "vector_entry_point", worlds=2, **asked)
    alone: Any = worlds_of(env_id, "sync", worlds=2, **asked)
    assert env.render_mode == "rgb_array" and env.metadata["render_modes"] == ["rgb_array"]
    assert env.metadata["render_fps"] == alone.envs[0].metadata["render_fps"]
    with pytest.raises(gym.error.ResetNeeded):
        env.render()
    observation, _ = env.reset(seed=[1, 2])
    alone.reset(seed=[1, 2])
    rng = np.random.default_rng(6)
    for batch in (env, copy.deepcopy(env)):
        for _ in range(2):
            assert all(map(np.array_equal, batch.render(), alone.render())) and batch.render()[0].shape[1:] == (48, 3)
            actions = chosen(observation["action_mask"], rng, hurry=0.0)
            observation, *_ = batch.step(actions)
            alone.step(actions)
        alone.reset(seed=[1, 2])
        observation = {"action_mask": alone.call("action_masks")}
    env.close()
    with pytest.raises(gym.error.ClosedEnvironmentError):
        env.render()
    unseen: Any = worlds_of(env_id, "vector_entry_point", worlds=2)
    unseen.reset(seed=0)
    assert unseen.render() is None
    unseen.close()
    alone.close()


COUNTED = [("vector_entry_point", mode) for mode in MODES]
COUNTED += [("sync", AutoresetMode.NEXT_STEP), ("sync", AutoresetMode.SAME_STEP)]


@pytest.mark.parametrize(("kind", "mode"), COUNTED)
@pytest.mark.parametrize("env_id", OWN)
def test_statistics_of_a_batch_are_the_sums_of_its_episodes(env_id, kind, mode):
    """Without autoreset only around the task's own: Gymnasium's takes the mask away before the wrapper sees it."""
    env: Any = around.RecordEpisodeStatistics(worlds_of(env_id, kind, mode))
    observation, _ = env.reset(seed=123)
    rng, counted = np.random.default_rng(3), 0
    totals, lengths, fresh = np.zeros(WORLDS), np.zeros(WORLDS, int), np.zeros(WORLDS, bool)
    for _ in range(200):
        observation, reward, terminated, truncated, info = env.step(chosen(observation["action_mask"], rng))
        totals, lengths = np.where(fresh, 0.0, totals + reward), np.where(fresh, 0, lengths + 1)
        over = terminated | truncated
        assert ("episode" in info) == bool(over.any())
        if over.any():
            counted += int(over.sum())
            assert info["episode"]["r"][over] == pytest.approx(totals[over], abs=1e-6)
            assert np.array_equal(info["episode"]["l"][over], lengths[over])
            if mode is AutoresetMode.DISABLED:
                observation, _ = env.reset(options={"reset_mask": over.copy()})
        fresh = over if mode is AutoresetMode.NEXT_STEP else np.zeros(WORLDS, bool)
        if mode is not AutoresetMode.NEXT_STEP:
            totals[over], lengths[over] = 0.0, 0
    assert counted == env.episode_count > 0
    env.close()


def flat(env: VectorEnv) -> Any:
    return around.FlattenObservation(env)


SHAPERS: list[Any] = [
    ("FilterObservation", {"filter_keys": ["machine", "action_mask"]}, AutoresetMode.NEXT_STEP),
    ("FlattenObservation", {}, AutoresetMode.NEXT_STEP),
    ("ClipReward", {"min_reward": -0.25, "max_reward": 0.5}, AutoresetMode.NEXT_STEP),
    ("ClipReward", {"min_reward": -0.25, "max_reward": 0.5}, AutoresetMode.SAME_STEP),
]
"""Wrappers of observations do not go around a batch that resets in the same step."""


@pytest.mark.parametrize(("name", "kwargs", "mode"), SHAPERS)
@pytest.mark.parametrize("env_id", OWN)
def test_a_wrapped_batch_is_a_batch_of_wrapped_worlds(env_id, name, kwargs, mode):
    """Around the task's own batch as around each world of Gymnasium's."""
    outside: Any = getattr(around, name)(worlds_of(env_id, "vector_entry_point", mode), **kwargs)
    inside = worlds_of(env_id, "sync", mode, wrappers=(lambda env: getattr(gym.wrappers, name)(env, **kwargs),))
    assert outside.observation_space == inside.observation_space and outside.action_space == inside.action_space
    assert outside.single_observation_space == inside.single_observation_space
    (here, info), (there, _) = outside.reset(seed=123), inside.reset(seed=123)
    assert data_equivalence(here, there, exact=True)
    rng = np.random.default_rng(4)
    for _ in range(60):
        actions = chosen(info["action_mask"], rng)
        first, second = outside.step(actions), inside.step(actions)
        same([first[:4], second[:4]])
        info = first[4]
    outside.close()
    inside.close()


@pytest.mark.parametrize("env_id", OWN)
def test_other_wrappers_go_around_a_batch(env_id):
    """Numbers are scaled, infos are lists, actions are turned round, and questions get through to the worlds."""

    class Counting(VectorWrapper):
        resets = 0

        def reset(self, **kwargs):
            self.resets += 1
            return super().reset(**kwargs)

    base = worlds_of(env_id, "vector_entry_point")
    actions = int(base.single_action_space.n)
    env: Any = Counting(around.NormalizeReward(around.NormalizeObservation(flat(base))))
    env = around.DictInfoToList(around.TransformAction(env, lambda chosen: actions - 1 - chosen))
    observation, infos = env.reset(seed=1)
    assert observation.shape == (WORLDS, *env.single_observation_space.shape)
    rng = np.random.default_rng(5)
    for _ in range(30):
        turned = actions - 1 - chosen([info["action_mask"] for info in infos], rng)
        observation, reward, _, _, infos = env.step(turned)
        assert np.isfinite(observation).all() and np.isfinite(reward).all() and len(infos) == WORLDS
    assert sum(info["scorecard"]["illegal"] for info in infos) == 0
    assert env.env.env.resets == 1 and env.metadata == base.metadata
    assert env.unwrapped.call("scenario") == base.call("scenario")
    with pytest.raises(TypeError):
        around.DictInfoToList(gym.make(env_id, backend="analytic"))  # type: ignore[arg-type]
    env.close()


@SLOW
@pytest.mark.parametrize(("env_id", "backend"), [(env_id, backend) for env_id in IN_PROCESSES for backend in BACKENDS])
def test_worlds_live_in_processes_that_begin_from_nothing(env_id, backend):
    """Forked ones are what the other tests have."""
    env = worlds_of(env_id, "async", worlds=2, backend=backend, context="spawn")
    twin = worlds_of(env_id, "sync", worlds=2, backend=backend)
    (here, _), (there, _) = env.reset(seed=9), twin.reset(seed=9)
    assert data_equivalence(here, there, exact=True)
    actions = chosen(here["action_mask"], np.random.default_rng(0))
    same([env.step(actions)[:4], twin.step(actions)[:4]])
    env.close()
    twin.close()
