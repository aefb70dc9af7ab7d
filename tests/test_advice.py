"""Advice of scripted policies beside the candidates, and learned policies that listen to it."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.agents import make_policy, policy_names, portable
from fieldgym.agents.advice import Advised, advice_of, advised
from fieldgym.agents.layout import Layout, layout_of
from fieldgym.agents.registry import load_policy
from fieldgym.envs import ENV_IDS

SORTING, SPEED = "fieldgym/ProduceSorting-v0", "fieldgym/LaserWeedingSpeed-v0"


def some_way_in(env_id: str, worlds: int = 6, decisions: int = 5) -> tuple[Any, dict[str, np.ndarray]]:
    env: Any = gym.make_vec(env_id, worlds, vectorization_mode="vector_entry_point")
    observation, _ = env.reset(seed=2)
    rng = np.random.default_rng(0)
    for _ in range(decisions):
        mask = observation["action_mask"]
        observation = env.step(np.where(mask > 0, rng.random(mask.shape), -1.0).argmax(axis=1))[0]
    return env, observation


def weights_of(layout: Layout, hidden: int = 8, seed: int = 0) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(seed)
    return {n: rng.normal(size=s).astype(np.float32) for n, s in portable.shapes(layout, hidden).items()}


def test_a_layout_splits_what_it_joins():
    layout = Layout(machine=1, candidates=3, features=2, options=2, extras=2, blocks=2)
    values = np.arange(2 * layout.actions).reshape(2, -1)
    slots, extras = layout.split(values)
    assert slots.shape == (2, 3, 4) and extras.shape == (2, 4)
    assert np.array_equal(layout.join(slots, extras, np.concatenate), values)


@pytest.mark.parametrize("env_id", ENV_IDS)
def test_every_rule_advises_most_what_it_does_and_moves_nothing_else(env_id):
    env, observation = some_way_in(env_id)
    layout = layout_of(env)
    for name in policy_names(env_id):
        if name in ("random", portable.LEARNED):
            continue
        policy = make_policy(name, env)
        advice = advice_of(policy, observation, layout.actions)
        assert advice.shape == (6, layout.actions) and advice.dtype == np.float32
        assert np.array_equal(advice.argmax(axis=1), policy.act(observation)), name
        assert (advice.max(axis=1) == 1.0).all() and advice.min() >= 0.0 and ((advice == 1.0).sum(axis=1) == 1).all()
        wide = advised(observation, policy, layout)
        table = wide["candidates"].reshape(6, layout.candidates, -1)
        assert wide["machine"].shape == (6, layout.advised().machine) and table.shape[2] == layout.advised().features
        plain = observation["candidates"].reshape(6, layout.candidates, -1)
        assert np.array_equal(table[..., : layout.features], plain)
        assert not table[plain[..., 0] == 0.0].any()


@pytest.mark.parametrize(("env_id", "adviser"), [(SORTING, "receding-horizon-value"), (SPEED, "constant-1")])
def test_a_policy_with_an_adviser_comes_out_of_its_file_with_it(env_id, adviser, tmp_path):
    env, observation = some_way_in(env_id)
    layout = layout_of(env)
    weights = weights_of(layout.advised())
    card = {"env_id": env_id, "adviser": adviser}
    portable.save(tmp_path / "p.npz", layout.advised(), 8, weights, card)
    policy = load_policy(tmp_path / "p.npz", env)
    assert isinstance(policy, Advised) and policy.card["adviser"] == adviser
    network = portable.LearnedPolicy(layout.advised(), 8, weights, card)
    told = advised(observation, make_policy(adviser, env), layout)
    assert np.array_equal(policy.act(observation), network.act(told))
    portable.save(tmp_path / "q.npz", layout.advised(), 8, weights, {**card, "adviser": "oracle"})
    with pytest.raises(portable.PolicyFileError, match="'oracle' is none of"):
        load_policy(tmp_path / "q.npz", env)
    portable.save(tmp_path / "r.npz", layout.advised(), 8, weights, {"env_id": env_id})
    with pytest.raises(portable.PolicyFileError, match="was made for"):
        load_policy(tmp_path / "r.npz", env)


def test_learners_see_the_advice_and_the_teacher_what_it_knows():
    sb3 = pytest.importorskip("fieldgym.agents.sb3")
    worlds = 8
    env = sb3.make_vec_env(SORTING, worlds, seed=3, time_limit_ends=True, adviser="receding-horizon")
    observation = env.reset()
    plain: Any = gym.make_vec(SORTING, worlds, vectorization_mode="vector_entry_point", autoreset_mode="SameStep")
    expected, _ = plain.reset(seed=3)
    rule, layout = make_policy("receding-horizon", plain), layout_of(plain)
    for _ in range(80):
        assert all(env.observation_space[name].contains(observation[name][0]) for name in observation)
        for name, values in advised(expected, rule, layout).items():
            assert np.array_equal(observation[name], values)
            assert np.array_equal(env.seen[name], expected[name])
        action = rule.act(env.seen)
        env.step_async(action)
        observation = env.step_wait()[0]
        expected = plain.step(action)[0]
    with pytest.raises(ValueError, match="time_limit_ends"):
        sb3.make_vec_env(SORTING, 2, adviser="fifo")


def test_a_run_with_an_adviser_begins_where_the_adviser_ends_and_goes_on_after_a_stop(tmp_path):
    pytest.importorskip("sb3_contrib")
    from fieldgym.agents.evaluation import evaluate
    from fieldgym.agents.train_settings import TrainSettings
    from fieldgym.agents.training import HELD_OUT_SEEDS, train

    name = "receding-horizon"
    settings = TrainSettings(
        adviser=name, teacher=name, teacher_decisions=12_000, teacher_epochs=8, num_envs=64, n_steps=4, batch_size=128,
        steps=512, learning_rate=3e-3, reward_scale=0.1, gamma=1.0, hidden=16, critic_hidden=16, evaluate_every=1,
        evaluation_episodes=16,
    )  # fmt: skip
    train(SORTING, TrainSettings.of({**settings.as_dict(), "steps": 256}), tmp_path, threads=1)
    result = train(SORTING, settings, tmp_path, threads=1, resume=True)
    seeds = range(HELD_OUT_SEEDS, HELD_OUT_SEEDS + 16)
    rule = evaluate(lambda env: make_policy(name, env), SORTING, seeds)
    rate = rule.scorecard["net_rate"].mean()
    assert result.progress.taught > 0.95
    assert result.curve[0]["net_rate"] == pytest.approx(rate, abs=0.02)
    learned = evaluate(lambda env: load_policy(result.best, env), SORTING, seeds)
    assert learned.returns.mean() == pytest.approx(max(point["return"] for point in result.curve), abs=1e-6)
