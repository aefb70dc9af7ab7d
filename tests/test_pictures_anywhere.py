"""Pictures without PyBullet, and a window that says what is missing instead of ending the process."""

import subprocess
import sys
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.simulation.window import Window

WITHOUT = """
import sys
sys.modules["pybullet"] = None
import gymnasium as gym
import numpy as np
import fieldgym
env = gym.make("{}", backend="analytic", perception="camera", render_mode="rgb_array")
_, info = env.reset(seed=1)
frames = []
env.unwrapped.record(frames.append, 2.0)
env.step(int(np.flatnonzero(info["action_mask"])[0]))
assert frames and env.render().std() > 20.0
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "name", ["SafflowerPicking", "TrayTransplanting", "HoeWeeding", "LaserWeeding", "ProduceSorting"]
)
def test_the_analytic_backend_sees_and_draws_without_pybullet(name):
    subprocess.run([sys.executable, "-c", WITHOUT.format(f"fieldgym/{name}-v0")], check=True)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="other systems always have a display")
@pytest.mark.parametrize("display", [None, ":9731"])
def test_a_window_without_a_display_is_an_error_and_not_the_end(monkeypatch, display):
    if display is None:
        monkeypatch.delenv("DISPLAY", raising=False)
    else:
        monkeypatch.setenv("DISPLAY", display)
    window = Window("fields")
    with pytest.raises(RuntimeError, match="rgb_array"):
        window.show(np.zeros((4, 4, 3), np.uint8))
    window.close()
    window.close()
    window.show(np.zeros((4, 4, 3), np.uint8))


def test_a_window_follows_the_first_state_and_every_decision(monkeypatch):
    shown: list[np.ndarray] = []
    monkeypatch.setattr(Window, "open", lambda self: None)
    monkeypatch.setattr(Window, "show", lambda self, rgb: shown.append(rgb.copy()))
    monkeypatch.setattr("fieldgym.envs.screen.time.sleep", lambda seconds: None)
    env: Any = gym.make("fieldgym/SafflowerPicking-v0", backend="analytic", render_mode="human").unwrapped
    _, info = env.reset(seed=0)
    assert len(shown) == 1 and env.render() is None
    *_, info = env.step(int(info["action_mask"].argmax()))
    assert len(shown) == pytest.approx(1 + 20.0 * sum(info["phases_s"].values()), abs=4)
    assert not np.array_equal(shown[0], shown[-1])
    env.close()
