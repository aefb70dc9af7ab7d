"""The 3UPS-RPU platform: closures, derivatives and statics against independent computations, limits, layouts."""

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fieldgym.mechanisms import ThreeUPSRPU
from fieldgym.mechanisms.three_ups_rpu import WEEDING_BOX
from fieldgym.mechanisms.three_ups_rpu_geometry import leg_distances
from fieldgym.scripts.synthesise_weeder import box as half_box
from fieldgym.scripts.synthesise_weeder import climb, judge

LAYOUTS = {
    "published": ThreeUPSRPU.published(),
    "paper": ThreeUPSRPU.published(paper_orientation=True),
    "weeder": ThreeUPSRPU.weeder(),
}
LOW, HIGH = np.array(WEEDING_BOX).T
any_layout = pytest.mark.parametrize("machine", LAYOUTS.values(), ids=LAYOUTS.keys())


def random_poses(count: int, seed: int = 0) -> np.ndarray:
    return LOW + (HIGH - LOW) * np.random.default_rng(seed).random((count, 4))


def box_grid(*counts: int) -> np.ndarray:
    axes = [np.linspace(low, high, count) for low, high, count in zip(LOW, HIGH, counts, strict=True)]
    return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 4)


def derivative(function: Callable[[float], np.ndarray], at: float, step: float = 2e-3) -> np.ndarray:
    """Fourth-order central difference of a function of time."""
    ahead = function(at + step) - function(at - step)
    return (8.0 * ahead - function(at + 2 * step) + function(at - 2 * step)) / (12.0 * step)


poses_in_box = st.tuples(*(st.floats(low, high) for low, high in WEEDING_BOX)).map(np.array)


@any_layout
def test_legs_close_on_the_platform_that_scipy_rotates(machine: ThreeUPSRPU) -> None:
    poses = random_poses(500)
    order = poses[:, [2, 3]] if machine.paper_orientation else poses[:, [3, 2]]
    rotation = Rotation.from_euler("XY" if machine.paper_orientation else "YX", order)
    offset = 0.3 * np.sin(poses[:, 2]) * np.sin(poses[:, 3]) if machine.paper_orientation else 0.0 * poses[:, 0]
    centre = np.stack([poses[:, 0], offset, poses[:, 1]], axis=-1)
    at = machine.attachments
    joints = np.stack([centre + rotation.apply(joint.copy()) for joint in at.platform], axis=1)
    np.testing.assert_allclose(machine.inverse(poses), np.linalg.norm(joints - at.base, axis=-1), rtol=0, atol=1e-12)
    chains = machine.chains(poses)
    closed = chains.base + machine.inverse(poses)[..., None] * chains.direction
    np.testing.assert_allclose(closed, joints, rtol=0, atol=1e-12)
    # The RPU leg stays in the plane normal to its revolute axis.
    np.testing.assert_allclose(chains.platform[:, 3, 1], 0.0, atol=1e-15)


def test_the_rpu_leg_allows_exactly_ry_rx_with_the_centre_in_the_plane() -> None:
    """Erratum to eq. 4: joint by joint, revolute about Y, slide, universal about Y and the platform's x."""
    rng = np.random.default_rng(1)
    swing, first, second = rng.uniform(-0.7, 0.7, (3, 2000))
    length = rng.uniform(0.45, 0.85, 2000)
    rotation = Rotation.from_euler("Y", swing[:, None]) * Rotation.from_euler("YX", np.stack([first, second], axis=-1))
    wrist = np.array([-0.4, 0.0, 0.0]) + length[:, None] * np.stack(
        [np.sin(swing), 0.0 * swing, np.cos(swing)], axis=-1
    )
    centre = wrist - rotation.apply([-0.3, 0.0, 0.0])
    np.testing.assert_allclose(centre[:, 1], 0.0, atol=1e-15)
    poses = np.stack([centre[:, 0], centre[:, 2], second, swing + first], axis=-1)
    machine = ThreeUPSRPU.published()
    np.testing.assert_allclose(machine.chains(poses).rotation, rotation.as_matrix(), atol=1e-14)
    np.testing.assert_allclose(machine.inverse(poses)[:, 3], length, atol=1e-12)
    np.testing.assert_allclose(machine.rpu_angles(poses), np.stack([swing, first, second], axis=-1), atol=1e-12)
    # The universal joint keeps the platform's x normal to Y; the paper's orientation does not.
    tilted = LAYOUTS["paper"].chains([0.0, 0.6, 0.2, 0.3]).rotation
    assert abs(tilted[1, 0]) == pytest.approx(math.sin(0.2) * math.sin(0.3), rel=1e-12)


