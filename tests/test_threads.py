"""Worlds that are stepped by several threads are, bit for bit, those that one thread steps."""

import copy
import gc
import os
import pickle
import signal
import threading
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from fieldgym.envs import env_ids

IDS = env_ids()
SHORT: dict[str, dict[str, Any]] = {
    "fieldgym/SafflowerPicking-v0": {"scenario.time_limit_s": 40.0},
    "fieldgym/TrayTransplanting-v0": {"scenario.time_limit_s": 20.0},
    "fieldgym/ProduceSorting-v0": {"scenario.time_limit_s": 12.0},
}
"""Time limits within some steps, but for the weeders'."""


def batch(env_id: str, threads: int, worlds: int = 5, mode: str = "NEXT_STEP", **settings: Any) -> Any:
    return gym.make_vec(
        env_id,
        num_envs=worlds,
        vectorization_mode="vector_entry_point",
        threads=threads,
        autoreset_mode=AutoresetMode[mode],
        overrides=SHORT.get(env_id, {"cart.time_factor": 0.15}),
        **settings,
    )


def flat(value: Any) -> Any:
    """A value that can be compared: arrays as bytes, whatever holds them as lists."""
    if isinstance(value, dict):
        return [(name, flat(part)) for name, part in value.items()]
    if isinstance(value, list | tuple):
        return [flat(part) for part in value]
    array = np.asarray(value)
    if array.dtype == object and array.ndim:
        return [flat(part) for part in array]
    return str(array.dtype), array.tobytes()


def steps(env: Any, number: int, seed: int = 0) -> list[Any]:
    """All that steps with random legal actions give."""
    rng, told = np.random.default_rng(seed), []
    for _ in range(number):
        masks = env.action_masks()
        told.append(flat(env.step(np.array([rng.choice(np.flatnonzero(mask)) for mask in masks]))))
    return told


@pytest.mark.parametrize("mode", ["NEXT_STEP", "SAME_STEP", "DISABLED"])
@pytest.mark.parametrize("env_id", IDS)
def test_numbers_do_not_depend_on_threads(env_id: str, mode: str) -> None:
    told = []
    for threads in (1, 2, 5):
        env = batch(env_id, threads, mode=mode)
        began = flat(env.reset(seed=3))
        told.append([began, *steps(env, 60), flat(env.core.state.totals), flat([g.random() for g in env.np_random])])
        if threads == 1:
            episodes = int(env.core.episode.sum())
            assert mode == "DISABLED" or episodes > 5, "no episode ended"
        env.close()
    assert told[0] == told[1] == told[2]


def test_resets_by_mask_and_with_fields() -> None:
    told = []
    for threads in (1, 2, 3):
        env = batch(IDS[0], threads, worlds=4, mode="DISABLED")
        parts = [flat(env.reset(seed=[7, 5, 3, 1])), *steps(env, 10)]
        some = np.array([True, False, True, True])
        parts += [flat(env.reset(options={"reset_mask": some})), *steps(env, 5)]
        fields = [env.core.draw_field(np.random.default_rng(i)) for i in range(3)]
        parts += [flat(env.reset(options={"reset_mask": some, "fields": fields})), *steps(env, 5)]
        told.append(parts)
        env.close()
    assert told[0] == told[1] == told[2]


def test_states_and_copies() -> None:
    one, two = batch(IDS[0], 1), batch(IDS[0], 2)
    for env in (one, two):
        env.reset(seed=4)
        steps(env, 12)
    state = two.get_state()
    later = steps(two, 30, seed=9)
    one.set_state(state)
    assert steps(one, 30, seed=9) == later
    two.set_state(state)
    twin, thawed = copy.deepcopy(two), pickle.loads(pickle.dumps(two))
    assert steps(twin, 30, seed=9) == later == steps(two, 30, seed=9) == steps(thawed, 30, seed=9)
    for env in (one, two, twin, thawed):
        env.close()


def test_an_error_in_a_thread_is_raised_when_all_are_through(monkeypatch: pytest.MonkeyPatch) -> None:
    env = batch(IDS[0], 3)
    env.reset(seed=0)
    shares = env._team._shared()

    def fails(*_: Any) -> Any:
        raise OSError("no more")

    monkeypatch.setattr(shares[2][0], "decide", fails)
    with pytest.raises(OSError, match="no more"):
        env.step(np.zeros(5, np.int64))
    env.close()


def test_threads_end_with_the_environment() -> None:
    env = batch(IDS[0], 3)
    env.reset(seed=0)
    ours = [thread for thread in threading.enumerate() if thread.name.startswith("fieldgym-worlds")]
    assert ours
    env.close()
    env.close()
    assert not any(thread.is_alive() for thread in ours)


def test_threads_of_a_batch_that_is_dropped_end() -> None:
    env = batch(IDS[0], 2)
    env.reset(seed=0)
    (worker,) = env._team._workers
    del env
    gc.collect()
    worker.join()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
@pytest.mark.filterwarnings("ignore:This process:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own() -> None:
    env = batch(IDS[0], 2)
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    actions = np.array([rng.choice(np.flatnonzero(mask)) for mask in env.action_masks()])
    child = os.fork()
    if child == 0:
        signal.alarm(60)  # who asks threads that are not there waits for ever
        env.step(actions)
        os._exit(int(env._team._made_in != os.getpid()))
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0
    env.close()


@pytest.mark.parametrize("threads", [0, -1, 6, 1.5, True, "2"])
def test_odd_threads_are_refused_in_one_line(threads: Any) -> None:
    with pytest.raises(ValueError, match=r"threads = .*1\.\.5") as told:
        batch(IDS[0], threads)
    assert "\n" not in str(told.value)


def test_cameras_and_threads_are_refused() -> None:
    with pytest.raises(ValueError, match="threads = 2: worlds that are drawn"):
        batch(IDS[0], 2, perception="camera")
