"""Machines within their motors: what they can give is planned, what they cannot hold is refused."""

import re
from dataclasses import replace

import gymnasium as gym
import numpy as np
import pytest

import fieldgym  # noqa: F401
from fieldgym.envs.motors import ALL, PLANNED, Motions, Motor, shares
from fieldgym.envs.safflower import motors as safflower
from fieldgym.envs.safflower.config import SafflowerConfig
from fieldgym.envs.sorting import motors as sorting
from fieldgym.envs.sorting.config import SortingConfig
from fieldgym.envs.transplanting import motors as transplanting
from fieldgym.envs.transplanting.config import MOTIONS, TransplantingConfig
from fieldgym.envs.weeding.tools.hoe import motors as hoe
from fieldgym.envs.weeding.tools.hoe.config import HoeWeedingConfig
from fieldgym.envs.weeding.tools.laser import motors as laser
from fieldgym.envs.weeding.tools.laser.config import WeedingConfig
from fieldgym.kernels.config import ConfigError, override
from fieldgym.mechanisms.bodies import EffortTerms
from fieldgym.motion import QUINTIC
from fieldgym.motion.efforts import law_columns
from fieldgym.scripts.machine_limits import MACHINES, try_random

PICKER, TRANSPLANTER, SORTER, LASER, HOE = (
    "SafflowerPicking",
    "TrayTransplanting",
    "ProduceSorting",
    "LaserWeeding",
    "HoeWeeding",
)
WEAK = {
    PICKER: {"machine.picker.arm_torque_limit_n_m": 8.3},
    TRANSPLANTER: {"machine.torque_limit_n_m": 25.0},
    SORTER: {"machine.sorter.slider_force_limit_n": 40.0},
    LASER: {"machine.leg_force_limit_n": 120.0},
    HOE: {"machine.platform_mass_kg": 3.6},
}
"""Motors, or a load, at which every machine still works, but more slowly."""
HELPLESS = {
    PICKER: ({"machine.picker.arm_torque_limit_n_m": 6.0}, "machine.picker.arm_torque_limit_n_m", 8.02, "N m"),
    TRANSPLANTER: ({"machine.torque_limit_n_m": 8.0}, "machine.torque_limit_n_m", 8.33, "N m"),
    SORTER: ({"machine.sorter.slider_force_limit_n": 20.0}, "machine.sorter.slider_force_limit_n", 26.9, "N"),
    LASER: ({"machine.leg_force_limit_n": 75.0}, "machine.leg_force_limit_n", 79.9, "N"),
    HOE: ({"machine.slider_force_limit_n": 60.0}, "machine.slider_force_limit_n", 80.4, "N"),
}


def make(task, backend, overrides):
    return gym.make(f"fieldgym/{task}-v0", backend=backend, perception="perfect", overrides=overrides)


def test_shipped_machines_have_motors_that_suffice():
    # The fits take that for granted and look no further.
    config = SafflowerConfig()
    assert safflower.fitted(config.machine) is config.machine
    machine = TransplantingConfig().machine
    for motion in MOTIONS:
        assert transplanting.motor_shares(replace(machine, motion=motion), 0.3) == ALL
    sorter = SortingConfig()
    assert sorting.motor_shares(sorter.machine, sorter.belt.speed_m_s, sorting.heaviest_kg(sorter)) == ALL
    weeder, hoeing = WeedingConfig(), HoeWeedingConfig()
    assert laser.motor_shares(weeder.reach, weeder.parameters, weeder.cart.acceleration_m_s2) == ALL
    assert hoe.motor_shares(hoeing.reach, hoeing.process, hoeing.parameters) == ALL


FITS = {
    PICKER: (SafflowerConfig(), safflower.within_motors),
    TRANSPLANTER: (TransplantingConfig(), transplanting.within_motors),
    SORTER: (SortingConfig(), sorting.within_motors),
    LASER: (WeedingConfig(), laser.within_motors),
    HOE: (HoeWeedingConfig(), hoe.within_motors),
}


@pytest.mark.parametrize("task", FITS)
def test_what_was_fitted_fits(task):
    plain, fit = FITS[task]
    fitted = fit(override(plain, WEAK[task]))
    assert fitted != override(plain, WEAK[task])
    assert fit(fitted) == fitted


@pytest.mark.parametrize("task", HELPLESS)
def test_what_cannot_be_held_is_refused_in_one_line(task):
    overrides, setting, least, unit = HELPLESS[task]
    with pytest.raises(ConfigError) as refused:
        make(task, "analytic", overrides)
    line = str(refused.value)
    (limit,) = overrides.values()
    assert "\n" not in line
    assert f"{setting} = {limit:g} {unit}: the motor needs " in line
    needed = float(re.findall(r"needs ([\d.]+)", line)[0])
    assert needed == pytest.approx(least, rel=0.02)
    # What the line asks for is enough.
    make(task, "analytic", {setting: 1.01 * needed}).close()


