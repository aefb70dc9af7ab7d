"""The transplanter's configuration refuses nonsense; what it takes gives observations inside their space."""

from dataclasses import replace
from typing import Any

import gymnasium as gym
import numpy as np
import pytest

from fieldgym.envs.transplanting.columns import SHOWN, C, M, candidate_table
from fieldgym.envs.transplanting.config import (
    SCENARIOS,
    MachineConfig,
    PerceptionModel,
    ProcessConfig,
    TransplantingConfig,
    Tray,
)
from fieldgym.envs.transplanting.core import TransplantingCore
from fieldgym.kernels.config import Config, ConfigError, override
from fieldgym.kernels.config_fields import entries

ID = "fieldgym/TrayTransplanting-v0"
PROCESS = ProcessConfig()


SHORT: Any = ((1.0, 0.0, 0.0),) * 2, ((1.0, 0.0, 0.0),) * 3


@pytest.mark.parametrize(
    ("make", "word"),
    [
        (lambda: gym.make(ID, scenario="orchard"), "scenario"),
        (lambda: gym.make(ID, motion="jump"), "motion"),
        (lambda: gym.make(ID, source_tray=73), "source_tray"),
        (lambda: gym.make(ID, target_tray=128), "target_tray"),
        (lambda: gym.make(ID, backend="gazebo"), "backend"),
        (lambda: gym.make(ID, perception="lidar"), "perception"),
        (lambda: gym.make_vec(ID, num_envs=0), "num_envs"),
        (lambda: gym.make_vec(ID, num_envs=2, backend="pybullet"), "batched"),
        (lambda: Tray(10, 20, 0.03), "columns"),
        (lambda: replace(SCENARIOS["fill"], vacancy=1.2), "vacancy"),
        (lambda: replace(SCENARIOS["fill"], target_trays=0), "target_trays"),
        (lambda: replace(PROCESS, extraction=float("nan")), "extraction"),
        (lambda: replace(PROCESS, plug_kg=0.4), "plug_kg"),
        (lambda: MachineConfig(lift_m=0.2), "lift_m"),
        (lambda: MachineConfig(straight_m=0.16), "straight_m"),
        (lambda: MachineConfig(carry_acceleration_m_s2=(10.0, 20.0, 70.0)), "carry_acceleration_m_s2"),
        (lambda: TransplantingConfig(machine=MachineConfig(tray_centre_m=0.25)), "tray_centre_m"),
        (lambda: PerceptionModel(*SHORT), "source"),
    ],
)
def test_bad_settings_are_named(make, word):
    with pytest.raises(ValueError, match=word) as caught:
        make()
    assert "\n" not in str(caught.value)


def numbers(cls: type, path: str = "") -> list[Any]:
    """Every field of one or more numbers, with its dotted name."""
    found = []
    for entry in entries(cls).values():
        if entry.nested is not None and issubclass(entry.nested, Config):
            found += numbers(entry.nested, f"{path}{entry.name}.")
        elif entry.nested is None and entry.type is not str and entry.type is not bool and not entry.declared.choices:
            found.append(pytest.param(f"{path}{entry.name}", entry, id=f"{path}{entry.name}"))
    return found


FIELDS = numbers(TransplantingConfig)


@pytest.mark.parametrize(("name", "entry"), FIELDS)
def test_every_number_is_refused_in_a_line_or_gives_observations_inside_their_space(name, entry):
    """Other fields stay at their defaults."""
    default: Any = TransplantingConfig()
    for part in name.split("."):
        default = getattr(default, part)
    low, high = entry.declared.low, entry.declared.high
    odd = [np.nan, np.inf, -np.inf, None, "7", True, 1e300, -1e300, 0, 0.0, -1, 1, 2, 3.5, 1e-9, 1e3, 10**40, [1.0], {}]
    ends = [low, high, np.nextafter(low, -np.inf), np.nextafter(high, np.inf), 0.5 * (low + high)]
    near = [default] if isinstance(default, tuple) else [default, 0.9 * default, 1.1 * default]
    played = 0
    for value in [*odd, *ends, *near, *([int(low), int(high)] if entry.type is int else [])]:
        for shown in (value, (value,) * 3):
            try:
                config = override(TransplantingConfig(), {name: shown})
                env = gym.make(ID, backend="analytic", perception="perfect", config=config, disable_env_checker=True)
            except ConfigError as error:
                # A rule between fields may name another one of the same part.
                assert "\n" not in str(error) and error.path.startswith(name.rpartition(".")[0]), str(error)
                continue
            observation, info = env.reset(seed=1)
            rng = np.random.default_rng(0)
            for _ in range(4):
                assert env.observation_space.contains(observation)
                step = env.step(int(rng.choice(np.flatnonzero(info["action_mask"]))))
                observation, reward, info = step[0], step[1], step[-1]
                assert np.isfinite([reward, *info["scorecard"].values(), *info["phases_s"].values()]).all()
                assert all(np.isfinite(part).all() for part in observation.values())
                if step[2] or step[3]:
                    break
            assert env.observation_space.contains(observation)
            played += 1
    assert played, "no value at all was taken"


@pytest.mark.parametrize("name", [field.id for field in FIELDS if field.values[1].declared.unit == "m"])
def test_millimetres_are_no_metres(name):
    config = TransplantingConfig()
    value: Any = config
    for part in name.split("."):
        value = getattr(value, part)
    if np.isfinite(value):
        with pytest.raises(ConfigError, match=name.split(".")[-1]):
            override(config, {name: 1e3 * (value or 1e-3)})


def test_slow_machines_and_short_limits_are_shown_at_the_end_of_the_space():
    machine = MachineConfig(velocity_m_s=0.02)
    scenario = replace(SCENARIOS["replug"], time_limit_s=1e-3)
    core = TransplantingCore(TransplantingConfig(scenario=scenario, machine=machine), PerceptionModel.perfect(), 1)
    core.reset_rows(np.array([0]), [np.random.default_rng(0)])
    candidates = candidate_table(core.observe())[0]
    there = candidates[:, C.present] > 0.0
    assert (candidates[there][:, [C.carry, C.approach]] == SHOWN).all()
    core.apply((plan := core.plan(np.array([core.action_space.n - 1]))), core.nominal(plan))
    assert core.observe()["machine"][0, M.time] == SHOWN
