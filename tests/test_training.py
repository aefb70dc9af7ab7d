"""Training runs: settings, what they leave, and going on after a kill."""

import json
import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.agents.learning.train_settings import TrainSettings, tuned
from fieldgym.envs import env_ids, task
from fieldgym.kernels.seeds import CHOOSING

ID = "fieldgym/SafflowerPicking-v0"
SMALL = TrainSettings(
    scenario="pots",
    steps=6 * 128,
    num_envs=8,
    n_steps=16,
    batch_size=64,
    n_epochs=1,
    hidden=8,
    critic_hidden=8,
    evaluate_every=3,
    evaluation_episodes=4,
)


class StoppedError(Exception):
    """Raised in the middle of a run."""


def stop_after(updates: int) -> Any:
    def stop(progress: Any) -> None:
        if progress.updates == updates:
            raise StoppedError

    return stop


def weights(folder: Path, name: str = "last.npz") -> dict[str, np.ndarray]:
    with np.load(folder / name) as arrays:
        return dict(arrays)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of six updates that nothing disturbs."""
    pytest.importorskip("sb3_contrib")
    pytest.importorskip("tensorboard")
    from fieldgym.agents.learning.training import train

    folder = tmp_path_factory.mktemp("whole")
    train(ID, SMALL, folder, threads=1)
    return folder


def test_a_run_leaves_a_policy_a_curve_a_log_and_its_time(whole):
    from fieldgym.agents.learning.portable import load
    from fieldgym.agents.learning.training import train

    result = train(ID, SMALL, whole, resume=True)
    progress = result.progress
    assert progress.steps == 768 and progress.updates == 6
    assert min(progress.environment_s, progress.acting_s, progress.learning_s) > 0.0
    assert "environment" in progress.split() and "learning" in progress.split()
    assert [point["steps"] for point in result.curve] == [384, 768]
    assert result.curve == json.loads((whole / "curve.json").read_text())
    card = load(result.best).card
    assert card["settings"] == SMALL.as_dict() and card["env_id"] == ID
    assert card["chosen_on_seeds"] == [CHOOSING.first, CHOOSING.first + 3]
    assert list((whole / "tensorboard").glob("events*"))
    assert not list(whole.glob(".*"))


def test_a_run_ends_with_its_time(tmp_path):
    pytest.importorskip("sb3_contrib")
    pytest.importorskip("tensorboard")
    from fieldgym.agents.learning.training import train

    # Any update takes longer than this: there is one, it is evaluated and kept.
    hurried = replace(SMALL, steps=10**9, minutes=1e-6)
    result = train(ID, hurried, tmp_path, threads=1)
    assert result.progress.updates == 1 and [point["steps"] for point in result.curve] == [128]
    assert result.best.is_file()
    more = train(ID, replace(hurried, steps=256, minutes=None), tmp_path, threads=1, resume=True)
    assert [point["steps"] for point in more.curve] == [128, 256]


def test_what_is_left_of_a_run_s_time_is_a_share_of_its_minutes(tmp_path):
    from fieldgym.agents.learning.runs import Journal

    nowhere: Any = None
    record = Journal(ID, replace(SMALL, minutes=2.0), 0, tmp_path, nowhere)
    for wall_s, left in ((0.0, 1.0), (30.0, 0.75), (120.0, 0.0), (150.0, 0.0)):
        record.progress = replace(record.progress, learning_s=wall_s)
        assert record.time_left == pytest.approx(left)
    assert Journal(ID, SMALL, 0, tmp_path, nowhere).time_left == 1.0


def test_a_run_that_stops_and_goes_on_learns_the_same(whole, tmp_path):
    from fieldgym.agents.learning.training import train

    with pytest.raises(StoppedError):
        train(ID, SMALL, tmp_path, threads=1, on_update=stop_after(4))
    result = train(ID, SMALL, tmp_path, threads=1, resume=True)
    assert result.progress.updates == 6
    for name in ("last.npz", "best.npz"):
        one, other = weights(whole, name), weights(tmp_path, name)
        assert all(np.array_equal(one[key], other[key]) for key in one)
    fields = ("steps", "return", "net_rate", "cycle_time_s")
    curves = [json.loads((folder / "curve.json").read_text()) for folder in (whole, tmp_path)]
    assert [[point[f] for f in fields] for point in curves[0]] == [[point[f] for f in fields] for point in curves[1]]


def test_a_killed_run_goes_on(whole, tmp_path):
    code = f"""
