"""The formulas that both five-bars share, held to finite differences, virtual work and loop closure."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fieldgym.mechanisms import FiveBar, TranslationalFiveBar, UnreachablePoseError

MACHINES = {"safflower": FiveBar.safflower(), "transplanter": TranslationalFiveBar.transplanter()}
BOXES = {"safflower": ((0.15, -0.51), (0.43, -0.22)), "transplanter": ((-0.40, -0.75), (0.40, -0.40))}
UNEQUAL = FiveBar.from_lengths(0.16, 0.33, 0.05, 0.04, 0.36, 0.19, 0.55)


@pytest.fixture(params=["safflower", "transplanter", "unequal"])
def case(request):
    """A machine and 400 of its reachable poses."""
    if request.param == "unequal":
        return UNEQUAL, reachable_poses(UNEQUAL, BOXES["safflower"], 400)
    return MACHINES[request.param], reachable_poses(MACHINES[request.param], BOXES[request.param], 400)


def reachable_poses(machine, box, count, seed=0):
    thrown = np.random.default_rng(seed).uniform(box[0], box[1], (20 * count, 2))
    poses = thrown[machine.reachable(thrown)][:count]
    assert len(poses) == count
    return poses


def vectors(count, size, seed):
    return size * np.random.default_rng(seed).normal(size=(count, 2))


def derivative(function, step):
    """Central difference of fourth order at zero."""
    return (8.0 * (function(step) - function(-step)) - (function(2.0 * step) - function(-2.0 * step))) / (12.0 * step)


def assert_close_as_vectors(actual, expected, relative):
    """Compare (n, ...) arrays row by row, relative to each row's size: a component may pass through zero."""
    axes = tuple(range(1, expected.ndim))
    error = np.sqrt(np.sum((actual - expected) ** 2, axis=axes))
    size = np.sqrt(np.sum(expected**2, axis=axes))
    assert np.max(error / size) < relative


def test_forward_undoes_inverse(case):
    machine, poses = case
    assert np.max(np.abs(machine.forward(machine.inverse(poses)) - poses)) <= 1e-12


def test_links_keep_their_lengths(case):
    machine, poses = case
    pose = machine._pose(poses)
    for index, leg in enumerate(machine._legs):
        motor = np.array([leg.motor_x_m, 0.0])
        arm = np.linalg.norm(pose.elbow[:, index] - motor, axis=-1)
        forearm = np.linalg.norm(pose.wrist[:, index] - pose.elbow[:, index], axis=-1)
        np.testing.assert_allclose(arm, leg.arm_m, rtol=0, atol=1e-14)
        np.testing.assert_allclose(forearm, leg.forearm_m, rtol=0, atol=1e-12)


def test_elbows_point_outwards_and_the_tool_hangs_below_them(case):
    machine, poses = case
    pose = machine._pose(poses)
    for index, leg in enumerate(machine._legs):
        reach, elbow = pose.wrist[:, index] - [leg.motor_x_m, 0.0], pose.elbow[:, index] - [leg.motor_x_m, 0.0]
        assert np.all(leg.side * (reach[:, 0] * elbow[:, 1] - reach[:, 1] * elbow[:, 0]) < 0.0)
    left = 0 if machine._legs[0].side > 0.0 else 1
    b, e = pose.elbow[:, left], pose.elbow[:, 1 - left]
    tool = pose.wrist.mean(axis=1)
    assert np.all((e - b)[:, 0] * (tool - b)[:, 1] - (e - b)[:, 1] * (tool - b)[:, 0] < 0.0)


def test_jacobian_is_the_derivative_of_the_inverse(case):
    machine, poses = case
    columns = [derivative(lambda h, axis=axis: machine.inverse(poses + h * axis), 5e-5) for axis in np.eye(2)]
    assert_close_as_vectors(machine.jacobian(poses), np.stack(columns, axis=-1), 1e-7)


def test_joint_rates_and_accelerations_follow_a_moving_tool(case):
    machine, poses = case
    v, a = vectors(len(poses), 1.0, 1), vectors(len(poses), 20.0, 2)

    def position(t):
        return poses + t * v + 0.5 * t * t * a

    rates = derivative(lambda t: machine.inverse(position(t)), 5e-5)
    assert_close_as_vectors(machine.joint_rates(poses, v), rates, 1e-7)
    accelerations = derivative(lambda t: machine.joint_rates(position(t), v + t * a), 3e-5)
    assert_close_as_vectors(machine.joint_accelerations(poses, v, a), accelerations, 1e-7)