def test_published_case_one_after_ten_seconds() -> None:
    machine, pose, rates = ThreeUPSRPU.published(), [0.05, 0.65, 0.0, 0.0], [0.005, 0.005, 0.0, 0.0]
    lengths_mm = 1e3 * machine.inverse(pose)
    np.testing.assert_allclose(lengths_mm, [659.545, 651.920, 659.545, 667.083], atol=5e-4)
    assert lengths_mm[0] == lengths_mm[2]
    np.testing.assert_allclose(1e3 * machine.joint_rates(pose, rates), [5.3067, 4.6018, 5.3067, 5.9963], atol=5e-5)


def test_published_case_two_after_ten_seconds() -> None:
    machine, tilt, rate = ThreeUPSRPU.published(), math.pi / 9, math.pi / 90
    pose = [0.0, 0.6, tilt, tilt]
    np.testing.assert_allclose(1e3 * machine.inverse(pose), [518.432, 511.221, 707.231, 712.461], atol=5e-4)
    np.testing.assert_allclose(
        1e3 * machine.joint_rates(pose, [0.0, 0.0, rate, rate]), [-6.521, -8.747, 8.831, 10.298], atol=5e-4
    )


@any_layout
def test_twist_is_the_derivative_of_the_placement(machine: ThreeUPSRPU) -> None:
    poses, rates = random_poses(50), np.random.default_rng(3).normal(size=(50, 4))
    accelerations = np.random.default_rng(4).normal(size=(50, 4))

    def pose_at(time: float) -> np.ndarray:
        return poses + time * rates + 0.5 * time * time * accelerations

    twist = machine.twist(poses, rates)
    np.testing.assert_allclose(derivative(lambda t: machine.chains(pose_at(t)).centre, 0.0), twist[:, :3], atol=1e-9)
    turning = derivative(lambda t: machine.chains(pose_at(t)).rotation, 0.0)
    spin = turning @ np.swapaxes(machine.chains(poses).rotation, -1, -2)
    omega = np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=-1)
    np.testing.assert_allclose(omega, twist[:, 3:], atol=1e-9)
    change = derivative(lambda t: machine.twist(pose_at(t), rates + t * accelerations), 0.0)
    np.testing.assert_allclose(machine.twist_rate(poses, rates, accelerations), change, atol=1e-8)


@any_layout
def test_jacobian_rows_give_leg_rates_and_hold_the_constraints(machine: ThreeUPSRPU) -> None:
    poses, rates = random_poses(200), np.random.default_rng(5).normal(size=(200, 4))
    measured = derivative(lambda t: machine.inverse(poses + t * rates), 0.0)
    product = (machine.jacobian(poses) @ machine.twist(poses, rates)[..., None])[..., 0]
    np.testing.assert_allclose(product[:, :4], measured, atol=1e-9)
    np.testing.assert_allclose(product[:, 4:], 0.0, atol=1e-14)
    np.testing.assert_allclose(machine.joint_rates(poses, rates), measured, atol=1e-9)
    np.testing.assert_allclose(
        machine.rate_map(poses), machine.jacobian(poses)[:, :4] @ machine.twist_map(poses), atol=1e-14
    )


def test_the_printed_couple_direction_is_violated() -> None:
    """Erratum to eqs 9 and 15: along the platform's z the couple would do work in both orientation models."""
    for machine in (LAYOUTS["published"], LAYOUTS["paper"]):
        pose, rates = [0.0, 0.6, 0.2, 0.2], [0.0, 0.0, 1.0, 1.0]
        normal = machine.chains(pose).rotation[:, 2]
        assert abs(normal @ machine.twist(pose, rates)[3:]) > 0.1
        assert abs(machine.jacobian(pose)[5, 3:] @ machine.twist(pose, rates)[3:]) < 1e-15


