"""Pictures and videos for people: from where, how large, and as long as what they show."""

import copy
import json
from itertools import pairwise
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from twins import at_night
from typer.testing import CliRunner

from fieldgym import wrappers
from fieldgym.agents import make_policy
from fieldgym.agents.rollout import begin, decisions
from fieldgym.envs import env_ids, task
from fieldgym.scripts import cli
from fieldgym.scripts.film import film
from fieldgym.wrappers import FRAMES_PER_SECOND, Filming, RecordField

HOE, SORTING = "fieldgym/HoeWeeding-v0", "fieldgym/ProduceSorting-v0"
SMALL: dict[str, Any] = {"backend": "analytic", "perception": "perfect", "width": 96}


def made(env_id: str, **options: Any) -> Any:
    return gym.make(env_id, disable_env_checker=True, render_mode="rgb_array", **{**SMALL, **options})


@pytest.mark.parametrize("env_id", env_ids())
def test_every_camera_shows_something_else_in_the_size_that_was_asked_for(env_id: str):
    pictures = []
    for camera in task(env_id).assembly.cameras:
        env = made(env_id, camera=camera, height=60)
        env.reset(seed=3)
        pictures.append(env.render().astype(float))
        env.close()
        assert pictures[-1].shape == (60, 96, 3) and pictures[-1].std() > 10.0, camera
    assert len(pictures) >= 3
    assert all(np.abs(a - b).mean() > 5.0 for k, a in enumerate(pictures) for b in pictures[:k])


def test_the_first_camera_and_the_scene_s_own_size_are_meant_where_nothing_is_said():
    for options, shape in (({"width": None}, (480, 720)), ({"width": 96}, (64, 96)), ({"height": 96}, (96, 144))):
        env = made(HOE, **{"width": None, **options})
        env.reset(seed=3)
        assert env.render().shape == (*shape, 3)
        assert env.unwrapped.shot.camera == "machine"
        env.close()


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"camera": "back"}, "camera = 'back' is unknown: choose one of 'machine', 'overview', 'tool'"),
        ({"camera": "front"}, "'machine', 'overview', 'tool'"),
        ({"width": 8}, "width = 8: give a whole number of pixels in 32..4096"),
        ({"height": 480.0}, "height = 480.0: give a whole number of pixels in 32..4096"),
        ({"width": True}, "width = True: give a whole number"),
    ],
)
def test_a_picture_that_cannot_be_drawn_is_refused_in_one_line(options: dict[str, Any], told: str):
    with pytest.raises(ValueError, match=r"camera|width|height") as error:
        made(SORTING, **options)
    assert told in str(error.value) and "\n" not in str(error.value)


def test_what_is_asked_of_pictures_survives_json_copies_and_every_wrapper():
    asked = {"camera": "tool", "width": 100, "height": 70}
    env = made(HOE, **asked)
    assert env.spec is not None
    again = gym.make(EnvSpec.from_json(json.loads(json.dumps(env.spec.to_json()))))
    for one in (again, copy.deepcopy(env)):
        one.reset(seed=3)
        picture: Any = one.render()
        assert picture.shape == (70, 100, 3)
        one.close()
    env.reset(seed=3)
    assert np.array_equal(env.render(), picture)
    env.close()


DRAWN = [pytest.param(one, marks=at_night(one)) for one in env_ids()]


@pytest.mark.parametrize("env_id", DRAWN)
def test_a_picture_a_decision_plays_as_long_as_the_episode_took(env_id: str):
    """Gymnasium's ``RecordVideo`` shows them at ``render_fps``."""
    spec = task(env_id)
    measured = spec.assembly.decision_s
    assert spec.headline in measured and set(measured) <= set(spec.scenarios)
    for scenario in (spec.headline, list(measured)[-1]):
        env = made(env_id, scenario=scenario, perception="model")
        policy, took_s, count = make_policy(spec.reference, env, 1), 0.0, 0
        for seed in range(100, 112):
            observation, _ = begin(env, seed, None)
            for decision in decisions(env, policy, observation):
                took_s += sum(decision.info["phases_s"].values())
                count += 1
        assert count / env.metadata["render_fps"] == pytest.approx(took_s, rel=0.2), scenario
        env.close()


def test_frames_keep_the_simulated_clock_and_follow_the_motion():
    """Decisions last for no whole number of frames; what is left over is not lost."""
    env = made(HOE)
    _, info = env.reset(seed=3)
    frames: list[np.ndarray] = []
    filming = Filming(env, frames.append, 30.0, "", info["scorecard"])
    took_s, decided = 0.0, 0
    while took_s < 3.0:
        *_, info = env.step(int(info["action_mask"].argmax()))
        filming.took(info)
        took_s, decided = took_s + sum(info["phases_s"].values()), decided + 1
        assert -1e-3 < len(frames) - 30.0 * took_s < 1.0
    filming.end()
    env.step(int(info["action_mask"].argmax()))
    assert -1e-3 < len(frames) - 30.0 * took_s < 1.0
    moved = [bool(np.any(a != b)) for a, b in pairwise(frames)]
    assert sum(moved) > 0.9 * len(moved) and decided < 0.5 * len(frames)
    env.close()


class Short(gym.Wrapper[Any, Any, Any, Any]):
    """Ends after three decisions."""

    count = 0

    def reset(self, **options: Any) -> Any:
        self.count = 0
        return self.env.reset(**options)

    def step(self, action: Any) -> Any:
        observation, reward, terminated, _, info = self.env.step(action)
        self.count += 1
        return observation, reward, terminated, self.count >= 3, info