def test_pose_rates_undo_joint_rates(case):
    machine, poses = case
    v = vectors(len(poses), 1.0, 3)
    assert_close_as_vectors(machine.pose_rates(poses, machine.joint_rates(poses, v)), v, 1e-12)


def test_static_torques_do_no_net_work_on_any_small_motion(case):
    machine, poses = case
    force, shift = vectors(len(poses), 10.0, 4), vectors(len(poses), 1.0, 5)
    turn = derivative(lambda h: machine.inverse(poses + h * shift), 5e-5)
    work_of_motors = np.sum(machine.statics(poses, force) * turn, axis=-1)
    work_of_force = np.sum(force * shift, axis=-1)
    size = np.linalg.norm(force, axis=-1) * np.linalg.norm(shift, axis=-1)
    assert np.max(np.abs(work_of_motors + work_of_force) / size) < 1e-7


def test_conditioning_is_that_of_the_velocity_map(case):
    machine, poses = case
    values = np.linalg.svd(np.linalg.inv(machine.jacobian(poses)), compute_uv=False)
    got = machine.conditioning(poses)
    np.testing.assert_allclose(got.largest, values[:, 0], rtol=1e-9)
    np.testing.assert_allclose(got.smallest, values[:, 1], rtol=1e-9)
    np.testing.assert_allclose(got.number, values[:, 0] / values[:, 1], rtol=1e-9)


def test_pose_error_is_the_jacobian_applied_to_a_small_joint_error(case):
    machine, poses = case
    error = vectors(len(poses), 1e-6, 6)
    assert_close_as_vectors(machine.pose_error(poses, error), machine.pose_rates(poses, error), 1e-4)


def test_transmission_angles_are_those_between_the_drawn_links(case):
    machine, poses = case
    pose = machine._pose(poses)

    def between(a, b):
        lengths = np.linalg.norm(a, axis=-1) * np.linalg.norm(b, axis=-1)
        return np.arcsin(np.minimum(np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / lengths, 1.0))

    arms = [pose.elbow[:, i] - [leg.motor_x_m, 0.0] for i, leg in enumerate(machine._legs)]
    forearms = [pose.wrist[:, i] - pose.elbow[:, i] for i in range(2)]
    expected = [between(arms[0], forearms[0]), between(arms[1], forearms[1]), between(*forearms)]
    np.testing.assert_allclose(machine.transmission_angles(poses), np.stack(expected, axis=-1), atol=1e-6)


def test_a_batch_is_its_single_poses_bit_for_bit(case):
    machine, poses = case
    few, v = poses[:37], vectors(37, 1.0, 7)
    calls = {
        "inverse": lambda p, u: machine.inverse(p),
        "forward": lambda p, u: machine.forward(machine.inverse(p)),
        "jacobian": lambda p, u: machine.jacobian(p),
        "joint_rates": machine.joint_rates,
        "joint_accelerations": lambda p, u: machine.joint_accelerations(p, u, 3.0 * u),
        "statics": machine.statics,
    }
    for name, call in calls.items():
        single = np.stack([call(p, u) for p, u in zip(few, v, strict=True)])
        np.testing.assert_array_equal(call(few, v), single, err_msg=name)
    for name, values in machine.margins(few).items():
        np.testing.assert_array_equal(values, [machine.margins(p)[name] for p in few], err_msg=name)


def test_leading_axes_are_kept_and_chunks_leave_no_seam(case):
    machine, poses = case
    tiled = np.tile(poses, (50, 1))  # 20,000 poses: several chunks and a short last one
    np.testing.assert_array_equal(machine.inverse(tiled), np.tile(machine.inverse(poses), (50, 1)))
    assert machine.inverse(poses.reshape(20, 20, 2)).shape == (20, 20, 2)
    assert machine.jacobian(poses.reshape(20, 20, 2)).shape == (20, 20, 2, 2)
    assert machine.inverse(np.empty((0, 2))).shape == (0, 2)


def test_arguments_are_left_alone(case):
    machine, poses = case
    kept = poses.copy()
    machine.margins(poses)
    machine.forward(machine.inverse(poses))
    np.testing.assert_array_equal(poses, kept)


