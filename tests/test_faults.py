"""A machine that cannot follow what it was told ends its decisions as faults, never as errors."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.envs.driven import RECOVERY_S
from fieldgym.kernels.config import override
from fieldgym.mechanisms.errors import UnreachablePoseError

HOPELESS = {
    "SafflowerPicking": {"machine.picker.arm_torque_limit_n_m": 3.0},
    "TrayTransplanting": {"machine.torque_limit_n_m": 4.0},
    "ProduceSorting": {"machine.sorter.slider_force_limit_n": 15.0},
    "LaserWeeding": {"machine.leg_force_limit_n": 30.0},
    "HoeWeeding": {"machine.slider_force_limit_n": 15.0},
}
"""Motors that no environment is made with: they are put in behind its back."""
GAIN = {"SafflowerPicking": "collected", "TrayTransplanting": "planted", "ProduceSorting": "placed"}


def hopeless(task):
    """An environment whose rules plan for the shipped machine and whose machine has hopeless motors."""
    env: Any = gym.make(f"fieldgym/{task}-v0", backend="pybullet", perception="perfect").unwrapped
    core = env.core
    sound, core.config = core.config, override(core.config, HOPELESS[task])
    env.executor.close()
    env.executor = type(env.executor)(core)
    core.config = sound
    return env


def play(env, decisions):
    observation, info = env.reset(seed=2)
    yield info
    for _ in range(decisions):
        observation, _, terminated, truncated, info = env.step(int(info["action_mask"].argmax()))
        assert all(np.isfinite(part).all() for part in observation.values())
        assert np.isfinite([*info["phases_s"].values(), *info["scorecard"].values()]).all()
        yield info
        if terminated or truncated:
            return


@pytest.mark.parametrize("task", HOPELESS)
def test_hopeless_motors_end_as_faults(task):
    env = hopeless(task)
    infos = list(play(env, 6))
    env.close()
    faults = [info["fault"] for info in infos[1:]]
    assert infos[0]["fault"] == "" and all(faults)
    assert "\n" not in faults[0] and "motors at their limits: " in faults[0] and "none" not in faults[0]
    assert "Weeding" in task or all(sum(info["phases_s"].values()) > RECOVERY_S for info in infos[1:])
    gain = GAIN.get(task, "killed")
    assert sum(info["rewards"][gain] for info in infos) < 0.5


@pytest.mark.parametrize("task", HOPELESS)
def test_sound_machines_have_no_faults(task):
    env: Any = gym.make(f"fieldgym/{task}-v0", backend="pybullet", perception="perfect").unwrapped
    assert [info["fault"] for info in play(env, 8)] == [""] * 9
    env.close()


@pytest.mark.parametrize("task", HOPELESS)
def test_a_way_beyond_the_limits_ends_as_a_fault(task, monkeypatch):
    env: Any = gym.make(f"fieldgym/{task}-v0", backend="pybullet", perception="perfect").unwrapped
    gain = GAIN.get(task, "killed")

    def refuse(*parts, **more):
        raise UnreachablePoseError("Machine", [0.0], "leg1_reach", -0.02)

    machine = env.executor._machine
    with monkeypatch.context() as patched:
        patched.setattr(machine, "hoe" if task == "HoeWeeding" else "run", refuse)
        for info in list(play(env, 2))[1:]:
            assert info["fault"] == "the way leaves the machine's limits: leg1_reach by 0.02"
            assert info["rewards"][gain] <= 0.0
            assert "Weeding" in task or sum(info["phases_s"].values()) > RECOVERY_S
    # The machine then stands where the rules say, and goes on.
    *_, info = env.step(int(env.action_masks().argmax()))
    assert info["fault"] == ""
    env.close()


def test_analytic_machines_have_no_faults():
    env: Any = gym.make("fieldgym/ProduceSorting-v0", backend="analytic")
    assert env.reset(seed=0)[1]["fault"] == "" == env.step(0)[-1]["fault"]