def test_the_wrapper_writes_a_whole_file_an_episode(tmp_path: Path):
    imageio = pytest.importorskip("imageio.v2", reason="the bench extra is not installed")
    pytest.importorskip("imageio_ffmpeg", reason="the bench extra is not installed")
    folder = tmp_path / "videos"
    env = RecordField(Short(made(HOE, height=65)), folder, episode_trigger=lambda k: k != 1, fps=10)
    plain = Short(made(HOE))
    took_s = []
    for seed in (3, 4, 5):
        over, took = False, 0.0
        _, info = env.reset(seed=seed)
        plain.reset(seed=seed)
        while not over:
            action = int(info["action_mask"].argmax())
            _, reward, terminated, truncated, info = env.step(action)
            *known, expected = plain.step(action)[1:]
            assert known == [reward, terminated, truncated]
            assert all(expected[name] == info[name] for name in ("rewards", "phases_s", "scorecard"))
            over, took = terminated or truncated, took + sum(info["phases_s"].values())
        took_s.append(took)
    env.reset(seed=6)
    env.close()
    env.close()
    plain.close()
    assert [path.name for path in env.files] == [f"field-episode-{k}.mp4" for k in (0, 2, 3)]
    assert sorted(path.name for path in folder.iterdir()) == [path.name for path in env.files]
    for path, long_s in zip(env.files, (took_s[0], took_s[2], 0.05), strict=True):
        frames = imageio.mimread(path, memtest=False)
        assert -1e-3 < len(frames) - 10.0 * long_s < 1.0
        # A picture of 65 rows, and its lines; videos have an even number of rows.
        assert frames[0].shape == (65 + wrappers._BAR_PX - 1, 96, 3)


def test_the_wrapper_refuses_what_it_cannot_record(tmp_path: Path):
    env = made(HOE)
    with pytest.raises(ValueError, match=r"fps = 0: give 1\.\.240"):
        RecordField(env, tmp_path, fps=0)
    with pytest.raises(ValueError, match=r"speed = 0.0: give a positive"):
        RecordField(env, tmp_path, speed=0.0)
    env.close()
    with pytest.raises(ValueError, match="none of fieldgym's environments"):
        RecordField(gym.make("CartPole-v1"), tmp_path)


def test_lines_stand_under_the_picture_and_fit_into_it():
    picture = np.full((40, 200, 3), 90, np.uint8)
    longer = "a machine whose name is longer than the picture is wide, by far, with everything it can do"
    both = wrappers.captioned(picture, (longer, "12.3 s    net rate 50.0 %"))
    assert np.array_equal(both[:40], picture) and both.shape[1:] == picture.shape[1:]
    written = np.abs(both[40:].astype(int) - both[40:43, :3].mean(axis=(0, 1))).sum(axis=-1) > 60
    columns = np.flatnonzero(written.any(axis=0))
    assert columns[0] >= 5 and 150 < columns[-1] < 195


def test_two_play_beside_each_other_until_both_have_ended():
    def play(hand: Any, count: int, value: int) -> int:
        for _ in range(count):
            hand(np.full((4, 4, 3), value, np.uint8))
        return value

    frames: list[np.ndarray] = []
    assert film(frames.append, [lambda hand: play(hand, 3, 1), lambda hand: play(hand, 30, 2)]) == [1, 2]
    assert len(frames) == 30
    assert all((frame[:, :4] == 1).all() and (frame[:, 4:] == 2).all() for frame in frames)

    def breaks(hand: Any) -> int:
        hand(np.zeros((4, 4, 3), np.uint8))
        raise ArithmeticError("the gripper is stuck")

    with pytest.raises(ArithmeticError, match="stuck"):
        film(frames.append, [lambda hand: play(hand, 10**9, 1), breaks])


@pytest.mark.slow
def test_the_command_films_two_policies_on_the_same_field(tmp_path: Path):
    imageio = pytest.importorskip("imageio.v2", reason="the bench extra is not installed")
    pytest.importorskip("imageio_ffmpeg", reason="the bench extra is not installed")
    path = tmp_path / "hoes.mp4"
    words = ["run", "HoeWeeding", "--policy", "fifo", "--against", "nearest", "--backend", "analytic"]
    words += ["--set", "scenario.strip_m=1.5", "--video", str(path), "--camera", "tool", "--speed", "20"]
    result = CliRunner().invoke(cli.app, words)
    assert result.exit_code == 0, result.output
    assert "fifo, seed 0" in result.output and "nearest, seed 0" in result.output
    ends_s = [float(line.split()[2]) for line in result.output.splitlines() if line.startswith(("fifo ", "nearest "))]
    frames = imageio.mimread(path, memtest=False)
    assert frames[0].shape == (480 + wrappers._BAR_PX, 1440, 3)
    assert abs(len(frames) - max(ends_s) * FRAMES_PER_SECOND / 20.0) <= 1.0


@pytest.mark.parametrize("words", [["--against", "nearest"], ["--camera", "tool"]])
def test_what_is_of_films_needs_one(words: list[str]):
    result = CliRunner().invoke(cli.app, ["run", "HoeWeeding", *words])
    assert result.exit_code != 0 and "give --video FILE.mp4" in str(result.exception)
