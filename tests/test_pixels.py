"""Pictures as observations: what checkers say, batch and single, states, and what the pictures show."""

from __future__ import annotations

import copy
import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from fieldgym.envs.task import tasks
from fieldgym.testing import check_batch

IDS = [spec.id for spec in tasks() if spec.id.startswith("fieldgym/")]
SMALL: dict[str, Any] = {"pixel_rows": 48}


def made(env_id: str, **kwargs: Any) -> Any:
    return gym.make(env_id, **{"backend": "analytic", "observation": "pixels", **SMALL, **quick(env_id), **kwargs})


def quick(env_id: str) -> dict[str, str]:
    """The weeders' pictures that take least time."""
    return {"pictures": "easy"} if "Weeding" in env_id else {}


def legal(mask: Any, rng: np.random.Generator) -> int:
    return int(rng.choice(np.flatnonzero(mask)))


@pytest.mark.parametrize("env_id", IDS)
def test_checkers_have_nothing_to_say(env_id):
    env_checker = pytest.importorskip("stable_baselines3.common.env_checker")
    for more in ({}, {"observation": "both", "depth": True}):
        env = made(env_id, **more)
        assert env.spec.to_json()
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            check_env(env.unwrapped, skip_render_check=True)
            env_checker.check_env(env, warn=True, skip_render_check=True)
        names = {"action_mask", "machine", "pixels", "slots"} | ({"candidates", "depth"} if more else set())
        assert set(env.observation_space.spaces) == names
        env.close()


@pytest.mark.parametrize("mode", ["NextStep", "SameStep"])
@pytest.mark.parametrize("env_id", IDS)
def test_a_batch_draws_what_single_environments_draw(env_id, mode):
    scenario = next(spec.headline for spec in tasks() if spec.id == env_id)
    check_batch(
        env_id, scenario, mode, worlds=2, decisions=30, observation="both", depth=True, **quick(env_id), **SMALL
    )


def test_worlds_that_rest_go_on_showing_their_last_picture():
    shared = {"overrides": {"scenario.time_limit_s": 4.0}, "observation": "pixels", **SMALL}
    env = gym.make_vec(
        "fieldgym/TrayTransplanting-v0",
        num_envs=2,
        vectorization_mode="vector_entry_point",
        autoreset_mode="Disabled",
        **shared,
    )
    observation, _ = env.reset(seed=0)
    over, last = np.zeros(2, bool), {}
    for _ in range(40):
        before = over
        observation, _, ended, cut, _ = env.step(np.array([np.flatnonzero(m)[0] for m in observation["action_mask"]]))
        over = ended | cut
        for row in np.flatnonzero(over).tolist():
            now = observation["pixels"][row]
            assert now.any()
            assert not before[row] or np.array_equal(now, last[row])
            last[row] = now.copy()
    assert over.all()


@pytest.mark.parametrize("env_id", IDS)
def test_pictures_follow_from_the_state_alone(env_id):
    env, other = made(env_id).unwrapped, made(env_id).unwrapped
    rng = np.random.default_rng(1)
    observation, info = env.reset(seed=4)
    for _ in range(25):
        observation, _, ended, cut, info = env.step(legal(info["action_mask"], rng))
        if ended or cut:
            break
    other.reset(seed=9)
    for twin in (other, copy.deepcopy(env)):
        again, _ = twin.set_state(env.get_state())
        for name, values in observation.items():
            np.testing.assert_array_equal(again[name], values, err_msg=name)