@pytest.mark.parametrize("name", MACHINES)
def test_what_no_leg_can_reach_is_nan_with_a_negative_margin_and_no_warning(name, recwarn):
    machine = MACHINES[name]
    far = np.array([[0.1, -5.0], reachable_poses(machine, BOXES[name], 1)[0]])
    assert np.all(np.isnan(machine.inverse(far)[0])) and not np.any(np.isnan(machine.inverse(far)[1]))
    margins = machine.margins(far)
    assert margins["leg1_reach"][0] < 0.0 and margins["leg2_reach"][0] < 0.0
    np.testing.assert_array_equal(machine.reachable(far)[:1], [False])
    for values in (machine.jacobian(far), machine.statics(far, [0.0, 1.0]), machine.forward(machine.inverse(far))):
        assert np.all(np.isnan(values[0]))
    assert len(recwarn) == 0


@pytest.mark.parametrize("name", MACHINES)
def test_strict_names_the_limit_its_margin_and_the_pose(name):
    machine = MACHINES[name]
    good = reachable_poses(machine, BOXES[name], 3)
    np.testing.assert_array_equal(machine.inverse(good, strict=True), machine.inverse(good))
    with pytest.raises(UnreachablePoseError, match=r"leg1_reach.*violated by") as caught:
        machine.inverse(np.concatenate([good, [[0.0, -3.0]]]), strict=True)
    assert caught.value.limit == "leg1_reach" and caught.value.index == (3,)
    assert caught.value.margin == pytest.approx(float(machine.margins([0.0, -3.0])["leg1_reach"]))
    assert type(machine).__name__ in str(caught.value)


@pytest.mark.parametrize("name", MACHINES)
def test_each_margin_turns_negative_exactly_where_its_limit_is_passed(name):
    machine = MACHINES[name]
    poses = reachable_poses(machine, BOXES[name], 200)
    margins = machine.margins(poses)
    middle = {name: float(np.median(values)) for name, values in margins.items()}
    tightened = {
        "clearance": replace(machine, link_clearance_m=machine.link_clearance_m + middle["clearance"]),
        "forearms": replace(machine, min_forearm_angle_rad=machine.min_forearm_angle_rad + middle["forearms"]),
        "elbow1": replace(machine, min_elbow_angle_rad=machine.min_elbow_angle_rad + middle["elbow1"]),
        "elbow2": replace(machine, min_elbow_angle_rad=machine.min_elbow_angle_rad + middle["elbow2"]),
    }
    for limit, tight in tightened.items():
        now = tight.margins(poses)[limit]
        assert np.any(now < 0.0) and np.any(now >= 0.0)
        np.testing.assert_array_equal(tight.reachable(poses) & (now < 0.0), np.zeros(len(poses), dtype=bool))
    low, high = machine.arm_range_rad
    joints = machine.inverse(poses)
    left = 0 if machine._legs[0].side > 0.0 else 1
    for index in range(2):
        joint = machine._JOINTS[index]
        bounds = (low, high) if index == left else (-np.pi - high, -np.pi - low)
        np.testing.assert_allclose(margins[f"{joint}_lower"], joints[:, index] - bounds[0], atol=1e-14)
        np.testing.assert_allclose(margins[f"{joint}_upper"], bounds[1] - joints[:, index], atol=1e-14)


def test_a_tool_above_its_elbows_has_crossed_forearms():
    machine = FiveBar.safflower()
    above = np.array([0.29, 0.25])
    assert machine.margins(above)["forearms"] < -machine.min_forearm_angle_rad
    assert not machine.reachable(above)


@pytest.mark.parametrize("name", MACHINES)
def test_wrong_shapes_are_named(name):
    machine = MACHINES[name]
    with pytest.raises(ValueError, match=r"position has shape \(3,\): expected \(\.\.\., 2\)"):
        machine.inverse([0.1, 0.2, 0.3])
    with pytest.raises(ValueError, match="velocity has shape"):
        machine.joint_rates([0.1, -0.4], 1.0)


GAPS = [0.0, 1e-16, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4]


