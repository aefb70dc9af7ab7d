"""Closed-form motor efforts against PyBullet's, and durations under effort limits against brute force."""

import numpy as np
import pytest

from fieldgym.mechanisms.bodies import effort_terms
from fieldgym.motion import QUINTIC
from fieldgym.motion.efforts import duration_under_efforts, duration_under_rates, law_columns
from fieldgym.motion.orientation import angle_between, conjugate, euler_angles, product, slerp, tilted
from fieldgym.simulation.dynamics import picker_dynamics, prrs_dynamics, transplanter_dynamics, weeder_dynamics
from fieldgym.simulation.hoe import HoeMachine
from fieldgym.simulation.hoe_model import HoeParameters
from fieldgym.simulation.picker import PickerMachine
from fieldgym.simulation.picker_model import PickerParameters, picker_joints
from fieldgym.simulation.sorter import SorterMachine
from fieldgym.simulation.sorter_model import SorterParameters
from fieldgym.simulation.transplanter import TransplanterMachine
from fieldgym.simulation.transplanter_model import TransplanterParameters, transplanter_joints
from fieldgym.simulation.weeder import WeederMachine
from fieldgym.simulation.weeder_model import WeederParameters

HZ = 960.0
"""Finer than the environments simulate: what is compared is the physics, not the time step."""
SETTLING = 100
"""Steps in which the closures take up the weight before a motion is looked at."""


def law(duration_s):
    """Share of a stroke and its two derivatives, (n, 1) each, at ``HZ``."""
    time = np.arange(int(np.ceil(duration_s * HZ)) + 1) / HZ
    state = QUINTIC.sample(time, 1.0, duration_s)
    return state.position[:, None], state.velocity[:, None], state.acceleration[:, None]


def worst(machine, targets, efforts):
    """Largest deviation (motors,) of the closed form from what the motors applied, as a share of a motor's peak.

    A motor that hardly works in a motion is judged by a hundredth of its limit instead.
    """
    applied = []
    loop = machine._machine
    loop.follow(np.repeat(targets[:1], SETTLING, 0))
    loop.follow(targets, lambda row: applied.append(loop.motor_efforts()))
    # The drive in step k takes the machine from the speed before row k to the one after it.
    peak = np.maximum(np.abs(efforts).max(axis=0), 0.01 * np.array([motor.limit for motor in loop.motors]))
    return np.abs(np.array(applied) - efforts[:-1]).max(axis=0) / peak


def picker_errors(rng, motions):
    parameters = PickerParameters(physics_hz=HZ)
    bar, dynamics = parameters.five_bar, picker_dynamics(parameters)
    with PickerMachine(parameters) as machine:
        while motions:
            start, end = rng.uniform((0.1, -0.55), (0.48, -0.28), (2, 2))
            if not bar.reachable(np.linspace(start, end, 20)).all():
                continue
            motions -= 1
            s, v, a = law(max(float(QUINTIC.duration(np.linalg.norm(end - start), 0.5, 2.0)), 0.3))
            tool = start + s * (end - start)
            machine.reset(0.0, start)
            arm = picker_joints(parameters, np.zeros(len(s)), tool)[:, [0, 1, 3]]
            efforts = dynamics.efforts(tool, v * (end - start), a * (end - start))
            # The cart stands still, which takes no force: its column is left out.
            yield worst(machine, arm, np.column_stack([np.ones(len(s)), efforts]))[1:]


def transplanter_errors(rng, motions):
    parameters = TransplanterParameters(physics_hz=HZ)
    with TransplanterMachine(parameters) as machine:
        for _ in range(motions):
            payload = float(rng.choice([0.0, 0.05, 0.3]))
            start, end = rng.uniform((-0.3, -0.66), (0.3, -0.51), (2, 2))
            s, v, a = law(max(float(QUINTIC.duration(np.linalg.norm(end - start), 4.5, 60.0)), 0.06))
            tool = start + s * (end - start)
            machine.reset(start)
            machine.carry(payload)
            efforts = transplanter_dynamics(parameters, payload).efforts(tool, v * (end - start), a * (end - start))
            yield worst(machine, transplanter_joints(parameters, tool)[:, [0, 2]], efforts)


