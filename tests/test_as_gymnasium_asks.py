"""What Gymnasium's own tests ask of its environments, asked of every id on both backends; batches in the file beside.

The demands are those of ``tests/envs``, ``tests/utils`` and ``tests/wrappers`` in Gymnasium's repository;
``scripts/gymnasium_tests.py`` runs that repository's own files over these ids.
"""

import pickle
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec, WrapperSpec
from gymnasium.utils.env_checker import check_env, data_equivalence
from gymnasium.wrappers import (
    FlattenObservation,
    HumanRendering,
    NormalizeReward,
    OrderEnforcing,
    PassiveEnvChecker,
    RecordEpisodeStatistics,
    RenderCollection,
    TimeAwareObservation,
    TimeLimit,
)
from twins import at_night

from fieldgym import env_ids

pytestmark = pytest.mark.portable

OWN = tuple(env_id for env_id in env_ids() if env_id.startswith("fieldgym/"))
BACKENDS = ("analytic", "pybullet")
EQUIPPED = [(env_id, backend) for env_id in OWN for backend in BACKENDS]
on_every_machine = pytest.mark.parametrize(("env_id", "backend"), EQUIPPED)
DECISIONS = 50
AT_LENGTH = [
    pytest.param(
        env_id,
        backend,
        marks=[pytest.mark.slow, *at_night(env_id)] * (backend == "pybullet"),
    )
    for env_id, backend in EQUIPPED
]
"""The same, where a machine with its cameras takes seconds."""


@contextmanager
def no_warnings() -> Iterator[None]:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        yield


def made(*args: Any, **kwargs: Any) -> Any:
    return gym.make(*args, **kwargs)


def wrappers_of(env: Any) -> list[type]:
    """The wrappers around an environment, the outermost first."""
    found = []
    while isinstance(env, gym.Wrapper):
        found.append(type(env))
        env = env.env
    return found


def same_steps(first: Any, second: Any, decisions: int, seed: int) -> None:
    """Two environments give the same, episode after episode, for actions of any kind."""
    assert data_equivalence(first.reset(seed=seed), second.reset(seed=seed), exact=True)
    first.action_space.seed(seed)
    for _ in range(decisions):
        action = first.action_space.sample()
        here, there = first.step(action), second.step(action)
        assert data_equivalence(here, there, exact=True)
        assert here[0] in first.observation_space
        if here[2] or here[3]:
            assert data_equivalence(first.reset(seed=seed), second.reset(seed=seed), exact=True)


@on_every_machine
def test_the_checker_finds_nothing_pictures_and_closing_included(env_id, backend, monkeypatch):
    """``check_env`` with all that it can check; what a window would show goes nowhere."""
    monkeypatch.setattr("fieldgym.simulation.window.Window.open", lambda self: None)
    monkeypatch.setattr("fieldgym.simulation.window.Window.show", lambda self, rgb: None)
    monkeypatch.setattr("fieldgym.envs.screen.time.sleep", lambda seconds: None)
    with no_warnings():
        env = made(env_id, backend=backend).unwrapped
        check_env(env)
        env.close()


@pytest.mark.parametrize(("env_id", "backend"), AT_LENGTH)
def test_the_passive_checker_watches_an_episode_without_a_word(env_id, backend):
    with no_warnings():
        env = made(env_id, backend=backend, max_episode_steps=DECISIONS)
        assert PassiveEnvChecker in wrappers_of(env) and OrderEnforcing in wrappers_of(env)
        env.reset()
        over = False
        while not over:
            *_, terminated, truncated, _ = env.step(env.action_space.sample())
            over = terminated or truncated
        env.close()


@pytest.mark.parametrize(("env_id", "backend"), AT_LENGTH)
def test_equal_environments_play_equal_episodes(env_id, backend):
    spec = gym.spec(env_id)
    assert not spec.nondeterministic
    first, second = (spec.make(backend=backend, disable_env_checker=True) for _ in range(2))
    same_steps(first, second, DECISIONS, seed=0)
    first.close()
    second.close()


@on_every_machine
def test_seeds_mean_the_same_and_none_goes_on(env_id, backend):
    """One seed is one episode, another one another; without one the chance goes on and is not begun anew."""
    env = made(env_id, backend=backend, perception="perfect")
    first, _ = env.reset(seed=123)
    after = env.unwrapped.np_random.bit_generator.state
    second, _ = env.reset()
    assert env.unwrapped.np_random_seed == 123
    again, _ = env.reset(seed=123)
    assert data_equivalence(first, again, exact=True) and env.unwrapped.np_random.bit_generator.state == after
    assert not data_equivalence(first, second, exact=True)
    assert data_equivalence(second, env.reset()[0], exact=True)
    assert not data_equivalence(first, env.reset(seed=124)[0], exact=True)
    env.close()


