"""What the speed command says of parts of a step adds up, and its threads play the same decisions."""

from typing import Any

import gymnasium as gym
import pytest

from fieldgym.envs import env_ids
from fieldgym.scripts import speed
from fieldgym.scripts.speed_parts import Parts, parts_of
from fieldgym.scripts.speed_threads import processes, speed_up


def test_every_section_is_one_of_the_command():
    assert {"decisions", "resets", "threads", "profile"} <= set(speed.SECTIONS)


def test_parts_of_a_step_are_told_by_what_ran(monkeypatch: pytest.MonkeyPatch) -> None:
    env_id, calls = env_ids()[0], []
    made = gym.make_vec

    def watched(*args, **kwargs):
        env: Any = made(*args, **kwargs)
        core: Any = env.unwrapped.core
        draw = core.draw
        core.draw = lambda generators: (calls.append(len(generators)), draw(generators))[1]
        return env

    monkeypatch.setattr(gym, "make_vec", watched)
    parts = parts_of(env_id, 3, 2)
    assert calls == [3, 3]  # both resets, before deciding and before timing, are no part of a step
    assert parts.draw == parts.load == parts.show == parts.resets == 0.0
    assert parts.kernels > 0.0 and parts.info > 0.0 and parts.python > 0.0


def test_shares_are_of_the_whole():
    parts = Parts(kernels=50.0, draw=20.0, load=6.0, show=4.0, info=5.0, python=15.0)
    assert parts.whole == 100.0 and parts.resets == pytest.approx(0.3)
    assert str(parts) == "kernels 50 %, draw 20 %, load 6 %, show 4 %, info 5 %, python 15 %"


def test_threads_and_processes_are_measured():
    assert speed_up(env_ids()[0], 4, 5) > 0.0
    assert processes(1_000) > 0.0