@any_layout
def test_accelerations_are_second_derivatives_of_the_lengths(machine: ThreeUPSRPU) -> None:
    poses, rng = random_poses(200), np.random.default_rng(6)
    rates, accelerations = rng.normal(size=(2, 200, 4))

    def leg_rates(time: float) -> np.ndarray:
        pose = poses + time * rates + 0.5 * time * time * accelerations
        return machine.joint_rates(pose, rates + time * accelerations)

    found = machine.joint_accelerations(poses, rates, accelerations)
    np.testing.assert_allclose(found, derivative(leg_rates, 0.0, 5e-4), rtol=1e-7, atol=1e-8)


@any_layout
def test_hessian_holds_eq_16_with_the_corrected_signs(machine: ThreeUPSRPU) -> None:
    poses, rng = random_poses(200), np.random.default_rng(7)
    rates, accelerations = rng.normal(size=(2, 200, 4))
    twist, change = machine.twist(poses, rates), machine.twist_rate(poses, rates, accelerations)
    hessian = machine.hessian(poses)
    bent = np.einsum("ni,nkij,nj->nk", twist, hessian, twist)
    sides = (machine.jacobian(poses) @ change[..., None])[..., 0] + bent
    np.testing.assert_allclose(sides[:, :4], machine.joint_accelerations(poses, rates, accelerations), atol=1e-12)
    np.testing.assert_allclose(sides[:, 4:], 0.0, atol=1e-13)
    # Erratum to eq. 14: with the printed sign of H5 the constraint's own acceleration does not vanish.
    assert np.abs(sides[:, 4] - 2.0 * bent[:, 4]).max() > 0.1


def test_rates_and_accelerations_invert() -> None:
    machine, poses, rng = ThreeUPSRPU.weeder(), random_poses(300), np.random.default_rng(8)
    rates, accelerations = rng.normal(size=(2, 300, 4))
    np.testing.assert_allclose(machine.pose_rates(poses, machine.joint_rates(poses, rates)), rates, atol=1e-12)
    legs = machine.joint_accelerations(poses, rates, accelerations)
    np.testing.assert_allclose(machine.pose_accelerations(poses, rates, legs), accelerations, atol=1e-11)


def test_statics_balance_forces_and_moments_and_do_no_virtual_work() -> None:
    machine, poses, rng = ThreeUPSRPU.weeder(), random_poses(300), np.random.default_rng(9)
    wrench, rates = rng.normal(size=(300, 6)), rng.normal(size=(300, 4))
    found = machine.statics(poses, wrench)
    work = np.sum(found[:, :4] * machine.joint_rates(poses, rates), axis=-1)
    work += np.sum(wrench * machine.twist(poses, rates), axis=-1)
    np.testing.assert_allclose(work, 0.0, atol=1e-12)
    chains = machine.chains(poses)
    pushes = found[:, :4, None] * chains.direction
    pushes[:, 3, 1] += found[:, 4]
    np.testing.assert_allclose(pushes.sum(axis=1) + wrench[:, :3], 0.0, atol=1e-12)
    # The couple is normal to both axes of the universal joint: the platform's x and Y.
    couple = np.cross(chains.rotation[:, :, 0], [0.0, 1.0, 0.0])
    moments = np.cross(chains.arms, pushes).sum(axis=1) + found[:, 5:] * couple + wrench[:, 3:]
    np.testing.assert_allclose(moments, 0.0, atol=1e-12)


@settings(max_examples=150, deadline=None)
@given(pose=poses_in_box, seed=poses_in_box)
def test_forward_returns_what_inverse_took(pose: np.ndarray, seed: np.ndarray) -> None:
    machine = ThreeUPSRPU.weeder()
    found = machine.forward(machine.inverse(pose), seed)
    assert found.converged
    np.testing.assert_allclose(found.pose, pose, rtol=0, atol=1e-9)


@settings(max_examples=100, deadline=None)
@given(pose=poses_in_box, rates=st.tuples(*[st.floats(-1.0, 1.0)] * 4).map(np.array))
def test_limits_and_rates_over_the_weeding_box(pose: np.ndarray, rates: np.ndarray) -> None:
    machine = ThreeUPSRPU.weeder()
    assert machine.reachable(pose)
    assert min(float(margin) for margin in machine.margins(pose).values()) >= 0.0
    scaled = rates * np.array([1.0, 1.0, 0.3, 0.3])
    speed, legs = np.linalg.norm(scaled), np.linalg.norm(machine.joint_rates(pose, rates))
    state = machine.conditioning(pose)
    assert state.smallest * speed - 1e-12 <= legs <= state.largest * speed + 1e-12


