"""The 3-PRRS: closed loops, rates, accelerations, statics and limits against independent computation."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fieldgym.mechanisms import ThreePRRS, UnreachablePoseError
from fieldgym.mechanisms.prrs_legs import LEG_ANGLES_RAD, MARGINS
from fieldgym.mechanisms.rotations import euler_from_rotation, rotation_from_euler, sines_and_cosines

MACHINES = {"published": ThreePRRS.published(), "sorter": ThreePRRS.sorter(), "hoe": ThreePRRS.hoe()}
machines = pytest.mark.parametrize("machine", MACHINES.values(), ids=MACHINES.keys())


def reachable_poses(machine, count, seed=0, turn=0.4):
    """Uniform reachable poses of the workspace's box with angles up to ``turn``."""
    rng = np.random.default_rng(seed)
    lower, upper = machine.box()
    poses = np.empty((40 * count, 6))
    poses[:, :3] = rng.uniform(lower, upper, (len(poses), 3))
    poses[:, 3:] = rng.uniform(-turn, turn, (len(poses), 3))
    good = poses[machine.reachable(poses)]
    assert len(good) >= count
    return good[:count]


def elementary(axis, angle):
    c, s = np.cos(angle), np.sin(angle)
    i, j = [(1, 2), (2, 0), (0, 1)][axis]
    turn = np.eye(3)
    turn[i, i] = turn[j, j] = c
    turn[i, j], turn[j, i] = -s, s
    return turn


def moved(pose, twist, time):
    """A pose carried along a constant twist of the fixed frame, by the exponential of the rotation."""
    angle = np.linalg.norm(twist[3:]) * time
    axis = twist[3:] / np.linalg.norm(twist[3:])
    cross = np.cross(axis, np.eye(3)).T
    turn = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return np.concatenate([pose[:3] + twist[:3] * time, euler_from_rotation(turn @ rotation_from_euler(pose[3:]))])


def test_rotation_is_z_y_x():
    angles = np.array([0.3, -0.5, 0.9])
    expected = elementary(2, 0.9) @ elementary(1, -0.5) @ elementary(0, 0.3)
    np.testing.assert_allclose(rotation_from_euler(angles), expected, atol=1e-15)
    np.testing.assert_allclose(euler_from_rotation(expected), angles, atol=1e-14)


@pytest.mark.parametrize("largest", [0.5, 2.49, 2.51, 10.0])
def test_half_angle_sines_are_exact(largest):
    angles = np.linspace(-largest, largest, 1001).reshape(7, 143)
    sine, cosine = sines_and_cosines(angles)
    np.testing.assert_allclose(sine, np.sin(angles), atol=1e-15)
    np.testing.assert_allclose(cosine, np.cos(angles), atol=1e-15)


@machines
def test_loops_close(machine):
    poses = reachable_poses(machine, 2000)
    joints = machine.inverse(poses)
    chains = machine.chains(poses)
    np.testing.assert_allclose(chains.joints, joints, atol=1e-14)
    for leg, azimuth in enumerate(LEG_ANGLES_RAD):
        outwards = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        g = 0.5 * machine.base_diameter_m * outwards + joints[:, leg, None] * np.array([0.0, 0.0, 1.0])
        a = poses[:, :3] + rotation_from_euler(poses[:, 3:]) @ (machine.platform_radius_m * outwards)
        theta = joints[:, leg + 3]
        # The printed u1 = (0, cos theta1, sin theta1), turned about Z to each leg.
        u = np.stack([np.zeros_like(theta), np.cos(theta), np.sin(theta)], axis=-1) @ elementary(2, azimuth).T
        np.testing.assert_allclose(np.linalg.norm(a - g, axis=-1), machine.link_m, atol=1e-12)
        np.testing.assert_allclose(np.sum(u * (a - g), axis=-1), 0.0, atol=1e-12)
        np.testing.assert_allclose(chains.g[:, leg], g, atol=1e-12)
        np.testing.assert_allclose(chains.a[:, leg], a, atol=1e-12)
        np.testing.assert_allclose(chains.u[:, leg], u, atol=1e-12)
        swing = chains.swing[:, leg, None]
        link = np.sin(swing) * outwards - np.cos(swing) * np.cross(outwards, u)
        np.testing.assert_allclose(a - g, machine.link_m * link, atol=1e-12)
        assert (g[:, 2] > a[:, 2]).all()


