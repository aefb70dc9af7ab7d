"""The closed-loop hoe in PyBullet: tracking against the soil's resistance, reach, drawing along the row."""

from dataclasses import replace

import numpy as np
import pytest

from fieldgym.mechanisms.errors import UnreachablePoseError
from fieldgym.motion import QUINTIC
from fieldgym.simulation.hoe import HoeMachine
from fieldgym.simulation.hoe_model import HoeParameters

PARAMETERS = HoeParameters()
SPEED_M_S = 0.10


def stroke(ends, depth_m, radius_m, speed_m_s=SPEED_M_S) -> np.ndarray:
    """Poses relative to the cart: over ground to ``end`` at the machine's limits, down, once around, up."""
    start, end = np.array(ends)
    top, down_s, around_s = 0.095, 0.23, 0.43
    move_s = float(QUINTIC.duration(np.linalg.norm(end - start), PARAMETERS.velocity_m_s, PARAMETERS.acceleration_m_s2))
    steps = int(np.ceil((move_s + 2.0 * down_s + around_s) * PARAMETERS.physics_hz))
    time = np.arange(steps + 1) / PARAMETERS.physics_hz
    begins = np.cumsum([0.0, move_s, down_s, around_s])
    lengths = zip(begins, (move_s, down_s, around_s, down_s), strict=True)
    there, down, around, up = (QUINTIC.sample(time - begin, 1.0, lasts).position for begin, lasts in lengths)
    angle, radius = 2.0 * np.pi * around, radius_m * (down - up)
    pose = np.zeros((steps + 1, 6))
    pose[:, :2] = start + there[:, None] * (end - start)
    pose[:, 0] += radius * np.cos(angle) - speed_m_s * time
    pose[:, 1] += radius * np.sin(angle)
    pose[:, 2] = top - (top + PARAMETERS.lowest_tip_m + depth_m) * (down - up)
    return pose


HARD = [((-0.06, -0.20), (0.14, 0.20)), ((0.14, 0.20), (0.14, -0.20)), ((0.14, 0.0), (0.10, 0.01))]


@pytest.fixture(scope="module")
def machine():
    with HoeMachine() as made:
        yield made


@pytest.mark.parametrize("ends", HARD)
def test_tracks_at_full_speed_and_in_the_soil(machine, ends):
    pose = stroke(ends, 0.035, 0.013)
    machine.reset(pose[0])
    report = machine.hoe(pose, SPEED_M_S, measure=True)
    assert report.position_error_m < 3e-4
    assert report.angle_error_rad < np.deg2rad(0.05)
    assert report.closure_error_m < 3e-4
    assert not report.saturated.any()
    machine.reset(pose[0])
    free = machine.run(pose, measure=True)
    assert report.peak_effort[:3].sum() > free.peak_effort[:3].sum() + 10.0


def test_the_soil_pushes_back_by_hand(machine):
    pose = np.zeros((5, 6))
    # The blade's underside is 20 mm below the ground and goes ahead at 0.24 m/s over the cart's 0.10 m/s.
    pose[:, 2] = 0.020
    pose[:, 0] = 0.001 * np.arange(5)
    force, tip = machine.soil_force(pose, SPEED_M_S)
    assert tip[:, 2] == pytest.approx(-0.020)
    assert force[2] == pytest.approx([-4.0e4 * 0.028 * 0.020, 0.0, 0.0])
    pose[:, 2] = 0.050
    assert not machine.soil_force(pose, SPEED_M_S)[0].any()
    # A blade that hardly moves over ground is hardly pushed.
    still = np.zeros((5, 6))
    still[:, 0] = -SPEED_M_S / PARAMETERS.physics_hz * np.arange(5)
    assert np.abs(machine.soil_force(still, SPEED_M_S)[0]).max() < 1e-9


def test_heavier_soil_costs_effort_and_stops_weak_motors():
    pose = stroke(HARD[0], 0.035, 0.013)
    weak = replace(PARAMETERS, soil_resistance_pa=4.0e5)
    with HoeMachine(weak) as made:
        made.reset(pose[0])
        report = made.hoe(pose, SPEED_M_S, measure=True)
    assert report.saturated.any()


def test_the_machine_reaches_its_window_and_refuses_what_is_beyond_by_name(machine):
    x, y, z = np.meshgrid([-0.18, 0.0, 0.18], [-0.215, 0.0, 0.215], [0.0, 0.10], indexing="ij")
    pose = np.zeros((x.size, 6))
    pose[:, :3] = np.stack([x.ravel(), y.ravel(), z.ravel()], axis=-1)
    assert PARAMETERS.mechanism.reachable(pose).all()
    far = np.zeros((2, 6))
    far[:, :3] = [0.0, 0.0, 0.05], [0.26, 0.20, 0.05]
    machine.reset(far[0])
    with pytest.raises(UnreachablePoseError, match=r"cone|lock|slider"):
        machine.run(far)


def test_bad_numbers_are_named():
    with pytest.raises(ValueError, match="lowest_tip_m"):
        HoeParameters(lowest_tip_m=0.01)
    with pytest.raises(ValueError, match="blade_radius_m"):
        HoeParameters(blade_radius_m=0.0)