def test_every_element_of_a_batch_walks_alone() -> None:
    machine, poses = ThreeUPSRPU.weeder(), random_poses(64, seed=10)
    lengths = machine.inverse(poses)
    lengths[::7, 0] = 5.0
    lengths[5] = np.nan
    together = machine.forward(lengths, machine.home_pose)
    for row, length in enumerate(lengths):
        alone = machine.forward(length, machine.home_pose)
        np.testing.assert_array_equal(alone.pose, together.pose[row])
        assert alone.converged == together.converged[row] and alone.iterations == together.iterations[row]
        np.testing.assert_array_equal(machine.inverse(poses[row]), machine.inverse(poses)[row])
    assert not together.converged[::7].any() and np.isnan(together.pose[::7]).all()
    kept = np.delete(np.arange(64), [5, *range(0, 64, 7)])
    np.testing.assert_allclose(together.pose[kept], poses[kept], atol=1e-9)


def test_forward_stays_on_the_seeds_side_of_the_singular_set() -> None:
    machine, rng = ThreeUPSRPU.published(), np.random.default_rng(11)
    seeds, goals = random_poses(400, seed=12), random_poses(400, seed=13)
    found = machine.forward(machine.inverse(goals), seeds)
    kept = found.converged
    assert 100 < kept.sum() < 400
    np.testing.assert_allclose(machine.inverse(found.pose[kept]), machine.inverse(goals)[kept], atol=1e-12)
    before, after = (np.sign(machine.singularity(poses[kept]).determinant) for poses in (seeds, found.pose))
    np.testing.assert_array_equal(before, after)
    level = np.array([rng.uniform(-0.1, 0.1), 0.6, 0.0, 0.0])
    assert not machine.forward(machine.inverse(level), level).converged


def test_shapes_follow_the_leading_axes() -> None:
    machine, poses = ThreeUPSRPU.weeder(), random_poses(6).reshape(2, 3, 4)
    rates = np.ones(4)
    assert machine.inverse(poses).shape == (2, 3, 4)
    assert machine.jacobian(poses).shape == (2, 3, 6, 6) and machine.hessian(poses).shape == (2, 3, 6, 6, 6)
    assert machine.pose_rates(poses, rates).shape == machine.joint_accelerations(poses, rates, rates).shape == (2, 3, 4)
    assert machine.statics(poses, np.ones(6)).shape == machine.null_twist(poses).shape == (2, 3, 6)
    assert machine.reachable(poses).shape == machine.conditioning(poses).number.shape == (2, 3)
    assert machine.reachable(poses[0, 0]).shape == machine.singularity(poses[0, 0]).smallest.shape == ()
    empty = np.empty((0, 4))
    assert machine.inverse(empty).shape == machine.forward(empty, empty).pose.shape == (0, 4)
    assert machine.reachable(empty).shape == (0,)
    assert machine.forward(machine.inverse(poses), machine.home_pose).converged.shape == (2, 3)
    for call in (machine.inverse, machine.margins, machine.jacobian):
        with pytest.raises(ValueError, match=r"pose has shape \(3,\): expected \(..., 4\)"):
            call([0.0, 0.6, 0.0])


def test_published_layout_is_singular_wherever_it_is_level() -> None:
    machine, rng = ThreeUPSRPU.published(), np.random.default_rng(14)
    level = random_poses(200, seed=15)
    level[:, 2:] = 0.0
    assert machine.singularity(level).singular.all()
    assert all(np.linalg.matrix_rank(machine.jacobian(pose), tol=1e-9) == 5 for pose in level)
    assert not machine.reachable(level).any()
    # Base and platform are homothetic, so the leg lines meet in 4 o; the platform turns about the Y-parallel there.
    chains, twist = machine.chains(level), machine.null_twist(level)
    meeting = 4.0 * chains.centre
    off = np.cross(meeting[:, None] - chains.base, chains.direction)
    np.testing.assert_allclose(off, 0.0, atol=1e-12)
    np.testing.assert_allclose(np.abs(twist[:, 4]), 1.0, atol=1e-9)
    np.testing.assert_allclose(twist[:, :3], np.cross(twist[:, 3:], chains.centre - meeting), atol=1e-9)
    np.testing.assert_allclose(machine.jacobian(level) @ twist[..., None], 0.0, atol=1e-12)
    rates = rng.normal(size=(200, 4))
    assert np.isfinite(machine.joint_rates(level, rates)).all()
    assert np.isnan(machine.pose_rates(level, rates)).all()
    assert np.isnan(machine.statics(level, np.ones(6))).all()