@machines
def test_inverse_is_the_same_in_any_batch(machine):
    poses = reachable_poses(machine, 20000)
    joints = machine.inverse(poses)
    assert joints.shape == (20000, 6)
    np.testing.assert_array_equal(machine.inverse(poses.reshape(100, 200, 6)).reshape(-1, 6), joints)
    np.testing.assert_allclose(machine.inverse(poses[7]), joints[7], atol=1e-15)
    assert machine.inverse(np.empty((0, 6))).shape == (0, 6)


@machines
def test_large_yaw_is_as_exact_as_small(machine):
    # Rotating platform and sliders' names by 120 deg is the same machine.
    pose = machine.home_pose + np.array([0.001, 0.002, 0.0, 0.03, 0.02, 0.01])
    third = np.deg2rad(120.0)
    turned = np.concatenate(
        [
            elementary(2, third) @ pose[:3],
            euler_from_rotation(elementary(2, third) @ rotation_from_euler(pose[3:]) @ elementary(2, -third)),
        ]
    )
    joints, other = machine.inverse(pose), machine.inverse(turned)
    np.testing.assert_allclose(other[[1, 2, 0, 4, 5, 3]], joints, atol=1e-14)
    np.testing.assert_allclose(machine.inverse(pose + 2.0 * np.pi * np.eye(6)[5]), joints, atol=1e-13)


@machines
def test_forward_undoes_inverse(machine):
    poses = reachable_poses(machine, 3000)
    rng = np.random.default_rng(1)
    near = poses + rng.normal(0.0, 0.02, poses.shape) * np.array([machine.link_m] * 3 + [1.0] * 3)
    closing = np.isfinite(machine.inverse(near)).all(axis=-1)
    assert closing.mean() > 0.99
    poses, near = poses[closing], near[closing]
    result = machine.forward(machine.inverse(poses), near)
    assert result.converged.all()
    np.testing.assert_allclose(result.pose, poses, atol=1e-9)
    from_home = machine.forward(machine.inverse(poses[:50]))
    assert from_home.converged.all()
    np.testing.assert_allclose(from_home.pose, poses[:50], atol=1e-9)


def test_forward_keeps_batch_elements_apart():
    machine = ThreePRRS.sorter()
    poses = reachable_poses(machine, 6)
    joints = machine.inverse(poses)
    joints[2, 0] += 1.0  # no platform spans these sliders
    joints[4, 5] = np.nan
    result = machine.forward(joints, np.broadcast_to(machine.home_pose, (6, 6)))
    np.testing.assert_array_equal(result.converged, [True, True, False, True, False, True])
    assert np.isnan(result.pose[[2, 4]]).all()
    for row in (0, 1, 3, 5):
        np.testing.assert_array_equal(result.pose[row], machine.forward(joints[row], machine.home_pose).pose)


def test_forward_stays_in_the_seeds_assembly_mode():
    machine = replace(ThreePRRS.sorter(), cone_rad=np.pi, link_clearance_m=0.0)
    pose, beyond = machine.home_pose.copy(), machine.home_pose.copy()
    pose[5], beyond[5] = np.deg2rad(80.0), np.deg2rad(100.0)
    lock = [machine.margins(p)["platform_lock"] + machine.min_platform_lock for p in (pose, beyond)]
    assert lock[0] > 0.0 > lock[1]
    # Beyond the parallel singularity at 90 deg of yaw lies the other mode: asked from this side, it is not reached.
    across = machine.forward(machine.inverse(beyond), pose)
    assert not across.converged or abs(across.pose[5] - beyond[5]) > 0.01
    there = machine.forward(machine.inverse(beyond), beyond + 0.01)
    assert there.converged
    np.testing.assert_allclose(there.pose, beyond, atol=1e-9)


