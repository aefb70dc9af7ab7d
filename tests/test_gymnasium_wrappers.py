"""Gymnasium's wrappers that need the extra ``wrappers``, and RL Baselines3 Zoo (extra ``zoo``), as people use them."""

import os
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401

pytestmark = pytest.mark.filterwarnings("ignore:.*Overwriting existing videos")
PICKER, HOES = "fieldgym/SafflowerPicking-v0", "fieldgym/HoeWeeding-v0"


def picture_count(path: Path) -> int:
    imageio = pytest.importorskip("imageio.v3")
    return sum(1 for _ in imageio.imiter(path))


@pytest.mark.parametrize("backend", ["analytic", "pybullet"])
def test_record_video_writes_a_picture_a_decision(backend, tmp_path):
    pytest.importorskip("moviepy")
    env: Any = gym.make(HOES, backend=backend, perception="perfect", render_mode="rgb_array", width=64)
    env = gym.wrappers.RecordVideo(env, str(tmp_path), video_length=4)
    env.reset(seed=1)
    for _ in range(6):
        env.step(int(np.flatnonzero(env.unwrapped.action_masks())[0]))
    env.close()
    (video,) = tmp_path.glob("*.mp4")
    assert picture_count(video) == 5  # the beginning's among them


def test_record_video_takes_a_batch_as_one_picture(tmp_path):
    pytest.importorskip("moviepy")
    batch: Any = gym.make_vec(PICKER, 4, "vector_entry_point", render_mode="rgb_array", width=64, height=48)
    env = gym.wrappers.vector.RecordVideo(batch, str(tmp_path), video_length=3)
    env.reset(seed=1)
    for _ in range(5):
        env.step(np.argmax(batch.action_masks(), axis=1))
    env.close()
    (video,) = tmp_path.glob("*.mp4")
    assert picture_count(video) == 4
    imageio = pytest.importorskip("imageio.v3")
    assert imageio.imread(video, index=0).shape == (96, 128, 3)


@pytest.fixture
def shown(monkeypatch):
    """What a window of pygame's shows, and it waits for nobody."""
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    pygame = pytest.importorskip("pygame")
    pictures = []

    def flip() -> None:
        pictures.append(pygame.surfarray.array3d(pygame.display.get_surface()))

    monkeypatch.setattr(pygame.display, "flip", flip)
    yield pictures
    pygame.quit()


@pytest.mark.parametrize("backend", ["analytic", "pybullet"])
def test_human_rendering_shows_the_environment_s_own_pictures(backend, shown):
    env: Any = gym.make(HOES, backend=backend, perception="perfect", render_mode="rgb_array", width=64)
    env.unwrapped.metadata["render_fps"] = 1000
    env = gym.wrappers.HumanRendering(env)
    env.reset(seed=1)
    for turn in range(3):
        assert len(shown) == turn + 1
        assert np.array_equal(shown[-1].transpose(1, 0, 2), env.unwrapped.render())
        env.step(int(np.flatnonzero(env.unwrapped.action_masks())[0]))
    env.close()


def test_human_rendering_shows_a_batch_side_by_side(shown):
    batch: Any = gym.make_vec(HOES, 2, "vector_entry_point", render_mode="rgb_array", width=64, height=48)
    batch.metadata["render_fps"] = 1000
    env = gym.wrappers.vector.HumanRendering(batch, screen_size=(64, 96))
    env.reset(seed=1)
    env.step(np.argmax(batch.action_masks(), axis=1))
    assert len(shown) == 2
    assert np.array_equal(shown[-1].transpose(1, 0, 2), np.concatenate(batch.render()))
    env.close()


SETTINGS = """
fieldgym/SafflowerPicking-v0:
  n_timesteps: 64
  n_envs: 1
  policy: MultiInputPolicy
  n_steps: 32
  batch_size: 32
"""


@pytest.mark.slow
@pytest.mark.long
def test_the_zoo_trains_and_enjoys(tmp_path):
    """``rl_zoo3.train`` and ``rl_zoo3.enjoy``, as the page on learning has them."""
    pytest.importorskip("rl_zoo3")
    (tmp_path / "ppo.yml").write_text(SETTINGS, "utf-8")
    common = ["--algo", "ppo", "--env", PICKER, "--gym-packages", "fieldgym", "--env-kwargs", 'backend:"analytic"']
    trained = ["rl_zoo3.train", *common, "--conf-file", "ppo.yml", "--eval-freq", "-1", "--eval-episodes", "1"]
    watched = ["rl_zoo3.enjoy", *common, "--folder", "logs", "--n-timesteps", "20", "--no-render"]
    for words in (trained, watched):
        done = subprocess.run(
            [sys.executable, "-m", *words],
            cwd=tmp_path,
            env={**os.environ, "HF_HUB_OFFLINE": "1"},
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]
    assert "Loading" in done.stdout
    shutil.rmtree(tmp_path / "logs")
