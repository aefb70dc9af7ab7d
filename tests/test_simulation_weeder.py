"""The weeder in PyBullet: spot error while following, closure, force limits, agreement of the backends."""

from typing import Any

import numpy as np
import pytest

from fieldgym.agents import act_single
from fieldgym.agents.policies.weeding import EarliestDeadline
from fieldgym.envs.weeding.tools.laser.aim import LaserReach, poses
from fieldgym.envs.weeding.tools.laser.env import LaserWeedingEnv
from fieldgym.motion import QUINTIC
from fieldgym.simulation.weeder import WeederMachine
from fieldgym.simulation.weeder_model import WeederParameters

REACH = LaserReach()


def drive(machine, speed, follow_s=0.9, move_s=0.40):
    """Move between two far corners of the window, then follow; returns what was wanted and what was seen."""
    dt = 1.0 / machine.parameters.physics_hz
    start, goal = np.array([0.0, 0.18, -0.18]), np.array([0.12, -0.15, 0.18])
    n, k = int(move_s / dt), int(follow_s / dt)
    share = QUINTIC.shape(np.linspace(0.0, 1.0, n + 1))[0]
    beam = np.concatenate([start + share[:, None] * (goal - start), np.repeat(goal[None], k, axis=0)])
    cart = speed * dt * np.arange(len(beam))
    pose = poses(REACH, beam, cart)
    machine.reset(0.0, pose[0], speed)
    report = machine.run(cart, pose, REACH.target_height_m, np.ones(len(cart), bool))
    return np.column_stack([beam[:, 0] + beam[:, 1], beam[:, 2]]), report, n


@pytest.mark.parametrize("speed", [0.1, 0.3])
def test_the_spot_stands_still_on_the_weed_while_the_cart_drives(speed):
    with WeederMachine() as machine:
        wanted, report, moved = drive(machine, speed)
        error = np.hypot(*(report.beam - wanted).T)[moved + 1 :]
        assert error.max() < 0.5e-3
        assert report.closure_error_m < 0.5e-3
        assert not report.saturated.any()


def test_weak_actuators_saturate_and_say_so():
    with WeederMachine(WeederParameters(leg_force_limit_n=40.0)) as machine:
        _, report, _ = drive(machine, 0.1)
        assert report.saturated[1:].any()
        assert np.all(report.peak_effort[1:] <= 40.0 + 1e-6)


def test_the_beam_at_rest_is_where_the_closed_form_says():
    with WeederMachine() as machine:
        for beam in ([0.1, 0.15, -0.1], [-0.1, -0.2, 0.2], [0.0, 0.0, 0.0]):
            pose = poses(REACH, np.array([beam]), np.array([2.0]))[0]
            pose[0] += 2.0
            machine.reset(2.0, pose)
            expected = [2.0 + beam[0] + beam[1], beam[2]]
            assert machine.beam_world(REACH.target_height_m) == pytest.approx(expected, abs=1e-6)


def test_a_jump_is_refused():
    with WeederMachine() as machine:
        pose = machine.parameters.mechanism.home_pose
        with pytest.raises(ValueError, match="starts"):
            machine.run(np.array([0.1, 0.1]), np.stack([pose, pose]))


@pytest.mark.slow
def test_backends_agree():
    scores = {}
    for backend in ("analytic", "pybullet"):
        env: Any = LaserWeedingEnv("load-1.25", backend, "model")
        rule = EarliestDeadline(env.core.config)
        rows = []
        for seed in range(3):
            observation, info = env.reset(seed=seed)
            over = False
            while not over:
                observation, _, end, cut, info = env.step(act_single(rule, observation))
                over = end or cut
            rows.append([info["scorecard"]["net_rate"], info["scorecard"]["cycle_time_s"]])
        env.close()
        scores[backend] = np.mean(rows, axis=0)
    assert abs(scores["pybullet"][0] - scores["analytic"][0]) < 0.015
    assert abs(scores["pybullet"][1] / scores["analytic"][1] - 1.0) < 0.02
