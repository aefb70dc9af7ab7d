"""A policy that looks at pictures: PyTorch and NumPy agree, files, what it looks at, and a training run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.agents.evaluation import evaluate
from fieldgym.agents.learning.portable import load, load_for, save
from fieldgym.agents.policies.layout import layout_of
from fieldgym.agents.policies.network import shapes
from fieldgym.agents.policies.pixels import PixelPolicy, eye_shapes, features_of
from fieldgym.agents.policies.weights import PolicyFileError

TRAYS, SORTING, PICKING = "fieldgym/TrayTransplanting-v0", "fieldgym/ProduceSorting-v0", "fieldgym/SafflowerPicking-v0"
ROWS, CHANNELS, HIDDEN = 48, 6, 8


def batch(env_id: str, observation: str = "both", n: int = 3) -> Any:
    shown = {"observation": observation, "pixel_rows": ROWS} if observation != "features" else {}
    return gym.make_vec(env_id, n, "vector_entry_point", autoreset_mode="SameStep", **shown)


def policy_for(env: Any, seed: int = 0) -> PixelPolicy:
    """One with random weights."""
    marks = env.unwrapped.drawer(env.unwrapped.shown._replace(observation="both", rows=ROWS)).marks
    layout = layout_of(env)
    layout = type(layout)(**{**vars(layout), "features": features_of(CHANNELS, marks.shape[1])})
    rng = np.random.default_rng(seed)
    wanted = eye_shapes(CHANNELS) | shapes(layout, HIDDEN)
    weights = {name: 0.3 * rng.standard_normal(shape, np.float32) for name, shape in wanted.items()}
    return PixelPolicy(layout, HIDDEN, weights, {}, channels=CHANNELS, rows=ROWS).fitted(env)


def parts(table: Any, observation: Any, env: Any, policy: PixelPolicy) -> Any:
    """What is seen and what is told of candidates, with how many numbers each has."""
    seen = table.shape[1] // len(policy._marks)
    return (table, seen), (observation["candidates"], len(env.unwrapped.core.candidate_features))


@pytest.mark.parametrize("env_id", [TRAYS, SORTING])
def test_numpy_sees_what_pytorch_sees(env_id):
    torch = pytest.importorskip("torch")
    pytest.importorskip("sb3_contrib")
    from fieldgym.agents.learning.pixel_policy import Eyes

    env = batch(env_id)
    policy = policy_for(env)
    eyes = Eyes(policy._marks, CHANNELS)
    eyes.load_state_dict({name: torch.from_numpy(policy.weights[name]) for name in eye_shapes(CHANNELS)})
    observation, _ = env.reset(seed=1)
    for _ in range(4):
        table = policy.table(observation["pixels"], observation["slots"][..., 0])
        with torch.no_grad():
            seen = eyes(
                torch.from_numpy(observation["pixels"]).permute(0, 3, 1, 2).float(),
                torch.from_numpy(observation["slots"][..., 0]).float(),
            )
        np.testing.assert_allclose(table, seen.numpy(), rtol=2e-4, atol=2e-4)
        shown, told = (part.reshape(3, -1, n)[..., 0] > 0.0 for part, n in parts(table, observation, env, policy))
        assert shown.sum() > 0.7 * told.sum() > 0.0
        assert env_id != SORTING or (shown <= told).all()
        observation, *_ = env.step(policy.act(observation))


def test_it_looks_at_the_picture_and_not_at_the_numbers():
    env = batch(SORTING)
    policy = policy_for(env)
    observation, _ = env.reset(seed=4)
    table = policy.table(observation["pixels"], observation["slots"][..., 0])
    black = policy.table(np.zeros_like(observation["pixels"]), observation["slots"][..., 0])
    assert np.abs(table - black).max() > 0.1
    for _ in range(12):
        blind = observation | {"candidates": np.zeros_like(observation["candidates"])}
        actions = policy.act(blind)
        assert np.array_equal(actions, policy.act(observation))
        observation, *_ = env.step(actions)


@pytest.mark.parametrize("env_id", [SORTING, PICKING])
def test_a_policy_without_pictures_draws_its_own(env_id):
    seeing, plain = batch(env_id, "pixels"), batch(env_id, "features")
    policies = policy_for(seeing), policy_for(plain)
    observations = [env.reset(seed=2)[0] for env in (seeing, plain)]
    for _ in range(15):
        actions = [policy.act(observation) for policy, observation in zip(policies, observations, strict=True)]
        assert np.array_equal(actions[0], actions[1])
        observations = [env.step(actions[0])[0] for env in (seeing, plain)]
    single: Any = gym.make(env_id, backend="analytic", perception="model")
    observation, _ = single.reset(seed=2)
    first = policy_for(single).act({name: values[None] for name, values in observation.items()})
    assert first[0] == policy_for(seeing).act(seeing.reset(seed=2)[0])[0]


def test_files_hold_it_and_are_checked(tmp_path: Path):
    env = batch(SORTING, "features")
    policy = policy_for(env)
    path = tmp_path / "eyes.npz"
    save(path, policy, {"env_id": SORTING})
    again = load_for(path, env)
    observation, _ = env.reset(seed=0)
    assert np.array_equal(again.act(observation), policy.act(observation))
    scores = evaluate(load(path).fitted, SORTING, range(2))
    assert np.isfinite(scores.returns).all()
    head, weights = dict(policy.head), dict(policy.weights)
    for broken in ({"rows": 4}, {"channels": 5}, {"hidden": 10**6}, {"layout": {}}):
        with pytest.raises(PolicyFileError):
            PixelPolicy.of(head | broken, weights, "eyes")
    with pytest.raises(PolicyFileError):
        PixelPolicy.of(head, weights | {"first.bias": weights["second.bias"]}, "eyes")
    with pytest.raises(PolicyFileError):
        policy.fitted(batch(TRAYS, "features"))


@pytest.mark.slow
def test_a_run_learns_from_pictures_and_goes_on_after_a_stop(tmp_path: Path):
    pytest.importorskip("sb3_contrib")
    from fieldgym.agents.learning.train_settings import tuned
    from fieldgym.agents.learning.training import train

    sizes: dict[str, Any] = {"num_envs": 4, "n_steps": 32, "batch_size": 64, "channels": 8, "evaluation_episodes": 4}
    given = {**sizes, "observation": "pixels", "teacher": "nearest", "teacher_decisions": 600, "evaluate_every": 1}
    settings = tuned(PICKING, "pots", steps=256, **given)
    whole = train(PICKING, settings, tmp_path / "whole")
    assert whole.progress.taught > 0.3 and whole.progress.steps == 256
    assert isinstance(load(whole.best), PixelPolicy)
    half = tuned(PICKING, "pots", steps=128, **given)
    train(PICKING, half, tmp_path / "halves")
    rest = train(PICKING, settings, tmp_path / "halves", resume=True)
    assert rest.progress.steps == 256 and rest.curve[-1]["steps"] == 256
