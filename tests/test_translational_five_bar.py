"""The transplanter's five-bar: the corrected equations of its paper, its window and its motor torques."""

import numpy as np
import pytest

from fieldgym.mechanisms import LinkMasses, TranslationalFiveBar

BAR = TranslationalFiveBar.transplanter()
E, L1, L2 = BAR.motor_offset_m, BAR.arm_m, BAR.forearm_m
GRAVITY = 9.81
assert BAR.masses is not None
MASSES = BAR.masses


def window_poses(count, seed=0):
    return np.random.default_rng(seed).uniform(*BAR.window_m, (count, 2))


def coefficients(poses):
    """A, B, C of the loop equation A sin + B cos + C = 0, for both legs."""
    sign = np.array([1.0, -1.0])
    x, y = poses[:, :1], poses[:, 1:]
    a = np.broadcast_to(-2.0 * L1 * y, (len(poses), 2))
    b = -2.0 * L1 * (x - sign * E)
    c = x**2 + y**2 + E**2 + L1**2 - L2**2 - 2.0 * sign * E * x
    return a, b, c


def test_inverse_agrees_with_the_corrected_equation_12():
    poses = window_poses(400)
    a, b, c = coefficients(poses)
    theta = np.arctan2(a, b) - np.array([1.0, -1.0]) * np.arccos(-c / np.hypot(a, b))
    difference = np.angle(np.exp(1j * (BAR.inverse(poses) - theta)))
    assert np.max(np.abs(difference)) < 1e-12


def test_angles_solve_the_loop_equation_11():
    poses = window_poses(400)
    theta = BAR.inverse(poses)
    for leg, sign in enumerate((1.0, -1.0)):
        rest = poses - sign * E * np.array([1.0, 0.0]) - L1 * np.stack([np.cos(theta), np.sin(theta)], -1)[:, leg]
        np.testing.assert_allclose(np.linalg.norm(rest, axis=-1), L2, rtol=0, atol=1e-12)


def test_where_the_printed_equation_12_is_0_over_0_the_inverse_is_smooth():
    """C = B on a circle through the window; for leg 1 the printed numerator vanishes there too."""
    # C - B = (x - e + l1)^2 + y^2 - l2^2: pointing the arm to -x closes the leg as well, with the elbow inwards.
    y = -0.60
    x = E - L1 + np.sqrt(L2**2 - y**2)
    a, b, c = (values[0, 0] for values in coefficients(np.array([[x, y]])))
    assert abs(c - b) < 1e-15
    assert abs(-a + np.sqrt(a * a + b * b - c * c)) < 1e-15
    near = np.array([[x + h, y] for h in (-1e-7, 0.0, 1e-7)])
    theta = BAR.inverse(near)[:, 0]
    assert theta[0] + theta[2] == pytest.approx(2.0 * theta[1], abs=1e-12)
    assert np.max(np.abs(BAR.forward(BAR.inverse(near)) - near)) < 1e-12


def test_jacobian_agrees_with_the_corrected_equations_13_and_15():
    poses = window_poses(100)
    pose = BAR._pose(poses)
    u = np.stack([np.cos(pose.arm), np.sin(pose.arm)], axis=-1)
    w = np.stack([np.cos(pose.forearm), np.sin(pose.forearm)], axis=-1)
    qu = np.stack([-u[..., 1], u[..., 0]], axis=-1)
    j = w / (L1 * np.sum(w * qu, axis=-1, keepdims=True))
    np.testing.assert_allclose(BAR.jacobian(poses), j, rtol=1e-10, atol=1e-12)


def test_accelerations_agree_with_the_corrected_equation_14():
    poses = window_poses(100)
    rng = np.random.default_rng(1)
    v, a = 3.0 * rng.normal(size=poses.shape), 40.0 * rng.normal(size=poses.shape)
    pose = BAR._pose(poses)
    u = np.stack([np.cos(pose.arm), np.sin(pose.arm)], axis=-1)
    w = np.stack([np.cos(pose.forearm), np.sin(pose.forearm)], axis=-1)
    qu, qw = (np.stack([-n[..., 1], n[..., 0]], axis=-1) for n in (u, w))
    rate = BAR.joint_rates(poses, v)
    passive = np.sum(qw * (v[:, None] - L1 * qu * rate[..., None]), axis=-1) / L2
    push = np.sum(w * a[:, None], -1) + L1 * rate**2 * np.sum(w * u, -1) + L2 * passive**2
    np.testing.assert_allclose(
        BAR.joint_accelerations(poses, v, a), push / (L1 * np.sum(w * qu, -1)), rtol=1e-9, atol=1e-9
    )


def test_the_window_is_600_by_150_mm_reachable_and_well_conditioned():
    (left, bottom), (right, top) = BAR.window_m
    assert (right - left, top - bottom, top) == pytest.approx((0.600, 0.150, -0.510))
    grid = BAR.window_grid(121, 31)
    assert np.all(BAR.reachable(grid))
    number, smallest, _ = BAR.conditioning(grid)
    assert np.max(number) == pytest.approx(1.222, abs=5e-4)
    assert np.rad2deg(np.min(BAR.transmission_angles(grid)[..., 2])) == pytest.approx(78.8, abs=0.05)
    assert 4.5 / np.min(smallest) == pytest.approx(16.5, abs=0.05)


# --- torques ---------------------------------------------------------------------------------------------------------