DECISIONS = 12
MOVING = ("travel", "carry", "approach", "move")
"""Phases in which the tool goes somewhere; a task has some of them."""


def moving_s(task, backend, overrides):
    """Seconds of moving in ``DECISIONS`` for the first possible action."""
    env = make(task, backend, overrides)
    _, info = env.reset(seed=3)
    seconds = 0.0
    for _ in range(DECISIONS):
        _, _, terminated, truncated, info = env.step(int(info["action_mask"].argmax()))
        seconds += sum(info["phases_s"].get(phase, 0.0) for phase in MOVING)
        if terminated or truncated:
            break
    env.close()
    return seconds


@pytest.mark.parametrize("task", WEAK)
def test_weak_motors_take_longer_and_pybullet_follows(task):
    planned = moving_s(task, "analytic", WEAK[task])
    assert planned > 1.01 * moving_s(task, "analytic", {})
    # A decision ends with a whole step of the simulation, and with a look at whether the tool rests.
    assert abs(moving_s(task, "pybullet", WEAK[task]) - planned) < 0.02 * DECISIONS


def test_shares_lower_what_limits_a_motion():
    """One motor, one motion of a mass of 1 kg over 1 m: its peak force is 10 / sqrt(3) / T^2."""
    _, _, acceleration = law_columns(QUINTIC, 1001)
    terms = EffortTerms(acceleration[None], 0.0 * acceleration[None], 0.0 * acceleration[None])
    force = 20.0
    motor = (Motor("force_n", force / PLANNED, "N"),)
    slow, fast = np.array([QUINTIC.duration(1.0, np.inf, 40.0)]), np.array([0.4])
    found = shares(Motions(terms, slow, slow), motor, "Crane")
    assert found.speed == 1.0 and found.acceleration == pytest.approx(0.5, rel=1e-5)
    shortest = np.sqrt(QUINTIC.peak_acceleration / force)
    found = shares(Motions(terms, fast, fast / 2.0), motor, "Crane")
    assert found.acceleration == 1.0 and found.speed == pytest.approx(0.4 / shortest, rel=1e-5)
    assert shares(Motions(terms, 2.0 * slow, slow), motor, "Crane") == ALL


LIMITS = {
    PICKER: lambda c: (c.machine.picker.tool_acceleration_m_s2, c.machine.picker.cart_acceleration_m_s2),
    TRANSPLANTER: lambda c: (c.machine.acceleration_m_s2, *c.machine.carry_acceleration_m_s2),
    SORTER: lambda c: (c.machine.sorter.acceleration_m_s2, c.machine.sorter.turn_rad_s2, -c.machine.shortest_move_s),
    LASER: lambda c: (c.reach.travel_acceleration_m_s2, c.reach.lean_acceleration_m_s2),
    HOE: lambda c: (c.reach.acceleration_m_s2, c.process.plunge_acceleration_m_s2, c.process.stir_acceleration_m_s2),
}
"""What stronger motors can only raise and a heavier tool only lower."""


@pytest.mark.parametrize("task", LIMITS)
def test_accelerations_fall_with_the_mass_and_rise_with_the_motors(task):
    plain, fit = FITS[task]
    machine = MACHINES[task]

    def found(limit, mass):
        try:
            return np.array(LIMITS[task](fit(override(plain, machine.scaled(limit, mass)))))
        except ConfigError:
            return np.full(len(LIMITS[task](plain)), -np.inf)

    # From refusal through slower motions to what was asked for.
    factors = (0.05, 0.25, 0.35, 0.8, 2.0)
    by_limit = np.array([found(limit, 1.0) for limit in factors])
    by_mass = np.array([found(0.8, mass) for mass in (1.0, 2.0, 3.0)])
    assert np.all(by_limit[1:] >= by_limit[:-1]) and np.all(by_mass[1:] <= by_mass[:-1])
    assert np.all(by_limit[0] == -np.inf) and np.array_equal(by_limit[-1], LIMITS[task](plain))


@pytest.mark.slow
@pytest.mark.parametrize("task", LIMITS)
@pytest.mark.parametrize(("backend", "number"), [("analytic", 40), ("pybullet", 8)])
def test_any_machine_is_made_or_refused_in_a_line_and_never_raises_in_step(task, backend, number):
    counts = try_random(task, number, backend)
    assert counts["played"] + counts["refused"] == number and counts["played"] > 0.3 * number
