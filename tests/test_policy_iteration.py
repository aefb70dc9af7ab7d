"""The sorting planner with a learned value, and the policy iteration that trains it."""

import json
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

import fieldgym  # noqa: F401
from fieldgym.agents import make_policy
from fieldgym.agents.learning import portable
from fieldgym.agents.learning.train_settings import TrainSettings, tuned
from fieldgym.agents.policies import search as planning
from fieldgym.agents.policies.search import Taken
from fieldgym.agents.policies.sorting_value import ValueSearch, ValueWeights, describe_all
from fieldgym.agents.policies.value_weights import SHAPES, VALUE
from fieldgym.agents.policies.weights import PolicyFileError
from fieldgym.envs import env_ids
from fieldgym.envs.sorting.columns import candidate_table

ID = "fieldgym/ProduceSorting-v0"
SMALL = TrainSettings(
    algo="policy-iteration", scenario="load-1.25", teacher="fifo", episodes=32, steps=7000, depth=2, width=4
)
SEQUENCES = 200
"""More than there are sequences of two of twelve items."""


def worlds(count: int, **options: Any) -> Any:
    vectorized = {"vectorization_mode": "vector_entry_point", "autoreset_mode": AutoresetMode.DISABLED}
    return gym.make_vec(ID, count, **vectorized, **options)  # type: ignore[arg-type]


def some_weights(depth: int = 4, width: int = 8, **changes: Any) -> ValueWeights:
    rng = np.random.default_rng(2)
    weights: dict[str, Any] = {name: rng.normal(size=shape).astype(np.float32) for name, shape in SHAPES.items()}
    weights["arrivals"] = np.array([0.78, 8.2, 0.5, 87.0], np.float32)
    return ValueWeights(depth, width, {**weights, **changes}, {"env_id": ID})


def midway(count: int = 6, decisions: int = 12) -> tuple[Any, dict[str, np.ndarray]]:
    env = worlds(count)
    observation, _ = env.reset(seed=5)
    teacher = make_policy("fifo", env)
    for _ in range(decisions):
        observation = env.step(teacher.act(observation))[0]
    return env, observation


def test_a_wide_search_finds_the_sequence_with_the_most_gain_and_value():
    env, observation = midway()
    policy = some_weights(depth=2, width=SEQUENCES).fitted(env)
    problem = policy.problem(observation)
    picks, actions = problem.picks, policy.act(observation)
    for w in range(len(actions)):
        best: dict[int, float] = {}
        for first in np.flatnonzero(picks.possible[w]).tolist():
            step = planning.extend(problem, w, 0.0, 0.0, 0.0, 0.0, first, 0, Taken(0, 0, 0), True)
            one = Taken(1 << first, 0, 0)
            worth = step.gain + planning.prospect(problem, w, step.clock_s, one, first)
            for then in set(np.flatnonzero(picks.present[w]).tolist()) - {first}:
                after = planning.extend(
                    problem, w, step.x, step.y, 0.0, step.clock_s, then, 0, Taken(1 << first, 0, 0), False
                )
                if after.possible:
                    left = planning.prospect(problem, w, after.clock_s, Taken(one.used | 1 << then, 0, 0), then)
                    worth = max(worth, step.gain + after.gain + left)
            best[first] = worth
        if best:
            assert best[int(actions[w])] == pytest.approx(max(best.values()))
        else:
            assert actions[w] == picks.present.shape[1]


