"""Minimum-time motion along paths: limits, optimality, and TOPP-RA as the oracle."""

from typing import Any

import numpy as np
import pytest

from fieldgym.motion import Bezier, CurvedPath, SCurve, gate_corners, minimum_time, polyline, rounded
from fieldgym.motion.minimum_time import squared_speeds

GATE = gate_corners((0.0, 0.0), (0.6, 0.0), 0.15)
WAVE = CurvedPath(
    (
        Bezier(np.array([[0.0, 0.0], [0.0, 0.15], [0.1, 0.2], [0.2, 0.2]])),
        Bezier(np.array([[0.2, 0.2], [0.3, 0.2], [0.35, 0.05], [0.45, 0.05], [0.55, 0.05], [0.6, 0.2]])),
    )
)
V, A = 4.5, 60.0


def peaks(motion, points=20_001):
    time = np.linspace(0.0, motion.duration_s, points)
    state = motion.sample(time)
    jerk = np.diff(state.acceleration, axis=0) / (time[1] - time[0])
    return [float(np.max(np.linalg.norm(x, axis=-1))) for x in (state.velocity, state.acceleration, jerk)]


@pytest.mark.parametrize("path", [polyline(GATE), rounded(GATE, 0.1), rounded(GATE, 0.1, "smooth"), WAVE])
@pytest.mark.parametrize(("v", "a"), [(4.5, 60.0), (1.0, 60.0), (50.0, 10.0)])
def test_limits_hold_and_one_of_them_is_always_met(path, v, a):
    motion = minimum_time(path, v, a, nodes=1000)
    velocity, acceleration, _ = peaks(motion)
    assert velocity <= v * (1.0 + 1e-9) and acceleration <= a * (1.0 + 1e-5)
    ends = path.at([0.0, path.length_m]).position
    np.testing.assert_allclose(motion.sample([0.0, motion.duration_s]).position, ends, atol=1e-12)
    # Bang-bang: at nearly every instant the speed or the acceleration is at its limit.
    state = motion.sample((np.arange(4000) + 0.5) / 4000 * motion.duration_s)
    use = np.maximum(np.linalg.norm(state.velocity, axis=-1) / v, np.linalg.norm(state.acceleration, axis=-1) / a)
    assert np.mean(use > 0.98) > 0.97


@pytest.mark.parametrize(
    ("path", "within"), [(rounded(GATE, 0.05), 1.001), (rounded(GATE, 0.15), 1.001), (WAVE, 1.003)]
)
def test_the_time_converges_from_above(path, within):
    times = [minimum_time(path, V, A, nodes=n).duration_s for n in (50, 200, 800, 3200)]
    assert times == sorted(times, reverse=True)
    assert times[1] < within * times[3] and times[2] < 1.001 * times[3]


def test_fields_are_derivatives_of_each_other():
    motion = minimum_time(WAVE, V, A)
    time, h = np.linspace(0.0, motion.duration_s, 500)[1:-1], 1e-6
    along = motion.along(time)
    np.testing.assert_allclose(
        (motion.along(time + h).position - motion.along(time - h).position) / (2 * h), along.velocity, atol=1e-4
    )
    state = motion.sample(time)
    slope = (motion.sample(time + h).position - motion.sample(time - h).position) / (2 * h)
    np.testing.assert_allclose(slope, state.velocity, atol=1e-3)


def toppra_duration(path, v, a, gridpoints=400):
    """TOPP-RA with the disc of accelerations as a polygon of 128 sides (from outside: at most 0.03 % too wide)."""
    toppra = pytest.importorskip("toppra")
    from toppra import algorithm, constraint

    toppra.setup_logging("ERROR")

    class Curve(toppra.interpolator.AbstractGeometricPath):
        """Our path by arc length, so both sides see the same curve."""

        dof = path.at([0.0]).position.shape[-1]
        path_interval = np.array([0.0, path.length_m])
        waypoints = None

        def __call__(self, s, order=0):
            values = path.at(np.atleast_1d(s))[order]
            return values[0] if np.ndim(s) == 0 else values

    angles = np.arange(128) * 2.0 * np.pi / 128
    faces, bounds = np.stack([np.cos(angles), np.sin(angles)], axis=-1), np.full(128, a)

    def speed_box(s):
        # By arc length the speed is ds/dt: bounding one direction of the box suffices.
        reach = v * np.abs(path.at([s]).tangent[0]) + 1e-12
        return np.stack([-reach, reach], axis=-1)

    speed = constraint.JointVelocityConstraintVarying(speed_box)
    force = constraint.SecondOrderConstraint(
        lambda q, qd, qdd: qdd, lambda q: faces, lambda q: bounds, 2, discretization_scheme=1
    )
    grid = np.unique(np.concatenate([np.linspace(0.0, path.length_m, gridpoints), path.offsets]))
    solver = algorithm.TOPPRA([speed, force], Curve(), gridpoints=grid, parametrizer="ParametrizeConstAccel")
    trajectory: Any = solver.compute_trajectory(0.0, 0.0)
    return trajectory.duration


