"""The closed-loop sorter in PyBullet: tracking, closure, payload, limits, determinism."""

from dataclasses import replace

import numpy as np
import pytest

from fieldgym.mechanisms.errors import UnreachablePoseError
from fieldgym.motion import QUINTIC
from fieldgym.motion.orientation import angle_between, euler_angles, from_euler, slerp, tilted
from fieldgym.scripts import check_sorter_motions
from fieldgym.simulation.client import PhysicsClient
from fieldgym.simulation.sorter import SorterMachine
from fieldgym.simulation.sorter_limits import first_violation
from fieldgym.simulation.sorter_model import SorterParameters

PARAMETERS = SorterParameters()
HEAVIEST_ITEM_KG = 0.25


def motion(start, start_turn, end, end_turn, parameters=PARAMETERS) -> np.ndarray:
    """Poses at the machine's limits, orientation on SO(3)."""
    start, end = np.array(start), np.array(end)
    linear = QUINTIC.duration(np.linalg.norm(end - start), parameters.velocity_m_s, parameters.acceleration_m_s2)
    angular = QUINTIC.duration(angle_between(start_turn, end_turn), parameters.turn_rad_s, parameters.turn_rad_s2)
    duration_s = max(float(linear), float(angular))
    time = np.arange(int(np.ceil(duration_s * parameters.physics_hz)) + 1) / parameters.physics_hz
    share = QUINTIC.sample(time, 1.0, duration_s).position
    return np.column_stack([start + share[:, None] * (end - start), euler_angles(slerp(start_turn, end_turn, share))])


LEVEL = tilted(0.0, 0.0, 0.0)
HARD = [
    ((-0.14, 0.0, 0.01), tilted(0.30, 0.0, 0.9), (0.08, 0.20, 0.09), LEVEL),
    ((-0.20, 0.0, 0.09), LEVEL, (0.20, 0.0, 0.09), LEVEL),
    ((0.0, -0.14, 0.05), tilted(0.2, 1.0, 0.7), (0.0, 0.14, 0.05), tilted(0.2, -2.0, -0.7)),
    ((-0.08, -0.20, 0.09), LEVEL, (0.08, 0.20, 0.09), LEVEL),
]


@pytest.fixture(scope="module")
def machine():
    with SorterMachine() as made:
        yield made


@pytest.mark.parametrize("payload_kg", [0.0, HEAVIEST_ITEM_KG])
@pytest.mark.parametrize("ends", HARD)
def test_tracks_at_full_speed_with_and_without_payload(machine, ends, payload_kg):
    poses = motion(*ends)
    speed = np.linalg.norm(np.diff(poses[:, :3], axis=0), axis=1).max() * PARAMETERS.physics_hz
    turning = angle_between(from_euler(poses[1:, 3:]), from_euler(poses[:-1, 3:])).max() * PARAMETERS.physics_hz
    assert speed > 0.9 * PARAMETERS.velocity_m_s or turning > 0.9 * PARAMETERS.turn_rad_s
    machine.reset(poses[0])
    machine.carry(payload_kg)
    report = machine.run(poses, measure=True)
    assert report.position_error_m < 3e-4
    assert report.angle_error_rad < np.deg2rad(0.05)
    assert report.closure_error_m < 3e-4
    assert not report.saturated.any()
    assert (report.peak_effort[:3] > 5.0).all()


def test_a_payload_costs_effort(machine):
    poses, efforts = motion(*HARD[0]), []
    for payload_kg in (0.0, 3.0):
        machine.reset(poses[0])
        machine.carry(payload_kg)
        efforts.append(machine.run(poses, measure=True).peak_effort[:3].sum())
    # Three kilograms hang on three sliders: 29 N at rest, more while they are accelerated.
    assert efforts[1] - efforts[0] > 25.0
    with pytest.raises(ValueError, match="mass_kg"):
        machine.carry(-1.0)


def test_sliders_stand_and_hold_what_statics_says(machine):
    pose = np.array([0.05, -0.08, 0.05, 0.1, -0.15, 0.4])
    machine.reset(pose)
    report = machine.run(np.repeat(pose[None], 60, axis=0), measure=True)
    mechanism = PARAMETERS.mechanism
    assert machine.joints() == pytest.approx(mechanism.inverse(pose), abs=1e-4)
    moved = PARAMETERS.slider_mass_kg + PARAMETERS.yoke_mass_kg + PARAMETERS.link_mass_kg
    total = 9.81 * (3.0 * moved + PARAMETERS.platform_mass_kg)
    assert report.peak_effort[:3].sum() == pytest.approx(total, rel=0.10)