@machines
def test_jacobian_against_differences(machine):
    rng = np.random.default_rng(2)
    step = 1e-5
    for pose in reachable_poses(machine, 25, seed=3):
        twist = rng.normal(size=6) * np.array([0.05] * 3 + [0.5] * 3)
        before, after = (machine.inverse(moved(pose, twist, t)) for t in (-step, step))
        rates = machine.joint_rates(pose, twist)
        np.testing.assert_allclose((after - before) / (2 * step), rates, rtol=1e-6, atol=1e-8)
        np.testing.assert_allclose(machine.pose_rates(pose, rates), twist, atol=1e-10)
        # And the Euler rates that belong to the twist are the ones of the moved pose.
        euler = (moved(pose, twist, step) - moved(pose, twist, -step)) / (2 * step)
        np.testing.assert_allclose(machine.euler_rates(pose, twist), euler, atol=1e-7)
        np.testing.assert_allclose(machine.twist(pose, euler), twist, atol=1e-7)


@machines
def test_accelerations_against_differences(machine):
    rng = np.random.default_rng(4)
    step = 2e-4
    for pose in reachable_poses(machine, 25, seed=5):
        # A curve of pose coordinates with given first and second derivatives.
        rate, curve = (rng.normal(size=6) * np.array([0.1] * 3 + [1.0] * 3) for _ in range(2))

        def at(time, pose=pose, rate=rate, curve=curve):
            return pose + rate * time + 0.5 * curve * time**2

        def twist(time, at=at, rate=rate, curve=curve):
            return machine.twist(at(time), rate + curve * time)

        twist_rate = (twist(step) - twist(-step)) / (2 * step)
        joints = machine.inverse(np.stack([at(-step), at(0.0), at(step)]))
        expected = (joints[0] - 2 * joints[1] + joints[2]) / step**2
        found = machine.joint_accelerations(pose, twist(0.0), twist_rate)
        np.testing.assert_allclose(found, expected, rtol=2e-5, atol=2e-5)


@machines
def test_statics_by_virtual_work(machine):
    rng = np.random.default_rng(6)
    poses = reachable_poses(machine, 50)
    wrench, twist = rng.normal(size=(50, 6)), rng.normal(size=(50, 6))
    efforts = machine.statics(poses, wrench)
    work = np.sum(efforts * machine.joint_rates(poses, twist), axis=-1) + np.sum(wrench * twist, axis=-1)
    np.testing.assert_allclose(work, 0.0, atol=1e-10)
    weight = machine.statics(machine.home_pose, [0, 0, -30.0, 0, 0, 0])
    np.testing.assert_allclose(weight, [10.0] * 3 + [0.0] * 3, atol=1e-12)


@machines
def test_margins_measure_what_they_name(machine):
    pose = reachable_poses(machine, 1, seed=8)[0]
    margins = machine.margins(pose)
    assert tuple(margins) == MARGINS
    chains = machine.chains(pose)
    normal = rotation_from_euler(pose[3:])[:, 2]
    links = chains.a - chains.g
    for leg in range(3):
        low, high = machine.slider_range_m
        assert margins[f"slider{leg + 1}_lower"] == pytest.approx(chains.joints[leg] - low, abs=1e-14)
        assert margins[f"slider{leg + 1}_upper"] == pytest.approx(high - chains.joints[leg], abs=1e-14)
        angle = np.arccos(-links[leg] @ normal / machine.link_m)
        assert margins[f"cone{leg + 1}"] == pytest.approx(machine.cone_rad - angle, abs=1e-12)
        reach = np.hypot(*links[leg, :2])
        assert margins[f"leg{leg + 1}_closure"] == pytest.approx(machine.link_m - reach, abs=1e-12)
    share = np.linspace(0.0, 1.0, 801)
    for i, j in ((0, 1), (1, 2), (2, 0)):
        first, second = (chains.g[k] + share[:, None] * links[k] for k in (i, j))
        nearest = np.linalg.norm(first[:, None] - second, axis=-1).min()
        found = margins[f"clearance{i + 1}{j + 1}"] + machine.link_clearance_m
        assert found - 1e-12 <= nearest <= found + 2e-4


