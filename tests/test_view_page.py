"""The browser view's server and its replays: what pages do changes nothing, and a replay is whole by itself."""

import re
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from typer.testing import CliRunner

from fieldgym.agents import make_policy
from fieldgym.agents.policies.base import act_single
from fieldgym.scripts import cli
from fieldgym.scripts.view import seat_of
from fieldgym.viewer import panels
from fieldgym.viewer.play import Play

pytest.importorskip("viser", reason="the view extra is not installed")

HOE, LASER = "fieldgym/HoeWeeding-v0", "fieldgym/LaserWeeding-v0"
SETTINGS = {"backend": "analytic"}


def viewer_of(play: Play, **options: Any) -> Any:
    from fieldgym.viewer.show import Viewer

    return Viewer(play, seat_of, port=0, bounded=False, **options)


def unseen(play: Play, name: str, actions: list[int]) -> list[tuple[int, float, dict[str, float]]]:
    """The same decisions of a policy without a viewer."""
    env = gym.make(play.env_id, disable_env_checker=True, **play.settings)
    policy = make_policy(name, env, 1)
    observation, _ = env.reset(seed=play.seed)
    found = []
    for _ in actions:
        action = act_single(policy, observation)
        observation, reward, _, _, info = env.step(action)
        found.append((action, float(reward), info["scorecard"]))
    env.close()
    return found


def noted(seat: Any) -> list[tuple[int, float, dict[str, float]]]:
    return [(entry.action, entry.reward, entry.scorecard) for entry in seat.log]


def test_two_policies_play_the_same_field_as_they_would_alone():
    play = Play(HOE, "fifo", "nearest", seed=3, settings=SETTINGS)
    viewer = viewer_of(play, speed=16.0)
    try:
        viewer.set_running(True)
        for _ in range(12):
            viewer.go_on(0.4)
        assert viewer.updates > 20
        for seat, name in zip(viewer.seats, ("fifo", "nearest"), strict=True):
            assert len(seat.log) > 5 and seat.policy.name == name
            assert noted(seat) == unseen(play, name, seat.log)
            assert abs(seat.now_s - viewer.now_s) < 2.0
    finally:
        viewer.close()


def test_one_decision_stops_and_a_new_seed_is_another_field():
    viewer = viewer_of(Play(LASER, "fifo", seed=3, settings=SETTINGS))
    try:
        assert not viewer.running
        viewer.single()
        for _ in range(200):
            if viewer.running:
                viewer.go_on(0.05)
        assert len(viewer.seats[0].log) == 1 and not viewer.running
        last = viewer.seats[0].layout.actions - 1
        viewer.single(last)
        for _ in range(200):
            if viewer.running:
                viewer.go_on(0.05)
        assert viewer.seats[0].log[1].by_hand and viewer.seats[0].log[1].action == last
        before = viewer.seats[0].belief.true_m
        viewer.load(Play(LASER, "edf", seed=4, settings=SETTINGS))
        assert viewer.seats[0].policy.name == "edf" and not viewer.seats[0].log
        after = viewer.seats[0].belief.true_m
        assert before.shape != after.shape or np.abs(before - after).max() > 0.01
    finally:
        viewer.close()


def test_a_policy_that_cannot_be_made_leaves_what_is_played():
    viewer = viewer_of(Play(LASER, "fifo", settings=SETTINGS))
    try:
        viewer.single()
        seat = viewer.seats[0]
        with pytest.raises(ValueError, match="unknown"):
            viewer.load(Play(LASER, "no-such", settings=SETTINGS))
        assert viewer.seats == [seat] and viewer.play.policy == "fifo"
        viewer.go_on(0.5)
    finally:
        viewer.close()


def test_a_click_means_the_candidate_on_its_ray():
    viewer = viewer_of(Play("fieldgym/SafflowerPicking-v0", "fixed-order", settings=SETTINGS))
    try:
        belief = viewer.seats[0].belief
        there = np.flatnonzero(np.isfinite(belief.slot_m[:, 0]))
        eye = np.array([0.4, -2.0, 1.5])
        for slot in (int(there[0]), int(there[-1])):
            place = belief.slot_m[slot] - viewer._mirrors[0].middle + viewer._mirrors[0].place
            viewer.pick_along(eye, place - eye)
            assert viewer.picked == slot
        viewer.pick_along(eye, (0.0, 0.0, 1.0))
        assert viewer.picked is None
    finally:
        viewer.close()


def test_a_replay_is_whole_by_itself(tmp_path: Path):
    path = tmp_path / "hoe.html"
    words = ["view", "HoeWeeding", "--policy", "edf", "--record", str(path), "--seconds", "12"]
    result = CliRunner().invoke(cli.app, words)
    assert result.exit_code == 0, result.output
    html = path.read_text("utf-8")
    assert len(html) < 2e6
    assert not re.findall(r"""(?:src|href)\s*=\s*["'](?:https?:)?//""", html), "fetched from the network"
    play = Play(HOE, "edf", settings=SETTINGS)
    shown = int(re.search(r"edf: (\d+) decisions", html).group(1))  # type: ignore[union-attr]
    last = unseen(play, "edf", list(range(shown)))[-1][2]
    table = html[html.index('<details open id="fieldgym"') :]
    for name in ("net_rate", "cycle_time_s", "duration_s", "missed"):
        assert f">{panels.figure(name, last[name])}</td>" in table
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--port", "70000"], "--port 70000: give 0..65535"),
        (["--record", "replay.mp4"], "name a file that ends in .html"),
        (["--seconds", "5"], "give --record"),
        (["--field", "nowhere.yaml"], "there is no such file"),
        (["--against", "nobody-at-all"], "is unknown"),
        (["--seed", "-1"], "give 0 or more"),
    ],
)
def test_what_is_wrong_is_told_in_one_line(words: list[str], told: str):
    result = CliRunner().invoke(cli.app, ["view", "HoeWeeding", *words])
    assert result.exit_code != 0 and told in str(result.exception) and "\n" not in str(result.exception)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems always have a display")
def test_human_mode_without_a_display_shows_its_scenes_on_a_page(monkeypatch, capsys):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setattr("fieldgym.envs.screen.time.sleep", lambda seconds: None)
    env: Any = gym.make(HOE, backend="analytic", render_mode="human").unwrapped
    _, info = env.reset(seed=4)
    page = env._screen._page
    told = capsys.readouterr().err
    assert f"http://127.0.0.1:{page.server.get_port()}" in told and told.count("no display here") == 1
    machine = page._mirror._shown["machine"]
    for _ in range(3):
        *_, info = env.step(int(info["action_mask"].argmax()))
    assert np.abs(page._mirror._shown["machine"].shift - machine.shift).max() > 0.005
    twin = gym.make(HOE, backend="analytic")
    _, expected = twin.reset(seed=4)
    for _ in range(3):
        *_, expected = twin.step(int(expected["action_mask"].argmax()))
    assert expected["scorecard"] == info["scorecard"]
    twin.close()
    env.close()
    env.close()


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems always have a display")
def test_human_mode_with_neither_says_what_to_install(monkeypatch):
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.setitem(sys.modules, "viser", None)
    env: Any = gym.make(HOE, backend="analytic", render_mode="human").unwrapped
    with pytest.raises(RuntimeError, match=r"fieldgym\[view\]") as error:
        env.reset(seed=4)
    assert "\n" not in str(error.value) and "rgb_array" in str(error.value)
    env.close()