def test_published_determinant_is_odd_so_upright_poses_without_beta_are_singular_too() -> None:
    machine, poses = ThreeUPSRPU.published(), random_poses(200, seed=16)
    mirrored = poses * [-1.0, 1.0, 1.0, -1.0]
    straight, turned = machine.singularity(poses), machine.singularity(mirrored)
    np.testing.assert_allclose(straight.determinant, -turned.determinant, atol=1e-14)
    assert not straight.singular.any()
    poses[:, [0, 3]] = 0.0
    assert machine.singularity(poses).singular.all()
    assert np.isfinite(machine.null_twist(poses)).all()


def test_weeder_meets_what_it_was_synthesised_for() -> None:
    machine = ThreeUPSRPU.weeder()
    poses = box_grid(9, 5, 9, 9)
    corners = box_grid(2, 2, 2, 2)
    for chosen in (poses, corners):
        assert machine.reachable(chosen).all()
        assert machine.conditioning(chosen).smallest.min() >= 0.44
    assert machine.singularity(poses).determinant.min() > 0.0
    assert max(high / low for low, high in machine.stroke_m) < 2.0
    chains = machine.chains(poses)
    tilt = np.degrees(np.arccos(chains.direction[:, :3, 2].min()))
    rpu = np.degrees(np.arccos(np.sum(chains.direction[:, 3] * chains.rotation[..., 2], axis=-1).min()))
    assert max(tilt, rpu) <= 50.0
    assert leg_distances(chains).min() >= 0.15
    for ring in (machine.base_angles_rad, machine.platform_angles_rad):
        assert ring[0] == -ring[2] and ring[1] == 0.0 and ring[3] == math.pi
    # The strokes are the extremes over the box rounded outwards: no more than a millimetre and a bit is wasted.
    for leg, (low, high) in enumerate(machine.stroke_m):
        assert 0.0 <= chains.length[:, leg].min() - low < 1.1e-3
        assert 0.0 <= high - chains.length[:, leg].max() < 1.1e-3


def test_mirror_image_swaps_legs_one_and_three() -> None:
    machine, poses = ThreeUPSRPU.weeder(), random_poses(100)
    mirrored = machine.inverse(poses * [1.0, 1.0, -1.0, 1.0])
    np.testing.assert_allclose(mirrored[:, [2, 1, 0, 3]], machine.inverse(poses), atol=1e-15)


def test_no_neighbour_in_whole_degrees_beats_the_weeder() -> None:
    machine = ThreeUPSRPU.weeder()
    base, platform = math.degrees(machine.base_angles_rad[2]), math.degrees(machine.platform_angles_rad[2])
    chosen = judge(base, platform, half_box((9, 5, 5, 9)))
    assert chosen.allowed
    assert climb(chosen, 1.0) == chosen
    assert not judge(90.0, 90.0, half_box((5, 3, 3, 5))).allowed


def test_workspace_at_a_fixed_orientation() -> None:
    machine = ThreeUPSRPU.weeder()
    thrown = machine.workspace(samples=20_000)
    found = machine.workspace("polar", samples=20_000)
    assert thrown.area_m2 == pytest.approx(found.area_m2, rel=0.05)
    assert found.area_m2 > 0.2 * 0.2
    assert machine.reachable(np.concatenate([thrown.points, np.zeros_like(thrown.points)], axis=-1)).all()
    tilted = machine.workspace("polar", orientation=(math.radians(14.0), math.radians(14.0)), samples=20_000)
    assert tilted.area_m2 < found.area_m2
    with pytest.raises(ValueError, match="reachable"):
        ThreeUPSRPU.published().workspace(samples=2_000)