@on_every_machine
def test_a_pickled_stack_of_wrappers_is_another_environment(env_id, backend):
    env = NormalizeReward(gym.make(env_id, backend=backend, max_episode_steps=40), gamma=0.8)
    env.reset(seed=7)
    env.step(env.action_space.sample())
    copy = pickle.loads(pickle.dumps(env))
    same_steps(env, copy, 5, seed=123)
    env.close()
    copy.step(0)
    copy.close()


@pytest.mark.parametrize("env_id", OWN)
def test_nothing_is_drawn_that_nobody_asked_for(env_id):
    env = made(env_id, backend="analytic")
    env.reset(seed=0)
    assert env.render_mode is None
    env.step(env.action_space.sample())
    assert env.render() is None and env.unwrapped._view is None
    env.close()


@on_every_machine
def test_pictures_are_pictures(env_id, backend):
    env = made(env_id, backend=backend, render_mode="rgb_array", width=96)
    assert env.metadata["render_modes"] == ["human", "rgb_array"] and env.metadata["render_fps"] > 0
    env.reset(seed=0)
    first: Any = env.render()
    action = int(np.flatnonzero(env.unwrapped.action_masks())[0])
    env.step(action)
    second: Any = env.render()
    for picture in (first, second):
        assert isinstance(picture, np.ndarray) and picture.dtype == np.uint8
        assert picture.shape == first.shape and picture.shape[1:] == (96, 3) and picture.std() > 1.0
    assert np.array_equal(second, env.render()) and not np.shares_memory(second, env.render())
    env.close()


@on_every_machine
def test_a_list_of_pictures_has_one_a_decision(env_id, backend):
    env = made(env_id, backend=backend, render_mode="rgb_array_list", width=96)
    assert RenderCollection in wrappers_of(env)
    assert (env.render_mode, env.unwrapped.render_mode) == ("rgb_array_list", "rgb_array")
    env.reset(seed=0)
    for _ in range(2):
        env.step(env.action_space.sample())
    pictures: Any = env.render()
    assert isinstance(pictures, list) and [picture.shape[1:] for picture in pictures] == [(96, 3)] * 3
    assert env.render() == []
    env.close()


@on_every_machine
def test_people_see_what_a_window_shows(env_id, backend, monkeypatch):
    """The environment has a window of its own: Gymnasium's stays out, and ``render`` gives nothing."""
    shown: list[np.ndarray] = []
    monkeypatch.setattr("fieldgym.simulation.window.Window.open", lambda self: None)
    monkeypatch.setattr("fieldgym.simulation.window.Window.show", lambda self, rgb: shown.append(rgb))
    monkeypatch.setattr("fieldgym.envs.screen.time.sleep", lambda seconds: None)
    env = made(env_id, backend=backend, render_mode="human", width=96)
    assert env.render_mode == "human" and HumanRendering not in wrappers_of(env)
    env.reset(seed=0)
    assert len(shown) == 1
    env.step(int(np.flatnonzero(env.unwrapped.action_masks())[0]))
    assert len(shown) > 1 and {frame.shape[1:] for frame in shown} == {(96, 3)} and env.render() is None
    with pytest.raises(ValueError, match="but got 'human'"):
        HumanRendering(env)
    env.close()


@on_every_machine
def test_a_mode_that_there_is_not_is_refused(env_id, backend):
    with pytest.warns(UserWarning, match="not in the possible render_modes"):
        with pytest.raises(ValueError, match=r"^render_mode = 'ansi' is unknown: choose one of 'human', 'rgb_array'$"):
            gym.make(env_id, backend=backend, render_mode="ansi")


@on_every_machine
def test_an_id_and_its_specification_make_the_same(env_id, backend):
    by_id, by_spec = made(env_id, backend=backend), made(gym.spec(env_id), backend=backend)
    assert by_id.spec == by_spec.spec and type(by_id.unwrapped) is type(by_spec.unwrapped)
    assert by_id.spec is not None and by_id.spec.id == env_id and by_id.spec.kwargs == {"backend": backend}
    assert by_id.unwrapped.backend == backend
    assert gym.spec(env_id).kwargs == {}
    for env in (by_id, by_spec):
        env.close()
        env.close()