@machines
def test_platform_lock_is_the_parallel_determinant(machine):
    """det(J) times what the legs contribute is the lock, up to one constant: it vanishes only at singularities."""
    poses = reachable_poses(machine, 200, turn=0.6)
    lock = machine.margins(poses)["platform_lock"] + machine.min_platform_lock
    links = machine.chains(poses)
    serial = np.prod(np.cos(links.swing), axis=-1) * np.prod((links.g - links.a)[..., 2] / machine.link_m, axis=-1)
    ratio = np.linalg.det(machine.jacobian(poses)) * serial / lock
    np.testing.assert_allclose(ratio, ratio[0], rtol=1e-9)
    centre = replace(machine, base_diameter_m=machine.platform_diameter_m)
    assert centre.margins(centre.home_pose)["platform_lock"] + machine.min_platform_lock == pytest.approx(1.0)


def test_unreachable_is_nan_or_a_named_error():
    machine = ThreePRRS.published()
    far = np.array([0.2, 0.0, 0.08, 0.0, 0.0, 0.0])
    assert np.isnan(machine.inverse(far)).any()
    assert not machine.reachable(far)
    assert machine.margins(far)["leg1_closure"] < 0.0
    with pytest.raises(UnreachablePoseError, match="leg1_closure") as error:
        machine.inverse(np.stack([machine.home_pose, far]), strict=True)
    assert error.value.index == (1,)
    high = machine.home_pose + np.array([0, 0, 0.1, 0, 0, 0])
    assert np.isfinite(machine.inverse(high)).all()
    with pytest.raises(UnreachablePoseError, match="slider1_upper"):
        machine.inverse(high, strict=True)
    tilted = machine.home_pose + np.array([0, 0, 0, 0.9, 0, 0])
    with pytest.raises(UnreachablePoseError, match="cone"):
        machine.inverse(tilted, strict=True)
    np.testing.assert_array_equal(machine.inverse(machine.home_pose, strict=True), machine.inverse(machine.home_pose))


def test_singular_poses_give_nan_not_an_exception():
    machine = ThreePRRS.sorter()
    poses = np.stack([machine.home_pose, machine.home_pose])
    poses[1, 0] = 10.0
    assert np.isfinite(machine.statics(poses, np.ones(6))[0]).all()
    assert np.isnan(machine.statics(poses, np.ones(6))[1]).any()
    conditioning = machine.conditioning(poses)
    assert np.isfinite(conditioning.number[0]) and np.isnan(conditioning.number[1])


def test_conditioning_does_not_depend_on_the_unit_of_length():
    machine = ThreePRRS.sorter()
    poses = reachable_poses(machine, 20)
    low, high = machine.slider_range_m
    double = ThreePRRS(0.66, 0.32, 0.32, (2 * low, 2 * high), machine.cone_rad)
    scaled = poses * np.array([2.0] * 3 + [1.0] * 3)
    np.testing.assert_allclose(double.conditioning(scaled).number, machine.conditioning(poses).number, rtol=1e-9)
    with pytest.raises(ValueError, match="length_m"):
        machine.conditioning(poses, length_m=0.0)


def towards(machine, direction, share):
    """The pose a share of the way from home to the workspace's rim in a direction of the six-dimensional space."""
    lower, upper = machine.box()
    step = np.asarray(direction) * np.array([*(upper - lower), 1.2, 1.2, 1.2])
    inside, outside = 0.0, 1.0
    for _ in range(20):
        middle = 0.5 * (inside + outside)
        inside, outside = (
            (middle, outside) if machine.reachable(machine.home_pose + middle * step) else (inside, middle)
        )
    return machine.home_pose + share * inside * step


@settings(max_examples=150, deadline=None)
@given(
    name=st.sampled_from(sorted(MACHINES)),
    direction=st.tuples(*[st.floats(-1.0, 1.0)] * 6),
    share=st.floats(0.0, 1.0),
    offset=st.tuples(*[st.floats(-0.005, 0.005)] * 6),
)
# At the rim a seed beside the pose may lie where a link is too short.
@example("published", (0.0, -1.0, 0.5, -1.0, 0.0, 0.0), 1.0, (0.0, -0.00390625, 0.0, 0.0, 0.0, 0.0))
def test_forward_of_inverse_over_the_reachable_set(name, direction, share, offset):
    machine = MACHINES[name]
    pose = towards(machine, direction, share)
    assert machine.reachable(pose)
    joints = machine.inverse(pose)
    chains = machine.chains(pose)
    np.testing.assert_allclose(np.linalg.norm(chains.a - chains.g, axis=-1), machine.link_m, atol=1e-12)
    assert np.isfinite(machine.jacobian(pose)).all()
    seed = pose + np.array(offset) * np.array([machine.link_m] * 3 + [1.0] * 3)
    result = machine.forward(joints, seed)
    seed_closes = np.isfinite(machine.inverse(seed)).all()
    assert result.converged == seed_closes
    np.testing.assert_allclose(result.pose, pose if seed_closes else np.full(6, np.nan), atol=1e-9)