def bodies(tool, payload):
    """Masses with their positions, inertias with their angles, from triangles alone."""
    m = MASSES
    points, turns = [(m.platform_kg + payload, tool)], []
    for sign in (1.0, -1.0):
        motor = np.array([sign * E, 0.0])
        span = tool - motor
        length = np.hypot(*span)
        inner = np.arccos((length**2 + L1**2 - L2**2) / (2.0 * length * L1))
        angle = np.arctan2(span[1], span[0]) + sign * inner
        elbow = motor + L1 * np.array([np.cos(angle), np.sin(angle)])
        forearm = tool - elbow
        points += [
            (m.arm_kg, motor + m.arm_centre * (elbow - motor)),
            (m.elbow_kg, elbow),
            (m.forearm_kg, elbow + m.forearm_centre * forearm),
        ]
        turns += [
            (m.arm_inertia_kg_m2 + m.rotor_inertia_kg_m2, angle),
            (m.forearm_inertia_kg_m2, np.arctan2(forearm[1], forearm[0])),
        ]
    return points, turns


def mass_matrix(tool, payload, step=1e-5):
    """Kinetic energy v.M.v / 2 from differentiated body positions."""
    result = np.zeros((2, 2))
    ahead, behind = ([bodies(tool + s * step * axis, payload) for axis in np.eye(2)] for s in (1.0, -1.0))
    for kind in (0, 1):
        for body in range(len(ahead[0][kind])):
            partial = np.stack(
                [np.atleast_1d(ahead[i][kind][body][1] - behind[i][kind][body][1]) / (2.0 * step) for i in range(2)], -1
            )
            result += ahead[0][kind][body][0] * partial.T @ partial
    return result


def potential(tool, payload):
    return sum(mass * GRAVITY * position[1] for mass, position in bodies(tool, payload)[0])


def lagrange_torques(tool, velocity, acceleration, payload, step=1e-4):
    slopes = [
        (mass_matrix(tool + step * axis, payload) - mass_matrix(tool - step * axis, payload)) / (2.0 * step)
        for axis in np.eye(2)
    ]
    pull = [
        (potential(tool + step * axis, payload) - potential(tool - step * axis, payload)) / (2.0 * step)
        for axis in np.eye(2)
    ]
    changing = (slopes[0] * velocity[0] + slopes[1] * velocity[1]) @ velocity
    own = 0.5 * np.array([velocity @ slope @ velocity for slope in slopes])
    force = mass_matrix(tool, payload) @ acceleration + changing - own + pull
    return np.linalg.solve(BAR.jacobian(tool).T, force)


def test_torques_are_those_of_lagranges_equations():
    poses = window_poses(20)
    rng = np.random.default_rng(2)
    v, a, payload = 2.0 * rng.normal(size=poses.shape), 30.0 * rng.normal(size=poses.shape), 0.3 * rng.random(20)
    expected = [lagrange_torques(*row) for row in zip(poses, v, a, payload, strict=True)]
    np.testing.assert_allclose(BAR.inverse_dynamics(poses, v, a, payload), expected, rtol=2e-6, atol=2e-6)


def test_motor_power_is_the_change_of_energy():
    poses = window_poses(50, seed=3)
    rng = np.random.default_rng(3)
    v, a = 2.0 * rng.normal(size=poses.shape), 30.0 * rng.normal(size=poses.shape)

    def energy(t):
        tools, speeds = poses + t * v + 0.5 * t * t * a, v + t * a
        kinetic = [0.5 * s @ mass_matrix(r, 0.3) @ s for r, s in zip(tools, speeds, strict=True)]
        return np.array(kinetic) + [potential(r, 0.3) for r in tools]

    h = 1e-4
    power = np.sum(BAR.inverse_dynamics(poses, v, a, 0.3) * BAR.joint_rates(poses, v), axis=-1)
    np.testing.assert_allclose(power, (energy(h) - energy(-h)) / (2.0 * h), rtol=1e-5, atol=1e-3)


def test_a_resting_payload_costs_what_statics_says():
    poses, zero = window_poses(50), np.zeros((50, 2))
    loaded = BAR.inverse_dynamics(poses, zero, zero, 0.3) - BAR.inverse_dynamics(poses, zero, zero)
    np.testing.assert_allclose(loaded, BAR.statics(poses, np.tile([0.0, -0.3 * GRAVITY], (50, 1))), rtol=1e-9)


def test_torques_broadcast_and_scale_with_all_masses():
    poses, still = BAR.window_grid(5, 3), np.zeros(2)
    pull = BAR.inverse_dynamics(poses, still, np.array([10.0, 0.0]))
    assert pull.shape == (3, 5, 2)
    once = vars(MASSES)
    masses = LinkMasses(**{name: value if name.endswith("centre") else 2.0 * value for name, value in once.items()})
    double = TranslationalFiveBar(E, L1, L2, BAR.window_m, masses)
    np.testing.assert_allclose(double.inverse_dynamics(poses, still, np.array([10.0, 0.0])), 2.0 * pull, rtol=1e-12)


def test_a_machine_without_masses_says_so():
    bare = TranslationalFiveBar(E, L1, L2, BAR.window_m)
    with pytest.raises(ValueError, match="has no masses"):
        bare.inverse_dynamics([0.0, -0.6], [0.0, 0.0], [0.0, 0.0])


def test_impossible_geometry_is_refused_by_name():
    with pytest.raises(ValueError, match=r"arm_m = -0\.36 m is not a length"):
        TranslationalFiveBar(E, -L1, L2, BAR.window_m)
    with pytest.raises(ValueError, match=r"window_m = .* rectangle below y = 0"):
        TranslationalFiveBar(E, L1, L2, ((0.3, -0.6), (-0.3, -0.5)))
    with pytest.raises(ValueError, match=r"arm_kg = -1\.0"):
        LinkMasses.of_uniform_bars(-1.0, L1, 0.5, L2, 0.2, 0.8, 0.0)