def prrs_errors(machine, rng, motions):
    parameters = machine.parameters
    dynamics = prrs_dynamics(parameters)
    with machine:
        while motions:
            start, end = rng.uniform((-0.15, -0.15, 0.0), (0.15, 0.15, 0.09), (2, 3))
            first, last = (tilted(rng.uniform(0, 0.3), rng.uniform(0, 6.3), rng.uniform(-0.7, 0.7)) for _ in "ab")
            angle = float(angle_between(first, last))
            s, v, a = law(
                QUINTIC.duration(np.array([np.linalg.norm(end - start), angle]), [1.0, 4.0], [10.0, 40.0]).max()
            )
            pose = np.concatenate([start + s * (end - start), euler_angles(slerp(first, last, s[:, 0]))], axis=1)
            if not parameters.mechanism.reachable(pose).all():
                continue
            motions -= 1
            turn = product(last, conjugate(first))
            axis = np.sign(turn[0]) * turn[1:] / np.linalg.norm(turn[1:])
            stroke = np.concatenate([end - start, angle * axis])
            machine.reset(pose[0])
            yield worst(machine, parameters.mechanism.inverse(pose), dynamics.efforts(pose, v * stroke, a * stroke))


def sorter_errors(rng, motions):
    return prrs_errors(SorterMachine(SorterParameters(physics_hz=HZ)), rng, motions)


def hoe_errors(rng, motions):
    return prrs_errors(HoeMachine(HoeParameters(physics_hz=HZ)), rng, motions)


def weeder_errors(rng, motions):
    parameters = WeederParameters(physics_hz=HZ)
    dynamics = weeder_dynamics(parameters)
    with WeederMachine(parameters) as machine:
        for _ in range(motions):
            start, end = rng.uniform((-0.15, 0.55, -0.23, -0.23), (0.15, 0.62, 0.23, 0.23), (2, 4))
            stroke = end - start
            s, v, a = law(QUINTIC.duration(stroke, [1.0, 1.0, 2.4, 2.4], [10.0, 10.0, 21.0, 21.0]).max())
            pose = start + s * stroke
            still = np.zeros_like(s)
            place, velocity, acceleration = (np.hstack([still, part]) for part in (pose, v * stroke, a * stroke))
            machine.reset(0.0, start)
            targets = np.concatenate([still, parameters.mechanism.inverse(pose)], axis=1)
            yield worst(machine, targets, dynamics.efforts(place, velocity, acceleration))


ERRORS = (picker_errors, transplanter_errors, sorter_errors, hoe_errors, weeder_errors)


@pytest.mark.parametrize("errors", ERRORS)
def test_efforts_are_what_pybullet_applies(errors):
    assert max(found.max() for found in errors(np.random.default_rng(1), 20)) < 0.10


@pytest.mark.slow
@pytest.mark.parametrize("errors", ERRORS)
def test_efforts_are_what_pybullet_applies_in_a_hundred_motions(errors):
    largest = [found.max() for found in errors(np.random.default_rng(2), 100)]
    assert max(largest) < 0.10 and np.median(largest) < 0.02


def test_viscous_friction_is_what_pybullet_brakes_with():
    parameters = TransplanterParameters(physics_hz=HZ, damping_n_m_s=2.0, friction_n_m=10.0)
    dynamics = transplanter_dynamics(parameters)
    start, stroke = np.array([-0.2, -0.6]), np.array([0.4, 0.05])
    s, v, a = law(0.3)
    tool = start + s * stroke
    efforts = dynamics.efforts(tool, v * stroke, a * stroke)
    braked = efforts + dynamics.rates(tool, v * stroke) * dynamics.viscous
    with TransplanterMachine(parameters) as machine:
        machine.reset(start)
        assert [motor.limit for motor in machine._machine.motors] == [80.0, 80.0]
        assert worst(machine, transplanter_joints(parameters, tool)[:, [0, 2]], braked).max() < 0.10
    # It is a good part of what the motors do here: without it the closed form is far off.
    assert np.abs(braked - efforts).max() > 0.5 * np.abs(efforts).max()