def test_placing_closes_the_loops_in_any_reachable_pose(machine):
    rng = np.random.default_rng(2)
    poses = np.column_stack(
        [rng.uniform(-0.12, 0.12, (50, 2)), rng.uniform(0.0, 0.09, 50), rng.uniform(-0.2, 0.2, (50, 2)),
         rng.uniform(-0.7, 0.7, 50)]
    )  # fmt: skip
    for pose in poses[PARAMETERS.mechanism.reachable(poses)]:
        machine.place(pose)
        position, quaternion = machine.platform()
        assert position == pytest.approx(pose[:3], abs=1e-6)
        assert float(angle_between(quaternion, from_euler(pose[3:]))) < 1e-5
        assert machine._machine.closure_error_m() < 1e-5


def test_a_motion_that_leaves_the_workspace_on_the_way_is_refused_by_the_limits_name(machine):
    poses = motion((0.0, 0.0, 0.09), LEVEL, (0.10, 0.0, 0.09), LEVEL)
    poses[:, 2] += 0.12 * np.sin(np.linspace(0.0, np.pi, len(poses)))
    assert first_violation(PARAMETERS.mechanism, poses[[0, -1]]) is None
    machine.reset(poses[0])
    before = machine.platform()[0]
    with pytest.raises(UnreachablePoseError, match="slider") as caught:
        machine.run(poses)
    assert "upper" in caught.value.limit and caught.value.margin < 0.0
    margins = PARAMETERS.mechanism.margins(poses[caught.value.index])
    assert margins[caught.value.limit] == pytest.approx(caught.value.margin)
    assert np.array_equal(machine.platform()[0], before)
    sideways = motion((0.0, 0.0, 0.05), LEVEL, (0.30, 0.0, 0.05), LEVEL)
    with pytest.raises(UnreachablePoseError, match="cone"):
        machine.run(sideways)


def test_jumps_and_nonsense_are_refused(machine):
    machine.reset(PARAMETERS.mechanism.home_pose)
    far = motion((0.05, 0.0, 0.05), LEVEL, (0.10, 0.0, 0.05), LEVEL)
    with pytest.raises(ValueError, match="starts"):
        machine.run(far)
    with pytest.raises(ValueError, match="NaN"):
        machine.run(np.full((3, 6), np.nan))
    with pytest.raises(ValueError, match="shape"):
        machine.run(np.zeros(6))
    with pytest.raises(ValueError, match=r"tool_m = -1.0: give a number in \[0.001, 1\] m"):
        SorterParameters(tool_m=-1.0)
    with pytest.raises(ValueError, match=r"link_m = 330.0: give a number .* m"):
        SorterParameters(mechanism=replace(PARAMETERS.mechanism, link_m=330.0))
    with PhysicsClient(500.0) as other:
        lent = SorterMachine(client=other)
        with pytest.raises(ValueError, match="rate"):
            lent.run(far)
        lent.close()
        lent.close()
        assert not other.closed


def test_weak_motors_are_reported_as_saturated():
    with SorterMachine(replace(PARAMETERS, slider_force_limit_n=22.0)) as weak:
        poses = motion(*HARD[1])
        weak.reset(poses[0])
        report = weak.run(poses, measure=True)
        assert report.saturated[:3].any() and report.position_error_m > 1e-3


def test_equal_commands_give_equal_bits():
    poses = motion(*HARD[0])
    ends = []
    for _ in range(2):
        with SorterMachine() as made:
            made.reset(poses[0])
            made.run(poses)
            ends.append(np.concatenate(made.platform()))
            made.reset(poses[0])
            made.run(poses)
            ends.append(np.concatenate(made.platform()))
    assert all(np.array_equal(end, ends[0]) for end in ends)


@pytest.mark.slow
def test_random_motions_keep_the_limits_or_are_refused_by_name():
    tally = check_sorter_motions.check(80, seed=7)
    assert tally.simulated + sum(tally.refused.values()) == 80
    assert tally.violations == [] and tally.unconfirmed == 0 and tally.refused_picks == 0
    assert 1 <= sum(tally.refused.values()) < 40