def test_the_features_count_items_and_gain_by_the_time_left():
    env, observation = midway()
    policy = some_weights().fitted(env)
    problem, rows = policy.problem(observation), describe_all(policy.problem(observation))
    picks = problem.picks
    left_s = (picks.last_m - picks.along_m) / picks.paces.speed_m_s
    counted = picks.present & (left_s >= 0.25)
    assert counted.sum() > 12 and rows.shape == (6, VALUE) and np.isfinite(rows).all()
    np.testing.assert_allclose(rows[:, :8].sum(axis=1), counted.sum(axis=1))
    np.testing.assert_allclose(rows[:, 8:16].sum(axis=1), (picks.gain * counted).sum(axis=1))
    # The products of the counts, each pair once, are half of their sum's square and half of their squares.
    items, gain = rows[:, :8], rows[:, 8:16]
    each_once = 0.5 * (items.sum(axis=1) ** 2 + (items**2).sum(axis=1))
    expected = 0.1 * (each_once + items.sum(axis=1) * gain.sum(axis=1))
    np.testing.assert_allclose(rows[:, 16:116].sum(axis=1), expected)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of four rounds that nothing disturbs."""
    pytest.importorskip("tensorboard")
    from fieldgym.agents.learning.policy_iteration import iterate

    folder = tmp_path_factory.mktemp("whole")
    iterate(ID, SMALL, folder)
    return folder


def test_a_run_leaves_a_policy_a_curve_and_its_time(whole):
    policy = portable.load(whole / "best.npz")
    curve = json.loads((whole / "curve.json").read_text())
    assert [point["steps"] for point in curve] == sorted(point["steps"] for point in curve) and len(curve) >= 2
    assert curve[-1]["steps"] >= SMALL.steps and max(p["return"] for p in curve) == policy.card["held_out"]["return"]
    assert policy.card["algorithm"] == "policy-iteration" and policy.card["settings"] == SMALL.as_dict()
    assert list((whole / "tensorboard").glob("events*")) and not list(whole.glob(".*"))
    # What the camera model and the stream say, found out by watching.
    env = worlds(1)
    rate_hz, left_s, gain, last_s = policy.weights["arrivals"]
    config = env.unwrapped.core.config
    assert rate_hz == pytest.approx(config.scenario.rate_hz, rel=0.08)
    assert 0.3 < gain < 0.65 and 7.0 < left_s < 9.5 and 80.0 < last_s < 93.0


def test_a_run_that_stops_and_goes_on_learns_the_same(whole, tmp_path):
    from fieldgym.agents.learning.policy_iteration import iterate

    class StoppedError(Exception):
        pass

    def stop(progress: Any) -> None:
        if progress.updates == 2:
            raise StoppedError

    with pytest.raises(StoppedError):
        iterate(ID, SMALL, tmp_path, on_update=stop)
    iterate(ID, SMALL, tmp_path, resume=True)
    one, other = portable.load(whole / "last.npz"), portable.load(tmp_path / "last.npz")
    assert all(np.array_equal(one.weights[name], other.weights[name]) for name in SHAPES)


def test_however_few_decisions_are_asked_for_there_is_a_policy(tmp_path):
    pytest.importorskip("tensorboard")
    from fieldgym.agents.learning.policy_iteration import iterate

    settings = TrainSettings.of({**SMALL.as_dict(), "steps": 1, "episodes": 8, "evaluation_episodes": 2})
    result = iterate(ID, settings, tmp_path)
    assert len(result.curve) == 1 and portable.load(result.best).card["training_seeds"] == [10**9, 10**9 + 15]


def test_with_lambda_one_the_fit_is_that_of_the_returns(tmp_path):
    """Then every trace is a plain sum, and LSTD is ridge regression on what was earned until the end (Boyan 2002)."""
    pytest.importorskip("stable_baselines3")
    from stable_baselines3.common.logger import configure

    from fieldgym.agents.learning.policy_iteration import _RIDGE, _Run
    from fieldgym.agents.learning.runs import Journal

    settings = TrainSettings.of({**SMALL.as_dict(), "gae_lambda": 1.0})
    env = worlds(settings.episodes)
    run = _Run(Journal(ID, settings, 0, tmp_path, configure(None, [])), env, 1_000_000_000)
    teacher = make_policy("fifo", env)
    run._watch(run._play(teacher))
    moments = list(run._play(teacher))
    found = run._fitted(iter(moments))
    helper = run.learned().fitted(env)
    to_go, matrix, right = np.zeros(settings.episodes), _RIDGE * np.eye(VALUE), np.zeros(VALUE)
    for moment in reversed(moments):
        to_go = to_go + moment.rewards
        rows = describe_all(helper.problem(moment.observation))[moment.under_way]
        matrix += rows.T @ rows
        right += rows.T @ to_go[moment.under_way]
    np.testing.assert_allclose(found, np.linalg.solve(matrix, right), rtol=1e-6, atol=1e-8)


def test_a_checkpoint_says_what_does_not_fit(whole, tmp_path):
    from fieldgym.agents.learning.policy_iteration import iterate
    from fieldgym.agents.learning.runs import CheckpointError

    with pytest.raises(CheckpointError, match="start without --resume"):
        iterate(ID, SMALL, tmp_path, resume=True)
    state = json.loads((whole / "state.json").read_text())
    for damaged in ("{", json.dumps({**state, "value": [0.0]}), json.dumps({**state, "gain": None})):
        (tmp_path / "state.json").write_text(damaged)
        with pytest.raises(CheckpointError, match="damaged"):
            iterate(ID, SMALL, tmp_path, resume=True)
    with pytest.raises(CheckpointError, match="with depth = 2, now it is 3"):
        iterate(ID, TrainSettings.of({**SMALL.as_dict(), "depth": 3}), whole, resume=True)
    with pytest.raises(CheckpointError, match="with seed 0"):
        iterate(ID, SMALL, whole, resume=True, seed=3)


def test_what_it_is_not_made_for_is_refused(tmp_path):
    pytest.importorskip("tensorboard")
    from fieldgym.agents.learning.policy_iteration import iterate

    with pytest.raises(ValueError, match="choose maskable-ppo or ppo"):
        iterate(env_ids()[0], SMALL, tmp_path)
    with pytest.raises(ValueError, match="needs a teacher"):
        iterate(ID, TrainSettings.of({**SMALL.as_dict(), "teacher": None}), tmp_path)
    assert tuned(ID).algo == "policy-iteration"


def test_a_file_decides_as_what_was_saved_for_any_number_of_slots(tmp_path):
    env, observation = midway()
    learned = some_weights()
    portable.save(tmp_path / "p.npz", learned)
    read = portable.load_for(tmp_path / "p.npz", env)
    assert isinstance(read, ValueSearch) and read.card["env_id"] == ID
    np.testing.assert_array_equal(read.act(observation), learned.fitted(env).act(observation))
    few = worlds(4, slots=3)
    observation, _ = few.reset(seed=0)
    actions = portable.load_for(tmp_path / "p.npz", few).act(observation)
    assert candidate_table(observation).shape[1] == 3 and observation["action_mask"][np.arange(4), actions].all()


@pytest.mark.parametrize(
    ("changes", "word"),
    [
        ({"depth": 0}, "out of range"),
        ({"width": 10**6}, "out of range"),
        ({"value": np.zeros(VALUE - 1, np.float32)}, "wanted float32"),
        ({"gain": np.full(12, np.inf, np.float32)}, "not finite"),
        ({"more": np.zeros(1, np.float32)}, "unknown"),
    ],
)
def test_bad_weights_are_refused(changes, word):
    with pytest.raises(PolicyFileError, match=word):
        some_weights(**changes)


def test_weights_for_sorting_fit_no_other_task():
    other: Any = gym.make(env_ids()[0], backend="analytic")
    with pytest.raises(PolicyFileError, match="another task"):
        some_weights().fitted(other)