def test_soil_on_the_platform_is_carried_by_the_motors():
    dynamics = prrs_dynamics(HoeParameters())
    pose, still = dynamics.mechanism.home_pose + np.array([0.05, 0.02, 0.0, 0.0, 0.0, 0.0]), np.zeros(6)
    wrench = np.array([30.0, -10.0, 5.0, 1.0, -2.0, 0.5])
    felt = dynamics.efforts(pose, still, still, wrench=wrench) - dynamics.efforts(pose, still, still)
    np.testing.assert_allclose(felt, dynamics.mechanism.statics(pose, wrench), rtol=1e-9)


def transplanter_strokes():
    """Terms and limits of a handful of motions of the transplanter with friction, and their samples."""
    from dataclasses import replace

    dynamics = replace(transplanter_dynamics(TransplanterParameters(), 0.3), viscous=(1.5, 0.5))
    start = np.array([[-0.3, -0.66], [0.0, -0.51], [0.3, -0.6], [0.1, -0.55]])
    stroke = np.array([[0.0, 0.15], [0.3, 0.0], [-0.5, 0.05], [0.02, -0.03]])

    def terms(samples):
        s, v, a = law_columns(QUINTIC, samples)
        ways = stroke[:, None]
        return effort_terms(dynamics, start[:, None] + s * ways, v * ways, a * ways)

    return dynamics, start, stroke, terms


def test_terms_tell_the_efforts_of_any_duration():
    dynamics, start, stroke, terms = transplanter_strokes()
    for duration_s in (0.05, 0.2, 3.0):
        state = QUINTIC.sample(np.linspace(0.0, duration_s, 64), 1.0, duration_s)
        v, a = state.velocity[1:-1, None] * stroke[0], state.acceleration[1:-1, None] * stroke[0]
        place = start[0] + state.position[1:-1, None] * stroke[0]
        wanted = dynamics.efforts(place, v, a) + dynamics.rates(place, v) * dynamics.viscous
        np.testing.assert_allclose(terms(64).at(np.full((4, 1), duration_s))[0, 1:-1], wanted, rtol=1e-9, atol=1e-9)


def test_shortest_duration_is_where_the_limit_is_reached_first():
    _, _, _, terms = transplanter_strokes()
    limit = np.array([30.0, 40.0])
    found = duration_under_efforts(*terms(64), limit)
    for factor, within in ((1.0 + 1e-9, True), (1.001, True), (2.0, True), (20.0, True), (0.999, False)):
        efforts = np.abs(terms(64).at((factor * found)[:, None]))
        assert np.array_equal((efforts <= limit * (1.0 + 1e-9)).all(axis=(1, 2)), np.full(4, within))


def test_sixty_four_samples_are_enough():
    _, _, _, terms = transplanter_strokes()
    coarse, fine = (duration_under_efforts(*terms(n), 30.0) for n in (64, 1024))
    assert np.all(coarse <= fine * (1.0 + 1e-12)) and np.all(fine <= 1.005 * coarse)


def test_what_cannot_be_held_takes_forever():
    inertia, steady = np.ones((2, 3, 1)), np.array([[[1.0], [-2.0], [1.0]], [[1.0], [1.0], [1.0]]])
    assert np.array_equal(np.isinf(duration_under_efforts(inertia, 0.0 * inertia, steady, 1.5)), [True, False])


def test_an_effort_that_turns_round_before_its_limit_does_not_limit():
    # x - x^2 in x = 1 / T never reaches 1, but -1 where x^2 - x - 1 = 0: at the golden ratio.
    inertia, viscous, steady = -np.ones((1, 1)), np.ones((1, 1)), np.zeros((1, 1))
    assert duration_under_efforts(inertia, viscous, steady, 1.0) == pytest.approx(0.5 * (np.sqrt(5.0) - 1.0))


def test_rates_limit_by_their_order():
    _, v, a = law_columns(QUINTIC, 4097)
    assert duration_under_rates(0.6 * v, 4.5, 1) == pytest.approx(1.875 * 0.6 / 4.5, rel=1e-6)
    assert duration_under_rates(0.6 * a, 60.0, 2) == pytest.approx(np.sqrt(10.0 / np.sqrt(3.0) * 0.6 / 60.0), rel=1e-6)