@pytest.mark.parametrize("gap", GAPS)
@pytest.mark.parametrize("leg", [0, 1])
@pytest.mark.parametrize("outwards", [True, False])
def test_near_an_upright_arm_the_wanted_closure_stays_exact(gap, leg, outwards):
    """The half-angle quotient is 0/0 where the other closure's arm is upright, infinite where this one's is."""
    machine = FiveBar.from_lengths(0.175, 0.350, 0.0, 0.0, 0.350, 0.175, 0.5)
    motor, side = machine._legs[leg].motor_x_m, machine._legs[leg].side
    upright = np.array([motor, 0.175])
    away = -side if outwards else side
    wrist = upright + 0.350 * np.array([away * np.cos(0.9), -np.sin(0.9)])
    point = wrist + gap * np.array([0.6, -0.8])
    angle = machine.inverse(point)[leg]
    assert -1.5 * np.pi <= angle <= 0.5 * np.pi
    elbow = np.array([motor, 0.0]) + 0.175 * np.array([np.cos(angle), np.sin(angle)])
    assert np.linalg.norm(point - elbow) == pytest.approx(0.350, abs=1e-14)
    reach, arm = point - [motor, 0.0], elbow - [motor, 0.0]
    assert side * (reach[0] * arm[1] - reach[1] * arm[0]) < 0.0
    assert (np.linalg.norm(elbow - upright) <= 2.0 * gap + 1e-14) == outwards


def test_a_leg_stretched_or_folded_along_the_vertical_has_an_angle():
    machine = FiveBar.from_lengths(0.25, 0.5, 0.0, 0.0, 0.5, 0.25, 0.5)  # exact in binary: the limit is met, not missed
    for height, upright in ((0.75, True), (-0.75, False), (-0.25, True)):
        angle = machine.inverse([0.0, height])[0]
        assert np.sin(angle) == pytest.approx(1.0 if upright else -1.0, abs=1e-12)


def test_high_poses_in_a_batch_leave_the_low_ones_alone():
    machine = FiveBar.from_lengths(0.175, 0.350, 0.0, 0.0, 0.350, 0.175, 0.5)
    poses = np.random.default_rng(3).uniform((-0.2, -0.5), (0.7, 0.4), (500, 2))
    np.testing.assert_array_equal(machine.inverse(poses), np.stack([machine.inverse(p) for p in poses]))


unit = st.floats(0.0, 1.0)


@settings(max_examples=200, deadline=None)
@given(name=st.sampled_from(sorted(MACHINES)), across=unit, up=unit)
def test_reachable_exactly_where_every_margin_is_kept(name, across, up):
    machine = MACHINES[name]
    (left, bottom), (right, top) = BOXES[name]
    pose = np.array([left - 0.2 + across * (right - left + 0.4), bottom - 0.2 + up * (top - bottom + 0.4)])
    margins = machine.margins(pose)
    assert bool(machine.reachable(pose)) == all(bool(value >= 0.0) for value in margins.values())
    if machine.reachable(pose):
        assert np.max(np.abs(machine.forward(machine.inverse(pose)) - pose)) <= 1e-12
        machine.inverse(pose, strict=True)
    else:
        with pytest.raises(UnreachablePoseError):
            machine.inverse(pose, strict=True)


@settings(max_examples=100, deadline=None)
@given(across=unit, up=unit, factor=st.floats(0.1, 10.0))
def test_angles_do_not_change_with_the_scale(across, up, factor):
    small = FiveBar.safflower()
    lengths = (0.175, 0.350, 0.040, 0.060, 0.350, 0.175, 0.580)
    large = FiveBar.from_lengths(*(factor * length for length in lengths))
    pose = np.array([0.20 + 0.18 * across, -0.42 + 0.14 * up])
    np.testing.assert_allclose(large.inverse(factor * pose), small.inverse(pose), rtol=0, atol=1e-11)
    np.testing.assert_allclose(large.jacobian(factor * pose) * factor, small.jacobian(pose), rtol=1e-9)


@settings(max_examples=100, deadline=None)
@given(name=st.sampled_from(sorted(MACHINES)), across=unit, up=unit)
def test_a_mirrored_pose_has_mirrored_joints(name, across, up):
    machine = MACHINES[name]
    axis = sum(leg.motor_x_m for leg in machine._legs) / 2.0
    (_, bottom), (right, top) = BOXES[name]
    offset = across * (right - axis)
    y = bottom + up * (top - bottom)
    here, there = machine.inverse([axis + offset, y]), machine.inverse([axis - offset, y])
    np.testing.assert_allclose(there[::-1], -np.pi - here, rtol=0, atol=1e-12)