@pytest.mark.parametrize(
    ("env_id", "colour"),
    [
        # Filaments are red and not green; weeds greener than soil; produce is warmer than the blue belt.
        ("fieldgym/SafflowerPicking-v0", lambda r, g, b: (r > g + 30).mean() > 0.7),
        ("fieldgym/LaserWeeding-v0", lambda r, g, b: (g > r).mean() > 0.06),
        ("fieldgym/HoeWeeding-v0", lambda r, g, b: (g > r).mean() > 0.06),
        ("fieldgym/ProduceSorting-v0", lambda r, g, b: (np.maximum(r, g) > b + 20).mean() > 0.9),
    ],
)
def test_marks_lie_on_their_candidates(env_id, colour):
    env = made(env_id, observation="both", perception="perfect", pixel_rows=128).unwrapped
    rng, hits, marks = np.random.default_rng(2), 0, 0
    observation, info = env.reset(seed=1)
    for _ in range(60):
        table = observation["candidates"].reshape(-1, len(env.core.candidate_features))
        for slot in np.flatnonzero(table[:, 0]).tolist():
            here = observation["slots"][:, :, 0] == slot + 1
            if np.count_nonzero(here) > 30:
                marks += 1
                hits += bool(colour(*observation["pixels"][here].astype(int).T))
        observation, _, ended, cut, info = env.step(legal(info["action_mask"], rng))
        if ended or cut:
            observation, info = env.reset()
    assert marks > 40
    assert hits >= 0.85 * marks


def test_marks_of_a_pair_are_its_two_cells():
    env = made("fieldgym/TrayTransplanting-v0", observation="both", perception="perfect", pixel_rows=128).unwrapped
    core, green = env.core, {True: [], False: []}
    marks = env.view.slot_marks()
    n, m = core.source_shape[1], core.target_shape[1]
    assert marks.tolist() == [[place + 1 for place in core.cells_of_pair(pair)] for pair in range(n * m)]
    for seed in range(6):
        observation, _ = env.reset(seed=seed)
        pixels, slots = observation["pixels"].astype(int), observation["slots"][:, :, 0]
        cells = np.concatenate([core.state.source_cells[0, 0], core.state.target_cells[0, 0]])
        for place, content in enumerate(cells.tolist()):
            rows, columns = np.nonzero(slots == place + 1)
            assert (rows < 64).all() if place < n else (rows >= 64).all()
            r, g, _ = pixels[rows, columns].T
            green[content != 0].append((g > r).mean())
    assert np.mean(green[True]) > 0.5 > 0.2 > np.mean(green[False])


def test_depth_is_depth():
    env = made("fieldgym/SafflowerPicking-v0", depth=True, observation="both").unwrapped
    observation, _ = env.reset(seed=2)
    sight = env.view.sight(48)
    near, far = env.view.depth_range_m
    back = near + observation["depth"][:, :, 0] / 255.0 * (far - near)
    assert sight.depth_m.min() > near and sight.depth_m.max() < far
    np.testing.assert_allclose(back, sight.depth_m, atol=0.51 * (far - near) / 255.0)


def test_what_is_picked_is_bare():
    env = made("fieldgym/SafflowerPicking-v0", observation="both", perception="perfect").unwrapped
    observation, info = env.reset(seed=0)
    while not info["action_mask"][1]:
        observation, *_, info = env.step(len(info["action_mask"]) - 1)
    disc = observation["slots"][:, :, 0] == 1
    after, *_ = env.step(1)
    red = [o["pixels"][disc].astype(int) @ (1, -1, 0) for o in (observation, after)]
    assert red[0].mean() > red[1].mean() + 20


@pytest.mark.parametrize(
    ("kwargs", "word"),
    [
        ({"observation": "pictures"}, "observation"),
        ({"pixel_rows": 4}, "16..1080"),
        ({"pixel_rows": 96.0}, "pixel_rows"),
        ({"depth": 1}, "depth"),
        ({"observation": "features", "depth": True}, "observation"),
    ],
)
def test_what_cannot_be_shown_is_refused(kwargs, word):
    for make in (gym.make, lambda env_id, **kw: gym.make_vec(env_id, 2, "vector_entry_point", **kw)):
        with pytest.raises(ValueError, match=word) as refusal:
            make("fieldgym/SafflowerPicking-v0", **{"observation": "pixels", **kwargs, "backend": "analytic"})
        assert "\n" not in str(refusal.value)


def test_the_machine_in_pybullet_shows_the_same_pictures():
    pytest.importorskip("pybullet")
    envs = [made("fieldgym/SafflowerPicking-v0", backend=b, perception="model") for b in ("pybullet", "analytic")]
    pictures = [env.reset(seed=3)[0]["pixels"] for env in envs]
    np.testing.assert_array_equal(*pictures)
    for env in envs:
        env.close()