from pathlib import Path
from fieldgym.agents.learning.train_settings import TrainSettings
from fieldgym.agents.learning.training import train
settings = TrainSettings(**{SMALL.as_dict()!r})
train({ID!r}, settings, Path({str(tmp_path)!r}), threads=1, on_update=lambda p: print(p.updates, flush=True))
"""
    run = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    assert run.stdout is not None
    while run.stdout.readline().strip() != "2":
        assert run.poll() is None
    os.kill(run.pid, signal.SIGKILL)
    run.communicate()
    from fieldgym.agents.learning.training import train

    train(ID, SMALL, tmp_path, threads=1, resume=True)
    one, other = weights(whole), weights(tmp_path)
    assert all(np.array_equal(one[key], other[key]) for key in one)


@pytest.mark.parametrize("env_id", [env_id for env_id in env_ids() if env_id != ID])
def test_every_task_goes_on_as_it_was(env_id, tmp_path):
    pytest.importorskip("sb3_contrib")
    from fieldgym.agents.learning.training import train

    settings = TrainSettings.of(
        {**SMALL.as_dict(), "scenario": None, "steps": 384, "evaluate_every": 100, "evaluation_episodes": 1}
    )
    train(env_id, settings, tmp_path / "whole", threads=1)
    with pytest.raises(StoppedError):
        train(env_id, settings, tmp_path / "parts", threads=1, on_update=stop_after(2))
    train(env_id, settings, tmp_path / "parts", threads=1, resume=True)
    one, other = weights(tmp_path / "whole"), weights(tmp_path / "parts")
    assert all(np.array_equal(one[key], other[key]) for key in one)


def test_a_checkpoint_says_what_does_not_fit(whole, tmp_path):
    from fieldgym.agents.learning.runs import CheckpointError
    from fieldgym.agents.learning.training import train

    with pytest.raises(CheckpointError, match="start without --resume"):
        train(ID, SMALL, tmp_path, resume=True)
    (tmp_path / "state.pt").write_bytes((whole / "state.pt").read_bytes()[:5000])
    with pytest.raises(CheckpointError, match="damaged"):
        train(ID, SMALL, tmp_path, resume=True)
    with pytest.raises(CheckpointError, match=r"gamma = 0\.99, now it is 0\.5"):
        train(ID, TrainSettings.of({**SMALL.as_dict(), "gamma": 0.5}), whole, resume=True)
    with pytest.raises(CheckpointError, match="with seed 0"):
        train(ID, SMALL, whole, resume=True, seed=3)


def test_plain_ppo_takes_the_mask_from_the_observation(tmp_path):
    pytest.importorskip("sb3_contrib")
    from fieldgym.agents.learning.training import train

    settings = TrainSettings.of({**SMALL.as_dict(), "algo": "ppo", "steps": 128, "evaluate_every": 1})
    assert train(ID, settings, tmp_path, threads=1).progress.steps == 128


def test_a_pupil_begins_with_what_its_teacher_does(tmp_path):
    pytest.importorskip("sb3_contrib")
    from fieldgym.agents import make_policy
    from fieldgym.agents.evaluation import evaluate
    from fieldgym.agents.learning.training import train

    settings = TrainSettings.of(
        {
            **SMALL.as_dict(),
            "teacher": "grams-per-second",
            "teacher_decisions": 3000,
            "teacher_epochs": 8,
            "hidden": 32,
            "steps": 128,
        }
    )
    result = train(ID, settings, tmp_path, threads=1)
    assert result.progress.taught > 0.9
    seeds = CHOOSING.take(settings.evaluation_episodes)
    teacher = evaluate(lambda env: make_policy("grams-per-second", env), ID, seeds, scenario="pots")
    assert result.curve[0]["steps"] == 0
    assert result.curve[0]["return"] == pytest.approx(teacher.returns.mean(), abs=0.5)
    with pytest.raises(ValueError, match="no episode ended within 16 decisions"):
        train(ID, TrainSettings.of({**settings.as_dict(), "teacher_decisions": 16}), tmp_path / "short", threads=1)


@pytest.mark.parametrize("env_id", env_ids())
def test_shipped_settings_fit_every_scenario(env_id):
    pytest.importorskip("yaml")
    for scenario in task(env_id).scenarios:
        assert tuned(env_id, scenario).scenario == scenario


def test_a_file_s_settings_come_on_top_and_given_ones_above(tmp_path):
    pytest.importorskip("yaml")
    path = tmp_path / "mine.yaml"
    path.write_text("defaults: {n_steps: 32, gamma: 1}\nscenarios:\n  row: {n_steps: 16}\n")
    settings = tuned(ID, "row", path, steps=1000, algo="ppo")
    assert (settings.n_steps, settings.gamma, settings.steps, settings.algo) == (16, 1.0, 1000, "ppo")
    assert tuned(ID, "pots", path).n_steps == 32


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("defaults: {gama: 0.9}", "did you mean gamma"),
        ("defaults: {gamma: 1.5}", "gamma = 1.5"),
        ("defaults: {gamma: .nan}", "gamma = nan"),
        ("defaults: {n_steps: many}", "n_steps = 'many'"),
        ("defaults: {n_steps: 0}", "n_steps = 0"),
        ("defaults: {batch_size: 10000000}", "batch_size"),
        ("defaults: {algo: dqn}", "'maskable-ppo', 'ppo'"),
        ("gamma: 0.9", "under 'defaults:'"),
        ("- 1", "mapping"),
        ("defaults: {a: [", "no YAML"),
        ("defaults: !!python/object/apply:os.getcwd []", "mine.yaml:1"),
    ],
)
def test_bad_settings_are_named_in_one_line(tmp_path, text, word):
    pytest.importorskip("yaml")
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(ValueError, match=word) as caught:
        tuned(ID, "pots", path)
    assert "\n" not in str(caught.value)