@pytest.mark.parametrize(
    ("path", "v", "a"),
    [
        (rounded(GATE, 0.1, "smooth"), 4.5, 60.0),
        (rounded(GATE, 0.1, "smooth"), 1.5, 60.0),
        (rounded(GATE, 0.14, "smooth"), 20.0, 30.0),
        (WAVE, 4.5, 60.0),
        (WAVE, 2.0, 100.0),
    ],
    ids=["gate", "slow gate", "weak gate", "wave", "slow wave"],
)
def test_times_agree_with_toppra(path, v, a):
    assert minimum_time(path, v, a).duration_s == pytest.approx(toppra_duration(path, v, a), rel=0.01)


def test_straight_legs_are_exact_and_stop_at_corners():
    legs = SCurve.under_limits([0.15, 0.6, 0.15], V, A)
    motion = minimum_time(polyline(GATE), V, A)
    assert motion.duration_s == pytest.approx(float(np.sum(legs.duration_s)), rel=1e-13)
    corners = np.cumsum(legs.duration_s)[:2]
    np.testing.assert_allclose(motion.sample(corners).position, GATE[1:3], atol=1e-9)
    assert peaks(motion)[0] <= V * (1 + 1e-12)
    limited = minimum_time(polyline(GATE), V, A, 3000.0)
    expected = np.sum(SCurve.under_limits([0.15, 0.6, 0.15], V, A, 3000.0).duration_s)
    assert limited.duration_s == pytest.approx(float(expected), rel=1e-12)
    assert peaks(limited)[2] <= 3000.0 * (1 + 1e-6)


def test_a_long_arc_is_driven_at_the_speed_that_its_curvature_allows():
    """On a circle the speed limit is sqrt(a r), reached and left as fast as the rest of the acceleration allows."""
    radius, turns = 0.1, 0.5 * np.pi
    path = rounded([[0.0, 0.0], [0.0, 0.101], [0.101, 0.101]], radius)
    motion = minimum_time(path, 100.0, 10.0, nodes=2000)
    # z' = 2 sqrt(a^2 - (z/r)^2) from z = 0: z = a r sin(2 s / r), so the top is passed at s = pi r / 4.
    quarter = motion.along(np.interp(0.001 + 0.25 * np.pi * radius, motion.arc_m, motion.time_s))
    assert float(quarter.velocity[0]) ** 2 == pytest.approx(10.0 * radius, rel=2e-3)
    assert path.length_m == pytest.approx(0.002 + radius * turns)


@pytest.mark.parametrize("jerk", [1e6, 1e4, 1e3, 100.0])
@pytest.mark.parametrize("path", [rounded(GATE, 0.1, "smooth"), rounded(GATE, 0.05, "smooth")])
def test_a_jerk_limit_holds_everywhere(path, jerk):
    motion = minimum_time(path, V, A, jerk)
    velocity, acceleration, jolt = peaks(motion)
    assert velocity <= V * (1 + 1e-6) and acceleration <= A * (1 + 1e-4) and jolt <= jerk * (1 + 1e-3)
    # Some limit is met: slowing was not overdone.
    assert max(velocity / V, np.sqrt(acceleration / A), np.cbrt(jolt / jerk)) > 0.98
    assert motion.duration_s >= minimum_time(path, V, A).duration_s
    np.testing.assert_allclose(motion.sample([motion.duration_s]).position, GATE[-1:], atol=1e-9)


def test_a_jerk_limit_on_a_curvature_jump_is_refused():
    with pytest.raises(ValueError, match=r"curvature jumps at s = 0\.05 m"):
        minimum_time(rounded(GATE, 0.1), V, A, 1e4)


def test_batched_sweeps_equal_single_ones_bit_for_bit():
    rng = np.random.default_rng(0)
    steps, curvature = rng.uniform(0.0, 0.01, (6, 80)), rng.uniform(0.0, 40.0, (6, 80))
    rest = np.zeros((6, 81), dtype=bool)
    rest[:, [0, 30, 80]] = True
    v, a = rng.uniform(1.0, 5.0, 6), rng.uniform(5.0, 60.0, 6)
    batch = squared_speeds(steps, curvature, rest, v[:, None], a)
    for row in range(6):
        single = squared_speeds(steps[row], curvature[row], rest[row], v[row], a[row])
        np.testing.assert_array_equal(batch[row], single)
    # Each step keeps the acceleration limit at both of its ends.
    tangential = np.diff(batch, axis=-1) / (2.0 * steps)
    tighter = curvature * np.maximum(batch[:, 1:], batch[:, :-1])
    assert np.max(np.hypot(tangential, tighter) / a[:, None]) <= 1.0 + 1e-9


def test_a_slowed_motion_is_the_same_path_in_more_time():
    motion = minimum_time(WAVE, V, A)
    slow = motion.slowed(2.0)
    assert slow.duration_s == 2.0 * motion.duration_s
    time = np.linspace(0.0, motion.duration_s, 50)
    np.testing.assert_allclose(slow.sample(2.0 * time).position, motion.sample(time).position, atol=1e-12)
    assert peaks(slow)[1] == pytest.approx(peaks(motion)[1] / 4.0)


def test_bad_limits_are_named():
    with pytest.raises(ValueError, match=r"jerk_limit = -1\.0 must be positive"):
        minimum_time(WAVE, V, A, -1.0)
    with pytest.raises(ValueError, match="nodes = 1"):
        minimum_time(WAVE, V, A, nodes=1)