@machines
@pytest.mark.parametrize("orientation", [(0.0, 0.0, 0.0), (np.deg2rad(15.0), 0.0, 0.0), (0.1, -0.2, 0.4)])
def test_heights_bound_the_reach(machine, orientation):
    lower, upper = machine.box(orientation)
    xy = np.random.default_rng(0).uniform(lower[:2], upper[:2], (500, 2))
    low, high = machine.heights(xy, orientation)
    reachable = machine.reachable_at(orientation)
    for share, inside in ((1e-9, True), (0.5, True), (1.0 - 1e-9, True), (-1e-6, False), (1.0 + 1e-6, False)):
        z = low + share * (high - low)
        np.testing.assert_array_equal(reachable(np.column_stack([xy, z])), np.isfinite(low) & inside)
    empty = xy[np.isnan(low)]
    for z in np.linspace(lower[2], upper[2], 40):
        assert not reachable(np.column_stack([empty, np.full(len(empty), z)])).any()


def test_sorter_holds_what_it_promises():
    machine = ThreePRRS.sorter()
    rng = np.random.default_rng(0)
    count = 20000
    radius, azimuth = 0.15 * np.sqrt(rng.random(count)), rng.uniform(0, 2 * np.pi, count)
    tilt, side = np.deg2rad(15.0) * rng.random(count), rng.uniform(0, 2 * np.pi, count)
    poses = np.column_stack(
        [
            radius * np.cos(azimuth),
            radius * np.sin(azimuth),
            rng.uniform(0.0, 0.10, count),
            tilt * np.cos(side),
            tilt * np.sin(side),
            rng.uniform(-1.0, 1.0, count) * np.deg2rad(45.0),
        ]
    )
    assert machine.reachable(poses).all()
    assert machine.conditioning(poses[:2000]).smallest.min() > 0.8
    poses[:, :2] *= 0.20 / 0.15
    poses[:, 3:] = 0.0
    assert machine.reachable(poses).all()


def test_sorter_is_what_the_script_finds():
    from fieldgym.scripts.synthesise_sorter import evaluate, required_poses

    poses = required_poses()
    found = evaluate(0.330, 0.160, poses)
    assert found is not None and found.machine == ThreePRRS.sorter()
    assert all(evaluate(0.325, base_mm / 1000, poses) is None for base_mm in range(160, 400, 20))


def test_hoe_is_what_the_script_finds():
    from fieldgym.scripts.synthesise_sorter import evaluate, required_hoe_poses

    poses = required_hoe_poses()
    found = evaluate(0.345, 0.160, poses)
    assert found is not None and found.machine == ThreePRRS.hoe()
    assert all(evaluate(0.340, base_mm / 1000, poses) is None for base_mm in range(160, 400, 20))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"link_m": 0.0}, "l = 0.0"),
        ({"base_diameter_m": 0.5}, "further apart"),
        ({"slider_range_m": (0.2, 0.1)}, "slider_range_m"),
        ({"cone_rad": 0.0}, "cone_rad"),
        ({"link_clearance_m": -1.0}, "link_clearance_m"),
        ({"min_platform_lock": 1.0}, "min_platform_lock"),
    ],
)
def test_bad_dimensions_are_named(change, message):
    with pytest.raises(ValueError, match=message):
        replace(ThreePRRS.published(), **change)


def test_wrong_shapes_are_named():
    with pytest.raises(ValueError, match="pose has shape"):
        ThreePRRS.published().inverse([0.0, 0.0, 0.1])