@on_every_machine
def test_a_stack_of_wrappers_is_made_again_from_its_specification(env_id, backend):
    """At every level, through JSON and through pickle, with the wrappers' arguments."""
    base = made(env_id, backend=backend, perception="perfect", render_mode="rgb_array", max_episode_steps=40)
    counting = RecordEpisodeStatistics(base, buffer_length=17, stats_key="sums")
    env: Any = NormalizeReward(TimeAwareObservation(FlattenObservation(counting)), gamma=0.8)
    level: Any = env
    while level is not level.unwrapped:
        told = level.spec.to_json()
        for spec in (level.spec, EnvSpec.from_json(told), pickle.loads(pickle.dumps(level.spec))):
            assert spec == level.spec
        again = made(EnvSpec.from_json(told))
        assert again.spec == level.spec and wrappers_of(again)[0] is type(level)
        assert again.unwrapped.backend == backend and again.observation_space == level.observation_space
        again.close()
        level = level.env
    names = ["RecordEpisodeStatistics", "FlattenObservation", "TimeAwareObservation", "NormalizeReward"]
    assert [wrapper.name for wrapper in env.spec.additional_wrappers] == names
    assert all(name in env.spec.pprint(disable_print=True) for name in (env_id, *names))
    again = made(env.spec)
    assert (again.gamma, again.get_wrapper_attr("_stats_key")) == (0.8, "sums") and again.render_mode == "rgb_array"
    same_steps(env, again, 5, seed=42)
    again.close()
    env.close()


class Unrecorded(gym.ObservationWrapper):
    """A wrapper of a caller's own that keeps no arguments."""

    def observation(self, observation):
        return observation


@on_every_machine
def test_a_wrapper_that_cannot_be_made_again_is_told(env_id, backend):
    env = Unrecorded(gym.make(env_id, backend=backend))
    assert env.spec is not None
    with pytest.raises(ValueError, match="Unrecorded wrapper does not inherit from"):
        gym.make(env.spec)
    env.close()


@on_every_machine
def test_wrappers_that_an_id_brings_along_are_there(env_id, backend):
    """Somebody's own id of one of these environments, with wrappers in its registration."""
    spec = gym.spec(env_id)
    clipped: Any = gym.wrappers.ClipReward.wrapper_spec(min_reward=-0.25, max_reward=0.5)
    gym.register(
        "somebody/Own-v0",
        entry_point=spec.entry_point,
        vector_entry_point=spec.vector_entry_point,
        kwargs={"backend": backend, "perception": "perfect"},
        additional_wrappers=(FlattenObservation.wrapper_spec(), clipped),
    )
    try:
        env = gym.make("somebody/Own-v0")
        assert isinstance(env, gym.wrappers.ClipReward) and isinstance(env.observation_space, gym.spaces.Box)
        assert env.spec is not None and isinstance(env.spec.additional_wrappers[1], WrapperSpec)
        same_steps(env, gym.make(EnvSpec.from_json(env.spec.to_json())), 5, seed=1)
        worlds: Any = gym.make_vec("somebody/Own-v0", 2, "sync")
        assert isinstance(worlds, gym.vector.SyncVectorEnv) and isinstance(worlds.envs[0], gym.wrappers.ClipReward)
        worlds.close()
        env.close()
    finally:
        del gym.registry["somebody/Own-v0"]


@on_every_machine
def test_a_limit_of_decisions_cuts_at_that_decision(env_id, backend):
    """Once, or twice around each other; ``-1`` leaves Gymnasium's limit away."""
    env = made(env_id, backend=backend, perception="perfect")
    assert env.spec is not None and env.spec.max_episode_steps is None and TimeLimit not in wrappers_of(env)
    env.close()
    limited: Any = (
        made(env_id, backend=backend, perception="perfect", max_episode_steps=4),
        TimeLimit(made(env_id, backend=backend, perception="perfect", max_episode_steps=9), 4),
    )
    for one in limited:
        assert one.spec.max_episode_steps == 4
        one.reset(seed=0)
        illegal = int(np.flatnonzero(~one.unwrapped.action_masks())[0])
        ends = [one.step(illegal)[2:4] for _ in range(4)]
        assert ends == [(False, False)] * 3 + [(False, True)]
        one.close()
    endless = gym.make(env_id, backend=backend, max_episode_steps=-1)
    assert endless.spec is not None and endless.spec.max_episode_steps is None
    endless.close()


@on_every_machine
def test_statistics_of_episodes_are_their_sums(env_id, backend):
    env = RecordEpisodeStatistics(gym.make(env_id, backend=backend, perception="perfect", max_episode_steps=6), 2)
    sums = []
    for seed in range(3):
        env.reset(seed=seed)
        total, length, over, info = 0.0, 0, False, {}
        while not over:
            assert "episode" not in info
            _, reward, terminated, truncated, info = env.step(env.action_space.sample())
            total, length, over = total + float(reward), length + 1, terminated or truncated
        assert info["episode"]["r"] == pytest.approx(total, abs=1e-6) and info["episode"]["l"] == length
        sums.append(info["episode"]["r"])
    assert list(env.return_queue) == sums[1:] and len(env.length_queue) == 2
    env.close()
